"""Faces of the kernel as polygons in the planes of their parameters, whose corners along edges are shared by number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAbs import GeomAbs_C1, GeomAbs_Line, GeomAbs_Plane
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.boundary import part_surface
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, RealArray, as_edge, as_face, as_vertex, as_wire
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.mesh.triangles.outlined import Outline
from gyroid_cad.mesh.triangles.trimmed import FaceTriangles, triangulated_faces
from gyroid_cad.nurbs.surface import NurbsSurface, point_derivatives
from gyroid_cad.trim.surfaces import PartSurface

__all__ = ["face_triangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Between the places measured a triangle may be further off: of a quadratic surface by at most 3 %.
_MARGIN = 1.05
# Chords along a smooth piece of an edge from which it is told how many it takes, each with a place in its middle.
_CHORDS = 8
_MOST_CHORDS = 4096
# Of an edge shrunk to a point in the plane of the parameters.
_AT_POLE = 32
# Borders that cross in the plane of the parameters are looked at again with twice the chords, so many times.
_FINER = 4
_PLACES_AT_ONCE = 2**15
# In parts of the parameters' range: places that are one.
_SAME = 1e-6


def face_triangles(faces: Sequence[TopoDS_Face], deviation: float, angle: float) -> FaceTriangles:
    """Triangles of faces, with the places along an edge shared by all that it bounds; turned as the faces are.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
    deviation : float
        Largest distance of a triangle from its face, in mm.
    angle : float
        Largest angle between neighbouring triangles within a face, and chords along an edge, in radians.

    Raises
    ------
    KernelError
        If a face has no border, or one that does not close in the plane of its parameters.
    """
    limit = deviation / _MARGIN
    read = _Faces(faces)
    edges = _Edges(read.edges, read.vertices, limit, angle)
    for _ in range(_FINER):
        outlines = [read.outline(index, edges) for index in range(len(faces))]
        made = triangulated_faces(outlines, read, edges.points, limit, angle)
        if not made.crossed.any():
            break
        edges.halve({use for face in np.flatnonzero(made.crossed).tolist() for use in read.edges_of(face)})
    backwards = np.array([face.Orientation() == TopAbs_REVERSED for face in faces])[made.faces]
    triangles = np.where(backwards[:, np.newaxis], made.triangles[:, ::-1], made.triangles)
    return FaceTriangles(made.vertices, triangles, made.faces, made.crossed)


@dataclass(frozen=True, slots=True, eq=False)
class _Splines:
    """B-spline surfaces that differ by their control points alone."""

    first: NurbsSurface
    nets: Floats


class _Faces:
    """Faces: their surfaces, and the edges round them in order."""

    def __init__(self, faces: Sequence[TopoDS_Face]) -> None:
        self.edges, self.vertices = NumberedShapes(), NumberedShapes()
        self._forward = [as_face(face.Oriented(TopAbs_FORWARD)) for face in faces]
        for face in faces:
            TopExp.MapShapes_s(face, TopAbs_EDGE, self.edges)
            TopExp.MapShapes_s(face, TopAbs_VERTEX, self.vertices)
        self._loops = [self._wires(face) for face in self._forward]
        self._others: dict[int, PartSurface] = {}
        self._planes: set[int] = set()
        self._read_surfaces()

    def edges_of(self, face: int) -> Iterator[int]:
        """Numbers of the edges round a face."""
        return (number for loop in self._loops[face] for number, _ in loop)

    def _wires(self, face: TopoDS_Face) -> list[list[tuple[int, TopoDS_Edge]]]:
        loops = []
        for wire in parts_of(face, TopAbs_WIRE):
            loop = [(int(self.edges.FindIndex(edge)) - 1, as_edge(edge)) for edge in parts_of(wire, TopAbs_EDGE)]
            ends = [(TopExp.FirstVertex_s(edge, True), TopExp.LastVertex_s(edge, True)) for _, edge in loop]
            numbers = [tuple(self.vertices.FindIndex(vertex) for vertex in pair) for pair in ends]
            distinct = len({start for start, _ in numbers}) == len(numbers)
            if not distinct or any(numbers[k - 1][1] != numbers[k][0] for k in range(len(numbers))):
                loop = self._in_order(wire, face, len(loop))
            loops.append(loop)
        if not loops:
            raise KernelError("a face without a border has no triangles")
        return loops

    def _in_order(self, wire: TopoDS_Shape, face: TopoDS_Face, count: int) -> list[tuple[int, TopoDS_Edge]]:
        explorer, loop = BRepTools_WireExplorer(as_wire(wire), face), []
        while explorer.More():
            edge = explorer.Current()
            loop.append((int(self.edges.FindIndex(edge)) - 1, edge))
            explorer.Next()
        if len(loop) != count:
            raise KernelError("a border of a face does not close")
        return loop

    # Surfaces -------------------------------------------------------------------------------------------------------

    def _read_surfaces(self) -> None:
        surfaces: dict[int, tuple[Geom_BSplineSurface, NurbsSurface]] = {}
        alike: dict[tuple[bytes, ...], list[tuple[int, NurbsSurface]]] = {}
        self.domains: dict[int, tuple[Floats, Floats]] = {}
        for index, face in enumerate(self._forward):
            location = TopLoc_Location()
            surface = BRep_Tool.Surface_s(face, location)
            if not isinstance(surface, Geom_BSplineSurface) or surface.IsUPeriodic() or surface.IsVPeriodic():
                adaptor = BRepAdaptor_Surface(face, True)
                low = np.array([adaptor.FirstUParameter(), adaptor.FirstVParameter()])
                high = np.array([adaptor.LastUParameter(), adaptor.LastVParameter()])
                self._others[index] = part_surface(adaptor, (low, high))
                if adaptor.GetType() == GeomAbs_Plane:
                    self._planes.add(index)
                continue
            if id(surface) not in surfaces:
                # Kept alive, so that its id stays its own.
                surfaces[id(surface)] = surface, nurbs_of_surface(surface)
            own = surfaces[id(surface)][1]
            key = (own.knots_u.tobytes(), own.knots_v.tobytes(), own.weights.tobytes())
            alike.setdefault(key, []).append((index, _placed(own, location)))
            self.domains[index] = (
                np.array([own.knots_u[0], own.knots_v[0]]),
                np.array([own.knots_u[-1], own.knots_v[-1]]),
            )
        self._groups = [
            _Splines(members[0][1], np.stack([own.control_points for _, own in members])) for members in alike.values()
        ]
        self._group, self._member = np.full((2, len(self._forward)), -1)
        for number, members in enumerate(alike.values()):
            for place, (index, _) in enumerate(members):
                self._group[index], self._member[index] = number, place

    def evaluated(self, faces: Integers, places: Floats) -> tuple[Floats, Floats]:
        """As of :class:`gyroid_cad.mesh.triangles.outlined.Surfaces`."""
        points, normals = np.empty((2, len(faces), 3))
        order = np.argsort(faces, kind="stable")
        own, first, counts = np.unique(faces[order], return_index=True, return_counts=True)
        # Of each group, faces with like numbers of places together.
        ranked = np.lexsort([counts, self._group[own]])
        own, first, counts = own[ranked], first[ranked], counts[ranked]
        start = 0
        while start < len(own):
            group = int(self._group[own[start]])
            if group < 0:
                rows = order[first[start] : first[start] + counts[start]]
                surface = self._others[int(own[start])]
                points[rows], normals[rows] = surface.points(places[rows]), surface.area_vectors(places[rows])
                start += 1
                continue
            end = start + 1
            while (
                end < len(own)
                and self._group[own[end]] == group
                and counts[end] * (end + 1 - start) <= max(_PLACES_AT_ONCE, counts[start])
            ):
                end += 1
            most = int(counts[end - 1])
            index = np.minimum(np.arange(most), counts[start:end, np.newaxis] - 1) + first[start:end, np.newaxis]
            rows = order[index]
            splines = self._groups[group]
            found = point_derivatives(
                splines.nets[self._member[own[start:end]]],
                splines.first.weights,
                (splines.first.knots_u, splines.first.knots_v),
                places[rows, 0],
                places[rows, 1],
            )
            points[rows], normals[rows] = found[0], np.cross(found[1], found[2])
            start = end
        return points, normals

    # Outlines -------------------------------------------------------------------------------------------------------

    def outline(self, face: int, edges: _Edges) -> Outline:
        """Border of a face, with the places that its edges have now."""
        loops = []
        for loop in self._loops[face]:
            places, numbers = [], []
            for number, edge in loop:
                forward = edge.Orientation() == TopAbs_FORWARD
                own = self._places(face, number, edge, edges)
                ids = edges.numbers(number)
                places.append((own if forward else own[::-1])[:-1])
                numbers.append((ids if forward else ids[::-1])[:-1])
            loops.append((np.concatenate(places), np.concatenate(numbers)))
        square = self._square(face, edges)
        if square is None:
            return Outline(loops)
        turn, steps = square
        return Outline([(np.roll(loops[0][0], -turn, axis=0), np.roll(loops[0][1], -turn))], steps)

    def _places(self, face: int, number: int, edge: TopoDS_Edge, edges: _Edges) -> Floats:
        """Parameters of the places along an edge, as the edge runs."""
        if face in self._planes:
            plane = self._others[face]
            return np.asarray(plane.distances(edges.points[edges.numbers(number)])[2])
        curve = BRepAdaptor_Curve2d(edge, self._forward[face])
        first, last = curve.FirstParameter(), curve.LastParameter()
        along = first + edges.parts(number) * (last - first)
        if curve.GetType() == GeomAbs_Line:
            line = curve.Line()
            return np.asarray(line.Location().Coord() + along[:, np.newaxis] * np.array(line.Direction().Coord()))
        return np.array([curve.Value(t).Coord() for t in along.tolist()])

    def _square(self, face: int, edges: _Edges) -> tuple[int, tuple[int, int, int, int]] | None:
        """Corner of a whole patch's border at its lowest parameters, and the border's steps; None of any other face."""
        loops = self._loops[face]
        if len(loops) != 1 or len(loops[0]) != 4 or face not in self.domains:
            return None
        numbers = [number for number, _ in loops[0]]
        if len(set(numbers)) < 4 or not all(edges.even(number) for number in numbers):
            return None
        low, high = self.domains[face]
        corners = []
        for _, edge in loops[0]:
            curve = BRepAdaptor_Curve2d(edge, self._forward[face])
            if curve.GetType() != GeomAbs_Line:
                return None
            forward = edge.Orientation() == TopAbs_FORWARD
            at = curve.Value(curve.FirstParameter() if forward else curve.LastParameter()).Coord()
            corners.append((np.array(at) - low) / (high - low))
        for turn in range(4):
            expected = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
            if np.abs(np.roll(corners, -turn, axis=0) - expected).max() < _SAME:
                steps = [edges.steps(number) for number in [*numbers[turn:], *numbers[:turn]]]
                first = sum(edges.steps(number) for number in numbers[:turn])
                return first, (steps[0], steps[1], steps[2], steps[3])
        return None


def _placed(surface: NurbsSurface, location: TopLoc_Location) -> NurbsSurface:
    if location.IsIdentity():
        return surface
    transformation = location.Transformation()
    rows = np.array([[transformation.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    return surface.transformed(rows[:, :3], rows[:, 3])


class _Edges:
    """Edges as chords: smooth pieces, how many chords each has, and the places between these."""

    def __init__(self, edges: NumberedShapes, vertices: NumberedShapes, limit: float, angle: float) -> None:
        count, corners = int(edges.Extent()), int(vertices.Extent())
        shapes = [as_edge(edges.FindKey(k).Oriented(TopAbs_FORWARD)) for k in range(1, count + 1)]
        self._ends = np.array(
            [
                [vertices.FindIndex(which(edge)) - 1 for which in (TopExp.FirstVertex_s, TopExp.LastVertex_s)]
                for edge in shapes
            ],
            dtype=np.int64,
        ).reshape(-1, 2)
        if (self._ends < 0).any():
            raise KernelError("an edge that ends nowhere has no triangles")
        self._corners = np.array(
            [BRep_Tool.Pnt_s(as_vertex(vertices.FindKey(k))).Coord() for k in range(1, corners + 1)]
        ).reshape(-1, 3)
        self._curves: list[Any] = [
            None if BRep_Tool.Degenerated_s(edge) else BRepAdaptor_Curve(edge) for edge in shapes
        ]
        self._breaks = [_breaks(curve) for curve in self._curves]
        self._counts = self._enough(limit, angle)
        self._lay()

    def _enough(self, limit: float, angle: float) -> list[Integers]:
        """Chords of each piece of each edge: one of a line, of others as many as it takes."""
        bent = [
            (edge, piece, curve)
            for edge, curve in enumerate(self._curves)
            if curve is not None and curve.GetType() != GeomAbs_Line
            for piece in range(len(self._breaks[edge]) - 1)
        ]
        fractions = np.linspace(0, 1, 2 * _CHORDS + 1)
        samples = np.empty((len(bent), len(fractions), 3))
        for row, (edge, piece, curve) in enumerate(bent):
            first, last = self._breaks[edge][piece : piece + 2].tolist()
            samples[row] = [curve.Value(t).Coord() for t in (first + fractions * (last - first)).tolist()]
        chords = samples[:, 2::2] - samples[:, :-2:2]
        away = samples[:, 1::2] - samples[:, :-2:2]
        length = np.maximum(np.linalg.norm(chords, axis=-1), np.finfo(float).tiny)
        off = np.linalg.norm(np.cross(away, chords), axis=-1) / length
        sides = np.diff(samples, axis=1)
        sides /= np.maximum(np.linalg.norm(sides, axis=-1, keepdims=True), np.finfo(float).tiny)
        turned = np.arccos(np.clip(np.sum(sides[:, 1:] * sides[:, :-1], axis=-1), -1, 1)).max(axis=1, initial=0.0)
        wanted = np.maximum(_CHORDS * np.sqrt(off.max(axis=1, initial=0.0) / limit), 2 * _CHORDS * turned / angle).clip(
            1, _MOST_CHORDS
        )
        counts = [np.ones(len(breaks) - 1, dtype=np.int64) for breaks in self._breaks]
        for (edge, piece, _), value in zip(bent, np.ceil(wanted - 1e-9).astype(np.int64).tolist(), strict=True):
            counts[edge][piece] = value
        keys = np.sort(self._ends, axis=1)
        _, which, uses = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
        for edge, shared in enumerate((uses[which.ravel()] > 1).tolist()):
            if self._curves[edge] is None:
                counts[edge][:] = _AT_POLE
            elif self._ends[edge, 0] == self._ends[edge, 1]:
                counts[edge] = np.maximum(counts[edge], 4)
            elif shared and self._curves[edge].GetType() != GeomAbs_Line:
                # Else two edges between the same vertices may be one chord.
                counts[edge] = np.maximum(counts[edge], 2)
        return counts

    def halve(self, edges: set[int]) -> None:
        """Give edges twice the chords."""
        for edge in edges:
            if self._curves[edge] is not None:
                self._counts[edge] = 2 * self._counts[edge]
        self._lay()

    def _lay(self) -> None:
        """Places between chords, numbered after the vertices."""
        between = [
            0 if curve is None else int(own.sum()) - 1 for curve, own in zip(self._curves, self._counts, strict=True)
        ]
        self._first = len(self._corners) + np.concatenate([[0], np.cumsum(between)]).astype(np.int64)
        points: list[tuple[float, float, float]] = []
        for edge, curve in enumerate(self._curves):
            if between[edge] > 0:
                points += [curve.Value(t).Coord() for t in self._parameters(edge)[1:-1].tolist()]
        self.points = np.concatenate([self._corners, np.array(points).reshape(-1, 3)])

    def _parameters(self, edge: int) -> Floats:
        breaks, counts = self._breaks[edge], self._counts[edge]
        starts = np.repeat(breaks[:-1], counts)
        sizes = np.repeat(np.diff(breaks) / counts, counts)
        index = np.arange(len(starts)) - np.repeat(np.cumsum(counts) - counts, counts)
        return np.append(starts + index * sizes, breaks[-1])

    def parts(self, edge: int) -> Floats:
        """Places along an edge in parts of its range of parameters."""
        breaks = self._breaks[edge]
        return np.asarray((self._parameters(edge) - breaks[0]) / (breaks[-1] - breaks[0]))

    def numbers(self, edge: int) -> Integers:
        """Numbers of the points along an edge."""
        start, end = self._ends[edge].tolist()
        if self._curves[edge] is None:
            return np.full(int(self._counts[edge].sum()) + 1, start)
        return np.concatenate([[start], np.arange(self._first[edge], self._first[edge + 1]), [end]])

    def even(self, edge: int) -> bool:
        """True if an edge has steps that are all alike."""
        return len(self._counts[edge]) == 1 and self._curves[edge] is not None

    def steps(self, edge: int) -> int:
        """Count of the chords along an edge."""
        return int(self._counts[edge].sum())


def _breaks(curve: Any) -> Floats:
    """Parameters where an edge begins, bends sharply, and ends."""
    if curve is None:
        return np.array([0.0, 1.0])
    count = curve.NbIntervals(GeomAbs_C1)
    if count == 1:
        return np.array([curve.FirstParameter(), curve.LastParameter()])
    found = RealArray(1, count + 1)
    curve.Intervals(found, GeomAbs_C1)
    return np.array([found.Value(k) for k in range(1, count + 2)])

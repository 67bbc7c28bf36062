"""Faces of the kernel as polygons in the planes of their parameters, whose corners along edges are shared by number."""

from __future__ import annotations

from collections.abc import Sequence
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

from gyroid_cad.common.arrays import dot, numbered_groups, unit
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.boundary import part_surface
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, RealArray, as_edge, as_face, as_vertex, as_wire
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.mesh.triangles.outlined import Outlines
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
# Of a whole patch in parts of the parameters' ranges, and places that are one there.
_CORNERS, _SAME = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]), 1e-6


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
    surfaces, borders = _Surfaces(faces), _Borders(faces)
    edges = _Edges(borders.edges, borders.vertices, limit, angle)
    for _ in range(_FINER):
        made = triangulated_faces(borders.outlines(edges, surfaces), surfaces, edges.points, limit, angle)
        if not made.crossed.any():
            break
        edges.halve(borders.edges_of(made.crossed))
    backwards = np.array([face.Orientation() == TopAbs_REVERSED for face in faces])[made.faces]
    triangles = np.where(backwards[:, np.newaxis], made.triangles[:, ::-1], made.triangles)
    return FaceTriangles(made.vertices, triangles, made.faces, made.crossed)


@dataclass(frozen=True, slots=True, eq=False)
class _Splines:
    """B-spline surfaces that differ by their control points alone."""

    first: NurbsSurface
    nets: Floats


class _Surfaces:
    """Surfaces of faces.

    ``others`` has those that are no plain B-splines, ``domains``, of shape (faces, 2, 2), the lowest and the highest
    parameters of those that are, and nothing but NaN of the others.
    """

    def __init__(self, faces: Sequence[TopoDS_Face]) -> None:
        self.others: dict[int, PartSurface] = {}
        self.domains = np.full((len(faces), 2, 2), np.nan)
        surfaces: dict[int, tuple[Geom_BSplineSurface, NurbsSurface]] = {}
        alike: dict[tuple[bytes, ...], list[tuple[int, NurbsSurface]]] = {}
        for index, face in enumerate(faces):
            location = TopLoc_Location()
            surface = BRep_Tool.Surface_s(face, location)
            if not isinstance(surface, Geom_BSplineSurface) or surface.IsUPeriodic() or surface.IsVPeriodic():
                adaptor = BRepAdaptor_Surface(face, True)
                low = np.array([adaptor.FirstUParameter(), adaptor.FirstVParameter()])
                high = np.array([adaptor.LastUParameter(), adaptor.LastVParameter()])
                self.others[index] = part_surface(adaptor, (low, high))
                continue
            if id(surface) not in surfaces:
                # Kept alive, so that its id stays its own.
                surfaces[id(surface)] = surface, nurbs_of_surface(surface)
            own = surfaces[id(surface)][1]
            key = (own.knots_u.tobytes(), own.knots_v.tobytes(), own.weights.tobytes())
            alike.setdefault(key, []).append((index, _placed(own, location)))
            self.domains[index] = [(own.knots_u[0], own.knots_v[0]), (own.knots_u[-1], own.knots_v[-1])]
        self._groups = [
            _Splines(members[0][1], np.stack([own.control_points for _, own in members])) for members in alike.values()
        ]
        self._group, self._member = np.full((2, len(faces)), -1)
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
                surface = self.others[int(own[start])]
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


class _Borders:
    """Edges round faces, in order, and the curves in the planes of the faces' parameters."""

    def __init__(self, faces: Sequence[TopoDS_Face]) -> None:
        self.edges, self.vertices = NumberedShapes(), NumberedShapes()
        for face in faces:
            TopExp.MapShapes_s(face, TopAbs_EDGE, self.edges)
            TopExp.MapShapes_s(face, TopAbs_VERTEX, self.vertices)
        forward = [as_face(face.Oriented(TopAbs_FORWARD)) for face in faces]
        loops = [(index, loop) for index, face in enumerate(forward) for loop in self._wires(face)]
        self._face = np.array([index for index, _ in loops], dtype=np.int64)
        self._loops = np.cumsum([0, *(len(loop) for _, loop in loops)])
        uses = [(index, number, edge) for index, loop in loops for number, edge in loop]
        self._edge = np.array([number for _, number, _ in uses], dtype=np.int64)
        self._along = np.array([edge.Orientation() == TopAbs_FORWARD for _, _, edge in uses], dtype=bool)
        # Ends of the straight ones; of the others the curve.
        self._ends = np.full((len(uses), 2, 2), np.nan)
        self._curves: dict[int, BRepAdaptor_Curve2d] = {}
        flat = np.array([BRepAdaptor_Surface(face, False).GetType() == GeomAbs_Plane for face in faces], dtype=bool)
        self._flat = flat[np.repeat(self._face, np.diff(self._loops))]
        for use in np.flatnonzero(~self._flat).tolist():
            index, _, edge = uses[use]
            curve = BRepAdaptor_Curve2d(edge, forward[index])
            if curve.GetType() == GeomAbs_Line:
                ends = curve.FirstParameter(), curve.LastParameter()
                self._ends[use] = [curve.Value(t).Coord() for t in ends]
            else:
                self._curves[use] = curve

    def edges_of(self, faces: NDArray[np.bool_]) -> Integers:
        """Numbers of the edges round some faces."""
        return np.unique(self._edge[np.repeat(faces[self._face], np.diff(self._loops))])

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

    def outlines(self, edges: _Edges, surfaces: _Surfaces) -> Outlines:
        """Borders of all faces, with the places that the edges have now."""
        order, squares = self._squares(edges, surfaces.domains)
        steps = edges.steps[self._edge[order]]
        use, index = numbered_groups(steps)
        ahead = self._along[order][use]
        at = edges.first[self._edge[order]][use] + np.where(ahead, index, steps[use] - index)
        vertices, part = edges.numbers[at], edges.parts[at, np.newaxis]
        loops = np.concatenate([[0], np.cumsum(steps)])[self._loops]
        start, end = np.moveaxis(self._ends[order][use], 1, 0)
        places = start + part * (end - start)
        corner = np.repeat(self._face, np.diff(loops))
        first = np.cumsum(steps) - steps
        for place in np.flatnonzero(np.isin(order, list(self._curves))).tolist():
            own = np.arange(first[place], first[place] + steps[place])
            curve = self._curves[int(order[place])]
            low, high = curve.FirstParameter(), curve.LastParameter()
            along = low + edges.parts[at[own]] * (high - low)
            places[own] = [curve.Value(t).Coord() for t in along.tolist()]
        flat = np.flatnonzero(self._flat[order][use])
        for own in np.split(flat, np.flatnonzero(np.diff(corner[flat])) + 1) if len(flat) else []:
            places[own] = surfaces.others[int(corner[own[0]])].distances(edges.points[vertices[own]])[2]
        return Outlines(places, vertices, loops, self._face, squares)

    def _squares(self, edges: _Edges, domains: Floats) -> tuple[Integers, Integers]:
        """Order of the uses of edges, those of whole patches from the lowest parameters on, and the steps of these."""
        order, squares = np.arange(len(self._edge)), np.zeros((len(domains), 4), dtype=np.int64)
        of_four = np.diff(self._loops) == 4
        alone = np.bincount(self._face, minlength=len(domains))[self._face] == 1
        some = np.flatnonzero(of_four & alone)
        uses = self._loops[some, np.newaxis] + np.arange(4)
        numbers = self._edge[uses]
        distinct = np.all(np.diff(np.sort(numbers, axis=1), axis=1) > 0, axis=1)
        good = distinct & edges.even[numbers].all(axis=1)
        some, uses = some[good], uses[good]
        low, high = np.moveaxis(domains[self._face[some]], 1, 0)
        starts = np.where(self._along[uses][..., np.newaxis], self._ends[uses, 0], self._ends[uses, 1])
        places = (starts - low[:, np.newaxis]) / (high - low)[:, np.newaxis]
        for turn in range(4):
            turned = np.roll(places, -turn, axis=1)
            # Of what has no domain, or is not straight, nothing is near.
            whole = np.all(np.abs(turned - _CORNERS) < _SAME, axis=(1, 2))
            own = np.roll(uses[whole], -turn, axis=1)
            order[uses[whole]] = own
            squares[self._face[some[whole]]] = edges.steps[self._edge[own]]
        return order, squares


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
        breaks = [_breaks(curve) for curve in self._curves]
        pieces = np.array([len(own) - 1 for own in breaks], dtype=np.int64)
        self._piece_edge = np.repeat(np.arange(count), pieces)
        self._starts = np.concatenate([np.empty(0), *(own[:-1] for own in breaks)])
        self._sizes = np.concatenate([np.empty(0), *(np.diff(own) for own in breaks)])
        self._last = np.array([own[-1] for own in breaks])
        self._shrunk = np.array([curve is None for curve in self._curves], dtype=bool)
        self.even = (pieces == 1) & ~self._shrunk
        self._counts = self._enough(limit, angle)
        self._lay()

    def _enough(self, limit: float, angle: float) -> Integers:
        """Chords of each piece of each edge: one of a line, of others as many as it takes."""
        straight = np.array([curve is not None and curve.GetType() == GeomAbs_Line for curve in self._curves])
        bent = np.flatnonzero(~(straight | self._shrunk)[self._piece_edge])
        fractions = np.linspace(0, 1, 2 * _CHORDS + 1)
        along = (self._starts[bent, np.newaxis] + fractions * self._sizes[bent, np.newaxis]).tolist()
        curves = (self._curves[edge] for edge in self._piece_edge[bent].tolist())
        samples = np.array(
            [[curve.Value(t).Coord() for t in own] for curve, own in zip(curves, along, strict=True)]
        ).reshape(-1, 2 * _CHORDS + 1, 3)
        chords = samples[:, 2::2] - samples[:, :-2:2]
        away = samples[:, 1::2] - samples[:, :-2:2]
        length = np.maximum(np.linalg.norm(chords, axis=-1), np.finfo(float).tiny)
        off = np.linalg.norm(np.cross(away, chords), axis=-1) / length
        sides = unit(np.diff(samples, axis=1))
        turned = np.arccos(np.clip(dot(sides[:, 1:], sides[:, :-1]), -1, 1)).max(axis=1, initial=0.0)
        wanted = np.maximum(_CHORDS * np.sqrt(off.max(axis=1, initial=0.0) / limit), 2 * _CHORDS * turned / angle)
        counts = np.ones(len(self._starts), dtype=np.int64)
        counts[bent] = np.ceil(wanted.clip(1, _MOST_CHORDS) - 1e-9)
        _, which, uses = np.unique(np.sort(self._ends, axis=1), axis=0, return_inverse=True, return_counts=True)
        # Else two edges between the same vertices may be one chord, and a closed one nothing.
        fewest = np.where((uses[which.ravel()] > 1) & ~straight, 2, 1)
        fewest[self._ends[:, 0] == self._ends[:, 1]] = 4
        fewest[self._shrunk] = _AT_POLE
        return np.maximum(counts, fewest[self._piece_edge])

    def halve(self, edges: Integers) -> None:
        """Give edges twice the chords."""
        self._counts[np.isin(self._piece_edge, edges) & ~self._shrunk[self._piece_edge]] *= 2
        self._lay()

    def _lay(self) -> None:
        """Places between chords, numbered after the vertices.

        Of each edge, from its first number on, places in parts of its range of parameters, and the points there.
        """
        self.steps = np.bincount(self._piece_edge, self._counts, len(self._curves)).astype(np.int64)
        self.first = np.concatenate([[0], np.cumsum(self.steps + 1)])
        piece, index = numbered_groups(self._counts)
        along = np.empty(self.first[-1])
        along[np.arange(len(piece)) + self._piece_edge[piece]] = (
            self._starts[piece] + index * (self._sizes / self._counts)[piece]
        )
        along[self.first[1:] - 1] = self._last
        edge, index = numbered_groups(self.steps + 1)
        low = along[self.first[:-1]]
        self.parts = (along - low[edge]) / (self._last - low)[edge]
        between = np.flatnonzero((index > 0) & (index < self.steps[edge]) & ~self._shrunk[edge])
        self.numbers = np.where(index == self.steps[edge], self._ends[edge, 1], self._ends[edge, 0])
        self.numbers[between] = len(self._corners) + np.arange(len(between))
        curves = (self._curves[own] for own in edge[between].tolist())
        points = [curve.Value(t).Coord() for curve, t in zip(curves, along[between].tolist(), strict=True)]
        self.points = np.concatenate([self._corners, np.array(points).reshape(-1, 3)])


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

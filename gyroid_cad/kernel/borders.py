"""Faces of a shape as arrays: their surfaces, many evaluated at once, and the edges round each in order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAbs import GeomAbs_Line, GeomAbs_Plane
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.arrays import dot, grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.boundary import part_surface
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_wire
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.nurbs.surface import NurbsSurface, point_derivatives
from gyroid_cad.trim.free_surfaces import FreeForm, Swept
from gyroid_cad.trim.surfaces import PartSurface, Quadric

__all__ = ["FaceBorders", "FaceSurfaces", "Splines"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_PLACES_AT_ONCE = 2**15
# Of the squared sine between lines of parameters.
_FLAT = 1e-12
# Of a whole patch in parts of the parameters' ranges, and places that are one there.
_CORNERS, _SAME = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]), 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Splines:
    """B-spline surfaces that differ by their control points alone."""

    first: NurbsSurface
    nets: Floats


class FaceSurfaces:
    """Surfaces of faces.

    ``groups`` has B-splines of one basis together, ``others`` those that are no plain B-splines, ``domains``, of shape
    (faces, 2, 2), the lowest and the highest parameters of those that are, and nothing but NaN of the others.
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
        self.groups = [
            Splines(members[0][1], np.stack([own.control_points for _, own in members])) for members in alike.values()
        ]
        self._group, self._member = np.full((2, len(faces)), -1)
        for number, members in enumerate(alike.values()):
            for place, (index, _) in enumerate(members):
                self._group[index], self._member[index] = number, place

    def in_groups(self) -> Iterator[tuple[Splines, Integers]]:
        """Splines of one basis after another, and the faces on them in their order."""
        members = grouped(self._group[self._group >= 0])
        spline_faces = np.flatnonzero(self._group >= 0)
        for number, some in members:
            own = spline_faces[some]
            yield self.groups[number], own[np.argsort(self._member[own])]

    def evaluated(self, faces: Integers, places: Floats) -> tuple[Floats, Floats]:
        """As of :class:`gyroid_cad.mesh.triangles.outlined.Surfaces`."""
        points, normals = np.empty((2, len(faces), 3))
        for rows, own in self._portions(faces):
            if rows.ndim == 1:
                surface = self.others[int(own[0])]
                points[rows], normals[rows] = surface.points(places[rows]), surface.area_vectors(places[rows])
            else:
                found = self._spline_derivatives(own, places[rows], 1)
                points[rows], normals[rows] = found[0], np.cross(found[1], found[2])
        return points, normals

    def smallest_radii(self, faces: Integers, places: Floats) -> Floats:
        """Smaller radii of curvature (n,), in mm, on faces (n,) at places (n, 2); NaN where there is no normal.

        By the principal curvatures, H + sqrt(H^2 - K) with their signs.
        """
        radii = np.empty(len(faces))
        for rows, own in self._portions(faces):
            surface = self.others.get(int(own[0])) if rows.ndim == 1 else None
            if isinstance(surface, Quadric):
                radii[rows] = surface.radii(places[rows])
            elif surface is not None:
                free = surface.free if isinstance(surface, Swept) else surface
                assert isinstance(free, FreeForm)
                radii[rows] = _radii(free.derivatives(places[rows], 2))
            else:
                radii[rows] = _radii(self._spline_derivatives(own, places[rows], 2))
        return radii

    def _spline_derivatives(self, faces: Integers, places: Floats, order: int) -> tuple[Floats, ...]:
        """Points and derivatives of spline faces of one group (k,) at places (k, q, 2)."""
        splines = self.groups[int(self._group[faces[0]])]
        knots = splines.first.knots_u, splines.first.knots_v
        nets = splines.nets[self._member[faces]]
        return point_derivatives(nets, splines.first.weights, knots, places[..., 0], places[..., 1], order)

    def _portions(self, faces: Integers) -> Iterator[tuple[Integers, Integers]]:
        """Rows of some faces, and these: (n,) of one alone, (faces, n) of splines of one group, some rows twice."""
        order = np.argsort(faces, kind="stable")
        own, first, counts = np.unique(faces[order], return_index=True, return_counts=True)
        # Of each group, faces with like numbers of places together.
        ranked = np.lexsort([counts, self._group[own]])
        own, first, counts = own[ranked], first[ranked], counts[ranked]
        start = 0
        while start < len(own):
            group = int(self._group[own[start]])
            if group < 0:
                yield order[first[start] : first[start] + counts[start]], own[start : start + 1]
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
            yield order[index], own[start:end]
            start = end


def _radii(derivatives: tuple[Floats, ...]) -> Floats:
    """Smaller radii of curvature by points and derivatives by u, v, uu, uv and vv, (..., 3)."""
    _, du, dv, duu, duv, dvv = derivatives
    normal = np.cross(du, dv)
    square = dot(normal, normal)
    e, f, g = dot(du, du), dot(du, dv), dot(dv, dv)
    second_uu, second_uv, second_vv = (dot(bend, normal) for bend in (duu, duv, dvv))
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (e * second_vv - 2 * f * second_uv + g * second_uu) / (2 * square**1.5)
        product = (second_uu * second_vv - second_uv**2) / square**2
        largest = np.abs(mean) + np.sqrt(np.maximum(mean**2 - product, 0))
        # Where derivatives all but vanish, as at a pole, curvature is rounding.
        return np.where(square > _FLAT * e * g + np.finfo(float).tiny, 1 / largest, np.nan)


class FaceBorders:
    """Edges round faces, in order, and the curves in the planes of the faces' parameters.

    Attributes
    ----------
    edges, vertices : NumberedShapes
        Of all faces, each once.
    face : ndarray of int, shape (loops,)
        Face of each closed border, in ascending order.
    loops : ndarray of int, shape (loops + 1,)
        First use of an edge in each border, and the end.
    edge : ndarray of int, shape (uses,)
        Edge that is used.
    along : ndarray of bool, shape (uses,)
        Whether the border runs the way the edge does.
    ends : ndarray, shape (uses, 2, 2)
        Parameters at the first and the last place of the edge, where it runs straight between them; else NaN.
    curves : dict of int to BRepAdaptor_Curve2d
        Of the other uses, but for those in planes.
    flat : ndarray of bool, shape (uses,)
        Uses in planes.

    Raises
    ------
    KernelError
        If a face has no border, or one that does not close.
    """

    def __init__(self, faces: Sequence[TopoDS_Face]) -> None:
        self.edges, self.vertices = NumberedShapes(), NumberedShapes()
        for face in faces:
            TopExp.MapShapes_s(face, TopAbs_EDGE, self.edges)
            TopExp.MapShapes_s(face, TopAbs_VERTEX, self.vertices)
        forward = [as_face(face.Oriented(TopAbs_FORWARD)) for face in faces]
        loops = [(index, loop) for index, face in enumerate(forward) for loop in self._wires(face)]
        self.face = np.array([index for index, _ in loops], dtype=np.int64)
        self.loops = np.cumsum([0, *(len(loop) for _, loop in loops)])
        uses = [(index, number, edge) for index, loop in loops for number, edge in loop]
        self.edge = np.array([number for _, number, _ in uses], dtype=np.int64)
        self.along = np.array([edge.Orientation() == TopAbs_FORWARD for _, _, edge in uses], dtype=bool)
        # Ends of the straight ones; of the others the curve.
        self.ends = np.full((len(uses), 2, 2), np.nan)
        self.curves: dict[int, BRepAdaptor_Curve2d] = {}
        planes = np.array([BRepAdaptor_Surface(face, False).GetType() == GeomAbs_Plane for face in faces], dtype=bool)
        self.flat = planes[self.owner]
        for use in np.flatnonzero(~self.flat).tolist():
            index, _, edge = uses[use]
            curve = BRepAdaptor_Curve2d(edge, forward[index])
            if curve.GetType() == GeomAbs_Line:
                ends = curve.FirstParameter(), curve.LastParameter()
                self.ends[use] = [curve.Value(t).Coord() for t in ends]
            else:
                self.curves[use] = curve

    def edges_of(self, faces: NDArray[np.bool_]) -> Integers:
        """Numbers of the edges round some faces."""
        return np.unique(self.edge[np.repeat(faces[self.face], np.diff(self.loops))])

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

    @cached_property
    def owner(self) -> Integers:
        """Face of each use of an edge."""
        return np.asarray(np.repeat(self.face, np.diff(self.loops)))

    def places(self, use: Integers, part: Floats, points: Floats, surfaces: FaceSurfaces) -> Floats:
        """Parameters, shape (n, 2), along uses of edges.

        Parameters
        ----------
        use : ndarray of int, shape (n,)
        part : ndarray, shape (n,)
            Of the edge's range of parameters, from 0 to 1.
        points : ndarray, shape (n, 3)
            The places in space, by which those in planes are found.
        surfaces : FaceSurfaces
        """
        start, end = np.moveaxis(self.ends[use], 1, 0)
        places: Floats = start + part[:, np.newaxis] * (end - start)
        bent = np.flatnonzero(np.isin(use, list(self.curves)))
        for number, some in grouped(use[bent]):
            curve, rows = self.curves[number], bent[some]
            low, high = curve.FirstParameter(), curve.LastParameter()
            places[rows] = [curve.Value(t).Coord() for t in (low + part[rows] * (high - low)).tolist()]
        flat = np.flatnonzero(self.flat[use])
        for face, some in grouped(self.owner[use[flat]]):
            places[flat[some]] = surfaces.others[face].distances(points[flat[some]])[2]
        return places

    def whole_patches(self, domains: Floats) -> Integers:
        """Four uses of edges, from the lowest parameters on, of every face that is all of its surface's square.

        Parameters
        ----------
        domains : ndarray, shape (faces, 2, 2)
            As of :class:`FaceSurfaces`.
        """
        of_four = np.diff(self.loops) == 4
        alone = np.bincount(self.face, minlength=len(domains))[self.face] == 1
        some = np.flatnonzero(of_four & alone)
        uses = self.loops[some, np.newaxis] + np.arange(4)
        distinct = np.all(np.diff(np.sort(self.edge[uses], axis=1), axis=1) > 0, axis=1)
        some, uses = some[distinct], uses[distinct]
        low, high = np.moveaxis(domains[self.face[some]], 1, 0)
        starts = np.where(self.along[uses][..., np.newaxis], self.ends[uses, 0], self.ends[uses, 1])
        places = (starts - low[:, np.newaxis]) / (high - low)[:, np.newaxis]
        found = [np.zeros((0, 4), dtype=np.int64)]
        for turn in range(4):
            # Of what has no domain, or is not straight, nothing is near.
            whole = np.all(np.abs(np.roll(places, -turn, axis=1) - _CORNERS) < _SAME, axis=(1, 2))
            found.append(np.roll(uses[whole], -turn, axis=1))
        return np.concatenate(found)


def _placed(surface: NurbsSurface, location: TopLoc_Location) -> NurbsSurface:
    if location.IsIdentity():
        return surface
    transformation = location.Transformation()
    rows = np.array([[transformation.Value(i, j) for j in range(1, 5)] for i in range(1, 4)])
    return surface.transformed(rows[:, :3], rows[:, 3])

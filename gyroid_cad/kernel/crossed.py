"""Faces of the kernel that share their edges: of a lattice what a part leaves, and of its boundary what they leave."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex, TopoDS_Wire

from gyroid_cad.kernel.boundary import ReadBoundary
from gyroid_cad.kernel.check import measure_about, parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face
from gyroid_cad.kernel.split import Change, Pieces
from gyroid_cad.kernel.surfaces import (
    TOLERANCE,
    WallGeometry,
    border_line,
    kernel_curve,
    plane_curve,
    straight_curve,
)
from gyroid_cad.nurbs.surface import NurbsCurve
from gyroid_cad.trim.lattice_faces import LatticeFaces
from gyroid_cad.trim.measures import PieceMeasures
from gyroid_cad.trim.pieces import Crossing, CutEdge, CutLoops, Uses
from gyroid_cad.trim.section_splines import section_knots
from gyroid_cad.wall.areas import ShapeSize
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["FaceSizes", "crossed_pieces"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Between what was measured between stations of a section curve and what the kernel finds elsewhere along it.
_MARGIN = 2.0
# Of the angle between a section and an edge of the part, by which their corner reaches further.
_SMALLEST_SINE = 1e-3
_CORNERS = ((0, 0), (-1, 0), (-1, -1), (0, -1))


def crossed_pieces(
    cut: Crossing, read: ReadBoundary, whole: LatticeFaces, backwards: Booleans
) -> tuple[Pieces, list[TopoDS_Face]]:
    """Pieces of a part and of a lattice's faces, and faces of the lattice that nothing has cut.

    Parameters
    ----------
    cut : Crossing
    read : ReadBoundary
        Of the same boundary.
    whole : LatticeFaces
        Further faces, that lie in the part.
    backwards : ndarray of bool, shape (faces,)
        Whether the region is on the side that their normal points to.

    Returns
    -------
    pieces : Pieces
    faces : list of TopoDS_Face
    """
    work = _Realisation(cut, read)
    inside = [work.lattice_face(piece) for piece in cut.lattice]
    boundary = [(piece, work.part_face(piece)) for piece in [*cut.inner, *cut.outer]]
    faces = work.whole_faces(whole, backwards)
    pieces = Pieces(
        tuple(inside), tuple(face for _, face in boundary), tuple(piece.face for piece, _ in boundary), work.changes()
    )
    return pieces, faces


class _Realisation:
    def __init__(self, cut: Crossing, read: ReadBoundary) -> None:
        self.cut, self.read = cut, read
        self.wall: Wall = cut.faces.wall
        self.builder, self.geometry = BRep_Builder(), WallGeometry(self.wall)
        self.complex = self.wall.complex
        self.vertices: dict[int, TopoDS_Vertex] = dict(enumerate(read.vertices))
        self.fan_vertices: dict[int, TopoDS_Vertex] = {}
        self.fan_of = {vertex: fan for fan, vertex in cut.fans.items()}
        self.edges: dict[int, TopoDS_Edge] = {}
        self.rims: dict[int, TopoDS_Edge] = {}
        self.pieces_of: dict[int, list[tuple[float, int]]] = {}
        self.patch_edges = self.complex.patch_edges.tolist()
        self.face_patch, self.face_side = cut.faces.patch.tolist(), cut.faces.side.tolist()
        self.face_rims, self.face_forward = cut.faces.rims.tolist(), cut.faces.forward.tolist()

    # Vertices -------------------------------------------------------------------------------------------------------

    def vertex(self, number: int) -> TopoDS_Vertex:
        number = self.cut.twins.get(number, number)
        if number in self.fan_of:
            return self.fan_vertex(self.fan_of[number])
        if number not in self.vertices:
            self.vertices[number] = self._made_vertex(self.cut.points[number])
        return self.vertices[number]

    def fan_vertex(self, fan: int) -> TopoDS_Vertex:
        if fan not in self.fan_vertices:
            side, index = divmod(fan, self.complex.fan_count)
            patch, corner = self._corner_of[index]
            net = self.wall.nets[self.wall.patch_net[patch], side][_CORNERS[corner]]
            self.fan_vertices[fan] = self._made_vertex(net + self.wall.shifts[self.wall.patch_shift[patch]])
        return self.fan_vertices[fan]

    @cached_property
    def _corner_of(self) -> list[tuple[int, int]]:
        """A patch and its corner at each fan."""
        first = np.zeros(self.complex.fan_count, dtype=np.int64)
        first[self.complex.patch_fans.ravel()] = np.arange(self.complex.patch_fans.size)
        return [(patch, corner) for patch, corner in zip(*(some.tolist() for some in np.divmod(first, 4)), strict=True)]

    def _made_vertex(self, point: Floats) -> TopoDS_Vertex:
        vertex = TopoDS_Vertex()
        self.builder.MakeVertex(vertex, gp_Pnt(*point.tolist()), TOLERANCE)
        return vertex

    # Edges ----------------------------------------------------------------------------------------------------------

    def edge(self, number: int) -> TopoDS_Edge:
        if number not in self.edges:
            made = {"rim": self._rim_piece, "part": self._part_piece, "section": self._section_edge}
            edge = self.cut.edges[number]
            self.edges[number] = made[edge.kind](number, edge)
        return self.edges[number]

    def rim(self, rim: int) -> TopoDS_Edge:
        """All of a rim."""
        if rim not in self.rims:
            start, end = self._rim_ends(rim)
            self.rims[rim] = self._on_rim(rim, self.fan_vertex(start), self.fan_vertex(end), -1.0, 1.0)
        return self.rims[rim]

    def _rim_ends(self, rim: int) -> tuple[int, int]:
        side, index = divmod(rim, self.complex.edge_count)
        if side in SIDES:
            start, end = self.complex.edge_fans[index].tolist()
            return side * self.complex.fan_count + start, side * self.complex.fan_count + end
        fan = rim - len(SIDES) * self.complex.edge_count
        return fan, self.complex.fan_count + fan

    def _rim_piece(self, _: int, edge: CutEdge) -> TopoDS_Edge:
        if edge.first == -1.0 and edge.last == 1.0:
            return self.rim(edge.number)
        return self._on_rim(edge.number, self.vertex(edge.start), self.vertex(edge.end), edge.first, edge.last)

    def _on_rim(self, rim: int, start: TopoDS_Vertex, end: TopoDS_Vertex, first: float, last: float) -> TopoDS_Edge:
        side, index = divmod(rim, self.complex.edge_count)
        if side in SIDES:
            patch = int(self.complex.edge_patches[index, 0])
            k = self.patch_edges[patch].index(index)
            curve, location = self.geometry.face_edge(patch, k, side), self.geometry.location(patch)
        else:
            curve, location = straight_curve(*map(self.fan_vertex, self._rim_ends(rim))), TopLoc_Location()
        edge = TopoDS_Edge()
        self.builder.MakeEdge(edge, curve, location, TOLERANCE)
        return self._bounded(edge, start, end, first, last)

    def _part_piece(self, number: int, edge: CutEdge) -> TopoDS_Edge:
        own, whole = self.read.edges[edge.number], self.read.boundary.edges[edge.number]
        if edge.first == whole.first and edge.last == whole.last:
            return own
        # The curves stay the part's own, in space and on both faces.
        piece = as_edge(own.EmptyCopied())
        self.builder.UpdateEdge(piece, _MARGIN * self.read.boundary.deviation(edge.number))
        self.pieces_of.setdefault(edge.number, []).append((edge.first, number))
        return self._bounded(piece, self.vertex(edge.start), self.vertex(edge.end), edge.first, edge.last)

    def _section_edge(self, _: int, edge: CutEdge) -> TopoDS_Edge:
        section = self.cut.sections[edge.number]
        points = section.in_space
        curve = kernel_curve(NurbsCurve(points, np.ones(len(points)), section_knots(len(points))))
        made = TopoDS_Edge()
        self.builder.MakeEdge(made, curve, self._tolerance(edge.number))
        return self._bounded(made, self.vertex(edge.start), self.vertex(edge.end), 0.0, 1.0)

    def _tolerance(self, section: int) -> float:
        return max(TOLERANCE, _MARGIN * self.cut.sections[section].deviation)

    def _bounded(
        self, edge: TopoDS_Edge, start: TopoDS_Vertex, end: TopoDS_Vertex, first: float, last: float
    ) -> TopoDS_Edge:
        self.builder.Add(edge, start.Oriented(TopAbs_FORWARD))
        self.builder.Add(edge, end.Oriented(TopAbs_REVERSED))
        self.builder.Range(edge, first, last)
        curve = BRepAdaptor_Curve(edge)
        tolerance = BRep_Tool.Tolerance_s(edge)
        for vertex, parameter in ((start, first), (end, last)):
            # Two curves that meet in it need not do so exactly.
            gap = _MARGIN * curve.Value(parameter).Distance(BRep_Tool.Pnt_s(vertex))
            self.builder.UpdateVertex(vertex, max(tolerance, gap))
        return edge

    # Faces ----------------------------------------------------------------------------------------------------------

    def lattice_face(self, piece: CutLoops) -> TopoDS_Face:
        patch, side = self.face_patch[piece.face], self.face_side[piece.face]
        surface, location = self.geometry.face(patch, side), self.geometry.location(patch)
        made = TopoDS_Face()
        self.builder.MakeFace(made, surface, location, TOLERANCE)
        for loop in piece.loops:
            for number, _ in loop:
                edge = self.cut.edges[number]
                if edge.kind == "rim":
                    k = self.face_rims[piece.face].index(edge.number)
                    line, tolerance = border_line(k, self.face_forward[piece.face][k]), TOLERANCE
                else:
                    line, tolerance = (
                        _plane_section(self.cut.sections[edge.number].in_square),
                        self._tolerance(edge.number),
                    )
                self.builder.UpdateEdge(self.edge(number), line, surface, location, tolerance)
            self.builder.Add(made, self._wire(loop))
        self.builder.NaturalRestriction(made, piece.whole)
        return as_face(made.Oriented(TopAbs_REVERSED)) if self.cut.backwards[piece.face] else made

    def whole_faces(self, faces: LatticeFaces, backwards: Booleans) -> list[TopoDS_Face]:
        numbers = (some.tolist() for some in (faces.patch, faces.side, faces.rims, faces.forward, backwards))
        return [self._whole_face(*some) for some in zip(*numbers, strict=True)]

    def _whole_face(self, patch: int, side: int, rims: list[int], forward: list[bool], backwards: bool) -> TopoDS_Face:
        surface, location = self.geometry.face(patch, side), self.geometry.location(patch)
        made, wire = TopoDS_Face(), TopoDS_Wire()
        self.builder.MakeFace(made, surface, location, TOLERANCE)
        self.builder.MakeWire(wire)
        for k, (rim, runs_on) in enumerate(zip(rims, forward, strict=True)):
            edge = self.rim(rim)
            self.builder.UpdateEdge(edge, border_line(k, runs_on), surface, location, TOLERANCE)
            self.builder.Add(wire, edge if runs_on else edge.Reversed())
        wire.Closed(True)
        self.builder.Add(made, wire)
        self.builder.NaturalRestriction(made, True)
        return as_face(made.Oriented(TopAbs_REVERSED)) if backwards else made

    def part_face(self, piece: CutLoops) -> TopoDS_Face:
        own = self.read.faces[piece.face]
        if piece.whole:
            return own
        location = TopLoc_Location()
        surface = BRep_Tool.Surface_s(own, location)
        made = TopoDS_Face()
        self.builder.MakeFace(made, surface, location, BRep_Tool.Tolerance_s(own))
        for loop in piece.loops:
            for number, _ in loop:
                edge = self.cut.edges[number]
                if edge.kind == "section":
                    curve = _plane_section(self.cut.sections[edge.number].on_part)
                    self.builder.UpdateEdge(self.edge(number), curve, surface, location, self._tolerance(edge.number))
            self.builder.Add(made, self._wire(loop))
            self._widen_corners(made, loop)
        return as_face(made.Oriented(own.Orientation()))

    def _widen_corners(self, face: TopoDS_Face, loop: Uses) -> None:
        """Let vertices reach to where a section and an edge of the part may cross beside them.

        What made the part may have left its edges off their faces by a little. A section that meets such an edge at a
        small angle crosses it some way off their common vertex, and the kernel takes it for a wire that crosses itself.
        """
        for (number, forward), (following, onward) in zip(loop, [*loop[1:], loop[0]], strict=True):
            if {self.cut.edges[one].kind for one in (number, following)} != {"section", "part"}:
                continue
            point, direction = self._end_on(face, number, forward)
            other_point, other = self._end_on(face, following, not onward)
            lengths = direction.Magnitude() * other.Magnitude()
            sine = direction.Crossed(other).Magnitude() / lengths if lengths else 0.0
            reach = point.Distance(other_point) / max(sine, _SMALLEST_SINE)
            edge = self.cut.edges[number]
            self.builder.UpdateVertex(self.vertex(edge.end if forward else edge.start), _MARGIN * reach)

    def _end_on(self, face: TopoDS_Face, number: int, last: bool) -> tuple[gp_Pnt, gp_Vec]:
        """Point where an edge ends, or begins, by its curve on a face, and the way it goes there."""
        curve, point, direction = BRepAdaptor_Curve(self.edge(number), face), gp_Pnt(), gp_Vec()
        curve.D1(curve.LastParameter() if last else curve.FirstParameter(), point, direction)
        return point, direction

    def _wire(self, loop: Uses) -> TopoDS_Wire:
        wire = TopoDS_Wire()
        self.builder.MakeWire(wire)
        for number, forward in loop:
            edge = self.edge(number)
            self.builder.Add(wire, edge if forward else edge.Reversed())
        wire.Closed(True)
        return wire

    def changes(self) -> tuple[Change, ...]:
        """Edges of the part that were parted, with their pieces in order."""
        return tuple(
            (self.read.edges[edge], tuple(self.edges[number] for _, number in sorted(pieces)))
            for edge, pieces in self.pieces_of.items()
        )


def _plane_section(control: Floats) -> Geom2d_BSplineCurve:
    """A section curve in the parameters of a face."""
    return plane_curve(control, section_knots(len(control)))


class FaceSizes:
    """Volumes and areas of what faces bound, from those of the faces; the kernel is asked for faces not given.

    Parameters
    ----------
    faces : iterable of TopoDS_Face
        Oriented as they are measured.
    measures : PieceMeasures
        Of the faces, in that order.
    middle : ndarray, shape (3,)
        That the fluxes are taken about.
    """

    def __init__(self, faces: Iterable[TopoDS_Face], measures: PieceMeasures, middle: Floats) -> None:
        self._numbers, self._orientations = NumberedShapes(), []
        for face in faces:
            self._numbers.Add(face)
            self._orientations.append(face.Orientation())
        self._measures, self._middle = measures, middle
        self._others: list[tuple[float, float, bool]] = []
        self._other_numbers = NumberedShapes()

    def of(self, shape: TopoDS_Shape) -> ShapeSize:
        """Its size; the volume negative if the shape is inside out, no centroid if the kernel is asked for a face."""
        volume = area = 0.0
        moment, exact = np.zeros(3), True
        for face in parts_of(shape, TopAbs_FACE):
            flux, size, own = self._of_face(face)
            volume, area = volume + flux, area + size
            exact &= own is not None
            moment += np.zeros(3) if own is None else own
        if not (exact and volume):
            return ShapeSize(volume, area)
        x, y, z = (self._middle + moment / volume).tolist()
        return ShapeSize(volume, area, (x, y, z))

    def areas(self, shape: TopoDS_Shape) -> Floats:
        """Areas of its faces, in the order in which the kernel counts them, in mm2."""
        return np.array([self._of_face(face)[1] for face in parts_of(shape, TopAbs_FACE)])

    def _of_face(self, face: TopoDS_Shape) -> tuple[float, float, Floats | None]:
        """Flux and area of a face, and its moment, None if the kernel is asked."""
        index = int(self._numbers.FindIndex(face)) - 1
        if index < 0:
            return *self._of_other(as_face(face)), None
        sign = 1.0 if face.Orientation() == self._orientations[index] else -1.0
        measures = self._measures
        return sign * float(measures.flux[index]), float(measures.area[index]), sign * measures.moment[index]

    def _of_other(self, face: TopoDS_Face) -> tuple[float, float]:
        """Flux and area of a face that was not given: the kernel is asked once, for its integrals take long."""
        forward = face.Orientation() == TopAbs_FORWARD
        number = int(self._other_numbers.Add(face))
        if number > len(self._others):
            self._others.append((*measure_about(face, self._middle), forward))
        flux, area, asked_forward = self._others[number - 1]
        return flux if forward == asked_forward else -flux, area

"""Offsets of a solid's faces inwards, each with the borders of its own, and tubes and balls round what points inwards.

Every place of a skin's inner side is on one of these pieces: on the offset of a face that is no larger than the face,
on a tube round an edge that points into the material, or on a ball round a corner that does. So nothing is extended.
Faces that pass into each other smoothly share the offset of their common edge, a tube shares an edge with the offsets
on either side of it: what only touches is joined here, and never sought as a crossing. At edges that point outwards
the offsets run through each other, and end where nothing is kept.

An opening is its own offset, to which the others come: round its border, as wide as the skin, runs a tube from the
offset of the face beside it until a little beyond the opening.

An offset has the parameters of its face, so that curves in the parameter plane bound both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Circle, Geom_Line, Geom_Surface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Ax2, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Solid, TopoDS_Vertex, TopoDS_Wire

from gyroid_cad.common.graph import connected
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_vertex
from gyroid_cad.kernel.offset_surface import (
    FaceOffset,
    Rim,
    closed_form_curve,
    curve_points,
    derivatives,
    plane_points,
    vector_of,
)
from gyroid_cad.kernel.offset_tube import BallArc, ball_round, straight, tube_round
from gyroid_cad.kernel.spline_fit import fitted_curve

__all__ = ["offset_pieces"]

Floats = NDArray[np.float64]

# Of fitted curves and surfaces, in parts of the offset.
_TOLERANCE = 1e-4
# Sine of an angle between normals on either side of an edge below which the edge is smooth.
_SMOOTH = 5e-3
_SAMPLES = 9
_LEAST_TOLERANCE = 1e-7
# Number of a face that stands for both on either side of a smooth edge.
_SHARED = -1
# Of what is measured between samples, which may be more elsewhere.
_MARGIN = 1.5
_CLOSELY = 36
# By how much the offset beside an opening must come through it to need no tube, in radians.
_THROUGH = 0.1


@dataclass(slots=True)
class _Side:
    """A face on one side of an edge: its index, the edge as it runs round it, and the curve in its plane."""

    face: int
    edge: TopoDS_Edge
    curve: Geom2d_Curve
    parameters: Floats
    normals: Floats
    tangents: Floats


def offset_pieces(
    solid: TopoDS_Solid, by: float, openings: Sequence[TopoDS_Face] = ()
) -> tuple[list[TopoDS_Face], list[TopoDS_Face]]:
    """Faces, oriented like the solid's, among which is all of the inner side of a skin, and more; and the openings.

    Parameters
    ----------
    solid : TopoDS_Solid
        Without faces that close on themselves.
    by : float
        Thickness of the skin, in mm.
    openings : sequence of TopoDS_Face
        Of its faces.

    Raises
    ------
    KernelError
        If an offset cannot be fitted.
    """
    return _Pieces(solid, by, openings).made()


class _Pieces:
    def __init__(self, solid: TopoDS_Solid, by: float, openings: Sequence[TopoDS_Face]) -> None:
        self.by, self.tolerance = by, _TOLERANCE * by
        self.builder, self.place = BRep_Builder(), TopLoc_Location()
        self.faces = [as_face(face) for face in parts_of(solid, TopAbs_FACE)]
        self.opened = [any(face.IsSame(opening) for opening in openings) for face in self.faces]
        self.offsets: list[FaceOffset | Rim] = [
            FaceOffset(face, 0.0 if is_open else by, self.tolerance)
            for face, is_open in zip(self.faces, self.opened, strict=True)
        ]
        self.edges, self.vertices = NumberedShapes(), NumberedShapes()
        TopExp.MapShapes_s(solid, TopAbs_EDGE, self.edges)
        TopExp.MapShapes_s(solid, TopAbs_VERTEX, self.vertices)
        self.sides: dict[int, list[_Side]] = {}
        for index, face in enumerate(self.faces):
            for shape in parts_of(face.Oriented(TopAbs_FORWARD), TopAbs_EDGE):
                self.sides.setdefault(self.edges.FindIndex(shape), []).append(self._side(index, as_edge(shape)))
        self.bends = {number: _bend(*sides) for number, sides in self.sides.items() if len(sides) == 2}
        self.rims: dict[int, list[_Side]] = {}
        for number in list(self.bends):
            self._open(number)
        self.ends: dict[int, tuple[int, int]] = {}
        for number in self.sides:
            edge = as_edge(self.edges.FindKey(number).Oriented(TopAbs_FORWARD))
            self.ends[number] = (
                self.vertices.FindIndex(TopExp.FirstVertex_s(edge)),
                self.vertices.FindIndex(TopExp.LastVertex_s(edge)),
            )
        self.places, self.corners = self._corners()
        self.made_vertices: dict[int, TopoDS_Vertex] = {}
        self.made_edges: dict[tuple[int, int], TopoDS_Edge] = {}
        self.arcs: dict[tuple[int, frozenset[int]], BallArc] = {}

    def made(self) -> tuple[list[TopoDS_Face], list[TopoDS_Face]]:
        faces = {index: self._offset_face(index) for index in range(len(self.faces)) if self.offsets[index].surface}
        tubes = [self._tube(number) for number, bend in self.bends.items() if bend.min() < -_SMOOTH]
        tubes += [self._tube(number) for number in self.rims]
        balls = [ball for vertex in range(1, self.vertices.Extent() + 1) for ball in self._balls(vertex)]
        kept, opened = ([face for index, face in faces.items() if self.opened[index] == side] for side in (False, True))
        return [*kept, *tubes, *balls], opened

    def _open(self, number: int) -> None:
        """Have an edge of openings for what it is: between two of them there is none, else a rim goes along it."""
        sides = self.sides[number]
        opened = [side for side in sides if self.opened[side.face]]
        if len(opened) == 2:
            self.bends[number] = np.zeros(_SAMPLES)
        if len(opened) != 1:
            return
        del self.bends[number]
        (side,), (beside,) = opened, [side for side in sides if not self.opened[side.face]]
        offset = self.offsets[side.face]
        assert isinstance(offset, FaceOffset)
        rim = Rim(offset, side.curve, _sign(offset, side.edge), self.by)
        line = Geom2d_Line(gp_Pnt2d(0.0, 0.0), gp_Dir2d(1.0, 0.0))
        normals = rim.normals(plane_points(line, side.parameters))
        end = _Side(len(self.offsets), side.edge, line, side.parameters, normals, side.tangents)
        self.offsets.append(rim)
        sides.append(end)
        # Where the offset of the face beside it comes through the opening by itself, no tube goes on from it.
        up, into = rim.axes(side.parameters)
        if np.min(np.arctan2(np.sum(beside.normals * up, axis=1), -np.sum(beside.normals * into, axis=1))) > -_THROUGH:
            self.rims[number] = [beside, end]

    def _pair(self, number: int) -> list[_Side]:
        """Sides that a tube round an edge runs between."""
        return self.rims.get(number) or self.sides[number]

    def _side(self, index: int, edge: TopoDS_Edge) -> _Side:
        face = self.faces[index]
        first, last = BRep_Tool.Range_s(edge)
        curve = BRep_Tool.CurveOnSurface_s(edge, as_face(face.Oriented(TopAbs_FORWARD)), first, last)
        parameters = np.linspace(first, last, _SAMPLES)
        places = plane_points(curve, parameters)
        offset = self.offsets[index]
        assert isinstance(offset, FaceOffset)
        tangents = _sign(offset, edge) * offset.tangents(curve, parameters)
        return _Side(index, edge, curve, parameters, offset.normals(places), tangents)

    def _smooth(self, number: int) -> bool:
        bend = self.bends.get(number)
        return bend is not None and bool(np.abs(bend).max() < _SMOOTH)

    def _corners(self) -> tuple[dict[int, list[Floats]], dict[tuple[int, int], int]]:
        """Corners that the faces' offsets make, numbered: places by number, and numbers by corner and face.

        Offsets of faces that are smooth at a corner make one place of it.
        """
        numbers: dict[tuple[int, int], int] = {}
        places: list[Floats] = []
        joined: list[list[int]] = []
        for number, sides in self.sides.items():
            for at, end in zip((0, -1), self.ends[number], strict=True):
                for side in sides:
                    if (end, side.face) not in numbers:
                        numbers[end, side.face] = len(places)
                        place = plane_points(side.curve, side.parameters[[at]])
                        places.append(self.offsets[side.face].points(place)[0])
                if number in self.bends and abs(self.bends[number][at]) < _SMOOTH:
                    joined.append([numbers[end, side.face] for side in sides])
        labels = connected(len(places), *np.array(joined, dtype=np.int64).reshape(-1, 2).T).tolist()
        by_label: dict[int, list[Floats]] = {}
        for place, label in zip(places, labels, strict=True):
            by_label.setdefault(label, []).append(place)
        return by_label, {corner: labels[index] for corner, index in numbers.items()}

    def _vertex(self, corner: int) -> TopoDS_Vertex:
        if corner not in self.made_vertices:
            middle = np.mean(self.places[corner], axis=0)
            reach = float(np.linalg.norm(self.places[corner] - middle, axis=1).max())
            made = TopoDS_Vertex()
            self.builder.MakeVertex(made, gp_Pnt(*middle.tolist()), _MARGIN * reach + _LEAST_TOLERANCE)
            self.made_vertices[corner] = made
        return self.made_vertices[corner]

    def _edge(self, number: int, face: int) -> TopoDS_Edge:
        """The edge that an edge becomes on a face's offset; at smooth edges both faces share it."""
        key = (number, _SHARED if self._smooth(number) else face)
        if key in self.made_edges:
            return self.made_edges[key]
        sides = [side for side in self.sides[number] if side.face == face or key[1] == _SHARED]
        sides = [side for side in sides if self.offsets[side.face].surface] or sides
        first, last = sides[0].parameters[[0, -1]].tolist()
        original = as_edge(self.edges.FindKey(number).Oriented(TopAbs_FORWARD))
        edge, off = self._bare_edge(original, sides, first, last)
        ends = [self._vertex(self.corners[end, sides[0].face]) for end in self.ends[number]]
        self._bound(edge, ends, first, last, off)
        for one in {one.face: one for one in sides}.values():
            surface = self.offsets[one.face].surface
            if surface is None:
                continue
            # At a seam the curve of the edge as it runs forwards comes first.
            backwards = [other.edge.Orientation() == TopAbs_REVERSED for other in sides]
            order = sorted(range(len(sides)), key=backwards.__getitem__)
            curves = [sides[index].curve for index in order if sides[index].face == one.face]
            self.builder.UpdateEdge(edge, *curves, surface, self.place, off)
        self.made_edges[key] = edge
        return edge

    def _bare_edge(
        self, original: TopoDS_Edge, sides: Sequence[_Side], first: float, last: float
    ) -> tuple[TopoDS_Edge, float]:
        """An edge without ends, and how far it is at most from the offsets it lies on."""

        def points(parameters: Floats, side: _Side = sides[0]) -> Floats:
            return self.offsets[side.face].points(plane_points(side.curve, parameters))

        edge, sampled = TopoDS_Edge(), points(sides[0].parameters)
        if np.linalg.norm(sampled - sampled[0], axis=1).max() < self.tolerance:
            self.builder.MakeEdge(edge)
            self.builder.Degenerated(edge, True)
            return edge, _LEAST_TOLERANCE
        curve = None if BRep_Tool.Degenerated_s(original) else closed_form_curve(original, points, first, last)
        if curve is None:
            curve = fitted_curve(points, [first, last], self.tolerance)
        parameters = np.linspace(first, last, _CLOSELY)
        on_curve = curve_points(curve, parameters)
        away = [
            float(np.linalg.norm(self.offsets[side.face].on_surface(places) - on_curve, axis=1).max())
            for side in sides
            for places in [plane_points(side.curve, parameters)]
        ]
        fit = 0.0 if isinstance(curve, Geom_Circle | Geom_Line) else self.tolerance
        off = _MARGIN * max(*away, fit) + _LEAST_TOLERANCE
        self.builder.MakeEdge(edge, curve, off)
        return edge, off

    def _bound(
        self, edge: TopoDS_Edge, ends: Sequence[TopoDS_Vertex], first: float, last: float, tolerance: float
    ) -> None:
        for end, way in zip(ends, (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
            self.builder.Add(edge, end.Oriented(way))
            self.builder.UpdateVertex(end, tolerance)
        self.builder.Range(edge, first, last)

    def _offset_face(self, index: int) -> TopoDS_Face:
        forward, made = self.faces[index].Oriented(TopAbs_FORWARD), TopoDS_Face()
        self.builder.MakeFace(made, self.offsets[index].surface, self.place, _LEAST_TOLERANCE)
        for shape in parts_of(forward, TopAbs_WIRE):
            wire = TopoDS_Wire()
            self.builder.MakeWire(wire)
            for edge in parts_of(shape.Oriented(TopAbs_FORWARD), TopAbs_EDGE):
                new = self._edge(self.edges.FindIndex(edge), index)
                self.builder.Add(wire, new.Oriented(edge.Orientation()))
            wire.Closed(True)
            self.builder.Add(made, wire.Oriented(shape.Orientation()))
        return as_face(made.Oriented(self.faces[index].Orientation()))

    def _tube(self, number: int) -> TopoDS_Face:
        sides = self._pair(number)
        first, last = sides[0].parameters[[0, -1]].tolist()
        curve = BRepAdaptor_Curve(as_edge(self.edges.FindKey(number).Oriented(TopAbs_FORWARD)))
        ways = [partial(self._inwards, side) for side in sides]
        tube = tube_round(curve, ways[0], ways[1], self.by, self.tolerance)
        made, wire = TopoDS_Face(), TopoDS_Wire()
        self.builder.MakeFace(made, tube.surface, self.place, _LEAST_TOLERANCE)
        self.builder.MakeWire(wire)
        borders = [self._edge(number, side.face) for side in sides]
        for border, across in zip(borders, (0.0, 1.0), strict=True):
            line = straight(tube.place(across, first), tube.place(across, last), first, last)
            self._lay(border, [line], tube.surface)
        (low, low_backwards), (high, high_backwards) = arcs = [
            self._arc(number, at, parameter) for at, parameter in ((0, first), (-1, last))
        ]
        lines = [
            straight(tube.place(float(backwards), at), tube.place(1.0 - backwards, at), 0.0, arc.angle)
            for (arc, backwards), at in zip(arcs, (first, last), strict=True)
        ]
        # Anticlockwise in the plane of (across, along), and the other way where the surface's parameters run so.
        middle = (first + last) / 2
        origin, beside, beyond = (tube.place(*at) for at in ((0.5, middle), (1.0, middle), (0.5, last)))
        turned = float(np.linalg.det([beside - origin, beyond - origin])) < 0
        if low is high:
            # Of a seam the curve of the edge as it runs forwards comes first.
            self._lay(low.edge, lines if low_backwards == turned else lines[::-1], tube.surface)
        else:
            for (arc, _), line in zip(arcs, lines, strict=True):
                self._lay(arc.edge, [line], tube.surface)
        loop = [
            (low.edge, low_backwards),
            (borders[1], False),
            (high.edge, not high_backwards),
            (borders[0], True),
        ]
        for edge, backwards in loop:
            self.builder.Add(wire, edge.Oriented(TopAbs_REVERSED if backwards != turned else TopAbs_FORWARD))
        wire.Closed(True)
        self.builder.Add(made, wire)
        point, along_u, along_v = (some[0] for some in derivatives(tube.surface, origin[np.newaxis]))
        towards = curve_points(curve, np.array([middle]))[0] - point
        outwards = float(np.cross(along_u, along_v) @ towards) > 0
        return as_face(made.Oriented(TopAbs_FORWARD if outwards else TopAbs_REVERSED))

    def _lay(self, edge: TopoDS_Edge, lines: Sequence[Geom2d_Curve], surface: Geom_Surface) -> None:
        """Have an edge lie on a surface, along one line or as its seam, as near as it is; it may be a point."""
        off = self.tolerance
        if not BRep_Tool.Degenerated_s(edge):
            # Both are fits: together they may be apart by more than either of them.
            curve = BRepAdaptor_Curve(edge)
            parameters = np.linspace(curve.FirstParameter(), curve.LastParameter(), _CLOSELY)
            on_lines = [derivatives(surface, plane_points(line, parameters))[0] for line in lines]
            off = max(off, float(np.linalg.norm(on_lines - curve_points(curve, parameters), axis=-1).max()))
        self.builder.UpdateEdge(edge, *lines, surface, self.place, _MARGIN * off)
        for end in parts_of(edge, TopAbs_VERTEX):
            self.builder.UpdateVertex(as_vertex(end), _MARGIN * off)

    def _inwards(self, side: _Side, parameters: Floats) -> Floats:
        return -self.offsets[side.face].normals(plane_points(side.curve, parameters))

    def _arc(self, number: int, at: int, parameter: float) -> tuple[BallArc, bool]:
        """The arc that ends the tube round an edge, and whether it runs from the second side to the first.

        Tubes that go on in each other share it.
        """
        sides, vertex = self._pair(number), self.ends[number][at]
        corners = [self.corners[vertex, side.face] for side in sides]
        key = (vertex, frozenset(corners))
        if key not in self.arcs:
            start, stop = (self._inwards(side, np.array([parameter]))[0] for side in sides)
            place = BRep_Tool.Pnt_s(as_vertex(self.vertices.FindKey(vertex)))
            edge = TopoDS_Edge()
            angle = float(np.arctan2(np.linalg.norm(np.cross(start, stop)), start @ stop))
            if corners[0] == corners[1] or angle * self.by < self.tolerance:
                angle = 1.0
                self.builder.MakeEdge(edge)
                self.builder.Degenerated(edge, True)
            else:
                axes = gp_Ax2(place, gp_Dir(*np.cross(start, stop).tolist()), gp_Dir(*start.tolist()))
                self.builder.MakeEdge(edge, Geom_Circle(axes, self.by), _MARGIN * self.tolerance)
            self._bound(edge, [self._vertex(corner) for corner in corners], 0.0, angle, _MARGIN * self.tolerance)
            self.arcs[key] = BallArc(edge, (corners[0], corners[1]), vector_of(place), start, stop, angle)
        arc = self.arcs[key]
        arc.uses += 1
        return arc, arc.corners[0] != corners[0]

    def _balls(self, vertex: int) -> Iterator[TopoDS_Face]:
        """The piece of a ball that arcs which bound only one tube each leave open round a corner."""
        arcs = [arc for (at, _), arc in self.arcs.items() if at == vertex and arc.uses == 1]
        arcs = [arc for arc in arcs if not BRep_Tool.Degenerated_s(arc.edge)]
        while arcs:
            loop = [arcs.pop()]
            start, end = loop[0].corners
            while end != start:
                following = [arc for arc in arcs if end in arc.corners]
                if len(following) != 1:
                    return
                arcs.remove(following[0])
                loop.append(following[0])
                end = next(corner for corner in following[0].corners if corner != end)
            yield ball_round(loop, self.by, self.tolerance)


def _sign(offset: FaceOffset, edge: TopoDS_Edge) -> float:
    """1 if an edge's curve runs round a face anticlockwise, seen from outside, else -1."""
    return offset.outwards * (-1.0 if edge.Orientation() == TopAbs_REVERSED else 1.0)


def _bend(one: _Side, other: _Side) -> Floats:
    """Sine of the angle by which normals turn across an edge: above 0 where it points outwards; shape (n,)."""
    return np.asarray(np.sum(one.tangents * np.cross(one.normals, other.normals), axis=1))

"""A solid put in an order that its geometry alone decides, so that the same work gives the same bytes.

Some of the kernel's algorithms go by addresses in memory, which are others at every run: their faces, edges and
vertices come in another order each time, and their edges run the other way.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_Curve, Geom_Line
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line, Geom2d_TrimmedCurve
from OCP.gp import gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.GProp import GProp_GProps
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_VERTEX,
    TopAbs_WIRE,
)
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Solid, TopoDS_Vertex

from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_vertex
from gyroid_cad.kernel.extent import bounding_box

__all__ = ["in_order", "sorted_by_place"]

Shape = TypeVar("Shape", bound=TopoDS_Shape)

# Of mm, by which places are told apart.
_DECIMALS = 6
# Of a closed edge, in parts of its length: where it goes first tells which way it runs.
_EARLY, _LATE = 0.3, 0.7


def in_order(solid: TopoDS_Solid) -> TopoDS_Solid:
    """Build a solid anew, its shells, faces, wires and edges in the order of where they are.

    Parameters
    ----------
    solid : TopoDS_Solid

    Returns
    -------
    TopoDS_Solid
        With the same surfaces; it shares no edge or vertex with the one given.
    """
    builder, made, order = BRep_Builder(), TopoDS_Solid(), _Order(solid)
    builder.MakeSolid(made)
    for shell in sorted_by_place(parts_of(solid, TopAbs_SHELL)):
        ordered = shell.Oriented(TopAbs_FORWARD).EmptyCopied()
        for face in sorted_by_place(parts_of(shell.Oriented(TopAbs_FORWARD), TopAbs_FACE)):
            builder.Add(ordered, order.face(as_face(face)))
        ordered.Closed(shell.Closed())
        builder.Add(made, ordered.Oriented(shell.Orientation()))
    return made


class _Order:
    def __init__(self, solid: TopoDS_Solid) -> None:
        self.builder = BRep_Builder()
        self.faces = [as_face(face.Oriented(TopAbs_FORWARD)) for face in sorted_by_place(parts_of(solid, TopAbs_FACE))]
        self.vertex_numbers, self.edge_numbers = NumberedShapes(), NumberedShapes()
        TopExp.MapShapes_s(solid, TopAbs_VERTEX, self.vertex_numbers)
        TopExp.MapShapes_s(solid, TopAbs_EDGE, self.edge_numbers)
        self.vertices = [
            self._vertex(as_vertex(self.vertex_numbers.FindKey(number)))
            for number in range(1, self.vertex_numbers.Extent() + 1)
        ]
        edges = [
            as_edge(self.edge_numbers.FindKey(number).Oriented(TopAbs_FORWARD))
            for number in range(1, self.edge_numbers.Extent() + 1)
        ]
        self.turned = [_runs_back(edge) and self._can_be_turned(edge) for edge in edges]
        self.edges = [self._edge(edge, turned) for edge, turned in zip(edges, self.turned, strict=True)]
        for face in self.faces:
            for edge in {
                self.edge_numbers.FindIndex(edge): as_edge(edge) for edge in parts_of(face, TopAbs_EDGE)
            }.values():
                self._carry_on(edge, face)

    def face(self, face: TopoDS_Face) -> TopoDS_Shape:
        forward = face.Oriented(TopAbs_FORWARD)
        made = forward.EmptyCopied()
        for wire in sorted_by_place(parts_of(forward, TopAbs_WIRE)):
            ordered = wire.Oriented(TopAbs_FORWARD).EmptyCopied()
            edges = [self._renewed(edge) for edge in parts_of(wire.Oriented(TopAbs_FORWARD), TopAbs_EDGE)]
            first = min(range(len(edges)), key=lambda index: _whereabouts(edges[index]))
            # Round the wire as before, from its first edge on.
            for edge in edges[first:] + edges[:first]:
                self.builder.Add(ordered, edge)
            ordered.Closed(wire.Closed())
            self.builder.Add(made, ordered.Oriented(wire.Orientation()))
        return made.Oriented(face.Orientation())

    def _renewed(self, edge: TopoDS_Shape) -> TopoDS_Shape:
        """Return an edge's successor, which runs the way that the edge does."""
        number = self.edge_numbers.FindIndex(edge) - 1
        backwards = (edge.Orientation() == TopAbs_REVERSED) != self.turned[number]
        return self.edges[number].Oriented(TopAbs_REVERSED if backwards else TopAbs_FORWARD)

    def _vertex(self, vertex: TopoDS_Vertex) -> TopoDS_Vertex:
        made = TopoDS_Vertex()
        self.builder.MakeVertex(made, BRep_Tool.Pnt_s(vertex), BRep_Tool.Tolerance_s(vertex))
        return made

    def _edge(self, edge: TopoDS_Edge, turned: bool) -> TopoDS_Edge:
        made, tolerance = TopoDS_Edge(), BRep_Tool.Tolerance_s(edge)
        first, last = BRep_Tool.Range_s(edge)
        if BRep_Tool.Degenerated_s(edge):
            self.builder.MakeEdge(made)
            self.builder.UpdateEdge(made, tolerance)
            self.builder.Degenerated(made, True)
        else:
            curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
            if turned:
                first, last = curve.ReversedParameter(last), curve.ReversedParameter(first)
            self.builder.MakeEdge(made, _plain(curve.Reversed() if turned else curve), tolerance)
        ends = [TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)]
        for end, orientation in zip(reversed(ends) if turned else ends, (TopAbs_FORWARD, TopAbs_REVERSED), strict=True):
            vertex = self.vertices[self.vertex_numbers.FindIndex(end) - 1]
            self.builder.Add(made, vertex.Oriented(orientation))
        self.builder.Range(made, first + 0.0, last + 0.0)
        return made

    def _carry_on(self, edge: TopoDS_Edge, face: TopoDS_Face) -> None:
        """Give an edge's successor its curves in the parameter plane of a face."""
        number = self.edge_numbers.FindIndex(edge) - 1
        made, turned, tolerance = self.edges[number], self.turned[number], BRep_Tool.Tolerance_s(edge)
        ways = (TopAbs_FORWARD, TopAbs_REVERSED)
        curves = [_curve_on(face, as_edge(edge.Oriented(way))) for way in ways]
        if turned:
            end = BRep_Tool.Curve_s(edge, 0.0, 0.0).ReversedParameter(0.0)
            curves = [_turned(curve, end) for curve in reversed(curves)]
        curves = [_plain_in_plane(curve) for curve in curves]
        if BRep_Tool.IsClosed_s(edge, face):
            # At a seam the face has one on either side.
            self.builder.UpdateEdge(made, *curves, face, tolerance)
        else:
            self.builder.UpdateEdge(made, curves[0], face, tolerance)

    def _can_be_turned(self, edge: TopoDS_Edge) -> bool:
        """Tell whether all of an edge's curves have parameters that still agree when they run the other way."""
        end = BRep_Tool.Curve_s(edge, 0.0, 0.0).ReversedParameter(0.0)
        faces = [face for face in self.faces if any(edge.IsSame(other) for other in parts_of(face, TopAbs_EDGE))]
        curves = [_curve_on(face, edge) for face in faces]
        return all(isinstance(curve, Geom2d_Line) or curve.ReversedParameter(0.0) == end for curve in curves)


def _curve_on(face: TopoDS_Face, edge: TopoDS_Edge) -> Geom2d_Curve:
    """Curve of an edge in the parameter plane of a face; the edge knows its ends."""
    curve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    return curve.BasisCurve() if isinstance(curve, Geom2d_TrimmedCurve) else curve


def _turned(curve: Geom2d_Curve, end: float) -> Geom2d_Curve:
    """Turn a curve so that it is at a parameter where it was at the end less that parameter."""
    made = curve.Reversed()
    if isinstance(made, Geom2d_Line):
        origin, along = made.Location(), made.Direction()
        start = curve.ReversedParameter(0.0) - end
        return Geom2d_Line(gp_Pnt2d(origin.X() + start * along.X(), origin.Y() + start * along.Y()), along)
    return made


def _plain_in_plane(curve: Geom2d_Curve) -> Geom2d_Curve:
    """As :func:`_plain`, of a curve in a parameter plane."""
    if not isinstance(curve, Geom2d_Line):
        return curve
    origin, along = curve.Location(), curve.Direction()
    return Geom2d_Line(gp_Pnt2d(origin.X() + 0.0, origin.Y() + 0.0), gp_Dir2d(along.X() + 0.0, along.Y() + 0.0))


def _plain(curve: Geom_Curve) -> Geom_Curve:
    """Return a line without a zero below zero, as if it had never been turned; other curves as they are."""
    if not isinstance(curve, Geom_Line):
        return curve
    origin, along = curve.Position().Location(), curve.Position().Direction()
    return Geom_Line(
        gp_Pnt(origin.X() + 0.0, origin.Y() + 0.0, origin.Z() + 0.0),
        gp_Dir(along.X() + 0.0, along.Y() + 0.0, along.Z() + 0.0),
    )


def _runs_back(edge: TopoDS_Edge) -> bool:
    """Tell whether an edge runs from its end that comes last, of where they are, to that which comes first."""
    if BRep_Tool.Degenerated_s(edge):
        return False
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    ends, between = (
        [_place(curve, first + part * (last - first)) for part in parts] for parts in ((0, 1), (_EARLY, _LATE))
    )
    return ends[0] > ends[1] if ends[0] != ends[1] else between[0] > between[1]


def _place(curve: Geom_Curve, parameter: float) -> tuple[float, float, float]:
    point = curve.Value(parameter)
    x, y, z = _rounded(point.X(), point.Y(), point.Z())
    return x, y, z


def sorted_by_place(shapes: Iterable[Shape]) -> list[Shape]:
    """Shapes in the order of where they are."""
    some = list(shapes)
    keys = [_whereabouts(shape) for shape in some]
    # Tight boxes of free-form faces take seconds: they are made where edges alone don't tell two shapes apart.
    extents = [bounding_box(one) if keys.count(key) > 1 else np.empty(0) for one, key in zip(some, keys, strict=True)]
    whole = [(key, *_rounded(*extent.ravel().tolist())) for key, extent in zip(keys, extents, strict=True)]
    return [some[index] for index in sorted(range(len(some)), key=whole.__getitem__)]


def _whereabouts(shape: TopoDS_Shape) -> tuple[float, ...]:
    """Length and middle of a shape's edges, and how it runs: with its extent no two have all of it in common."""
    lines = GProp_GProps()
    BRepGProp.LinearProperties_s(shape, lines)
    centre = lines.CentreOfMass()
    return (*_rounded(lines.Mass(), centre.X(), centre.Y(), centre.Z()), float(shape.Orientation().value))


def _rounded(*values: float) -> tuple[float, ...]:
    return tuple(round(value, _DECIMALS) + 0.0 for value in values)

"""A part's boundary read out of the kernel's shape as numbers (:mod:`gyroid_cad.trim.boundary`)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Curve2d, BRepAdaptor_Surface
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import Geom_BSplineSurface
from OCP.GeomAbs import (
    GeomAbs_BSplineCurve,
    GeomAbs_BSplineSurface,
    GeomAbs_Circle,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Ellipse,
    GeomAbs_Line,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_SurfaceOfExtrusion,
    GeomAbs_SurfaceOfRevolution,
    GeomAbs_Torus,
)
from OCP.gp import gp_Ax3, gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.arrays import dot
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_vertex, as_wire
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.nurbs.basis import orders, quotients
from gyroid_cad.trim.boundary import Boundary, BoundaryEdge, BoundaryFace, Coedge, StraightLine
from gyroid_cad.trim.free_surfaces import FreeForm, Swept
from gyroid_cad.trim.surfaces import PartSurface, Quadric, QuadricKind

__all__ = ["ReadBoundary", "part_surface", "read_boundary"]

Floats = NDArray[np.float64]
# From parameters (n,) to points and derivatives; from two of them to points and derivatives by s, t, ss, st and tt.
Curve = Callable[[Floats], tuple[Floats, ...]]
Derivatives = Callable[[Floats, int], tuple[Floats, ...]]
# How many a surface has up to each order, itself among them.
_COUNTS = (1, 3, 6)


@dataclass(frozen=True, slots=True, eq=False)
class ReadBoundary:
    """A boundary, and the kernel's shapes by the same numbers.

    Attributes
    ----------
    boundary : Boundary
    faces : list of TopoDS_Face
    edges : list of TopoDS_Edge
        Forward.
    vertices : list of TopoDS_Vertex
    """

    boundary: Boundary
    faces: list[TopoDS_Face]
    edges: list[TopoDS_Edge]
    vertices: list[TopoDS_Shape]


def read_boundary(shape: TopoDS_Shape) -> ReadBoundary:
    """Read the boundary of a shape, its faces in the order in which they are found there.

    Raises
    ------
    KernelError
        If an edge and its curves on the faces do not run alike.
    """
    faces = [as_face(face) for face in parts_of(shape, TopAbs_FACE)]
    edges, vertices = NumberedShapes(), NumberedShapes()
    for face in faces:
        TopExp.MapShapes_s(face, TopAbs_EDGE, edges)
        TopExp.MapShapes_s(face, TopAbs_VERTEX, vertices)
    forward = [as_edge(edges.FindKey(k).Oriented(TopAbs_FORWARD)) for k in range(1, edges.Extent() + 1)]
    corners = [as_vertex(vertices.FindKey(k)) for k in range(1, vertices.Extent() + 1)]
    boundary = Boundary(
        [_face(face, edges) for face in faces],
        [_edge(edge, vertices) for edge in forward],
        np.array([_values(BRep_Tool.Pnt_s(corner)) for corner in corners]),
    )
    return ReadBoundary(boundary, faces, forward, corners)


def _face(face: TopoDS_Face, edges: NumberedShapes) -> BoundaryFace:
    adaptor = BRepAdaptor_Surface(face, False)
    forward = as_face(face.Oriented(TopAbs_FORWARD))
    loops = [_loop(wire, forward, edges) for wire in parts_of(forward, TopAbs_WIRE)]
    low, high = np.array(corners_of(box_round([face])))
    periods = (
        adaptor.UPeriod() if adaptor.IsUPeriodic() else _round(adaptor.IsUClosed(), adaptor, "U"),
        adaptor.VPeriod() if adaptor.IsVPeriodic() else _round(adaptor.IsVClosed(), adaptor, "V"),
    )
    sign = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
    made = BoundaryFace(None, sign, loops, periods, low, high)  # type: ignore[arg-type]
    made.surface = part_surface(adaptor, made.range)
    return made


def _round(closed: bool, adaptor: BRepAdaptor_Surface, along: str) -> float:
    """Range of the parameters of a surface that closes; 0 if it does not."""
    return float(getattr(adaptor, f"Last{along}Parameter")() - getattr(adaptor, f"First{along}Parameter")()) * closed


def _loop(wire: TopoDS_Shape, face: TopoDS_Face, edges: NumberedShapes) -> list[Coedge]:
    explorer = BRepTools_WireExplorer(as_wire(wire), face)
    loop = []
    while explorer.More():
        edge = explorer.Current()
        if not BRep_Tool.SameParameter_s(edge) and not BRep_Tool.Degenerated_s(edge):
            raise KernelError("an edge of the part and its curves on the faces do not run alike")
        adaptor = BRepAdaptor_Curve2d(edge, face)
        first, last = adaptor.FirstParameter(), adaptor.LastParameter()
        along = edge.Orientation() == TopAbs_FORWARD
        loop.append(Coedge(edges.FindIndex(edge) - 1, along, _curve_on_surface(adaptor), first, last))
        explorer.Next()
    if len(loop) != sum(1 for _ in parts_of(wire, TopAbs_EDGE)):
        raise KernelError("a border of one of the part's faces does not close")
    return loop


def _edge(edge: TopoDS_Edge, vertices: NumberedShapes) -> BoundaryEdge:
    start, end = (vertices.FindIndex(which(edge)) - 1 for which in (TopExp.FirstVertex_s, TopExp.LastVertex_s))
    first, last = BRep_Tool.Range_s(edge)
    curve = None if BRep_Tool.Degenerated_s(edge) else _curve_in_space(BRepAdaptor_Curve(edge))
    return BoundaryEdge(curve, first, last, start, end, BRep_Tool.Tolerance_s(edge))


def part_surface(adaptor: BRepAdaptor_Surface, extent: tuple[Floats, Floats]) -> PartSurface:
    """Surface of a face, by formulas where it has them.

    Parameters
    ----------
    adaptor : BRepAdaptor_Surface
    extent : tuple of ndarray, shape (2,)
        Least and largest parameters.
    """
    kind = adaptor.GetType()
    if (simple := _QUADRICS.get(kind)) is not None:
        name, get, sizes = simple
        element = getattr(adaptor, get)()
        quadric = Quadric(name, *_placed(element.Position()), *(getattr(element, size)() for size in sizes))
        return replace(quadric, crossed=quadric.crosses_at(np.mean(extent, axis=0)))
    free = FreeForm(_derivatives(adaptor), *extent, _breaks(adaptor))
    if kind == GeomAbs_SurfaceOfExtrusion:
        direction = np.array(_values(adaptor.Direction()))
        return Swept(free, np.zeros(3), direction, _curve_in_space(adaptor.BasisCurve(), 2), False)
    if kind == GeomAbs_SurfaceOfRevolution:
        axis = adaptor.AxeOfRevolution()
        at, along = np.array(_values(axis.Location())), np.array(_values(axis.Direction()))
        swept = Swept(free, at, along, _curve_in_space(adaptor.BasisCurve(), 2), True)
        return swept if swept.planar else free
    return free


def _breaks(adaptor: BRepAdaptor_Surface) -> tuple[Floats, Floats]:
    """Knots of a surface along both its parameters."""
    kind, none = adaptor.GetType(), np.zeros(0)
    if kind == GeomAbs_BSplineSurface:
        spline = adaptor.BSpline()
        along_s = [spline.UKnot(k) for k in range(1, spline.NbUKnots() + 1)]
        return np.array(along_s), np.array([spline.VKnot(k) for k in range(1, spline.NbVKnots() + 1)])
    if kind in (GeomAbs_SurfaceOfExtrusion, GeomAbs_SurfaceOfRevolution):
        curve = adaptor.BasisCurve()
        if curve.GetType() == GeomAbs_BSplineCurve:
            knots = np.array([curve.BSpline().Knot(k) for k in range(1, curve.BSpline().NbKnots() + 1)])
            return (knots, none) if kind == GeomAbs_SurfaceOfExtrusion else (none, knots)
    return none, none


# What each simple surface is called here and by the kernel, and what its sizes are called.
_QUADRICS: dict[Any, tuple[QuadricKind, str, tuple[str, ...]]] = {
    GeomAbs_Plane: ("plane", "Plane", ()),
    GeomAbs_Cylinder: ("cylinder", "Cylinder", ("Radius",)),
    GeomAbs_Cone: ("cone", "Cone", ("RefRadius", "SemiAngle")),
    GeomAbs_Sphere: ("sphere", "Sphere", ("Radius",)),
    GeomAbs_Torus: ("torus", "Torus", ("MajorRadius", "MinorRadius")),
}


def _placed(position: gp_Ax3) -> tuple[Floats, Floats]:
    directions = (position.XDirection(), position.YDirection(), position.Direction())
    return np.array(_values(position.Location())), np.array([_values(direction) for direction in directions])


def _derivatives(adaptor: BRepAdaptor_Surface) -> Derivatives:
    """Points and derivatives by s, t, ss, st and tt of a surface that is none of the simple ones."""
    kind = adaptor.GetType()
    if kind == GeomAbs_BSplineSurface and (known := _of_spline(adaptor.BSpline())) is not None:
        return known
    if kind == GeomAbs_SurfaceOfRevolution:
        axis = adaptor.AxeOfRevolution()
        at, along = np.array(_values(axis.Location())), np.array(_values(axis.Direction()))
        return _of_revolution(at, along, _curve_in_space(adaptor.BasisCurve(), 2))
    if kind == GeomAbs_SurfaceOfExtrusion:
        return _of_extrusion(np.array(_values(adaptor.Direction())), _curve_in_space(adaptor.BasisCurve(), 2))

    def asked(places: Floats, order: int) -> tuple[Floats, ...]:
        made = np.empty((6, len(places), 3))
        point, vectors = gp_Pnt(), [gp_Vec() for _ in range(5)]
        ds, dt, dss, dtt, dst = vectors
        for index, (u, v) in enumerate(places.tolist()):
            adaptor.D2(u, v, point, ds, dt, dss, dtt, dst)
            for row, value in enumerate((point, ds, dt, dss, dst, dtt)):
                made[row, index] = _values(value)
        return tuple(made[: _COUNTS[order]])

    return asked


def _of_spline(spline: Geom_BSplineSurface) -> Derivatives | None:
    if spline.IsUPeriodic() or spline.IsVPeriodic():
        return None
    surface = nurbs_of_surface(spline)
    degrees, knots = (spline.UDegree(), spline.VDegree()), (surface.knots_u, surface.knots_v)
    if any(np.ptp(k[: d + 1]) or np.ptp(k[-d - 1 :]) for k, d in zip(knots, degrees, strict=True)):
        return None
    # By scipy, which looks at the few functions alone that do not vanish: lofts have a hundred along each parameter.
    weights = surface.weights[..., np.newaxis]
    rational = np.ptp(weights) > 0
    together = scipy.interpolate.NdBSpline(
        knots, np.concatenate([surface.control_points * weights, weights[..., : int(rational)]], -1), degrees
    )

    def found(places: Floats, order: int) -> tuple[Floats, ...]:
        values = {of: together(places, nu=of) for of in orders(order, 2)}
        if not rational:
            return tuple(value / surface.weights[0, 0] for value in values.values())
        above, below = ({of: value[:, part] for of, value in values.items()} for part in (slice(3), slice(3, 4)))
        return tuple(quotients(above, below).values())

    return found


def _of_revolution(origin: Floats, axis: Floats, curve: Curve) -> Derivatives:
    def found(places: Floats, order: int) -> tuple[Floats, ...]:
        s, t = places.T
        cosine, sine = np.cos(s)[:, np.newaxis], np.sin(s)[:, np.newaxis]

        def turned(vectors: Floats) -> tuple[Floats, Floats, Floats]:
            """Vectors turned about the axis (Rodrigues), and the first two derivatives of that by the angle."""
            along = dot(vectors, axis)[:, np.newaxis] * axis
            out, across = vectors - along, np.cross(axis, vectors)
            radial = cosine * out + sine * across
            return along + radial, cosine * across - sine * out, -radial

        point, rate, bend = curve(t)
        (x, ds, dss), (dt, dst, _), (dtt, _, _) = turned(point - origin), turned(rate), turned(bend)
        return (origin + x, ds, dt, dss, dst, dtt)[: _COUNTS[order]]

    return found


def _of_extrusion(direction: Floats, curve: Curve) -> Derivatives:
    def found(places: Floats, order: int) -> tuple[Floats, ...]:
        s, t = places.T
        point, rate, bend = curve(s)
        none = np.zeros_like(point)
        every = point + t[:, np.newaxis] * direction, rate, none + direction, bend, none, none
        return every[: _COUNTS[order]]

    return found


def _curve_in_space(adaptor: Any, order: int = 1) -> Curve:
    kind = adaptor.GetType()
    if kind == GeomAbs_Line:
        line = adaptor.Line()
        return StraightLine(np.array(_values(line.Location())), np.array(_values(line.Direction())))
    if kind in (GeomAbs_Circle, GeomAbs_Ellipse):
        conic = adaptor.Circle() if kind == GeomAbs_Circle else adaptor.Ellipse()
        radii = (conic.Radius(),) * 2 if kind == GeomAbs_Circle else (conic.MajorRadius(), conic.MinorRadius())
        position = conic.Position()
        axes = [
            radius * np.array(_values(axis))
            for radius, axis in zip(radii, (position.XDirection(), position.YDirection()), strict=True)
        ]
        return _ellipse(np.array(_values(position.Location())), *axes)
    if kind == GeomAbs_BSplineCurve and not adaptor.BSpline().IsPeriodic():
        spline = adaptor.BSpline()
        return _spline(spline, np.array([_values(spline.Pole(k)) for k in range(1, spline.NbPoles() + 1)]), order)

    def asked(t: Floats) -> tuple[Floats, ...]:
        found = gp_Pnt(), gp_Vec(), gp_Vec()
        made = np.empty((3, len(t), 3))
        for index, place in enumerate(t.tolist()):
            adaptor.D2(place, *found)
            made[:, index] = [_values(some) for some in found]
        return tuple(made[: order + 1])

    return asked


def _curve_on_surface(adaptor: BRepAdaptor_Curve2d) -> Curve:
    kind = adaptor.GetType()
    if kind == GeomAbs_Line:
        line = adaptor.Line()
        origin, along = line.Location(), line.Direction()
        return StraightLine(np.array([origin.X(), origin.Y()]), np.array([along.X(), along.Y()]))
    if kind == GeomAbs_BSplineCurve and not adaptor.BSpline().IsPeriodic():
        spline = adaptor.BSpline()
        poles = [spline.Pole(k) for k in range(1, spline.NbPoles() + 1)]
        return _spline(spline, np.array([(pole.X(), pole.Y()) for pole in poles]), 1)

    def asked(t: Floats) -> tuple[Floats, ...]:
        point, along = gp_Pnt2d(), gp_Vec2d()
        made = np.empty((2, len(t), 2))
        for index, place in enumerate(t.tolist()):
            adaptor.D1(place, point, along)
            made[:, index] = (point.X(), point.Y()), (along.X(), along.Y())
        return tuple(made)

    return asked


def _ellipse(centre: Floats, x: Floats, y: Floats) -> Curve:
    def found(t: Floats) -> tuple[Floats, ...]:
        cosine, sine = np.cos(t)[:, np.newaxis], np.sin(t)[:, np.newaxis]
        radial = cosine * x + sine * y
        return centre + radial, cosine * y - sine * x, -radial

    return found


def _spline(spline: Any, poles: Floats, order: int) -> Curve:
    """A B-spline curve of the kernel's, in space or in the plane, by its own basis."""
    count = spline.NbKnots()
    knots = np.repeat(
        [spline.Knot(k) for k in range(1, count + 1)], [spline.Multiplicity(k) for k in range(1, count + 1)]
    )
    degree = int(spline.Degree())
    weights = np.array([spline.Weight(k) for k in range(1, len(poles) + 1)])

    above, below = (
        scipy.interpolate.BSpline(knots, poles * weights[:, np.newaxis], degree),
        scipy.interpolate.BSpline(knots, weights[:, np.newaxis], degree),
    )
    derivatives = orders(order, 1)

    def found(t: Floats) -> tuple[Floats, ...]:
        values = {of: above(t, of[0]) for of in derivatives}
        if np.ptp(weights) == 0:
            return tuple(value / weights[0] for value in values.values())
        return tuple(quotients(values, {of: below(t, of[0]) for of in derivatives}).values())

    return found


def _values(point: Any) -> tuple[float, float, float]:
    return point.X(), point.Y(), point.Z()

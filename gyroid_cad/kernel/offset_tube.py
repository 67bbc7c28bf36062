"""Tubes round edges and balls round corners, of which the inner side of a skin is made where a part points inwards."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_CylindricalSurface, Geom_SphericalSurface, Geom_Surface, Geom_ToroidalSurface
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Wire

from gyroid_cad.common.arrays import unit
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.offset_surface import curve_points, derivatives, vector_of
from gyroid_cad.kernel.spline_fit import fitted_plane_curve, fitted_surface

__all__ = ["BallArc", "Tube", "ball_round", "between", "straight", "tube_round"]

Floats = NDArray[np.float64]

# Of lengths of 1 mm, or in parts of larger ones; and the least that edges are apart from what they lie on, in mm.
_SAME, _LEAST_TOLERANCE = 1e-9, 1e-7
_SAME_LENGTH = 1e-12
_SAMPLES = 9
_ACROSS = (0.0, 0.5, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Tube:
    """A tube's surface, and where on it the tube is.

    Attributes
    ----------
    surface : Geom_Surface
    place : callable
        Parameters of the surface, shape (2,), for how far across the tube, from 0 to 1, and a parameter along it.
    """

    surface: Geom_Surface
    place: Callable[[float, float], Floats]


def tube_round(
    curve: BRepAdaptor_Curve,
    start_at: Callable[[Floats], Floats],
    stop_at: Callable[[Floats], Floats],
    by: float,
    tolerance: float,
) -> Tube:
    """A tube round a curve: a cylinder round a line, a torus round a circle, else a fitted spline.

    Parameters
    ----------
    curve : BRepAdaptor_Curve
    start_at, stop_at : callable
        Directions from the curve to the tube's borders at parameters of the curve, shape (n, 3).
    by, tolerance : float
        The tube's radius, and that of a fit, in mm.

    Raises
    ------
    KernelError
        If no spline comes near enough.
    """
    first, last = curve.FirstParameter(), curve.LastParameter()
    parameters = np.linspace(first, last, _SAMPLES)

    def points(across: Floats, along: Floats) -> Floats:
        return curve_points(curve, along) + by * between(start_at(along), stop_at(along), across)

    expected = points(np.array(_ACROSS), parameters)
    start, stop = start_at(parameters[:1])[0], stop_at(parameters[:1])[0]
    for tube in (_cylinder(curve, start, stop, by), _torus(curve, start, stop, by)):
        if tube is not None:
            places = np.array([tube.place(across, along) for across in _ACROSS for along in parameters.tolist()])
            off = np.abs(derivatives(tube.surface, places)[0] - expected.reshape(-1, 3)).max()
            if off < _SAME * max(1.0, float(np.abs(expected).max())):
                return tube
    surface = fitted_surface(points, [0.0, 1.0], [first, last], tolerance)
    return Tube(surface, lambda across, along: np.array([across, along]))


def _cylinder(curve: BRepAdaptor_Curve, start: Floats, stop: Floats, by: float) -> Tube | None:
    if curve.GetType() != GeomAbs_Line:
        return None
    line = curve.Line()
    angle = float(np.arctan2(vector_of(line.Direction()) @ np.cross(start, stop), start @ stop))
    axes = gp_Ax3(line.Location(), line.Direction(), gp_Dir(*start.tolist()))
    return Tube(Geom_CylindricalSurface(axes, by), lambda across, along: np.array([across * angle, along]))


def _torus(curve: BRepAdaptor_Curve, start: Floats, stop: Floats, by: float) -> Tube | None:
    if curve.GetType() != GeomAbs_Circle or curve.Circle().Radius() <= (1 + _SAME) * by:
        return None
    circle = curve.Circle()
    axis = vector_of(circle.Axis().Direction())
    radial = unit(curve_points(curve, np.array([curve.FirstParameter()]))[0] - vector_of(circle.Location()))
    angles = [float(np.arctan2(way @ axis, way @ radial)) for way in (start, stop)]
    angle = (angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi
    axes = gp_Ax3(circle.Location(), circle.Axis().Direction(), circle.XAxis().Direction())
    surface = Geom_ToroidalSurface(axes, circle.Radius(), by)
    return Tube(surface, lambda across, along: np.array([along, angles[0] + across * angle]))


def between(one: Floats, other: Floats, across: Floats) -> Floats:
    """Unit vectors on great circles from some to others, each shape (n, 3), so far across; shape (k, n, 3)."""
    angles = np.arctan2(np.linalg.norm(np.cross(one, other), axis=1), np.sum(one * other, axis=1))
    sines = np.sin(angles)
    flat = sines < _SAME
    safe = np.where(flat, 1.0, sines)
    a = np.where(flat, 1 - across[:, np.newaxis], np.sin((1 - across)[:, np.newaxis] * angles) / safe)
    b = np.where(flat, across[:, np.newaxis], np.sin(across[:, np.newaxis] * angles) / safe)
    return np.asarray(a[..., np.newaxis] * one + b[..., np.newaxis] * other)


def straight(start: Floats, stop: Floats, first: float, last: float) -> Geom2d_Curve:
    """The straight line from a place to another between two parameters."""
    way, length = stop - start, float(np.linalg.norm(stop - start))
    if abs(length - (last - first)) < _SAME_LENGTH * (last - first):
        origin = start - way / length * first
        return Geom2d_Line(gp_Pnt2d(*origin.tolist()), gp_Dir2d(*way.tolist()))
    return fitted_plane_curve(
        lambda parameters: start + np.outer((parameters - first) / (last - first), way), [first, last], _SAME
    )


@dataclass(slots=True)
class BallArc:
    """Arc on the ball round a corner, between what two faces' offsets make of the corner.

    Attributes
    ----------
    edge : TopoDS_Edge
    corners : tuple of int
        Where it begins and ends, by number.
    centre, start, stop : ndarray, shape (3,)
        The corner, and the ways from it to the ends.
    angle : float
        In radians.
    uses : int
        How many tubes it bounds.
    """

    edge: TopoDS_Edge
    corners: tuple[int, int]
    centre: Floats
    start: Floats
    stop: Floats
    angle: float
    uses: int = 0


def ball_round(loop: Sequence[BallArc], by: float, tolerance: float) -> TopoDS_Face:
    """The piece of a ball that arcs bound, oriented out of the core round a corner of its part.

    Parameters
    ----------
    loop : sequence of BallArc
        One after the other.
    by, tolerance : float
        The ball's radius, and that of a fit, in mm.
    """
    builder, place = BRep_Builder(), TopLoc_Location()
    centre = loop[0].centre
    towards = unit(np.sum([unit(arc.start + arc.stop) for arc in loop], axis=0))
    side = unit(np.cross(towards, np.eye(3)[np.argmin(np.abs(towards))]))
    # Seam and poles lie as far away as they can.
    axes = gp_Ax3(gp_Pnt(*centre.tolist()), gp_Dir(*side.tolist()), gp_Dir(*(-towards).tolist()))
    surface = Geom_SphericalSurface(axes, by)
    third = np.cross(side, -towards)
    made, wire = TopoDS_Face(), TopoDS_Wire()
    builder.MakeFace(made, surface, place, _LEAST_TOLERANCE)
    builder.MakeWire(wire)
    turned, end = [], loop[0].corners[0]
    corners = []
    for arc in loop:
        forwards = arc.corners[0] == end
        end = arc.corners[1] if forwards else arc.corners[0]

        def places(parameters: Floats, arc: BallArc = arc) -> Floats:
            ways = between(arc.start[np.newaxis], arc.stop[np.newaxis], parameters / arc.angle)[:, 0]
            u = np.arctan2(ways @ third, ways @ -towards) % (2 * np.pi)
            return np.stack([u, np.arcsin(np.clip(ways @ side, -1, 1))], axis=1)

        line = fitted_plane_curve(places, [0.0, arc.angle], tolerance / by)
        builder.UpdateEdge(arc.edge, line, surface, place, 3 * tolerance)
        turned.append(arc.edge.Oriented(TopAbs_FORWARD if forwards else TopAbs_REVERSED))
        shown = places(np.linspace(0, arc.angle, _SAMPLES))
        corners += list(shown if forwards else shown[::-1])[:-1]
    x, y = np.array(corners).T
    anticlockwise = float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)) > 0
    for edge in turned if anticlockwise else [edge.Reversed() for edge in reversed(turned)]:
        builder.Add(wire, edge)
    wire.Closed(True)
    builder.Add(made, wire)
    # A ball's own normal runs away from its centre, where the core's runs towards it.
    return as_face(made.Oriented(TopAbs_REVERSED))

"""The offset of one face inwards: in closed form where its kind has one, else a spline fitted to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_Curve,
    Geom_CylindricalSurface,
    Geom_Line,
    Geom_OffsetSurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_Surface,
)
from OCP.Geom2d import Geom2d_Curve
from OCP.GeomAbs import GeomAbs_Circle, GeomAbs_Line
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from gyroid_cad.common.arrays import unit
from gyroid_cad.kernel.spline_fit import fitted_surface
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.nurbs.surface import NurbsSurface

__all__ = [
    "FaceOffset",
    "Rim",
    "closed_form_curve",
    "curve_points",
    "derivatives",
    "plane_points",
    "vector_of",
]

Floats = NDArray[np.float64]

# Of lengths of 1 mm, or in parts of larger ones.
_SAME = 1e-9
# How short one derivative is beside the other where a side of a face is a point, and how far off that place the
# normal is taken, in parts of the face.
_POLE, _BESIDE = 1e-7, 1e-6
# By how much an offset's lengths shrink where a face is bent: at 0 it has an edge, below it turns inside out.
_LEAST_STRETCH = 1e-4
_SAMPLES, _CLOSELY, _STEP = 9, 21, 1e-5
# An offset may fold if it is so wide, in parts of the least radius that a face has at a few places.
_BENT = 0.25
# The place where a face is bent most is sought in ever smaller grids.
_ZOOMS, _ROUND, _BORDER = 8, np.linspace(-1, 1, 5), 1e-4
# How far tubes go on outside an opening, in radians.
_BEYOND = 0.35


class FaceOffset:
    """The offset of a face inwards, which has the face's parameters.

    Parameters
    ----------
    face : TopoDS_Face
        Oriented out of its solid.
    by : float
        In mm; 0 of an opening, whose offset is the face itself.
    tolerance : float
        Of a fit, in mm.

    Attributes
    ----------
    surface : Geom_Surface, optional
        None where the face is bent so narrowly that nothing of its offset bounds a core.
    outwards : float
        1 if the face's parameters go round its outward normal anticlockwise, else -1.

    Raises
    ------
    KernelError
        If no spline comes near enough.
    """

    def __init__(self, face: TopoDS_Face, by: float, tolerance: float) -> None:
        self.base = BRep_Tool.Surface_s(face)
        if isinstance(self.base, Geom_RectangularTrimmedSurface):
            self.base = self.base.BasisSurface()
        self._net = _net(self.base)
        self.outwards = -1.0 if face.Orientation() == TopAbs_REVERSED else 1.0
        self.by = by
        self.bounds = np.array(BRepTools.UVBounds_s(face)).reshape(2, 2)
        self.surface: Geom_Surface | None = None
        if by == 0:
            self.surface = self.base
        elif not self.bent_away():
            self.surface = self._closed_form() or self._fitted(tolerance)

    def _derivatives(self, places: Floats) -> tuple[Floats, Floats, Floats]:
        if self._net is None:
            return derivatives(self.base, places)
        # The kernel is asked for one place at a time, which takes a hundred times as long.
        found = self._net.derivatives(*places.T)
        return found[0, 0], found[1, 0], found[0, 1]

    def normals(self, places: Floats) -> Floats:
        """Unit normals out of the solid at parameters, shape (n, 2); shape (n, 3)."""
        _, along_u, along_v = self._derivatives(places)
        found = np.cross(along_u, along_v)
        spans = np.ptp(self.bounds, axis=1)
        lengths = np.stack([np.linalg.norm(some, axis=1) for some in (along_u, along_v)]) * spans[:, np.newaxis]
        poles = lengths.min(axis=0) < _POLE * lengths.max(axis=0)
        if poles.any():
            # At a pole: the normal of what is next to it.
            moved = places[poles] + _BESIDE * (self.bounds.mean(axis=1) - places[poles])
            _, beside_u, beside_v = self._derivatives(moved)
            found[poles] = np.cross(beside_u, beside_v)
        return self.outwards * unit(found)

    def tangents(self, curve: Geom2d_Curve, parameters: Floats) -> Floats:
        """Unit tangents on the face of a curve in its parameter plane; shape (n, 3)."""
        place, way = gp_Pnt2d(), gp_Vec2d()
        places, ways = np.empty((len(parameters), 2)), np.empty((len(parameters), 2))
        for index, parameter in enumerate(parameters.tolist()):
            curve.D1(parameter, place, way)
            places[index], ways[index] = (place.X(), place.Y()), (way.X(), way.Y())
        _, along_u, along_v = self._derivatives(places)
        return unit(ways[:, :1] * along_u + ways[:, 1:] * along_v)

    def bent_away(self) -> bool:
        """True where the face is bent more than the offset is wide, all over: then nothing of it bounds a core."""
        return bool(np.all(1 - self.by * self._curvatures(self._grid(_SAMPLES)) < _LEAST_STRETCH))

    def may_fold(self, by: float) -> bool:
        """Tell whether an offset so wide, in mm, may fold: not where the face is bent far less, or alike all over."""
        if isinstance(self.base, Geom_Plane | Geom_CylindricalSurface | Geom_SphericalSurface):
            return False
        return bool(by * self._curvatures(self._grid(_SAMPLES)).max() > _BENT)

    def folding(self) -> tuple[float, float, Floats]:
        """Smallest and largest radius to which the face is bent outwards, in mm, and the place of the smallest.

        An offset between these folds over: it is turned inside out in some places and not in others.
        """
        places = self._grid(_CLOSELY)
        found = self._curvatures(places)
        least, (low, high) = found.min(), self.bounds.T
        reach = (high - low) / _CLOSELY
        for _ in range(_ZOOMS):
            # Where it is bent most more closely, but for its very border, beyond which it may not go on.
            inner = _BORDER * (high - low)
            u, v = np.clip(places[np.argmax(found)] + np.outer(_ROUND, reach), low + inner, high - inner).T
            places = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
            found, reach = self._curvatures(places), reach / 2
        worst, tiny = int(np.argmax(found)), np.finfo(float).tiny
        place = self._derivatives(places[[worst]])[0][0]
        return float(1 / max(found[worst], tiny)), float(1 / max(least, tiny)), place

    def _curvatures(self, places: Floats) -> Floats:
        """Larger principal curvature at parameters, above 0 where the face is bent outwards; shape (n,)."""
        steps = np.diag(_STEP * np.ptp(self.bounds, axis=1))
        _, *along = self._derivatives(places)
        turns = [(self.normals(places + step) - self.normals(places - step)) / (2 * step.sum()) for step in steps]
        shape = np.linalg.pinv(np.stack(along, axis=-1)) @ np.stack(turns, axis=-1)
        return np.asarray(np.linalg.eigvals(shape).real.max(axis=1))

    def points(self, places: Floats) -> Floats:
        """Points of the offset at parameters, shape (n, 2); shape (n, 3)."""
        return self._derivatives(places)[0] - self.by * self.normals(places)

    def on_surface(self, places: Floats) -> Floats:
        """Points of the surface, a fit's too, at parameters, shape (n, 2); shape (n, 3)."""
        return self.points(places) if self.surface is None else derivatives(self.surface, places)[0]

    def _closed_form(self) -> Geom_Surface | None:
        try:
            surface = Geom_OffsetSurface(self.base, -self.by * self.outwards).Surface()
        except Exception:
            return None
        if surface is None:
            return None
        places = self._grid(_SAMPLES)
        off = np.linalg.norm(derivatives(surface, places)[0] - self.points(places), axis=1).max()
        return surface if off < _SAME * max(1.0, float(np.abs(self.points(places)).max())) else None

    def _fitted(self, tolerance: float) -> Geom_Surface | None:
        def points(u: Floats, v: Floats) -> Floats:
            grid = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
            return self.points(grid).reshape(len(u), len(v), 3)

        breaks_u, breaks_v = (_breaks(self.base, way, *self.bounds[way].tolist()) for way in (0, 1))
        return fitted_surface(points, breaks_u, breaks_v, tolerance)

    def _grid(self, count: int) -> Floats:
        """So many places along either side, none of them on a side, which may be a point; shape (n, 2)."""
        u, v = (np.linspace(low, high, count + 2)[1:-1] for low, high in self.bounds)
        return np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class Rim:
    """End of the tube round an opening's border, a little outside, as the offset of a face beside it would be.

    Its parameters are those of the edge, and zero.

    Attributes
    ----------
    opening : FaceOffset
        By nothing.
    curve : Geom2d_Curve
        Of the edge in its parameters.
    sign : float
        1 if the curve runs round the opening anticlockwise, seen from outside, else -1.
    by : float
        Radius of the tube, in mm.
    """

    opening: FaceOffset
    curve: Geom2d_Curve
    sign: float
    by: float
    surface: None = None

    def axes(self, along: Floats) -> tuple[Floats, Floats]:
        """Unit vectors out of the opening, and along it away from its border; shape (n, 3) each."""
        up = self.opening.normals(plane_points(self.curve, along))
        return up, np.cross(up, self.sign * self.opening.tangents(self.curve, along))

    def normals(self, places: Floats) -> Floats:
        """Away from where the tube ends, as from a face inwards; shape (n, 3)."""
        up, into = self.axes(places[:, 0])
        return np.asarray(-np.cos(_BEYOND) * into - np.sin(_BEYOND) * up)

    def points(self, places: Floats) -> Floats:
        """Ends of the tube, shape (n, 3)."""
        on_edge = self.opening.points(plane_points(self.curve, places[:, 0]))
        return np.asarray(on_edge - self.by * self.normals(places))

    def on_surface(self, places: Floats) -> Floats:
        return self.points(places)


def _net(surface: Geom_Surface) -> NurbsSurface | None:
    """Arrays of a B-spline surface that has ends along both sides."""
    if not isinstance(surface, Geom_BSplineSurface) or surface.IsUPeriodic() or surface.IsVPeriodic():
        return None
    return nurbs_of_surface(surface)


def _breaks(surface: Geom_Surface, way: int, low: float, high: float) -> list[float]:
    """Knots of a surface between two parameters along u or v, these among them."""
    knots: list[float] = []
    if isinstance(surface, Geom_BSplineSurface):
        count = (surface.NbUKnots, surface.NbVKnots)[way]()
        knot, times = ((surface.UKnot, surface.UMultiplicity), (surface.VKnot, surface.VMultiplicity))[way]
        degree = (surface.UDegree, surface.VDegree)[way]()
        # Where the surface is no smoother than its tangents, its offset has a kink: such knots come twice.
        for index in range(1, count + 1):
            knots += (2 if times(index) >= degree - 1 else 1) * [knot(index)]
    span = high - low
    return [low, *(value for value in knots if low + 1e-6 * span < value < high - 1e-6 * span), high]


def curve_points(curve: Geom_Curve | BRepAdaptor_Curve, parameters: Floats) -> Floats:
    """Points of a curve, shape (n, 3)."""
    found = [curve.Value(parameter) for parameter in parameters.tolist()]
    return np.array([(point.X(), point.Y(), point.Z()) for point in found])


def plane_points(curve: Geom2d_Curve, parameters: Floats) -> Floats:
    """Places on a curve in a parameter plane, shape (n, 2)."""
    found = [curve.Value(parameter) for parameter in parameters.tolist()]
    return np.array([(point.X(), point.Y()) for point in found])


def derivatives(surface: Geom_Surface, places: Floats) -> tuple[Floats, Floats, Floats]:
    """Points of a surface and its derivatives along u and v at parameters, shape (n, 2); shape (n, 3) each."""
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    found = np.empty((3, len(places), 3))
    for index, (u, v) in enumerate(places.tolist()):
        surface.D1(u, v, point, along_u, along_v)
        found[0, index] = point.X(), point.Y(), point.Z()
        found[1, index] = along_u.X(), along_u.Y(), along_u.Z()
        found[2, index] = along_v.X(), along_v.Y(), along_v.Z()
    return found[0], found[1], found[2]


def closed_form_curve(
    edge: TopoDS_Edge, points_at: Callable[[Floats], Floats], first: float, last: float
) -> Geom_Curve | None:
    """The line or the circle that the points of an edge's offset lie on, with its parameter, if they do."""
    kind = BRepAdaptor_Curve(edge).GetType()
    parameters = np.linspace(first, last, _SAMPLES)
    points = points_at(parameters)
    if kind == GeomAbs_Line:
        way = (points[-1] - points[0]) / (last - first)
        origin = points[0] - first * way
        curve: Geom_Curve = Geom_Line(gp_Pnt(*origin.tolist()), gp_Dir(*way.tolist()))
    elif kind == GeomAbs_Circle:
        axis = BRepAdaptor_Curve(edge).Circle().Axis().Direction()
        normal = np.array([axis.X(), axis.Y(), axis.Z()])
        # Two radii are perpendicular to their tangents; the centre is where their planes meet the circle's.
        tangents = [np.cross(normal, points[i + 1] - points[i - 1]) for i in (1, _SAMPLES - 2)]
        across = [points[i + 1] - points[i - 1] for i in (1, _SAMPLES - 2)]
        matrix = np.array([*across, normal])
        if abs(np.linalg.det(matrix)) < _SAME * np.prod(np.linalg.norm(matrix, axis=1)) or not tangents:
            return None
        centre = np.linalg.solve(matrix, [across[0] @ points[1], across[1] @ points[-2], normal @ points[0]])
        radial = points[0] - centre
        start = np.cos(first) * radial - np.sin(first) * np.cross(normal, radial)
        axes = gp_Ax2(gp_Pnt(*centre.tolist()), gp_Dir(*normal.tolist()), gp_Dir(*start.tolist()))
        curve = Geom_Circle(axes, float(np.linalg.norm(radial)))
    else:
        return None
    off = np.linalg.norm(curve_points(curve, parameters) - points, axis=1).max()
    return curve if off < _SAME * max(1.0, float(np.abs(points).max())) else None


def vector_of(given: gp_Pnt | gp_Dir) -> Floats:
    """Coordinates of a point or a direction, shape (3,)."""
    return np.array([given.X(), given.Y(), given.Z()])

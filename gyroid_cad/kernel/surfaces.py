"""Curves and surfaces as the kernel's own: ``Geom_BSplineCurve`` and ``Geom_BSplineSurface``."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt, gp_Pnt2d, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Vertex

from gyroid_cad.kernel.compat import IntegerArray, Point2dArray, PointArray, PointGrid, RealArray, RealGrid
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface
from gyroid_cad.wall.offset import Wall, side_along

__all__ = [
    "TOLERANCE",
    "WallGeometry",
    "border_line",
    "kernel_curve",
    "kernel_knots",
    "kernel_surface",
    "nurbs_of_surface",
    "parameter_line",
    "straight_curve",
    "translation",
]

Floats = NDArray[np.float64]


def kernel_curve(curve: NurbsCurve) -> Geom_BSplineCurve:
    """The curve as a ``Geom_BSplineCurve``, rational only if its weights differ."""
    knots, multiplicities = kernel_knots(curve.knots)
    poles = PointArray(1, len(curve.control_points))
    for i, point in enumerate(curve.control_points.tolist(), 1):
        poles.SetValue(i, gp_Pnt(*point))
    if np.ptp(curve.weights) == 0:
        return Geom_BSplineCurve(poles, knots, multiplicities, curve.degree)
    return Geom_BSplineCurve(poles, _reals(curve.weights), knots, multiplicities, curve.degree)


def plane_curve(points: Floats, knots: Floats) -> Geom2d_BSplineCurve:
    """A cubic in the parameter plane, by its control points (n, 2), as a ``Geom2d_BSplineCurve``."""
    poles = Point2dArray(1, len(points))
    for index, place in enumerate(points.tolist(), 1):
        poles.SetValue(index, gp_Pnt2d(*place))
    return Geom2d_BSplineCurve(poles, *kernel_knots(knots), 3)


def kernel_surface(surface: NurbsSurface) -> Geom_BSplineSurface:
    """The surface as a ``Geom_BSplineSurface``, rational only if its weights differ."""
    n, m = surface.weights.shape
    poles = PointGrid(1, n, 1, m)
    for i, row in enumerate(surface.control_points.tolist(), 1):
        for j, point in enumerate(row, 1):
            poles.SetValue(i, j, gp_Pnt(*point))
    knots_u, multiplicities_u = kernel_knots(surface.knots_u)
    knots_v, multiplicities_v = kernel_knots(surface.knots_v)
    rest = (knots_u, knots_v, multiplicities_u, multiplicities_v, surface.degree_u, surface.degree_v)
    if not surface.rational:
        return Geom_BSplineSurface(poles, *rest)
    weights = RealGrid(1, n, 1, m)
    for i, values in enumerate(surface.weights.tolist(), 1):
        for j, value in enumerate(values, 1):
            weights.SetValue(i, j, value)
    return Geom_BSplineSurface(poles, weights, *rest)


def nurbs_of_surface(surface: Geom_BSplineSurface) -> NurbsSurface:
    """Arrays of a B-spline surface that the kernel holds."""
    rows, columns = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1)
    # As one array: to ask for every pole by itself takes twice as long.
    poles = surface.Poles()
    points = np.array([[poles.Value(i, j).Coord() for j in columns] for i in rows])
    weights = np.ones(points.shape[:2])
    if surface.IsURational() or surface.IsVRational():
        weights = np.array([[surface.Weight(i, j) for j in columns] for i in rows])
    knots_u = np.repeat(
        [surface.UKnot(i) for i in range(1, surface.NbUKnots() + 1)],
        [surface.UMultiplicity(i) for i in range(1, surface.NbUKnots() + 1)],
    )
    knots_v = np.repeat(
        [surface.VKnot(i) for i in range(1, surface.NbVKnots() + 1)],
        [surface.VMultiplicity(i) for i in range(1, surface.NbVKnots() + 1)],
    )
    return NurbsSurface(points, weights, knots_u, knots_v)


def kernel_knots(vector: Floats) -> tuple[RealArray, IntegerArray]:
    """Distinct knots and their multiplicities."""
    return _knot_arrays(tuple(vector.tolist()))


@lru_cache(maxsize=64)
def _knot_arrays(vector: tuple[float, ...]) -> tuple[RealArray, IntegerArray]:
    """Distinct knots and their multiplicities; the kernel copies them, so one pair serves all."""
    values, counts = np.unique(vector, return_counts=True)
    multiplicities = IntegerArray(1, len(counts))
    for i, count in enumerate(counts.tolist(), 1):
        multiplicities.SetValue(i, count)
    return _reals(values), multiplicities


def _reals(values: Floats) -> RealArray:
    array = RealArray(1, len(values))
    for i, value in enumerate(values.tolist(), 1):
        array.SetValue(i, value)
    return array


# The kernel's own smallest distance (Precision::Confusion): shared edges agree to rounding.
TOLERANCE = 1e-7


class WallGeometry:
    """Curves and surfaces by patch, in the patch's own place; and the location that carries them to where they belong.

    Parameters
    ----------
    wall : Wall
    """

    def __init__(self, wall: Wall) -> None:
        self.wall = wall
        # One location object a translation: the kernel compares locations by how they were made.
        self._locations = [translation(shift) for shift in wall.shifts.tolist()]
        self._patch_net, self._patch_shift = wall.patch_net.tolist(), wall.patch_shift.tolist()
        self._forward = wall.complex.edge_forward.tolist()
        self._faces: dict[tuple[int, int], Geom_BSplineSurface] = {}
        self._rims: dict[tuple[int, int, int, bool], Geom_BSplineCurve] = {}

    def location(self, patch: int) -> TopLoc_Location:
        return self._locations[self._patch_shift[patch]]

    def face(self, patch: int, side: int) -> Geom_BSplineSurface:
        """A side of the wall, or from :func:`side_along` on the ruled surface through it along a border."""
        key = (self._patch_net[patch], side)
        if key not in self._faces:
            net, edge = key[0], side - side_along(0)
            self._faces[key] = kernel_surface(self.wall.face(*key) if edge < 0 else self.wall.side_wall(net, edge))
        return self._faces[key]

    def face_edge(self, patch: int, k: int, side: int) -> Geom_BSplineCurve:
        """Border curve k of a face, run the way the complex's edge runs, on [-1, 1]."""
        forward = self._forward[patch][k]
        key = (self._patch_net[patch], k, side, forward)
        if key not in self._rims:
            curve = self.wall.face(self._patch_net[patch], side).edge(k)
            self._rims[key] = kernel_curve(curve if forward else curve.reversed())
        return self._rims[key]

    def border(self, patch: int, k: int) -> Geom2d_Line:
        """Border k in the parameter plane, run the way the complex's edge runs."""
        return border_line(k, self._forward[patch][k])


def straight_curve(start: TopoDS_Vertex, end: TopoDS_Vertex) -> Geom_BSplineCurve:
    """The straight curve from a vertex to another, on [-1, 1]."""
    ends = np.array([(point.X(), point.Y(), point.Z()) for point in map(BRep_Tool.Pnt_s, (start, end))])
    return kernel_curve(NurbsCurve(ends, np.ones(2), np.array([-1.0, -1.0, 1.0, 1.0])))


def parameter_line(u: float, v: float, du: float, dv: float) -> Geom2d_Line:
    """The line in the parameter plane through (u, v) towards (du, dv)."""
    return Geom2d_Line(gp_Pnt2d(u, v), gp_Dir2d(du, dv))


@lru_cache(maxsize=8)
def border_line(k: int, forward: bool) -> Geom2d_Line:
    """Side k of the square in the parameter plane, run round it or against that."""
    start, (du, dv) = ((0, -1), (1, 0), (0, 1), (-1, 0))[k], ((1, 0), (0, 1), (-1, 0), (0, -1))[k]
    return parameter_line(*start, du, dv) if forward else parameter_line(*start, -du, -dv)


def translation(shift: list[float]) -> TopLoc_Location:
    """Location of what is shifted by so many mm along x, y and z."""
    transformation = gp_Trsf()
    transformation.SetTranslation(gp_Vec(*shift))
    return TopLoc_Location(transformation)

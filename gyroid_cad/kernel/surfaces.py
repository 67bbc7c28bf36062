"""Curves and surfaces as the kernel's own: ``Geom_BSplineCurve`` and ``Geom_BSplineSurface``."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.gp import gp_Pnt

from gyroid_cad.kernel.compat import IntegerArray, PointArray, PointGrid, RealArray, RealGrid
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface

__all__ = ["kernel_curve", "kernel_knots", "kernel_surface", "nurbs_of_surface"]

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
    """What the kernel holds, read back into arrays."""
    n, m = surface.NbUPoles(), surface.NbVPoles()
    poles = [[surface.Pole(i, j) for j in range(1, m + 1)] for i in range(1, n + 1)]
    weights = [[surface.Weight(i, j) for j in range(1, m + 1)] for i in range(1, n + 1)]
    knots_u = np.repeat(
        [surface.UKnot(i) for i in range(1, surface.NbUKnots() + 1)],
        [surface.UMultiplicity(i) for i in range(1, surface.NbUKnots() + 1)],
    )
    knots_v = np.repeat(
        [surface.VKnot(i) for i in range(1, surface.NbVKnots() + 1)],
        [surface.VMultiplicity(i) for i in range(1, surface.NbVKnots() + 1)],
    )
    points = np.array([[(p.X(), p.Y(), p.Z()) for p in row] for row in poles])
    return NurbsSurface(points, np.array(weights), knots_u, knots_v)


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

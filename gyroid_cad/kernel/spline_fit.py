"""Curves and surfaces of the kernel through points that are computed, with a deviation that is measured."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Pnt2d

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.compat import Point2dArray
from gyroid_cad.kernel.surfaces import kernel_curve, kernel_knots, kernel_surface
from gyroid_cad.nurbs.basis import greville
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface

__all__ = ["fitted_curve", "fitted_plane_curve", "fitted_surface"]

Floats = NDArray[np.float64]

_DEGREE = 3
# Intervals of a curve, and of a surface along either side, at most.
_MOST_INTERVALS, _MOST_ON_SIDE = 2048, 256
# Between two places that are interpolated the deviation is largest about in the middle.
_BETWEEN = (0.25, 0.5, 0.75)
_LINES_CHECKED = 16
# How little a finer spline must gain to be the last, and how far off that one may be, in tolerances.
_STALLED, _LENIENT = 0.7, 10.0


def fitted_curve(points_at: Callable[[Floats], Floats], breaks: Sequence[float], tolerance: float) -> Geom_BSplineCurve:
    """Cubic B-spline curve through places of a curve, with its parameter.

    Parameters
    ----------
    points_at : callable
        Points, shape (n, 3), at parameters, shape (n,).
    breaks : sequence of float
        Parameters between which the curve is smooth, from its start to its end.
    tolerance : float
        In mm.

    Raises
    ------
    KernelError
        If no spline comes so near.
    """
    knots, poles = _curve(points_at, breaks, tolerance)
    return kernel_curve(NurbsCurve(poles, np.ones(len(poles)), knots))


def fitted_plane_curve(
    places_at: Callable[[Floats], Floats], breaks: Sequence[float], tolerance: float
) -> Geom2d_BSplineCurve:
    """The same in a parameter plane: places of shape (n, 2)."""
    knots, poles = _curve(places_at, breaks, tolerance)
    array = Point2dArray(1, len(poles))
    for index, place in enumerate(poles.tolist(), 1):
        array.SetValue(index, gp_Pnt2d(*place))
    return Geom2d_BSplineCurve(array, *kernel_knots(knots), _DEGREE)


def _curve(points_at: Callable[[Floats], Floats], breaks: Sequence[float], tolerance: float) -> tuple[Floats, Floats]:
    count = 1
    while True:
        ends = _divided(np.asarray(breaks, dtype=float), count)
        knots = _knots(ends, breaks)
        places = greville(knots, _DEGREE)
        spline = scipy.interpolate.make_interp_spline(places, points_at(places), k=_DEGREE, t=knots)
        between = np.concatenate([ends[:-1] + part * np.diff(ends) for part in _BETWEEN])
        if np.abs(spline(between) - points_at(between)).max() < tolerance:
            return spline.t, spline.c
        if len(ends) > _MOST_INTERVALS:
            raise KernelError(f"no spline comes within {tolerance:.2g} mm of a curve")
        count *= 2


def fitted_surface(
    points_at: Callable[[Floats, Floats], Floats],
    breaks_u: Sequence[float],
    breaks_v: Sequence[float],
    tolerance: float,
) -> Geom_BSplineSurface:
    """Bicubic B-spline surface through places of a surface, with its parameters.

    Parameters
    ----------
    points_at : callable
        Points, shape (n, m, 3), at n parameters u and m parameters v.
    breaks_u, breaks_v : sequence of float
        Parameters between which the surface is smooth, from its start to its end; twice where it has a kink.
    tolerance : float
        In mm; ten times as much where the surface has kinks, which no spline comes nearer to.

    Raises
    ------
    KernelError
        If no spline comes so near.
    """
    counts, before = [1, 1], np.inf
    while True:
        ends = [_divided(np.unique(breaks), count) for breaks, count in zip((breaks_u, breaks_v), counts, strict=True)]
        knots = [_knots(some, breaks) for some, breaks in zip(ends, (breaks_u, breaks_v), strict=True)]
        u, v = (greville(some, _DEGREE) for some in knots)
        along = scipy.interpolate.make_interp_spline(u, points_at(u, v), k=_DEGREE, t=knots[0])
        poles = scipy.interpolate.make_interp_spline(v, along.c.swapaxes(0, 1), k=_DEGREE, t=knots[1]).c.swapaxes(0, 1)
        off = [
            np.abs(_evaluated(poles, knots, *places) - points_at(*places)).max()
            for places in ((_between(ends[0]), _some(v)), (_some(u), _between(ends[1])))
        ]
        # Where the given surface has kinks of its own, finer splines come no nearer.
        stalled = max(off) > _STALLED * before and max(off) < _LENIENT * tolerance
        if max(off) < tolerance or stalled:
            return kernel_surface(NurbsSurface(poles, np.ones(poles.shape[:2]), *knots))
        if max(map(len, ends)) > _MOST_ON_SIDE:
            raise KernelError(f"no spline comes within {tolerance:.2g} mm of a surface; it is {max(off):.2g} mm off")
        before = max(off)
        counts = [count * 2 if far > tolerance / 2 else count for count, far in zip(counts, off, strict=True)]


def _evaluated(poles: Floats, knots: Sequence[Floats], u: Floats, v: Floats) -> Floats:
    along = scipy.interpolate.BSpline(knots[0], poles, _DEGREE)(u).swapaxes(0, 1)
    return np.asarray(scipy.interpolate.BSpline(knots[1], along, _DEGREE)(v).swapaxes(0, 1))


def _some(places: Floats) -> Floats:
    return places[:: max(1, len(places) // _LINES_CHECKED)]


def _divided(breaks: Floats, count: int) -> Floats:
    """Ends of as many intervals between each two breaks."""
    parts = np.arange(count) / count
    return np.append((breaks[:-1, np.newaxis] + parts * np.diff(breaks)[:, np.newaxis]).ravel(), breaks[-1])


def _knots(ends: Floats, breaks: Sequence[float]) -> Floats:
    values, counts = np.unique(breaks, return_counts=True)
    kinks = np.isin(ends, values[counts > 1])
    inner = np.repeat(ends, np.where(kinks, _DEGREE, 1))
    return np.concatenate([np.repeat(ends[0], _DEGREE), inner, np.repeat(ends[-1], _DEGREE)])


def _between(ends: Floats) -> Floats:
    return np.sort(np.concatenate([ends[:-1] + part * np.diff(ends) for part in _BETWEEN]))

"""Cubic splines through stations of section curves: how many stations, on what knots, and how close is close."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.basis import basis

__all__ = [
    "BETWEEN",
    "NEAR_ENOUGH",
    "chord_lengths",
    "close_enough",
    "more_stations",
    "on_section",
    "section_knots",
    "spread_along",
    "through_stations",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Through so many stations; the fewest that are close, or the most if near enough, in cell sizes.
_STATIONS = np.array([3, 4, 6, 8, 12, 16, 20, 24, 28, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 256])
_CLOSE, NEAR_ENOUGH = 1e-7, 2e-6
# In mm, whatever the cell: readers of STEP give edges the kernel's smallest tolerance, 1e-7 mm, or what they see at
# some places of a curve; its Boolean operations refuse edges that are further from their faces anywhere. Between the
# places where it is measured here a curve is up to a tenth further.
_CLOSE_IN_MM = 8.5e-8
# With what power of their number the distance falls.
_ORDER = 4
# Where the distance is measured, in steps beyond each station: where a face's curvature leaps, at a knot of its
# maker's, it is not largest halfway.
BETWEEN = np.array([0.25, 0.5, 0.75])
# So many functions on either side of its own do not vanish at a station that is nearly in its even place.
_BAND = 4
# In steps between stations.
_UNEVEN = 0.75


def close_enough(cell_size: float) -> float:
    """Distance in mm of a curve from its faces that leaves nothing to gain from more stations."""
    return min(_CLOSE * cell_size, _CLOSE_IN_MM)


@lru_cache
def section_knots(control_points: int) -> Floats:
    """Knots on [0, 1] of a cubic through as many evenly spaced stations, none at the second and last but one."""
    inner = np.linspace(0, 1, control_points)[2:-2]
    return np.concatenate([np.zeros(4), inner, np.ones(4)])


def on_section(control: Floats, t: Floats, derivative: int = 0) -> Floats:
    """Points of a curve through stations, or its rate of change, at parameters in [0, 1], from its control points."""
    return np.asarray(_section_basis(len(control), np.asarray(t, float).tobytes(), derivative) @ control)


@lru_cache(maxsize=256)
def _section_basis(control_points: int, t: bytes, derivative: int) -> Floats:
    """Most curves are looked at in the same places: at evenly spread ones, or at Gauss points from end to end."""
    return basis(section_knots(control_points), 3, np.frombuffer(t), derivative)


def chord_lengths(points: Floats) -> Floats:
    """Length of the chords up to each of points (..., k, d), in parts of all; not numbers if there is none."""
    run = np.cumsum(np.linalg.norm(np.diff(points, axis=-2, prepend=points[..., :1, :]), axis=-1), axis=-1)
    with np.errstate(invalid="ignore"):
        return np.asarray(run / run[..., -1:])


def spread_along(ways: Sequence[Floats] | Floats, runs: Sequence[Floats] | Floats, t: Floats) -> Floats:
    """Places of each way (k, d) at parameters t, where its own points have parameters ``runs``; shape (ways, q, d)."""
    # All in one row, each beyond the one before it.
    known = np.concatenate([np.nan_to_num(run) + 2.0 * number for number, run in enumerate(runs)])
    asked = t + 2.0 * np.arange(len(ways))[:, np.newaxis]
    return np.stack([np.interp(asked, known, column) for column in np.concatenate(ways).T], axis=-1)


def more_stations(counts: Integers, excess: Floats) -> Integers:
    """Numbers of stations that are likely to be enough; 0 where those there are cannot be improved on."""
    most = len(_STATIONS) - 1
    likely = counts * np.where(np.isfinite(excess), excess, 1.0) ** (1 / _ORDER)
    following = np.maximum(np.searchsorted(_STATIONS, likely), np.searchsorted(_STATIONS, counts, side="right"))
    done = (excess <= 1) | (counts == _STATIONS[-1]) | (counts == 0)
    return np.where(done, 0, _STATIONS[np.minimum(following, most)])


def through_stations(points: Floats, values: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Control points of splines whose parameter is the chord length, on :func:`section_knots`.

    Parameters
    ----------
    points : ndarray, shape (m, n, 3)
        Stations, nearly evenly spread.
    values : ndarray, shape (m, n, k)
        What the splines are to be there.

    Returns
    -------
    control : ndarray, shape (m, n, k)
    crowded : ndarray of bool, shape (m,)
        Where stations are too unevenly spread: the control points mean nothing.
    """
    t, count = chord_lengths(points), points.shape[1]
    through = basis(section_knots(count), 3, t.ravel()).reshape(len(t), count, count)
    # A spline goes through stations only where each lies well within a function of its own (Schoenberg and Whitney):
    # nearly even ones do.
    crowded = ~np.all(np.isfinite(t), axis=1)
    crowded |= np.abs(t - np.linspace(0, 1, count)).max(axis=1) * (count - 1) > _UNEVEN
    through[crowded] = np.eye(count)
    return _solved(through, values), crowded


def _solved(through: Floats, values: Floats) -> Floats:
    """Solutions of many systems at once, by elimination in the band that a spline's functions leave.

    Without pivots, for a matrix of B-splines is totally positive (de Boor and Pinkus).
    """
    through, values = through.copy(), values.copy()
    count = through.shape[1]
    for k in range(count - 1):
        rows, columns = slice(k + 1, k + 1 + _BAND), slice(k, k + 1 + 2 * _BAND)
        factor = through[:, rows, k] / through[:, [k], k]
        through[:, rows, columns] -= factor[..., None] * through[:, [k], columns]
        values[:, rows] -= factor[..., None] * values[:, [k]]
    for k in range(count - 1, -1, -1):
        above = slice(k + 1, k + 1 + 2 * _BAND)
        values[:, k] -= np.einsum("mj,mjc->mc", through[:, k, above], values[:, above])
        values[:, k] /= through[:, k, k, None]
    return values

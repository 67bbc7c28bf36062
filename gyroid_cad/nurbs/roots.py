"""Root finding: where sampled functions vanish, where lines meet surfaces, and which places are nearest to points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot

__all__ = ["foot_step", "line_step", "nearest_places", "roots"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_NEWTON_STEPS, _TURNING_STEPS = 40, 6
# What a step of Newton's method leaves is its square; what one by bisection leaves is as long as itself.
_CONVERGED, _SQUARED = 1e-14, 1e-9
_ROUNDING = 1e-13
# A parabola that turns back between samples comes at most an eighth of its second difference nearer zero than they do.
_HIDDEN = 1 / 4
# Steps to the nearest place, and how small the last is, whose square is what it leaves.
_NEAREST_STEPS, _NEAREST_CONVERGED = 40, 1e-8
# How long the first step may be, in the square's parameters; and how far a squared distance must bend upwards at least,
# in parts of the squared derivatives.
_FIRST_REACH, _BENT = 0.5, 1e-3


def roots(
    samples: Floats, values: Floats, at: Callable[[Integers, Floats], tuple[Floats, Floats]]
) -> tuple[Integers, Floats]:
    """Find the places where functions change sign.

    Parameters
    ----------
    samples : ndarray, shape (k,)
        Evenly spaced, so close that the functions are all but parabolas between three of them. The first and the last
        lie beyond where roots are wanted, and only tell how the functions bend.
    values : ndarray, shape (m, k)
        Of m functions.
    at : callable
        From which functions, shape (n,), and places, shape (n,), to values and rates of change.

    Returns
    -------
    which : ndarray of int, shape (n,)
    places : ndarray, shape (n,)
        In the order of the functions, then of the places.
    """
    above = values > 0
    which, index = np.nonzero(above[:, 2:-1] != above[:, 1:-2])
    low, high = samples[index + 1], samples[index + 2]
    low_value, high_value = values[which, index + 1], values[which, index + 2]
    turned, before, turn, turn_value = _turns(samples, values, at)
    which = np.concatenate([which, turned, turned])
    low, high = np.concatenate([low, samples[before], turn]), np.concatenate([high, turn, samples[before + 1]])
    low_value = np.concatenate([low_value, values[turned, before], turn_value])
    high_value = np.concatenate([high_value, turn_value, values[turned, before + 1]])
    place = low + (high - low) * low_value / (low_value - high_value)
    left = np.arange(len(which))
    for _ in range(_NEWTON_STEPS):
        here = place[left]
        value, rate = at(which[left], here)
        early = (value > 0) == (low_value[left] > 0)
        low[left], high[left] = np.where(early, here, low[left]), np.where(early, high[left], here)
        with np.errstate(divide="ignore", invalid="ignore"):
            nearer = here - value / rate
        astray = ~((nearer >= low[left] - _CONVERGED) & (nearer <= high[left] + _CONVERGED))
        place[left] = np.where(astray, (low[left] + high[left]) / 2, np.clip(nearer, low[left], high[left]))
        left = left[np.abs(place[left] - here) >= np.where(astray, _CONVERGED, _SQUARED)]
        if not len(left):
            break
    order = np.lexsort((place, which))
    return which[order], place[order]


def _turns(
    samples: Floats, values: Floats, at: Callable[[Integers, Floats], tuple[Floats, Floats]]
) -> tuple[Integers, Integers, Floats, Floats]:
    """Functions that turn back beyond zero between two samples: the sample before, the place, and the value there."""
    here = values[:, 1:-1]
    with np.errstate(invalid="ignore"):
        bend = values[:, :-2] - 2 * here + values[:, 2:]
        near = (np.sign(here) * bend > 0) & (np.abs(here) < _HIDDEN * np.abs(bend))
    which, index = np.nonzero(near)
    # Of parabolas through three samples: their vertices lie next to the middle ones.
    step, index, bend = samples[1] - samples[0], index + 1, bend[which, index]
    turn = samples[index] + step * (values[which, index - 1] - values[which, index + 1]) / (2 * bend)
    for _ in range(_TURNING_STEPS):
        turn = np.clip(turn - step**2 * at(which, turn)[1] / bend, samples[index - 1], samples[index + 1])
    before = np.where(turn < samples[index], index - 1, index)
    value = at(which, turn)[0]
    above = values[which, before] > 0
    # What reaches zero by no more than rounding touches it.
    beyond = ((value > 0) != above) & (np.abs(value) > _ROUNDING * np.abs(values[which]).max(axis=1, initial=0.0))
    same = (values[which, before + 1] > 0) == above
    wanted = np.flatnonzero(beyond & same & (before >= 1) & (before < len(samples) - 2))
    # Two neighbours may both see one turn.
    _, first = np.unique(np.stack([which, before])[:, wanted], axis=1, return_index=True)
    wanted = wanted[first]
    return which[wanted], before[wanted], turn[wanted], value[wanted]


def line_step(away: Floats, du: Floats, dv: Floats, direction: Floats) -> tuple[Floats, Floats, Floats]:
    """One step of Newton's method to where a line meets a surface: to where it meets the tangent plane.

    Parameters
    ----------
    away : ndarray, shape (..., 3)
        From a point of the line to a place of the surface.
    du, dv : ndarray, shape (..., 3)
        Derivatives of the surface there.
    direction : ndarray, shape (..., 3)
        Of the line.

    Returns
    -------
    u, v : ndarray, shape (...)
        Steps of the parameters.
    distance : ndarray, shape (...)
        From the point to where the line meets the plane, in lengths of the direction.
    """
    normal = np.cross(du, dv)
    distance = dot(away, normal) / dot(direction, normal)
    left, squared = distance[..., np.newaxis] * direction - away, dot(normal, normal)
    return dot(np.cross(left, dv), normal) / squared, dot(np.cross(du, left), normal) / squared, distance


def foot_step(
    apart: Floats, du: Floats, dv: Floats, duu: Floats, duv: Floats, dvv: Floats
) -> tuple[Floats, Floats, Booleans]:
    """One step of Newton's method to the foot of a perpendicular (The NURBS Book, eq. (6.6)).

    Parameters
    ----------
    apart : ndarray, shape (..., 3)
        From a place of the surface to the point.
    du, dv, duu, duv, dvv : ndarray, shape (..., 3)
        Derivatives of the surface there.

    Returns
    -------
    u, v : ndarray, shape (...)
        Steps of the parameters.
    sound : ndarray of bool, shape (...)
        Whether there is a nearest place nearby: not past the centre of curvature, where the steps mean nothing.
    """
    a, b, c = _hessian(apart, du, dv, duu, duv, dvv)
    along_u, along_v = dot(apart, du), dot(apart, dv)
    determinant = a * c - b * b
    sound = (determinant > 0) & (a > 0)
    determinant = np.where(sound, determinant, 1.0)
    return (c * along_u - b * along_v) / determinant, (a * along_v - b * along_u) / determinant, sound


def _hessian(apart: Floats, du: Floats, dv: Floats, *bends: Floats) -> tuple[Floats, Floats, Floats]:
    """Second derivatives by uu, uv and vv of half the squared distance."""
    duu, duv, dvv = bends
    return dot(du, du) - dot(apart, duu), dot(du, dv) - dot(apart, duv), dot(dv, dv) - dot(apart, dvv)


def nearest_places(
    points: Floats, u: Floats, v: Floats, derivatives: Callable[[Floats, Floats], tuple[Floats, ...]]
) -> tuple[Floats, Floats, Floats]:
    """Places of surfaces on [-1, 1]^2 that are nearest to points, found by Newton's method from places near them.

    Steps keep within a region that gets smaller where one led further away, and within the square: on its border they
    go on along it (projected Newton steps in a trust region; Nocedal and Wright, Numerical Optimization, ch. 4, 16.7).

    Parameters
    ----------
    points : ndarray, shape (n, 3)
    u, v : ndarray, shape (n,)
        Where to start, each on a surface of its own.
    derivatives : callable
        From places u, v, shape (n,), to points and derivatives by u, v, uu, uv and vv, shape (n, 3).

    Returns
    -------
    u, v, distance : ndarray, shape (n,)
        No further away than where they started.
    """
    place = np.stack([u, v], axis=-1)
    found = derivatives(*place.T)
    distance, reach = np.linalg.norm(points - found[0], axis=-1), np.full(len(points), _FIRST_REACH)
    for _ in range(_NEAREST_STEPS):
        tried = np.clip(place + _downhill(place, points, found, reach), -1, 1)
        length = np.abs(tried - place).max(axis=1)
        there = derivatives(*tried.T)
        away = np.linalg.norm(points - there[0], axis=-1)
        nearer = away <= distance
        reach = np.where(nearer, 2 * reach, length / 4)
        place, distance = np.where(nearer[:, np.newaxis], tried, place), np.where(nearer, away, distance)
        if length.max(initial=0.0) < _NEAREST_CONVERGED:
            break
        found = tuple(np.where(nearer[:, np.newaxis], new, old) for new, old in zip(there, found, strict=True))
    return place[:, 0], place[:, 1], distance


def _downhill(place: Floats, points: Floats, found: tuple[Floats, ...], reach: Floats) -> Floats:
    """Steps in the square by which the squared distance falls, none longer than is allowed; shape (n, 2)."""
    apart, (du, dv, *_) = points - found[0], found[1:]
    slope = np.stack([dot(apart, du), dot(apart, dv)], axis=-1)
    # Out of the square there is nowhere to go: what is left is along the border.
    stuck = (np.abs(place) == 1) & (slope * place > 0)
    a, b, c = _hessian(apart, *found[1:])
    b = np.where(stuck.any(axis=1), 0.0, b)
    # Bent so far that the quadratic has a least value: added to both diagonal entries.
    least = (a + c) / 2 - np.hypot((a - c) / 2, b)
    added = np.maximum(_BENT * (dot(du, du) + dot(dv, dv)) - least, 0)
    a, c = a + added, c + added
    determinant = a * c - b * b
    step = np.stack([c * slope[:, 0] - b * slope[:, 1], a * slope[:, 1] - b * slope[:, 0]], axis=-1)
    step = np.where(stuck, 0.0, step / determinant[:, np.newaxis])
    longest = np.abs(step).max(axis=1)
    return np.asarray(step * np.minimum(1.0, reach / np.maximum(longest, reach))[:, np.newaxis])

"""Roots of sampled functions, pairs of them that hide between two samples included."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["roots"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_NEWTON_STEPS, _TURNING_STEPS = 40, 3
_CONVERGED = 1e-14
_ROUNDING = 1e-13
# A parabola that turns back between samples comes at most an eighth of its second difference nearer zero than they do.
_HIDDEN = 1 / 4


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
    for _ in range(_NEWTON_STEPS):
        value, rate = at(which, place)
        early = (value > 0) == (low_value > 0)
        low, high = np.where(early, place, low), np.where(early, high, place)
        with np.errstate(divide="ignore", invalid="ignore"):
            nearer = place - value / rate
        astray = ~((nearer >= low - _CONVERGED) & (nearer <= high + _CONVERGED))
        nearer = np.where(astray, (low + high) / 2, np.clip(nearer, low, high))
        step, place = np.max(np.abs(nearer - place), initial=0.0), nearer
        if step < _CONVERGED:
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

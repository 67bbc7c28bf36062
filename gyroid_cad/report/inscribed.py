"""Spheres inscribed in the pores: centres moved until their spheres are as large as they get, each sphere once."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array

from gyroid_cad.wall.distances import Feet, WallFaces, tree_of

__all__ = ["distinct", "settled"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Samples of the walls looked at round a centre, which is as near to three walls or more.
_TOUCHING = 200
# Centres are moved until the radius they gain is this part of the grid's spacing; coarser where they are many.
_SETTLED, _SETTLED_ENOUGH = 1e-6, 1e-3
_MANY = 100
_MOST_MOVES = 40
# One step of the linear programme must give this part of what it promises, or the next is to be shorter.
_KEPT_PROMISE = 0.25


def settled(faces: WallFaces, centres: Floats, radii: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Move centres until their spheres are as large as they get.

    The radius is the least of the distances to the feet, and each of these grows with the way along its own
    direction: a linear programme says where all of them grow most, within a step that gets shorter where it promised
    too much (sequential linear programming).
    """
    centres, radii = centres.copy(), radii.copy()
    reach = np.full(len(centres), spacing / 2)
    moving = np.arange(len(centres))
    least = spacing * (_SETTLED if len(centres) <= _MANY else _SETTLED_ENOUGH)
    for _ in range(_MOST_MOVES):
        steps, gains = _best_steps(faces.feet(centres[moving], _TOUCHING), reach[moving])
        tried, outside, _ = faces.feet(centres[moving] + steps, _TOUCHING).nearest()
        better = outside & (tried > radii[moving])
        promised = better & (tried - radii[moving] >= _KEPT_PROMISE * gains)
        centres[moving[better]] += steps[better]
        radii[moving[better]] = tried[better]
        reach[moving[~promised]] /= 4
        moving = moving[(gains > least) & (reach[moving] > least)]
        if not len(moving):
            break
    return centres, radii


def _best_steps(feet: Feet, reach: Floats) -> tuple[Floats, Floats]:
    """Steps, each coordinate within reach, that let the least distance to the feet grow most, and by how much.

    The programmes of all centres are solved as one: nothing joins them but that their gains are added.
    """

    count = len(feet.distance)
    nearest = np.arange(_TOUCHING) == np.argmin(feet.distance, axis=1)[:, np.newaxis]
    which, foot = np.nonzero(feet.found | nearest)
    distance = feet.distance[which, foot]
    # r - (away / distance) . step <= distance, in the unknowns x, y, z and r of each centre.
    values = np.column_stack([-feet.away[which, foot] / distance[:, np.newaxis], np.ones(len(which))])
    columns = 4 * which[:, np.newaxis] + np.arange(4)
    rows = csr_array((values.ravel(), columns.ravel(), 4 * np.arange(len(which) + 1)), shape=(len(which), 4 * count))
    bounds = np.repeat(np.column_stack([-reach, reach]), 4, axis=0)
    bounds[3::4] = [-np.inf, np.inf]
    gain = np.tile([0.0, 0.0, 0.0, -1.0], count)
    # SciPy takes sparse rows, which its stubs do not know.
    best: Any = linprog(gain, rows, distance, bounds=bounds)  # type: ignore[call-overload]
    if best.status != 0:
        return np.zeros((count, 3)), np.zeros(count)
    found = best.x.reshape(count, 4)
    return found[:, :3], found[:, 3] - feet.distance.min(axis=1)


def distinct(centres: Floats, radii: Floats, apart: float, period: float | None) -> Integers:
    """Keep the largest of spheres with nearly one centre."""
    order = np.argsort(-radii, kind="stable")
    tree = tree_of(centres[order], period)
    kept = np.ones(len(order), dtype=bool)
    for first, second in tree.query_pairs(apart, output_type="ndarray"):
        kept[max(first, second)] = False
    return np.sort(order[kept])

"""Regular grids within polygons: squares that lie well inside them, and the band that is left round these."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.mesh.triangles.plane import filled
from gyroid_cad.mesh.triangles.templates import grid_triangles

__all__ = ["gridded"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In squares: how far places along a polygon are apart that are looked at, and how far from it a square stays.
_LOOKED_AT, _STAYS_OFF = 0.25, 0.4


def gridded(loops: Sequence[Floats], low: Floats, step: Floats, shape: tuple[int, int]) -> tuple[Floats, Integers]:
    """Triangles of a region: a regular grid where its squares lie inside, and a band between them and the border.

    Parameters
    ----------
    loops : sequence of ndarray, shape (corners, 2)
        Polygons with the region to their left.
    low, step : ndarray, shape (2,)
        Of the grid.
    shape : tuple of int
        Squares along both axes.

    Returns
    -------
    nodes : ndarray, shape (nodes, 2)
        Of the grid, where it is used.
    triangles : ndarray of int, shape (triangles, 3)
        Numbers of the corners of the polygons, one after another, then of the nodes.

    Examples
    --------
    >>> square = 5 * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    >>> nodes, triangles = gridded([square], np.zeros(2), np.ones(2), (5, 5))
    >>> len(nodes), len(triangles)
    (16, 34)
    """
    kept = _squares_inside([(loop - low) / step for loop in loops], shape)
    if not kept.any():
        # A grid of two squares across has none that is off the border.
        return np.empty((0, 2)), filled(loops)
    across = shape[1] + 1
    numbers = np.arange((shape[0] + 1) * across).reshape(shape[0] + 1, across)
    squares = grid_triangles(numbers).reshape(*shape, 6)[kept].reshape(-1, 3)
    used = np.unique(squares)
    own = np.zeros(numbers.size, dtype=np.int64)
    count = sum(map(len, loops))
    own[used] = np.arange(len(used)) + count
    nodes = low + step * np.stack(np.divmod(used, across), axis=1)
    holes = [own[hole] for hole in _outlines(kept)]
    numbers = np.concatenate([np.arange(count), *holes])
    band = numbers[filled([*loops, *(nodes[hole - count] for hole in holes)])]
    return nodes, np.concatenate([band, own[squares]])


def _squares_inside(loops: Sequence[Floats], shape: tuple[int, int]) -> Booleans:
    """Mask of the unit squares inside polygons and off their sides, none touching another in a corner alone."""
    start = np.concatenate(loops)
    end = np.concatenate([np.roll(loop, -1, axis=0) for loop in loops])
    touched = np.zeros(shape, dtype=bool)
    steps = np.ceil(np.abs(end - start).max(axis=1) / _LOOKED_AT).astype(np.int64) + 1
    which, index = _runs(steps)
    places = start[which] + (index / steps[which])[:, np.newaxis] * (end - start)[which]
    most = np.array(shape) - 1
    for offset in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        squares = np.clip(np.floor(places + _STAYS_OFF * np.array(offset)).astype(np.int64), 0, most)
        touched[squares[:, 0], squares[:, 1]] = True
    kept = _centres_inside(start, end, shape) & ~touched
    while True:
        a, b, c, d = kept[:-1, :-1], kept[1:, :-1], kept[1:, 1:], kept[:-1, 1:]
        touching = (a & c & ~b & ~d) | (b & d & ~a & ~c)
        if not touching.any():
            return np.asarray(kept)
        a &= ~touching
        b &= ~touching


def _centres_inside(start: Floats, end: Floats, shape: tuple[int, int]) -> Booleans:
    """Mask of the unit squares whose centres lie inside polygons, by the sides that a row of them crosses."""
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first = np.clip(np.ceil(low - 0.5), 0, shape[1]).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, shape[1]).astype(np.int64)
    which, index = _runs(last - first)
    row = first[which] + index
    (x0, y0), (x1, y1) = start[which].T, end[which].T
    with np.errstate(divide="ignore", invalid="ignore"):
        x = x0 + (row + 0.5 - y0) / (y1 - y0) * (x1 - x0)
    column = np.clip(np.ceil(x - 0.5), 0, shape[0]).astype(np.int64)
    crossed = np.zeros((shape[0] + 1, shape[1]), dtype=np.int64)
    np.add.at(crossed, (column, row), 1)
    return np.asarray(np.cumsum(crossed, axis=0)[:-1] % 2 == 1)


def _runs(counts: Integers) -> tuple[Integers, Integers]:
    """For runs of so many each, the number of the run, and the place in it."""
    which = np.repeat(np.arange(len(counts)), counts)
    return which, np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)


def _outlines(kept: Booleans) -> list[Integers]:
    """Loops of nodes round squares, these to their right."""
    across, inside = kept.shape[1] + 1, np.pad(kept, 1)
    following: dict[int, int] = {}
    corners = ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))
    # Below, right, above and left of each.
    for (di, dj), (start, end) in zip(((0, -1), (1, 0), (0, 1), (-1, 0)), pairwise(corners), strict=True):
        bare = kept & ~inside[1 + di : 1 + di + kept.shape[0], 1 + dj : 1 + dj + kept.shape[1]]
        i, j = np.nonzero(bare)
        ends = ((i + end[0]) * across + j + end[1]).tolist()
        following.update(zip(ends, ((i + start[0]) * across + j + start[1]).tolist(), strict=True))
    loops = []
    while following:
        first, node = following.popitem()
        loop = [first]
        while node != first:
            loop.append(node)
            node = following.pop(node)
        loops.append(np.array(loop, dtype=np.int64))
    return loops

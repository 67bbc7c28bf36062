"""Triangles on a grid of samples: which of them is nearest to the viewer, and what it is worth there.

A z-buffer in numpy (E. Catmull, *A subdivision algorithm for computer display of curved surfaces*, 1974). Triangles are
cut into rows of samples by their edges; of all that cover a sample the nearest wins. A sample belongs to a triangle if
its middle does, and where two triangles share an edge, to just one of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays, numbered_groups

__all__ = ["NOTHING", "Slopes", "nearest_triangles", "slopes"]

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Integers = NDArray[np.int64]

# In place of a triangle's number, where there is none.
NOTHING = -1
# Samples looked at in one go: what they take stays below 100 MB.
_AT_ONCE = 1_000_000
# Depths are compared as whole numbers with the triangle's number behind: the least of them is the nearest.
_DEPTH_STEPS = 2**31 - 1
_NUMBER_BITS = np.uint64(32)
_FARTHEST = np.iinfo(np.uint64).max


@dataclass(frozen=True, slots=True, eq=False)
class Slopes:
    """Values that go linearly over each triangle, in single precision.

    Attributes
    ----------
    first : ndarray, shape (n, ...)
        At the first corner.
    along_x, along_y : ndarray, shape (n, ...)
        What is added by one sample to the right, and by one down.
    x, y : ndarray, shape (n,)
        Where the first corner is.
    """

    first: Singles
    along_x: Singles
    along_y: Singles
    x: Singles
    y: Singles

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def at(self, which: Integers, column: Integers, row: Integers) -> Singles:
        """Values of some triangles in the middles of samples; shape (samples, ...)."""
        shape = (-1, *(1,) * (self.first.ndim - 1))
        dx, dy = (
            (place.astype(np.float32) + np.float32(0.5) - start[which]).reshape(shape)
            for place, start in ((column, self.x), (row, self.y))
        )
        value = self.along_x[which]
        value *= dx
        value += self.first[which]
        value += self.along_y[which] * dy
        return np.asarray(value)


def slopes(corners: Floats, values: Floats) -> Slopes:
    """Values at the corners of triangles as linear functions of the place; level on triangles seen edge-on.

    Parameters
    ----------
    corners : ndarray, shape (n, 3, 3)
        In samples: to the right, down, and towards the viewer.
    values : ndarray, shape (n, 3) or (n, 3, k)
        By triangle and corner.
    """
    (x0, y0, _), (x1, y1, _), (x2, y2, _) = corners.transpose(1, 2, 0)
    area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
    inverse = 1 / np.where(area == 0, np.inf, area)
    to_second, to_third = (values[:, k] - values[:, 0] for k in (1, 2))
    shape = (-1, *(1,) * (values.ndim - 2))
    along_x, along_y = (
        (a * inverse).reshape(shape) * to_second + (b * inverse).reshape(shape) * to_third
        for a, b in ((y2 - y0, y0 - y1), (x0 - x2, x1 - x0))
    )
    return Slopes(*(part.astype(np.float32) for part in (values[:, 0], along_x, along_y, x0, y0)))


def nearest_triangles(corners: Floats, width: int, height: int) -> Integers:
    """The triangle that is seen at each sample.

    Parameters
    ----------
    corners : ndarray, shape (n, 3, 3)
        In samples: to the right, down, and towards the viewer.
    width, height : int
        Of the grid.

    Returns
    -------
    ndarray of int, shape (height * width,)
        Row by row; ``NOTHING`` where there is no triangle.
    """
    z = corners[..., 2]
    nearest, farthest = z.max(axis=1), z.min(axis=1)
    top, bottom = float(nearest.max(initial=-np.inf)), float(farthest.min(initial=np.inf))
    # Over a depth of less than one sample the steps are fine enough.
    scale = _DEPTH_STEPS / max(top - bottom, 1.0)
    depth = slopes(corners, z)
    seen = np.full(width * height, _FARTHEST, dtype=np.uint64)
    for which, row, column, count in _rows(corners, width, height):
        some, along = numbered_groups(count)
        triangle = which[some]
        start = depth.at(which, column, row).astype(float)
        place = np.repeat(start, count) + along * np.repeat(depth.along_x[which], count)
        # Of triangles seen nearly edge-on rounding would put some in front of everything.
        place = np.clip(place, np.repeat(farthest[which], count), np.repeat(nearest[which], count))
        key = ((top - place) * scale).astype(np.uint64) << _NUMBER_BITS | triangle.astype(np.uint64)
        np.minimum.at(seen, np.repeat(row * width + column, count) + along, key)
    number = (seen & np.uint64(2**32 - 1)).astype(np.int64)
    return np.where(seen == _FARTHEST, NOTHING, number)


def _rows(corners: Floats, width: int, height: int) -> Iterator[tuple[Integers, Integers, Integers, Integers]]:
    """Rows of samples in triangles, many at once: the triangle, the row, its first column, and how many samples."""
    x, y = corners[..., 0], corners[..., 1]
    first, end = (_first_middle(extreme, height) for extreme in (y.min(axis=1), y.max(axis=1)))
    some = np.flatnonzero(end > first)
    counts = (end - first)[some]
    # About as many samples as there are in the boxes round them.
    areas = counts * np.minimum(np.ptp(x[some], axis=1) + 1, width)
    ends = np.cumsum(areas)
    start = 0
    while start < len(some):
        done = ends[start - 1] if start else 0
        # At least one triangle, however large.
        stop = max(start + 1, int(np.searchsorted(ends, done + _AT_ONCE, side="right")))
        which, count = some[start:stop], counts[start:stop]
        start = stop
        group, step = numbered_groups(count)
        row = first[which[group]] + step
        left, right = _crossings(corners[which], count, np.asarray(row + 0.5))
        column = _first_middle(left, width)
        samples = _first_middle(right, width) - column
        hit = np.flatnonzero(samples > 0)
        yield which[group[hit]], row[hit], column[hit], samples[hit]


def _crossings(corners: Floats, count: Integers, y: Floats) -> tuple[Floats, Floats]:
    """Begin and end of triangles, so many rows of each, at the heights of their rows."""
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for one, other in ((0, 1), (1, 2), (2, 0)):
        # Both triangles at an edge run it upwards, and so find the same place to the last bit.
        swapped = (corners[:, one, 1] > corners[:, other, 1])[:, np.newaxis]
        a = np.where(swapped, corners[:, other], corners[:, one])
        b = np.where(swapped, corners[:, one], corners[:, other])
        rise = b[:, 1] - a[:, 1]
        slope = (b[:, 0] - a[:, 0]) / np.where(rise > 0, rise, np.inf)
        x0, y0, y1, m = (np.repeat(value, count) for value in (a[:, 0], a[:, 1], b[:, 1], slope))
        crossed = (y0 <= y) & (y < y1)
        place = x0 + (y - y0) * m
        left = np.where(crossed & (place < left), place, left)
        right = np.where(crossed & (place > right), place, right)
    return left, right


def _first_middle(place: Floats, limit: int) -> Integers:
    """Number of the first sample whose middle is not before a place, at most a limit."""
    return np.asarray(np.ceil(np.clip(place, 0, limit) - 0.5), dtype=np.int64)

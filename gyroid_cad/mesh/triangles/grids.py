"""Regular grids within polygons: squares that lie well inside them, and the band that is left round these.

All polygons are gone through at once, in one array of squares: those of one face after those of another, row by row,
with a row and a column of none round each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import numbered_groups
from gyroid_cad.mesh.triangles.outlined import Outlines
from gyroid_cad.mesh.triangles.plane import filled

__all__ = ["gridded"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In squares: how far places along a polygon are apart that are looked at, and how far from it a square stays.
_LOOKED_AT, _STAYS_OFF = 0.25, 0.4
# Of so few squares across none is off the border.
_TOO_FEW = 2
_SQUARES_AT_ONCE = 2**22


def gridded(outlines: Outlines, faces: Integers, units: Floats, shapes: Integers) -> tuple[Floats, Integers, Integers]:
    """Triangles of faces: a regular grid where its squares lie inside, and a band between them and the border.

    Parameters
    ----------
    outlines : Outlines
    faces : ndarray of int, shape (m,)
        Those looked at.
    units : ndarray, shape (corners, 2)
        Of all outlines, in sides of the squares of a face's grid, from its corner.
    shapes : ndarray of int, shape (faces, 2)
        Squares along both axes.

    Returns
    -------
    nodes : ndarray, shape (nodes, 2)
        Of the grids, where they are used, in the same units.
    owners : ndarray of int, shape (nodes,)
        Their faces.
    triangles : ndarray of int, shape (triangles, 3)
        Numbers of the outlines' corners, then of the nodes.

    Examples
    --------
    >>> square = 5 * np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    >>> one = Outlines(square, np.arange(4), np.array([0, 4]), np.array([0]), np.zeros((1, 4), dtype=int))
    >>> nodes, owners, triangles = gridded(one, np.array([0]), square, np.array([(5, 5)]))
    >>> len(nodes), len(triangles)
    (16, 34)
    """
    count = len(units)
    nodes, owners, squares = [np.empty((0, 2))], [faces[:0]], [np.empty((0, 3), dtype=np.int64)]
    rims: dict[int, list[Integers]] = {}
    for some in _batches(faces[shapes[faces].min(axis=1) > _TOO_FEW], shapes):
        grids = _squares_inside(outlines, some, units, shapes[some])
        used, which, own = grids.nodes_used()
        for slot, rim in grids.rims():
            rims.setdefault(int(some[slot]), []).append(own[rim] + count)
        squares.append(own[grids.triangles()] + count)
        nodes.append(used)
        owners.append(some[which])
        count += len(used)
    found = np.concatenate(nodes)
    return found, np.concatenate(owners), np.concatenate([_bands(outlines, faces, units, found, rims), *squares])


def _batches(faces: Integers, shapes: Integers) -> Iterator[Integers]:
    """Faces together whose squares are not too many."""
    if len(faces):
        size = np.cumsum(np.prod(shapes[faces] + 2, axis=1))
        yield from np.split(faces, np.flatnonzero(np.diff(size // _SQUARES_AT_ONCE)) + 1)


def _bands(
    outlines: Outlines, faces: Integers, units: Floats, nodes: Floats, rims: dict[int, list[Integers]]
) -> Integers:
    """Triangles between the borders of faces and the rims of their grids."""
    loops, owners, count = outlines.loops.tolist(), outlines.faces, len(units)
    firsts = np.searchsorted(owners, faces).tolist()
    lasts = np.searchsorted(owners, faces, side="right").tolist()
    found, numbers, before = [np.empty((0, 3), dtype=np.int64)], [faces[:0]], 0
    for face, first, last in zip(faces.tolist(), firsts, lasts, strict=True):
        holes = rims.get(face, [])
        borders = [units[start:end] for start, end in pairwise(loops[first : last + 1])]
        found.append(filled([*borders, *(nodes[hole - count] for hole in holes)]) + before)
        own = [np.arange(loops[first], loops[last]), *holes]
        numbers += own
        before += sum(map(len, own))
    return np.asarray(np.concatenate(numbers)[np.concatenate(found)])


@dataclass(frozen=True, slots=True, eq=False)
class _Grids:
    """Squares of grids: which are kept, the first number and the length of a row of each grid.

    A node has the number of the square above it and to its right.
    """

    kept: Booleans
    base: Integers
    stride: Integers

    def _kept(self) -> tuple[Integers, Integers]:
        """Numbers of the squares that are kept, and the lengths of their rows."""
        squares = np.flatnonzero(self.kept)
        return squares, self.stride[np.searchsorted(self.base, squares, side="right") - 1]

    def triangles(self) -> Integers:
        """Triangles of the squares kept, by the numbers of nodes."""
        a, row = self._kept()
        return np.stack([a, a + 1, a + row + 1, a, a + row + 1, a + row], axis=-1).reshape(-1, 3)

    def nodes_used(self) -> tuple[Floats, Integers, Integers]:
        """Places of the nodes used, the grids they are of, and, by the number of a node, which of those it is."""
        a, row = self._kept()
        used = np.zeros(len(self.kept), dtype=bool)
        for corner in (a, a + 1, a + row + 1, a + row):
            used[corner] = True
        nodes = np.flatnonzero(used)
        which = np.searchsorted(self.base, nodes, side="right") - 1
        places = np.stack(np.divmod(nodes - self.base[which], self.stride[which])[::-1], axis=1) - 1.0
        return places, which, np.cumsum(used) - 1

    def rims(self) -> Iterator[tuple[int, Integers]]:
        """Grids and loops of nodes round their squares, these to the right."""
        a, row = self._kept()
        following: dict[int, int] = {}
        corners = (a, a + 1, a + row + 1, a + row, a)
        # Below, right, above and left of each.
        for beside, (start, end) in zip((a - row, a + 1, a + row, a - 1), pairwise(corners), strict=True):
            bare = ~self.kept[beside]
            following.update(zip(end[bare].tolist(), start[bare].tolist(), strict=True))
        loops = []
        while following:
            first, node = following.popitem()
            loop = [first]
            while node != first:
                loop.append(node)
                node = following.pop(node)
            loops.append(np.array(loop, dtype=np.int64))
        slots = np.searchsorted(self.base, [loop[0] for loop in loops], side="right") - 1
        return zip(slots.tolist(), loops, strict=True)


def _squares_inside(outlines: Outlines, faces: Integers, units: Floats, shapes: Integers) -> _Grids:
    """Squares inside polygons and off their sides, none touching another in a corner alone."""
    stride = shapes[:, 0] + 2
    ends = np.cumsum(stride * (shapes[:, 1] + 2))
    base = np.concatenate([[0], ends[:-1]])
    slots = np.full(len(outlines.squares), -1)
    slots[faces] = np.arange(len(faces))
    slot = slots[outlines.owners]
    following = np.arange(1, len(units) + 1)
    following[outlines.loops[1:] - 1] = outlines.loops[:-1]
    own = np.flatnonzero(slot >= 0)
    sides = units[own], units[following[own]], slot[own]
    touched = np.zeros(int(ends[-1]), dtype=bool)
    steps = np.ceil(np.abs(sides[1] - sides[0]).max(axis=1) / _LOOKED_AT).astype(np.int64) + 1
    which, index = numbered_groups(steps)
    places = sides[0][which] + (index / steps[which])[:, np.newaxis] * (sides[1] - sides[0])[which]
    grid = sides[2][which]
    for offset in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        at = np.clip(np.floor(places + _STAYS_OFF * np.array(offset)).astype(np.int64), 0, shapes[grid] - 1) + 1
        touched[base[grid] + at[:, 1] * stride[grid] + at[:, 0]] = True
    kept = _centres_inside(*sides, shapes, base, stride, int(ends[-1])) & ~touched
    candidates = np.flatnonzero(kept)
    while True:
        # Squares above and to the right of a node, and those round it.
        row = stride[np.searchsorted(base, candidates, side="right") - 1]
        right = _touching(kept, candidates, candidates - 1, candidates - row - 1, candidates - row)
        left = _touching(kept, candidates, candidates + 1, candidates - row + 1, candidates - row)
        if not (right | left).any():
            return _Grids(kept, base, stride)
        kept[candidates[right | left]] = False
        candidates = candidates[kept[candidates]]


def _touching(kept: Booleans, square: Integers, beside: Integers, across: Integers, below: Integers) -> Booleans:
    return np.asarray(kept[square] & kept[across] & ~kept[beside] & ~kept[below])


def _centres_inside(
    start: Floats, end: Floats, grid: Integers, shapes: Integers, base: Integers, stride: Integers, count: int
) -> Booleans:
    """Mask of the squares whose centres lie inside polygons, by the sides that a row of them crosses."""
    rows, columns = shapes[grid, 1], shapes[grid, 0]
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first = np.clip(np.ceil(low - 0.5), 0, rows).astype(np.int64)
    last = np.clip(np.ceil(high - 0.5), 0, rows).astype(np.int64)
    which, index = numbered_groups(last - first)
    row = first[which] + index
    (x0, y0), (x1, y1) = start[which].T, end[which].T
    with np.errstate(divide="ignore", invalid="ignore"):
        x = x0 + (row + 0.5 - y0) / (y1 - y0) * (x1 - x0)
    column = np.clip(np.ceil(x - 0.5), 0, columns[which]).astype(np.int64)
    at = base[grid[which]] + (row + 1) * stride[grid[which]] + column + 1
    # Every row is crossed an even number of times: counting begins anew in each by itself.
    return np.asarray(np.cumsum(np.bincount(at, minlength=count)) % 2 == 1)

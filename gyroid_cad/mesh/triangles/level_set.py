"""Surface between the inside and the outside of a grid of points, with its creases.

Dual contouring (T. Ju, F. Losasso, S. Schaefer and J. Warren, Dual contouring of Hermite data, SIGGRAPH 2002): a vertex
in every cube of the grid that the surface crosses, where the planes at its crossings with the cube's edges meet best;
a square for every edge that is crossed. A cube that several sheets cross has a vertex for each (S. Schaefer, T. Ju and
J. Warren, Manifold dual contouring, IEEE TVCG 13, 2007), so that the surface is a manifold but in rare cases.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot

__all__ = ["Grid", "level_surface", "portioned", "told_apart"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Function = Callable[[Floats], Floats]

# Normals of one cube that differ by less, as the cosine of the angle to their mean, are those of a smooth surface.
_SMOOTH = 0.985
# Of the eigenvalues of the planes' normals, in parts of the largest: below it a direction is along the surface.
_ALONG = 0.02
# How far from its cube's middle a vertex may lie, in steps of the grid.
_REACH = 1.0
# Points of a grid are looked at in blocks of so many steps a side, one in another.
_BLOCKS = (16, 4, 1)
_POINTS_AT_ONCE = 200_000
_SECANTS = 3


@dataclass(frozen=True, slots=True)
class Grid:
    """Points of a cubic grid.

    Attributes
    ----------
    low : tuple of float
        The first of them, in mm.
    step : float
        In mm.
    shape : tuple of int
    """

    low: tuple[float, float, float]
    step: float
    shape: tuple[int, int, int]

    def points(self, numbers: NDArray[np.number]) -> Floats:
        """Places of numbers along the axes, shape (n, 3), in mm."""
        return np.asarray(np.array(self.low) + self.step * numbers)


def told_apart(function: Function, grid: Grid) -> Booleans:
    """Mask of a grid's points at which a function is positive, which changes by no more than the distance.

    Where it is far from zero in the middle of a block, all of the block is on one side: few points are asked.
    """
    inside = np.zeros(grid.shape, dtype=bool)
    blocks = _within(np.zeros((1, 3), dtype=np.int64), max(grid.shape), _BLOCKS[0], grid.shape)
    for size, finer in zip(_BLOCKS, (*_BLOCKS[1:], 0), strict=True):
        values = portioned(function, grid.points(blocks + (size - 1) / 2))
        if size == 1:
            inside[tuple(blocks[values > 0].T)] = True
            break
        far = np.abs(values) > grid.step * (size - 1) / 2 * np.sqrt(3)
        for block in blocks[far & (values > 0)].tolist():
            i, j, k = (slice(first, first + size) for first in block)
            inside[i, j, k] = True
        blocks = _within(blocks[~far], size, finer, grid.shape)
    return inside


def _within(blocks: Integers, size: int, finer: int, shape: tuple[int, int, int]) -> Integers:
    """First points of smaller blocks in larger ones, as far as they are in the grid."""
    along = np.arange(0, size, finer)
    offsets = np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
    found = (blocks[:, np.newaxis] + offsets).reshape(-1, 3)
    return np.asarray(found[np.all(found < shape, axis=1)])


def portioned(function: Function, points: Floats) -> Floats:
    """Values of a function at points, of which it is given some at once, so that memory is bounded."""
    some = [function(points[first : first + _POINTS_AT_ONCE]) for first in range(0, len(points), _POINTS_AT_ONCE)]
    return np.concatenate([np.empty(0), *some])


def level_surface(
    inside: Booleans, grid: Grid, function: Function, normals: Function, project: Function
) -> tuple[Floats, Integers]:
    """Triangles of the surface round the inside of a grid, outwards.

    Parameters
    ----------
    inside : ndarray of bool
        Of every point; none of those at the grid's ends.
    grid : Grid
    function : callable
        Of points (n, 3), positive inside, zero on the surface; as :func:`told_apart` asks for.
    normals : callable
        Unit normals of the surface at points near it, outwards.
    project : callable
        The places on the surface next to points.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    """
    first, axes, outwards = _crossed_edges(inside)
    ends = grid.points(first), grid.points(first + np.eye(3, dtype=np.int64)[axes])
    places = project(_on_edges(ends, function))
    directions = normals(places)
    cubes, corners = _vertices_of_edges(inside, first, axes)
    vertices, sharp = _best_places(cubes, corners, places, directions, grid)
    vertices[~sharp] = project(vertices[~sharp])
    squares = np.where(outwards[:, np.newaxis], corners, corners[:, ::-1])
    return vertices, _halved(vertices, squares, sharp)


def _crossed_edges(inside: Booleans) -> tuple[Integers, Integers, Booleans]:
    """First points of the edges with one end inside, the axes they are along, and whether the first end is inside."""
    found = []
    for axis in range(3):
        ahead, behind = (
            np.take(inside, range(*ends), axis) for ends in ((1, inside.shape[axis]), (0, inside.shape[axis] - 1))
        )
        some = np.argwhere(ahead != behind)
        found.append((some, np.full(len(some), axis), behind[tuple(some.T)]))
    first, axes, outwards = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return first, axes, outwards


def _on_edges(ends: tuple[Floats, Floats], function: Function) -> Floats:
    """Places of edges where a function is about zero, by the method of false position."""
    low, high = (end.copy() for end in ends)
    at_low, at_high = portioned(function, low), portioned(function, high)
    for _ in range(_SECANTS):
        part = np.clip(at_low / (at_low - at_high), 0.0, 1.0)[:, np.newaxis]
        middle = low + part * (high - low)
        value = portioned(function, middle)
        same = (value > 0) == (at_low > 0)
        low[same], at_low[same] = middle[same], value[same]
        high[~same], at_high[~same] = middle[~same], value[~same]
    return np.where((np.abs(at_low) < np.abs(at_high))[:, np.newaxis], low, high)


# Corners of a cube, and its edges by their first corners and axes.
_CORNERS = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
_EDGES = [(int(corner), axis) for axis in range(3) for corner in range(8) if not _CORNERS[corner][axis]]


@cache
def _sheets() -> Integers:
    """Sheet of the surface that crosses each edge of a cube, for every way of being inside; shape (256, 12)."""
    number = {edge: index for index, edge in enumerate(_EDGES)}
    table = np.full((256, 12), -1, dtype=np.int64)
    for state in range(256):
        within = [bool(state >> corner & 1) for corner in range(8)]
        label = list(range(12))
        crossed = {edge for edge, (corner, axis) in enumerate(_EDGES) if within[corner] != within[corner + (4 >> axis)]}
        for pair in _linked(within, number):
            low, high = sorted(label[edge] for edge in pair)
            label = [low if own == high else own for own in label]
        names = sorted({label[edge] for edge in crossed})
        for edge in crossed:
            table[state, edge] = names.index(label[edge])
    return table


def _linked(within: list[bool], number: dict[tuple[int, int], int]) -> list[tuple[int, int]]:
    """Pairs of edges that one sheet crosses on a side of a cube: corners inside are parted where they are diagonal."""
    pairs = []
    for normal in range(3):
        u, v = (axis for axis in range(3) if axis != normal)
        for base in (0, 4 >> normal):
            a, b, c, d = base, base + (4 >> u), base + (4 >> u) + (4 >> v), base + (4 >> v)
            around = [number[a, u], number[b, v], number[d, u], number[a, v]]
            ring, edges = [within[corner] for corner in (a, b, c, d)], [around[0], around[1], around[2], around[3]]
            crossed = [edge for k, edge in enumerate(edges) if ring[k] != ring[(k + 1) % 4]]
            if len(crossed) == 2:
                pairs.append((crossed[0], crossed[1]))
            elif len(crossed) == 4:
                pairs += [(edges[k - 1], edges[k]) for k in range(4) if ring[k]]
    return pairs


def _vertices_of_edges(inside: Booleans, first: Integers, axes: Integers) -> tuple[Integers, Integers]:
    """Cubes that have vertices, shape (vertices, 3), and the four vertices round every crossed edge in turn."""
    shape = np.array(inside.shape) - 1
    number = {edge: index for index, edge in enumerate(_EDGES)}
    keys = np.empty((len(first), 4), dtype=np.int64)
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        some = np.flatnonzero(axes == axis)
        for k, (back_u, back_v) in enumerate(((1, 1), (0, 1), (0, 0), (1, 0))):
            cube = first[some].copy()
            cube[:, u] -= back_u
            cube[:, v] -= back_v
            edge = number[back_u * (4 >> u) + back_v * (4 >> v), axis]
            sheet = _sheets()[_states(inside, cube), edge]
            keys[some, k] = np.ravel_multi_index(tuple(cube.T), tuple(shape)) * 4 + sheet
    own, numbers = np.unique(keys, return_inverse=True)
    return np.stack(np.unravel_index(own // 4, tuple(shape)), axis=1), numbers.reshape(-1, 4)


def _states(inside: Booleans, cubes: Integers) -> Integers:
    """Corners of cubes that are inside, as the bits of a number; shape (cubes,)."""
    states = np.zeros(len(cubes), dtype=np.int64)
    for corner, ahead in enumerate(_CORNERS):
        states |= inside[tuple((cubes + ahead).T)].astype(np.int64) << corner
    return states


def _best_places(
    cubes: Integers, corners: Integers, places: Floats, normals: Floats, grid: Grid
) -> tuple[Floats, Booleans]:
    """Places where the planes at each vertex's crossings meet best, and which of them are on creases."""
    count, vertex = len(cubes), corners.ravel()
    crossing = np.repeat(np.arange(len(places)), 4)
    uses = np.bincount(vertex, minlength=count)[:, np.newaxis]
    mean = _summed(vertex, places[crossing], count) / uses
    direction = _summed(vertex, normals[crossing], count)
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), np.finfo(float).tiny)
    turned = np.ones(count)
    np.minimum.at(turned, vertex, dot(normals[crossing], direction[vertex]))
    sharp = turned < _SMOOTH
    chosen = sharp[vertex]
    order = np.cumsum(sharp) - 1
    own, n = order[vertex[chosen]], normals[crossing[chosen]]
    heights = dot(n, places[crossing[chosen]] - mean[vertex[chosen]])
    planes = _summed(own, (n[:, :, np.newaxis] * n[:, np.newaxis]).reshape(-1, 9), int(sharp.sum())).reshape(-1, 3, 3)
    values, vectors = np.linalg.eigh(planes)
    wanted = _summed(own, n * heights[:, np.newaxis], int(sharp.sum()))
    firm = values > _ALONG * values[:, -1:]
    parts = np.einsum("nij,ni->nj", vectors, wanted) * np.where(firm, 1 / np.where(firm, values, 1.0), 0.0)
    found = mean.copy()
    found[sharp] += np.einsum("nij,nj->ni", vectors, parts)
    middle = grid.points(cubes + 0.5)
    astray = np.abs(found - middle).max(axis=1) > _REACH * grid.step
    found[astray] = mean[astray]
    return found, sharp & ~astray


def _summed(owner: Integers, values: Floats, count: int) -> Floats:
    return np.stack([np.bincount(owner, values[:, k], minlength=count) for k in range(values.shape[1])], axis=1)


def _halved(vertices: Floats, squares: Integers, sharp: Booleans) -> Integers:
    """Two triangles of every square, parted along a crease that runs through it, else along the shorter diagonal."""
    a, b, c, d = squares.T
    crease = (sharp[a] & sharp[c]).astype(np.int64) - (sharp[b] & sharp[d])
    shorter = np.linalg.norm(vertices[a] - vertices[c], axis=1) <= np.linalg.norm(vertices[b] - vertices[d], axis=1)
    along = np.where(crease == 0, shorter, crease > 0)[:, np.newaxis, np.newaxis]
    one = np.stack([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)], axis=1)
    other = np.stack([np.stack([a, b, d], axis=1), np.stack([b, c, d], axis=1)], axis=1)
    triangles = np.where(along, one, other).reshape(-1, 3)
    return np.asarray(triangles[np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)])

"""Templates by which a patch, or a side wall, is cut into triangles in the square of its parameters.

The steps inside a patch and along each of its edges may differ. Whatever they are, a template has on an edge exactly
the places of the edge's own steps, so patches that share an edge share its places, and nothing has to be merged.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays

__all__ = [
    "FEWEST_STEPS",
    "Template",
    "face_template",
    "few_counts",
    "grid_triangles",
    "wall_template",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# One place at least lies inside a patch: what the strips along its edges are stitched to.
FEWEST_STEPS = 2
_REMEMBERED = 256
# Where counts are more than these they are rounded up to three binary digits, so that few templates are needed.
_FEW_COUNTS = 4


@dataclass(frozen=True, slots=True, eq=False)
class Template:
    """Triangles in a square of parameters.

    Attributes
    ----------
    places : ndarray, shape (places, 2)
        Parameters u and v. Of a patch: its four corners, then the places along edges 0 to 3, each as the patch runs
        along it, then those inside, along u and then v. Of a side wall: along u and then v.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise in (u, v).
    sides : ndarray of int, shape (sides, 2)
        Every side of a triangle once.
    """

    places: Floats
    triangles: Integers
    sides: Integers

    def __post_init__(self) -> None:
        freeze_arrays(self)


@lru_cache(maxsize=_REMEMBERED)
def face_template(steps: int, edge_steps: tuple[int, int, int, int]) -> Template:
    """Triangles of a patch with so many steps along u and v inside it, and so many along its edges.

    Inside is a regular grid; a strip between its rim and each edge is stitched by the shorter diagonal.

    Parameters
    ----------
    steps : int
        At least 2.
    edge_steps : tuple of int
        Along edges 0 to 3, each at least 1.
    """
    inner = np.linspace(-1, 1, steps + 1)[1:-1]
    corners = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    edges = [
        corners[k] + np.linspace(0, 1, count + 1)[1:-1, np.newaxis] * (corners[(k + 1) % 4] - corners[k])
        for k, count in enumerate(edge_steps)
    ]
    grid = np.stack(np.meshgrid(inner, inner, indexing="ij"), axis=-1).reshape(-1, 2)
    numbers = np.arange(len(grid)).reshape(steps - 1, steps - 1) + 4 + sum(edge_steps) - 4
    triangles = [grid_triangles(numbers)]
    first = 4
    rims = (numbers[:, 0], numbers[-1, :], numbers[::-1, -1], numbers[0, ::-1])
    for k, count in enumerate(edge_steps):
        outer = np.concatenate([[k], np.arange(first, first + count - 1), [(k + 1) % 4]])
        triangles.append(_stitched(outer, rims[k], np.linspace(-1, 1, count + 1), inner))
        first += count - 1
    return _template(np.concatenate([corners, *edges, grid]), np.concatenate(triangles))


@lru_cache(maxsize=_REMEMBERED)
def wall_template(along: int, across: int) -> Template:
    """Triangles of a side wall: u from -1 to 1 along its edge, v from 0 to 1 through the wall."""
    u, v = np.linspace(-1, 1, along + 1), np.linspace(0, 1, across + 1)
    places = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
    return _template(places, grid_triangles(np.arange(len(places)).reshape(along + 1, across + 1)))


def few_counts(steps: Integers) -> Integers:
    """Steps as they are where few numbers occur, else rounded up to three binary digits.

    Examples
    --------
    >>> few_counts(np.array([2, 3, 9])).tolist(), few_counts(np.arange(6, 12)).tolist()
    ([2, 3, 9], [6, 7, 8, 10, 10, 12])
    """
    if len(np.unique(steps)) <= _FEW_COUNTS:
        return steps
    unit = 2 ** np.maximum(0, np.floor(np.log2(steps)).astype(np.int64) - 2)
    return np.asarray(-(-steps // unit) * unit)


def _template(places: Floats, triangles: Integers) -> Template:
    ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return Template(places, triangles, np.unique(ends, axis=0))


def grid_triangles(numbers: Integers) -> Integers:
    """Two triangles for each square of a grid of numbers.

    Examples
    --------
    >>> grid_triangles(np.arange(4).reshape(2, 2)).tolist()
    [[0, 2, 3], [0, 3, 1]]
    """
    a, b, c, d = (part.ravel() for part in (numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]))
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def _stitched(outer: Integers, rim: Integers, outer_at: Floats, inner_at: Floats) -> Integers:
    """Triangles between an edge and the rim inside it that runs the same way, the rim to its left."""
    triangles = []
    i = j = 0
    while i < len(outer) - 1 or j < len(rim) - 1:
        to_outer = abs(outer_at[i + 1] - inner_at[j]) if i < len(outer) - 1 else np.inf
        to_rim = abs(outer_at[i] - inner_at[j + 1]) if j < len(rim) - 1 else np.inf
        if to_outer <= to_rim:
            triangles.append((outer[i], outer[i + 1], rim[j]))
            i += 1
        else:
            triangles.append((outer[i], rim[j + 1], rim[j]))
            j += 1
    return np.array(triangles, dtype=np.int64)

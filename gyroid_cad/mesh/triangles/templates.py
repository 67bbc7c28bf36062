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
from gyroid_cad.nurbs.surface import basis

__all__ = [
    "FEWEST_STEPS",
    "Template",
    "face_template",
    "images",
    "rational_basis",
    "rational_basis_and_rates",
    "wall_template",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# One place at least lies inside a patch: what the strips along its edges are stitched to.
FEWEST_STEPS = 2
_REMEMBERED = 256
# Of rows, columns and length of a product.
_ONE_THREAD = 2**18


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
    triangles = [_grid_triangles(numbers)]
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
    return _template(places, _grid_triangles(np.arange(len(places)).reshape(along + 1, across + 1)))


def rational_basis(weights: Floats, knots: tuple[Floats, Floats], places: Floats) -> Floats:
    """Rational basis functions (The NURBS Book, eq. (4.12)) as a matrix on control points.

    Parameters
    ----------
    weights : ndarray, shape (n, m)
    knots : tuple of ndarray
        Along u and v.
    places : ndarray, shape (places, 2)

    Returns
    -------
    ndarray, shape (places, n m)
    """
    along_u, along_v = (_along(weights, knots, places, axis, 0) for axis in (0, 1))
    weighted = _weighted(along_u, along_v, weights)
    return np.asarray(weighted / weighted.sum(axis=1, keepdims=True))


def rational_basis_and_rates(weights: Floats, knots: tuple[Floats, Floats], places: Floats) -> Floats:
    """Rational basis functions and their derivatives by u and by v, by the quotient rule; shape (3, places, n m)."""
    (u, u_rate), (v, v_rate) = ([_along(weights, knots, places, axis, k) for k in (0, 1)] for axis in (0, 1))
    weighted = _weighted(u, v, weights)
    total = weighted.sum(axis=1, keepdims=True)
    result = np.empty((3, *weighted.shape))
    result[0] = weighted / total
    for k, rate in ((1, _weighted(u_rate, v, weights)), (2, _weighted(u, v_rate, weights))):
        result[k] = (rate - rate.sum(axis=1, keepdims=True) * result[0]) / total
    return result


def _along(weights: Floats, knots: tuple[Floats, Floats], places: Floats, axis: int, derivative: int) -> Floats:
    """Basis functions of one axis, or their derivatives; shape (places, control points along it)."""
    degree = len(knots[axis]) - weights.shape[axis] - 1
    return basis(knots[axis], degree, places[:, axis], derivative)


def _weighted(along_u: Floats, along_v: Floats, weights: Floats) -> Floats:
    products = along_u[:, :, np.newaxis] * along_v[:, np.newaxis]
    return np.asarray((products * weights).reshape(-1, weights.size))


def images(matrix: Floats, controls: Floats) -> Floats:
    """Products of one matrix with the control points of many surfaces.

    In portions so small that OpenBLAS keeps to one thread (``GEMM_MULTITHREAD_THRESHOLD`` in its sources): on a busy
    machine its threads wait for each other, and products of this size take twenty times as long.

    Parameters
    ----------
    matrix : ndarray, shape (places, controls)
    controls : ndarray, shape (surfaces, controls, components)

    Returns
    -------
    ndarray, shape (surfaces, places, components)
    """
    rows = max(1, _ONE_THREAD // (controls.shape[1] * controls.shape[2]))
    parts = [matrix[first : first + rows] @ controls for first in range(0, len(matrix), rows)]
    return np.concatenate(parts, axis=1) if parts else np.empty((len(controls), 0, controls.shape[2]))


def _template(places: Floats, triangles: Integers) -> Template:
    ends = np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    return Template(places, triangles, np.unique(ends, axis=0))


def _grid_triangles(numbers: Integers) -> Integers:
    """Two triangles for each square of a grid of numbers."""
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

"""The exact wall of a graded lattice, without any fit: where it is, and its volume."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.basis import orders
from gyroid_cad.nurbs.surface import layer_volumes
from gyroid_cad.surface.patch import PARAMETERISATIONS
from gyroid_cad.surface.symmetry import QUARTER, Placements
from gyroid_cad.surface.weierstrass import Family
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.grading import Grading, WallPoints

__all__ = [
    "ExactMeasures",
    "block_volume",
    "differentiation_matrix",
    "exact_measures",
    "grid_rates",
    "interpolation_matrix",
    "offset_patches",
    "patch_derivatives",
    "patch_points_and_normals",
    "sampled_point",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_QUADRATURE_POINTS = 16
_BLOCK_POINTS = 4
_PATCH_NODES = 33
# So few that what is computed for them stays in the processor's cache.
_PATCHES_AT_ONCE = 48


def offset_patches(
    complex: CellComplex, grading: Grading, samples: Floats, patches: Integers | None = None
) -> Iterator[tuple[slice, WallPoints]]:
    """The exact mid-surface at a grid of samples of every patch, some patches at a time.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading
    samples : ndarray, shape (m,)
        Along each side of a patch.
    patches : ndarray of int, optional
        Which patches; all if left out.

    Yields
    ------
    slice
        Of ``patches``.
    WallPoints
        At patches x m x m points; du x dv along the normal.
    """
    patches = np.arange(complex.patch_count) if patches is None else patches
    for first in range(0, len(patches), _PATCHES_AT_ONCE):
        some = slice(first, first + _PATCHES_AT_ONCE)
        points, normals = patch_points_and_normals(complex, grading.cell_size, samples, patches[some])
        yield some, grading.lay(points.reshape(-1, 3), normals.reshape(-1, 3))


def patch_points_and_normals(
    complex: CellComplex, cell_size: float, samples: Floats, patches: Integers | slice = slice(None)
) -> tuple[Floats, Floats]:
    """Points of patches before any map, in mm, and the unit normals on the common side.

    Parameters
    ----------
    complex : CellComplex
    cell_size : float
        In mm.
    samples : ndarray, shape (m,)
        Along each side of a patch.
    patches : ndarray of int, or slice
        Which patches; all if left out.

    Returns
    -------
    points, normals : ndarray, shape (patches, m * m, 3)
    """
    points, normals = _placed_grid(complex.placements, cell_size, tuple(samples.tolist()))
    placement, corner = complex.patch_placement[patches], complex.patch_cell[patches] * cell_size
    return points[placement] + corner[:, np.newaxis], normals[placement]


def sampled_point(
    complex: CellComplex, cell_size: float, samples: Floats, patch: int, index: int
) -> tuple[float, float, float]:
    """Place, in mm and before any map, of the sample of a patch that has a flat index in its grid."""
    x, y, z = patch_points_and_normals(complex, cell_size, samples, np.array([patch]))[0][0, index].tolist()
    return x, y, z


@lru_cache(maxsize=16)
def _placed_grid(placements: Placements, cell_size: float, samples: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Points in mm and unit normals of the first cell's patches; shape (placements, m * m, 3) each."""
    points, normals = _exact_grid(samples, placements.patch.family)
    turns = np.swapaxes(placements.matrices, 1, 2).astype(float)
    places = points @ turns + (placements.translations * QUARTER)[:, np.newaxis]
    return places * (cell_size / 2), normals @ (turns * placements.sides[:, np.newaxis, np.newaxis])


def patch_derivatives(family: Family, u: Floats, v: Floats) -> tuple[Floats, ...]:
    """Points and derivatives of the exact patch, in its own frame and in bounding-cell lengths.

    Of the polynomials through its values at Chebyshev's nodes: patches are analytic, and to rounding these are the
    same.

    Parameters
    ----------
    family : Family
    u, v : ndarray, shape (n,)

    Returns
    -------
    tuple of ndarray, shape (n, 3)
        Points, then derivatives by u, v, uu, uv and vv.
    """
    nodes = -np.cos(np.pi * np.arange(_PATCH_NODES) / (_PATCH_NODES - 1))
    values = _exact_grid(tuple(nodes.tolist()), family)[0].reshape(_PATCH_NODES, _PATCH_NODES, 3)
    rate = differentiation_matrix(nodes)
    along_u, along_v = (
        [interpolation_matrix(nodes, x) @ np.linalg.matrix_power(rate, k) for k in range(3)] for x in (u, v)
    )
    return tuple(np.einsum("pi,pj,ijc->pc", along_u[k], along_v[m], values) for k, m in orders(2, 2))


@lru_cache(maxsize=16)
def _exact_grid(samples: tuple[float, ...], family: Family) -> tuple[Floats, Floats]:
    along = np.array(samples)
    points, normals = PARAMETERISATIONS["smooth"](along[:, np.newaxis], along[np.newaxis], family)
    return points.reshape(-1, 3), normals.reshape(-1, 3)


@dataclass(frozen=True, slots=True)
class ExactMeasures:
    """Measures of the exact wall.

    Attributes
    ----------
    volume : float
        In mm3.
    area : float
        Of the mid-surface, in mm2.
    mean_thickness : float
        Over the mid-surface, in mm.
    """

    volume: float
    area: float
    mean_thickness: float


def exact_measures(complex: CellComplex, grading: Grading) -> ExactMeasures:
    """Volume, area and mean thickness of the exact wall.

    The exact faces are sampled at the Gauss points of each patch and differentiated as the polynomial
    through them; patches are analytic, so this converges faster than any power. It is slower where a field has kinks.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading

    Returns
    -------
    ExactMeasures
    """
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    rate = differentiation_matrix(nodes)
    totals = np.zeros(3)
    for _, fitted in offset_patches(complex, grading, nodes):
        shape = (-1, len(nodes), len(nodes), 3)
        middle = fitted.points.reshape(shape)
        half = (fitted.normals * (fitted.thickness / 2)[:, np.newaxis]).reshape(shape)
        along = grid_rates(rate, middle)
        volumes = layer_volumes(along, grid_rates(rate, half), half)
        flat = np.cross(*along)
        areas = np.linalg.norm(flat, axis=-1)
        integrands = np.stack([volumes, areas, areas * fitted.thickness.reshape(areas.shape)])
        totals += np.einsum("u,v,ipuv->i", weights, weights, integrands)
    volume, area, thickness = totals.tolist()
    return ExactMeasures(volume, area, thickness / area)


def block_volume(cells: tuple[int, int, int], grading: Grading) -> float:
    """Volume in mm3 of the block of cells where the map carries it, by Gauss quadrature of the determinant.

    Parameters
    ----------
    cells : tuple of int
    grading : Grading

    Returns
    -------
    float

    Raises
    ------
    SelfIntersectionError
        If the determinant is not positive all over the block.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_BLOCK_POINTS)
    inside = np.stack(np.meshgrid(*3 * [(nodes + 1) / 2], indexing="ij"), axis=-1).reshape(-1, 3)
    quadrature = np.einsum("i,j,k->ijk", *3 * [weights / 2]).ravel()
    volume = 0.0
    for corner in np.ndindex(*cells):
        determinant = grading.carry((inside + corner) * grading.cell_size)[2]
        volume += float(np.sum(quadrature * determinant)) * grading.cell_size**3
    return volume


def differentiation_matrix(nodes: Floats) -> Floats:
    """Derivatives at the nodes of the polynomial through values there, by barycentric weights.

    Parameters
    ----------
    nodes : ndarray, shape (m,)

    Returns
    -------
    ndarray, shape (m, m)
        From values at the nodes to derivatives there.
    """
    difference = nodes[:, np.newaxis] - nodes
    np.fill_diagonal(difference, 1.0)
    barycentric = 1 / difference.prod(axis=1)
    matrix = barycentric / barycentric[:, np.newaxis] / difference
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return np.asarray(matrix)


def grid_rates(matrix: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Derivatives along u and v of what is sampled at the nodes of a grid.

    Parameters
    ----------
    matrix : ndarray, shape (m, m)
        Of :func:`differentiation_matrix`.
    values : ndarray, shape (patches, m, m, components)

    Returns
    -------
    along_u, along_v : ndarray, shape (patches, m, m, components)
    """
    return np.einsum("ab,pbvc->pavc", matrix, values), np.einsum("ab,pubc->puac", matrix, values)


def interpolation_matrix(nodes: Floats, places: Floats) -> Floats:
    """Values at other places of the polynomial through values at the nodes (Lagrange's form).

    Parameters
    ----------
    nodes : ndarray, shape (m,)
    places : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k, m)
    """
    others = ~np.eye(len(nodes), dtype=bool)
    denominators = np.prod(nodes[:, np.newaxis] - nodes, axis=1, where=others)
    products = [np.prod(places[:, np.newaxis] - nodes[others[j]], axis=1) for j in range(len(nodes))]
    return np.asarray(np.stack(products, axis=1) / denominators)

"""Determinants of the map from the cube [-1, 1]^3 to a hexahedron of 8, 20 or 27 nodes, by its own shape functions.

The corners of a quadratic hexahedron say little of what its middle nodes do: it is looked at at all its nodes and at
the Gauss points of full integration, where solvers evaluate it. What happens between these stays unseen.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.mesh.finite_elements.elements import element_type

__all__ = [
    "HEXAHEDRA",
    "determinant_measures",
    "hexahedron_nodes",
    "sample_places",
    "sampled_determinants",
    "shape_gradients",
]

Floats = NDArray[np.float64]

# On [-1, 1]^3, those of 27 nodes: the others have the first ones of them.
_NODES: Floats = element_type(True, 2, full=True).nodes.astype(np.float64) - 1
# Gauss points along each axis of full integration, by number of nodes.
_GAUSS_POINTS = {8: 2, 20: 3, 27: 3}
HEXAHEDRA = tuple(_GAUSS_POINTS)
# In parts of the cube of an element's size: less is rounding.
_NOTHING = 1e-14


def hexahedron_nodes(count: int) -> Floats:
    """Where the nodes of a hexahedron of 8, 20 or 27 nodes lie on [-1, 1]^3, in VTK's order; shape (count, 3)."""
    return _NODES[:count].copy()


def sample_places(count: int) -> Floats:
    """The nodes of a hexahedron of 8, 20 or 27, and the Gauss points of full integration; shape (samples, 3)."""
    along = np.polynomial.legendre.leggauss(_GAUSS_POINTS[count])[0]
    return np.concatenate([_NODES[:count], np.array(list(product(along, repeat=3)))])


def shape_gradients(count: int, places: Floats) -> Floats:
    """Derivatives of the shape functions of a hexahedron of 8, 20 or 27 nodes.

    The functions are those combinations of an element's monomials that are 1 at one node and 0 at the others: the
    monomials of degree at most 1, or 2, in each variable, and for 20 nodes those of superlinear degree at most 2
    (Arnold and Awanou, The serendipity family of finite elements, 2011).

    Parameters
    ----------
    count : int
        Of nodes.
    places : ndarray, shape (samples, 3)
        In [-1, 1]^3.

    Returns
    -------
    ndarray, shape (3, samples, count)
        d N_node / d (xi, eta, zeta) at the places.
    """
    exponents = _exponents(count)
    to_functions = np.linalg.inv(_monomials(exponents, _NODES[:count]))
    gradients = []
    for axis in range(3):
        lowered = exponents.copy()
        lowered[:, axis] = np.maximum(lowered[:, axis] - 1, 0)
        gradients.append(exponents[:, axis] * _monomials(lowered, places) @ to_functions)
    return np.array(gradients)


def sampled_determinants(nodes: Floats) -> Floats:
    """Determinants of hexahedra at their nodes and Gauss points; 0 where they are none to rounding.

    Parameters
    ----------
    nodes : ndarray, shape (3, 8 or 20 or 27, m)
        Coordinates of the elements' nodes.

    Returns
    -------
    ndarray, shape (samples, m)
        Of the derivatives by (xi, eta, zeta) on [-1, 1]^3, in the cube of the coordinates' unit.
    """
    return _determinants(*_columns(nodes))


def determinant_measures(nodes: Floats) -> dict[str, Floats]:
    """What the determinants at a hexahedron's nodes and Gauss points say of it.

    - determinant_ratio: the least over the largest magnitude: 1 for a parallelepiped, none or less where it is inverted
    - sampled_scaled_jacobian, of quadratic hexahedra: the least determinant of the three unit vectors along the
      derivatives by xi, eta and zeta, as the scaled Jacobian is of the edges

    Parameters
    ----------
    nodes : ndarray, shape (3, 8 or 20 or 27, m)
        Coordinates of the elements' nodes.

    Returns
    -------
    dict of str to ndarray, shape (m,)
    """
    columns, none = _columns(nodes)
    determinants = _determinants(columns, none)
    largest = np.abs(determinants).max(axis=0)
    measures = {"determinant_ratio": determinants.min(axis=0) / np.where(largest > 0, largest, 1.0)}
    if nodes.shape[1] > HEXAHEDRA[0]:
        lengths = np.sqrt(np.sum(columns * columns, axis=1)).prod(axis=0)
        scaled = determinants / np.where(determinants != 0, lengths, 1.0)
        measures["sampled_scaled_jacobian"] = scaled.min(axis=0)
    return measures


def _columns(nodes: Floats) -> tuple[Floats, Floats]:
    """Derivatives (3, coordinate, samples, m) by xi, eta and zeta, and what is none among determinants (m,)."""
    centred = nodes - nodes.mean(axis=1, keepdims=True)
    gradients = _sampled_gradients(nodes.shape[1])
    return gradients[:, np.newaxis] @ centred, _NOTHING * np.abs(centred).max(axis=(0, 1)) ** 3


def _determinants(columns: Floats, none: Floats) -> Floats:
    xi, eta, zeta = columns
    across = (
        eta[1] * zeta[2] - eta[2] * zeta[1],
        eta[2] * zeta[0] - eta[0] * zeta[2],
        eta[0] * zeta[1] - eta[1] * zeta[0],
    )
    determinants = xi[0] * across[0] + xi[1] * across[1] + xi[2] * across[2]
    return np.where(np.abs(determinants) <= none, 0.0, determinants)


@lru_cache
def _sampled_gradients(count: int) -> Floats:
    return shape_gradients(count, sample_places(count))


def _exponents(count: int) -> NDArray[np.int64]:
    """Of the monomials whose combinations the shape functions are; shape (count, 3)."""
    highest = 1 if count == 8 else 2
    powers = np.array(list(product(range(highest + 1), repeat=3)))
    superlinear = np.where(powers > 1, powers, 0).sum(axis=1)
    return np.asarray(powers[superlinear <= 2] if count == 20 else powers)


def _monomials(exponents: NDArray[np.int64], places: Floats) -> Floats:
    """Values at the places; shape (places, monomials)."""
    return np.asarray(np.prod(places[:, np.newaxis] ** exponents, axis=-1))

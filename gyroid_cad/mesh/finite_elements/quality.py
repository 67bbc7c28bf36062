"""Quality of a mesh's elements: measures of each, summaries of all, and those turned inside out.

The measures are Verdict's, of the corner nodes (``corner_measures.py``); hexahedra are looked at by their own shape
functions too (``determinants.py``), for the corners of a quadratic one say little of its middle nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.checks import finite_number
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.corner_measures import (
    Measures,
    hexahedron_corner_measures,
    quadrilateral_corner_measures,
)
from gyroid_cad.mesh.finite_elements.elements import element_type
from gyroid_cad.mesh.finite_elements.summaries import (
    USUAL_BOUNDS,
    MeasureSummary,
    Quality,
    combined,
    shown_name,
    shown_number,
    summary_of,
)

__all__ = [
    "HEXAHEDRA",
    "USUAL_BOUNDS",
    "Inverted",
    "MeasureSummary",
    "Quality",
    "combined",
    "determinant_measures",
    "element_measures",
    "hexahedron_nodes",
    "inverted",
    "quality_report",
    "sample_points",
    "sampled_determinants",
    "shape_gradients",
    "shown_name",
    "shown_number",
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
    """Nodes of a hexahedron of 8, 20 or 27 nodes on [-1, 1]^3, in VTK's order; shape (count, 3)."""
    return _NODES[:count].copy()


def sample_points(count: int) -> Floats:
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
    """Measures of a hexahedron by its Jacobian determinants at nodes and Gauss points.

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
    return shape_gradients(count, sample_points(count))


def _exponents(count: int) -> NDArray[np.int64]:
    """Exponents of the monomials whose combinations the shape functions are; shape (count, 3)."""
    highest = 1 if count == 8 else 2
    powers = np.array(list(product(range(highest + 1), repeat=3)))
    superlinear = np.where(powers > 1, powers, 0).sum(axis=1)
    return np.asarray(powers[superlinear <= 2] if count == 20 else powers)


def _monomials(exponents: NDArray[np.int64], places: Floats) -> Floats:
    """Values at the places; shape (places, monomials)."""
    return np.asarray(np.prod(places[:, np.newaxis] ** exponents, axis=-1))


Integers = NDArray[np.int64]

_QUADRILATERAL = 4
_CORNERS = 8
# So few that what is computed for them stays in the processor's cache.
_NODES_AT_ONCE = 16_384


@dataclass(frozen=True, slots=True, eq=False)
class Inverted:
    """Hexahedra that are flat or turned inside out somewhere.

    Attributes
    ----------
    elements : ndarray of int, shape (k,)
        Indices among the cells, rising.
    places : ndarray, shape (k, 3)
        Means of their nodes, in mm.
    determinants : ndarray, shape (k,)
        The smallest of each, in mm3 on the cube [-1, 1]^3.
    """

    elements: Integers
    places: Floats
    determinants: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)


def element_measures(points: ArrayLike, cells: ArrayLike) -> Measures:
    """Every measure of every element.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        In mm.
    cells : array_like of int, shape (m, 4 or 8 or 20 or 27)
        Nodes of quadrilaterals or hexahedra in VTK's order.

    Returns
    -------
    dict of str to ndarray, shape (m,)
        As listed at :class:`Quality`.

    Raises
    ------
    ParameterError
        If points or cells are not of that kind, or there are none.
    """
    points, cells = _checked(points, cells)
    blocks = [_measures(nodes) for _, nodes in _blocks(points, cells)]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


def quality_report(points: ArrayLike, cells: ArrayLike, bounds: Mapping[str, float] | None = None) -> Quality:
    """Summaries of every measure.

    Memory does not grow with the number of elements. A mesh that is made piece by piece is reported on piece by piece,
    and the reports :func:`combined`.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        In mm.
    cells : array_like of int, shape (m, 4 or 8 or 20 or 27)
        Nodes of quadrilaterals or hexahedra in VTK's order.
    bounds : mapping of str to float, optional
        Where acceptable ends, by measure, instead of ``USUAL_BOUNDS``.

    Raises
    ------
    ParameterError
        If points or cells are not of that kind, there are none, or a bound is of no measure.
    """
    points, cells = _checked(points, cells)
    limits = {**USUAL_BOUNDS, **(bounds or {})}
    for name, bound in limits.items():
        if name not in USUAL_BOUNDS:
            raise ParameterError("bounds", name, f"some of {', '.join(USUAL_BOUNDS)}")
        finite_number(f"bounds[{name!r}]", bound)
    return combined(_block_quality(nodes, limits) for _, nodes in _blocks(points, cells))


def inverted(points: ArrayLike, cells: ArrayLike) -> Inverted:
    """Hexahedra whose determinant is not positive at one of their nodes or Gauss points, and where they are.

    Parameters
    ----------
    points : array_like, shape (n, 3)
        In mm.
    cells : array_like of int, shape (m, 8 or 20 or 27)

    Raises
    ------
    ParameterError
        If points or cells are not of that kind, or there are none.
    """
    points, cells = _checked(points, cells)
    if cells.shape[1] not in HEXAHEDRA:
        raise ParameterError("cells", cells.shape, "hexahedra of 8, 20 or 27 nodes: a face in space has no sign")
    elements, places, smallest = [], [], []
    for first, nodes in _blocks(points, cells):
        least = sampled_determinants(nodes).min(axis=0)
        bad = np.flatnonzero(least <= 0)
        elements.append(first + bad)
        places.append(nodes[..., bad].mean(axis=1).T)
        smallest.append(least[bad])
    return Inverted(np.concatenate(elements), np.concatenate(places), np.concatenate(smallest))


def _checked(points: ArrayLike, cells: ArrayLike) -> tuple[Floats, Integers]:
    places, nodes = np.asarray(points), np.asarray(cells)
    if places.ndim != 2 or places.shape[1] != 3 or places.dtype.kind not in "fiu" or not np.isfinite(places).all():
        raise ParameterError("points", _described(places), "finite coordinates in mm, shape (n, 3)")
    widths = (_QUADRILATERAL, *HEXAHEDRA)
    if nodes.ndim != 2 or nodes.shape[1] not in widths or nodes.dtype.kind not in "iu" or not len(nodes):
        raise ParameterError("cells", _described(nodes), "one element or more of 4, 8, 20 or 27 node numbers each")
    if nodes.min() < 0 or nodes.max() >= len(places):
        extremes = f"{nodes.min()} to {nodes.max()}"
        raise ParameterError("cells", extremes, f"node numbers from 0 to {len(places) - 1}")
    return places.astype(np.float64, copy=False), nodes


def _described(array: NDArray[Any]) -> str:
    return f"{array.dtype} {array.shape}"


def _blocks(points: Floats, cells: Integers) -> Iterator[tuple[int, Floats]]:
    """Index of the first element and coordinates (3, nodes, elements) of some elements at a time."""
    step = _NODES_AT_ONCE // cells.shape[1]
    for first in range(0, len(cells), step):
        yield first, np.ascontiguousarray(points[cells[first : first + step].T].transpose(2, 0, 1))


def _measures(nodes: Floats) -> Measures:
    if nodes.shape[1] == _QUADRILATERAL:
        return quadrilateral_corner_measures(nodes)
    return hexahedron_corner_measures(nodes[:, :_CORNERS]) | determinant_measures(nodes)


def _block_quality(nodes: Floats, bounds: Mapping[str, float]) -> Quality:
    measures = _measures(nodes)
    centres = nodes.mean(axis=1)
    summaries = {name: summary_of(name, values, bounds[name], centres) for name, values in measures.items()}
    bad = int(np.sum(measures["determinant_ratio"] <= 0)) if nodes.shape[1] in HEXAHEDRA else 0
    return Quality(nodes.shape[2], nodes.shape[1], bad, MappingProxyType(summaries))

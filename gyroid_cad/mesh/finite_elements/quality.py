"""How good the elements of a mesh are: measures of each, summaries of all, and which are turned inside out.

The measures are Verdict's, of the corner nodes (``corner_measures.py``); hexahedra are looked at by their own shape
functions too (``determinants.py``), for the corners of a quadratic one say little of its middle nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.checks import finite_number
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.corner_measures import hexahedron_corner_measures, quadrilateral_corner_measures
from gyroid_cad.mesh.finite_elements.determinants import HEXAHEDRA, determinant_measures, sampled_determinants
from gyroid_cad.mesh.finite_elements.summaries import (
    USUAL_BOUNDS,
    MeasureSummary,
    Quality,
    combined,
    quality_rows,
    shown_name,
    shown_number,
    summary_of,
)

__all__ = [
    "USUAL_BOUNDS",
    "Inverted",
    "MeasureSummary",
    "Quality",
    "combined",
    "element_measures",
    "inverted",
    "quality_report",
    "quality_rows",
    "shown_name",
    "shown_number",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Measures = dict[str, Floats]

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

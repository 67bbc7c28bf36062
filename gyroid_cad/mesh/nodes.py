"""Places of a grid on every patch, numbered once: patches share those of their common edges and corners.

First come the fans, then the places between the ends of every edge, in the edge's own direction, then those inside
every patch. Control points and nodes are numbered alike; nothing is merged by distance.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.wall.complex import CellComplex

__all__ = ["FACE_A", "FACE_B", "FREE_WALLS", "patch_nodes", "place_count"]

Integers = NDArray[np.int64]

# Of the wall: A faces the network that the common normal points to, B the other; free walls close the lattice's rim.
FACE_A, FACE_B, FREE_WALLS = "FACE_A", "FACE_B", "FREE_WALLS"


def place_count(complex: CellComplex, steps: int) -> int:
    """Count the nodes with so many steps along each side of a patch."""
    inner = steps - 1
    return complex.fan_count + complex.edge_count * inner + complex.patch_count * inner**2


def patch_nodes(complex: CellComplex, steps: int, patches: slice = slice(None)) -> Integers:
    """Numbers of the places of patches.

    Parameters
    ----------
    complex : CellComplex
    steps : int
        Along each side of a patch.
    patches : slice, optional
        Which patches; all if left out.

    Returns
    -------
    ndarray of int, shape (patches, steps + 1, steps + 1)
        Along u, then v. Corner k, at the start of edge k, is its fan's own number.
    """
    inner = steps - 1
    first_on_edges = complex.fan_count
    first_inside = first_on_edges + complex.edge_count * inner
    chosen = np.arange(complex.patch_count)[patches]
    numbers = np.empty((steps + 1, steps + 1, len(chosen)), dtype=np.int64)
    along = np.arange(inner)[:, np.newaxis]
    for k in range(4):
        row = edge_row(numbers, k)
        run = np.where(complex.edge_forward[chosen, k], along, inner - 1 - along)
        row[0] = complex.patch_fans[chosen, k]
        row[1:-1] = first_on_edges + complex.patch_edges[chosen, k] * inner + run
    within = np.arange(inner**2).reshape(inner, inner, 1)
    numbers[1:-1, 1:-1] = first_inside + chosen * inner**2 + within
    return np.ascontiguousarray(np.moveaxis(numbers, -1, 0))

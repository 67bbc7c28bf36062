"""Shells of a triangulated surface: which triangles are connected, which shells bound voids, and what is open.

A shell is what is connected by edges. Oriented outwards, one that bounds solid encloses a positive volume, and one
that bounds a void within it a negative one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays

__all__ = ["Shells", "shells_of"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Solid angle of a whole sphere, by which winding numbers are counted.
_SPHERE = 4 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class Shells:
    """The shells of a triangulated surface.

    Attributes
    ----------
    volumes : ndarray, shape (shells,)
        Signed, in mm3; the largest in size first.
    triangles : ndarray of int, shape (shells,)
        How many each has.
    inside : ndarray of bool, shape (shells,)
        Of shells turned inwards: whether another goes round it.
    open_edges : int
        Not run through as often one way as the other: at these the surface is not closed, or turned inside out.
    low, high : ndarray, shape (3,)
        Corners of the box round all of them, in mm.
    """

    volumes: Floats
    triangles: Integers
    inside: NDArray[np.bool_]
    open_edges: int
    low: Floats
    high: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def closed(self) -> bool:
        return self.open_edges == 0

    @property
    def pieces(self) -> int:
        """Solids that are not joined."""
        return int(np.sum(self.volumes > 0))

    @property
    def trapped_voids(self) -> int:
        """Shells turned inwards, inside another."""
        return int(np.sum((self.volumes < 0) & self.inside))

    @property
    def inside_out(self) -> int:
        """Shells turned inwards that no other goes round."""
        return int(np.sum((self.volumes < 0) & ~self.inside))


def shells_of(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> Shells:
    """Take a triangulated surface apart into its shells.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm; no two alike, for triangles are connected by their vertices' numbers.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.

    Returns
    -------
    Shells
    """
    points, facets = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    labels, open_edges = _connected(facets, len(points))
    corners = points[facets] - points.mean(axis=0)
    volumes = np.bincount(labels, np.einsum("nc,nc->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)
    order = np.argsort(-np.abs(volumes), kind="stable")
    # There may be thousands of loose pieces, and each question takes all triangles: only voids are asked.
    inside = np.zeros(len(order), dtype=np.bool_)
    for place in np.flatnonzero(volumes[order] < 0).tolist():
        inside[place] = _inside_another(points, facets, labels, int(order[place]))
    used = points[np.unique(facets)]
    counts = np.bincount(labels)[order]
    return Shells(
        np.asarray(volumes[order], dtype=float), counts, inside, open_edges, used.min(axis=0), used.max(axis=0)
    )


def _connected(triangles: Integers, count: int) -> tuple[Integers, int]:
    """Labels of what is connected by edges, shape (triangles,); and how many edges are open."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    forward = edges[:, 0] < edges[:, 1]
    keys = edges.min(axis=1) * count + edges.max(axis=1)
    order = np.argsort(keys, kind="stable")
    sorted_keys, owner = keys[order], order // 3
    first = np.flatnonzero(np.concatenate([[True], sorted_keys[1:] != sorted_keys[:-1]]))
    balance = np.add.reduceat(np.where(forward[order], 1, -1), first)
    alike = np.flatnonzero(sorted_keys[1:] == sorted_keys[:-1])
    size = len(triangles)
    joined = coo_array((np.ones(len(alike), dtype=bool), (owner[alike], owner[alike + 1])), shape=(size, size))
    return np.asarray(connected_components(joined, directed=False)[1], dtype=np.int64), int(np.sum(balance != 0))


def _inside_another(points: Floats, triangles: Integers, labels: Integers, shell: int) -> bool:
    """Tell whether another shell goes round one: by the winding number of the others about a point of it.

    Solid angles of triangles as of van Oosterom and Strackee (IEEE Trans. Biomed. Eng. 30, 1983).
    """
    others = labels != shell
    point = points[triangles[np.flatnonzero(~others)[0], 0]]
    a, b, c = np.moveaxis(points[triangles[others]] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    volume = np.einsum("nc,nc->n", a, np.cross(b, c))
    flat = la * lb * lc + np.sum(a * b, axis=1) * lc + np.sum(b * c, axis=1) * la + np.sum(c * a, axis=1) * lb
    angles = 2 * np.arctan2(volume, flat)
    # Shell by shell: what one encloses another may exclude.
    winding = np.bincount(labels[others], angles, minlength=int(labels.max()) + 1) / _SPHERE
    return bool(np.any(np.rint(winding) != 0))

"""Measures of tetrahedra of 4 or 10 nodes: volumes, mean ratios, and whether one is turned inside out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot

__all__ = ["EDGES", "FACES", "cell_volumes", "mean_ratios", "smallest_determinants"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Corners of the edges in the order of the nodes in their middles, and of the faces, outwards, as VTK and Abaqus count.
EDGES = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
# A rule that is exact to the third degree, as determinants of quadratic tetrahedra are (Stroud T3 3-1), of volume 1.
_PLACES = np.array([(0.25, 0.25, 0.25, 0.25), *(np.eye(4) / 3 + 1 / 6)])
_WEIGHTS = np.array([-0.8, 0.45, 0.45, 0.45, 0.45])
# Where determinants are looked at: all ten nodes, and the Gauss points of the second degree.
_INSIDE = 0.1381966011250105
_LOOKED_AT = np.concatenate([np.eye(4), np.eye(4)[EDGES].mean(axis=1), _INSIDE + (1 - 4 * _INSIDE) * np.eye(4)])


def mean_ratios(points: Floats, cells: Integers) -> Floats:
    """Mean ratios of tetrahedra by their corners: 1 of a regular one, 0 of a flat one, below of one turned inside out.

    12 (3 V)^(2/3) by the sum of the squared edges (Liu and Joe, Relationship between tetrahedron shape measures, 1994).

    Examples
    --------
    >>> corners = np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    >>> mean_ratios(corners, np.array([[0, 1, 2, 3], [1, 0, 2, 3]])).round(9).tolist()
    [-1.0, 1.0]
    """
    corners = points[cells[:, :4]]
    volumes = _straight_volumes(corners)
    edges = corners[:, EDGES[:, 0]] - corners[:, EDGES[:, 1]]
    squares = np.maximum(dot(edges, edges).sum(axis=1), np.finfo(float).tiny)
    return np.asarray(np.sign(volumes) * 12 * np.cbrt(3 * np.abs(volumes)) ** 2 / squares)


def cell_volumes(points: Floats, cells: Integers) -> Floats:
    """Volumes of tetrahedra, in mm3; of those of 10 nodes with their curved sides.

    Examples
    --------
    >>> corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> ten = np.concatenate([corners, corners[EDGES].mean(axis=1)])
    >>> cell_volumes(ten, np.arange(10)[np.newaxis]).round(9).tolist()
    [0.166666667]
    """
    if cells.shape[1] == 4:
        return _straight_volumes(points[cells])
    return np.asarray(_WEIGHTS @ _determinants(points, cells, _PLACES) / 6)


def smallest_determinants(points: Floats, cells: Integers) -> Floats:
    """Smallest of each tetrahedron's determinants at its nodes and Gauss points, in parts of that of its corners.

    Examples
    --------
    >>> corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    >>> smallest_determinants(corners, np.arange(4)[np.newaxis]).tolist()
    [1.0]
    """
    if cells.shape[1] == 4:
        return np.asarray(np.sign(_straight_volumes(points[cells])))
    straight = np.maximum(6 * np.abs(_straight_volumes(points[cells[:, :4]])), np.finfo(float).tiny)
    return np.asarray(_determinants(points, cells, _LOOKED_AT).min(axis=0) / straight)


def _straight_volumes(corners: Floats) -> Floats:
    a, b, c = (corners[:, k] - corners[:, 0] for k in (1, 2, 3))
    return np.asarray(dot(a, np.cross(b, c)) / 6)


def _determinants(points: Floats, cells: Integers, places: Floats) -> Floats:
    """Determinants (places, cells) of quadratic tetrahedra at places by the weights of the corners, (places, 4)."""
    one, other = EDGES.T
    # By each corner's weight: of corners w (2 w - 1), of middles 4 w v; the last weight is 1 less the others.
    gradients = np.zeros((len(places), 4, 10))
    corner = np.arange(4)
    gradients[:, corner, corner] = 4 * places - 1
    gradients[:, one, 4 + np.arange(6)] = 4 * places[:, other]
    gradients[:, other, 4 + np.arange(6)] = 4 * places[:, one]
    along = gradients[:, 1:] - gradients[:, :1]
    columns = np.einsum("pkn,enx->pkex", along, points[cells] - points[cells[:, :1]])
    return dot(columns[:, 0], np.cross(columns[:, 1], columns[:, 2]))

"""Points spread over triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, numbered_groups, unit

__all__ = ["spread_points"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of the spacing: how far apart points are along columns, and columns; and the diagonal of cubes that hold one each.
_STEP, _CUBE = 0.75, 0.15


def spread_points(corners: Floats, spacing: float, face: Integers | None = None) -> tuple[Floats, Floats]:
    """Points of triangles, so that no place is further than a spacing from one; and normals there.

    They lie in columns on each triangle's longest side, so that a long thin one, as faces with holes are meshed by,
    has no more than its length asks for; then of those that all but coincide one is left.

    Parameters
    ----------
    corners : ndarray, shape (triangles, 3, 3)
        In mm.
    spacing : float
        In mm.
    face : ndarray of int, shape (triangles,), optional
        Of these each has points of its own; one face if left out.

    Returns
    -------
    points, normals : ndarray, shape (n, 3)

    Examples
    --------
    >>> [len(spread_points(np.eye(3)[np.newaxis], spacing)[0]) for spacing in (2.0, 1.0)]
    [4, 5]
    """
    face, step = np.zeros(len(corners), dtype=np.int64) if face is None else face, _STEP * spacing
    foot, top, triangle = _columns(corners, step)
    counts = np.ceil(np.linalg.norm(top - foot, axis=1) / step).astype(np.int64)
    column, number = numbered_groups(counts + 1)
    share = number / np.maximum(counts, 1)[column]
    points = foot[column] + share[:, np.newaxis] * (top - foot)[column]
    kept = _one_of_each(face[triangle[column]], points, _CUBE * spacing * 3**-0.5)
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    return points[kept], normals[triangle[column[kept]]]


def _columns(corners: Floats, step: float) -> tuple[Floats, Floats, Integers]:
    """Feet of columns on the longest sides of triangles, their tops on the others, and the triangle of each.

    One of each triangle's is that of its tip, so that no place is beside lower columns alone.
    """
    sides = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
    order = (sides.argmax(axis=1)[:, np.newaxis] + np.arange(3)) % 3
    tip, start, end = np.moveaxis(np.take_along_axis(corners, order[..., np.newaxis], axis=1), 1, 0)
    base = end - start
    middle = dot(tip - start, base) / np.maximum(dot(base, base), np.finfo(float).tiny)
    height = tip - start - middle[:, np.newaxis] * base
    counts = np.ceil(sides.max(axis=1) / step).astype(np.int64).clip(1)
    triangle, number = numbered_groups(counts + 2)
    share = np.where(number > counts[triangle], middle[triangle], number / counts[triangle])
    middle = middle[triangle]
    before = share <= middle
    with np.errstate(divide="ignore", invalid="ignore"):
        rise = np.nan_to_num(np.where(before, share / middle, (1 - share) / (1 - middle)), nan=0.0)
    foot = start[triangle] + share[:, np.newaxis] * base[triangle]
    return foot, foot + rise[:, np.newaxis] * height[triangle], triangle


def _one_of_each(face: Integers, points: Floats, side: float) -> Integers:
    """Positions of the first point of each face in each cube of so long a side."""
    cubes = np.floor((points - points.min(axis=0, initial=0.0)) / side).astype(np.int64)
    key = face
    for axis in range(3):
        key = key * (int(cubes[:, axis].max(initial=0)) + 1) + cubes[:, axis]
    return np.sort(np.unique(key, return_index=True)[1])

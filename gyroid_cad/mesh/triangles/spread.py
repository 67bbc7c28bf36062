"""Points spread over triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import unit

__all__ = ["spread_points"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def spread_points(
    a: Floats, b: Floats, c: Floats, spacing: float, face: Integers | None = None
) -> tuple[Floats, Floats]:
    """Points of triangles, their corners among them, so that no place is further than a spacing from one; normals.

    A point that triangles of one face share is given once; of several faces, once for each.

    Parameters
    ----------
    a, b, c : ndarray, shape (triangles, 3)
        Corners, in mm.
    spacing : float
        In mm.
    face : ndarray of int, shape (triangles,), optional
        One face if left out.

    Returns
    -------
    points, normals : ndarray, shape (n, 3)

    Examples
    --------
    >>> a, b, c = np.eye(3)[:, np.newaxis]
    >>> [len(spread_points(a, b, c, spacing)[0]) for spacing in (2.0, 1.0)]
    [4, 8]
    """
    face = np.zeros(len(a), dtype=np.int64) if face is None else face
    normals = unit(np.cross(b - a, c - a))
    steps = [np.ceil(np.linalg.norm(end - a, axis=1) / spacing).astype(int).clip(1) for end in (b, c)]
    clouds, directions, faces = [], [], []
    for along_b, along_c in np.unique(np.stack(steps, axis=1), axis=0).tolist():
        alike = (steps[0] == along_b) & (steps[1] == along_c)
        u, v = (np.linspace(0, 1, count + 1) for count in (along_b, along_c))
        u, v = (grid.ravel() for grid in np.meshgrid(u, v))
        # Beyond the third side points are moved onto it: a place near it is then no further from one.
        excess = np.maximum(u + v, 1)
        u, v = (u / excess)[:, np.newaxis, np.newaxis], (v / excess)[:, np.newaxis, np.newaxis]
        cloud = a[alike] + u * (b - a)[alike] + v * (c - a)[alike]
        clouds.append(cloud.reshape(-1, 3))
        directions.append(np.broadcast_to(normals[alike], cloud.shape).reshape(-1, 3))
        faces.append(np.broadcast_to(face[alike], cloud.shape[:2]).ravel())
    points = np.concatenate(clouds)
    keys = np.column_stack([np.concatenate(faces), points])
    _, first = np.unique(keys, axis=0, return_index=True)
    return points[first], np.concatenate(directions)[first]

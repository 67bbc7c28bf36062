"""Triangles as files can hold them: corners that any program tells apart, closed by their coordinates alone."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import signed_volumes
from gyroid_cad.errors import ExportError
from gyroid_cad.mesh.triangles.files import renumbered
from gyroid_cad.mesh.triangles.measures import shell_labels, unmatched_edges

__all__ = ["TOLD_APART", "joined_meshes", "storable_triangles", "without_chips"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# In mm: programs that read triangles take corners nearer than 1e-8 for one, some of them up to several times that.
TOLD_APART = 2.0**-24
# How often corners that became one are moved apart, first by two steps and each time by twice as many.
_TRIES = 8


def joined_meshes(meshes: Sequence[tuple[Floats, Integers]]) -> tuple[Floats, Integers]:
    """Vertices and triangles of several meshes as those of one.

    Examples
    --------
    >>> corner = np.eye(3), np.array([[0, 1, 2]])
    >>> joined_meshes([corner, corner])[1].tolist()
    [[0, 1, 2], [3, 4, 5]]
    """
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    triangles = [numbers + first for (_, numbers), first in zip(meshes, counts[:-1], strict=True)]
    return np.concatenate([vertices for vertices, _ in meshes]), np.concatenate(triangles)


def storable_triangles(vertices: Floats, triangles: Integers, single: bool = True) -> tuple[Floats, Integers]:
    """Triangles that stay closed when their corners are rounded for a file and numbered by coordinates alone.

    Coordinates become multiples of one step, so that corners which differ are that far apart: 6e-8 mm, or if that is
    more what single precision tells apart at the largest of them. Corners that become one are one, and triangles
    between them vanish; where two that do not belong together would meet, they are moved apart by some steps, each
    into its own side.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Closed.
    single : bool
        Whether the file has numbers of single precision.

    Returns
    -------
    vertices : ndarray, shape (fewer, 3)
        Numbers that such a file has.
    triangles : ndarray of int, shape (fewer, 3)

    Raises
    ------
    ExportError
        If they do not stay closed.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> len(storable_triangles(corners, sides)[1])
    4
    """
    reach = np.float32(np.abs(vertices).max(initial=0.0))
    step = max(TOLD_APART, float(np.spacing(reach))) if single else TOLD_APART
    stored = _in_steps(vertices, step)
    for attempt in range(_TRIES):
        places, numbers, _ = renumbered(stored, triangles)
        if not unmatched_edges(numbers):
            return places, numbers
        stored = _in_steps(_parted(vertices, triangles, stored, step * 2.0 ** (attempt + 1)), step)
    raise ExportError(
        "nothing was written: its triangles do not stay closed in single precision; try another deviation"
    )


def _in_steps(vertices: Floats, step: float) -> Floats:
    # A power of two, by which no digit is lost.
    return np.asarray(np.rint(vertices / step) * step)


def _parted(vertices: Floats, triangles: Integers, stored: Floats, away: float) -> Floats:
    """Corners that became one moved a little against the normals of their own triangles."""
    _, which, count = np.unique(stored, axis=0, return_inverse=True, return_counts=True)
    together = np.flatnonzero(count[which.ravel()] > 1)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    across = np.cross(b - a, c - a)
    normals = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(across[:, k], 3), len(vertices)) for k in range(3)], axis=1
    )[together]
    normals = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    parted = stored.copy()
    # Where triangles have no area there are no normals, and sheets that lie on one another have the same.
    aside = np.random.default_rng(len(together)).uniform(-0.5, 0.5, normals.shape)
    parted[together] = vertices[together] - away * (normals + aside)
    return parted


def without_chips(vertices: Floats, triangles: Integers, shells: int, least: float) -> tuple[Floats, Integers, int]:
    """Triangles without the shells that rounding cut off, and how many shells bound a solid from outside.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Every edge used by two of them, once each way.
    shells : int
        How many there were before they were rounded: nothing goes where there are no more.
    least : float
        Volume in mm3 below which a shell that bounds a solid or a void is a chip.

    Returns
    -------
    vertices : ndarray, shape (fewer, 3)
    triangles : ndarray of int, shape (fewer, 3)
    solids : int

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> both = np.concatenate([corners, 0.1 * corners + 2.0]), np.concatenate([sides, sides + 4])
    >>> [solids for *_, solids in (without_chips(*both, shells, 0.001) for shells in (1, 2))]
    [1, 2]
    """
    label = shell_labels(triangles)
    volumes = np.bincount(label, signed_volumes(vertices, triangles))
    kept = np.abs(volumes) >= least if len(volumes) > shells else np.ones(len(volumes), dtype=np.bool_)
    solids = int(np.sum(kept & (volumes > 0)))
    if kept.all():
        return vertices, triangles, solids
    used, numbers = np.unique(triangles[kept[label]], return_inverse=True)
    return vertices[used], numbers.reshape(-1, 3).astype(np.int64), solids

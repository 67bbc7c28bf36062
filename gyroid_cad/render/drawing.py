"""Pictures of triangles: a z-buffer in numpy, written as PNG. No display, no graphics library, no kernel."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays

__all__ = ["VIEWS", "Facets", "View", "drawn"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

# Pixels are drawn so many times finer, along both sides, and averaged.
_FINER = 2
_FRAGMENTS_AT_ONCE = 100_000
# Part of the picture left free round what is drawn.
_MARGIN = 0.03
# Light: from the viewer's upper left, and some from everywhere.
_LIGHT = np.array([-0.35, 0.5, 0.8]) / np.linalg.norm([-0.35, 0.5, 0.8])
_AMBIENT, _DIFFUSE = 0.5, 0.56
_NO_LENGTH = 1e-30


@dataclass(frozen=True, slots=True)
class View:
    """From where a picture is taken, without perspective.

    Attributes
    ----------
    name : str
    towards : tuple of float
        Direction from what is drawn to the viewer.
    up : tuple of float
        What is upright in the picture.
    """

    name: str
    towards: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    @property
    def axes(self) -> Floats:
        """Unit vectors to the picture's right, up it and to the viewer, as rows."""
        towards = np.array(self.towards) / np.linalg.norm(self.towards)
        right = np.cross(self.up, towards)
        right /= np.linalg.norm(right)
        return np.stack([right, np.cross(towards, right), towards])


VIEWS = (
    View("from the corner", (3.0, -4.0, 2.6)),
    View("from the front, along y", (0.0, -1.0, 0.0)),
    View("from the right, along x", (1.0, 0.0, 0.0)),
    View("from above, along z", (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
)


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Coloured triangles.

    Attributes
    ----------
    corners : ndarray, shape (n, 3, 3)
        By triangle, corner and coordinate, in mm.
    normals : ndarray, shape (n, 3, 3)
        At the corners, out of the solid; of any length but zero.
    colours : ndarray, shape (n, 3)
        Red, green and blue from 0 to 1.
    closed : bool
        Whether they bound solids, counterclockwise seen from outside: then none is ever seen from behind.
    """

    corners: Floats
    normals: Floats
    colours: Floats
    closed: bool

    def __post_init__(self) -> None:
        freeze_arrays(self)


def drawn(facets: Facets, view: View, size: int) -> Bytes:
    """Draw triangles.

    Parameters
    ----------
    facets : Facets
    view : View
    size : int
        Of the longer side of the picture, in pixels.

    Returns
    -------
    ndarray of uint8, shape (height, width, 4)
        Red, green, blue and how opaque; nothing is behind the triangles.
    """
    points = facets.corners @ view.axes.T
    low, high = (reach(points.reshape(-1, 3), axis=0)[:2] for reach in (np.min, np.max))
    scale = _FINER * size * (1 - 2 * _MARGIN) / float(np.max(high - low))
    margin = _MARGIN * size * _FINER
    width, height = (_FINER * int(np.ceil(x)) for x in ((high - low) * scale + 2 * margin) / _FINER)
    placed = np.empty_like(points)
    placed[..., 0] = (points[..., 0] - low[0]) * scale + margin
    placed[..., 1] = (high[1] - points[..., 1]) * scale + margin
    placed[..., 2] = points[..., 2]
    depths = np.full(width * height, -np.inf)
    owners = np.zeros(width * height, dtype=np.int64)
    portions = np.zeros((width * height, 3))
    for pixels, depth, which, shares in _fragments(placed, facets.closed, width, height):
        nearer = np.flatnonzero(depth > depths[pixels])
        # Of fragments in one pixel the nearest is to be written last.
        nearer = nearer[np.argsort(depth[nearer], kind="stable")]
        seen = pixels[nearer]
        depths[seen], owners[seen], portions[seen] = depth[nearer], which[nearer], shares[nearer]
    covered = np.isfinite(depths)
    shades = np.zeros((width * height, 3))
    shades[covered] = _shaded(facets, owners[covered], portions[covered], view)
    return _averaged(shades, covered, width, height)


def _shaded(facets: Facets, which: Integers, shares: Floats, view: View) -> Floats:
    """Colours at places of triangles, lit."""
    normal = np.einsum("nk,nkc->nc", shares, facets.normals[which]) @ view.axes.T
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), _NO_LENGTH)
    # What is seen from behind, in a surface that is not closed, is lit too.
    normal *= np.where(normal[:, 2:] < 0, -1.0, 1.0)
    light = _AMBIENT + _DIFFUSE * np.maximum(dot(normal, _LIGHT), 0.0)
    return np.minimum(facets.colours[which] * light[:, np.newaxis], 1.0)


def _fragments(
    placed: Floats, closed: bool, width: int, height: int
) -> Iterator[tuple[Integers, Floats, Integers, Floats]]:
    """Pixels that triangles cover: number of pixel, depth, triangle, and shares of its three corners."""
    low = np.floor(placed[..., :2].min(axis=1) - 0.5).astype(np.int64).clip(0)
    high = np.ceil(placed[..., :2].max(axis=1) - 0.5).astype(np.int64)
    high = np.minimum(high, [width - 1, height - 1])
    extent = high - low + 1
    a, b, c = (placed[:, k, :2] for k in range(3))
    twice = _cross(b - a, c - a)
    # Down the picture is the other way round. Of closed surfaces the back is never seen.
    facing = twice < 0 if closed else twice != 0
    seen = np.flatnonzero(facing & np.all(extent > 0, axis=1))
    # Triangles whose boxes are about as large, to an eighth, go together.
    unit = 2 ** np.maximum(np.floor(np.log2(np.maximum(extent[seen], 1))).astype(np.int64) - 3, 0)
    boxes = -(-extent[seen] // unit) * unit
    kinds, which_kind = np.unique(boxes, axis=0, return_inverse=True)
    in_order = seen[np.argsort(which_kind.ravel(), kind="stable")]
    ends = np.cumsum(np.bincount(which_kind.ravel(), minlength=len(kinds)))
    for (columns, rows), members in zip(kinds.tolist(), np.split(in_order, ends[:-1]), strict=True):
        step = max(1, _FRAGMENTS_AT_ONCE // (columns * rows))
        for first in range(0, len(members), step):
            some = members[first : first + step]
            x = low[some, 0, np.newaxis, np.newaxis] + np.arange(columns)[np.newaxis, np.newaxis]
            y = low[some, 1, np.newaxis, np.newaxis] + np.arange(rows)[np.newaxis, :, np.newaxis]
            px, py = x + 0.5, y + 0.5
            corner = [(placed[some, k, 0, None, None], placed[some, k, 1, None, None]) for k in range(3)]
            area = twice[some, np.newaxis, np.newaxis]
            shares = [
                ((corner[k][0] - px) * (corner[m][1] - py) - (corner[k][1] - py) * (corner[m][0] - px)) / area
                for k, m in ((1, 2), (2, 0), (0, 1))
            ]
            inside = (shares[0] >= 0) & (shares[1] >= 0) & (shares[2] >= 0) & (x < width) & (y < height)
            which, row, column = np.nonzero(inside)
            weights = np.stack([share[which, row, column] for share in shares], axis=1)
            triangle = some[which]
            depth = np.sum(weights * placed[triangle, :, 2], axis=1)
            yield (low[triangle, 1] + row) * width + low[triangle, 0] + column, depth, triangle, weights


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _averaged(shades: Floats, covered: NDArray[np.bool_], width: int, height: int) -> Bytes:
    blocks = (height // _FINER, _FINER, width // _FINER, _FINER)
    opaque = covered.reshape(blocks).mean(axis=(1, 3))
    colour = shades.reshape(*blocks, 3).sum(axis=(1, 3)) / np.maximum(opaque * _FINER**2, 1)[..., np.newaxis]
    picture = np.concatenate([colour, opaque[..., np.newaxis]], axis=-1)
    return np.asarray(np.round(picture * 255), dtype=np.uint8)

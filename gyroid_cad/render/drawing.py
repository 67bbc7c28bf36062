"""Pictures of triangles: soft light, fine lines where faces meet, dark ones along edges and outlines.

Orthographic, and all in numpy: no display, driver, viewer or kernel is needed. Edges are found in the picture itself,
where neighbouring samples see different things (T. Saito and T. Takahashi, *Comprehensible rendering of 3-D shapes*,
1990).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.render.facets import Facets
from gyroid_cad.render.picture import CAMERA, SIZE, Vector, view_axes
from gyroid_cad.render.raster import NOTHING, nearest_triangles, slopes

__all__ = ["draw", "snug_size"]

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

# Of the picture's smaller side, left free on all sides.
_MARGIN = 0.02
# Each pixel is the mean of so many samples squared.
_FINER = 3
# PNG files of colours in steps too small to be seen are a third smaller; 255 is a multiple of it.
_COLOUR_STEP = 3
# Samples in one go, so that large pictures take no more memory than these: about 500 MB.
_AT_ONCE = 6_000_000
# Light from everywhere, from the sky, and from a lamp over the viewer's left shoulder (right, up, towards the viewer).
_AMBIENT, _SKY, _LAMP = 0.5, 0.18, 0.42
_DIRECTION = np.array([-0.45, 0.6, 0.66]) / np.linalg.norm([-0.45, 0.6, 0.66])
# How much darker a sample is on an outline or a sharp edge, beside it, and where two faces meet smoothly.
_EDGE, _BESIDE, _SMOOTH = 0.75, 0.4, 0.25
# Cosine of the angle between neighbouring triangles from which on an edge is sharp.
_SHARP = 0.82
# Of depth between neighbouring samples, above what their triangles' slopes explain, in samples.
_JUMP = 2.0
# In parts of the length of what is drawn: its width, at least.
_THINNEST = 1e-6
_NO_LENGTH = float(np.finfo(float).tiny)


def draw(facets: Facets, size: tuple[int, int] = SIZE, camera: Vector = CAMERA) -> Bytes:
    """Draw triangles, seen from afar, as large as the picture lets them be.

    Parameters
    ----------
    facets : Facets
    size : tuple of int
        Width and height in pixels.
    camera : tuple of float
        Direction to the viewer; z points up in the picture.

    Returns
    -------
    ndarray of uint8, shape (height, width, 4)
        Red, green, blue and opacity; what is behind the triangles shows through.

    Examples
    --------
    >>> from gyroid_cad.render.facets import facets_of_triangles
    >>> square = facets_of_triangles([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], closed=False)
    >>> image = draw(square, (100, 100), camera=(0, 0, 1))
    >>> image.shape, int((image[..., 3] == 255).sum())
    ((100, 100, 4), 9216)
    """
    width, height = (_FINER * length for length in size)
    scene = _scene(facets, view_axes(camera), width, height)
    rows = max(_AT_ONCE // (_FINER * width), 1)
    return np.concatenate([_band(scene, size, top, min(top + rows, size[1])) for top in range(0, size[1], rows)])


def snug_size(facets: Facets, camera: Vector, longest: int) -> tuple[int, int]:
    """Width and height of a picture that triangles just fill, in pixels.

    Parameters
    ----------
    facets : Facets
    camera : tuple of float
    longest : int
        The longer of the two.
    """
    extent = np.ptp((facets.corners @ view_axes(camera)[:2].T).reshape(-1, 2), axis=0)
    usable = longest * (1 - 2 * _MARGIN)
    shorter = usable * float(extent.min()) / (float(extent.max()) or 1.0)
    # The margin is a part of the shorter side.
    other = max(int(np.ceil(shorter / (1 - 2 * _MARGIN))), 1)
    return (longest, other) if extent[0] >= extent[1] else (other, longest)


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Triangles that may be seen.

    Attributes
    ----------
    corners : ndarray, shape (n, 3, 3)
        In samples: to the right, down, and towards the viewer.
    flat : ndarray, shape (n, 3)
        Unit normals towards the viewer.
    colours : ndarray, shape (n, 3, 3)
        At the corners, lit.
    faces : ndarray of int, shape (n,)
    """

    corners: Floats
    flat: Floats
    colours: Floats
    faces: Integers


def _scene(facets: Facets, axes: Floats, width: int, height: int) -> _Scene:
    seen = facets.corners @ axes.T
    flat = _unit(np.cross(seen[:, 1] - seen[:, 0], seen[:, 2] - seen[:, 0]))
    low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    usable = np.array([width, height]) - 2 * _MARGIN * min(width, height)
    # A line or a point fills nothing.
    least = _THINNEST * float(np.max(high - low)) or 1.0
    scale = float(np.min(usable / np.maximum(high - low, least)[:2]))
    # Nobody sees closed surfaces from behind.
    kept = flat[:, 2] > 0 if facets.closed else flat[:, 2] != 0
    flat, seen = flat[kept], seen[kept]
    # Others are lit on the side that is seen.
    turned = np.where(flat[:, 2] < 0, -1.0, 1.0)[:, np.newaxis]
    normals = _unit(facets.normals[kept] @ axes.T) * turned[:, np.newaxis]
    light = _AMBIENT + _SKY * (1 + normals[..., 1]) / 2 + _LAMP * np.maximum(dot(normals, _DIRECTION), 0)
    corners = (seen - (low + high) / 2) * (scale, -scale, scale) + (width / 2, height / 2, 0)
    return _Scene(corners, flat * turned, facets.colours[kept] * light[..., np.newaxis], facets.faces[kept])


def _band(scene: _Scene, size: tuple[int, int], top: int, bottom: int) -> Bytes:
    """Rows of pixels of a picture, from one to another."""
    width = _FINER * size[0]
    # With a pixel above and below, for the lines that come from there.
    height, above = _FINER * (bottom - top + 2), _FINER * (top - 1)
    scene = replace(scene, corners=scene.corners - (0, above, 0))
    seen = nearest_triangles(scene.corners, width, height)
    hit = np.flatnonzero(seen != NOTHING)
    row, column = np.divmod(hit, width)
    colours = slopes(scene.corners, scene.colours).at(seen[hit], column, row)
    fine = np.zeros((width * height, 4), dtype=np.float32)
    fine[hit, :3] = np.clip(colours, 0, 1) * (1 - _ink(scene, seen, hit, width)[hit])[:, np.newaxis]
    fine[hit, 3] = 1
    # Whole rows first, which is quickest.
    rows = fine.reshape(-1, _FINER, 4 * width).sum(axis=1)
    mean = rows[1:-1].reshape(-1, size[0], _FINER, 4).sum(axis=2) / _FINER**2
    # PNG's colours are not multiplied by their opacity.
    mean[..., :3] /= np.maximum(mean[..., 3:], 1 / _FINER**2)
    return np.asarray(np.round(mean * (255 // _COLOUR_STEP)) * _COLOUR_STEP, dtype=np.uint8)


def _ink(scene: _Scene, seen: Integers, hit: Integers, width: int) -> Singles:
    """Darkness of each sample for the lines it lies on, from 0 to 1."""
    depth = slopes(scene.corners, scene.corners[..., 2])
    place = np.zeros(len(seen), dtype=np.float32)
    place[hit] = depth.at(seen[hit], *np.divmod(hit, width)[::-1])
    sharp, smooth = np.zeros((2, len(seen)), dtype=bool)
    for step, slope in ((1, depth.along_x), (width, depth.along_y)):
        here = np.flatnonzero(seen[:-step] != seen[step:])
        if step == 1:
            here = here[(here + 1) % width != 0]
        there = here + step
        outline = (seen[here] == NOTHING) | (seen[there] == NOTHING)
        one, other = seen[here], seen[there]
        change = place[there] - place[here]
        unexplained = np.minimum(np.abs(change - slope[one]), np.abs(change - slope[other]))
        # Where a curved surface turns away from the viewer its triangles' slopes differ much.
        jump = unexplained > _JUMP + np.minimum(np.abs(slope[one]), np.abs(slope[other]))
        turn = dot(scene.flat[one], scene.flat[other]) < _SHARP
        meeting = scene.faces[one] != scene.faces[other]
        for lines, kind in ((outline | jump | turn, sharp), (meeting, smooth)):
            kind[here[lines]] = True
            kind[there[lines]] = True
    beside = sharp.copy()
    for step in (1, width):
        beside[step:] |= sharp[:-step]
        beside[:-step] |= sharp[step:]
    return np.select([sharp, beside, smooth], [_EDGE, _BESIDE, _SMOOTH], 0.0).astype(np.float32)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _NO_LENGTH))

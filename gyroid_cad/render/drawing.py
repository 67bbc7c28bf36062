"""Pictures of triangles: soft light, fine lines where faces meet, dark ones along edges and outlines.

Orthographic, and all in numpy: no display, driver, viewer or kernel is needed. Edges are found in the picture itself,
where neighbouring samples see different things (T. Saito and T. Takahashi, *Comprehensible rendering of 3-D shapes*,
1990).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.render.facets import Facets
from gyroid_cad.render.picture import CAMERA, SIZE, Vector, view_axes
from gyroid_cad.render.raster import NOTHING, nearest_triangles, slopes

__all__ = ["bounds", "draw", "projection", "snug_size"]

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
# Samples, and triangles, in one go: neither large pictures nor many triangles take more memory than about 1 GB.
_SAMPLES, _TRIANGLES = 8_000_000, 500_000
# Light on what is turned away from the lamp, and how much more on what faces it; the lamp hangs over the viewer's left
# shoulder (right, up, towards the viewer).
_SHADE, _LAMP = 0.5, 0.62
_DIRECTION = np.array([-0.45, 0.6, 0.66]) / np.linalg.norm([-0.45, 0.6, 0.66])
# How much darker a sample is on an outline or a sharp edge, beside it, and where two faces meet smoothly.
_EDGE, _BESIDE, _SMOOTH = 0.75, 0.4, 0.25
# Of depth between neighbouring samples, beyond what their triangles' slopes explain, in parts of the picture's width.
_JUMP = 0.01
# In parts of the length of what is drawn: its width, at least.
_THINNEST = 1e-6
_NO_LENGTH = float(np.finfo(float).tiny)


def draw(pieces: Sequence[Facets], size: tuple[int, int] = SIZE, camera: Vector = CAMERA) -> Bytes:
    """Draw triangles, seen from afar, as large as the picture lets them be.

    Parameters
    ----------
    pieces : sequence of Facets
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
    >>> image = draw([square], (100, 100), camera=(0, 0, 1))
    >>> image.shape, int((image[..., 3] == 255).sum())
    ((100, 100, 4), 9216)
    """
    matrix, offset = projection(pieces, size, camera)
    width = _FINER * size[0]
    # Samples, to the right, down, and towards the viewer.
    matrix, offset = _FINER * matrix, _FINER * offset
    rows = max(_SAMPLES // (_FINER * width), 1)
    bands = []
    for top in range(0, size[1], rows):
        bottom = min(top + rows, size[1])
        # With a pixel above and below, for the lines that come from there.
        above, height = _FINER * (top - 1), _FINER * (bottom - top + 2)
        scene, seen = _visible(pieces, matrix, offset - (0, above, 0), width, height)
        bands.append(_pixels(scene, seen, width, view_axes(camera))[1:-1])
    return np.concatenate(bands)


def snug_size(pieces: Sequence[Facets], camera: Vector, longest: int) -> tuple[int, int]:
    """Width and height of a picture that triangles just fill, in pixels.

    Parameters
    ----------
    pieces : sequence of Facets
    camera : tuple of float
    longest : int
        The longer of the two.
    """
    low, high = bounds(pieces, view_axes(camera))
    extent = (high - low)[:2]
    usable = longest * (1 - 2 * _MARGIN)
    shorter = usable * float(extent.min()) / (float(extent.max()) or 1.0)
    # The margin is a part of the shorter side.
    other = max(int(np.ceil(shorter / (1 - 2 * _MARGIN))), 1)
    return (longest, other) if extent[0] >= extent[1] else (other, longest)


def projection(pieces: Sequence[Facets], size: tuple[int, int], camera: Vector) -> tuple[Floats, Floats]:
    """Matrix and offset that take points to pixels, as :func:`draw` does: to the right, down, and towards the viewer.

    Parameters
    ----------
    pieces : sequence of Facets
        They fill the picture, but for a margin.
    size : tuple of int
    camera : tuple of float

    Returns
    -------
    matrix : ndarray, shape (3, 3)
    offset : ndarray, shape (3,)
    """
    axes, pixels = view_axes(camera), np.array(size)
    low, high = bounds(pieces, axes)
    usable = pixels - 2 * _MARGIN * pixels.min()
    # A line or a point fills nothing.
    least = _THINNEST * float(np.max(high - low)) or 1.0
    scale = float(np.min(usable / np.maximum(high - low, least)[:2])) * np.array([1, -1, 1])
    return axes * scale[:, np.newaxis], np.array([*pixels / 2, 0]) - (low + high) / 2 * scale


def bounds(pieces: Sequence[Facets], axes: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest coordinates along some axes, rows of a matrix."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for piece in pieces:
        points = piece.corners.reshape(-1, 3)
        for place in piece.places:
            along = points @ (axes @ place[:, :3]).T + axes @ place[:, 3]
            low, high = np.minimum(low, along.min(axis=0)), np.maximum(high, along.max(axis=0))
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    """Triangles that may be seen.

    Attributes
    ----------
    corners : ndarray, shape (n, 3, 3)
        In samples: to the right, down, and towards the viewer.
    normals : ndarray, shape (n, 3, 3)
        At the corners, as they are in space, on the side that is seen.
    colours : ndarray, shape (n, 3, 3)
    faces, surfaces : ndarray of int, shape (n,)
        Apart for each place.
    """

    corners: Floats
    normals: Floats
    colours: Floats
    faces: Integers
    surfaces: Integers

    def some(self, which: Integers) -> _Scene:
        return _Scene(*(getattr(self, name)[which] for name in _PARTS))


_PARTS = tuple(field.name for field in fields(_Scene))


def _together(scenes: Sequence[_Scene]) -> _Scene:
    return _Scene(*(np.concatenate([getattr(scene, name) for scene in scenes]) for name in _PARTS))


def _visible(
    pieces: Sequence[Facets], matrix: Floats, offset: Floats, width: int, height: int
) -> tuple[_Scene, Integers]:
    """The triangles that are seen, and which of them at each sample.

    Of many only so many at a time are held besides those that were seen so far: memory goes with the picture.
    """
    kept: list[_Scene] = []
    seen = np.full(width * height, NOTHING)
    for some in _portions(pieces, matrix, offset, height):
        scene = _together([*kept, some])
        seen = nearest_triangles(scene.corners, width, height)
        hit = np.zeros(len(scene.faces) + 1, dtype=bool)
        hit[seen] = True
        # The last one, which NOTHING counts as, is no triangle.
        used = np.flatnonzero(hit[:-1])
        numbers = np.full(len(hit), NOTHING)
        numbers[used] = np.arange(len(used))
        kept, seen = [scene.some(used)], numbers[seen]
    return kept[0], seen


def _portions(pieces: Sequence[Facets], matrix: Floats, offset: Floats, height: int) -> Iterator[_Scene]:
    """Triangles in their places, so far as they may be seen, not too many at once."""
    taken = 0
    for piece in pieces:
        numbers = int(max(piece.faces.max(initial=0), piece.surfaces.max(initial=0))) + 1
        at_once = max(_TRIANGLES // max(len(piece.faces), 1), 1)
        for start in range(0, len(piece.places), at_once):
            parts = []
            for place in piece.places[start : start + at_once]:
                parts.append(_placed(piece, matrix @ place[:, :3], matrix @ place[:, 3] + offset, place, taken, height))
                taken += numbers
            yield _together(parts)


def _placed(piece: Facets, matrix: Floats, offset: Floats, place: Floats, first: int, height: int) -> _Scene:
    corners = piece.corners @ matrix.T + offset
    (x0, y0, _), (x1, y1, _), (x2, y2, _) = corners.transpose(1, 2, 0)
    # Down the picture is the other way round.
    turned = -np.sign((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
    # Nobody sees closed surfaces from behind.
    kept = turned > 0 if piece.closed else turned != 0
    kept &= (corners[..., 1].max(axis=1) > 0) & (corners[..., 1].min(axis=1) < height)
    return _Scene(
        corners[kept],
        # Others are lit on the side that is seen.
        piece.normals[kept] @ place[:, :3].T * turned[kept, np.newaxis, np.newaxis],
        piece.colours[kept],
        piece.faces[kept] + first,
        piece.surfaces[kept] + first,
    )


def _pixels(scene: _Scene, seen: Integers, width: int, axes: Floats) -> Bytes:
    """Samples lit, lined, and averaged to pixels."""
    normals = _unit(scene.normals) @ axes.T
    # Round the whole sphere of normals, so that what is in the shade has its shape too.
    light = _SHADE + _LAMP * (1 + dot(normals, _DIRECTION)) / 2
    lit = slopes(scene.corners, scene.colours * light[..., np.newaxis])
    hit = np.flatnonzero(seen != NOTHING)
    row, column = np.divmod(hit, width)
    fine = np.zeros((len(seen), 4), dtype=np.float32)
    ink = _ink(scene, seen, hit, width)[hit]
    fine[hit, :3] = np.clip(lit.at(seen[hit], column, row), 0, 1) * (1 - ink)[:, np.newaxis]
    fine[hit, 3] = 1
    # Whole rows first, which is quickest.
    rows = fine.reshape(-1, _FINER, 4 * width).sum(axis=1)
    mean = rows.reshape(len(rows), -1, _FINER, 4).sum(axis=2) / _FINER**2
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
        low, high = np.minimum(slope[one], slope[other]), np.maximum(slope[one], slope[other])
        # One curved surface falls by something between its slopes here and there.
        jump = np.maximum(low - change, change - high) > _JUMP * width + np.minimum(np.abs(low), np.abs(high)) / 2
        sharp_edge = scene.surfaces[one] != scene.surfaces[other]
        meeting = scene.faces[one] != scene.faces[other]
        for lines, kind in ((outline | jump | sharp_edge, sharp), (meeting, smooth)):
            kind[here[lines]] = True
            kind[there[lines]] = True
    beside = sharp.copy()
    for step in (1, width):
        beside[step:] |= sharp[:-step]
        beside[:-step] |= sharp[step:]
    return np.select([sharp, beside, smooth], [_EDGE, _BESIDE, _SMOOTH], 0.0).astype(np.float32)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), _NO_LENGTH))

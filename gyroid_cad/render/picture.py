"""Triangles as a picture: a z-buffer in numpy and a PNG file by hand, so that no display, driver or viewer is needed.

Orthographic; the pixels a triangle covers are found by its edge functions (J. Pineda, *A parallel algorithm for polygon
rasterization*, 1988), those nearest to the viewer win, and only they are shaded.
"""

from __future__ import annotations

import struct
import zlib
from base64 import b64encode
from collections.abc import Iterator
from operator import index

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import three_numbers
from gyroid_cad.errors import ParameterError

__all__ = ["CAMERA", "MOST_DRAWN_PATCHES", "SIZE", "data_uri", "draw", "png", "require_view", "view_axes"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Vector = tuple[float, float, float]

# Towards the viewer; as the project's other pictures are seen.
CAMERA: Vector = (3.0, -4.0, 2.4)
# Width and height in pixels.
SIZE = (480, 420)
# Of more it would show nothing but grey, after many seconds.
MOST_DRAWN_PATCHES = 48_000
_SMALLEST, _LARGEST = 16, 4096

_COLOUR = np.array([0.87, 0.68, 0.32])
# Of the picture's smaller side, left free on all sides.
_MARGIN = 0.02
# Each pixel is the mean of so many squared.
_FINER = 2
# Pixels looked at in one go: what they take stays below 100 MB.
_AT_ONCE = 1_000_000
# Where a triangle is further turned from what its neighbours agree on, there is an edge to be seen; the cosine.
_CREASE = 0.9
# Light from above the viewer's left shoulder (right, up, towards the viewer), and what comes from everywhere.
_LIGHT = np.array([-0.35, 0.55, 0.76]) / np.linalg.norm([-0.35, 0.55, 0.76])
_AMBIENT = 0.38
# How much darker the furthest point is than the nearest, for depth.
_FADING = 0.4
_DEPTH_STEPS = 2**31
_NOTHING = np.iinfo(np.uint64).max
_PNG_SIGNATURE, _EIGHT_BITS, _RGBA = b"\x89PNG\r\n\x1a\n", 8, 6


def require_view(size: tuple[int, int], camera: Vector) -> tuple[tuple[int, int], Vector]:
    """Check what a picture is asked for: its size, in whole pixels, and from where it is seen.

    Raises
    ------
    ParameterError
    """
    try:
        width, height = map(index, size)
        usable = all(_SMALLEST <= length <= _LARGEST for length in (width, height))
    except (TypeError, ValueError):
        usable = False
    if not usable:
        raise ParameterError("size", size, f"width and height in pixels, {_SMALLEST} to {_LARGEST}")
    x, y, z = three_numbers("camera", camera).tolist()
    if x == y == z == 0:
        raise ParameterError("camera", camera, "a direction, not zero")
    return (width, height), (x, y, z)


def draw(
    vertices: NDArray[np.floating],
    triangles: NDArray[np.integer],
    size: tuple[int, int] = SIZE,
    camera: Vector = CAMERA,
) -> Bytes:
    """Draw triangles, seen from afar, as large as the picture lets them be.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Either way round.
    size : tuple of int
        Width and height in pixels.
    camera : tuple of float
        Direction to the viewer; z points up in the picture.

    Returns
    -------
    ndarray of uint8, shape (height, width, 4)
        Red, green, blue and opacity; what is behind the triangles shows through.
    """
    axes = view_axes(camera)
    seen = np.asarray(vertices, dtype=np.float64) @ axes.T
    width, height = (_FINER * length for length in size)
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = np.maximum(high - low, np.finfo(float).tiny)
    usable = np.array([width, height]) - 2 * _MARGIN * min(width, height)
    scale = float(np.min(usable / extent[:2]))
    middle = (low + high)[:2] / 2
    pixels = (seen[:, :2] - middle) * (scale, -scale) + (width / 2, height / 2)
    # From 0, nearest to the viewer, to 1.
    depth = (high[2] - seen[:, 2]) / extent[2]
    corners = np.concatenate([pixels, depth[:, np.newaxis]], axis=1)[triangles]
    planes = _planes(corners)
    nearest = np.full(width * height, _NOTHING, dtype=np.uint64)
    for which, pixel, behind in _covered(corners, planes, width, height):
        # Depth first, then the triangle's number: the least of them is the nearest.
        key = np.clip(behind * _DEPTH_STEPS, 0, _DEPTH_STEPS).astype(np.uint64) << np.uint64(32)
        np.minimum.at(nearest, pixel, key | which.astype(np.uint64))
    return _shaded(nearest, planes, _corner_normals(seen, triangles), width, height)


def view_axes(camera: Vector) -> Floats:
    """Unit vectors to the picture's right, up it and to the viewer, as rows."""
    towards = np.array(camera, dtype=float) / np.linalg.norm(camera)
    right = np.cross((0.0, 0.0, 1.0), towards)
    if np.linalg.norm(right) < 1e-9:
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def png(image: Bytes) -> bytes:
    """An image as a PNG file (W3C, Portable Network Graphics, 2nd edition), without interlacing.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width, 4)
    """
    height, width, _ = image.shape
    # Each row after a byte that names its filter: 1, differences to the pixel before.
    rows = np.empty((height, 1 + 4 * width), dtype=np.uint8)
    rows[:, 0] = 1
    before = np.concatenate([np.zeros_like(image[:, :1]), image[:, :-1]], axis=1)
    rows[:, 1:] = (image - before).reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, _EIGHT_BITS, _RGBA, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 9)), (b"IEND", b""))
    return _PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def data_uri(image: bytes) -> str:
    """A PNG file as an address that holds it (RFC 2397)."""
    return "data:image/png;base64," + b64encode(image).decode("ascii")


def _planes(corners: Floats) -> Floats:
    """Weights of the first two corners and depth, as linear functions of x, y and 1 in pixels; shape (3, 3, triangles).

    Of triangles that are seen from the side the weights are nowhere positive.
    """
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = corners.transpose(1, 2, 0)
    area = (x0 - x2) * (y1 - y2) - (x1 - x2) * (y0 - y2)
    edge_on = area == 0
    inverse = 1 / np.where(edge_on, 1.0, area)
    first = np.stack([(y1 - y2) * inverse, (x2 - x1) * inverse, (x1 * y2 - x2 * y1) * inverse])
    second = np.stack([(y2 - y0) * inverse, (x0 - x2) * inverse, (x2 * y0 - x0 * y2) * inverse])
    depth = (z0 - z2) * first + (z1 - z2) * second
    depth[2] += z2
    planes = np.stack([first, second, depth])
    planes[..., edge_on] = -1.0
    return planes


def _covered(corners: Floats, planes: Floats, width: int, height: int) -> Iterator[tuple[Integers, Integers, Floats]]:
    """Pairs of a triangle and a pixel whose middle it covers, and its depth there, in portions."""
    limits = (width, height)
    first = np.clip(np.ceil(corners[..., :2].min(axis=1) - 0.5).astype(np.int64), 0, limits)
    last = np.clip(np.floor(corners[..., :2].max(axis=1) - 0.5).astype(np.int64) + 1, 0, limits)
    columns, rows = np.maximum(last - first, 0).T
    some = np.flatnonzero(columns * rows)
    counts = (columns * rows)[some]
    ends = np.cumsum(counts)
    start = 0
    while start < len(some):
        # At least one triangle, however large.
        done = ends[start - 1] if start else 0
        end = max(start + 1, int(np.searchsorted(ends, done + _AT_ONCE, side="right")))
        count = counts[start:end]
        which = np.repeat(some[start:end], count)
        place = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
        row, column = np.divmod(place, columns[which])
        row += first[which, 1]
        column += first[which, 0]
        a, b = (_at(planes[k], which, column, row) for k in range(2))
        inside = np.flatnonzero((a >= 0) & (b >= 0) & (a + b <= 1))
        which, column, row = which[inside], column[inside], row[inside]
        yield which, row * width + column, _at(planes[2], which, column, row)
        start = end


def _at(plane: Floats, which: Integers, column: Integers, row: Integers) -> Floats:
    """A linear function of some triangles at the middles of pixels."""
    return np.asarray(plane[0][which] * (column + 0.5) + plane[1][which] * (row + 0.5) + plane[2][which])


def _corner_normals(vertices: Floats, triangles: NDArray[np.integer]) -> Floats:
    """A normal for each corner of each triangle: the vertex's own, but on creases the triangle's; (triangles, 3, 3)."""
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    flat = np.cross(b - a, c - a)
    numbers = triangles.ravel()
    summed = [np.bincount(numbers, np.repeat(flat[:, axis], 3), minlength=len(vertices)) for axis in range(3)]
    flat, smooth = _unit(flat)[:, np.newaxis], _unit(np.stack(summed, axis=1))[triangles]
    creased = np.zeros(len(vertices), dtype=bool)
    creased[numbers[np.einsum("tkx,tkx->tk", smooth, np.broadcast_to(flat, smooth.shape)).ravel() < _CREASE]] = True
    return np.where(creased[triangles][..., np.newaxis], flat, smooth)


def _shaded(nearest: NDArray[np.uint64], planes: Floats, normals: Floats, width: int, height: int) -> Bytes:
    """Colour and opacity of each pixel, from the nearest triangle at each of the finer ones."""
    hit = np.flatnonzero(nearest != _NOTHING)
    which = (nearest[hit] & np.uint64(0xFFFFFFFF)).astype(np.int64)
    depth = (nearest[hit] >> np.uint64(32)).astype(float) / _DEPTH_STEPS
    row, column = np.divmod(hit, width)
    a, b = (_at(planes[k], which, column, row) for k in range(2))
    normal = _unit(np.einsum("kn,nkx->nx", np.stack([a, b, 1 - a - b]), normals[which]))
    # What is seen faces the viewer, whichever way round its corners run.
    normal *= np.where(normal[:, 2] < 0, -1.0, 1.0)[:, np.newaxis]
    light = (_AMBIENT + (1 - _AMBIENT) * np.clip(normal @ _LIGHT, 0, 1)) * (1 - _FADING * depth)
    fine = np.zeros((width * height, 4))
    fine[hit, :3] = light[:, np.newaxis] * _COLOUR
    fine[hit, 3] = 1
    mean = fine.reshape(height // _FINER, _FINER, width // _FINER, _FINER, 4).mean(axis=(1, 3))
    # PNG's colours are not multiplied by their opacity.
    mean[..., :3] /= np.maximum(mean[..., 3:], 1 / _FINER**2)
    return np.asarray(np.round(255 * mean), dtype=np.uint8)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny))

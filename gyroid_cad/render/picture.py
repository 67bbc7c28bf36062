"""A picture's size, where it is seen from, and its file: PNG, written by hand."""

from __future__ import annotations

import struct
import zlib
from base64 import b64encode
from operator import index

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import three_numbers
from gyroid_cad.errors import ParameterError

__all__ = ["CAMERA", "MOST_DRAWN_PATCHES", "SIZE", "VIEWS", "data_uri", "png", "require_view", "view_axes"]

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Vector = tuple[float, float, float]

# Towards the viewer.
CAMERA: Vector = (3.0, -4.0, 2.5)
# What a lattice is seen from, by name: one view from the corner, three from its sides.
VIEWS: dict[str, Vector] = {
    "from the corner": CAMERA,
    "from the front, along y": (0.0, -1.0, 0.0),
    "from the right, along x": (1.0, 0.0, 0.0),
    "from above, along z": (0.0, 0.0, 1.0),
}
# Width and height in pixels.
SIZE = (480, 420)
# Of more it would show nothing but grey, after many seconds.
MOST_DRAWN_PATCHES = 48_000
_SMALLEST, _LARGEST = 16, 4096

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
    # Each row after a byte that names its filter: none, for those that foresee pixels fail at every line.
    rows = np.zeros((height, 1 + 4 * width), dtype=np.uint8)
    rows[:, 1:] = image.reshape(height, -1)
    header = struct.pack(">IIBBBBB", width, height, _EIGHT_BITS, _RGBA, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b""))
    return _PNG_SIGNATURE + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )


def data_uri(image: bytes) -> str:
    """A PNG file as an address that holds it (RFC 2397)."""
    return "data:image/png;base64," + b64encode(image).decode("ascii")

"""A picture's view and its file."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.render.picture import MOST_DRAWN_PATCHES, png, require_view, view_axes

FROM_ABOVE = (0.0, 0.0, 1.0)


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (40, 60), (37, 53)])
def test_the_file_holds_the_picture_to_the_last_bit(size: tuple[int, int]) -> None:
    image = np.random.default_rng(3).integers(0, 256, (*size, 4), dtype=np.uint8)
    assert np.array_equal(np.asarray(Image.open(BytesIO(png(image)))), image)


def test_every_chunk_of_a_png_has_its_checksum() -> None:
    data = png(np.zeros((3, 5, 4), dtype=np.uint8))
    place, kinds = 8, []
    while place < len(data):
        (length,) = struct.unpack(">I", data[place : place + 4])
        body = data[place + 4 : place + 8 + length]
        assert struct.unpack(">I", data[place + 8 + length : place + 12 + length])[0] == zlib.crc32(body)
        kinds.append(body[:4])
        place += 12 + length
    assert kinds == [b"IHDR", b"IDAT", b"IEND"]


def test_axes_of_a_view_are_a_right_handed_frame_with_z_upwards() -> None:
    for camera in ((3.0, -4.0, 2.4), (1.0, 0.0, 0.0), FROM_ABOVE):
        axes = view_axes(camera)
        assert np.allclose(axes @ axes.T, np.eye(3))
        assert np.linalg.det(axes) == pytest.approx(1)
        assert axes[1, 2] >= 0


@pytest.mark.parametrize("size", [(10, 100), (100, 5000), (100.5, 100), (100,), "large", 100])
def test_a_size_that_is_no_pictures_is_refused(size: object) -> None:
    with pytest.raises(ParameterError, match=r"size = .*width and height in pixels, 16 to 4096"):
        require_view(size, FROM_ABOVE)  # type: ignore[arg-type]


@pytest.mark.parametrize("camera", [(0, 0, 0), (1, 2), ("a", "b", "c"), (np.nan, 0, 1)])
def test_a_camera_without_a_direction_is_refused(camera: object) -> None:
    with pytest.raises(ParameterError, match="camera"):
        require_view((100, 100), camera)  # type: ignore[arg-type]


def test_more_cells_than_a_picture_shows_are_refused_before_any_is_laid(monkeypatch: pytest.MonkeyPatch) -> None:
    most = MOST_DRAWN_PATCHES // 24
    monkeypatch.setattr(Lattice, "fitted", lambda self: pytest.fail("fitted"))
    with pytest.raises(ParameterError, match=f"at most {most} cells"):
        Lattice((most + 1, 1, 1), 10, 0.8).picture()

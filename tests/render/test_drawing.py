"""Pictures without a display: what covers what, how much of the picture, and files that others read."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.lattice import Lattice
from gyroid_cad.render.drawing import VIEWS, Facets, View, drawn
from gyroid_cad.render.facets import facets_of_triangles, facets_of_wall
from gyroid_cad.render.picture import png
from gyroid_cad.report.charts import histogram, ticks

ABOVE = View("above", (0, 0, 1), (0, 1, 0))
Bytes = NDArray[np.uint8]


def flat(corners: list[list[float]], colour: tuple[float, float, float]) -> Facets:
    triangle = np.array([corners], dtype=float)
    return Facets(triangle, np.tile([0.0, 0.0, 1.0], (1, 3, 1)), np.array([colour]), closed=False)


def both(first: Facets, second: Facets) -> Facets:
    parts = [np.concatenate([getattr(f, name) for f in (first, second)]) for name in ("corners", "normals", "colours")]
    return Facets(*parts, closed=False)


def ball(rings: int = 40) -> Facets:
    trimesh = pytest.importorskip("trimesh")
    made = trimesh.creation.uv_sphere(radius=2.0, count=[rings, 2 * rings])
    return facets_of_triangles(made.vertices, made.faces, closed=True)


def test_a_ball_covers_a_disc_from_everywhere() -> None:
    for view in VIEWS:
        picture = drawn(ball(), view, 200)
        # The disc's diameter is the picture less its margins.
        assert picture[..., 3].mean() / 255 == pytest.approx(np.pi / 4 * 0.94**2, rel=0.01)


def test_the_nearer_of_two_triangles_is_seen_whichever_comes_first() -> None:
    near = flat([[0, 0, 1], [4, 0, 1], [0, 4, 1]], (1.0, 0.0, 0.0))
    far = flat([[0, 0, 0], [4, 0, 0], [0, 4, 0]], (0.0, 0.0, 1.0))
    for facets in (both(near, far), both(far, near)):
        picture = drawn(facets, ABOVE, 60)
        seen = picture[picture[..., 3] == 255]
        assert (seen[:, 0] > 0).all()
        assert (seen[:, 2] == 0).all()


def test_a_closed_surface_looks_the_same_with_or_without_its_back() -> None:
    front = ball(16)
    whole = Facets(front.corners, front.normals, front.colours, closed=False)
    assert (drawn(front, VIEWS[0], 100) == drawn(whole, VIEWS[0], 100)).all()


def test_a_lattice_looks_the_same_with_or_without_the_backs_of_its_faces() -> None:
    front = facets_of_wall(Lattice((1, 1, 1), 10.0, 0.8).fitted().wall)
    whole = Facets(front.corners, front.normals, front.colours, closed=False)
    pictures = [drawn(facets, VIEWS[0], 150).astype(int) for facets in (front, whole)]
    # Along outlines and edges rounding may choose another triangle.
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8) < 0.005


def test_light_falls_from_the_upper_left() -> None:
    picture = drawn(ball(), VIEWS[1], 100)
    assert picture[25:35, 25:35, :3].mean() > picture[65:75, 65:75, :3].mean() + 30


@pytest.mark.parametrize("size", [(1, 1), (7, 3), (40, 60)])
def test_a_png_is_read_back_to_the_last_bit(size: tuple[int, int]) -> None:
    image = pytest.importorskip("PIL.Image")
    picture = np.random.default_rng(3).integers(0, 256, (*size, 4), dtype=np.uint8)
    assert (np.asarray(image.open(BytesIO(png(picture)))) == picture).all()


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


@given(low=st.floats(-1e6, 1e6), width=st.floats(1e-3, 1e6), most=st.integers(2, 9))
def test_ticks_are_evenly_spaced_round_numbers_within_their_range(low: float, width: float, most: int) -> None:
    found = ticks(low, low + width, most)
    assert 1 <= len(found) <= most
    slack = 1e-6 * width
    assert len(found) == 1 or (found[0] >= low - slack and found[-1] <= low + width + slack)
    if len(found) > 1:
        step = found[1] - found[0]
        mantissa = step / 10 ** np.floor(np.log10(step) + 1e-6)
        assert min(abs(mantissa - round_number) for round_number in (1, 2, 5)) < 1e-3


def test_bars_are_as_high_as_their_shares_and_names_are_escaped() -> None:
    from xml.etree import ElementTree

    svg = ElementTree.fromstring(histogram([0, 1, 2, 3], [0.5, 0.25, 0.25], "<b> & wall", [("<i>", 1.5)]))
    bars = [float(rect.get("height", "")) for rect in svg.iter("rect")]
    assert bars[0] == pytest.approx(2 * bars[1], rel=1e-3)
    assert bars[1] == bars[2]
    assert svg.get("aria-label") == "Histogram: <b> & wall"

"""Pictures: which pixels triangles cover, which of them is seen, and the file that comes of it."""

from __future__ import annotations

from io import BytesIO

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.render.picture import MOST_DRAWN_PATCHES, draw, png, require_view, view_axes
from gyroid_cad.surface.fit import FitSettings

FROM_ABOVE = (0.0, 0.0, 1.0)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
HALVES = np.array([[0, 1, 2], [0, 2, 3]])


def opacity(image: NDArray[np.uint8]) -> NDArray[np.float64]:
    return image[..., 3] / 255


def test_the_file_holds_the_picture_to_the_last_bit() -> None:
    image = np.random.default_rng(0).integers(0, 256, (37, 53, 4), dtype=np.uint8)
    assert np.array_equal(np.asarray(Image.open(BytesIO(png(image)))), image)


def test_two_triangles_of_a_square_cover_each_pixel_once_and_leave_the_margin_free() -> None:
    seen = opacity(draw(SQUARE, HALVES, (100, 100), FROM_ABOVE))
    assert np.array_equal(np.unique(seen), [0, 1])
    assert np.array_equal(np.flatnonzero(seen[50]), np.arange(2, 98))
    assert seen.sum() == 96**2


def test_a_ball_covers_its_circle_from_wherever_it_is_seen() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5)
    for camera in (FROM_ABOVE, (1.0, 0.0, 0.0), (3.0, -4.0, 2.4), (0.0, 0.0, -1.0)):
        seen = opacity(draw(ball.vertices, ball.faces, (200, 200), camera))
        assert seen.sum() == pytest.approx(np.pi * (0.96 * 100) ** 2, rel=2e-3)


def test_a_ball_is_brightest_towards_the_light_and_the_same_on_all_sides() -> None:
    ball = trimesh.creation.icosphere(subdivisions=5)
    views = [draw(ball.vertices, ball.faces, (120, 120), camera).astype(int) for camera in ((1, 0, 0.2), (-2, 3, 1))]
    assert np.median(np.abs(views[0] - views[1])) <= 1
    brightness = views[0][..., :3].sum(axis=-1)
    row, column = np.unravel_index(np.argmax(brightness), brightness.shape)
    assert row < 60
    assert column < 60


def test_what_lies_in_front_hides_what_lies_behind_whatever_comes_first() -> None:
    # Behind: a large square. In front: a small one, tilted towards the light.
    tilted = SQUARE * 0.5 + (0.25, 0.25, 1)
    tilted[1:3, 2] += 0.4
    vertices = np.concatenate([SQUARE, tilted])
    front_last = draw(vertices, np.concatenate([HALVES, HALVES + 4]), (100, 100), FROM_ABOVE)
    front_first = draw(vertices, np.concatenate([HALVES + 4, HALVES]), (100, 100), FROM_ABOVE)
    assert np.array_equal(front_last, front_first)
    middle, border = front_last[50, 50].astype(int), front_last[50, 10].astype(int)
    assert np.all(middle[:3] > border[:3] + 10)


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_order_and_the_way_round_of_triangles_change_nothing(seed: int) -> None:
    random = np.random.default_rng(seed)
    corners = random.uniform(-1, 1, (60, 3))
    triangles = np.arange(60).reshape(20, 3)
    image = draw(corners, triangles, (64, 48))
    other = triangles[random.permutation(20)]
    other[::2] = other[::2, [0, 2, 1]]
    difference = np.abs(draw(corners, other, (64, 48)).astype(int) - image)
    # Where a corner's weight is zero but for rounding a pixel may go either way.
    assert np.mean(difference > 2) < 2e-3


def distance(places: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of places in the plane, shape (n, 2), from the nearest of some segments."""
    along, away = end - start, places[:, np.newaxis] - start
    part = np.clip(np.sum(away * along, axis=-1) / np.sum(along * along, axis=-1), 0, 1)
    return np.asarray(np.linalg.norm(away - part[..., np.newaxis] * along, axis=-1).min(axis=1))


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_through_a_pixel_hits_something_just_where_the_picture_is_opaque(seed: int) -> None:
    corners = np.random.default_rng(seed).uniform(-1, 1, (15, 3))
    triangles = np.arange(15).reshape(5, 3)
    seen = opacity(draw(corners, triangles, (40, 40), FROM_ABOVE))
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = 40 * 0.96 / (high - low)[:2].max()
    sure = np.argwhere((seen == 0) | (seen == 1))
    places = (np.stack([sure[:, 1] + 0.5, 39.5 - sure[:, 0]], axis=1) - 20) / scale + (low + high)[:2] / 2
    a, b, c = np.moveaxis(corners[triangles][:, :, :2], 1, 0)

    def side(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
        return (q - p)[:, 0, np.newaxis] * (places[:, 1] - p[:, 1:]) - (q - p)[:, 1, np.newaxis] * (
            places[:, 0] - p[:, :1]
        )

    sides = np.sign([side(a, b), side(b, c), side(c, a)])
    hit = np.any(np.abs(sides.sum(axis=0)) == 3, axis=0)
    # Wherever no triangle's border comes within a pixel.
    clear = np.min([distance(places, p, q) for p, q in ((a, b), (b, c), (c, a))], axis=0) > 1 / scale
    assert np.sum(clear) > 100
    assert np.array_equal(hit[clear], seen[tuple(sure[clear].T)] == 1)


def test_a_lattice_covers_as_much_as_its_shadow() -> None:
    lattice = Lattice((2, 1, 1), 10, 0.8, fit=FitSettings(5))
    vertices, triangles = indexed_triangles(lattice.triangles(0.05).triangulation)
    solid = manifold3d.Manifold(manifold3d.Mesh(vertices, triangles.astype(np.uint32)))
    with Image.open(BytesIO(lattice.picture((300, 200), FROM_ABOVE))) as image:
        seen = opacity(np.asarray(image))
    low, high = lattice.bounding_box()
    scale = min((300 - 8) / (high[0] - low[0]), (200 - 8) / (high[1] - low[1]))
    assert seen.sum() == pytest.approx(solid.project().area() * scale**2, rel=5e-3)


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
    monkeypatch.setattr(Lattice, "laid", lambda self: pytest.fail("laid"))
    with pytest.raises(ParameterError, match=f"at most {most} cells"):
        Lattice((most + 1, 1, 1), 10, 0.8).picture()

"""Drawing: which pixels triangles cover, which of them is seen, in what light, and where there are lines."""

from __future__ import annotations

from io import BytesIO

import build123d as bd
import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.render.drawing import draw, snug_size
from gyroid_cad.render.facets import COLOURS, Facets, facets_of_shape, facets_of_triangles, facets_of_wall
from gyroid_cad.render.picture import VIEWS
from gyroid_cad.surface.fit import FitSettings

FROM_ABOVE = (0.0, 0.0, 1.0)
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=float)
HALVES = np.array([[0, 1, 2], [0, 2, 3]])
RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)

Bytes = NDArray[np.uint8]


def opacity(image: Bytes) -> NDArray[np.float64]:
    return image[..., 3] / 255


def square(colour: tuple[float, float, float] = COLOURS[0], height: float = 0.0, size: float = 1.0) -> Facets:
    vertices = SQUARE * size + ((1 - size) / 2, (1 - size) / 2, height)
    return facets_of_triangles(vertices, HALVES, closed=False, colours=colour)


def ball(subdivisions: int = 5) -> Facets:
    made = trimesh.creation.icosphere(subdivisions=subdivisions)
    return facets_of_triangles(made.vertices, made.faces, closed=True)


def seen_from_both_sides(facets: Facets) -> Facets:
    return Facets(facets.corners, facets.normals, facets.colours, facets.faces, closed=False)


def brightness(image: Bytes) -> NDArray[np.int64]:
    return image[..., :3].astype(np.int64).sum(axis=-1)


# What is covered.


def test_two_triangles_of_a_square_cover_each_pixel_once_and_leave_the_margin_free() -> None:
    seen = opacity(draw([square()], (100, 100), FROM_ABOVE))
    assert np.array_equal(np.unique(seen), [0, 1])
    assert np.array_equal(np.flatnonzero(seen[50]), np.arange(2, 98))
    assert seen.sum() == 96**2


def test_a_ball_covers_its_circle_from_wherever_it_is_seen() -> None:
    for camera in (*VIEWS.values(), (0.0, 0.0, -1.0)):
        seen = opacity(draw([ball()], (200, 200), camera))
        assert seen.sum() == pytest.approx(np.pi * (0.96 * 100) ** 2, rel=2e-3)


def test_a_lattice_covers_as_much_as_its_shadow() -> None:
    lattice = Lattice((2, 1, 1), 10, 0.8, fit=FitSettings(5))
    vertices, triangles = indexed_triangles(lattice.triangles(0.05).triangulation)
    solid = manifold3d.Manifold(manifold3d.Mesh(vertices, triangles.astype(np.uint32)))
    with Image.open(BytesIO(lattice.picture((300, 200), FROM_ABOVE))) as image:
        seen = opacity(np.asarray(image))
    low, high = lattice.bounding_box()
    scale = min((300 - 8) / (high[0] - low[0]), (200 - 8) / (high[1] - low[1]))
    assert seen.sum() == pytest.approx(solid.project().area() * scale**2, rel=5e-3)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_a_ray_through_a_pixel_hits_something_just_where_the_picture_is_opaque(seed: int) -> None:
    corners = np.random.default_rng(seed).uniform(-1, 1, (15, 3))
    triangles = np.arange(15).reshape(5, 3)
    seen = opacity(draw([facets_of_triangles(corners, triangles, closed=False)], (40, 40), FROM_ABOVE))
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


def distance(places: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Of places in the plane, shape (n, 2), from the nearest of some segments."""
    along, away = end - start, places[:, np.newaxis] - start
    part = np.clip(np.sum(away * along, axis=-1) / np.sum(along * along, axis=-1), 0, 1)
    return np.asarray(np.linalg.norm(away - part[..., np.newaxis] * along, axis=-1).min(axis=1))


@pytest.mark.parametrize(("camera", "shape"), [(FROM_ABOVE, (100, 200)), ((1.0, 0.0, 0.0), (200, 100))])
def test_a_snug_picture_has_the_proportions_of_what_it_shows(
    camera: tuple[float, float, float], shape: tuple[int, int]
) -> None:
    box = trimesh.creation.box((200.0, 98.0, 196.0))
    facets = facets_of_triangles(box.vertices, box.faces, closed=True)
    width, height = snug_size([facets], camera, 200)
    assert (height, width) == pytest.approx(shape, abs=5)
    seen = opacity(draw([facets], (width, height), camera))
    assert seen.sum() == pytest.approx(0.96**2 * width * height, rel=0.03)


def test_a_picture_so_large_that_it_is_drawn_in_parts_has_no_seams() -> None:
    image = draw([square()], (4096, 300), FROM_ABOVE)
    inside = image[10:-10, 2048]
    assert np.array_equal(inside, np.broadcast_to(inside[0], inside.shape))


def test_a_sheet_seen_edge_on_is_not_seen() -> None:
    assert not draw([square()], (50, 40), (0.0, -1.0, 0.0)).any()


# What hides what.


def test_the_nearer_of_two_is_seen_whichever_comes_first() -> None:
    near, far = square(RED, height=1.0, size=0.5), square(BLUE)
    pictures = [draw(parts, (60, 60), FROM_ABOVE) for parts in ((near, far), (far, near))]
    assert np.array_equal(*pictures)
    (red, _, blue, _), border = pictures[0][30, 30], pictures[0][30, 8]
    assert (red > 100, blue) == (True, 0)
    assert (border[0], border[2] > 100) == (0, True)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_order_and_the_way_round_of_triangles_change_nothing(seed: int) -> None:
    random = np.random.default_rng(seed)
    corners = random.uniform(-1, 1, (60, 3))
    triangles = np.arange(60).reshape(20, 3)
    other = triangles[random.permutation(20)]
    other[::2] = other[::2, [0, 2, 1]]
    one, two = (
        draw([facets_of_triangles(corners, some, closed=False)], (64, 48)).astype(int) for some in (triangles, other)
    )
    # Where a sample's middle is on a side but for rounding it may go either way.
    assert np.mean(np.abs(one - two) > 5) < 4e-3


def test_a_closed_surface_looks_the_same_with_or_without_its_back() -> None:
    front = ball(3)
    assert np.array_equal(draw([front], (100, 100)), draw([seen_from_both_sides(front)], (100, 100)))


def test_a_lattice_looks_the_same_with_or_without_the_backs_of_its_faces() -> None:
    front = facets_of_wall(Lattice((1, 1, 1), 10.0, 0.8).fitted().wall)
    pictures = [draw([facets], (150, 150)).astype(int) for facets in (front, seen_from_both_sides(front))]
    # Along outlines and edges rounding may choose another triangle.
    assert np.mean(np.abs(pictures[0] - pictures[1]).max(axis=-1) > 8) < 0.01


# Light.


def test_a_ball_is_brightest_towards_the_light_and_the_same_on_all_sides() -> None:
    views = [draw([ball()], (120, 120), camera).astype(int) for camera in ((1, 0, 0.2), (-2, 3, 1))]
    assert np.median(np.abs(views[0] - views[1])) <= 3
    row, column = np.unravel_index(np.argmax(brightness(views[0].astype(np.uint8))), (120, 120))
    assert row < 60
    assert column < 60


def test_no_face_is_black_from_any_side() -> None:
    for camera in ((0.0, 0.0, 1.0), (0.3, 0.2, -1.0), (1.0, 1.0, 0.5)):
        image = draw([ball()], (120, 120), camera)
        inside = brightness(image)[30:90, 30:90]
        assert inside.min() > 0.5 * inside.max()


# Colours and lines.


def shares(image: Bytes) -> list[float]:
    """How much of what is covered has the hue of face B, of face A, and of the rest."""
    seen = image[image[..., 3] == 255][:, :3].astype(float)
    seen /= np.linalg.norm(seen, axis=1, keepdims=True)
    hues = np.array(COLOURS) / np.linalg.norm(COLOURS, axis=1, keepdims=True)
    nearest = np.argmax(seen @ hues.T, axis=1)
    return [float(np.mean(nearest == k)) for k in range(3)]


def test_both_sides_of_a_wall_have_their_colours_whether_the_kernel_made_the_solid_or_not() -> None:
    lattice = Lattice((2, 2, 2), 10, 0.8, fit=FitSettings(5))
    wall = shares(draw([facets_of_wall(lattice.fitted().wall)], (200, 200)))
    solid = shares(draw([facets_of_shape(lattice.solid())], (200, 200)))
    assert min(wall) > 0.1
    assert solid == pytest.approx(wall, abs=0.02)


def test_faces_that_cut_a_lattice_or_are_no_lattices_have_the_third_colour() -> None:
    block = shares(
        draw([facets_of_shape(Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(5), trim="box").solid())], (200, 200))
    )
    assert min(block) > 0.1
    box = shares(draw([facets_of_shape(bd.Box(1, 2, 3).wrapped)], (100, 100)))
    assert box == [0, 0, 1]


def test_a_line_is_dark_along_edges_and_outlines_and_fine_where_faces_meet_smoothly() -> None:
    folded = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 1], [2, 1, 1]], dtype=float)
    triangles = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    sharp = draw([facets_of_triangles(folded, triangles, closed=False)], (200, 104), FROM_ABOVE)
    flat = folded * (1, 1, 0)
    one_face, two_faces = (
        draw([facets_of_triangles(flat, triangles, closed=False, faces=np.array(faces))], (200, 104), FROM_ABOVE)
        for faces in ([0, 0, 0, 0], [0, 0, 1, 1])
    )
    middle = slice(98, 102)
    row = [brightness(image)[52] for image in (one_face, two_faces, sharp)]
    plain = int(row[0][100])
    assert np.ptp(row[0][middle]) == 0
    assert 0.7 * plain < row[1][middle].min() < 0.95 * plain
    assert row[2][middle].min() < 0.7 * plain
    # The picture's first covered column is an outline.
    assert all(values[np.flatnonzero(values)[0]] < 0.75 * plain for values in row)


def test_smooth_triangles_show_no_facets_and_a_box_no_rounding() -> None:
    coarse, fine = (draw([ball(subdivisions)], (200, 200)) for subdivisions in (2, 5))
    inside = np.s_[50:150, 50:150]
    assert np.abs(brightness(coarse)[inside] - brightness(fine)[inside]).mean() < 8
    box = trimesh.creation.box((1, 1, 1))
    image = draw([facets_of_triangles(box.vertices, box.faces, closed=True)], (100, 100), FROM_ABOVE)
    assert np.ptp(brightness(image)[10:-10, 10:-10]) == 0

"""The semi-fundamental patch: its symmetry, its smoothness and its two parameterisations."""

from __future__ import annotations

from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.polynomial import chebyshev, legendre
from numpy.typing import NDArray
from scipy.optimize import root

from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.patch import (
    EDGE_HALF_TURN,
    PARAMETERISATIONS,
    ROTOINVERSION,
    edge_half_turn_shift,
    exact_edge,
    parameter_corners,
    polar,
    smooth,
)
from gyroid_cad.surface.symmetry import QUARTER

TUBE = USUAL.tube

Floats = NDArray[np.float64]

PATCHES_PER_CELL = 24
# Bounding-cell lengths to cell sizes: L = 2 a.
AREAS_PER_CELL_SIZE_SQUARED = 1 / 4
SQUARE = st.floats(-1, 1)


class Sampled:
    """The smooth patch on a Gauss-Legendre grid, differentiated spectrally: independent of its own tangents."""

    def __init__(self, count: int) -> None:
        nodes, weights = legendre.leggauss(count)
        derivatives = np.stack([legendre.legval(nodes, legendre.legder(c)) for c in np.eye(count)], axis=1)
        differentiate = derivatives @ np.linalg.inv(legendre.legvander(nodes, count - 1))
        self.points, self.normals = smooth(nodes[:, np.newaxis], nodes)
        self.points_u, self.normals_u = (
            np.einsum("ij,jkc->ikc", differentiate, f) for f in (self.points, self.normals)
        )
        self.points_v, self.normals_v = (
            np.einsum("kj,ijc->ikc", differentiate, f) for f in (self.points, self.normals)
        )
        self.weights = np.outer(weights, weights)

    @property
    def area_vectors(self) -> Floats:
        return np.cross(self.points_u, self.points_v)


@pytest.fixture(scope="module")
def sampled() -> Sampled:
    return Sampled(32)


@pytest.mark.parametrize("name", PARAMETERISATIONS)
def test_corners_lie_on_the_grid_of_quarters(name: str) -> None:
    points, _ = PARAMETERISATIONS[name](*parameter_corners().T)
    np.testing.assert_allclose(
        points, USUAL.patch.corner_array * QUARTER, rtol=0, atol=1e-7 if name == "polar" else 1e-15
    )


@pytest.mark.parametrize("name", PARAMETERISATIONS)
@settings(max_examples=40, deadline=None)
@given(u=SQUARE, v=SQUARE)
def test_a_quarter_turn_of_the_square_is_the_rotoinversion_of_the_patch(name: str, u: float, v: float) -> None:
    (here, turned), (normal, turned_normal) = PARAMETERISATIONS[name]([u, -v], [v, u])
    # The polar one magnifies rounding at the corners, as a square root does.
    np.testing.assert_allclose(turned, ROTOINVERSION @ here, rtol=0, atol=5e-8 if name == "polar" else 1e-13)
    np.testing.assert_allclose(turned_normal, -ROTOINVERSION @ normal, rtol=0, atol=1e-12)


def test_the_half_turn_is_one_about_the_normal_at_the_middle_of_edge_3() -> None:
    middle, normal = smooth(-1, 0)
    np.testing.assert_array_equal(EDGE_HALF_TURN @ EDGE_HALF_TURN, np.eye(3))
    assert np.trace(EDGE_HALF_TURN) == -1
    np.testing.assert_allclose(EDGE_HALF_TURN @ normal, normal, rtol=0, atol=1e-15)
    np.testing.assert_allclose(EDGE_HALF_TURN @ middle + edge_half_turn_shift(), middle, rtol=0, atol=1e-15)


@settings(max_examples=50, deadline=None)
@given(SQUARE)
def test_the_half_turn_reverses_edge_3(along: float) -> None:
    there, back = exact_edge([along, -along])
    np.testing.assert_allclose(EDGE_HALF_TURN @ there + edge_half_turn_shift(), back, rtol=0, atol=1e-14)


@settings(max_examples=50, deadline=None)
@given(SQUARE)
def test_the_neighbour_goes_on_with_the_same_normals(along: float) -> None:
    _, (there, back) = smooth(-1, [along, -along])
    np.testing.assert_allclose(EDGE_HALF_TURN @ there, back, rtol=0, atol=1e-13)


@settings(max_examples=50, deadline=None)
@given(SQUARE)
def test_the_border_of_the_smooth_patch_is_the_exact_edge_turned_round(along: float) -> None:
    sides = {3: (-1, -along), 0: (along, -1), 1: (1, along), 2: (-along, 1)}
    start, end = exact_edge([-1.0, 1.0])
    places = []
    for turns, k in enumerate((3, 0, 1, 2)):
        point = smooth(*sides[k])[0] @ np.linalg.matrix_power(ROTOINVERSION, turns)
        places.append(2 * (point - start) @ (end - start) / ((end - start) @ (end - start)) - 1)
        np.testing.assert_allclose(point, exact_edge(places[-1]), rtol=0, atol=1e-13)
    np.testing.assert_allclose(places, places[0], rtol=0, atol=1e-13)


def test_places_on_the_border_are_the_same_run_backwards_and_keep_their_order() -> None:
    along = np.linspace(-1, 1, 41)
    start, end = exact_edge([-1.0, 1.0])
    places = 2 * (smooth(-1, -along)[0] - start) @ (end - start) / ((end - start) @ (end - start)) - 1
    np.testing.assert_allclose(places, -places[::-1], rtol=0, atol=1e-13)
    assert np.diff(places).min() > 0.9 * (along[1] - along[0])


def test_edge_3_is_parameterised_by_the_coordinate_along_its_chord() -> None:
    along = np.linspace(-1, 1, 21)
    start, end = exact_edge([-1.0, 1.0])
    chord = end - start
    np.testing.assert_allclose((exact_edge(along) - start) @ chord / (chord @ chord), (1 + along) / 2, atol=1e-14)


def test_both_parameterisations_have_the_same_edges() -> None:
    start, end = exact_edge([-1.0, 1.0])
    on_arc, _ = polar(-1, np.linspace(-0.99, 0.99, 23))
    along = 2 * (on_arc - start) @ (end - start) / ((end - start) @ (end - start)) - 1
    np.testing.assert_allclose(exact_edge(along), on_arc, rtol=0, atol=1e-13)


@pytest.mark.parametrize(("u", "v"), [(0, 0), (0.5, 0.1), (-0.9, 0.2), (0.3, 0.8), (-0.7, -0.7), (0.95, -0.9)])
def test_both_parameterisations_lie_on_one_surface(u: float, v: float) -> None:
    point, normal = polar(u, v)

    def apart_in_the_view(uv: Floats) -> Floats:
        return np.asarray(smooth(uv[0], uv[1])[0][:2] - point[:2])

    below = root(apart_in_the_view, [u, v], tol=1e-14).x
    on_smooth, smooth_normal = smooth(below[0], below[1])
    np.testing.assert_allclose(on_smooth, point, rtol=0, atol=1e-12)
    np.testing.assert_allclose(smooth_normal, normal, rtol=0, atol=1e-11)


def test_the_patch_is_a_graph_over_its_view_along_the_axis(sampled: Sampled) -> None:
    assert np.all(sampled.area_vectors[..., 2] < 0) or np.all(sampled.area_vectors[..., 2] > 0)
    # The normal tips most at the corners, where it lies along a diagonal of the cube.
    assert np.min(np.abs(sampled.normals[..., 2])) > 1 / sqrt(3)


def test_normals_at_the_corners_lie_along_diagonals_of_the_cube() -> None:
    _, normals = smooth(*parameter_corners().T)
    np.testing.assert_allclose(np.abs(normals), 1 / sqrt(3), rtol=0, atol=1e-15)


def test_normals_are_those_of_the_points_on_the_side_of_du_x_dv(sampled: Sampled) -> None:
    lengths = np.linalg.norm(sampled.area_vectors, axis=-1, keepdims=True)
    np.testing.assert_allclose(sampled.normals, sampled.area_vectors / lengths, rtol=0, atol=1e-11)


@settings(max_examples=40, deadline=None)
@given(st.floats(0.05, 0.9), st.floats(-0.9, 0.9), st.integers(0, 3))
def test_polar_normals_are_those_of_the_points_on_the_side_of_du_x_dv(r: float, along: float, turn: int) -> None:
    u, v = ((r, r * along), (-r * along, r), (-r, -r * along), (r * along, -r))[turn]
    step = 1e-5 * r
    du = polar(u + step, v)[0] - polar(u - step, v)[0]
    dv = polar(u, v + step)[0] - polar(u, v - step)[0]
    normal = np.cross(du, dv)
    np.testing.assert_allclose(polar(u, v)[1], normal / np.linalg.norm(normal), rtol=0, atol=1e-4)


def test_mean_curvature_vanishes(sampled: Sampled) -> None:
    bending = np.cross(sampled.normals_u, sampled.points_v) + np.cross(sampled.points_u, sampled.normals_v)
    mean = np.sum(sampled.normals * bending, axis=-1) / np.linalg.norm(sampled.area_vectors, axis=-1)
    np.testing.assert_allclose(mean, 0, atol=1e-9)


def test_24_patches_have_the_area_of_a_cell(sampled: Sampled) -> None:
    area = np.sum(sampled.weights * np.linalg.norm(sampled.area_vectors, axis=-1))
    assert area * PATCHES_PER_CELL * AREAS_PER_CELL_SIZE_SQUARED == pytest.approx(TUBE.area, rel=1e-12)


def test_24_patches_have_total_curvature_minus_16_pi(sampled: Sampled) -> None:
    gauss_map = np.sum(sampled.normals * np.cross(sampled.normals_u, sampled.normals_v), axis=-1)
    assert np.sum(sampled.weights * gauss_map) * PATCHES_PER_CELL == pytest.approx(-16 * pi, rel=1e-12)


def test_quadrature_of_the_smooth_patch_converges_geometrically() -> None:
    def area_error(count: int) -> float:
        coarse = Sampled(count)
        area = np.sum(coarse.weights * np.linalg.norm(coarse.area_vectors, axis=-1))
        return abs(float(area) * PATCHES_PER_CELL * AREAS_PER_CELL_SIZE_SQUARED - TUBE.area)

    errors = [area_error(count) for count in (8, 12, 16, 20)]
    assert all(later < earlier / 20 for earlier, later in pairwise(errors))


def _coefficients(points: Floats) -> Floats:
    """Chebyshev coefficients from samples at _chebyshev_nodes, largest component."""
    return np.asarray(
        np.max(np.abs(chebyshev.chebfit(chebyshev.chebpts1(len(points)), points, len(points) - 1)), axis=1)
    )


@pytest.mark.parametrize("v", [-1.0, 0.3, 1.0])
def test_chebyshev_coefficients_decay_geometrically_along_the_smooth_patch(v: float) -> None:
    size = _coefficients(smooth(chebyshev.chebpts1(64), v)[0])
    assert size[10:16].max() < 1e-3 * size[4:6].max()
    assert size[30:].max() < 1e-14


def test_chebyshev_coefficients_decay_algebraically_along_a_polar_edge() -> None:
    size = _coefficients(polar(chebyshev.chebpts1(128), -1.0)[0])
    tails = np.array([size[k : 2 * k].max() for k in (8, 16, 32)])
    # A square root at the ends: order 2 in the degree, however high that is.
    np.testing.assert_allclose(np.log2(tails[:-1] / tails[1:]), 2, atol=0.4)


def test_patch_corners_are_60_degrees_wide_so_that_six_meet() -> None:
    derivative = chebyshev.chebder(chebyshev.chebfit(chebyshev.chebpts1(48), exact_edge(chebyshev.chebpts1(48)), 40))
    arriving, leaving = chebyshev.chebval(1.0, derivative), ROTOINVERSION @ chebyshev.chebval(-1.0, derivative)
    cosine = -arriving @ leaving / (np.linalg.norm(arriving) * np.linalg.norm(leaving))
    assert cosine == pytest.approx(1 / 2, abs=1e-11)


@pytest.mark.parametrize("name", PARAMETERISATIONS)
def test_parameters_are_broadcast(name: str) -> None:
    points, normals = PARAMETERISATIONS[name](np.zeros((4, 1)), np.linspace(-1, 1, 5))
    assert points.shape == normals.shape == (4, 5, 3)

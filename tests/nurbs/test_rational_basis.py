"""Matrices of rational basis functions, and points at places of their own: each against the other and scipy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from gyroid_cad.nurbs.basis import images, orders, rational_basis, uniform_knots
from gyroid_cad.nurbs.surface import first_fold, grid_derivatives, layer_areas, layer_volumes, point_derivatives
from gyroid_cad.nurbs.volume import NurbsVolume

Floats = NDArray[np.float64]

KNOTS = (np.array([-1.0, -1, -1, -1, -0.7, 0.6, 1, 1, 1, 1]), np.array([0.0, 0, 0, 0.4, 3, 3, 3]))
RNG = np.random.default_rng(4)
WEIGHTS = RNG.uniform(0.5, 2, (6, 4))
NETS = RNG.normal(size=(5, 6, 4, 3))
PLACES = np.stack([RNG.uniform(-1, 1, 9), RNG.uniform(0, 3, 9)], axis=-1)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("order", [0, 1, 2])
def test_matrices_single_places_and_grids_are_one_surface(rational: bool, order: int) -> None:
    weights = WEIGHTS if rational else np.full_like(WEIGHTS, 3.0)
    u, v = (np.tile(along, (len(NETS), 1)) for along in PLACES.T)
    by_places = point_derivatives(NETS, weights, KNOTS, u, v, order)
    by_grid = grid_derivatives(NETS, weights, KNOTS, *PLACES.T, order)
    by_matrix = [images(rows, NETS.reshape(len(NETS), -1, 3)) for rows in rational_basis(weights, KNOTS, PLACES, order)]
    assert len(by_places) == len(by_grid) == len(by_matrix) == len(orders(order, 2))
    for at_places, on_grid, made in zip(by_places, by_grid, by_matrix, strict=True):
        scale = np.abs(made).max()
        np.testing.assert_allclose(at_places, made, rtol=0, atol=1e-13 * scale)
        np.testing.assert_allclose(np.diagonal(on_grid, axis1=1, axis2=2).transpose(0, 2, 1), made, atol=1e-13 * scale)


def test_a_rational_curve_is_the_quotient_of_two_of_scipy_s_splines_with_their_derivatives() -> None:
    points, weights, x = NETS[0, :, 0], WEIGHTS[:, 0], PLACES[:, 0]
    above, below = BSpline(KNOTS[0], points * weights[:, np.newaxis], 3), BSpline(KNOTS[0], weights, 3)
    w, first, second = (below(x, nu)[:, np.newaxis] for nu in range(3))
    value = above(x) / w
    rate = (above(x, 1) - first * value) / w
    found = rational_basis(weights, KNOTS[:1], x[:, np.newaxis], 2) @ points
    bend = (above(x, 2) - 2 * first * rate - second * value) / w
    for mine, theirs in zip(found, (value, rate, bend), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())


def test_a_volume_s_points_are_its_matrices_products() -> None:
    net, weights = RNG.normal(size=(4, 5, 3, 3)), RNG.uniform(0.5, 2, (4, 5, 3))
    knots = (uniform_knots(4), uniform_knots(5), uniform_knots(3, 2))
    places, volume = RNG.uniform(-1, 1, (7, 3)), NurbsVolume(net, weights, *knots)
    values, *rates = rational_basis(weights, knots, places, 1) @ net.reshape(-1, 3)
    np.testing.assert_allclose(volume.evaluate(*places.T), values, atol=1e-13)
    np.testing.assert_allclose(volume.jacobian(*places.T), np.stack(rates, axis=-1), atol=1e-12)


def test_beyond_the_square_the_polynomial_at_the_border_goes_on() -> None:
    u, v = np.full((5, 1), 1.1), np.full((5, 1), 3.2)
    value, du, dv, duu, duv, dvv = point_derivatives(NETS, np.ones((6, 4)), KNOTS, u - 0.1, v - 0.2, 2)
    beyond = point_derivatives(NETS, np.ones((6, 4)), KNOTS, u, v, 0)[0]
    taylor = value + 0.1 * du + 0.2 * dv + (0.01 * duu + 0.04 * duv + 0.04 * dvv) / 2
    # What is left out is of third order.
    np.testing.assert_allclose(beyond, taylor, atol=0.5 * np.abs(duu).max() * 0.3**3 * 60)


def layer(s: float) -> Floats:
    """Area vector along z of a unit saddle's parallel face, at its middle: (1 - s^2)."""
    return np.array(1 - s * s)


def test_a_layer_s_area_is_a_quadratic_whose_first_root_is_where_it_folds() -> None:
    # At the middle of a saddle of principal curvatures 1 and -1 the unit normal turns at these rates.
    x, y, z = np.eye(3)
    coefficients = layer_areas((x, y), (x, -y), z)
    assert [float(c) for c in coefficients] == [1.0, 0.0, -1.0]
    assert first_fold(*coefficients) == 1.0
    assert sum(c * 0.5**k for k, c in enumerate(coefficients)) == layer(0.5)
    # A layer from -1/2 to 1/2 of it: the integral of 1 - s^2 over s.
    assert layer_volumes((x, y), (x / 2, -y / 2), z / 2) == pytest.approx(1 - 2 / 3 * 0.5**3)


def test_a_plane_never_folds_and_what_is_turned_over_is_folded_already() -> None:
    x, y, z = np.eye(3)
    assert first_fold(*layer_areas((x, y), (0 * x, 0 * y), z)) == np.inf
    assert first_fold(*layer_areas((y, x), (x, -y), z)) == 0.0

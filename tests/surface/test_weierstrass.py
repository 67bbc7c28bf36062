"""The exact surface: its map, its normals and the chart at its corners."""

from __future__ import annotations

from math import pi, sqrt

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.special import elliprf

from gyroid_cad.errors import ParameterError
from gyroid_cad.surface import weierstrass as ws

Floats = NDArray[np.float64]

EDGE_MIDPOINT = (sqrt(2) - 1) * np.exp(1j * pi / 4)
# Into the domain from the corner c, whose angle there is 120 degrees.
INWARDS = np.exp(1j * np.array([-0.9, 0.0, 0.9]))


def domain_point(radius: float, phi: float, turn: int) -> complex:
    """Fig. 2: ``radius`` from 0 at the centre to 1 on the arc, ``phi`` along the arc."""
    return complex(radius * np.exp(1j * pi / 4) * (sqrt(2) * np.exp(1j * phi) - 1) * 1j**turn)


def omegas(largest_radius: float = 1.0) -> st.SearchStrategy[complex]:
    return st.builds(domain_point, st.floats(0, largest_radius), st.floats(-pi / 12, pi / 12), st.integers(0, 3))


def chart_values() -> st.SearchStrategy[complex]:
    """Values of tau inside the patch, whose angle at the corner is 60 degrees in this chart."""
    return st.builds(lambda r, a: complex(r * np.exp(1j * a)), st.floats(0, 0.6), st.floats(-0.4, 0.4))


@pytest.mark.parametrize(
    "omega",
    [
        *(ws.CORNER * 1j**k for k in range(4)),
        *(EDGE_MIDPOINT * 1j**k for k in range(4)),
        *(ws.CORNER - 1e-9 * INWARDS),
        *(1j * (ws.CORNER - 1e-4 * INWARDS)),
        1e-3 + 2e-3j,
        0.25 - 0.1j,
    ],
)
def test_points_agree_with_quadrature_of_the_weierstrass_integral(omega: complex) -> None:
    np.testing.assert_allclose(ws.points(omega), ws.quadrature_point(omega), rtol=0, atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(omegas())
def test_points_agree_with_quadrature_anywhere_in_the_domain(omega: complex) -> None:
    np.testing.assert_allclose(ws.points(omega), ws.quadrature_point(omega), rtol=0, atol=1e-12)


def test_the_centre_is_the_origin() -> None:
    np.testing.assert_array_equal(ws.points(0j), np.zeros(3))


def test_corners_stand_over_a_square_at_alternating_heights() -> None:
    # The corner itself is no double: half the digits of a point there hang on the last one of omega.
    corners = np.stack([ws.rotoinversion(ws.corner_chart_points(0), k) for k in range(4)])
    np.testing.assert_allclose(np.abs(corners), [[sqrt(2) / 4, sqrt(2) / 4, 1 / 4]] * 4, rtol=0, atol=1e-15)
    np.testing.assert_allclose(corners[:, 2], -np.roll(corners[:, 2], 1), rtol=0, atol=1e-15)
    np.testing.assert_allclose(ws.points(ws.CORNER * np.array([1, 1j, -1, -1j])), corners, rtol=0, atol=1e-8)


def test_constants_are_those_of_the_complete_integrals() -> None:
    with mpmath.workdps(30):
        k, k_prime = mpmath.ellipk(mpmath.mpf(1) / 4), mpmath.ellipk(mpmath.mpf(3) / 4)
        assert pytest.approx(float(mpmath.sqrt(k**2 + k_prime**2) / (k * k_prime)), rel=1e-15) == ws.GYROID.scale
        assert pytest.approx(float(mpmath.acot(k_prime / k)), rel=1e-15) == ws.GYROID.bonnet_angle
        assert float((mpmath.sqrt(3) - 1) / mpmath.sqrt(2)) == ws.CORNER


def test_the_corner_is_a_branch_point_of_the_integrand() -> None:
    assert abs(ws.CORNER**8 - 14 * ws.CORNER**4 + 1) < 1e-14


@settings(max_examples=50, deadline=None)
@given(omegas())
def test_multiplying_omega_by_i_is_the_rotoinversion(omega: complex) -> None:
    np.testing.assert_allclose(ws.points(1j * omega), ws.rotoinversion(ws.points(omega)), rtol=0, atol=1e-13)


@settings(max_examples=50, deadline=None)
@given(omegas())
def test_the_rotoinversion_carries_normals_to_the_other_side(omega: complex) -> None:
    np.testing.assert_allclose(ws.normals(1j * omega), -ws.rotoinversion(ws.normals(omega)), rtol=0, atol=1e-15)


def test_four_rotoinversions_are_the_identity_and_none_is_a_rotation() -> None:
    matrix = ws.rotoinversion(np.eye(3))
    np.testing.assert_array_equal(ws.rotoinversion(np.eye(3), 4), np.eye(3))
    np.testing.assert_array_equal(ws.rotoinversion(np.eye(3), -1), matrix.T)
    assert np.linalg.det(matrix) == pytest.approx(-1)


@settings(max_examples=50, deadline=None)
@given(omegas(largest_radius=0.9), st.floats(0, 2 * pi))
def test_the_surface_is_a_conformal_image_of_the_plane_with_the_gauss_map_as_normal(
    omega: complex, direction: float
) -> None:
    step = 1e-4 * np.exp(1j * direction)
    along, across = ((ws.points(omega + s) - ws.points(omega - s)) / 2e-4 for s in (step, 1j * step))
    expected = ws.GYROID.scale * (1 + abs(omega) ** 2) / abs(np.sqrt(omega**8 - 14 * omega**4 + 1))
    normal = ws.normals(omega)
    assert np.linalg.norm(normal) == pytest.approx(1, abs=1e-15)
    assert np.linalg.norm(along) == pytest.approx(expected, rel=1e-5)
    np.testing.assert_allclose(np.cross(along, across), expected**2 * normal, rtol=0, atol=2e-5 * expected**2)


@settings(max_examples=25, deadline=None)
@given(omegas())
def test_associate_surfaces_are_combinations_of_the_diamond_and_the_primitive_surface(omega: complex) -> None:
    angle, scale = ws.GYROID.bonnet_angle, ws.GYROID.scale
    diamond = ws.points(omega, ws.Family("D", 0.0, scale))
    primitive = ws.points(omega, ws.Family("P", pi / 2, scale))
    combined = np.cos(angle) * diamond + np.sin(angle) * primitive
    np.testing.assert_allclose(ws.points(omega), combined, rtol=0, atol=1e-14)


@settings(max_examples=50, deadline=None)
@given(chart_values())
def test_corner_chart_agrees_with_points(tau: complex) -> None:
    # points is given omega, so that half of tau's digits are lost near the corner.
    np.testing.assert_allclose(
        ws.corner_chart_points(tau), ws.points(ws.corner_chart_omega(tau)), rtol=0, atol=1e-15 / max(abs(tau), 1e-8)
    )


@settings(max_examples=50, deadline=None)
@given(chart_values())
def test_corner_chart_is_odd_about_the_corner(tau: complex) -> None:
    corner = ws.corner_chart_points(0)
    there, back = ws.corner_chart_points(np.array([tau, -tau])) - corner
    np.testing.assert_allclose(back, -there, rtol=0, atol=1e-15)


@settings(max_examples=50, deadline=None)
@given(chart_values())
def test_tangents_are_a_null_curve_perpendicular_to_the_normal(tau: complex) -> None:
    tangent = ws.corner_chart_tangents(tau)
    assert abs(np.sum(tangent**2)) < 1e-14
    np.testing.assert_allclose(tangent @ ws.normals(ws.corner_chart_omega(tau)), 0, atol=1e-14)


@settings(max_examples=25, deadline=None)
@given(chart_values(), st.floats(0, 2 * pi))
def test_associate_surfaces_are_isometric(tau: complex, angle: float) -> None:
    metric = np.linalg.norm(ws.corner_chart_tangents(tau))
    other = np.linalg.norm(ws.corner_chart_tangents(tau, ws.Family("associate", angle, ws.GYROID.scale)))
    assert other == pytest.approx(metric, rel=1e-14)


@pytest.mark.parametrize("tau", [0.0, 0.05j + 0.06, 0.3, 0.4 - 0.2j])
def test_tangents_are_the_limit_of_central_differences_at_second_order(tau: complex) -> None:
    def error(step: float) -> float:
        difference = (ws.corner_chart_points(tau + step) - ws.corner_chart_points(tau - step)) / (2 * step)
        return float(np.linalg.norm(difference - ws.corner_chart_tangents(tau).real))

    assert np.log2(error(2e-2) / error(1e-2)) == pytest.approx(2, abs=0.05)


@pytest.mark.parametrize("tau", [*(0.3 * np.exp(1j * pi * np.arange(12) / 6 + 0.1j)), 0.3, -0.3, 0.3j, -0.3j])
def test_corner_chart_points_are_the_integral_of_the_tangents_in_every_direction(tau: complex) -> None:
    nodes, weights = np.polynomial.legendre.leggauss(20)
    tangents = ws.corner_chart_tangents(tau * (1 + nodes) / 2)
    integral = (tau / 2 * weights @ tangents).real
    np.testing.assert_allclose(ws.corner_chart_points(tau) - ws.corner_chart_points(0), integral, rtol=0, atol=1e-13)


@pytest.mark.parametrize("turn", range(4))
def test_a_corner_rounded_outwards_is_still_the_corner(turn: int) -> None:
    rounded = np.nextafter(ws.CORNER, 1) * 1j**turn
    np.testing.assert_allclose(ws.points(rounded), ws.points(ws.CORNER * 1j**turn), rtol=0, atol=1e-7)


def test_shapes_are_kept() -> None:
    assert ws.points(0.1).shape == (3,)
    assert ws.points(np.zeros((2, 5))).shape == (2, 5, 3)
    assert ws.points(np.zeros((0,))).shape == (0, 3)
    assert ws.normals(np.zeros((2, 5))).shape == (2, 5, 3)


@pytest.mark.parametrize("omega", [1 + 0j, ws.CORNER + 1e-6, -0.4 - 0.4j, complex("nan"), complex("inf")])
def test_values_outside_the_domain_are_refused_by_name(omega: complex) -> None:
    with pytest.raises(ParameterError) as refusal:
        ws.points([0.1, omega, 0.2])
    assert str(refusal.value).startswith(f"omega = {complex(omega)!r}: expected a point of the semi-fundamental patch")


@settings(max_examples=25, deadline=None)
@given(st.floats(1.001, 100), st.floats(-pi / 12, pi / 12), st.integers(0, 3))
def test_everything_beyond_the_bounding_arcs_is_refused(radius: float, phi: float, turn: int) -> None:
    with pytest.raises(ParameterError):
        ws.points(domain_point(radius, phi, turn))


@settings(max_examples=100, deadline=None)
@given(st.complex_numbers(max_magnitude=0.9), st.floats(0, 0.99))
def test_the_elliptic_integral_is_scipys(s: complex, m: float) -> None:
    arguments = (np.array([1 - s * s]), np.array([1 - m * s * s]), np.ones(1, complex))
    np.testing.assert_allclose(ws._carlson_rf(*arguments), elliprf(*arguments), rtol=4e-15)

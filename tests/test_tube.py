"""The tube formula: thickness and density, checked against the exact surface."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyroid_cad.tube import (
    AREA_PER_CELL,
    EULER_CHARACTERISTIC,
    LARGEST_DENSITY,
    LARGEST_THICKNESS,
    THICKNESS_LIMIT,
    density_of_thickness,
    face_area,
    thickness_of_density,
)
from gyroid_cad.weierstrass import normals, points

THICKNESSES = st.floats(0, THICKNESS_LIMIT)
PATCHES_PER_CELL = 24
CELL_SIZE = 2.0  # in bounding-cell lengths, the unit of the patch


def arc(phi: float | np.ndarray) -> np.ndarray:
    """One of the four arcs that bound the patch's domain in the omega plane, |phi| <= pi / 12."""
    return np.asarray(np.exp(1j * pi / 4) * (sqrt(2) * np.exp(1j * phi) - 1))


def radius_of_curvature(omega: complex, step: float = 1e-4) -> float:
    """Way on the surface by turn of the normal, the same in every direction of a minimal surface; in cell sizes."""
    ends = np.array([omega - step, omega + step])
    way, turn = np.diff(points(ends), axis=0), np.diff(normals(ends), axis=0)
    return float(np.linalg.norm(way) / np.linalg.norm(turn)) / CELL_SIZE


@settings(max_examples=100, deadline=None)
@given(THICKNESSES)
def test_density_and_thickness_are_inverse(thickness: float) -> None:
    assert thickness_of_density(density_of_thickness(thickness)) == pytest.approx(thickness, rel=1e-9, abs=1e-15)


@settings(max_examples=100, deadline=None)
@given(st.floats(0, LARGEST_DENSITY))
def test_thickness_and_density_are_inverse(density: float) -> None:
    assert density_of_thickness(thickness_of_density(density)) == pytest.approx(density, rel=1e-9, abs=1e-15)


@settings(max_examples=50, deadline=None)
@given(THICKNESSES, THICKNESSES)
def test_a_thicker_wall_is_denser(one: float, other: float) -> None:
    thin, thick = sorted((one, other))
    assert density_of_thickness(thin) <= density_of_thickness(thick)


def test_no_thickness_is_no_density() -> None:
    assert density_of_thickness(0.0) == 0.0
    assert thickness_of_density(0.0) == 0.0


@settings(max_examples=50, deadline=None)
@given(THICKNESSES)
def test_density_grows_by_the_area_of_the_faces(thickness: float) -> None:
    # Simpson's rule is exact for a quadratic; a wall grows by half of dt on each of two faces.
    integral = thickness / 6 * (face_area(0.0) + 4 * face_area(thickness / 2) + face_area(thickness))
    assert density_of_thickness(thickness) == pytest.approx(integral, rel=1e-13, abs=1e-300)


def test_the_face_of_a_wall_of_no_thickness_is_the_mid_surface() -> None:
    assert face_area(0.0) == AREA_PER_CELL
    assert pytest.approx(3.0914438, abs=1e-8) == AREA_PER_CELL


def test_gauss_bonnet_the_normals_of_a_cell_cover_the_sphere_four_times() -> None:
    # The Gauss map is stereographic: area element 4 r dr dphi / (1 + r^2)^2, integrated along rays by hand.
    nodes, weights = np.polynomial.legendre.leggauss(30)
    border = arc(pi / 12 * nodes)
    swept = np.imag(np.conj(border) * np.exp(1j * pi / 4) * sqrt(2) * 1j * np.exp(1j * pi / 12 * nodes)) * pi / 12
    patch = 4 * weights @ (2 * swept / (1 + np.abs(border) ** 2))
    total_curvature = -patch * PATCHES_PER_CELL
    assert total_curvature == pytest.approx(-16 * pi, rel=1e-12)
    assert 2 * pi * EULER_CHARACTERISTIC == pytest.approx(total_curvature, rel=1e-12)
    # Weyl: a shell element at distance s has area (1 + K s^2) dA.
    thickness = 0.2
    cubic = (density_of_thickness(thickness) - AREA_PER_CELL * thickness) / thickness**3
    assert cubic == pytest.approx(total_curvature / 12, rel=1e-11)
    assert cubic == pytest.approx(-4 * pi / 3, rel=1e-11)


def test_the_thickness_limit_is_twice_the_smallest_radius_of_curvature() -> None:
    # Richardson's extrapolation of second-order differences at the patch's centre.
    coarse, fine = radius_of_curvature(0j, 2e-2), radius_of_curvature(0j, 1e-2)
    assert 2 * (4 * fine - coarse) / 3 == pytest.approx(THICKNESS_LIMIT, rel=1e-7)


@settings(max_examples=50, deadline=None)
@given(st.floats(0.01, 0.95), st.floats(-pi / 12, pi / 12), st.integers(0, 3))
def test_the_surface_is_nowhere_more_curved_than_at_patch_centres(radius: float, phi: float, turn: int) -> None:
    omega = complex(radius * arc(phi) * 1j**turn)
    assert 2 * radius_of_curvature(omega) > THICKNESS_LIMIT


def test_faces_shrink_to_points_nowhere_before_the_limit() -> None:
    assert 0 < face_area(THICKNESS_LIMIT) < AREA_PER_CELL
    assert density_of_thickness(LARGEST_THICKNESS) == LARGEST_DENSITY < 1

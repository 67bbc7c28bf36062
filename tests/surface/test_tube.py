"""The tube formula: thickness and density, checked against the exact surface."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyroid_cad.surface.families import SURFACES, MinimalSurface
from gyroid_cad.surface.weierstrass import Family, normals, points

EVERY = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
CELL_SIZE = 2.0  # in bounding-cell lengths, the unit of the patch

parts = st.floats(0, 1)


def arc(phi: float | np.ndarray) -> np.ndarray:
    """One of the four arcs that bound the patch's domain in the omega plane, |phi| <= pi / 12."""
    return np.asarray(np.exp(1j * pi / 4) * (sqrt(2) * np.exp(1j * phi) - 1))


def radius_of_curvature(omega: complex, family: Family, step: float = 1e-4) -> float:
    """Way on the surface by turn of the normal, the same in every direction of a minimal surface; in cell sizes."""
    ends = np.array([omega - step, omega + step])
    way, turn = np.diff(points(ends, family), axis=0), np.diff(normals(ends), axis=0)
    return float(np.linalg.norm(way) / np.linalg.norm(turn)) / CELL_SIZE


@EVERY
@settings(max_examples=100, deadline=None)
@given(part=parts)
def test_density_and_thickness_are_inverse(surface: MinimalSurface, part: float) -> None:
    tube = surface.tube
    thickness = part * tube.thickness_limit
    assert tube.thickness(tube.density(thickness)) == pytest.approx(thickness, rel=1e-9, abs=1e-15)


@EVERY
@settings(max_examples=100, deadline=None)
@given(part=parts)
def test_thickness_and_density_are_inverse(surface: MinimalSurface, part: float) -> None:
    tube = surface.tube
    density = part * tube.max_density
    assert tube.density(tube.thickness(density)) == pytest.approx(density, rel=1e-9, abs=1e-15)


@EVERY
@settings(max_examples=50, deadline=None)
@given(one=parts, other=parts)
def test_a_thicker_wall_is_denser(surface: MinimalSurface, one: float, other: float) -> None:
    tube = surface.tube
    thin, thick = sorted((one * tube.thickness_limit, other * tube.thickness_limit))
    assert tube.density(thin) <= tube.density(thick)


@EVERY
def test_no_thickness_is_no_density(surface: MinimalSurface) -> None:
    assert surface.tube.density(0.0) == 0.0
    assert surface.tube.thickness(0.0) == 0.0


@EVERY
@settings(max_examples=50, deadline=None)
@given(part=parts)
def test_density_grows_by_the_area_of_the_faces(surface: MinimalSurface, part: float) -> None:
    # Simpson's rule is exact for a quadratic; a wall grows by half of dt on each of two faces.
    tube = surface.tube
    thickness = part * tube.thickness_limit
    integral = thickness / 6 * (tube.face_area(0.0) + 4 * tube.face_area(thickness / 2) + tube.face_area(thickness))
    assert tube.density(thickness) == pytest.approx(integral, rel=1e-13, abs=1e-300)


@pytest.mark.parametrize(
    ("name", "area", "euler_characteristic"),
    [("gyroid", 3.09144380, -8), ("diamond", 3.83778471, -16), ("primitive", 2.34510288, -4)],
)
def test_areas_and_euler_characteristics_are_those_of_the_literature(
    name: str, area: float, euler_characteristic: float
) -> None:
    tube = SURFACES[name].tube
    assert tube.face_area(0.0) == tube.area
    assert tube.area == pytest.approx(area, abs=1e-8)
    assert tube.euler_characteristic == pytest.approx(euler_characteristic, abs=1e-12)


@EVERY
def test_gauss_bonnet_the_normals_of_a_patch_cover_a_sixth_of_the_sphere(surface: MinimalSurface) -> None:
    # The Gauss map is stereographic: area element 4 r dr dphi / (1 + r^2)^2, integrated along rays by hand.
    nodes, weights = np.polynomial.legendre.leggauss(30)
    border = arc(pi / 12 * nodes)
    swept = np.imag(np.conj(border) * np.exp(1j * pi / 4) * sqrt(2) * 1j * np.exp(1j * pi / 12 * nodes)) * pi / 12
    patch = 4 * weights @ (2 * swept / (1 + np.abs(border) ** 2))
    total_curvature = -patch * len(surface.cell)
    tube = surface.tube
    assert 2 * pi * tube.euler_characteristic == pytest.approx(total_curvature, rel=1e-12)
    # Weyl: a shell element at distance s has area (1 + K s^2) dA.
    thickness = 0.2
    cubic = (tube.density(thickness) - tube.area * thickness) / thickness**3
    assert cubic == pytest.approx(total_curvature / 12, rel=1e-11)


@EVERY
def test_the_thickness_limit_is_twice_the_smallest_radius_of_curvature(surface: MinimalSurface) -> None:
    # Richardson's extrapolation of second-order differences at the patch's centre.
    coarse, fine = (radius_of_curvature(0j, surface.family, step) for step in (2e-2, 1e-2))
    assert 2 * (4 * fine - coarse) / 3 == pytest.approx(surface.tube.thickness_limit, rel=1e-7)


@EVERY
@settings(max_examples=50, deadline=None)
@given(radius=st.floats(0.01, 0.95), phi=st.floats(-pi / 12, pi / 12), turn=st.integers(0, 3))
def test_the_surface_is_nowhere_more_curved_than_at_patch_centres(
    surface: MinimalSurface, radius: float, phi: float, turn: int
) -> None:
    omega = complex(radius * arc(phi) * 1j**turn)
    assert 2 * radius_of_curvature(omega, surface.family) > surface.tube.thickness_limit


@EVERY
def test_faces_shrink_to_points_nowhere_before_the_limit(surface: MinimalSurface) -> None:
    tube = surface.tube
    assert 0 < tube.face_area(tube.thickness_limit) < tube.area
    assert tube.density(tube.max_thickness) == tube.max_density < 1

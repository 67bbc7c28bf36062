"""Rational B-spline volumes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.basis import uniform_knots
from gyroid_cad.nurbs.surface import NurbsSurface
from gyroid_cad.nurbs.volume import NurbsVolume

LINE = np.array([0.0, 0.0, 1.0, 1.0])


def wavy(seed: int = 0, rational: bool = True) -> NurbsVolume:
    """A box of degrees (3, 2, 1), shaken."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(np.arange(6), np.arange(4), np.arange(3), indexing="ij"), axis=-1)
    weights = rng.uniform(0.5, 2, grid.shape[:3]) if rational else np.ones(grid.shape[:3])
    return NurbsVolume(
        grid + rng.uniform(-0.2, 0.2, grid.shape),
        weights,
        uniform_knots(6, 3),
        uniform_knots(4, 2),
        uniform_knots(3, 1),
    )


def quarter_ring(height: float) -> NurbsVolume:
    """Between two circular arcs of radii 1 and 2, exactly, as only rational volumes can be."""
    arc = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.zeros((3, 2, 2, 3))
    points[..., :2] = arc[:, np.newaxis, np.newaxis] * np.array([2.0, 1.0])[:, np.newaxis, np.newaxis]
    points[:, :, 1, 2] = height
    weights = np.broadcast_to(np.array([1.0, np.sqrt(0.5), 1.0])[:, np.newaxis, np.newaxis], (3, 2, 2))
    return NurbsVolume(points, weights, np.array([0.0, 0, 0, 1, 1, 1]), LINE, LINE)


def test_degrees_follow_from_the_lengths_of_knots_and_net() -> None:
    assert wavy().degrees == (3, 2, 1)
    assert quarter_ring(1).degrees == (2, 1, 1)


@pytest.mark.parametrize("height", [0.5, 3.0])
def test_the_volume_of_a_quarter_of_a_ring_holds_pi(height: float) -> None:
    assert quarter_ring(height).volume() == pytest.approx(np.pi * (2**2 - 1) / 4 * height, rel=1e-13)


def test_the_volume_is_the_flux_of_the_position_through_the_six_faces() -> None:
    volume = wavy(rational=False)
    net, weights, (u, v, w) = volume.control_points, volume.weights, volume.knots
    faces = [(-1, net[0], weights[0], v, w), (1, net[-1], weights[-1], v, w)]
    faces += [(1, net[:, 0], weights[:, 0], u, w), (-1, net[:, -1], weights[:, -1], u, w)]
    faces += [(-1, net[:, :, 0], weights[:, :, 0], u, v), (1, net[:, :, -1], weights[:, :, -1], u, v)]
    flux = 0.0
    for sign, *parts in faces:
        surface = NurbsSurface(*parts)
        a, b, quadrature = surface.quadrature()
        d = surface.derivatives(a, b)
        flux += sign * float(np.sum(quadrature * np.sum(d[0, 0] * np.cross(d[1, 0], d[0, 1]), axis=-1)))
    assert volume.volume() == pytest.approx(flux / 3, rel=1e-12)


@given(seed=st.integers(0, 10**6), rational=st.booleans())
def test_the_jacobian_is_the_limit_of_differences(seed: int, rational: bool) -> None:
    volume = wavy(seed, rational)
    place, step = np.random.default_rng(seed).uniform(-0.9, 0.9, 3), 1e-5
    differences = np.stack(
        [(volume.evaluate(*(place + e)) - volume.evaluate(*(place - e))) / (2 * step) for e in np.eye(3) * step],
        axis=-1,
    )
    np.testing.assert_allclose(volume.jacobian(*place), differences, atol=1e-6)
    assert volume.jacobian_determinant(*place) == pytest.approx(np.linalg.det(differences), abs=1e-5)


@given(seed=st.integers(0, 10**6))
def test_affine_maps_of_the_control_points_scale_volume_by_their_determinant(seed: int) -> None:
    volume, matrix = wavy(seed, rational=False), np.random.default_rng(seed).normal(size=(3, 3))
    moved = NurbsVolume(volume.control_points @ matrix.T + 3.0, volume.weights, *volume.knots)
    assert moved.volume() == pytest.approx(np.linalg.det(matrix) * volume.volume(), rel=1e-9, abs=1e-9)


def test_a_grid_given_open_has_the_values_of_the_same_places_one_by_one() -> None:
    volume = wavy()
    u, v, w = np.linspace(-1, 1, 5), np.linspace(-1, 1, 4), np.linspace(-1, 1, 3)
    one_by_one = np.meshgrid(u, v, w, indexing="ij")
    opened = (u[:, np.newaxis, np.newaxis], v[:, np.newaxis], w)
    for function in (volume.evaluate, volume.jacobian, volume.jacobian_determinant):
        np.testing.assert_allclose(function(*opened), function(*one_by_one), rtol=1e-12, atol=1e-12)
    crossed = (u[:, np.newaxis], v, 0.5)
    expected = volume.evaluate(*np.meshgrid(u, v, [0.5], indexing="ij"))[:, :, 0]
    np.testing.assert_allclose(volume.evaluate(*crossed), expected, atol=1e-12)


def test_its_arrays_cannot_be_written_to_and_weights_must_fit() -> None:
    volume = wavy()
    with pytest.raises(ValueError, match="read-only"):
        volume.control_points[0] = 0
    with pytest.raises(ParameterError, match=r"weights = .*one weight per control point: \(6, 4, 3\)"):
        NurbsVolume(volume.control_points, volume.weights[:-1], *volume.knots)

"""Distances between points and a wall, against dense samples and closed forms."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.lattice import Lattice
from gyroid_cad.nurbs.surface import grid_points, point_derivatives
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.surface.patch import smooth
from gyroid_cad.wall.distances import (
    distances_from_patches,
    in_wall,
    met_along_normals,
    nearest_offsets,
    nearest_patches,
    wall_faces,
)
from gyroid_cad.wall.exact import offset_patches, patch_derivatives

Floats = NDArray[np.float64]

NAMES = tuple(SURFACES)
SIZE = 10.0
DENSE = np.linspace(-1, 1, 101)
POINTS = st.lists(st.tuples(*3 * [st.floats(0, SIZE)]), min_size=1, max_size=4)


@cache
def wall_of(name: str, thickness: str | float = 0.8) -> Lattice:
    return Lattice((1, 1, 1), SIZE, thickness, surface=name, fit=FitSettings(6), tolerance=1e-3)


@cache
def densely(lattice: Lattice, patch: int) -> Floats:
    wall = lattice.wall()
    knots = (wall.knots, wall.knots)
    places = grid_points(wall.nets[wall.patch_net[patch]], wall.weights, knots, DENSE, DENSE)
    return places.reshape(-1, 3) + wall.shifts[wall.patch_shift[patch]]


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=15, deadline=None)
@given(POINTS, st.integers(0, 10**6))
def test_the_distance_from_a_patch_is_that_of_its_nearest_place(
    name: str, points: list[tuple[float, float, float]], number: int
) -> None:
    lattice, given_points = wall_of(name), np.array(points)
    patch = number % lattice.wall().complex.patch_count
    places = densely(lattice, patch)
    found = distances_from_patches(lattice.wall(), given_points, np.full(len(points), patch))
    dense = np.linalg.norm(given_points[:, np.newaxis] - places, axis=-1).min(axis=1)
    # A sample is off by half a step at most, about 0.1 mm: near a face that is much, far from it little.
    assert np.all(found <= dense + 1e-12)
    assert np.all(found**2 >= dense**2 - 0.1**2)


def test_a_place_where_the_nearest_sample_is_a_saddle_of_the_distance_is_found_all_the_same() -> None:
    # From a throat of the diamond the distance falls both ways along a valley, from the middle of a patch's edge.
    lattice = Lattice((1, 1, 1), SIZE, 0.9, surface="diamond", fit=FitSettings(16))
    point = np.array([[3.75, 8.75, 3.75]])
    patch = nearest_patches(lattice.wall(), point)[1]
    dense = np.linalg.norm(densely(lattice, int(patch[0])) - point, axis=1).min()
    assert distances_from_patches(lattice.wall(), point, patch)[0] == pytest.approx(dense, rel=1e-5)


@pytest.mark.parametrize("name", NAMES)
def test_samples_feet_and_nearest_places_agree_the_better_the_closer(name: str) -> None:
    lattice = wall_of(name, "0.8 + 0.02*x")
    points = np.random.default_rng(0).uniform(2, SIZE - 2, (12, 3))
    wall = lattice.wall()
    sampled, _ = nearest_patches(wall, points)
    feet = wall_faces(wall, None).feet(points, 8).nearest()[0]
    every = np.arange(wall.complex.patch_count)
    to_rounding = np.array([distances_from_patches(wall, np.tile(p, (len(every), 1)), every).min() for p in points])
    assert np.all(to_rounding <= sampled + 1e-12)
    assert feet == pytest.approx(to_rounding, abs=1e-3)
    assert np.abs(sampled - to_rounding).max() > 30 * np.abs(feet - to_rounding).max()


@pytest.mark.parametrize("name", NAMES)
def test_the_exact_patch_s_derivatives_are_those_of_its_points(name: str) -> None:
    family, step = SURFACES[name].family, 1e-4
    u, v = np.random.default_rng(1).uniform(-0.99, 0.99, (2, 25))
    points, du, dv, duu, duv, dvv = patch_derivatives(family, u, v)
    np.testing.assert_allclose(points, smooth(u, v, family)[0], atol=1e-13)

    def at(i: int, j: int) -> Floats:
        return smooth(u + i * step, v + j * step, family)[0]

    np.testing.assert_allclose(du, (at(1, 0) - at(-1, 0)) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(dv, (at(0, 1) - at(0, -1)) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(duu, (at(1, 0) - 2 * points + at(-1, 0)) / step**2, atol=1e-5)
    np.testing.assert_allclose(dvv, (at(0, 1) - 2 * points + at(0, -1)) / step**2, atol=1e-5)
    np.testing.assert_allclose(duv, (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * step**2), atol=1e-5)


def test_along_its_normals_a_fitted_wall_is_met_half_its_thickness_to_either_side() -> None:
    lattice = wall_of("gyroid", "0.8 + 0.02*x")
    fitted, samples = lattice.fitted(), np.linspace(-1, 1, 5)
    wall = fitted.wall
    for some, exact in offset_patches(fitted.complex, fitted.spec.grading, samples):
        met = met_along_normals(wall.nets[wall.patch_net[some]], wall.weights, wall.knots, samples, exact)[0]
        half = exact.thickness.reshape(met[:, 0].shape) / 2
        np.testing.assert_allclose(met, np.stack([-half, half], axis=1), atol=1e-2)


@given(st.floats(-5, 5), st.floats(-1, 1), st.floats(-1, 1))
def test_an_offset_from_samples_of_a_plane_is_the_height_above_it(height: float, x: float, y: float) -> None:
    along = np.linspace(-1, 1, 21)
    places = np.stack(np.meshgrid(along, along, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    offsets, nearest = nearest_offsets(
        places, np.broadcast_to([0.0, 0.0, 1.0], places.shape), np.array([[x, y, height]])
    )
    assert offsets[0] == pytest.approx(height)
    assert np.abs(places[nearest[0], :2] - (x, y)).max() <= 0.05 + 1e-12


def test_places_of_a_wall_lie_in_it_and_none_beyond_its_faces_or_ends() -> None:
    wall = Lattice((2, 1, 1), 8.0, "0.9 + 0.02*x", fit=FitSettings(5), tolerance=1e-2).wall()
    draw = np.random.default_rng(4)
    patch = draw.integers(wall.complex.patch_count, size=4000)
    places = draw.uniform(-1, 1, (len(patch), 3))
    beyond = draw.integers(3, size=len(patch)), draw.choice([-1.001, 1.001], len(patch))
    outside = places.copy()
    outside[np.arange(len(patch)), beyond[0]] = beyond[1]
    # Sides as they run round the square: v = -1, u = 1, v = 1, u = -1; there others go on, but where the wall ends.
    side = np.where(beyond[0] == 0, np.where(beyond[1] > 0, 1, 3), np.where(beyond[1] > 0, 2, 0))
    ends = (beyond[0] == 2) | wall.complex.free[wall.complex.patch_edges[patch, side]]

    def layer(some: Floats) -> Floats:
        knots, (u, v, w) = (wall.knots, wall.knots), some.T[..., np.newaxis]
        low, high = (
            point_derivatives(wall.nets[wall.patch_net[patch], k], wall.weights, knots, u, v, 0)[0][:, 0]
            for k in (0, 1)
        )
        return low + (w + 1) / 2 * (high - low) + wall.shifts[wall.patch_shift[patch]]

    assert np.all(in_wall(wall, layer(places)))
    assert not np.any(in_wall(wall, layer(outside))[ends])

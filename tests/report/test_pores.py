"""Pore sizes: the largest spheres between the walls, against the exact surface and what symmetry and offsets demand."""

from __future__ import annotations

from functools import lru_cache
from math import sqrt

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.lattice import Lattice
from gyroid_cad.report.pores import Pores, inscribed_spheres, pores_of
from gyroid_cad.report.wall_thickness import distribution_of
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.surface.patch import PARAMETERISATIONS
from gyroid_cad.surface.symmetry import QUARTER
from gyroid_cad.wall.exact import patch_points_and_normals

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SIZE, WALL = 10.0, 0.8
# The fitted faces' deviation, in cell sizes.
FIT = {"gyroid": 2e-5, "diamond": 5e-7, "primitive": 2e-5}


@lru_cache
def spheres(
    surface: str = "gyroid", wall: float = WALL, size: float = SIZE
) -> tuple[Floats, Floats, NDArray[np.int64]]:
    return inscribed_spheres(Lattice((1, 1, 1), size, wall, surface=surface).fitted())


@pytest.fixture(scope="module")
def gyroid() -> Pores:
    return pores_of(Lattice((3, 2, 1), SIZE, WALL).fitted())


def exact_distance(surface: str, place: Floats) -> float:
    """From a place to the exact endless surface, by searching the Weierstrass map: no NURBS, no tree."""
    complex = Lattice((1, 1, 1), SIZE, WALL, surface=surface).fitted().complex
    grid = patch_points_and_normals(complex, SIZE, np.linspace(-1, 1, 7))[0].reshape(-1, 3)
    images = np.round((place - grid) / SIZE) * SIZE
    gaps = np.linalg.norm(place - grid - images, axis=1)
    order = np.argsort(gaps)
    # The nearest sample of each of the nearest patches.
    starts = order[np.sort(np.unique(order // 49, return_index=True)[1])][:4]
    return min(_to_patch(surface, complex.patch_placement[i // 49], place - images[i], i % 49) for i in starts.tolist())


def _to_patch(surface: str, placement: int, place: Floats, sample: int) -> float:
    family = SURFACES[surface]
    matrix, translation = family.cell.matrices[placement], family.cell.translations[placement] * QUARTER
    middle, reach = np.linspace(-1, 1, 7)[[sample // 7, sample % 7]], 1 / 3
    best = np.inf
    # Finer and finer grids round the nearest place.
    for _ in range(9):
        u, v = (np.clip(x + reach * np.linspace(-1, 1, 9), -1, 1) for x in middle)
        points = PARAMETERISATIONS["smooth"](u[:, np.newaxis], v[np.newaxis], family.family)[0]
        away = np.linalg.norm(points @ matrix.T + translation - place / (SIZE / 2), axis=-1)
        i, j = np.unravel_index(np.argmin(away), away.shape)
        best, middle, reach = float(away[i, j]), np.array([u[i], v[j]]), reach / 3
    return best * SIZE / 2


@pytest.mark.parametrize(("surface", "radius", "count"), [("diamond", sqrt(3) / 8, 8), ("primitive", sqrt(3) / 4, 1)])
def test_spheres_of_diamond_and_primitive_touch_the_flat_points_on_the_threefold_axes(
    surface: str, radius: float, count: int
) -> None:
    _, radii, channels = spheres(surface)
    assert radii == pytest.approx(radius * SIZE - WALL / 2, abs=FIT[surface] * SIZE)
    assert np.bincount(channels).tolist() == [count, count]


def test_the_gyroid_s_spheres_are_as_large_as_their_centres_are_far_from_the_exact_surface() -> None:
    centres, radii, channels = inscribed_spheres(Lattice((1, 1, 1), SIZE, WALL, fit=FitSettings(20)).fitted())
    assert np.bincount(channels).tolist() == [12, 12]
    # In the middle of the networks' edges, on twofold axes: multiples of an eighth of the cell.
    eighths = centres / (SIZE / 8)
    assert eighths == pytest.approx(np.round(eighths), abs=1e-3)
    for first in (0, 13):
        exact = exact_distance("gyroid", np.round(eighths[first]) * SIZE / 8)
        assert radii[first] + WALL / 2 == pytest.approx(exact, abs=1e-6 * SIZE)


def test_round_a_sphere_s_centre_the_exact_surface_is_nowhere_further_away() -> None:
    centres, _, _ = spheres()
    centre = np.round(centres[0] / (SIZE / 8)) * SIZE / 8
    furthest = exact_distance("gyroid", centre)
    random = np.random.default_rng(5)
    for direction in random.normal(size=(3, 3)):
        beside = centre + 0.3 * direction / np.linalg.norm(direction)
        assert exact_distance("gyroid", beside) < furthest


def test_the_labyrinths_of_a_gyroid_have_the_same_pores(gyroid: Pores) -> None:
    assert gyroid.channel_a is not None
    assert gyroid.channel_b is not None
    assert gyroid.channel_a.count == gyroid.channel_b.count == 12
    assert gyroid.channel_a.largest == pytest.approx(gyroid.channel_b.largest, rel=1e-6)
    assert gyroid.channel_a.smallest == pytest.approx(gyroid.channel_a.largest, rel=1e-6)


@pytest.mark.parametrize("wall", [0.3, 2.4])
def test_a_sphere_loses_on_each_side_what_half_the_wall_gains(wall: float) -> None:
    grown = spheres()[1].max() - spheres(wall=wall)[1].max()
    assert grown == pytest.approx((wall - WALL) / 2, abs=FIT["gyroid"] * SIZE)


def test_pores_scale_with_the_cell() -> None:
    assert spheres(wall=3 * WALL, size=3 * SIZE)[1].max() == pytest.approx(3 * spheres()[1].max(), rel=1e-6)


def test_faces_with_weights_have_the_pores_of_those_without() -> None:
    weights = tuple(tuple(1 + 0.1 * ((i * j) % 3) for j in (0, 1, 2, 3, 3, 2, 1, 0)) for i in (0, 1, 2, 3, 3, 2, 1, 0))
    found = [
        inscribed_spheres(Lattice((1, 1, 1), SIZE, WALL, fit=FitSettings(8, weights=some)).fitted())[1].max()
        for some in (None, weights)
    ]
    assert found[0] == pytest.approx(found[1], abs=1e-3)


def test_how_many_cells_there_are_does_not_matter_where_all_are_alike(gyroid: Pores) -> None:
    assert gyroid.beyond == "endless"
    assert pores_of(Lattice((1, 1, 1), SIZE, WALL).fitted()).sizes.as_dict() == gyroid.sizes.as_dict()


def test_what_is_no_wall_is_pore(gyroid: Pores) -> None:
    assert gyroid.porosity == pytest.approx(1 - Lattice((1, 1, 1), SIZE, WALL).volume_fraction, abs=0.01)


def test_no_pore_is_larger_than_the_largest_sphere_and_the_share_of_these_is_the_volume_they_take_up(
    gyroid: Pores,
) -> None:
    """The volume that 24 overlapping spheres take up together, by counting random places."""
    centres, radii, _ = spheres()
    assert gyroid.sizes.largest == pytest.approx(2 * radii.max(), rel=1e-9)
    places = np.random.default_rng(1).uniform(0, SIZE, (40_000, 3))
    apart = places[:, np.newaxis] - centres
    apart -= SIZE * np.round(apart / SIZE)
    held = np.mean(np.any(np.linalg.norm(apart, axis=-1) < radii, axis=1))
    largest_bin = gyroid.sizes.shares[-1]
    exact = held / (1 - Lattice((1, 1, 1), SIZE, WALL).volume_fraction)
    # Both are counted, on a grid and at random.
    assert largest_bin == pytest.approx(exact, abs=0.015)


def test_a_field_that_does_not_vary_leaves_the_pores_as_they_are(gyroid: Pores) -> None:
    lattice = Lattice((1, 1, 1), SIZE, "0.8 + 0*x", fit=FitSettings(8))
    found = pores_of(lattice.fitted())
    assert found.beyond == "continued"
    assert found.sizes.largest == pytest.approx(gyroid.sizes.largest, rel=2e-3)
    assert found.sizes.mean == pytest.approx(gyroid.sizes.mean, rel=0.02)


@pytest.fixture
def few_places(monkeypatch: pytest.MonkeyPatch) -> None:
    """Enough for the inscribed spheres, which are moved to where they are largest."""
    monkeypatch.setattr("gyroid_cad.report.pores._PLACES", 12_000)


@pytest.mark.usefixtures("few_places")
def test_a_wall_that_would_be_gone_beyond_the_lattice_stays_as_it_ends(gyroid: Pores) -> None:
    lattice = Lattice((1, 1, 1), SIZE, lambda x, y, z: np.where(z < 13.5, WALL, -1.0), fit=FitSettings(8))
    found = pores_of(lattice.fitted())
    assert found.beyond == "continued"
    assert found.sizes.largest == pytest.approx(gyroid.sizes.largest, rel=2e-3)


@pytest.mark.usefixtures("few_places")
def test_where_a_map_ends_near_the_lattice_its_sides_are_open() -> None:
    # Half a cell beneath the block the cylinder has no radius left.
    lattice = Lattice((1, 1, 1), SIZE, WALL, map="cylinder:radius=6", fit=FitSettings(8))
    assert pores_of(lattice.fitted()).beyond == "open"


def test_a_distribution_s_shares_are_of_the_weights() -> None:
    found = distribution_of([1.0, 2.0, 4.0], [1.0, 1.0, 2.0], bins=3)
    assert found.shares.tolist() == [0.25, 0.25, 0.5]
    assert (found.smallest, found.mean, found.largest) == (1.0, 2.75, 4.0)


def test_values_that_are_all_alike_have_a_distribution_too() -> None:
    found = distribution_of(np.full(5, 0.8))
    assert found.shares.sum() == pytest.approx(1.0)
    assert found.edges[0] < 0.8 < found.edges[-1]

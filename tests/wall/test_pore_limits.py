"""How large a sphere passes through a lattice's channels."""

from __future__ import annotations

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest
from scipy.spatial import cKDTree

from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.covering import AT_HOME, covering_complex
from gyroid_cad.wall.exact import patch_points_and_normals
from gyroid_cad.wall.pore_limits import _held, narrowest_opening, network_throats, pore_limiting_diameter

NAMES = tuple(SURFACES)
CLOSELY = FitSettings(16)


def opening(lattice: Lattice) -> float:
    return narrowest_opening(lattice.wall(), lattice.fitted().spec.grading, lattice.cells)


@pytest.mark.parametrize("name", NAMES)
def test_a_flood_over_a_grid_that_no_symmetry_knows_comes_to_the_same_throat_from_below(name: str) -> None:
    # Its nodes miss the throats, so it is held back too early, by less than half a step's diagonal.
    surface, radius = SURFACES[name], network_throats(SURFACES[name]).radius
    complex = covering_complex(np.full(3, -0.5), np.full(3, 1.5), AT_HOME, 1.0, 0.0, surface)
    places, normals = (a.reshape(-1, 3) for a in patch_points_and_normals(complex, 1.0, np.linspace(-1, 1, 25)))
    tree = cKDTree(places)
    for count in (12, 24):
        axis = (np.arange(count) + np.sqrt(2) - 1) / count
        nodes = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
        distance, nearest = tree.query(nodes)
        above = np.sum((nodes - places[nearest]) * normals[nearest], axis=1) > 0
        held = _held(np.where(above, distance, 0.0).reshape(3 * [count]))
        assert 0 < radius - held < np.sqrt(3) / 2 / count


@pytest.mark.parametrize("name", NAMES)
def test_the_throats_sphere_touches_the_exact_surface_all_round_and_goes_through_it_nowhere(name: str) -> None:
    # A throat is a saddle of the distance: the places it touches hold its centre between them.
    surface, pore_limits = SURFACES[name], network_throats(SURFACES[name])
    complex = covering_complex(np.full(3, -0.5), np.full(3, 1.5), AT_HOME, 1.0, 0.0, surface)
    places = patch_points_and_normals(complex, 1.0, np.linspace(-1, 1, 41))[0].reshape(-1, 3)
    tree = cKDTree(places)
    distance, _ = tree.query(pore_limits.centres)
    assert np.all(distance >= pore_limits.radius - 1e-12)
    assert distance == pytest.approx(pore_limits.radius, rel=2e-3)
    for centre in pore_limits.centres:
        touched = places[tree.query_ball_point(centre, pore_limits.radius * 1.003)] - centre
        assert np.linalg.norm(touched.mean(axis=0)) < 0.05 * pore_limits.radius


def test_the_gyroids_throat_reaches_as_far_as_its_flat_points_root_three_eighths_of_the_cell() -> None:
    assert network_throats(SURFACES["gyroid"]).radius == pytest.approx(np.sqrt(3) / 8, rel=1e-12)


@pytest.mark.parametrize(("name", "count"), [("gyroid", 8), ("diamond", 16), ("primitive", 3)])
def test_each_labyrinth_has_the_throats_of_its_net(name: str, count: int) -> None:
    # srs has eight nodes a cell, the diamond's net sixteen bonds, the simple cubic one three.
    above = network_throats(SURFACES[name]).above
    assert (np.sum(above), np.sum(~above)) == (count, count)


@pytest.mark.parametrize("name", NAMES)
@hypothesis.given(st.floats(0.1, 100.0), st.floats(0.01, 0.25))
@hypothesis.settings(max_examples=25)
def test_the_diameter_scales_with_the_lattice_and_falls_by_exactly_the_wall(
    name: str, size: float, part: float
) -> None:
    surface = SURFACES[name]
    free = pore_limiting_diameter(surface, size, 0.0)
    assert free == pytest.approx(size * pore_limiting_diameter(surface, 1.0, 0.0), rel=1e-14)
    assert pore_limiting_diameter(surface, size, part * size) == pytest.approx(free - part * size, rel=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_distances_to_the_fitted_faces_come_to_the_same_diameter(name: str) -> None:
    lattice = Lattice((1, 1, 1), 10.0, 0.9, surface=name, fit=CLOSELY)
    assert opening(lattice) == pytest.approx(pore_limiting_diameter(SURFACES[name], 10.0, 0.9), abs=1e-4)


def test_where_walls_vary_the_narrowest_throat_lies_by_the_thickest_ones() -> None:
    lattice = Lattice((2, 1, 1), 10.0, "0.5 + 0.05*x", fit=FitSettings(6), tolerance=1e-3)
    narrowest = opening(lattice)
    assert pore_limiting_diameter(SURFACES["gyroid"], 10.0, lattice.fitted().max_thickness) <= narrowest
    assert narrowest < pore_limiting_diameter(SURFACES["gyroid"], 10.0, 0.5 + 0.05 * 15)


def test_a_map_that_only_scales_space_scales_the_throat() -> None:
    lattice = Lattice((1, 1, 1), 10.0, 1.0, scale_field=1.3, fit=CLOSELY)
    assert opening(lattice) == pytest.approx(pore_limiting_diameter(SURFACES["gyroid"], 13.0, 1.0), abs=2e-4)

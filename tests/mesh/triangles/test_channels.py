"""How large a sphere gets out of a part, as its triangles tell."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.channels import way_out
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.pore_limits import pore_limiting_diameter


@pytest.mark.parametrize("surface", list(SURFACES))
@pytest.mark.parametrize("rotation", [(0.0, 0.0, 0.0), (20.0, 40.0, 10.0)], ids=["straight", "turned"])
def test_the_channels_of_a_lattice_are_as_wide_as_its_surface_says(
    surface: str, rotation: tuple[float, float, float]
) -> None:
    lattice = Lattice((2, 2, 2), 10.0, 1.0, surface=surface, fit=FitSettings(6), rotation=rotation)
    diameter, within = way_out(*indexed_triangles(lattice.triangles(0.1).triangulation))
    assert diameter == pytest.approx(pore_limiting_diameter(SURFACES[surface], 10.0, 1.0), abs=within)
    assert within < 1.5


@pytest.mark.parametrize("hole", [3.0, 6.0])
def test_a_hollow_drains_through_its_hole(hole: float) -> None:
    outer, inner = trimesh.creation.box([30, 30, 30]), trimesh.creation.box([24, 24, 24])
    drill = trimesh.creation.cylinder(hole / 2, 20, transform=trimesh.transformations.translation_matrix([0, 0, 15]))
    part = trimesh.boolean.difference([outer, inner, drill])
    diameter, within = way_out(part.vertices, part.faces)
    assert diameter == pytest.approx(hole, abs=within)


def test_a_hole_too_narrow_for_the_grid_is_told_as_none_that_passes() -> None:
    outer, inner = trimesh.creation.box([30, 30, 30]), trimesh.creation.box([24, 24, 24])
    drill = trimesh.creation.cylinder(0.3, 20, transform=trimesh.transformations.translation_matrix([0, 0, 15]))
    part = trimesh.boolean.difference([outer, inner, drill])
    diameter, within = way_out(part.vertices, part.faces)
    assert diameter == 0.0
    assert within > 0.6


@pytest.mark.parametrize(
    "part",
    [
        trimesh.creation.box([10, 10, 10]),
        trimesh.creation.icosphere(3, 10.0),
        trimesh.creation.cone(8, 15),
        trimesh.creation.torus(10.0, 3.0),
    ],
    ids=["box", "ball", "cone", "ring"],
)
def test_what_is_open_on_all_sides_has_no_hollow(part: trimesh.Trimesh) -> None:
    assert way_out(part.vertices, part.faces)[0] is None


def test_where_a_part_stands_does_not_matter() -> None:
    lattice = Lattice((1, 1, 1), 10.0, 1.0, fit=FitSettings(5))
    vertices, triangles = indexed_triangles(lattice.triangles(0.2).triangulation)
    moved = way_out(vertices + np.array([1e4, -1e4, 3e3]), triangles)
    assert moved == pytest.approx(way_out(vertices, triangles), abs=1e-3)

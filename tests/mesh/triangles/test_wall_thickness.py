"""How thick walls are, measured straight through triangles."""

from __future__ import annotations

import sys

import numpy as np
import pytest
import trimesh

from gyroid_cad.errors import GyroidError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.measures import measured_walls
from gyroid_cad.surface.fit import FitSettings

PLACES = 400


def test_a_plate_is_as_thick_as_it_is_made() -> None:
    plate = trimesh.creation.box([30, 20, 1.25])
    walls = measured_walls(plate.vertices, plate.faces, PLACES)
    assert len(walls) == PLACES
    assert walls[0] == pytest.approx(1.25, rel=1e-4)
    assert walls[-1] in (pytest.approx(20, rel=1e-4), pytest.approx(30, rel=1e-4))


def test_a_hollow_ball_is_as_thick_as_what_is_left_between_its_two_surfaces() -> None:
    outer, inner = trimesh.creation.icosphere(4, 10.0), trimesh.creation.icosphere(4, 9.0)
    inner.invert()
    both = trimesh.util.concatenate([outer, inner])
    walls = measured_walls(both.vertices, both.faces, PLACES)
    # From the inner surface rays go outwards through the same wall.
    assert walls[0] == pytest.approx(1.0, rel=0.02)
    assert walls[len(walls) // 2] == pytest.approx(1.0, rel=0.02)


def test_the_edge_of_a_wedge_is_no_wall() -> None:
    wedge = trimesh.creation.extrude_triangulation([[0, 0], [10, 0], [0, 10]], [[0, 1, 2]], 8.0)
    walls = measured_walls(wedge.vertices, wedge.faces, 2000)
    # Of the 45 degree edge only the two ends, eight apart, face away from each other.
    assert walls == pytest.approx(8.0, rel=1e-4)


@pytest.mark.parametrize("angle", [16, 25, 40])
def test_where_a_plate_runs_out_to_an_edge_its_wall_is_that_of_the_plate(angle: float) -> None:
    out = 1.5 / np.tan(np.radians(angle))
    profile = [[0, 0], [10 + out, 0], [10, 1.5], [0, 1.5]]
    plate = trimesh.creation.extrude_triangulation(profile, [[0, 1, 2], [0, 2, 3]], 30.0)
    walls = measured_walls(plate.vertices, plate.faces, 2000)
    assert walls[0] == pytest.approx(1.5, rel=1e-3)


def test_a_blade_is_thin_for_its_own_sake() -> None:
    blade = trimesh.creation.extrude_triangulation([[0, 0], [30, 0], [0, 3]], [[0, 1, 2]], 30.0)
    assert measured_walls(blade.vertices, blade.faces, 2000)[0] < 0.1


@pytest.mark.parametrize("surface", ["gyroid", "diamond", "primitive"])
def test_the_walls_of_a_lattice_are_measured_as_they_were_asked_for(surface: str) -> None:
    lattice = Lattice((1, 1, 1), 10.0, 0.9, surface=surface, fit=FitSettings(8))
    walls = measured_walls(*indexed_triangles(lattice.triangles(0.01).triangulation), 1500)
    assert walls[0] == pytest.approx(0.9, rel=0.02)
    assert walls[len(walls) // 2] == pytest.approx(0.9, rel=0.005)


def test_without_vtk_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "vtkmodules.vtkCommonCore", None)
    plate = trimesh.creation.box([3, 2, 1])
    with pytest.raises(GyroidError, match="pip install vtk"):
        measured_walls(plate.vertices, plate.faces, 10)

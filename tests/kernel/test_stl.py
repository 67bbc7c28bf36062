"""STL: closed meshes, as near the solid as asked for."""

from __future__ import annotations

import struct
from collections.abc import Callable
from contextlib import AbstractContextManager
from math import inf, nan
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location
from scipy.spatial import cKDTree

from gyroid_cad.common.formats import DEFAULT_ANGLE, require_meshing
from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.kernel.check import enclosed_volume
from gyroid_cad.kernel.stl import meshed as triangles_of
from gyroid_cad.kernel.stl import write_meshed_stl
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.offset import SIDES

Floats = NDArray[np.float64]

LOOSE_ANGLE = 80.0


@pytest.fixture(scope="module")
def fine_cell() -> Lattice:
    return Lattice((1, 1, 1), 10.0, 0.8)


def meshed(lattice: Lattice, folder: Path, deviation: float, angle: float = DEFAULT_ANGLE) -> trimesh.Trimesh:
    path = folder / "part.stl"
    write_meshed_stl(lattice.solid(), path, deviation, angle)
    return trimesh.load_mesh(path)


def distances_to_facets(lattice: Lattice, mesh: trimesh.Trimesh, neighbours: int = 60) -> Floats:
    """From points all over the wall's two faces to the nearest facet, among the nearest few by their centres."""
    wall, along = lattice.wall(), np.linspace(-1, 1, 9)
    shifts = wall.shifts[wall.patch_shift]
    points = np.concatenate(
        [
            wall.face(net, side).evaluate(along[:, np.newaxis], along).reshape(-1, 3) + shift
            for net, shift in zip(wall.patch_net, shifts, strict=True)
            for side in SIDES
        ]
    )
    _, nearest = cKDTree(mesh.triangles_center).query(points, k=neighbours)
    closest = [trimesh.triangles.closest_point(mesh.triangles[facets], points) for facets in nearest.T]
    return np.asarray(np.min(np.linalg.norm(np.array(closest) - points, axis=-1), axis=0))


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 2, 1), (2, 2, 2)])
def test_the_mesh_is_closed_and_consistent_though_the_wall_touches_itself_in_lines(
    cells: tuple[int, int, int], tmp_path: Path
) -> None:
    lattice = Lattice(cells, 10.0, 0.8, fit=FitSettings(5))
    complex = lattice.wall().complex
    assert complex.non_manifold_edges > 0
    mesh = meshed(lattice, tmp_path, 0.1)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.euler_number == 2 * (complex.fan_count - complex.edge_count + complex.patch_count)


@pytest.mark.parametrize("thickness", [0.01, 3.7])
def test_the_thinnest_and_the_thickest_walls_give_closed_meshes(thickness: float, tmp_path: Path) -> None:
    mesh = meshed(Lattice((2, 1, 1), 10.0, thickness, fit=FitSettings(5)), tmp_path, 0.1)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent


def test_a_mesh_far_from_the_origin_is_closed_though_stl_counts_in_single_precision(tmp_path: Path) -> None:
    """What parts the touching triangles must be larger than what single precision can tell apart there."""
    lattice, move = Lattice((2, 1, 1), 10.0, 0.8, fit=FitSettings(5)), gp_Trsf()
    move.SetTranslation(gp_Vec(20_000, -26_000, 14_000))
    write_meshed_stl(lattice.solid().Moved(TopLoc_Location(move)), tmp_path / "far.stl", 0.02)
    mesh = trimesh.load_mesh(tmp_path / "far.stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == meshed(lattice, tmp_path, 0.1).euler_number


def test_no_point_of_the_wall_is_further_from_a_facet_than_the_deviation(fine_cell: Lattice, tmp_path: Path) -> None:
    deviations = np.array([0.2, 0.1, 0.05, 0.025, 0.0125])
    mean = []
    for deviation in deviations.tolist():
        distances = distances_to_facets(fine_cell, meshed(fine_cell, tmp_path, deviation, LOOSE_ANGLE))
        assert np.max(distances) <= deviation
        mean.append(np.mean(distances))
    order = np.polyfit(np.log(deviations), np.log(mean), 1)[0]
    assert order == pytest.approx(1, abs=0.3)


def test_the_mesh_encloses_the_solids_volume_to_the_deviation_times_its_area(
    fine_cell: Lattice, tmp_path: Path
) -> None:
    volume = enclosed_volume(fine_cell.solid())
    for deviation in (0.1, 0.02):
        mesh = meshed(fine_cell, tmp_path, deviation)
        assert abs(mesh.volume - volume) < deviation * mesh.area
    assert meshed(fine_cell, tmp_path, 0.01).volume == pytest.approx(volume, rel=1e-3)


def test_a_smaller_angle_makes_more_and_smaller_facets(fine_cell: Lattice, tmp_path: Path) -> None:
    loose, tight = (meshed(fine_cell, tmp_path, 1.0, angle) for angle in (40.0, 10.0))
    assert len(tight.faces) > 2 * len(loose.faces)
    assert np.max(distances_to_facets(fine_cell, tight)) < np.max(distances_to_facets(fine_cell, loose))


def test_the_mesh_fills_the_lattices_bounding_box(fine_cell: Lattice, tmp_path: Path) -> None:
    deviation = 0.05
    mesh = meshed(fine_cell, tmp_path, deviation)
    low, high = map(np.array, fine_cell.bounding_box())
    single_precision = 1e-5
    assert np.all(mesh.bounds[0] >= low - single_precision)
    assert np.all(mesh.bounds[1] <= high + single_precision)
    np.testing.assert_allclose(mesh.bounds, [low, high], atol=deviation)


def test_the_triangles_as_arrays_are_those_of_the_file_with_their_corners_numbered(
    fine_cell: Lattice, tmp_path: Path
) -> None:
    file = meshed(fine_cell, tmp_path, 0.1)
    vertices, triangles = triangles_of(fine_cell.solid(), tmp_path / "part.3mf", 0.1)
    arrays = trimesh.Trimesh(vertices, triangles, process=False)
    assert len(np.unique(vertices, axis=0)) == len(vertices)
    assert arrays.is_watertight
    assert arrays.is_winding_consistent
    assert len(triangles) == len(file.faces)
    assert arrays.volume == pytest.approx(file.volume, rel=1e-6)


def test_meshing_leaves_the_solid_without_triangles(fine_cell: Lattice, tmp_path: Path) -> None:
    solid = fine_cell.solid()
    write_meshed_stl(solid, tmp_path / "part.stl", 0.1)
    assert not BRepTools.Triangulation_s(solid, 1e9)


def test_the_file_is_binary_and_its_normals_follow_the_right_hand_rule(fine_cell: Lattice, tmp_path: Path) -> None:
    write_meshed_stl(fine_cell.solid(), tmp_path / "part.stl", 0.1)
    data = (tmp_path / "part.stl").read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    assert len(data) == 84 + 50 * count
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    facets = np.frombuffer(data, record, count, 84)
    corners = facets["corners"].astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.linalg.norm(cross, axis=1)
    large = area > 1e-3
    cosine = np.sum(cross * facets["normal"], axis=1)[large] / area[large]
    assert np.mean(large) > 0.9
    np.testing.assert_allclose(cosine, 1, atol=1e-3)


@pytest.mark.parametrize("deviation", [0.0, -1.0, nan, inf])
def test_a_deviation_that_is_no_length_is_refused_and_writes_nothing(
    fine_cell: Lattice, tmp_path: Path, deviation: float
) -> None:
    with pytest.raises(ParameterError, match=rf"deviation = {deviation}: expected a length above 0 mm"):
        write_meshed_stl(fine_cell.solid(), tmp_path / "part.stl", deviation)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("angle", [0.0, -15.0, 90.0, nan, inf])
def test_an_angle_no_facets_could_keep_to_is_refused(angle: float) -> None:
    with pytest.raises(ParameterError, match=rf"angle = {angle}: expected 0.1 or more and below 90 degrees"):
        require_meshing(0.1, angle)


def test_a_disk_that_fills_up_leaves_the_older_file_and_nothing_else(
    cell: Lattice, tmp_path: Path, disk_full: Callable[[int], AbstractContextManager[None]]
) -> None:
    path = tmp_path / "part.stl"
    path.write_text("older")
    with disk_full(10_000), pytest.raises(ExportError, match=r"part\.stl was not written"):
        write_meshed_stl(cell.solid(), path, 0.1)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]

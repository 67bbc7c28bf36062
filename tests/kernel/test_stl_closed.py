"""Triangles of the kernel's mesher are looked at before they are a file: none that is open takes its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere

from gyroid_cad import ExportError, IslandsWarning, Lattice
from gyroid_cad.kernel.stl import meshed, write_meshed_stl
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures, unmatched_edges
from gyroid_cad.surface.fit import FitSettings

STEEP = 80.0


@pytest.fixture(scope="module")
def thin() -> Lattice:
    """A thin wall, cut to its cell, that the kernel meshes with gaps where triangles may be larger than it is thick."""
    return Lattice((1, 1, 1), 10, density=0.05, surface="primitive", trim="box", fit=FitSettings(6))


@pytest.fixture(scope="module")
def solid(thin: Lattice) -> Any:
    with pytest.warns(IslandsWarning):
        return thin.solid()


@pytest.mark.parametrize("name", ["thin.stl", "thin.3mf"])
@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
def test_what_the_mesher_leaves_open_is_meshed_more_finely(
    thin: Lattice, solid: Any, name: str, tmp_path: Path
) -> None:
    wall = thin.wall_thickness
    assert unmatched_edges(meshed(solid, "", wall, STEEP)[1]) > 0
    thin.write(tmp_path / name, deviation=wall, angle=STEEP)
    found = triangle_measures(*read_triangles(tmp_path / name))
    assert (found.open_edges, found.manifold) == (0, True)


def test_what_stays_open_is_not_written_and_leaves_the_older_file(thin: Lattice, solid: Any, tmp_path: Path) -> None:
    (tmp_path / "thin.stl").write_bytes(b"older")
    with pytest.raises(ExportError, match=r"thin\.stl was not written: with deviation = 2\.13.* another deviation"):
        write_meshed_stl(solid, tmp_path / "thin.stl", 10 * thin.wall_thickness, STEEP)
    assert (tmp_path / "thin.stl").read_bytes() == b"older"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "shape", [BRepPrimAPI_MakeSphere(5).Shape(), BRepPrimAPI_MakeCone(4, 0, 6).Shape()], ids=["ball", "cone"]
)
def test_a_pole_leaves_no_triangle_without_area_in_the_file(shape: Any, tmp_path: Path) -> None:
    write_meshed_stl(shape, tmp_path / "a.stl", 0.01)
    mesh = trimesh.load(tmp_path / "a.stl", process=False)
    assert np.all(mesh.area_faces > 0)
    assert trimesh.load(tmp_path / "a.stl").is_watertight

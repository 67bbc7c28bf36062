"""Triangles of trimmed solids are closed, and looked at before they are a file: none that is open takes its name."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCone, BRepPrimAPI_MakeSphere
from OCP.TopAbs import TopAbs_FACE

from gyroid_cad import ExportError, IslandsWarning, Lattice
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.stl import write_meshed_stl
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
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


@pytest.mark.parametrize("walls", [0.5, 2.0, 10.0])
def test_a_thin_trimmed_wall_is_closed_however_large_its_triangles_may_be(
    thin: Lattice, solid: Any, walls: float, tmp_path: Path
) -> None:
    """The kernel's mesher left it open at all of these."""
    write_meshed_stl(solid, tmp_path / "thin.stl", walls * thin.wall_thickness, STEEP)
    found = triangle_measures(*read_triangles(tmp_path / "thin.stl"))
    assert (found.open_edges, found.manifold) == (0, True)


def test_what_is_open_is_not_written_and_leaves_the_older_file(solid: Any, tmp_path: Path) -> None:
    (tmp_path / "open.stl").write_bytes(b"older")
    faces = compound_of(list(parts_of(solid, TopAbs_FACE))[1:])
    with pytest.raises(ExportError, match=r"open\.stl was not written: with deviation = 0\.1 .*--route triangles"):
        write_meshed_stl(faces, tmp_path / "open.stl", 0.1, STEEP)
    assert (tmp_path / "open.stl").read_bytes() == b"older"
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize(
    "shape", [BRepPrimAPI_MakeSphere(5).Shape(), BRepPrimAPI_MakeCone(4, 0, 6).Shape()], ids=["ball", "cone"]
)
def test_a_pole_leaves_no_triangle_without_area_in_the_file(shape: Any, tmp_path: Path) -> None:
    write_meshed_stl(shape, tmp_path / "a.stl", 0.01)
    mesh = trimesh.load(tmp_path / "a.stl", process=False)
    assert np.all(mesh.area_faces > 0)
    assert trimesh.load(tmp_path / "a.stl").is_watertight

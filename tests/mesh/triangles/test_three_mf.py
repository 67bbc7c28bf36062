"""3MF: read back by lib3mf, and by hand from the XML in the package."""

from __future__ import annotations

import importlib.util
import re
import zipfile
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from xml.etree import ElementTree

import lib3mf
import numpy as np
import pytest
import trimesh

from gyroid_cad.errors import ExportError
from gyroid_cad.fields.makers import linear
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.triangulation import Triangulation, triangulated
from gyroid_cad.mesh.triangles.writing import write_3mf
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(5)
CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"


def alike() -> Triangulation:
    return triangulated(Lattice((2, 2, 1), 10, 0.8, fit=COARSE).wall(), 0.1)


def graded() -> Triangulation:
    return triangulated(Lattice((2, 1, 1), 10, linear(0.5, x=0.12), fit=COARSE, tolerance=1e-2).wall(), 0.1)


SUBJECTS = pytest.mark.parametrize("made", [alike, graded])


@SUBJECTS
def test_lib3mf_reads_the_same_closed_mesh_in_millimetres(made: Callable[[], Triangulation], tmp_path: Path) -> None:
    vertices, triangles = indexed_triangles(made())
    write_3mf(vertices, triangles, tmp_path / "part.3mf")
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(tmp_path / "part.3mf"))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    objects = model.GetMeshObjects()
    assert objects.MoveNext()
    mesh = objects.GetCurrentMeshObject()
    assert not objects.MoveNext()
    assert mesh.IsManifoldAndOriented()
    read = np.array([tuple(vertex.Coordinates) for vertex in mesh.GetVertices()])
    np.testing.assert_allclose(read, vertices, rtol=3e-7, atol=1e-6)
    assert np.array_equal([tuple(facet.Indices) for facet in mesh.GetTriangleIndices()], triangles)


@SUBJECTS
def test_the_xml_in_the_package_is_the_mesh_too(made: Callable[[], Triangulation], tmp_path: Path) -> None:
    """What any slicer reads, by the core specification: no library of ours or of the consortium in between."""
    triangulation = made()
    complex = triangulation.wall.complex
    write_3mf(*indexed_triangles(triangulation), tmp_path / "part.3mf")
    with zipfile.ZipFile(tmp_path / "part.3mf") as package:
        model = ElementTree.fromstring(package.read("3D/3dmodel.model"))
    assert model.get("unit") == "millimeter"
    vertices = [[float(node.get(k, "")) for k in "xyz"] for node in model.iter(f"{CORE}vertex")]
    triangles = [[int(node.get(k, "")) for k in ("v1", "v2", "v3")] for node in model.iter(f"{CORE}triangle")]
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert len(triangles) == triangulation.triangle_count
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.euler_number == 2 * (complex.fan_count - complex.edge_count + complex.patch_count)
    assert mesh.volume == pytest.approx(triangulation.volume, rel=1e-5)
    assert len(list(model.iter(f"{CORE}item"))) == 1


@pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ("networkx", "lxml")),
    reason="trimesh reads 3MF with the help of networkx and lxml",
)
def test_trimesh_reads_it_closed(tmp_path: Path) -> None:
    triangulation = alike()
    write_3mf(*indexed_triangles(triangulation), tmp_path / "part.3mf")
    mesh = trimesh.load(tmp_path / "part.3mf", force="mesh")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(triangulation.volume, rel=1e-5)


def test_a_mesh_that_is_not_closed_is_refused(tmp_path: Path) -> None:
    vertices, triangles = indexed_triangles(alike())
    for wrong in (triangles[1:], np.concatenate([triangles[:1, ::-1], triangles[1:]])):
        with pytest.raises(ExportError, match="not closed and oriented"):
            write_3mf(vertices, wrong, tmp_path / "part.3mf")
    assert not list(tmp_path.iterdir())


def test_a_disk_that_fills_up_leaves_the_older_file_and_nothing_else(
    tmp_path: Path, disk_full: Callable[[int], AbstractContextManager[None]]
) -> None:
    path = tmp_path / "part.3mf"
    path.write_text("older")
    with disk_full(10_000), pytest.raises(ExportError, match=r"part\.3mf was not written"):
        write_3mf(*indexed_triangles(alike()), path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


def test_a_trimmed_lattice_is_written_from_the_triangles_of_its_faces(tmp_path: Path) -> None:
    lattice = Lattice((1, 1, 1), 10, 0.8, fit=COARSE, trim="box")
    lattice.write(tmp_path / "part.3mf", deviation=0.05)
    with zipfile.ZipFile(tmp_path / "part.3mf") as package:
        model = ElementTree.fromstring(package.read("3D/3dmodel.model"))
    vertices = np.array([[float(node.get(k, "")) for k in "xyz"] for node in model.iter(f"{CORE}vertex")])
    triangles = [[int(node.get(k, "")) for k in ("v1", "v2", "v3")] for node in model.iter(f"{CORE}triangle")]
    mesh = trimesh.Trimesh(vertices, triangles, process=False)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(lattice.report().volume, rel=1e-3)
    np.testing.assert_allclose([vertices.min(axis=0), vertices.max(axis=0)], [[0, 0, 0], [10, 10, 10]], atol=1e-5)


@SUBJECTS
def test_the_same_mesh_makes_the_same_file_and_another_one_has_other_identities(
    made: Callable[[], Triangulation], tmp_path: Path
) -> None:
    vertices, triangles = indexed_triangles(made())
    paths = [tmp_path / name for name in ("a.3mf", "b.3mf", "c.3mf")]
    for path, scale in zip(paths, (1, 1, 2), strict=True):
        write_3mf(scale * vertices, triangles, path)
    assert paths[0].read_bytes() == paths[1].read_bytes()
    identities = [
        re.findall(r'UUID="([^"]+)"', zipfile.ZipFile(path).read("3D/3dmodel.model").decode()) for path in paths[1:]
    ]
    assert len(set(identities[0])) == len(identities[0]) == 3
    assert set(identities[0]).isdisjoint(identities[1])

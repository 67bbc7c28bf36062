"""Meshes written, and read back by programs and libraries that know nothing of ours."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gyroid_cad import Lattice
from gyroid_cad.common.formats import MESH_FORMATS, listed_endings
from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.mesh.finite_elements.files import require_mesh_format
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh
from gyroid_cad.surface.fit import FitSettings

LATTICE = Lattice((1, 1, 1), 10.0, 0.9, fit=FitSettings(6))
LINEAR = LATTICE.hexahedra(2, 2)
QUADRATIC = LATTICE.hexahedra(2, 1, 2)
FULL = LATTICE.hexahedra(2, 1, 2, full=True)
SURFACE = LATTICE.quadrilaterals(2)
CURVED_SURFACE = LATTICE.quadrilaterals(2, order=2)
SOLIDS = {"hexahedron": LINEAR, "hexahedron20": QUADRATIC, "hexahedron27": FULL}
EVERY = {**SOLIDS, "quad": SURFACE, "quad8": CURVED_SURFACE}


def written(mesh: Mesh, folder: Path, ending: str) -> Path:
    path = folder / f"mesh{ending}"
    mesh.write(path, pairs=LATTICE.periodic_pairs(mesh) if mesh.layers else None)
    assert [file.name for file in folder.iterdir()] == [path.name]
    return path


@pytest.mark.parametrize("name", EVERY)
def test_vtk_reads_vtu_with_the_same_points_cells_and_arrays(name: str, tmp_path: Path) -> None:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    mesh = EVERY[name]
    reader = vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(written(mesh, tmp_path, ".vtu")))
    reader.Update()
    grid = reader.GetOutput()
    np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), mesh.points)
    np.testing.assert_array_equal(
        vtk_to_numpy(grid.GetCells().GetConnectivityArray()).reshape(mesh.cells.shape), mesh.cells
    )
    patch = vtk_to_numpy(grid.GetCellData().GetArray("patch"))
    np.testing.assert_array_equal(patch, mesh.element_patch + 1)
    assert set(vtk_to_numpy(grid.GetCellData().GetArray("bounding_cell"))) == {1, 2, 3, 4}
    for set_name, nodes in mesh.node_sets().items():
        flags = vtk_to_numpy(grid.GetPointData().GetArray(set_name.lower()))
        np.testing.assert_array_equal(np.flatnonzero(flags), nodes)
    if mesh.layers:
        first = vtk_to_numpy(grid.GetPointData().GetArray("periodic_first"))
        pairs = LATTICE.periodic_pairs(mesh)
        np.testing.assert_array_equal(np.flatnonzero(first != np.arange(len(first))), np.sort(pairs.second))


@pytest.fixture(scope="module")
def gmsh() -> Any:
    try:
        import gmsh as module
    except (ImportError, OSError) as problem:
        pytest.skip(f"Gmsh's library cannot be loaded: {problem}")
    module.initialize(interruptible=False)
    module.option.setNumber("General.Verbosity", 1)
    yield module
    module.finalize()


def volume_by_gmsh(gmsh: Any, path: Path) -> float:
    gmsh.open(str(path))
    volume = 0.0
    for kind in gmsh.model.mesh.getElementTypes(3):
        places, weights = gmsh.model.mesh.getIntegrationPoints(kind, "Gauss6")
        determinants = np.array(gmsh.model.mesh.getJacobians(kind, places)[1]).reshape(-1, len(weights))
        assert determinants.min() > 0
        volume += float((determinants @ weights).sum())
    return volume


@pytest.mark.parametrize("name", SOLIDS)
def test_gmsh_integrates_the_wall_s_volume_and_knows_its_groups(gmsh: Any, name: str, tmp_path: Path) -> None:
    volume = volume_by_gmsh(gmsh, written(SOLIDS[name], tmp_path, ".msh"))
    assert volume == pytest.approx(LATTICE.exact_volume, rel=0.1 if name == "hexahedron" else 2e-3)
    names = {gmsh.model.getPhysicalName(*group): group for group in gmsh.model.getPhysicalGroups()}
    assert {name: group[0] for name, group in names.items()} == {"WALL": 3, "FACE_A": 2, "FACE_B": 2, "FREE_WALLS": 2}
    for group_name, nodes in SOLIDS[name].node_sets().items():
        tags = gmsh.model.mesh.getNodesForPhysicalGroup(*names[group_name])[0]
        np.testing.assert_array_equal(np.unique(tags) - 1, nodes)
    gmsh.clear()


def test_quadratic_meshes_come_nearer_to_the_tube_formula_at_fourth_order(gmsh: Any, tmp_path: Path) -> None:
    fine = Lattice((1, 1, 1), 10.0, 0.9)
    errors = []
    for n in (2, 4, 8):
        fine.hexahedra(n, 1, 2).write(tmp_path / f"{n}.msh")
        errors.append(abs(volume_by_gmsh(gmsh, tmp_path / f"{n}.msh") / fine.exact_volume - 1))
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3.5)


@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20", "quad", "quad8"])
def test_pynastran_reads_nastran_decks(name: str, tmp_path: Path) -> None:
    bdf = pytest.importorskip("pyNastran.bdf.bdf")
    mesh = EVERY[name]
    model = bdf.read_bdf(str(written(mesh, tmp_path, ".bdf")), xref=False, debug=False)
    points = np.array([model.nodes[number].xyz for number in sorted(model.nodes)])
    np.testing.assert_allclose(points, mesh.points, atol=1e-8)
    card = {"hexahedron": "CHEXA8", "hexahedron20": "CHEXA20", "quad": "CQUAD4", "quad8": "CQUAD8"}[name]
    assert {type(element).__name__ for element in model.elements.values()} == {card}
    nodes = np.array([model.elements[number].nodes for number in sorted(model.elements)]) - 1
    corners = 4 if name.startswith("quad") else 8
    np.testing.assert_array_equal(nodes[:, :corners], mesh.cells[:, :corners])
    if name == "hexahedron20":
        # NASTRAN has the middles of the upright edges before those of the top.
        np.testing.assert_array_equal(nodes[:, 12:16], mesh.cells[:, 16:])
        np.testing.assert_array_equal(nodes[:, 16:], mesh.cells[:, 12:16])
    assert {element.pid for element in model.elements.values()} == {1, 2, 3, 4}


@pytest.mark.parametrize("size", [0.02, 10.0, 5e4])
def test_nastran_numbers_keep_ten_digits_whatever_the_scale(size: float, tmp_path: Path) -> None:
    bdf = pytest.importorskip("pyNastran.bdf.bdf")
    mesh = Lattice((1, 1, 1), size, size / 10, fit=FitSettings(6)).hexahedra(2)
    mesh.write(tmp_path / "a.nas")
    model = bdf.read_bdf(str(tmp_path / "a.nas"), xref=False, debug=False)
    points = np.array([model.nodes[number].xyz for number in sorted(model.nodes)])
    np.testing.assert_allclose(points, mesh.points, atol=1e-9 * size)


@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20", "quad"])
def test_an_ansys_archive_reader_finds_nodes_elements_and_components(name: str, tmp_path: Path) -> None:
    reader = pytest.importorskip("ansys.mapdl.reader")
    mesh = EVERY[name]
    archive = reader.Archive(str(written(mesh, tmp_path, ".cdb")))
    np.testing.assert_allclose(archive.nodes, mesh.points, atol=1e-10)
    elements = np.array(archive.elem)[:, 10 : 10 + mesh.cells.shape[1]]
    if name != "quad":
        np.testing.assert_array_equal(elements - 1, mesh.cells)
    types = {"hexahedron": 185, "hexahedron20": 186, "quad": 181}
    assert {kind[1] for kind in archive.ekey.tolist()} >= {types[name]}
    for set_name, nodes in mesh.node_sets().items():
        np.testing.assert_array_equal(np.array(archive.node_components[set_name]) - 1, nodes)
    for set_name, numbers in mesh.element_sets().items():
        np.testing.assert_array_equal(np.array(archive.element_components[set_name]) - 1, numbers)


@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20", "quad", "quad8"])
def test_meshio_reads_abaqus_input_with_every_set(name: str, tmp_path: Path) -> None:
    import meshio

    mesh = EVERY[name]
    read = meshio.read(written(mesh, tmp_path, ".inp"))
    np.testing.assert_allclose(read.points, mesh.points, atol=1e-11)
    (block,) = read.cells
    assert block.type == name
    np.testing.assert_array_equal(block.data, mesh.cells)
    for set_name, nodes in mesh.node_sets().items():
        np.testing.assert_array_equal(np.sort(read.point_sets[set_name]), nodes)
    for set_name, elements in mesh.element_sets().items():
        np.testing.assert_array_equal(np.sort(read.cell_sets[set_name][0]), elements)
    if mesh.layers:
        pairs = LATTICE.periodic_pairs(mesh).by_translation()
        first, second = pairs[0, 0, 1]
        np.testing.assert_array_equal(read.point_sets["PERIODIC_0_0_1_FIRST"], first)
        np.testing.assert_array_equal(read.point_sets["PERIODIC_0_0_1_SECOND"], second)


@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20"])
def test_abaqus_lines_have_16_numbers_and_numbers_20_characters_at_most(name: str, tmp_path: Path) -> None:
    for line in written(EVERY[name], tmp_path, ".inp").read_text().splitlines():
        if not line.startswith("*"):
            words = line.rstrip(",").split(",")
            assert len(words) <= 16
            assert max(map(len, words)) <= 20


def test_the_elements_abaqus_knows_are_named_as_asked_for(tmp_path: Path) -> None:
    for name, kind in (("hexahedron", "C3D8"), ("hexahedron20", "C3D20R")):
        text = written(EVERY[name], tmp_path, ".inp").read_text()
        assert f"*ELEMENT, TYPE={kind}, ELSET=WALL\n" in text
        assert "*SURFACE, NAME=FACE_A, TYPE=ELEMENT\nFACE_A_S2, S2\n" in text


@pytest.mark.parametrize("path", ["mesh.stl", "mesh", "mesh.vtk", "mesh.INP.txt"])
def test_an_unknown_ending_is_refused_with_those_known(path: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=re.escape(listed_endings(MESH_FORMATS))):
        LINEAR.write(tmp_path / path)
    assert not list(tmp_path.iterdir())


def test_endings_in_capitals_are_known(tmp_path: Path) -> None:
    LINEAR.write(tmp_path / "MESH.INP")


@pytest.mark.parametrize("ending", [".inp", ".cdb", ".bdf", ".nas"])
def test_elements_of_27_nodes_are_refused_where_the_format_has_none(ending: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=rf"full = True: expected none in \{ending} files"):
        FULL.write(tmp_path / f"mesh{ending}")
    assert not list(tmp_path.iterdir())


def test_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="existing folder"):
        LINEAR.write(tmp_path / "none" / "mesh.inp")


@pytest.mark.parametrize("ending", [ending for form in MESH_FORMATS for ending in form.endings])
def test_a_full_disk_leaves_the_older_file_as_it_was(
    ending: str, tmp_path: Path, disk_full: Callable[[int], Any]
) -> None:
    path = tmp_path / f"mesh{ending}"
    path.write_text("older")
    with disk_full(1000), pytest.raises(ExportError, match="was not written"):
        LINEAR.write(path)
    assert path.read_text() == "older"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_without_mapdl_archive_cdb_is_refused_with_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "mapdl_archive", None)
    with pytest.raises(ParameterError, match=r"pip install 'gyroid_cad\[ansys\]'"):
        require_mesh_format(tmp_path / "mesh.cdb")

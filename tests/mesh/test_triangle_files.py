"""STL and 3MF files read back: the triangles that were written, whatever wrote them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gyroid_cad.errors import ExportError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangle_files import ReadTriangles, read_triangles, triangle_measures

CUBE = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    made = tmp_path_factory.mktemp("triangles")
    Lattice((1, 1, 1), 10.0, 0.8).write(made / "a.stl", made / "a.3mf", deviation=0.05)
    return made


@pytest.mark.parametrize("name", ["a.stl", "a.3mf"])
def test_a_lattice_is_read_back_with_its_triangles_volume_and_no_open_edge(folder: Path, name: str) -> None:
    report = Lattice((1, 1, 1), 10.0, 0.8).triangle_report(0.05)
    found = triangle_measures(read_triangles(folder / name))
    assert found.triangles == report.triangles
    assert found.volume == pytest.approx(report.volume, rel=1e-6)
    assert (found.closed, found.manifold, found.open_edges, found.pieces) == (True, True, 0, 1)


@pytest.mark.parametrize("ascii_text", [True, False])
def test_stl_by_another_program_is_read_as_text_and_as_bytes(tmp_path: Path, ascii_text: bool) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box(extents=(1, 2, 3))
    box.export(tmp_path / "box.stl", file_type="stl_ascii" if ascii_text else "stl")
    found = triangle_measures(read_triangles(tmp_path / "box.stl"))
    assert (found.triangles, found.vertices) == (12, 8)
    assert (found.volume, found.area) == (pytest.approx(6), pytest.approx(22))


def test_a_3mf_s_units_and_placements_are_those_of_what_is_built(folder: Path, tmp_path: Path) -> None:
    import lib3mf

    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.QueryReader("3mf").ReadFromFile(str(folder / "a.3mf"))
    model.SetUnit(lib3mf.ModelUnit.Inch)
    meshes = model.GetMeshObjects()
    meshes.MoveNext()
    model.AddBuildItem(meshes.GetCurrentMeshObject(), wrapper.GetTranslationTransform(100, 0, 0))
    # To a file the library writes in a locale of its own, and leaves the process in it.
    (tmp_path / "inches.3mf").write_bytes(bytes(model.QueryWriter("3mf").WriteToBuffer()))
    one, read = (triangle_measures(read_triangles(path)) for path in (folder / "a.3mf", tmp_path / "inches.3mf"))
    assert read.pieces == 2
    assert read_triangles(tmp_path / "inches.3mf").objects == 2
    assert read.volume == pytest.approx(2 * 25.4**3 * one.volume, rel=1e-5)
    assert read.high[0] - one.high[0] * 25.4 == pytest.approx(2540, rel=1e-5)


def test_a_cube_without_a_triangle_has_three_open_edges_and_no_inside() -> None:
    whole = triangle_measures(ReadTriangles(CUBE, FACETS, 1))
    opened = triangle_measures(ReadTriangles(CUBE, FACETS[1:], 1))
    assert (whole.volume, whole.area, whole.closed) == (pytest.approx(8), pytest.approx(24), True)
    assert (opened.open_edges, opened.closed, opened.manifold) == (3, False, False)


def test_cubes_that_share_an_edge_close_but_are_no_manifold() -> None:
    other = CUBE + np.array([2.0, 2.0, 0.0])
    vertices, numbers = np.unique(np.concatenate([CUBE, other]), axis=0, return_inverse=True)
    found = triangle_measures(ReadTriangles(vertices, numbers.ravel()[np.concatenate([FACETS, FACETS + 8])], 1))
    assert (found.closed, found.manifold, found.open_edges, found.pieces) == (True, False, 0, 1)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stl", b"no triangles at all", "could not be read as STL"),
        ("a.stl", b"solid nothing\nendsolid nothing\n", "holds no triangles"),
        ("a.stl", b"solid x\nvertex 1 2\nendsolid", "could not be read as STL"),
        ("a.stl", b"solid x\nvertex 1 2 3\nvertex 1 2 nan\nvertex 0 0 0\n", "no finite number"),
        ("a.3mf", b"PK no archive", "could not be read as 3MF"),
    ],
)
def test_a_file_that_is_none_says_so(tmp_path: Path, name: str, content: bytes, words: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ExportError, match=words):
        read_triangles(tmp_path / name)

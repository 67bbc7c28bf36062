"""Triangles come back from STL and 3MF files, in millimetres."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import lib3mf
import numpy as np
import pytest
import trimesh

from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.surface.fit import FitSettings

BOX = trimesh.creation.box([3, 2, 1])


def placed_3mf(path: Path, unit: lib3mf.ModelUnit) -> None:
    """One box twice: as a part, and moved by 10 along x as a part made of parts."""
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(unit)
    mesh = model.AddMeshObject()
    corners = [lib3mf.Position((lib3mf.Position._fields_[0][1])(*map(float, point))) for point in BOX.vertices]
    facets = [lib3mf.Triangle((lib3mf.Triangle._fields_[0][1])(*map(int, facet))) for facet in BOX.faces]
    mesh.SetGeometry(corners, facets)
    group = model.AddComponentsObject()
    group.AddComponent(mesh, wrapper.GetTranslationTransform(10, 0, 0))
    model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
    model.AddBuildItem(group, wrapper.GetIdentityTransform())
    # To a file the library writes in a locale of its own, and leaves the process in it.
    path.write_bytes(bytes(model.QueryWriter("3mf").WriteToBuffer()))


@pytest.mark.parametrize("ending", ["stl", "3mf"])
def test_our_own_files_come_back_closed_and_of_the_same_volume(ending: str, tmp_path: Path) -> None:
    lattice, path = Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5)), tmp_path / f"a.{ending}"
    lattice.write(path, deviation=0.1)
    found = triangle_measures(*read_triangles(path))
    assert found.closed
    assert found.triangles == lattice.triangle_report(0.1).triangles
    assert found.volume == pytest.approx(lattice.triangle_report(0.1).volume, rel=1e-5)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_binary_and_text_stl_of_other_programs_are_the_same(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    content = BOX.export(file_type=kind)
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    vertices, triangles = read_triangles(path)
    assert (len(vertices), len(triangles)) == (8, 12)
    assert triangle_measures(vertices, triangles).volumes == pytest.approx([6.0])


def test_a_binary_file_whose_header_begins_like_text_is_told_by_its_size(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    path.write_bytes(b"solid box".ljust(80) + BOX.export(file_type="stl")[80:])
    assert len(read_triangles(path)[1]) == 12


@pytest.mark.parametrize(
    ("unit", "millimetres"),
    [(lib3mf.ModelUnit.MilliMeter, 1.0), (lib3mf.ModelUnit.Inch, 25.4), (lib3mf.ModelUnit.MicroMeter, 1e-3)],
)
def test_3mf_says_its_unit_and_where_its_parts_stand(
    unit: lib3mf.ModelUnit, millimetres: float, tmp_path: Path
) -> None:
    placed_3mf(tmp_path / "a.3mf", unit)
    vertices, triangles = read_triangles(tmp_path / "a.3mf")
    assert np.ptp(vertices, axis=0) == pytest.approx(np.array([13.0, 2.0, 1.0]) * millimetres)
    assert triangle_measures(vertices, triangles).volumes == pytest.approx(2 * [6 * millimetres**3])


def test_words_of_obj_may_be_parted_by_tabs(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v\t0 0 0\nv 1 0 0\n v 0\t1 0\n\nf\t1/1 2/2 3/3\n")
    assert read_triangles(path)[1].tolist() == [[0, 1, 2]]


def test_triangles_without_area_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    corners = np.concatenate([BOX.triangles, BOX.triangles[:1, [0, 0, 1]]])
    lines = [f"vertex {x} {y} {z}" for x, y, z in corners.reshape(-1, 3).tolist()]
    path.write_text("solid\n" + "\n".join(lines) + "\nendsolid\n")
    assert len(read_triangles(path)[1]) == 12


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.dwg", b"", "ending in .stl, .3mf, .obj or .ply"),
        ("a.stl", b"solid of nothing", "with triangles of finite size in it"),
        ("a.stl", b"\xff\xfe not text", "a file of triangles"),
        ("a.stl", b"solid\nvertex 1 2\n", "a file of triangles"),
        ("a.stl", b"solid\nvertex 0 0 nan\nvertex 1 0 0\nvertex 0 1 0\n", "of finite size"),
        ("a.3mf", b"PK no archive", "no sound zip archive"),
        ("a.obj", b"v 0 0 0\nv 1 0", "line 2 is none of OBJ"),
        ("a.obj", b"v 0 0 0\nf 1 two 3\n", "line 2 is none of OBJ"),
        ("gone.stl", None, "No such file"),
    ],
)
def test_what_holds_no_triangles_is_refused_in_one_line(
    tmp_path: Path, name: str, content: bytes | None, words: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        read_triangles(tmp_path / name)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def archive_of(path: Path, content: bytes, times: int = 1) -> None:
    with ZipFile(path, "w", ZIP_DEFLATED) as archive, archive.open("3D/3dmodel.model", "w") as entry:
        for _ in range(times):
            entry.write(content)


def test_an_archive_that_unpacks_to_gigabytes_is_refused_at_once(tmp_path: Path) -> None:
    path = tmp_path / "bomb.3mf"
    archive_of(path, b" " * 10_000_000, 25)
    start = time.perf_counter()
    with pytest.raises(ParameterError, match=r"bomb\.3mf.*at most 1000 MB and 100 times its own size; it says 250 MB"):
        read_triangles(path)
    assert time.perf_counter() - start < 1


def test_an_archive_that_holds_more_than_it_says_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "liar.3mf"
    archive_of(path, b" " * 20_000_000)
    content = path.read_bytes()
    true, said = ((size).to_bytes(4, "little") for size in (20_000_000, 1000))
    assert true in content
    path.write_bytes(content.replace(true, said))
    with pytest.raises(ParameterError, match=r"no sound zip archive|is damaged"):
        read_triangles(path)


def test_what_is_no_text_is_not_read_as_text_however_large(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    with path.open("wb") as file:
        file.truncate(10**12)
    with pytest.raises(ParameterError, match="a file of triangles"):
        read_triangles(path)


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere file names are Unicode, and there is no such device")
@pytest.mark.parametrize("ending", [b"stl", b"3mf"])
def test_a_name_that_is_no_utf_8_is_read_and_a_device_is_not(tmp_path: Path, ending: bytes) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9." + ending))
    Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5)).write(path, deviation=0.2)
    assert triangle_measures(*read_triangles(path)).closed
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(ParameterError, match="it is a device or a pipe"):
        read_triangles(path)

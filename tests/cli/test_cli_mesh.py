"""gyroid-cad mesh: elements, files, quality and refusals from the shell."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import meshio
import pytest

from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.cli.app import main
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

Captured = pytest.CaptureFixture[str]

CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "1", "--control-points", "6"]
LATTICE = Lattice((1, 1, 1), 10.0, 1.0, fit=FitSettings(6))


def run(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main(["mesh", *map(str, arguments)])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


def test_the_paper_s_mesh_is_one_command(capsys: Captured, tmp_path: Path) -> None:
    size = ["--cells", "4", "3", "2", "--cell-size", "10", "--thickness", "1"]
    done = run(capsys, "-o", tmp_path / "a.vtu", *size, "--subdivisions", "20", "--json")
    summary = json.loads(done.out)
    assert summary["elements"] == 230_400
    assert summary["files"][0]["bytes"] == (tmp_path / "a.vtu").stat().st_size


@pytest.mark.parametrize(
    ("options", "element", "expected"),
    [
        (["--layers", "3"], "hexahedron", LATTICE.hexahedra(2, 3)),
        (["--order", "2"], "hexahedron20", LATTICE.hexahedra(2, 1, 2)),
        (["--order", "2", "--full"], "hexahedron27", LATTICE.hexahedra(2, 1, 2, True)),
        (["--layers", "0"], "quad", LATTICE.quadrilaterals(2)),
        (["--layers", "0", "--order", "2"], "quad8", LATTICE.quadrilaterals(2, 2)),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_options_make_the_mesh_that_python_makes(
    capsys: Captured, tmp_path: Path, options: list[str], element: str, expected: object
) -> None:
    done = run(capsys, "-o", tmp_path / "a.vtu", *CELL, "--subdivisions", "2", *options, "--json")
    assert done.status == 0, done.err
    read = meshio.read(tmp_path / "a.vtu")
    assert read.cells[0].type == element == json.loads(done.out)["element"]
    assert (read.cells[0].data == expected.cells).all()  # type: ignore[attr-defined]
    assert (read.points == expected.points).all()  # type: ignore[attr-defined]


def test_quality_is_that_of_the_mesh_in_json_and_in_the_table(capsys: Captured, tmp_path: Path) -> None:
    options = ["-o", tmp_path / "a.inp", *CELL, "--subdivisions", "3", "--quality"]
    expected = mesh_quality(LATTICE.hexahedra(3)).as_dict()
    assert json.loads(run(capsys, *options, "--json").out)["quality"] == json.loads(json.dumps(expected))
    table = run(capsys, *options).out
    assert f"{expected['measures']['scaled_jacobian']['smallest']:.4g}" in table


def test_without_quality_none_is_measured(capsys: Captured, tmp_path: Path) -> None:
    done = run(capsys, "-o", tmp_path / "a.inp", *CELL, "--subdivisions", "2", "--json")
    assert json.loads(done.out)["quality"] is None


def test_histograms_are_drawn_beside_the_mesh(capsys: Captured, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    picture = tmp_path / "quality.png"
    done = run(capsys, "-o", tmp_path / "a.inp", *CELL, "--subdivisions", "2", "--histogram", picture)
    assert done.status == 0, done.err
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert str(picture) in done.out


def test_a_lattice_in_a_file_is_meshed(capsys: Captured, tmp_path: Path) -> None:
    lattice, mesh = tmp_path / "lattice.toml", tmp_path / "a.msh"
    lattice.write_text(
        f'output = "{mesh}"\ncells = [1, 1, 1]\ncell_size = 10\nthickness = 1\ncontrol_points = 6\nsubdivisions = 2\n'
    )
    assert run(capsys, lattice, "--quiet").status == 0
    assert mesh.exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--subdivisions", "0"], "--subdivisions = 0: expected a whole number from 1 on"),
        (["--subdivisions", "1000000"], "GB of memory"),
        (["--subdivisions", "2", "--layers", "-1"], "--layers = -1"),
        (["--subdivisions", "2", "--order", "3"], "--order = 3: expected 1 for linear elements or 2"),
        (["--subdivisions", "2", "--full"], "--full = True"),
        (["--subdivisions", "2", "--order", "2", "--full"], "none in .inp files"),
        (["--subdivisions", "2", "--trim", "box"], "--trim = 'box'"),
        (["--subdivisions", "2", "-o", "a.vtk"], "ending in .vtu, .msh, .inp, .cdb, .bdf or .nas"),
        (["--subdivisions", "2", "-o", "./a.inp"], "each file once"),
        (["--subdivisions", "2", "--histogram", "a.jpg"], "--histogram = 'a.jpg'"),
        (["--subdivisions", "two"], "--subdivisions"),
        ([], "Missing option '--subdivisions'"),
    ],
)
def test_bad_input_is_one_line_and_leaves_no_file(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(capsys, "-o", "a.inp", *CELL, *options)
    assert done.status == 2
    assert len(done.err.splitlines()) == 1
    assert words in done.err
    assert not done.out
    assert not list(tmp_path.iterdir())


def test_no_output_is_asked_for(capsys: Captured) -> None:
    assert "Missing option '-o'" in run(capsys, *CELL, "--subdivisions", "2").err


def test_volumes_are_written_in_every_format(capsys: Captured, tmp_path: Path) -> None:
    names = ["a.mesh", "a.xml", "a.json", "a.npz"]
    outputs = [word for name in names for word in ("-o", str(tmp_path / name))]
    captured = main(["volumes", *outputs, *CELL, "--degree", "3", "--json"])
    summary = json.loads(capsys.readouterr().out)
    assert captured == 0
    expected = LATTICE.volumes(3)
    assert summary["control_points"] == len(expected.control_points)
    assert summary["degrees"] == [3, 3, 3]
    assert [file["path"] for file in summary["files"]] == [str(tmp_path / name) for name in names]
    assert json.loads((tmp_path / "a.json").read_text())["control_points"] == expected.control_points.tolist()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["-o", "a.mesh", "--degree", "2"], "--degree = 2: expected 1 or 3"),
        (["-o", "a.vtu"], "ending in .mesh, .xml, .json or .npz"),
        (["-o", "a.mesh", "-o", "./a.mesh"], "each file once"),
        (["-o", "a.mesh", "--trim", "box"], "--trim = 'box'"),
        ([], "Missing option '-o'"),
    ],
)
def test_volumes_that_cannot_be_are_refused_in_one_line(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["volumes", *CELL, *options]) == 2
    err = capsys.readouterr().err
    assert len(err.splitlines()) == 1
    assert words in err
    assert not list(tmp_path.iterdir())

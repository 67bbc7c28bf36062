"""The command line's fields, maps, the paper's units, and lattices in files."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest

from gyroid_cad.cli.app import main
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

Captured = pytest.CaptureFixture[str]

ONE_CELL = ["--cells", "1", "1", "1", "--cell-size", "10"]
COARSE = ["--control-points", "6", "--tolerance", "0.01"]


def run(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main(["build", *map(str, arguments)])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


def test_options_describe_the_same_lattice_as_python_does(capsys: Captured, tmp_path: Path) -> None:
    fields = {"thickness": "0.6 + 0.02*x", "scale_field": "1 + 0.01*y", "map": "twist:angle=10"}
    options = [word for name, text in fields.items() for word in ("--" + name.replace("_", "-"), text)]
    done = run(capsys, "-o", tmp_path / "a.brep", *ONE_CELL, *options, *COARSE, "--json")
    lattice = Lattice((1, 1, 1), 10.0, **fields, fit=FitSettings(6), tolerance=0.01)  # type: ignore[arg-type]
    summary, report = json.loads(done.out), lattice.report(kernel_check=True).as_dict()
    assert done.status == 0
    assert summary["valid"]
    assert summary["closed"]
    for key in (
        "volume",
        "volume_exact",
        "density",
        "min_thickness",
        "max_thickness",
        "control_points",
        "max_deviation",
    ):
        assert summary[key] == report[key]


def test_the_papers_units_are_those_of_lattice_paper(capsys: Captured, tmp_path: Path) -> None:
    units = {"thickness_factor": "0.08 + 0.05*x + 0.02*y", "bc_length": "1 + 0.05*x + 0.08*y", "scale": 5.0}
    options = [word for name, value in units.items() for word in ("--" + name.replace("_", "-"), str(value))]
    done = run(capsys, "-o", tmp_path / "a.brep", "--cells", "1", "1", "1", *options, *COARSE, "--json")
    lattice = Lattice.paper((1, 1, 1), **units, fit=FitSettings(6), tolerance=0.01)  # type: ignore[arg-type]
    assert json.loads(done.out)["volume"] == lattice.report(kernel_check=True).volume


def test_the_table_shows_the_range_of_the_wall_and_what_the_fit_took(capsys: Captured, tmp_path: Path) -> None:
    done = run(capsys, "-o", tmp_path / "a.brep", *ONE_CELL, "--thickness", "0.6 + 0.02*x", *COARSE)
    report = Lattice((1, 1, 1), 10.0, "0.6 + 0.02*x", fit=FitSettings(6), tolerance=0.01).report()
    assert f"{report.min_thickness:.4g} to {report.max_thickness:.4g}" in str(report)
    assert f"{report.control_points} x {report.control_points} control points a patch" in str(report)
    assert "289 for local self-intersection" in str(report)
    # The terminal shows the same lines, and below them the files and the time.
    shown = [" ".join(line.split()) for line in done.out.splitlines()]
    assert shown[: len(report.rows())] == [" ".join(row) for row in report.rows()]


def test_a_file_holds_a_whole_lattice_and_builds_it(capsys: Captured, tmp_path: Path) -> None:
    part, lattice = tmp_path / "part.brep", tmp_path / "lattice.toml"
    lattice.write_text(
        f'output = "{part}"\ncells = [1, 1, 1]\ncell_size = 10\nthickness = "0.6 + 0.02*x"\n'
        "control_points = 6\ntolerance = 0.01\n"
    )
    done = run(capsys, lattice, "--json")
    assert done.status == 0
    assert json.loads(done.out)["files"] == [{"path": str(part), "bytes": part.stat().st_size}]


def test_options_override_the_file(capsys: Captured, tmp_path: Path) -> None:
    lattice = tmp_path / "lattice.toml"
    lattice.write_text("cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\n")
    printed = tomllib.loads(run(capsys, lattice, "--cell-size", "12", "--print-config").out)
    assert (printed["cells"], printed["cell_size"], printed["thickness"]) == ([1, 1, 1], 12.0, 0.8)


def test_the_printed_lattice_prints_itself_again_and_builds_nothing(capsys: Captured, tmp_path: Path) -> None:
    options = ["--cells", "12", "2", "1", "--cell-size", "10", "--density", "0.2 + 0.001*y", "--tolerance", "2e-4"]
    first = run(capsys, "-o", tmp_path / "a.step", *options, "--map", "cylinder:radius=20,angle=360", "--print-config")
    lattice = tmp_path / "lattice.toml"
    lattice.write_text(first.out)
    assert run(capsys, lattice, "--print-config").out == first.out
    assert [path.name for path in tmp_path.iterdir()] == ["lattice.toml"]
    assert "seconds" not in first.out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([*ONE_CELL, "--thickness", "0.8 + q"], ["--thickness = '0.8 + q'", "'q' at column 7"]),
        ([*ONE_CELL, "--thickness", "x.real"], ["--thickness", "attribute", "column 1"]),
        ([*ONE_CELL, "--thickness", "open('/etc/passwd')"], ["--thickness", "open"]),
        ([*ONE_CELL, "--thickness", "x+" * 600 + "1"], ["--thickness", "1000 characters"]),
        ([*ONE_CELL, "--thickness", "(" * 100 + "x" + ")" * 100], ["--thickness"]),
        ([*ONE_CELL, "--thickness", "sqrt(x - 5)"], ["--thickness", "finite values", "(x, y, z)"]),
        ([*ONE_CELL, "--thickness", "0.5 - 0.1*x"], ["--thickness = -0.", "at (x, y, z) = (", "at least 0.0001"]),
        ([*ONE_CELL, "--thickness", "3 + 0.1*x"], ["--thickness = ", "below 3.76", "folds over"]),
        ([*ONE_CELL, "--density", "0.5 + 0.1*x"], ["--density = ", "below 0.940"]),
        ([*ONE_CELL, "--thickness", "0.8", "--scale-field", "x"], ["--scale-field", "(x, y, z)"]),
        ([*ONE_CELL, "--thickness", "0.8", "--map", "cone:radius=3"], ["--map = 'cone:radius=3'", "cylinder"]),
        ([*ONE_CELL, "--thickness", "0.8", "--map", "cylinder"], ["--map", "radius of cylinder"]),
        ([*ONE_CELL, "--thickness", "0.8", "--map", "cylinder:radius=1"], ["--map", "at least 1.59155 mm"]),
        ([*ONE_CELL, "--thickness", "0.8", "--map", "bend:angle=200"], ["--map: Jacobian determinant = -"]),
        ([*ONE_CELL, "--thickness", "0.8", "--tolerance", "0"], ["--tolerance = 0.0", "above 0"]),
        ([*ONE_CELL, "--thickness", "0.8", "--tolerance", "1e-12"], ["--tolerance = 1e-12", "40 control points"]),
        ([*ONE_CELL, "--thickness", "0.8 + 0.2*((x + 0.4) % 3)"], ["--tolerance", "smooth"]),
        ([*ONE_CELL, "--thickness", "0.8", "--bc-length", "1"], ["--thickness-factor", "--thickness"]),
        (["--cells", "1", "1", "1", "--bc-length", "1"], ["need --thickness-factor"]),
        (["--cells", "1", "1", "1", "--thickness-factor", "0.1", "--scale", "0"], ["--scale = 0.0"]),
        (["part.txt", *ONE_CELL, "--thickness", "0.8"], ["unexpected extra argument 'part.txt'", ".toml"]),
        (["none.toml"], ["none.toml", "No such file"]),
        (["--thickness", "0.8"], ["Missing option '--cells'"]),
        (["--cells", "1", "1", "1", "--thickness", "0.8"], ["Missing option '--cell-size'"]),
    ],
)
def test_bad_usage_is_one_line_and_leaves_no_file(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    failed = run(capsys, "-o", "a.step", *options)
    assert failed.status == 2
    assert failed.out == ""
    assert len(failed.err.splitlines()) == 1
    assert all(word in failed.err for word in words), failed.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cellsize = 10", ["lattice.toml, line 1: cellsize", "did you mean cell_size?"]),
        ("cells = [1, 1]", ["lattice.toml, line 1: cells: "]),
        ("cells = [1, 1, 1.5]", ["lattice.toml, line 1: cells: ", "1.5"]),
        ("cells = [1, 1, true]", ["lattice.toml, line 1: cells"]),
        ('\nfit = "rough"', ["lattice.toml, line 2: fit: ", "rough"]),
        ('thickness = "q"', ["lattice.toml, line 1: thickness = 'q'", "'q' at column 1"]),
        ("thickness = -1", ["lattice.toml, line 1: thickness = -1.0: expected"]),
        (
            "thickness = 1\ndensity = 0.3",
            ["exactly one of lattice.toml, line 1: thickness, lattice.toml, line 2: density"],
        ),
        ("json = true", ["lattice.toml, line 1: json"]),
        ("cells = [1", ["lattice.toml", "TOML"]),
    ],
)
def test_a_bad_file_is_one_line_that_names_the_key(
    capsys: Captured, tmp_path: Path, text: str, words: list[str]
) -> None:
    lattice = tmp_path / "lattice.toml"
    lattice.write_text(text)
    rest = [] if "cells" in text else ["--cells", "1", "1", "1"]
    thickness = [] if "thickness" in text else ["--thickness", "0.8"]
    failed = run(capsys, lattice, "-o", tmp_path / "a.step", *rest, "--cell-size", "10", *thickness)
    failed.err = failed.err.replace(f"{tmp_path}/", "")
    assert failed.status == 2
    assert "--" not in failed.err
    assert len(failed.err.splitlines()) == 1
    assert all(word in failed.err for word in words), failed.err
    assert not (tmp_path / "a.step").exists()


def test_a_field_that_differs_where_a_map_joins_the_ends_fails_with_the_gap(capsys: Captured, tmp_path: Path) -> None:
    closed = ["--cells", "12", "1", "1", "--cell-size", "10", "--map", "cylinder:radius=20,angle=360"]
    failed = run(capsys, "-o", tmp_path / "a.step", *closed, "--thickness", "0.8 + 0.001*x")
    assert failed.status == 1
    assert "apart near" in failed.err
    assert "the same at both ends" in failed.err
    assert not list(tmp_path.iterdir())

"""gyroid-cad print-check, and --printer of build."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import trimesh

from gyroid_cad.cli.app import main
from gyroid_cad.lattice import Lattice
from gyroid_cad.printing.print_check import print_check
from gyroid_cad.surface.fit import FitSettings

Captured = pytest.CaptureFixture[str]

CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--control-points", "5"]
LATTICE = Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5))


def run(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main([str(argument) for argument in arguments])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


def plain(check: object) -> object:
    return json.loads(json.dumps(check))


@pytest.mark.parametrize("ending", ["stl", "3mf"])
def test_a_file_is_checked_and_the_json_is_the_checks_own(capsys: Captured, tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"box.{ending}"
    trimesh.creation.box([5, 6, 7]).export(path)
    done = run(capsys, "print-check", path, "--printer", "form2", "--json")
    assert (done.status, done.err, done.out.count("\n")) == (0, "", 1)
    shown = json.loads(done.out)
    assert shown.pop("seconds") >= 0
    assert shown == plain(print_check(path).as_dict())
    assert shown["size"] == pytest.approx([5, 6, 7])


def test_a_lattice_is_checked_by_options_or_by_its_file(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\n")
    expected = plain(print_check(LATTICE).as_dict())
    for given in (CELL, [tmp_path / "a.toml"]):
        shown = json.loads(run(capsys, "print-check", *given, "--json").out)
        shown.pop("seconds")
        assert shown == expected


def test_the_table_has_a_row_for_each_subject_and_the_verdict_last(capsys: Captured) -> None:
    done = run(capsys, "print-check", *CELL)
    lines = [line.split("  ")[0].strip() for line in done.out.splitlines()]
    subjects = [row[0] for row in print_check(LATTICE).rows()]
    assert lines == ["Formlabs Form 2, resin (SLA)", *subjects, "verdict"]
    assert "passed" in done.out.splitlines()[-1]


def test_the_status_is_one_if_it_cannot_be_printed_and_the_scale_is_suggested(capsys: Captured) -> None:
    thin = [*CELL, "--thickness", "0.3"]
    assert run(capsys, "print-check", *thin, "--quiet").__dict__ == {"status": 1, "out": "", "err": ""}
    done = run(capsys, "print-check", *thin)
    assert (done.status, done.err) == (1, "")
    assert "suggested scale 1.333" in done.out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["print-check", "gone.stl"], "file = 'gone.stl'"),
        (
            ["print-check", "part.step"],
            "input file = 'part.step': expected a lattice in a .toml file, or a file ending in",
        ),
        (["print-check", "box.stl", "--deviation", "-1"], "--deviation = -1.0: expected a length above 0"),
        (["print-check", "box.stl", "--cells", "1", "1", "1"], "box.stl is a part already: none of --cells"),
        (["print-check", *CELL, "--printer", "lathe"], "--printer = 'lathe': expected form2, or the path"),
        (["print-check", *CELL, "--printer", "gone.toml"], "--printer = 'gone.toml'"),
        (["print-check", *CELL, "--deviation", "0"], "--deviation = 0.0"),
        (["print-check"], "Missing option '--cells'"),
        (["build", "-o", "a.stl", *CELL, "--printer", "lathe"], "--printer = 'lathe': expected form2"),
    ],
)
def test_bad_usage_is_one_line_and_leaves_no_file(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: str
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run(capsys, *arguments)
    assert (done.status, done.out) == (2, "")
    assert len(done.err.splitlines()) == 1
    assert words in done.err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["a.stl", "a.step"])
def test_build_adds_the_check_to_its_summary(capsys: Captured, tmp_path: Path, name: str) -> None:
    options = ["build", "-o", tmp_path / name, *CELL, "--printer", "form2"]
    summary = json.loads(run(capsys, *options, "--json").out)
    assert summary["print_check"] == plain(print_check(LATTICE).as_dict())
    table = run(capsys, *options).out
    assert "Formlabs Form 2" in table
    assert str(tmp_path / name) in table
    assert "print_check" not in json.loads(run(capsys, *options[:-2], "--json").out)


def test_a_printer_of_ones_own_may_stand_in_the_lattices_file(capsys: Captured, tmp_path: Path) -> None:
    printer = tmp_path / "tiny.toml"
    printer.write_text(
        '[tiny]\nname = "Tiny"\nprocess = "resin"\nbuild_volume = [5, 5, 5]\nmin_supported_wall = 0.1\n'
        "min_unsupported_wall = 0.1\nmin_drain_hole = 0.1\n"
    )
    (tmp_path / "a.toml").write_text(
        'cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\nprinter = "tiny.toml"\n'
    )
    done = run(capsys, "print-check", tmp_path / "a.toml")
    assert done.status == 1
    assert "too large: scale by" in done.out

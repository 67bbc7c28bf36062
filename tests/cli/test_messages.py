"""A message names what the user gave: the option as it is spelled, or the file, the line and the key."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from gyroid_cad.cli.app import commands, main
from gyroid_cad.lattice import Lattice

Captured = pytest.CaptureFixture[str]

LATTICE = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--control-points", "5"]


def run(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main([str(argument) for argument in arguments])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


def test_a_traceback_is_shown_for_debugging_and_never_else(capsys: Captured, monkeypatch: pytest.MonkeyPatch) -> None:
    def defective(*_: object, **__: object) -> None:
        raise ZeroDivisionError("deep down")

    monkeypatch.setattr(Lattice, "write", defective)
    line = "gyroid-cad: error: unexpected ZeroDivisionError: deep down"
    build = ["build", *LATTICE, "-o", "a.step"]
    for arguments in (["--debug", *build], [*build, "--debug"]):
        failed = run(capsys, *arguments)
        assert failed.status == 1
        assert failed.err.startswith("Traceback (most recent call last)")
        assert "in defective" in failed.err
        assert failed.err.splitlines()[-1] == line
    assert run(capsys, *build).err == f"{line}\n"


def test_every_command_can_be_debugged() -> None:
    for command in (commands, *commands.commands.values()):
        assert "--debug" in [name for option in command.params for name in option.opts]


def test_even_bad_usage_shows_where_it_was_found_when_debugging(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("cell_size = 'ten'")
    failed = run(capsys, "build", tmp_path / "a.toml", "--debug")
    assert failed.err.startswith("Traceback")
    assert failed.err.splitlines()[-1].endswith("a.toml, line 1: cell_size: 'ten' is not a valid float.")


def test_what_lacks_in_a_file_is_asked_for_as_an_option_or_a_key(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("cells = [1, 1, 1]\nthickness = 0.8")
    failed = run(capsys, "build", tmp_path / "a.toml", "-o", tmp_path / "a.step")
    assert failed.status == 2
    assert f"Missing option '--cell-size', and {tmp_path}/a.toml has no key cell_size." in failed.err


def test_files_that_a_file_names_stand_beside_it(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "inner").mkdir()
    keys = "cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\ndeviation = 0.2\n"
    (tmp_path / "inner" / "a.toml").write_text(keys + "output = 'a.stl'")
    done = run(capsys, "build", "inner/a.toml")
    assert done.status == 0, done.err
    assert "inner/a.stl" in done.out
    assert sorted(path.name for path in (tmp_path / "inner").iterdir()) == ["a.stl", "a.toml"]
    assert [path.name for path in tmp_path.iterdir()] == ["inner"]


def test_a_file_writes_elsewhere_only_where_that_is_allowed(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    lattice = tmp_path / "inner" / "a.toml"
    keys = "cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\ndeviation = 0.2\n"
    lattice.write_text(keys + "output = ['b.stl', '../a.stl']")
    failed = run(capsys, "build", lattice)
    assert failed.status == 2
    assert "a.toml, line 6: output = '../a.stl': expected a file in the folder of" in failed.err
    assert "--allow-outside" in failed.err
    assert [path.name for path in lattice.parent.iterdir()] == ["a.toml"]
    # What the user names goes wherever the user says, and so does what the file names once it is allowed to.
    assert run(capsys, "build", lattice, "-o", tmp_path / "c.stl").status == 0
    assert run(capsys, "build", lattice, "--allow-outside").status == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.stl", "c.stl", "inner"]


def test_no_file_allows_itself_to_write_elsewhere(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("allow_outside = true\noutput = '../a.stl'")
    assert "line 1: allow_outside = True: expected a known key" in run(capsys, "build", tmp_path / "a.toml").err


@pytest.mark.parametrize("option", ["--cells", "--subdivisions"])
def test_a_number_of_thousands_of_digits_is_one_short_line(capsys: Captured, option: str) -> None:
    failed = run(capsys, "mesh", option, *["9" * 5000] * (3 if option == "--cells" else 1))
    assert failed.status == 2
    assert option in failed.err
    assert len(failed.err) < 400


def test_without_a_word_too_much_the_program_says_it_too(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gyroid_cad", "build", *LATTICE, "-o", str(tmp_path / "a.step"), "--density", "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "gyroid-cad: error: give exactly one of --thickness and --density\n"

"""A message names what the user gave: the option as it is spelled, or the file, the line and the key."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace

import click
import pytest

from gyroid_cad.cli.app import commands, main
from gyroid_cad.lattice import Lattice

CONTEXT = click.Context(commands)
COMMANDS = {
    name: command for name in commands.list_commands(CONTEXT) if (command := commands.get_command(CONTEXT, name))
}


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
    for command in (commands, *COMMANDS.values()):
        assert "--debug" in [name for option in command.params for name in option.opts]


def test_even_bad_usage_shows_where_it_was_found_when_debugging(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("cell_size = 'ten'")
    failed = run(capsys, "build", tmp_path / "a.toml", "--debug")
    assert failed.err.startswith("Traceback")
    assert failed.err.splitlines()[-1].endswith("a.toml, line 1: cell_size: 'ten' is not a valid float.")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            ["--density", "30"],
            "--density = 30.0: expected above 0 and below 0.94033, where the wall meets itself; 30 % is 0.30",
        ),
        (["--density", "2.5"], "; 2.5 % is 0.025"),
        (["--porosity", "70"], "--porosity = 70.0: expected above 0 and below 1; 70 % is 0.70"),
        (["--porosity", "0.01"], "--porosity: density = 0.99: expected above 0 and below 0.94033"),
        (["--porosity", "0.1*x"], "--porosity: density = -0.25 at (x, y, z) = (12.5, 2.5, 7.5) mm: expected above 0"),
        (
            ["--porosity", "0.7 + q"],
            "--porosity = '0.7 + q': expected an expression of x, y, z; unknown name 'q' at column 7",
        ),
        (["--porosity", "0.7", "--density", "0.3"], "exactly one of --density, --porosity"),
    ],
)
@pytest.mark.parametrize("command", [["build", "-o", "a.step"], ["report", "--json"], ["volumes", "-o", "a.json"]])
def test_a_fraction_of_the_volume_is_refused_by_the_name_it_was_given(
    capsys: Captured, command: list[str], options: list[str], words: str
) -> None:
    failed = run(capsys, *command, *LATTICE[:6], "--control-points", "5", *options)
    assert failed.status == 2
    assert words in failed.err


@pytest.mark.parametrize(
    ("porosity", "density"), [("0.7", "0.3"), ("0.6 + 0.01*x", "1 - (0.6 + 0.01*x)")], ids=["a number", "a formula"]
)
def test_a_porosity_is_what_the_density_leaves(capsys: Captured, tmp_path: Path, porosity: str, density: str) -> None:
    keys = "cells = [1, 1, 1]\ncell_size = 10\ncontrol_points = 5\ntolerance = 0.01\ndeviation = 0.2\n"
    for name, given in (("porosity", porosity), ("density", density)):
        (tmp_path / f"{name}.toml").write_text(f"{keys}{name} = '{given}'\noutput = '{name}.stl'\n")
        done = run(capsys, "build", tmp_path / f"{name}.toml")
        assert done.status == 0, done.err
    assert (tmp_path / "porosity.stl").read_bytes() == (tmp_path / "density.stl").read_bytes()


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


@pytest.mark.parametrize("command", ["build", "mesh", "volumes", "view", "report", "print-check"])
@pytest.mark.parametrize(
    "option",
    ["--scale-field=1e300", "--scale-field=1e300*(1+x*x)", "--map=cylinder:radius=1e300", "--map=twist:angle=1e300"],
)
def test_numbers_beyond_all_measure_are_one_line_of_the_option(
    capsys: Captured, tmp_path: Path, command: str, option: str
) -> None:
    output = {"build": "a.step", "mesh": "a.vtu", "volumes": "a.xml", "view": "a.png", "report": "a.html"}.get(command)
    written = [] if output is None else ["-o", tmp_path / output]
    more = ["--subdivisions", "2"] if command == "mesh" else []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        failed = run(capsys, command, *LATTICE, *more, *written, option)
    assert failed.status == 2
    assert failed.err.startswith(f"gyroid-cad: error: {option.partition('=')[0]} ")
    assert failed.err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_without_a_word_too_much_the_program_says_it_too(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gyroid_cad", "build", *LATTICE, "-o", str(tmp_path / "a.step"), "--density", "3"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "gyroid-cad: error: give exactly one of --thickness, --density\n"

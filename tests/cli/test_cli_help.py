"""Help: every command has examples, and every example works. Completion: shells are told what may follow."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import cadquery
import click
import pytest

from gyroid_cad.cli.app import commands, main
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

CONTEXT = click.Context(commands)
COMMANDS = {
    name: command for name in commands.list_commands(CONTEXT) if (command := commands.get_command(CONTEXT, name))
}


Captured = pytest.CaptureFixture[str]

# So that each runs in a moment: fewer cells, fewer control points, larger triangles. What is left is as it is printed.
_CELLS = re.compile(r"--cells \d+ \d+ \d+")
_QUICK_FIT = ["--control-points", "5"]


def examples() -> Iterator[tuple[str, str]]:
    for name, command in {"": commands, **COMMANDS}.items():
        for line in (command.help or "").splitlines():
            if line.strip().startswith("gyroid-cad"):
                yield name, line.strip()


EXAMPLES = list(examples())


def words(line: str) -> list[str]:
    """The arguments of an example, without what the shell makes of the rest."""
    program, *arguments = shlex.split(re.split(r" >>? ", line)[0])
    assert program == "gyroid-cad"
    return arguments


@pytest.fixture(scope="module")
def parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that the examples read."""
    folder = tmp_path_factory.mktemp("parts")
    cadquery.exporters.export(cadquery.Workplane().box(5, 6, 7), str(folder / "part.step"))
    cadquery.exporters.export(cadquery.Workplane().box(3, 4, 5), str(folder / "inner.step"))
    machine = cadquery.Assembly(name="machine").add(cadquery.Workplane().box(4, 4, 4), name="bracket")
    machine.add(cadquery.Workplane().box(9, 9, 1).translate((0, 0, 9)), name="lid")
    machine.export(str(folder / "machine.step"))
    lattice = Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5))
    lattice.write(folder / "part.stl", folder / "part.3mf", deviation=0.2)
    for name in ("other.step", "scan.stl"):
        cadquery.exporters.export(cadquery.Workplane().box(4, 4, 4), str(folder / name))
    (folder / "fill.toml").write_text(
        'part = "part.step"\noutput = "light.step"\ncell_size = 10\ndensity = 0.3\ncontrol_points = 5\n'
    )
    (folder / "lattice.toml").write_text("cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\n")
    return folder


@pytest.fixture
def folder(parts: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """One to stand in, with those files."""
    monkeypatch.chdir(tmp_path)
    shutil.copytree(parts, tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_every_command_has_examples_of_its_own() -> None:
    assert {name for name, _ in EXAMPLES} == {"", *COMMANDS}
    for name, line in EXAMPLES:
        assert not name or words(line)[0] == name


@pytest.mark.parametrize(("name", "line"), EXAMPLES, ids=[line[11:60] for _, line in EXAMPLES])
@pytest.mark.usefixtures("folder")
def test_every_example_is_understood_as_it_is_printed(name: str, line: str) -> None:
    command, *arguments = words(line)
    with COMMANDS[command].make_context(command, arguments) as context:
        assert context.params
        if context.params.get("cells") is not None:
            from gyroid_cad.cli.lattice_options import lattice_of

            # Described and validated: what cannot be built in principle is refused here.
            assert lattice_of(context.params).cells == context.params["cells"]


# The ring, which fewer cells cannot make, is run among the README's commands.
RUN = [(name, line) for name, line in EXAMPLES if "--map" not in line]


@pytest.mark.parametrize(("name", "line"), RUN, ids=[line[11:60] for _, line in RUN])
def test_every_example_runs_with_fewer_cells(name: str, line: str, folder: Path, capsys: Captured) -> None:
    quick = re.sub(r"--subdivisions \d+", "--subdivisions 3", _CELLS.sub("--cells 1 1 1", line))
    arguments = words(re.sub(r"--deviation \S+", "--deviation 0.2", quick))
    if name == "view" and "-o" not in arguments:
        # Nobody is there to close a window.
        arguments += ["-o", "view.png"]
    takes_a_fit = any(option.name == "control_points" for option in COMMANDS[arguments[0]].params)
    of_a_file = name in ("view", "print-check", "report") and not arguments[1].startswith("-")
    if takes_a_fit and not of_a_file and "--control-points" not in arguments:
        arguments += _QUICK_FIT
    if "*" in line:
        arguments += ["--tolerance", "1e-2"]
    status = main(arguments)
    out, err = capsys.readouterr()
    # Of what takes long its stages are told.
    said = [line for line in err.splitlines() if not re.match(r" *\d+\.\d s  ", line)]
    assert (status, said) == (0, []), err
    assert out or name == "view"
    for output in [after for before, after in pairwise(arguments) if before == "-o"]:
        assert (folder / output).stat().st_size > 0


@pytest.mark.parametrize("columns", [60, 80])
@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help_keeps_to_the_terminal_and_its_examples_can_be_pasted(
    name: str, columns: int, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    assert main([*([name] if name else []), "--help"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) < columns
    # As a shell reads them: a backslash at the end of a line goes on in the next one.
    script = "\n".join(line[2:] for line in lines).replace("\\\n", "")
    shown = [" ".join(line.split()) for line in script.splitlines() if line.startswith("gyroid-cad ")]
    assert shown == [line for owner, line in EXAMPLES if owner == name]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_is_clicks_own_for_this_program(shell: str, capsys: Captured) -> None:
    assert main(["completion", shell]) == 0
    out, err = capsys.readouterr()
    assert f"_GYROID_CAD_COMPLETE={shell}_complete" in out
    assert "gyroid-cad" in out
    assert err == ""
    program = shutil.which(shell)
    if program is not None:
        # The shell itself finds nothing wrong with it.
        subprocess.run([program, "-n"], input=out, text=True, check=True)


def completed(monkeypatch: pytest.MonkeyPatch, captured: Captured, line: str) -> list[str]:
    monkeypatch.setenv("_GYROID_CAD_COMPLETE", "bash_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
    captured.readouterr()
    assert main([]) == 0
    return [shown.partition(",")[2] for shown in captured.readouterr().out.splitlines()]


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("gyroid-cad comp", ["completion"]),
        ("gyroid-cad build --surface d", ["diamond"]),
        ("gyroid-cad build --thickn", ["--thickness", "--thickness-factor"]),
        ("gyroid-cad completion ", ["bash", "zsh", "fish"]),
        ("gyroid-cad build --surface ", ["gyroid", "diamond", "primitive"]),
        ("gyroid-cad build --trim ", ["box"]),
        ("gyroid-cad build --fit p", ["paper"]),
        ("gyroid-cad build --schema ", ["ap214", "ap242"]),
        ("gyroid-cad build --printer form", ["form2"]),
        ("gyroid-cad print-check --printer f", ["form2"]),
        ("gyroid-cad report --printer f", ["form2"]),
        ("gyroid-cad fill part.step --kind network", ["network-a", "network-b"]),
        ("gyroid-cad fill part.step --surface p", ["primitive"]),
        ("gyroid-cad mesh --order ", ["1", "2"]),
        ("gyroid-cad volumes --degree ", ["1", "3"]),
    ],
)
def test_a_shell_that_asks_is_told_what_may_follow(
    line: str, expected: list[str], monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    assert completed(monkeypatch, capsys, line) == expected


def test_in_bash_itself_the_tab_key_completes_a_command(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash")
    program = tmp_path / "gyroid-cad"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gyroid_cad "$@"\n')
    program.chmod(0o755)
    script = (
        f'PATH="{tmp_path}:$PATH"; eval "$(gyroid-cad completion bash)"\n'
        'COMP_WORDS=(gyroid-cad vol); COMP_CWORD=1; _gyroid_cad_completion gyroid-cad; echo "${COMPREPLY[@]}"\n'
    )
    done = subprocess.run([bash, "-c", script], capture_output=True, text=True, check=True)
    assert done.stdout == "volumes\n", done.stderr


def test_commands_are_clicks_and_each_explains_itself() -> None:
    for command in COMMANDS.values():
        assert isinstance(command, click.Command)
        assert command.help
        for option in command.params:
            if isinstance(option, click.Option):
                assert option.help, f"{command.name} {option.name}"

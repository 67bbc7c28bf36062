"""Standard output is what a command prints, and nothing else; where it is closed or full, a status says so."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(os.name != "posix", reason="the shell that closes streams is POSIX's")

BUILD = ["build", "-o", "a.stl", "--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8"]
BUILD += ["--control-points", "5", "--deviation", "0.2"]
COMPLETION = {"_GYROID_CAD_COMPLETE": "bash_complete", "COMP_WORDS": "gyroid-cad b", "COMP_CWORD": "1"}


def in_shell(folder: Path, redirected: str, *arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The program in a shell that redirects its streams; the shell says last which status it left with."""
    command = f'"$0" -m gyroid_cad "$@" {redirected}'
    return subprocess.run(
        ["bash", "-c", command, sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_with_streams_closed_the_work_is_done_all_the_same(tmp_path: Path, closed: str) -> None:
    run = in_shell(tmp_path, closed, *BUILD)
    assert (run.returncode, run.stderr) == (0, "")
    # Nor has what would have been printed gone into the file.
    assert (tmp_path / "a.stl").read_bytes().startswith(b"gyroid_cad, millimetres")


@pytest.mark.parametrize("command", ["--version", "fit-report"])
def test_what_only_prints_leaves_without_a_word_where_standard_output_is_closed(tmp_path: Path, command: str) -> None:
    run = in_shell(tmp_path, ">&-", command)
    assert (run.returncode, run.stderr) == (0, "")


@pytest.mark.parametrize(
    ("arguments", "environment"),
    [(BUILD, {}), ([*BUILD, "--json"], {}), (["--help"], {}), (["completion", "bash"], {}), ([], COMPLETION)],
)
def test_a_pipe_that_nobody_reads_ends_it_silently_as_it_ends_other_programs(
    tmp_path: Path, arguments: list[str], environment: dict[str, str]
) -> None:
    run = in_shell(tmp_path, "| exec 0<&-; exit ${PIPESTATUS[0]}", *arguments, **environment)
    assert (run.returncode, run.stdout, run.stderr) == (141, "", "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full is Linux's")
@pytest.mark.parametrize("arguments", [BUILD, [*BUILD, "--json"], ["--version"]])
def test_a_full_device_is_one_line(tmp_path: Path, arguments: list[str]) -> None:
    run = in_shell(tmp_path, ">/dev/full", *arguments)
    line = "gyroid-cad: error: standard output could not be written: No space left on device\n"
    assert (run.returncode, run.stderr) == (1, line)


def test_where_errors_cannot_be_written_either_the_status_is_left(tmp_path: Path) -> None:
    run = in_shell(tmp_path, "2>&-", "build", "-o", "a.xyz")
    assert (run.returncode, run.stdout) == (2, "")


def test_what_the_kernel_prints_is_not_in_the_output(tmp_path: Path) -> None:
    # A BREP file that breaks off: the kernel says so on standard output, in three lines of its own.
    (tmp_path / "a.brep").write_text("\nCASCADE Topology V3, (c) Open Cascade\nLocations 0\nCurve2ds 1\n1 0 0")
    run = in_shell(tmp_path, "", "report", "a.brep", "-o", "a.html", "--json")
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("gyroid-cad: error: a.brep could not be read as BREP")
    assert run.stderr.count("\n") == 1


def test_json_is_all_that_is_printed_while_the_kernel_writes(tmp_path: Path) -> None:
    run = in_shell(tmp_path, "", *BUILD, "-o", "a.step", "-o", "a.brep", "--json")
    assert json.loads(run.stdout)["files"][1]["path"] == "a.step"
    assert run.stdout.count("\n") == 1


def test_a_name_that_is_not_text_is_printed_as_it_is(tmp_path: Path) -> None:
    command = f"cd {tmp_path} && {sys.executable} -m gyroid_cad {' '.join(BUILD)} -o".encode() + b" caf\xe9.step"
    run = subprocess.run(["bash", "-c", command], capture_output=True, check=True)
    assert b"caf\xe9.step" in run.stdout
    assert os.path.exists(os.fsencode(tmp_path) + b"/caf\xe9.step")


def test_letters_that_the_terminal_lacks_are_escaped(tmp_path: Path) -> None:
    run = in_shell(tmp_path, "", *BUILD, "-o", "naïve.step", PYTHONIOENCODING="ascii")
    assert (run.returncode, run.stderr) == (0, "")
    assert "na\\xefve.step" in run.stdout

"""Ctrl-C, `kill` and `kill -9`: no partial file if the program is asked, no process left behind however it ends."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import cadquery
import psutil
import pytest

from gyroid_cad import __main__ as program
from gyroid_cad.errors import GyroidError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.writing import write_3mf
from gyroid_cad.surface.fit import FitSettings

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals are sent to processes")

LARGE = ["--cells", "8", "8", "8", "--cell-size", "10", "--thickness", "0.8"]
PATIENCE = 60.0


def started(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    """The program at work, at the head of a group of its own, as a terminal starts it."""
    return subprocess.Popen(
        [sys.executable, "-m", "gyroid_cad", *arguments],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def interrupted(run: subprocess.Popen[str]) -> None:
    """What Ctrl-C does on a terminal: the whole group is interrupted; and what must come of it."""
    assert run.poll() is None, "it was done before it could be interrupted"
    os.killpg(run.pid, signal.SIGINT)
    out, err = run.communicate(timeout=PATIENCE)
    # Of what takes long its stages are told before.
    assert (out, err.splitlines()[-1:]) == ("", ["gyroid-cad: error: interrupted"])
    assert all(re.match(r" *\d+\.\d s  ", line) for line in err.splitlines()[:-1])
    # Interrupted in text that it executes, such as a dataclass's, Python leaves by the signal: to shells it is 130 too.
    assert run.returncode in (130, -signal.SIGINT)


def wait_for_partial(run: subprocess.Popen[str], folder: Path, size: int = 1) -> None:
    """Until a temporary file in the folder has grown to some size."""
    end = time.monotonic() + PATIENCE
    while run.poll() is None and time.monotonic() < end:
        if any(path.stat().st_size >= size for path in folder.glob(".*.partial*")):
            return
        time.sleep(0.005)
    pytest.fail("no temporary file appeared")


def only_the_older_file(folder: Path, name: str) -> None:
    assert [(path.name, path.read_text()) for path in folder.iterdir()] == [(name, "older")]


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("a.stl", ["build", *LARGE, "--deviation", "0.003"]),
        ("a.inp", ["mesh", *LARGE, "--subdivisions", "8"]),
        ("a.json", ["volumes", *LARGE]),
    ],
)
def test_while_a_large_file_is_written_nothing_of_it_is_left(tmp_path: Path, name: str, arguments: list[str]) -> None:
    (tmp_path / name).write_text("older")
    run = started(tmp_path, *arguments, "-o", name)
    wait_for_partial(run, tmp_path, 10_000)
    interrupted(run)
    only_the_older_file(tmp_path, name)


def test_while_the_kernel_writes_step_both_its_temporary_files_go(tmp_path: Path) -> None:
    # It hears of the interrupt when its writer returns.
    (tmp_path / "a.step").write_text("older")
    run = started(tmp_path, "build", "-o", "a.step", "--cells", "2", "2", "2", *LARGE[4:])
    wait_for_partial(run, tmp_path)
    interrupted(run)
    only_the_older_file(tmp_path, "a.step")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_killed_while_the_kernel_writes_step_it_leaves_neither_temporary_file(
    tmp_path: Path, number: signal.Signals
) -> None:
    (tmp_path / "a.step").write_text("older")
    run = started(tmp_path, "build", "-o", "a.step", "--cells", "2", "2", "2", *LARGE[4:])
    wait_for_partial(run, tmp_path)
    run.send_signal(number)
    assert run.communicate(timeout=PATIENCE) == ("", "")
    assert run.returncode == 128 + number
    only_the_older_file(tmp_path, "a.step")


@pytest.mark.parametrize("seconds", [0.3, 1.2])
def test_while_it_loads_or_builds_no_file_has_begun(tmp_path: Path, seconds: float) -> None:
    (tmp_path / "a.step").write_text("older")
    run = started(tmp_path, "build", "-o", "a.step", *LARGE)
    time.sleep(seconds)
    interrupted(run)
    only_the_older_file(tmp_path, "a.step")


def splitting(folder: Path) -> tuple[subprocess.Popen[str], list[psutil.Process]]:
    """The program that splits a part in processes of its own, and those."""
    cadquery.exporters.export(cadquery.Workplane().circle(15).extrude(20), str(folder / "part.step"))
    run = started(folder, "fill", "part.step", "-o", "a.step", "--cell-size", "8", "--density", "0.3")
    end, workers = time.monotonic() + PATIENCE, []
    while run.poll() is None and time.monotonic() < end:
        time.sleep(0.02)
        # What reads the part is alone, and is there before.
        with suppress(psutil.Error):
            workers = [child for child in psutil.Process(run.pid).children() if "fill" in child.cmdline()]
            if len(workers) > 1:
                return run, workers
    run.kill()
    run.communicate()
    pytest.skip("one processor: nothing is split in processes")


def test_while_a_part_is_split_in_processes_all_of_them_end(tmp_path: Path) -> None:
    run, workers = splitting(tmp_path)
    interrupted(run)
    assert not psutil.wait_procs(workers, timeout=5)[1]
    assert [path.name for path in tmp_path.iterdir()] == ["part.step"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere nothing is split in processes")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_killed_it_takes_its_processes_with_it_whatever_they_are_at(tmp_path: Path, number: signal.Signals) -> None:
    run, workers = splitting(tmp_path)
    run.send_signal(number)
    run.communicate(timeout=PATIENCE)
    assert run.returncode == -number
    assert not psutil.wait_procs(workers, timeout=2)[1]
    assert [path.name for path in tmp_path.iterdir()] == ["part.step"]


def test_an_interrupt_that_comes_while_3mf_is_packed_passes_through_the_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> bytes:
        raise KeyboardInterrupt

    triangulation = Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5)).triangles(0.2).triangulation
    monkeypatch.setattr("ctypes.string_at", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_3mf(*indexed_triangles(triangulation), tmp_path / "a.3mf")
    assert not list(tmp_path.iterdir())


def test_an_interrupt_while_the_program_itself_is_loaded_is_the_same_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Loading:
        def find_spec(self, name: str, *_: object) -> None:
            if name == "gyroid_cad.cli.app":
                raise KeyboardInterrupt

    monkeypatch.delitem(sys.modules, "gyroid_cad.cli.app", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Loading(), *sys.meta_path])
    with pytest.raises(SystemExit) as left:
        program.run()
    assert left.value.code == 130
    assert capsys.readouterr().err == "gyroid-cad: error: interrupted\n"
    assert not issubclass(KeyboardInterrupt, GyroidError)

"""Progress on the terminal: real fractions, and the time that remains where they are known."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cadquery
import pytest
from rich.progress import Progress, TimeRemainingColumn

from gyroid_cad.cli import build as cli_build
from gyroid_cad.cli import fill as cli_fill
from gyroid_cad.cli import mesh as cli_mesh
from gyroid_cad.cli.app import main
from gyroid_cad.cli.bars import terminal_progress
from gyroid_cad.cli.console import shown_progress

Told = list[tuple[str, int, int]]

# A wall that no other test builds: what is built already tells of no stage again.
CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8125", "--control-points", "5"]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Told:
    """All that commands tell of how far they have come."""
    steps: Told = []

    @contextmanager
    def listening(shown: bool, lines: bool = False) -> Iterator[object]:
        yield lambda *step: steps.append(step)

    for module in (cli_build, cli_fill, cli_mesh):
        monkeypatch.setattr(module, "shown_progress", listening)
    return steps


def fractions(told: Told, stage: str) -> list[tuple[int, int]]:
    return [(done, total) for name, done, total in told if name == stage]


@pytest.fixture
def display(monkeypatch: pytest.MonkeyPatch) -> list[Progress]:
    """The displays that are opened."""
    opened: list[Progress] = []
    enter = Progress.__enter__

    def entered(self: Progress) -> Progress:
        opened.append(self)
        return enter(self)

    monkeypatch.setattr(Progress, "__enter__", entered)
    return opened


def test_the_time_that_remains_is_told_of_a_stage_that_tells_how_far_it_is(display: list[Progress]) -> None:
    with terminal_progress() as update:
        (shown,) = display
        clock = iter(range(100))
        shown.get_time = lambda: float(next(clock))  # type: ignore[method-assign]
        shown._started_time = 0.0  # type: ignore[attr-defined]
        for done in (0, 10, 20, 30):
            update("write", done, 100)
        (task,) = shown.tasks
        assert (task.completed, task.total) == (30, 100)
        assert task.time_remaining is not None
        assert task.time_remaining > 0
        assert any(isinstance(column, TimeRemainingColumn) for column in shown.columns)


def test_a_stage_that_only_begins_and_ends_has_no_fraction_until_it_ends(display: list[Progress]) -> None:
    with terminal_progress() as update:
        update("check", 0, 1)
        (task,) = display[0].tasks
        assert (task.total, task.finished) == (None, False)
        update("check", 1, 1)
        assert (task.total, task.finished) == (1, True)


def test_what_has_begun_again_ends_again(display: list[Progress]) -> None:
    with terminal_progress() as update:
        for step in ((0, 1), (1, 1), (0, 1), (3, 9), (9, 9)):
            update("solid", *step)
        (task,) = display[0].tasks
        assert (task.completed, task.total) == (9, 9)


def test_build_tells_of_patches_in_the_solid_and_of_triangles_in_stl(told: Told, tmp_path: Path) -> None:
    cells = [*CELL[:1], "4", "4", "2", *CELL[4:]]
    files = ["-o", str(tmp_path / "a.brep"), "-o", str(tmp_path / "a.stl")]
    assert main(["build", *files, *cells, "--deviation", "0.1", "--quiet"]) == 0
    for stage in ("solid", "write a.stl"):
        steps = fractions(told, stage)
        total = max(total for _, total in steps)
        between = {done for done, of in steps if of == total} - {0, total}
        assert between, stage
        assert steps[-1][0] == steps[-1][1]
    for stage in ("complex", "wall", "check", "write a.brep"):
        assert fractions(told, stage)[-1] == (1, 1)


def test_fill_tells_how_far_the_cutting_is_and_of_every_file(told: Told, tmp_path: Path) -> None:
    part, filled = tmp_path / "part.step", tmp_path / "a.brep"
    cadquery.exporters.export(cadquery.Workplane().circle(4).extrude(7), str(part))
    size = ["--cell-size", "10", "--density", "0.3", "--control-points", "5"]
    assert main(["fill", str(part), "-o", str(filled), *size, "--quiet"]) == 0
    done, total = max(fractions(told, "cut"), key=lambda step: step[::-1])
    assert done == total > 1
    assert fractions(told, "cut")[-1] == (1, 1)
    assert fractions(told, "write a.brep") == [(0, 1), (1, 1)]


def test_fill_forecasts_what_it_takes_before_it_begins_and_prints_a_line_a_stage_into_logs(
    told: Told, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    part, filled = tmp_path / "part.step", tmp_path / "a.brep"
    cadquery.exporters.export(cadquery.Workplane().box(4, 4, 4), str(part))
    command = ["fill", str(part), "-o", str(filled), "--cell-size", "8", "--density", "0.3", "--control-points", "5"]
    monkeypatch.setattr(cli_fill, "shown_progress", shown_progress)
    # What takes no longer than this is not told of.
    monkeypatch.setattr("gyroid_cad.cli.console.SILENT_SECONDS", 0.0)
    assert main(command) == 0
    lines = [line.split(" s  ", 1) for line in capsys.readouterr().err.splitlines()]
    stages = [stage for _, stage in lines]
    assert stages.pop(0) == "read"
    assert re.fullmatch(r"about \d+ crossings, \d+ faces, .* GB of memory, .* MB of STEP, \d+ s", stages[0])
    assert stages == list(dict.fromkeys(stages))
    assert stages[-1] == "write a.brep"
    assert [float(seconds) for seconds, _ in lines] == sorted(float(seconds) for seconds, _ in lines)
    assert main([*command, "--quiet"]) == 0
    assert capsys.readouterr().err == ""


def test_the_time_that_remains_of_all_is_the_forecasts_less_what_has_passed(display: list[Progress]) -> None:
    with terminal_progress() as update:
        update("about 300 crossings", 0, 50)
        (shown,) = display
        (column,) = (column for column in shown.columns if isinstance(column, TimeRemainingColumn))
        (task,) = shown.tasks
        assert str(column.render(task)) in ("0:00:50", "0:00:49")


def test_mesh_and_volumes_tell_of_every_stage(told: Told, tmp_path: Path) -> None:
    files = tmp_path / "a.inp", tmp_path / "a.npz"
    assert main(["mesh", "-o", str(files[0]), *CELL, "--subdivisions", "6", "--quiet"]) == 0
    assert main(["volumes", "-o", str(files[1]), *CELL, "--quiet"]) == 0
    for stage in ("wall", "elements", "mesh", "write a.inp", "volumes", "write a.npz"):
        done, total = fractions(told, stage)[-1]
        assert done == total, stage
    assert max(total for _, total in fractions(told, "mesh")) > 1000

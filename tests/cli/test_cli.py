"""The command line: one object or one table on stdout, one line on stderr if it fails, and a status."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import psutil
import pytest

from gyroid_cad import __version__
from gyroid_cad.builds import solid as build_module
from gyroid_cad.cli.app import main
from gyroid_cad.common import formats, memory
from gyroid_cad.kernel.check import topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fit_report

Captured = pytest.CaptureFixture[str]

KEYS = [
    *("cells", "cell_size", "cells_alike", "thickness", "min_thickness", "max_thickness", "density"),
    *("patches", "faces", "solids", "islands", "islands_volume", "dropped", "dropped_volume"),
    *(
        "control_points",
        "valid",
        "closed",
        "checked_by",
        "boundary_edges",
        "non_manifold_edges",
        "volume",
        "volume_exact",
        "area",
    ),
    *("max_deviation", "max_wall_error", "max_normal_angle", "samples_per_patch", "seconds", "files"),
]
ONE_CELL = ["--cells", "1", "1", "1", "--cell-size", "10"]
WALL = ["--thickness", "0.8"]
COARSE = ["--control-points", "5"]


def in_process(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main([str(argument) for argument in arguments])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


def as_a_program(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gyroid_cad", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("options", "solids", "row"), [([], 1, "0 left, 2 dropped"), (["--keep-islands"], 3, "2 left")]
)
def test_chips_of_a_trimmed_lattice_are_in_the_table_and_the_json_and_stderr_is_silent(
    capsys: Captured, tmp_path: Path, options: list[str], solids: int, row: str
) -> None:
    trimmed = ["build", "-o", tmp_path / "a.brep", *ONE_CELL, *WALL, *COARSE, "--trim", "box", *options]
    shown, told = in_process(capsys, *trimmed), in_process(capsys, *trimmed, "--json")
    assert (shown.status, shown.err, told.err) == (0, "", "")
    assert row in shown.out
    summary = json.loads(told.out)
    assert summary["solids"] == solids == 1 + summary["islands"]
    assert summary["islands"] + summary["dropped"] == 2
    assert summary["islands_volume"] + summary["dropped_volume"] == pytest.approx(0.113, abs=0.005)


@pytest.fixture(scope="module")
def program_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """One run of the real program, in pipes: a STEP and an STL file, and JSON."""
    folder = tmp_path_factory.mktemp("program")
    files = ["-o", folder / "part.step", "-o", folder / "part.stl"]
    return folder, as_a_program("build", *files, "--cells", "2", "1", "1", "--cell-size", "10", *WALL, "--json")


def assert_failed(run: Any, status: int, folder: Path, *words: str) -> None:
    """One line on stderr, nothing on stdout, nothing in the folder."""
    assert run.status == status
    assert run.out == ""
    assert len(run.err.splitlines()) == 1
    assert run.err.startswith("gyroid-cad: error: ")
    assert "Traceback" not in run.err
    assert all(word in run.err for word in words), run.err
    assert not list(folder.iterdir())


def test_in_pipes_stdout_is_one_json_object_and_stderr_is_silent(
    program_run: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, run = program_run
    assert run.returncode == 0
    assert run.stderr == ""
    assert run.stdout.count("\n") == 1
    summary = json.loads(run.stdout)
    assert list(summary) == KEYS
    assert summary["files"] == [
        {"path": str(folder / name), "bytes": (folder / name).stat().st_size} for name in ("part.step", "part.stl")
    ]
    assert sorted(path.name for path in folder.iterdir()) == ["part.step", "part.stl"]


def test_what_the_program_says_of_its_file_is_true_of_the_file(
    program_run: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    folder, run = program_run
    summary, counted = json.loads(run.stdout), topology(read_step(folder / "part.step"))
    assert (summary["faces"], summary["solids"], summary["closed"]) == (counted.faces, counted.solids, counted.closed)
    assert summary["valid"]
    assert summary["faces"] == 2 * summary["patches"] + summary["boundary_edges"]
    assert summary["volume"] == pytest.approx(summary["volume_exact"], rel=2e-6)


def test_the_json_is_the_lattices_own_report(capsys: Captured, tmp_path: Path) -> None:
    run = in_process(capsys, "build", "-o", tmp_path / "a.brep", *ONE_CELL, "--density", "0.25", *COARSE, "--json")
    summary = json.loads(run.out)
    report = Lattice((1, 1, 1), 10.0, density=0.25, fit=FitSettings(5)).report(kernel_check=True).as_dict()
    assert run.status == 0
    assert list(summary) == KEYS
    for key in set(KEYS) - {"seconds", "files", "cells"}:
        assert summary[key] == report[key]
    assert summary["cells"] == list(report["cells"])
    assert summary["density"] == 0.25
    assert set(summary["seconds"]) >= {"write a.brep", "fit report", "total"}
    assert summary["seconds"]["total"] > 0


def test_without_json_a_table_says_the_same_and_names_each_file(capsys: Captured, tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("a.step", "b.brep", "c.stl")]
    outputs = [argument for path in files for argument in ("-o", path)]
    run = in_process(capsys, "build", *outputs, *ONE_CELL, *WALL, *COARSE, "--deviation", "0.1")
    assert run.status == 0
    assert run.err == ""
    lines = run.out.splitlines()
    for path in files:
        assert [line.split() for line in lines if str(path) in line] == [
            [str(path), f"{path.stat().st_size:,}", "bytes"]
        ]
    assert "1 x 1 x 1, 10 mm each" in run.out
    assert "84 (valid and closed)" in run.out


def test_a_path_of_any_length_stands_whole_on_its_line(capsys: Captured, tmp_path: Path) -> None:
    folder = tmp_path / ("x" * 120) / ("y" * 120)
    folder.mkdir(parents=True)
    run = in_process(capsys, "build", "-o", folder / "a.brep", *ONE_CELL, *WALL, *COARSE)
    assert str(folder / "a.brep") in run.out


def test_quiet_prints_nothing_but_writes_the_file(capsys: Captured, tmp_path: Path) -> None:
    run = in_process(capsys, "build", "-o", tmp_path / "a.brep", *ONE_CELL, *WALL, *COARSE, "--quiet")
    assert (run.status, run.out, run.err) == (0, "", "")
    assert (tmp_path / "a.brep").stat().st_size > 0


def test_options_reach_the_file(capsys: Captured, tmp_path: Path) -> None:
    outputs = ["-o", tmp_path / "a.step", "-o", tmp_path / "a.stl"]
    sizes = []
    for deviation in ("0.5", "0.05"):
        settings = ["--schema", "ap242", "--deviation", deviation]
        run = in_process(capsys, "build", *outputs, *ONE_CELL, *WALL, *COARSE, *settings)
        assert run.status == 0
        sizes.append((tmp_path / "a.stl").stat().st_size)
    assert sizes[0] < sizes[1]
    assert "AP242" in (tmp_path / "a.step").read_text()[:1000]


def test_the_angle_reaches_the_triangles_of_a_trimmed_lattice(capsys: Captured, tmp_path: Path) -> None:
    sizes = []
    for angle in ("40", "10"):
        settings = ["--trim", "box", "--deviation", "0.5", "--angle", angle]
        assert in_process(capsys, "build", "-o", tmp_path / "a.stl", *ONE_CELL, *WALL, *COARSE, *settings).status == 0
        sizes.append((tmp_path / "a.stl").stat().st_size)
    assert sizes[0] < sizes[1]


def test_files_of_triangles_alone_are_reported_as_triangles(capsys: Captured, tmp_path: Path) -> None:
    outputs = ["-o", tmp_path / "a.stl", "-o", tmp_path / "b.3mf"]
    settings = [*ONE_CELL, *WALL, *COARSE, "--deviation", "0.1"]
    summary = json.loads(in_process(capsys, "build", *outputs, *settings, "--json").out)
    report = Lattice((1, 1, 1), 10.0, 0.8, fit=FitSettings(5)).triangle_report(0.1).as_dict()
    assert list(summary) == [*report, "files"]
    for key in set(report) - {"seconds", "cells"}:
        assert summary[key] == report[key]
    assert set(summary["seconds"]) >= {"triangles", "write a.stl", "write b.3mf", "total"}
    assert summary["files"] == [
        {"path": str(tmp_path / name), "bytes": (tmp_path / name).stat().st_size} for name in ("a.stl", "b.3mf")
    ]
    assert summary["files"][0]["bytes"] == 84 + 50 * summary["triangles"]
    lines = in_process(capsys, "build", *outputs, *settings).out.splitlines()
    assert any(line.startswith("triangles") and f"{summary['triangles']:,} (closed)" in line for line in lines)
    assert any(str(tmp_path / "b.3mf") in line for line in lines)


def test_an_assembly_is_reported_as_one_and_holds_every_cell(capsys: Captured, tmp_path: Path) -> None:
    given = ["--cells", "2", "1", "3", "--cell-size", "10", *WALL, *COARSE, "-o", tmp_path / "a.step", "--instances"]
    summary = json.loads(in_process(capsys, "build", *given, "--json").out)
    report = Lattice((2, 1, 3), 10.0, 0.8, fit=FitSettings(5)).assembly_report().as_dict()
    assert list(summary) == [*report, "files"]
    for key in set(report) - {"seconds", "cells"}:
        assert summary[key] == report[key]
    assert summary["instances"] == topology(read_step(tmp_path / "a.step")).solids == 6
    assert summary["files"] == [{"path": str(tmp_path / "a.step"), "bytes": (tmp_path / "a.step").stat().st_size}]
    lines = in_process(capsys, "build", *given).out.splitlines()
    assert any(line.startswith("instances") and "6 of one valid and closed solid" in line for line in lines)


def test_the_config_of_an_assembly_makes_the_same_assembly(capsys: Captured, tmp_path: Path) -> None:
    given = [*ONE_CELL, *WALL, *COARSE, "-o", tmp_path / "a.step"]
    printed = in_process(capsys, "build", *given, "--instances", "--print-config").out
    assert "instances = true" in printed
    assert "instances" not in in_process(capsys, "build", *given, "--print-config").out
    (tmp_path / "lattice.toml").write_text(printed)
    assert json.loads(in_process(capsys, "build", tmp_path / "lattice.toml", "--json").out)["instances"] == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["build"], ["--output"]),
        (["build", *ONE_CELL, *WALL], ["Missing option", "--output"]),
        (["build", "-o", "a.step", "--cell-size", "10", *WALL], ["Missing option", "--cells"]),
        (["build", "-o", "a.step", "--cells", "1", "1", *WALL], ["--cells"]),
        (["build", "-o", "a.step", "--cells", "1", "1", "1.5", "--cell-size", "10", *WALL], ["--cells", "1.5"]),
        (["build", "-o", "a.step", "--cells", "0", "1", "1", "--cell-size", "10", *WALL], ["--cells = (0, 1, 1)"]),
        (["build", "-o", "a.step", "--cells", "1", "1", "1", "--cell-size", "0", *WALL], ["--cell-size = 0.0"]),
        (["build", "-o", "a.step", "--cells", "1", "1", "1", "--cell-size", "nan", *WALL], ["--cell-size = nan"]),
        (["build", "-o", "a.step", *ONE_CELL], ["exactly one of --thickness, --density, --porosity"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--density", "0.2"], ["exactly one of"]),
        (["build", "-o", "a.step", *ONE_CELL, "--thickness", "3.8"], ["--thickness = 3.8", "below 3.7647 mm"]),
        (["build", "-o", "a.step", *ONE_CELL, "--thickness", "thin"], ["--thickness", "thin"]),
        (["build", "-o", "a.step", *ONE_CELL, "--density", "1"], ["--density = 1.0", "above 0 and below 0.94"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--control-points", "41"], ["--control-points = 41", "4 to 40"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--control-points", "2.5"], ["--control-points", "2.5"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--fit", "paper", "--control-points", "12"], ["10, the paper's"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--fit", "rough"], ["--fit", "rough"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--schema", "ap203"], ["--schema", "ap203"]),
        (["build", "-o", "a.stl", *ONE_CELL, *WALL, "--deviation", "0"], ["--deviation = 0.0"]),
        (["build", "-o", "a.stl", *ONE_CELL, *WALL, "--deviation", "1e-7"], ["--deviation = 1e-07", "1e-06 mm"]),
        (["build", "-o", "a.stl", *ONE_CELL, *WALL, "--angle", "90"], ["--angle = 90.0"]),
        (
            ["build", "-o", "a.dwg", *ONE_CELL, *WALL],
            ["-o = 'a.dwg'", ".stp, .stpz, .step.gz, .stp.gz, .brep, .stl, .3mf"],
        ),
        (["build", "-o", "a.step", "-o", "./a.step", *ONE_CELL, *WALL], ["-o = ", "each file once"]),
        (["build", "-o", "a.stl", *ONE_CELL, *WALL, "--instances"], ["-o = 'a.stl'", ".step, .stp, .stpz"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--trim", "box", "--instances"], ["--instances", "not trimmed"]),
        (["build", "-o", "missing/a.step", *ONE_CELL, *WALL], ["-o = 'missing/a.step'", "existing folder"]),
        (["build", "-o", "a.step", *ONE_CELL, *WALL, "--colour", "red"], ["--colour"]),
        (["built"], ["built"]),
        (["fit-report", "--control-points", "3"], ["--control-points = 3", "4 to 40"]),
    ],
)
def test_bad_usage_is_one_line_and_status_two(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], words: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert_failed(in_process(capsys, *arguments), 2, tmp_path, *words)


def test_more_cells_than_memory_holds_are_bad_usage_counted_in_gigabytes(capsys: Captured, tmp_path: Path) -> None:
    cells = ["--cells", "9999", "9999", "9999", "--cell-size", "10"]
    run = in_process(capsys, "build", "-o", tmp_path / "a.step", *cells, *WALL)
    assert_failed(run, 2, tmp_path, "--cells = (9999, 9999, 9999)", "GB of memory")


def test_memory_that_suffices_for_the_solid_but_not_for_its_file_is_the_same_error(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    between = memory._BASE_BYTES + (build_module._SOLID_BYTES_PER_CELL + formats.FILE_BYTES_PER_CELL) / 2
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=between))
    run = in_process(capsys, "build", "-o", tmp_path / "a.step", *ONE_CELL, *WALL, *COARSE)
    assert_failed(run, 2, tmp_path, "--cells = (1, 1, 1)", "GB are free")


def test_the_papers_fit_fails_with_the_gap_it_leaves(capsys: Captured, tmp_path: Path) -> None:
    run = in_process(capsys, "build", "-o", tmp_path / "a.step", *ONE_CELL, *WALL, "--fit", "paper")
    gap = fit_report(fit_patch(FitSettings.paper())).edge_gap
    assert_failed(run, 1, tmp_path, f"{gap:.2e} of the cell size apart")


def test_a_failed_write_is_status_one_and_keeps_the_older_file(
    capsys: Captured, tmp_path: Path, disk_full: Callable[[int], AbstractContextManager[None]]
) -> None:
    path = tmp_path / "a.step"
    path.write_text("older")
    with disk_full(10_000):
        run = in_process(capsys, "build", "-o", path, *ONE_CELL, *WALL, *COARSE)
    assert path.read_text() == "older"
    path.unlink()
    assert_failed(run, 1, tmp_path, f"{path} was not written")


def test_an_interrupt_is_one_line_and_a_status_of_its_own(
    capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Lattice, "write", interrupted)
    run = in_process(capsys, "build", "-o", tmp_path / "a.step", *ONE_CELL, *WALL)
    assert_failed(run, 130, tmp_path, "interrupted")


def test_even_a_defect_of_ours_is_one_line(capsys: Captured, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def defective(*_: object, **__: object) -> None:
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr(Lattice, "write", defective)
    run = in_process(capsys, "build", "-o", tmp_path / "a.step", *ONE_CELL, *WALL)
    assert_failed(run, 1, tmp_path, "unexpected ZeroDivisionError: a b")


def test_the_program_leaves_with_the_status_of_its_command(tmp_path: Path) -> None:
    for wall, status in ((["--thickness", "4"], 2), ([*WALL, "--fit", "paper"], 1)):
        run = as_a_program("build", "-o", tmp_path / "a.step", *ONE_CELL, *wall)
        assert_failed(SimpleNamespace(status=run.returncode, out=run.stdout, err=run.stderr), status, tmp_path)


def test_on_a_terminal_progress_is_shown_on_stderr_and_stdout_stays_json(tmp_path: Path) -> None:
    pytest.importorskip("pty")
    terminal, program_end = os.openpty()
    shown: list[bytes] = []

    def read_terminal() -> None:
        try:
            while text := os.read(terminal, 4096):
                shown.append(text)
        except OSError:  # the other end is closed
            return

    reader = threading.Thread(target=read_terminal)
    reader.start()
    command = [sys.executable, "-m", "gyroid_cad", "build", "-o", str(tmp_path / "a.brep"), *ONE_CELL, *WALL, "--json"]
    run = subprocess.run(
        command, stdout=subprocess.PIPE, stderr=program_end, check=True, env={**os.environ, "TERM": "xterm"}
    )
    os.close(program_end)
    reader.join()
    os.close(terminal)
    assert list(json.loads(run.stdout)) == KEYS
    assert b"solid" in b"".join(shown)


def test_the_fit_report_sets_ours_beside_the_papers(capsys: Captured) -> None:
    run = in_process(capsys, "fit-report", "--control-points", "8", "--json")
    reports = json.loads(run.out)
    assert list(reports) == ["smooth", "paper"]
    assert run.out.count("\n") == 1
    assert reports["smooth"]["max_distance"] == fit_report(fit_patch(FitSettings(8))).max_distance
    assert reports["smooth"]["edge_gap"] < 1e-12 < reports["paper"]["edge_gap"]
    table = in_process(capsys, "fit-report", "--control-points", "8")
    assert "ours (8 x 8)" in table.out
    for key in reports["paper"]:
        assert f"{reports['paper'][key]:.2e}" in table.out


def test_version_and_help_are_printed_and_help_says_millimetres(capsys: Captured) -> None:
    assert in_process(capsys, "--version").out.startswith(f"gyroid-cad {__version__}, ")
    assert "millimetres" in in_process(capsys, "--help").out
    for command in ("build", "fit-report"):
        shown = in_process(capsys, command, "--help")
        assert (shown.status, shown.err) == (0, "")
        assert "--control-points" in shown.out

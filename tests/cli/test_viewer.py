"""The viewer: off screen into pictures, whose pixels are looked at, and what it says where it cannot draw."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cadquery.vis
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from gyroid_cad.cli import viewer
from gyroid_cad.cli.app import main
from gyroid_cad.cli.viewer import can_draw_off_screen, view
from gyroid_cad.errors import ExportError, GyroidError, ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(5)
ONE_CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--control-points", "5"]


@pytest.fixture(scope="module")
def drawing() -> None:
    """For tests that really draw; whether that can be is tried only where one of them runs."""
    if not can_draw_off_screen():
        pytest.skip("neither a display nor EGL nor OSMesa to draw with")


@pytest.fixture
def lattice() -> Lattice:
    return Lattice((1, 1, 1), 10.0, 0.8, fit=COARSE)


def pixels(path: Path) -> NDArray[np.int64]:
    """Red, green and blue, without the axes in the corner."""
    with Image.open(path) as image:
        assert image.format == "PNG"
        return np.asarray(image.convert("RGB"), dtype=np.int64)[:600, :800]


def covered(path: Path) -> NDArray[np.bool_]:
    return np.asarray(pixels(path).min(axis=-1) < 250)


def agreement(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float(np.sum(one & other) / np.sum(one | other))


@pytest.mark.usefixtures("drawing")
def test_a_lattice_its_stl_its_brep_and_its_step_file_look_the_same(lattice: Lattice, tmp_path: Path) -> None:
    lattice.write(*(tmp_path / f"cell{ending}" for ending in (".stl", ".brep", ".step")))
    view(lattice, tmp_path / "lattice.png")
    shape = covered(tmp_path / "lattice.png")
    assert 0.05 < shape.mean() < 0.8
    for ending in (".stl", ".brep", ".step"):
        view(tmp_path / f"cell{ending}", tmp_path / "file.png")
        assert agreement(shape, covered(tmp_path / "file.png")) > 0.97


@pytest.mark.usefixtures("drawing")
def test_an_assembly_is_shown_in_the_papers_colours(lattice: Lattice, tmp_path: Path) -> None:
    lattice.write(tmp_path / "cell.step", instances=True)
    view(tmp_path / "cell.step", tmp_path / "cell.png")
    red, green, blue = np.moveaxis(pixels(tmp_path / "cell.png"), -1, 0)
    bright = blue < 60
    for wanted in ((red > 120) & (green < 60), (green > 120) & (red < 60), (red > 120) & (green > 120)):
        assert np.sum(wanted & bright) > 50


@pytest.mark.usefixtures("drawing")
def test_the_command_draws_a_trimmed_lattice_from_the_file_that_build_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / "lattice.toml", tmp_path / "trimmed.png"
    file.write_text(
        'cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ntrim = "box"\ncontrol_points = 5\n'
        'output = "part.step"\nschema = "ap242"\ninstances = false\n'
    )
    assert main(["view", str(file), "--screenshot", str(picture)]) == 0
    assert capsys.readouterr() == ("", "")
    assert 0.05 < covered(picture).mean() < 0.9
    assert sorted(path.name for path in tmp_path.iterdir()) == ["lattice.toml", "trimmed.png"]


@pytest.mark.usefixtures("drawing")
def test_without_a_display_the_program_draws_off_screen_and_says_nothing(tmp_path: Path) -> None:
    run = program("view", *ONE_CELL, "--screenshot", str(tmp_path / "cell.png"))
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert covered(tmp_path / "cell.png").any()


def program(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """The real program, with no display but what is given."""
    without = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    command = [sys.executable, "-m", "gyroid_cad", *arguments]
    return subprocess.run(command, env={**without, **environment}, capture_output=True, text=True, check=False)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there always is a desktop")
@pytest.mark.parametrize(
    ("environment", "words"), [({}, "DISPLAY is not set"), ({"DISPLAY": ":4321"}, "DISPLAY=:4321 does not answer")]
)
def test_without_a_display_a_window_is_refused_in_one_line_that_says_what_to_do(
    environment: dict[str, str], words: str
) -> None:
    run = program("view", *ONE_CELL, **environment)
    assert run.returncode == 1
    assert run.stdout == ""
    assert run.stderr.splitlines() == [
        f"gyroid-cad: error: no display to open a window on: {words}; --screenshot FILE.png draws without one"
    ]


@pytest.mark.parametrize("trial", ["raise SystemExit(1)", "import os; os.abort()"])
def test_where_vtk_would_end_the_process_it_is_not_asked(
    trial: str, lattice: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "has_display", lambda: False)
    monkeypatch.setattr(viewer, "_TRIAL", trial)
    monkeypatch.setattr(cadquery.vis, "show", lambda *things, **look: pytest.fail("shown"))
    with pytest.raises(GyroidError, match=r"nothing to draw with: .* apt-get install libegl1"):
        view(lattice, tmp_path / "cell.png")
    assert not list(tmp_path.iterdir())


def test_with_a_display_a_window_stays_until_it_is_closed(lattice: Lattice, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[dict[str, Any]] = []
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    monkeypatch.setattr(cadquery.vis, "show", lambda *things, **look: shown.append(look))
    view(lattice)
    (look,) = shown
    assert look["title"] == "gyroid lattice"
    # CadQuery's own defaults: interact, no screenshot.
    assert not {"interact", "screenshot"} & set(look)


def cut_short(*things: Any, screenshot: str, **look: Any) -> None:
    Path(screenshot).write_bytes(b"\x89PNG\r\n\x1a\n")


def nothing_written(*things: Any, **look: Any) -> None:
    pass


@pytest.mark.parametrize("show", [cut_short, nothing_written])
def test_a_picture_that_failed_leaves_the_older_one(
    show: Callable[..., None], lattice: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "can_draw_off_screen", lambda: True)
    monkeypatch.setattr(cadquery.vis, "show", show)
    older = tmp_path / "cell.png"
    older.write_text("older")
    with pytest.raises(ExportError, match="was not written"):
        view(lattice, older)
    assert older.read_text() == "older"
    assert list(tmp_path.iterdir()) == [older]


@pytest.mark.parametrize("name", ["part.step", "part.brep", "part.stl"])
def test_a_file_that_is_not_what_its_ending_says_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(viewer, "can_draw_off_screen", lambda: True)
    (tmp_path / name).write_text("nonsense")
    assert main(["view", str(tmp_path / name), "--screenshot", str(tmp_path / "a.png")]) == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith(f"gyroid-cad: error: {tmp_path / name} could not be read as")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("what", "screenshot", "words"),
    [
        ("part.obj", None, "file = 'part.obj': expected a file ending in .step, .stp, .brep, .stl"),
        ("missing.step", None, "file = 'missing.step': expected a file that exists"),
        ("missing.step", "a.jpg", "screenshot = 'a.jpg': expected a file name ending in .png"),
        ("missing.step", "no/a.png", "existing folder"),
    ],
)
def test_names_that_will_not_do_are_refused_before_anything_is_drawn(
    what: str, screenshot: str | None, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ParameterError) as refused:
        view(what, screenshot)
    assert words in str(refused.value)


def test_help_names_what_can_be_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "--help"]) == 0
    out = capsys.readouterr().out
    for words in ("[LATTICE.toml|FILE]", ".step, .stp, .brep or .stl", "--screenshot FILE.png"):
        assert words in out

"""What is looked at: pictures, whose pixels are looked at, windows, and what is said where there is none."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cadquery as cq
import cadquery.vis
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from gyroid_cad.cli import view as viewer
from gyroid_cad.cli.app import main
from gyroid_cad.cli.view import view
from gyroid_cad.errors import GyroidError, MissingHostError, ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(5)
ONE_CELL = ["--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--control-points", "5"]
FILES = (".stl", ".3mf", ".brep", ".step")


@pytest.fixture
def lattice() -> Lattice:
    return Lattice((1, 1, 1), 10.0, 0.8, fit=COARSE)


def pixels(path: Path) -> NDArray[np.int64]:
    with Image.open(path) as image:
        assert image.format == "PNG"
        return np.asarray(image.convert("RGBA"), dtype=np.int64)


def covered(path: Path) -> NDArray[np.bool_]:
    return np.asarray(pixels(path)[..., 3] > 127)


def agreement(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    return float(np.sum(one & other) / np.sum(one | other))


# Pictures.


def test_a_lattice_and_its_files_look_the_same(lattice: Lattice, tmp_path: Path) -> None:
    lattice.write(*(tmp_path / f"cell{ending}" for ending in FILES))
    view(lattice, tmp_path / "lattice.png")
    shape = covered(tmp_path / "lattice.png")
    assert 0.05 < shape.mean() < 0.8
    for ending in FILES:
        view(tmp_path / f"cell{ending}", tmp_path / "file.png")
        assert agreement(shape, covered(tmp_path / "file.png")) > 0.99


def test_an_assembly_is_shown_in_the_papers_colours(lattice: Lattice, tmp_path: Path) -> None:
    lattice.write(tmp_path / "cell.step", instances=True)
    view(tmp_path / "cell.step", tmp_path / "cell.png")
    red, green, blue, _ = np.moveaxis(pixels(tmp_path / "cell.png"), -1, 0)
    pure = blue < 60
    for wanted in ((red > 120) & (green < 60), (green > 120) & (red < 60), (red > 120) & (green > 120)):
        assert np.sum(wanted & pure) > 50


def test_an_assembly_of_many_looks_like_the_solid_and_its_part_is_meshed_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lattice = Lattice((2, 2, 1), 10.0, 0.8, fit=COARSE)
    lattice.write(tmp_path / "many.step", instances=True)
    meshed: list[object] = []
    facets_of_shape = viewer.facets_of_shape
    monkeypatch.setattr(viewer, "facets_of_shape", lambda *some: meshed.append(some) or facets_of_shape(*some))
    view(tmp_path / "many.step", tmp_path / "many.png")
    # Meshing each place by itself took two minutes for a thousand cells.
    assert len(meshed) == 1
    view(lattice, tmp_path / "whole.png")
    assert agreement(covered(tmp_path / "many.png"), covered(tmp_path / "whole.png")) > 0.98


def test_the_command_draws_a_trimmed_lattice_from_the_file_that_build_reads(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file, picture = tmp_path / "lattice.toml", tmp_path / "trimmed.png"
    file.write_text(
        'cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ntrim = "box"\ncontrol_points = 5\n'
        'output = "part.step"\nschema = "ap242"\ninstances = false\n'
    )
    for option in ("-o", "--screenshot"):
        assert main(["view", str(file), option, str(picture)]) == 0
        assert capsys.readouterr() == ("", "")
        assert 0.05 < covered(picture).mean() < 0.9
        picture.unlink()
    assert [path.name for path in tmp_path.iterdir()] == ["lattice.toml"]


def test_a_file_may_name_its_picture(tmp_path: Path) -> None:
    (tmp_path / "lattice.toml").write_text(
        'cells = [1, 1, 1]\ncell_size = 10\nthickness = 0.8\ncontrol_points = 5\nscreenshot = "cell.png"\n'
    )
    assert main(["view", str(tmp_path / "lattice.toml")]) == 0
    assert covered(tmp_path / "cell.png").any()


def test_a_picture_takes_neither_a_display_nor_vtk(tmp_path: Path) -> None:
    loaded = (
        "import sys; from gyroid_cad.cli.app import main; sys.exit(main(sys.argv[1:]) or 'vtkmodules' in sys.modules)"
    )
    run = program("-c", loaded, "view", *ONE_CELL, "-o", str(tmp_path / "cell.png"))
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert covered(tmp_path / "cell.png").any()


def test_a_picture_that_failed_leaves_the_older_one(
    lattice: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*arguments: object) -> None:
        raise GyroidError("no")

    monkeypatch.setattr(viewer, "draw", fail)
    older = tmp_path / "cell.png"
    older.write_text("older")
    with pytest.raises(GyroidError):
        view(lattice, older)
    assert older.read_text() == "older"
    assert list(tmp_path.iterdir()) == [older]


# Windows.


def program(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Python, with no display but what is given."""
    without = {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}
    return subprocess.run(
        [sys.executable, *arguments], env={**without, **environment}, capture_output=True, text=True, check=False
    )


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="elsewhere there always is a desktop")
@pytest.mark.parametrize(
    ("environment", "words"), [({}, "DISPLAY is not set"), ({"DISPLAY": ":4321"}, "DISPLAY=:4321 does not answer")]
)
def test_without_a_display_a_window_is_refused_in_one_line_that_says_what_to_do(
    environment: dict[str, str], words: str
) -> None:
    run = program("-m", "gyroid_cad", "view", *ONE_CELL, **environment)
    assert run.returncode == 1
    assert run.stdout == ""
    assert run.stderr.splitlines() == [
        f"gyroid-cad: error: no display to open a window on: {words}; -o FILE.png draws without one"
    ]


def test_without_cadquery_a_window_is_refused_before_any_work(
    lattice: Lattice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    monkeypatch.setitem(sys.modules, "cadquery", None)
    monkeypatch.delitem(sys.modules, "gyroid_cad.cli.window", raising=False)
    stages: list[str] = []
    with pytest.raises(MissingHostError, match=r'pip install "gyroid_cad\[cadquery\]"'):
        view(lattice, progress=lambda stage, done, total: stages.append(stage))
    assert stages == []


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, dict[str, Any]]]:
    """What CadQuery's viewer is given, and how."""
    given: list[tuple[Any, dict[str, Any]]] = []
    monkeypatch.setattr(viewer, "has_display", lambda: True)
    monkeypatch.setattr(cadquery.vis, "show", lambda thing, **look: given.append((thing, look)))
    return given


def actors(assembly: Any) -> list[Any]:
    parts = assembly.GetParts()
    return [parts.GetItemAsObject(number) for number in range(parts.GetNumberOfItems())]


def test_with_a_display_a_window_stays_until_it_is_closed(
    lattice: Lattice, shown: list[tuple[Any, dict[str, Any]]]
) -> None:
    view(lattice)
    ((thing, look),) = shown
    assert look["title"] == "gyroid lattice"
    # CadQuery's own defaults: interact, no screenshot.
    assert not {"interact", "screenshot"} & set(look)
    low, high = lattice.bounding_box()
    assert thing.GetBounds() == pytest.approx([x for pair in zip(low, high, strict=True) for x in pair], abs=0.05)


def test_a_window_holds_each_part_once_and_all_its_places(
    tmp_path: Path, shown: list[tuple[Any, dict[str, Any]]]
) -> None:
    box = cq.Workplane().box(2, 1, 1)
    assembly = cq.Assembly(name="row")
    for number in range(3):
        assembly.add(
            box, name=f"box{number}", loc=cq.Location((5 * number, 0, 0), (0, 0, 1), 90), color=cq.Color("red")
        )
    assembly.add(cq.Workplane().sphere(1), name="ball", loc=cq.Location((-5, 0, 0)))
    assembly.export(str(tmp_path / "row.step"))
    view(tmp_path / "row.step")
    ((thing, look),) = shown
    assert look["title"] == "row.step"
    assert thing.GetBounds() == pytest.approx([-6, 10.5, -1, 1, -1, 1], abs=0.05)
    # Faces and lines of two things in four places.
    assert len(actors(thing)) == 8
    mappers = [actor.GetMapper() for actor in actors(thing)]
    assert len({id(mapper) for mapper in mappers}) == 4


_OFF_SCREEN = """
import sys, cadquery.vis
from gyroid_cad.cli import view as viewer
show = cadquery.vis.show
cadquery.vis.show = lambda *things, **look: show(*things, **look, interact=False, screenshot=sys.argv[2])
viewer.has_display = lambda: True
viewer.view(sys.argv[1])
"""
_TRIAL = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.AddRenderer(vtkRenderer())
window.Render()
"""


def test_what_a_window_shows_has_faces_of_both_colours_and_dark_lines(lattice: Lattice, tmp_path: Path) -> None:
    if subprocess.run([sys.executable, "-c", _TRIAL], capture_output=True, check=False).returncode:
        pytest.skip("neither a display nor EGL nor OSMesa for VTK to draw with")
    lattice.write(tmp_path / "cell.step")
    command = [sys.executable, "-c", _OFF_SCREEN, str(tmp_path / "cell.step"), str(tmp_path / "window.png")]
    subprocess.run(command, capture_output=True, check=True)
    # Without the axes in the corner.
    red, green, blue, _ = np.moveaxis(pixels(tmp_path / "window.png")[:600, :800], -1, 0)
    assert np.mean(red > blue + 40) > 0.02
    assert np.mean(blue > red + 40) > 0.02
    assert np.mean((red < 70) & (green < 70) & (blue < 70)) > 0.001


# What is refused.


@pytest.mark.parametrize("name", ["part.step", "part.brep", "part.stl", "part.3mf"])
def test_a_file_that_is_not_what_its_ending_says_is_one_line(
    name: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / name).write_text("nonsense")
    # What the kernel cannot read is a failure, triangles that are none a bad argument.
    assert main(["view", str(tmp_path / name), "-o", str(tmp_path / "a.png")]) in (1, 2)
    out, err = capfd.readouterr()
    assert out == ""
    assert err.startswith("gyroid-cad: error: ")
    assert str(tmp_path / name) in err
    assert len(err.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_file_without_a_face_says_that_there_is_nothing_to_be_seen(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    cq.exporters.export(cq.Workplane().rect(1, 2), str(tmp_path / "wire.step"))
    assert main(["view", str(tmp_path / "wire.step"), "-o", str(tmp_path / "a.png")]) == 1
    assert capfd.readouterr().err == f"gyroid-cad: error: {tmp_path / 'wire.step'} holds no face to be seen\n"


@pytest.mark.parametrize(
    ("what", "picture", "words"),
    [
        (
            "part.igs",
            None,
            "file = 'part.igs': expected a file ending in .step, .stp, .stpz",
        ),
        ("missing.step", None, "file = 'missing.step': expected a file that exists"),
        ("missing.step", "a.jpg", "output = 'a.jpg': expected a file name ending in .png"),
        ("missing.step", "no/a.png", "existing folder"),
    ],
)
def test_names_that_will_not_do_are_refused_before_anything_is_drawn(
    what: str, picture: str | None, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ParameterError) as refused:
        view(what, picture)
    assert words in str(refused.value)


def test_help_names_what_can_be_shown(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["view", "--help"]) == 0
    out = " ".join(capsys.readouterr().out.split())
    for words in (
        "[LATTICE.toml|FILE]",
        ".step, .stp, .stpz, .step.gz, .stp.gz, .brep, .stl",
        "-o, --output, --screenshot FILE.png",
    ):
        assert words in out

"""The command line's ``fill``: a STEP file in, the part filled with gyroid out, or one line that says why not."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import pytest

from gyroid_cad.cli.app import main
from gyroid_cad.kernel.check import is_valid, topology
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures

Captured = pytest.CaptureFixture[str]

FILL = ["--cell-size", "10", "--control-points", "6"]


def run(captured: Captured, *arguments: str | Path) -> SimpleNamespace:
    captured.readouterr()
    status = main(["fill", *map(str, arguments)])
    out, err = captured.readouterr()
    return SimpleNamespace(status=status, out=out, err=err)


@pytest.fixture
def peg(tmp_path: Path) -> Path:
    """A small part with a hole and a rounded edge."""
    part = cq.Workplane().box(6, 5, 7).edges("|Z").fillet(1).faces(">Z").workplane().hole(1.5)
    write_step(part.val().wrapped, tmp_path / "peg.step")
    return tmp_path / "peg.step"


def test_a_part_with_a_hole_and_fillets_comes_out_lighter_closed_and_valid(capsys: Captured, peg: Path) -> None:
    light = peg.with_name("light.step")
    done = run(capsys, peg, "-o", light, *FILL, "--density", "0.3", "--material-density", "2.7", "--json")
    summary, shape = json.loads(done.out), read_step(light)
    assert done.status == 0
    assert summary["valid"]
    assert is_valid(shape)
    assert topology(shape).closed
    assert measure(shape)[0] == pytest.approx(summary["volume"], rel=1e-4)
    assert summary["part_volume"] == pytest.approx(measure(read_step(peg))[0], rel=1e-6)
    assert summary["mass"] == pytest.approx(2.7e-3 * summary["volume"])
    assert summary["files"] == [{"path": str(light), "bytes": light.stat().st_size}]


def test_the_table_shows_what_it_weighs_before_and_after(capsys: Captured, peg: Path) -> None:
    done = run(capsys, peg, "-o", peg.with_name("a.brep"), *FILL, "--thickness", "0.9", "--material-density", "1")
    assert done.status == 0
    assert "islands" in done.out
    assert " g of " in done.out


@pytest.mark.parametrize("kind", ["sheet", "network-a", "network-b", "channels"])
def test_every_kind_takes_a_density_from_the_command_line(capsys: Captured, block: Path, kind: str) -> None:
    done = run(capsys, block, "-o", block.with_name("a.brep"), *FILL, "--density", "0.3", "--kind", kind, "--json")
    assert done.status == 0, done.err
    assert json.loads(done.out)["kind"] == kind


@pytest.mark.parametrize(
    ("options", "solids", "islands", "dropped"),
    [([], 1, 0, 2), (["--keep-islands"], 3, 2, 0), (["--drop-islands"], 1, 0, 2)],
)
def test_small_islands_are_dropped_unless_they_are_to_be_kept(
    capsys: Captured, tmp_path: Path, options: list[str], solids: int, islands: int, dropped: int
) -> None:
    write_step(cq.Workplane().box(10, 10, 10, centered=False).val().wrapped, tmp_path / "cell.step")
    arguments = [tmp_path / "cell.step", "-o", tmp_path / "a.stl", *FILL, "--density", "0.2", "--deviation", "0.1"]
    done = run(capsys, *arguments, *options, "--json")
    assert (done.status, done.err) == (0, "")
    summary = json.loads(done.out)
    assert (summary["solids"], summary["islands"], summary["dropped"]) == (solids, islands, dropped)
    assert triangle_measures(*read_triangles(tmp_path / "a.stl")).pieces == solids


@pytest.fixture
def block(tmp_path: Path) -> Path:
    write_step(cq.Workplane().box(6, 5, 7).val().wrapped, tmp_path / "block.step")
    return tmp_path / "block.step"


def test_with_a_skin_left_open_at_one_side_it_is_one_closed_solid(capsys: Captured, block: Path) -> None:
    options = ["--thickness", "1", "--skin", "0.8", "--opening", ">Z", "--opening", "0,0,-3.5", "--json"]
    done = run(capsys, block, "-o", block.with_name("skin.step"), *FILL, *options)
    assert done.status == 0, done.err
    summary, shape = json.loads(done.out), read_step(block.with_name("skin.step"))
    assert is_valid(shape)
    assert topology(shape).closed
    assert summary["solids"] - summary["islands"] == 1
    assert summary["min_wall"] == summary["skin"] == 0.8
    # The skin alone: the block less what is left of it within four walls, open above and below.
    assert summary["volume"] > 6 * 5 * 7 - 4.4 * 3.4 * 7


def test_a_wall_may_vary_and_the_table_says_where_it_is_thinnest(capsys: Captured, block: Path) -> None:
    done = run(capsys, block, "-o", block.with_name("a.step"), *FILL, "--thickness", "1 + 0.04*z")
    assert done.status == 0, done.err
    assert "smallest wall" in done.out


def test_the_bare_surface_is_written_as_shells(capsys: Captured, block: Path) -> None:
    done = run(capsys, block, "-o", block.with_name("a.step"), *FILL, "--kind", "surface", "--json")
    assert done.status == 0, done.err
    shape = read_step(block.with_name("a.step"))
    assert topology(shape).solids == 0
    assert topology(shape).faces == json.loads(done.out)["faces"]


@pytest.mark.parametrize("unit", ["INCH", "MM"])
def test_lengths_in_a_file_are_what_its_unit_says(capsys: Captured, tmp_path: Path, unit: str) -> None:
    path = tmp_path / "part.step"
    cq.exporters.export(cq.Workplane().box(4, 4, 4), str(path), unit=unit)
    # Not only the file's unit differs: an inch is 25.4 mm, so its numbers do.
    assert ("'INCH'" in path.read_text()) == (unit == "INCH")
    done = run(capsys, path, "-o", tmp_path / "a.brep", *FILL, "--thickness", "1", "--json")
    assert json.loads(done.out)["part_volume"] == pytest.approx(4**3)


def test_every_solid_of_a_file_is_filled(capsys: Captured, tmp_path: Path) -> None:
    two = cq.Workplane().pushPoints([(0, 0), (9, 0)]).box(4, 4, 4)
    write_step(cq.Compound.makeCompound(two.vals()).wrapped, tmp_path / "two.step")
    done = run(capsys, tmp_path / "two.step", "-o", tmp_path / "a.brep", *FILL, "--thickness", "1", "--json")
    summary = json.loads(done.out)
    assert summary["part_volume"] == pytest.approx(2 * 4**3)
    assert summary["solids"] >= 2


@pytest.mark.parametrize("part", [0.3, 0.7, 0.95])
def test_a_file_cut_short_is_refused(capsys: Captured, peg: Path, part: float) -> None:
    content = peg.read_bytes()
    peg.write_bytes(content[: int(part * len(content))])
    failed = run(capsys, peg, "-o", peg.with_name("a.step"), *FILL, "--density", "0.3")
    assert failed.status in (1, 2)
    assert len(failed.err.splitlines()) == 1
    assert not peg.with_name("a.step").exists()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--density", "0.3", "--thickness", "1"], "exactly one of --thickness, --density"),
        (["--density", "2"], "--density = 2.0"),
        (["--density", "30"], "; 30 % is 0.30"),
        (["--porosity", "0.01"], "--porosity: density = 0.99"),
        (["--porosity", "70"], "--porosity = 70.0: expected above 0 and below 1; 70 % is 0.70"),
        (["--thickness", "-1"], "--thickness = -1.0"),
        (["--density", "0.3", "--kind", "truss"], "--kind"),
        (["--density", "0.3", "--angle", "90"], "--angle"),
        (
            ["--thickness", "6", "--cell-size", "20"],
            "--thickness = '6': expected a wall below the part's smallest",
        ),
        (
            ["--density", "0.9", "--cell-size", "20"],
            "--density = '0.9': expected a wall below the part's smallest",
        ),
        (["--density", "0.3 + q"], "--density"),
        (["--density", "0.3", "--skin", "-1"], "--skin = -1.0"),
        (["--density", "0.3", "--skin", "5"], "--skin = 5.0"),
        (["--density", "0.3", "--opening", ">Z"], "none without a skin"),
        (["--density", "0.3", "--skin", "0.8", "--opening", "1,2"], "--opening = [1.0, 2.0]"),
    ],
)
def test_bad_usage_is_one_line_and_leaves_no_file(capsys: Captured, peg: Path, options: list[str], words: str) -> None:
    failed = run(capsys, peg, "-o", peg.with_name("a.step"), *FILL, *options)
    assert failed.status == 2
    assert len(failed.err.splitlines()) == 1
    assert words in failed.err
    assert not peg.with_name("a.step").exists()


@pytest.mark.parametrize("content", [None, b"", b"not STEP", b"ISO-10303-21;\nHEADER;\n"])
def test_a_file_that_is_no_step_file_is_one_line_and_nothing_else(
    capfd: pytest.CaptureFixture[str], tmp_path: Path, content: bytes | None
) -> None:
    if content is not None:
        (tmp_path / "part.step").write_bytes(content)
    status = main(["fill", str(tmp_path / "part.step"), "-o", str(tmp_path / "a.step"), *FILL, "--density", "0.3"])
    out, err = capfd.readouterr()
    assert status == 1
    assert out == ""
    assert len(err.splitlines()) == 1
    assert "part.step" in err
    assert not (tmp_path / "a.step").exists()

"""The command line's ``fill``: a STEP file in, the part filled with gyroid out, or one line that says why not."""

from __future__ import annotations

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import cadquery as cq
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.gp import gp_Pnt

from gyroid_cad.cli.app import main
from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import is_valid, topology
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.printing.print_check import print_check
from gyroid_cad.surface.fit import FitSettings

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


def test_the_bare_surface_is_refused_as_triangles_before_anything_is_filled(capsys: Captured, block: Path) -> None:
    done = run(capsys, block, "-o", block.with_name("a.stl"), *FILL, "--kind", "surface", "--route", "brep")
    assert done.status == 2
    assert done.err.splitlines() == [
        f"gyroid-cad: error: -o = '{block.with_name('a.stl')}': expected a file name "
        "ending in .step, .stp, .stpz, .step.gz, .stp.gz or .brep"
    ]


@pytest.mark.parametrize(("unit", "length"), [("INCH", 25.4), ("MM", 1.0)])
def test_lengths_in_a_file_are_what_its_unit_says(capsys: Captured, tmp_path: Path, unit: str, length: float) -> None:
    path = tmp_path / "part.step"
    size = 4 / length
    cq.exporters.export(cq.Workplane().box(size, size, size), str(path), unit=unit)
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
        (["--density", "30", "--kind", "network-a"], "--density = 30.0: expected the network's volume fraction"),
        (["--density", "30", "--kind", "network-a"], "; 30 % is 0.30"),
        (["--density", "0.3", "--tolerance", "1e-12"], "e-09, which 40 control points reach"),
        (["--density", "0.3", "--deviation", "1e-300"], "--deviation = 1e-300"),
        (["--porosity", "0.01"], "--porosity: density = 0.99"),
        (["--porosity", "70"], "--porosity = 70.0: expected above 0 and below 1; 70 % is 0.70"),
        (["--thickness", "-1"], "--thickness = -1.0"),
        (["--density", "0.3", "--kind", "truss"], "--kind"),
        (["--density", "0.3", "--angle", "90"], "--angle"),
        (
            ["--thickness", "6", "--cell-size", "20"],
            "--thickness = '6': expected a wall below the part's thickness",
        ),
        (
            ["--density", "0.9", "--cell-size", "20"],
            "--density = '0.9': expected a wall below the part's thickness",
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


def test_a_part_may_be_brep(capsys: Captured, block: Path) -> None:
    part = block.with_suffix(".brep")
    write_brep(read_step(block), part)
    done = run(capsys, part, "-o", block.with_name("a.brep"), *FILL, "--thickness", "1", "--json")
    assert done.status == 0, done.err
    assert json.loads(done.out)["part_volume"] == pytest.approx(6 * 5 * 7)


def test_triangles_are_no_part_of_a_step_file_and_the_message_says_which_route_takes_them(
    capsys: Captured, tmp_path: Path
) -> None:
    (tmp_path / "part.stl").write_text("solid a\nendsolid a\n")
    failed = run(capsys, tmp_path / "part.stl", "-o", tmp_path / "a.step", *FILL, "--density", "0.3")
    assert failed.status == 2
    assert "part.stl': expected a STEP or BREP file; triangles fill by --route triangles, into .stl" in failed.err


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


@pytest.fixture
def small(tmp_path: Path) -> Path:
    write_step(cq.Workplane().box(3, 3, 3).val().wrapped, tmp_path / "small.step")
    return tmp_path / "small.step"


def test_a_file_holds_a_whole_fill_and_what_is_given_overrides_it(capsys: Captured, small: Path) -> None:
    folder = small.parent
    (folder / "fill.toml").write_text(
        'part = "small.step"\noutput = ["light.brep", "light.stl"]\ncell_size = 10\ncontrol_points = 5\n'
        'thickness = "1 + 0.02*z"\ntolerance = 1e-2\norigin = [1, 2, 3]\ndeviation = 0.2\n'
    )
    done = run(capsys, folder / "fill.toml", "--json")
    assert done.status == 0, done.err
    summary = json.loads(done.out)
    assert [Path(file["path"]).name for file in summary["files"]] == ["light.brep", "light.stl"]
    expected = fill(small, 10, "1 + 0.02*z", origin=(1, 2, 3), tolerance=1e-2, fit=FitSettings(5)).report
    assert summary["volume"] == expected.volume
    write_step(cq.Workplane().box(2, 3, 3).val().wrapped, folder / "other.step")
    other = run(capsys, folder / "other.step", folder / "fill.toml", "-o", folder / "b.brep", "--json")
    assert json.loads(other.out)["part_volume"] == pytest.approx(18)
    assert [Path(file["path"]).name for file in json.loads(other.out)["files"]] == ["b.brep"]


def test_the_printed_fill_prints_itself_again_and_fills_nothing(capsys: Captured, block: Path) -> None:
    options = ["--density", "0.3", "--skin", "0.5", "--opening", ">Z", "--opening", "0,0,-3.5", "--printer", "form2"]
    first = run(capsys, block.name, "-o", "a.step", *FILL, *options, "--print-config")
    assert first.status == 0, first.err
    printed = tomllib.loads(first.out)
    assert (printed["part"], printed["opening"]) == (block.name, [">Z", "0,0,-3.5"])
    (block.parent / "fill.toml").write_text(first.out)
    again = run(capsys, block.parent / "fill.toml", "--print-config")
    assert {**tomllib.loads(again.out), "part": block.name, "output": ["a.step"]} == printed
    assert not (block.parent / "a.step").exists()


def test_a_block_of_cells_that_a_map_carries_fills_a_part(capsys: Captured, tmp_path: Path) -> None:
    part = tmp_path / "part.step"
    write_step(cq.Workplane().box(3, 3, 3).translate((5, 5, 5)).val().wrapped, part)
    words = {"scale-field": "1 + 0.01*x", "map": "twist:angle=10", "tolerance": "1e-2"}
    options = [word for name, value in words.items() for word in (f"--{name}", value)]
    done = run(
        *(capsys, part, "-o", tmp_path / "a.brep", "--cells", 1, 1, 1, *FILL, "--density", 0.3, *options, "--json")
    )
    assert done.status == 0, done.err
    lattice = Lattice((1, 1, 1), 10, density=0.3, scale_field="1 + 0.01*x", map="twist:angle=10", tolerance=1e-2)
    expected = fill(part, lattice=replace(lattice, fit=FitSettings(6))).report
    assert json.loads(done.out)["volume"] == expected.volume
    assert expected.volume != pytest.approx(fill(part, 10, density=0.3, fit=FitSettings(6)).report.volume, rel=1e-3)


def test_a_network_cut_by_a_box_is_not_too_thin_for_the_sharp_edges_of_the_cut(tmp_path: Path) -> None:
    network, path = (
        fill(cq.Workplane().box(10, 10, 10), 10, density=0.4, kind="network-a", fit=FitSettings(5)),
        tmp_path / "a.3mf",
    )
    network.write(path, deviation=0.03)
    check = print_check(path)
    assert check.min_wall is not None
    assert check.min_wall > 0.4
    assert check.passed


def test_a_printer_checks_what_is_left_of_the_part(capsys: Captured, small: Path) -> None:
    options = ["--thickness", "0.3", "--deviation", "0.1", "--printer", "form2"]
    done = run(capsys, small, "-o", small.with_name("a.brep"), *FILL, *options, "--json")
    assert done.status == 0, done.err
    check = json.loads(done.out)["print_check"]
    assert check["size"] == pytest.approx([3, 3, 3], abs=1e-3)
    assert (check["min_wall"], check["wall"], check["printer"]["key"]) == (0.3, "too thin", "form2")
    shown = run(capsys, small, "-o", small.with_name("a.brep"), *FILL, *options)
    assert "smallest wall" in shown.out
    assert "build volume" in shown.out


def test_a_network_that_is_checked_for_a_printer_has_its_walls_measured(small: Path) -> None:
    network = fill(small, 10, density=0.6, kind="network-a", fit=FitSettings(5))
    check = print_check(network, "form2", deviation=0.1)
    assert network.report.min_wall is None
    assert check.walls_measured > 0
    with pytest.raises(ParameterError, match=r"kind = 'surface': expected one that is a solid"):
        print_check(fill(small, 10, kind="surface", fit=FitSettings(5)))
    with pytest.raises(ParameterError, match="deviation = -1"):
        print_check(network, "form2", deviation=-1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "Missing argument 'PART.step'"),
        (["a.step", "b.step"], "expected one part"),
        (["a.step", "a.toml", "b.toml"], "at most one TOML file"),
        (["a.step"], "Missing option '-o'"),
        (["a.step", "-o", "b.step", "--density", "0.3"], "Missing option '--cell-size'"),
        (["a.step", "-o", "b.step", *FILL, "--density", "0.3", "--map", "twist:angle=9"], "give --cells with --map"),
        (["a.step", "-o", "b.step", *FILL, "--density", "0.3", "--scale", "2"], "give --cells with --scale"),
        (["a.step", "-o", "b.step", *FILL, "--density", "0.3", "--printer", "none"], "--printer = 'none'"),
        (["a.step", "-o", "b.step", *FILL, "--density", "0.3", "--kind", "sheet", "--trim", "box"], "--trim"),
    ],
)
def test_what_a_fill_lacks_is_said_before_anything_is_read(
    capsys: Captured, options: list[str], words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.toml", "b.toml"):
        (tmp_path / name).write_text("cell_size = 10\n")
    failed = run(capsys, *options)
    assert failed.status == 2
    assert len(failed.err.splitlines()) == 1
    assert words in failed.err


def test_a_part_that_a_file_names_wrongly_is_told_by_the_files_line(capsys: Captured, tmp_path: Path) -> None:
    (tmp_path / "fill.toml").write_text('cell_size = 10\ndensity = 0.3\npart = "part.iges"\noutput = "a.step"\n')
    failed = run(capsys, tmp_path / "fill.toml")
    assert failed.status != 0
    assert len(failed.err.splitlines()) == 1
    assert "part.iges" in failed.err


def test_a_core_from_a_file_and_the_voids_it_leaves_are_told(capsys: Captured, block: Path, tmp_path: Path) -> None:
    low, high = bounding_box(read_step(block))
    core = BRepPrimAPI_MakeBox(gp_Pnt(*(low + 0.5).tolist()), gp_Pnt(*(high - 0.5).tolist())).Shape()
    write_step(core, tmp_path / "inner.step")
    asked = [*FILL, "--density", "0.3", "--core", tmp_path / "inner.step"]
    done = run(capsys, block, "-o", tmp_path / "a.step", *asked)
    assert done.status == 0
    assert re.search(r"skin +0\.5 mm", done.out)
    assert "that no opening reaches" in done.out
    refused = run(capsys, block, "-o", tmp_path / "inner.step", *asked)
    assert refused.status == 2
    assert "expected another file" in refused.err
    both = run(capsys, block, "-o", tmp_path / "b.step", *asked, "--skin", "1")
    assert "--skin = 1.0: expected none beside a core" in both.err


def test_the_part_itself_is_not_overwritten(capsys: Captured, block: Path, tmp_path: Path) -> None:
    (tmp_path / "link.step").symlink_to(block)
    before = block.read_bytes()
    for name in (block, tmp_path / "link.step"):
        done = run(capsys, block, "-o", name, *FILL, "--density", "0.3")
        assert done.status == 2
        assert "expected another file than the part that is filled" in done.err
    assert block.read_bytes() == before


def test_a_mesh_that_cannot_be_made_leaves_no_other_file_of_its_call(
    capsys: Captured, block: Path, tmp_path: Path
) -> None:
    before = sorted(tmp_path.iterdir())
    given = ("--cell-size", "8", "--density", "0.3", "--control-points", "5", "--element-size", "100")
    done = run(capsys, block, "-o", tmp_path / "made.step", "-o", tmp_path / "made.msh", *given)
    assert done.status == 2
    assert "--element-size = 100.0: expected at most the cell size, 8 mm" in done.err
    assert sorted(tmp_path.iterdir()) == before

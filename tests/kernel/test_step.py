"""STEP: what is in the file, what comes back from it, and what is left alone."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import build123d as bd
import numpy as np
import pytest
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.TopoDS import TopoDS_Shape
from scipy.spatial import cKDTree

from gyroid_cad.common.formats import SCHEMAS, require_schema
from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.solid import TOLERANCE, build_solid
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.header import StepHeader
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.symmetry import CELL_QUARTERS
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.grading import LARGEST_CELL, SMALLEST_CELL
from gyroid_cad.wall.offset import build_wall

DiskFull = Callable[[int], AbstractContextManager[None]]

TEXT_SETTINGS = ("write.step.schema", "write.step.unit", "write.step.product.name")
EMPTY_FILE = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION(('nothing'),'2;1');
FILE_NAME('empty','2000-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
ENDSEC;
END-ISO-10303-21;
"""


@pytest.fixture(scope="module")
def solid(cell: Lattice) -> TopoDS_Shape:
    return cell.solid()


@pytest.fixture(scope="module")
def written(solid: TopoDS_Shape, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("step") / "one cell.step"
    write_step(solid, path)
    return path


@pytest.fixture
def foreign_settings() -> Iterator[dict[str, str | int]]:
    """The kernel's global settings as another program in this process may have left them."""
    before, before_mode = _settings(), Interface_Static.IVal_s("write.surfacecurve.mode")
    foreign = {"write.step.schema": "AP203", "write.step.unit": "INCH", "write.step.product.name": "their part"}
    for key, value in foreign.items():
        assert Interface_Static.SetCVal_s(key, value)
    Interface_Static.SetIVal_s("write.surfacecurve.mode", 1)
    yield _settings()
    for key in TEXT_SETTINGS:
        Interface_Static.SetCVal_s(key, str(before[key]))
    Interface_Static.SetIVal_s("write.surfacecurve.mode", before_mode)


def _settings() -> dict[str, str | int]:
    texts = {key: Interface_Static.CVal_s(key) for key in TEXT_SETTINGS}
    return {**texts, "write.surfacecurve.mode": Interface_Static.IVal_s("write.surfacecurve.mode")}


def entities(path: Path, name: str) -> int:
    return len(re.findall(rf"\b{name}\s*\(", path.read_text()))


def dangling_references(path: Path) -> set[str]:
    """Entities that are referred to but not there: readers may crash on them."""
    data = re.sub(r"'(?:[^']|'')*'", "", path.read_text().split("DATA;")[1])
    return set(re.findall(r"#\d+", data)) - set(re.findall(r"^(#\d+)\s*=", data, re.MULTILINE))


def in_millimetres(path: Path) -> bool:
    """Whether the file's one unit of length is the millimetre; an inch would be a second, built upon it."""
    units = [entity for entity in path.read_text().split(";") if "LENGTH_UNIT()" in entity]
    return len(units) == 1 and "SI_UNIT(.MILLI.,.METRE.)" in units[0]


def header(path: Path) -> str:
    return re.sub(r"\s+", " ", path.read_text().split("ENDSEC;")[0])


def test_a_block_comes_back_as_one_valid_closed_solid_of_the_right_volume_in_millimetres(
    block: Lattice, tmp_path: Path
) -> None:
    write_step(block.solid(), tmp_path / "block.step")
    back = read_step(tmp_path / "block.step")
    assert topology(back) == topology(block.solid())
    assert topology(back).solids == 1
    assert topology(back).closed
    assert is_valid(back)
    assert enclosed_volume(back) == pytest.approx(block.exact_volume, rel=2e-6)


def test_the_kernels_own_integration_finds_a_block_read_back_as_full_as_its_control_nets(
    tmp_path: Path, kernel_volume: Callable[[TopoDS_Shape], float]
) -> None:
    lattice = Lattice((2, 2, 2), 10.0, 0.8, fit=FitSettings(6))  # the kernel takes long to integrate finer ones
    write_step(lattice.solid(), tmp_path / "block.step")
    volume = kernel_volume(read_step(tmp_path / "block.step"))
    assert volume == pytest.approx(lattice.wall().volume(), rel=1e-4)


def test_the_file_lists_every_face_and_edge_once_and_no_curve_in_the_parameter_plane(
    cell: Lattice, written: Path
) -> None:
    complex = cell.wall().complex
    free, border = int(complex.free.sum()), int(complex.border_fans.sum())
    assert entities(written, "MANIFOLD_SOLID_BREP") == 1
    assert entities(written, "ADVANCED_FACE") == 2 * complex.patch_count + free
    assert entities(written, "EDGE_CURVE") == 2 * complex.edge_count + border
    assert entities(written, "VERTEX_POINT") == 2 * complex.fan_count
    assert entities(written, "PCURVE") == 0


@pytest.mark.parametrize("schema", SCHEMAS)
def test_every_entity_referred_to_is_in_the_file(solid: TopoDS_Shape, tmp_path: Path, schema: str) -> None:
    write_step(solid, tmp_path / "part.step", StepHeader(schema))
    assert not dangling_references(tmp_path / "part.step")


def test_no_two_points_of_surfaces_and_curves_are_written_twice(written: Path) -> None:
    """Vertices keep points of their own, so that those that coincide stay two."""
    text = written.read_text()
    points = dict(re.findall(r"(#\d+)\s*=\s*CARTESIAN_POINT\s*\('',\(([^()]*)\)", text))
    of_vertices = set(re.findall(r"VERTEX_POINT\s*\('[^']*',\s*(#\d+)\)", text))
    others = [coordinates for number, coordinates in points.items() if number not in of_vertices]
    assert len(set(others)) == len(others)
    assert len(of_vertices) == entities(written, "VERTEX_POINT")


def test_the_date_of_reproducible_builds_is_the_files_date(
    solid: TopoDS_Shape, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    write_step(solid, tmp_path / "part.step")
    assert "'1970-01-02T00:00:00'" in header(tmp_path / "part.step")


def test_the_same_solid_written_again_on_the_same_date_is_the_same_file(
    solid: TopoDS_Shape, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    written = []
    for _ in range(2):
        write_step(solid, tmp_path / "part.step")
        written.append((tmp_path / "part.step").read_bytes())
    assert written[0] == written[1]


def test_every_control_point_stands_in_the_file_well_within_the_kernels_smallest_distance(
    cell: Lattice, written: Path
) -> None:
    number = r"\s*(-?[0-9.]+(?:E[+-]?[0-9]+)?)\s*"
    found = re.findall(rf"CARTESIAN_POINT\s*\(\s*''\s*,\s*\({number},{number},{number}\)", written.read_text())
    wall = cell.wall()
    points = wall.nets[wall.patch_net] + wall.shifts[wall.patch_shift][:, np.newaxis, np.newaxis, np.newaxis]
    distances, _ = cKDTree(np.array(found, dtype=float)).query(points.reshape(-1, 3))
    assert np.max(distances) < TOLERANCE / 10


@pytest.mark.parametrize("cell_size", [SMALLEST_CELL, 1e3, LARGEST_CELL])
def test_the_smallest_and_the_largest_lattices_come_back_valid_too(cell_size: float, tmp_path: Path) -> None:
    lattice = Lattice((2, 1, 1), cell_size, 0.08 * cell_size, fit=FitSettings(5))
    write_step(lattice.solid(), tmp_path / "part.step")
    back = read_step(tmp_path / "part.step")
    assert topology(back) == topology(lattice.solid())
    assert is_valid(back)
    assert enclosed_volume(back) == pytest.approx(lattice.wall().volume(), rel=1e-8)


def test_the_header_names_the_part_but_neither_author_nor_organisation(written: Path) -> None:
    name, author, organisation = re.findall(
        r"FILE_NAME\s*\(\s*'([^']*)',[^,]*,\s*\((.*?)\),\s*\((.*?)\)", header(written)
    )[0]
    assert name == "one cell"
    assert author == organisation == "''"
    assert "gyroid_cad" in header(written)


def test_a_name_may_be_given_and_may_hold_a_quote(solid: TopoDS_Shape, tmp_path: Path) -> None:
    write_step(solid, tmp_path / "part.step", name="Schoen's surface")
    assert "FILE_NAME('Schoen''s surface'," in header(tmp_path / "part.step")
    assert topology(read_step(tmp_path / "part.step")).closed


def test_the_unit_of_length_is_the_millimetre(written: Path) -> None:
    assert in_millimetres(written)


@pytest.mark.parametrize(("schema", "protocol"), [("ap214", "10303 214 "), ("ap242", "10303 442 ")])
def test_the_schema_is_the_one_asked_for_whatever_was_written_before(
    solid: TopoDS_Shape, tmp_path: Path, schema: str, protocol: str
) -> None:
    for before in SCHEMAS:
        write_step(solid, tmp_path / "part.step", StepHeader(before))
        write_step(solid, tmp_path / "part.step", StepHeader(schema))
        assert protocol in header(tmp_path / "part.step").split("FILE_SCHEMA")[1]
    assert enclosed_volume(read_step(tmp_path / "part.step")) == pytest.approx(enclosed_volume(solid), rel=1e-8)


def test_pieces_come_back_as_solids_of_their_own(tmp_path: Path) -> None:
    placements = USUAL.cell
    scattered = replace(placements, translations=placements.translations % CELL_QUARTERS)
    wall = build_wall(build_complex((1, 1, 1), scattered), fit_patch(FitSettings(4)), 10.0, 0.8)
    write_step(build_solid(wall), tmp_path / "pieces.step")
    assert not dangling_references(tmp_path / "pieces.step")
    back = read_step(tmp_path / "pieces.step")
    assert topology(back).solids == wall.complex.component_count > 1
    assert topology(back).closed
    assert enclosed_volume(back) == pytest.approx(wall.volume(), rel=1e-8)


def test_settings_of_others_are_left_as_they_were_and_leave_no_mark_on_the_file(
    solid: TopoDS_Shape, tmp_path: Path, foreign_settings: dict[str, str | int]
) -> None:
    write_step(solid, tmp_path / "part.step", StepHeader("ap242"))
    assert _settings() == foreign_settings
    assert "10303 442 " in header(tmp_path / "part.step")
    assert in_millimetres(tmp_path / "part.step")
    assert entities(tmp_path / "part.step", "PCURVE") == 0


def test_settings_of_others_are_left_as_they_were_after_a_failure_too(
    solid: TopoDS_Shape, tmp_path: Path, foreign_settings: dict[str, str | int], disk_full: DiskFull
) -> None:
    with disk_full(10_000), pytest.raises(ExportError):
        write_step(solid, tmp_path / "part.step")
    assert _settings() == foreign_settings


def test_nothing_is_printed_and_the_kernels_messages_are_as_loud_as_before(
    solid: TopoDS_Shape, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    before = [printer.GetTraceLevel() for printer in Message.DefaultMessenger_s().Printers()]
    write_step(solid, tmp_path / "part.step")
    read_step(tmp_path / "part.step")
    assert capfd.readouterr() == ("", "")
    assert [printer.GetTraceLevel() for printer in Message.DefaultMessenger_s().Printers()] == before


def test_a_disk_that_fills_up_leaves_the_older_file_and_nothing_else(
    solid: TopoDS_Shape, tmp_path: Path, disk_full: DiskFull
) -> None:
    path = tmp_path / "part.step"
    path.write_text("older")
    with disk_full(10_000), pytest.raises(ExportError, match=re.escape(str(path))):
        write_step(solid, path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


def test_an_unknown_schema_is_refused_before_anything_is_touched(solid: TopoDS_Shape, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"schema = 'ap203': expected ap214 or ap242"):
        write_step(solid, tmp_path / "part.step", StepHeader("ap203"))
    assert not list(tmp_path.iterdir())
    assert {require_schema(schema) for schema in SCHEMAS} == {"AP214IS", "AP242DIS"}


def test_reading_says_which_file_is_missing_is_no_step_or_holds_no_shape(tmp_path: Path) -> None:
    (tmp_path / "prose.step").write_text("The gyroid was found by Alan Schoen.\n")
    (tmp_path / "empty.step").write_text(EMPTY_FILE)
    for name, problem in (("missing", "could not be read"), ("prose", "could not be read"), ("empty", "no shape")):
        with pytest.raises(ExportError, match=rf"{name}\.step.*{problem}"):
            read_step(tmp_path / f"{name}.step")


def inches_by_cadquery(box: TopoDS_Shape, path: Path) -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    cq.exporters.export(cq.Shape.cast(box), str(path), unit="INCH")


def inches_by_build123d(box: TopoDS_Shape, path: Path) -> None:
    bd.export_step(bd.Solid(box), path, unit=bd.Unit.IN)


@pytest.fixture
def lengths() -> Iterator[None]:
    """What a host leaves the kernel taking lengths for is put right again, for whatever is read after the test."""
    keys = ("xstep.cascade.unit", "write.step.unit")
    before = [Interface_Static.CVal_s(key) for key in keys]
    yield
    for key, value in zip(keys, before, strict=True):
        Interface_Static.SetCVal_s(key, value)


@pytest.mark.usefixtures("lengths")
@pytest.mark.parametrize("write_inches", [inches_by_cadquery, inches_by_build123d])
def test_a_host_that_writes_inches_changes_no_length_of_ours(
    write_inches: Callable[[TopoDS_Shape, Path], None], tmp_path: Path
) -> None:
    box = bd.Box(4, 4, 4).solid().wrapped
    write_step(box, tmp_path / "before.step")
    write_inches(box, tmp_path / "inches.step")
    write_step(box, tmp_path / "after.step")
    for name in ("before.step", "after.step"):
        assert measure(read_step(tmp_path / name))[0] == pytest.approx(4**3)
    assert measure(read_step(tmp_path / "inches.step"))[0] == pytest.approx((4 * 25.4) ** 3)

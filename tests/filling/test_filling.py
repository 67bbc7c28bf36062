"""Parts filled with gyroid: the wall, the networks, what they weigh, and what is refused."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import build123d as bd
import cadquery as cq
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
from OCP.TopoDS import TopoDS_Shape
from scipy.spatial.transform import Rotation

import gyroid_cad.filling.part
import gyroid_cad.filling.roads
import gyroid_cad.kernel.regions
from gyroid_cad.errors import ExportError, IslandsWarning, KernelError, ParameterError, SealedVoidsWarning
from gyroid_cad.filling.bodies import Made
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.part import part_of
from gyroid_cad.filling.wanted import KINDS
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.covering import frame_of

TUBE = USUAL.tube

CELL, WALL, RADIUS, HEIGHT = 10.0, 0.9, 1.8, 3.4
PEG = np.pi * RADIUS**2 * HEIGHT
COARSE = FitSettings(5)
HOME = (0.0, 0.0, 0.0)


def peg(x: float = 5.0) -> cq.Workplane:
    return cq.Workplane(origin=(x, 4.0, 4.3)).circle(RADIUS).extrude(HEIGHT)


def ball() -> cq.Workplane:
    """The kernel takes some time to tell what is inside one."""
    return cq.Workplane(origin=(5.0, 4.0, 6.0)).sphere(2.2)


@lru_cache(maxsize=8)
def filled(kind: str = "sheet", density: float | None = None) -> Filled:
    wall = WALL if density is None else None
    # Given an origin, the lattice stands there, and does not move clear of what it all but touches.
    return fill(peg(), CELL, wall, density, kind, HOME, fit=COARSE, material_density=2.7)


@pytest.mark.parametrize(
    ("kind", "density"), [("sheet", None), ("network-a", 0.3), ("network-b", 0.7), ("channels", None)]
)
def test_a_filled_part_is_closed_valid_and_what_its_report_says(kind: str, density: float | None) -> None:
    made, report = filled(kind, density), filled(kind, density).report
    assert is_valid(made.solid())
    assert topology(made.solid()).closed
    assert (topology(made.solid()).solids, topology(made.solid()).faces) == (report.solids, report.faces)
    assert measure(made.solid()) == pytest.approx((report.volume, report.area), rel=1e-6)
    assert report.part_volume == pytest.approx(PEG, rel=1e-6)
    assert report.density == pytest.approx(report.volume / report.part_volume)
    assert f"{report.kind}, cells of {report.cell_size:g} mm" in str(made)
    assert f"{report.area:.6g} mm2" in str(made)
    assert report.mass == pytest.approx(2.7e-3 * report.volume)
    assert report.part_mass == pytest.approx(2.7e-3 * report.part_volume)


def test_the_wall_and_the_channels_it_leaves_are_the_whole_part() -> None:
    assert filled("sheet").report.volume + filled("channels").report.volume == pytest.approx(PEG, rel=1e-5)
    assert set(filled("channels").domains) == {"channel-a", "channel-b"}


def test_the_labyrinths_of_complementary_densities_are_the_whole_part() -> None:
    # Where one begins at an offset, the other, of one less its density, ends.
    both = [filled("network-a", 0.3), filled("network-b", 0.7)]
    assert sum(made.report.volume for made in both) == pytest.approx(PEG, rel=1e-5)


@pytest.mark.parametrize("density", [0.1, 0.3, 0.5, 0.7])
def test_a_labyrinth_begins_where_half_of_space_less_half_a_wall_is_left(density: float) -> None:
    offset = TUBE.network_offset(density)
    assert 0.5 - np.sign(offset) * TUBE.density(2 * abs(offset)) / 2 == pytest.approx(density, rel=1e-12)


def test_a_box_of_one_period_is_as_dense_as_was_asked() -> None:
    made = fill(cq.Workplane().box(CELL, CELL, CELL).translate((1, 2, 3)), CELL, density=0.25, origin=(0.3, 0.2, 0.1))
    assert made.report.density == pytest.approx(0.25, rel=1e-4)
    assert made.report.thickness == pytest.approx(TUBE.thickness(0.25) * CELL)


def test_moving_part_and_lattice_together_changes_nothing() -> None:
    angles, shift = (30.0, -40.0, 50.0), (3.0, -2.0, 1.0)
    moved = peg().val().moved(cq.Location(cq.Vector(*shift)) * cq.Location((0, 0, 0), (0, 0, 1), 0))
    before, after = filled(), fill(moved, CELL, WALL, origin=shift, fit=COARSE)
    assert after.report.volume == pytest.approx(before.report.volume, rel=1e-7)
    assert after.report.faces == before.report.faces
    np.testing.assert_allclose(
        frame_of((0.0, 0.0, 0.0), angles).rotation,
        Rotation.from_euler("xyz", angles, degrees=True).as_matrix(),
        atol=1e-15,
    )


def test_parts_of_any_host_and_of_files_are_the_same_part(tmp_path: Path) -> None:
    shape, file = peg().val(), tmp_path / "peg.step"
    write_step(shape.wrapped, file)
    parts: list[Any] = [peg(), shape, shape.wrapped, bd.Solid(shape.wrapped), file, str(file)]
    assert [part_of(part).volume for part in parts] == pytest.approx(len(parts) * [PEG], rel=1e-6)


def test_islands_are_counted_and_dropped_on_request() -> None:
    plate = cq.Workplane().box(6, 6, 1, centered=False)
    with pytest.warns(IslandsWarning, match=r"left \(drop_islands drops\)"):
        both = fill(plate, 8, density=0.2, fit=COARSE).report
    with pytest.warns(IslandsWarning, match=r"dropped \(keep_islands keeps\)"):
        one = fill(plate, 8, density=0.2, fit=COARSE, drop_islands=True).report
    assert (both.islands, both.dropped) == (both.solids - 1, 0)
    assert both.islands >= 1
    assert (one.islands, one.dropped, one.solids) == (0, both.islands, 1)
    assert one.volume + one.dropped_volume == pytest.approx(both.volume)
    assert one.dropped_volume == pytest.approx(both.islands_volume)


def test_chips_at_the_corners_of_a_box_of_whole_cells_are_dropped_unless_they_are_to_be_kept() -> None:
    box = cq.Workplane().box(8, 8, 8, centered=False)
    with pytest.warns(IslandsWarning, match=r"2 islands, 0\.0\d* mm3 in all: dropped"):
        made = fill(box, 8, density=0.2, fit=COARSE)
    with pytest.warns(IslandsWarning, match=r"2 islands, 0\.0\d* mm3 in all: left"):
        whole = fill(box, 8, density=0.2, fit=COARSE, keep_islands=True)
    assert (made.report.solids, made.report.islands, made.report.dropped) == (1, 0, 2)
    assert (whole.report.solids, whole.report.islands, whole.report.dropped) == (3, 2, 0)
    assert measure(made.solid())[0] == pytest.approx(made.report.volume, rel=1e-4)
    assert made.report.volume + made.report.dropped_volume == pytest.approx(whole.report.volume, rel=1e-12)
    assert made.report.density == made.report.volume / made.report.part_volume


def test_small_islands_of_the_bare_surface_are_told_by_their_area() -> None:
    box = cq.Workplane().box(8, 8, 8, centered=False)
    made, whole = (fill(box, 8, kind="surface", fit=COARSE, keep_islands=keep).report for keep in (False, True))
    assert made.dropped == whole.islands - made.islands
    assert made.dropped_volume == made.islands_volume == 0
    assert made.area <= whole.area


def only_by(monkeypatch: pytest.MonkeyPatch, wanted: str) -> None:
    """Have every other road fail."""
    every = gyroid_cad.filling.roads.taken

    def taken(road: str, *arguments: Any) -> Any:
        if road != wanted:
            raise KernelError("touches")
        return every(road, *arguments)

    monkeypatch.setattr(gyroid_cad.filling.part, "taken", taken)


def test_a_box_is_cut_without_booleans_and_comes_out_as_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    box = cq.Workplane().box(4, 5, 3).translate((5, 4, 6))
    sections = fill(box, CELL, WALL, fit=COARSE).report
    only_by(monkeypatch, "booleans")
    booleans = fill(box, CELL, WALL, fit=COARSE).report
    assert sections.by_sections
    assert not booleans.by_sections
    assert sections.volume == pytest.approx(booleans.volume, rel=1e-5)
    assert sections.area == pytest.approx(booleans.area, rel=1e-5)
    assert (sections.solids, sections.faces) == (booleans.solids, booleans.faces)


@pytest.mark.parametrize("side", [1.0, 2.0, 4.0])
def test_small_boxes_at_the_origin_are_cut_as_large_ones_are(side: float) -> None:
    box = cq.Workplane().box(side, side, side, centered=False)
    both = [fill(box, 7.0, 0.6, kind=kind, fit=COARSE, keep_islands=True).report for kind in ("sheet", "channels")]
    assert all(report.by_sections for report in both)
    assert sum(report.volume for report in both) == pytest.approx(side**3, rel=1e-6)


def test_a_box_that_cannot_be_cut_without_the_kernel_goes_to_it(monkeypatch: pytest.MonkeyPatch) -> None:
    only_by(monkeypatch, "booleans")
    report = fill(cq.Workplane().box(4, 5, 3).translate((5, 4, 6)), CELL, WALL, fit=COARSE).report
    assert not report.by_sections
    assert report.valid


@pytest.mark.parametrize("turn", [(0, 0, 0), (20, 30, 40)])
def test_the_wall_in_a_box_and_its_channels_are_the_whole_box_however_the_lattice_is_turned(turn: Any) -> None:
    box = cq.Workplane().box(6, 7, 8)
    both = [fill(box, CELL, WALL, kind=kind, rotation=turn, fit=COARSE).report for kind in ("sheet", "channels")]
    assert sum(report.volume for report in both) == pytest.approx(6 * 7 * 8, rel=1e-6)


def test_whole_cells_are_as_dense_as_was_asked_wherever_they_begin() -> None:
    box = cq.Workplane().box(2 * CELL, CELL, CELL)
    for origin in ((0, 0, 0), (1.1, 2.3, 4.7)):
        made = fill(box, CELL, density=0.3, origin=origin, keep_islands=True)
        assert made.report.density == pytest.approx(0.3, rel=1e-6)


# No corner of the lattice lies in a side of the box: the lattice would be shifted, and the surface another.
@pytest.mark.parametrize("part", [ball(), cq.Workplane().box(4, 5, 3).translate((5.3, 4.2, 6.1))], ids=["ball", "box"])
def test_the_bare_surface_has_half_the_area_of_a_thin_wall_and_no_volume(part: cq.Workplane, tmp_path: Path) -> None:
    given = {"origin": HOME, "fit": COARSE}
    surface, wall = fill(part, CELL, kind="surface", **given), fill(part, CELL, 0.05, **given)
    report = surface.report
    assert (report.volume, report.solids, report.min_wall, report.closed) == (0, 0, None, False)
    # A thin wall is its mid-surface times its thickness.
    assert report.area == pytest.approx(wall.report.volume / 0.05, rel=1e-3)
    surface.write(tmp_path / "surface.step")
    assert is_valid(read_step(tmp_path / "surface.step"))
    with pytest.raises(ParameterError, match="the bare surface bounds no volume"):
        surface.write(tmp_path / "surface.stl")
    with pytest.raises(ParameterError, match="the bare surface bounds no volume"):
        surface.write(tmp_path / "surface.3mf")


def test_a_field_that_does_not_vary_is_a_number() -> None:
    number, field = filled().report, fill(peg(), CELL, f"{WALL} + 0*x", origin=HOME, fit=COARSE).report
    assert field.volume == pytest.approx(number.volume, rel=1e-3)


def test_a_field_is_of_places_in_the_part_and_turns_with_it() -> None:
    # A quarter turn about z is a symmetry of nothing here: part, lattice and field are turned alike.
    part = cq.Workplane().box(4, 5, 3).translate((5, 4, 6))
    turned = part.rotate((0, 0, 0), (0, 0, 1), 90)
    before = fill(part, CELL, "0.6 + 0.08*x", fit=COARSE).report
    after = fill(turned, CELL, "0.6 + 0.08*y", rotation=(0, 0, 90), fit=COARSE).report
    assert after.volume == pytest.approx(before.volume, rel=1e-6)
    assert (before.min_wall, before.thickness) == pytest.approx((after.min_wall, after.thickness), rel=1e-6)
    assert before.min_wall < before.thickness


def test_a_wall_that_varies_and_the_channels_it_leaves_are_the_whole_part() -> None:
    both = [fill(peg(), CELL, "0.7 + 0.05*z", kind=kind, fit=COARSE).report for kind in ("sheet", "channels")]
    assert sum(report.volume for report in both) == pytest.approx(PEG, rel=1e-5)


def test_a_block_of_cells_round_the_part_fills_it_as_an_endless_lattice_does() -> None:
    block = fill(peg(), lattice=Lattice((1, 1, 1), CELL, WALL, fit=COARSE)).report
    assert block.volume == pytest.approx(filled().report.volume, rel=1e-6)
    assert (block.solids, block.faces) == (filled().report.solids, filled().report.faces)


def test_a_skin_is_kept_and_fused_with_what_fills_the_core() -> None:
    skin = 0.4
    inner = RADIUS - skin
    core = cq.Workplane(origin=(5.0, 4.0, 4.3 + skin)).circle(inner).extrude(HEIGHT - 2 * skin)
    made, within = fill(peg(), CELL, WALL, fit=COARSE, skin=skin), fill(core, CELL, WALL, fit=COARSE)
    assert made.report.solids == 1
    assert made.report.by_sections
    assert made.report.shift == (0.0, 0.0, 0.0)
    assert made.report.volume == pytest.approx(
        PEG - np.pi * inner**2 * (HEIGHT - 2 * skin) + within.report.volume, rel=1e-4
    )
    assert made.report.min_wall == skin
    assert is_valid(made.solid())


def test_a_box_with_a_skin_is_cut_without_booleans_and_comes_out_as_with_them(monkeypatch: pytest.MonkeyPatch) -> None:
    box = cq.Workplane().box(7, 8, 6).translate((5, 4, 6))
    sections, channels = (
        fill(box, CELL, WALL, kind=kind, fit=COARSE, skin=0.7).report for kind in ("sheet", "channels")
    )
    only_by(monkeypatch, "booleans")
    booleans = fill(box, CELL, WALL, fit=COARSE, skin=0.7).report
    assert sections.by_sections
    assert sections.volume + channels.volume == pytest.approx(7 * 8 * 6, rel=1e-9)
    assert (sections.volume, sections.area) == pytest.approx((booleans.volume, booleans.area), rel=1e-5)
    assert (sections.solids, sections.faces) == (booleans.solids, booleans.faces)


def test_channels_within_a_skin_are_those_of_the_core() -> None:
    channels, wall = (fill(peg(), CELL, WALL, kind=kind, fit=COARSE, skin=0.4).report for kind in ("channels", "sheet"))
    assert channels.volume + wall.volume == pytest.approx(PEG, rel=1e-4)


def test_files_are_written_and_read_back(tmp_path: Path) -> None:
    filled().write(*(tmp_path / f"light.{ending}" for ending in ("step", "stl", "3mf")), deviation=0.1)
    shape = read_step(tmp_path / "light.step")
    assert is_valid(shape)
    assert topology(shape).closed
    assert measure(shape)[0] == pytest.approx(filled().report.volume, rel=1e-5)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["light.3mf", "light.step", "light.stl"]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"part": 3}, "part = 3"),
        ({"part": TopoDS_Shape()}, "an empty one"),
        ({"part": next(parts_of(cq.Workplane().box(1, 1, 1).val().wrapped, TopAbs_FACE))}, "there is none in it"),
        ({"cell_size": 0}, "cell_size = 0"),
        ({"cell_size": float("nan")}, "cell_size = nan"),
        ({"thickness": None}, "exactly one of the two"),
        ({"density": 0.3}, "exactly one of the two"),
        ({"thickness": 4.0}, "below 3.7647 mm"),
        ({"kind": "truss"}, " or ".join(KINDS)),
        ({"kind": "network-a"}, "thickness = 0.9: expected none of a network, which is told by its density"),
        ({"kind": "network-a", "thickness": None, "density": 1.2}, "volume fraction, above 0.02983"),
        ({"kind": "surface"}, "thickness = 0.9: expected none: the bare surface has no wall"),
        ({"kind": "surface", "thickness": None, "skin": 1}, "skin = 1: expected none round the bare surface"),
        ({"thickness": "0.9 + 0.1*q"}, "thickness"),
        ({"thickness": "1 - x"}, "at (x, y, z) = ("),
        ({"skin": 0}, "skin = 0"),
        ({"skin": 9}, "skin = 9"),
        ({"keep_islands": True, "drop_islands": True}, "one of keep_islands and drop_islands, not both"),
        ({"openings": [">Z"]}, "none without a skin"),
        ({"skin": 0.4, "openings": ["up"]}, "openings = 'up'"),
        ({"skin": 0.4, "openings": [(50, 0, 0)]}, "a point on a face; the nearest is"),
        ({"tolerance": 2}, "tolerance = 2"),
        ({"tolerance": 1e-12}, "at least about 5.8e-09, which 40 control points reach"),
        (
            {"lattice": Lattice((1, 1, 1), 10, 1), "cell_size": None, "thickness": None, "tolerance": 1e-3},
            "tolerance = 0.001: expected none beside a lattice",
        ),
        ({"lattice": Lattice((1, 1, 1), 10, 1)}, "cell_size = 10.0: expected none beside a lattice"),
        ({"kind": "network-a", "thickness": None, "density": 0.01}, "above 0.02983"),
        ({"origin": (0, 0)}, "origin = (0, 0): expected three finite numbers"),
        ({"rotation": 3}, "rotation = 3: expected three finite numbers"),
        ({"origin": (0, 0, 1e300)}, "three numbers from -10,000,000 to 10,000,000 mm"),
        ({"rotation": (0, 361, 0)}, "three numbers from -360 to 360 degrees"),
        ({"skin": 1e-300}, "skin = 1e-300: expected at least 0.0001 mm"),
        ({"skin": 0.4, "openings": [(1e300, 0, 0)]}, "a point on a face; none is anywhere near"),
        ({"material_density": 7850}, "g/cm3, at most 100: of water it is 1"),
        ({"lattice": Lattice((1, 1, 1), 10, 1, scale_field=1e300), "cell_size": None, "thickness": None}, "at most 1"),
        ({"material_density": -1}, "material_density = -1"),
        ({"part": cq.Workplane().box(9, 9, 0.5)}, "a wall below the part's thickness, about 0.5 mm"),
    ],
)
def test_what_cannot_be_filled_is_refused_in_one_line(given: dict[str, Any], words: str) -> None:
    arguments = {"part": peg(), "cell_size": CELL, "thickness": WALL, **given}
    with pytest.raises(ParameterError) as caught:
        fill(**arguments)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_tolerance_is_heeded_of_a_uniform_wall_too() -> None:
    box = cq.Workplane().box(6, 6, 6)
    coarse, fine = (fill(box, CELL, WALL, fit=FitSettings(5), tolerance=part) for part in (0.5, 1e-5))
    exact = fill(box, CELL, WALL, fit=FitSettings(14)).report.volume
    assert abs(fine.report.volume / exact - 1) < 3e-6 < abs(coarse.report.volume / exact - 1)
    with pytest.raises(ParameterError, match=r"^tolerance = 1e-12: expected at least"):
        fill(box, CELL, WALL, tolerance=1e-12)


def test_solids_that_meet_in_an_edge_are_no_reason_to_refuse() -> None:
    part = part_of(cq.Workplane(cq.Compound.makeCompound([cq.Workplane().box(4, 4, 4).val(),
        cq.Workplane().box(4, 4, 4).translate((4, 4, 0)).val()])))  # fmt: skip
    assert part.volume == pytest.approx(128)


def test_a_lattice_from_far_away_fills_a_part_as_one_moved_by_whole_cells_does() -> None:
    given = {"thickness": "0.8 + 0.05*x", "fit": COARSE, "tolerance": 1e-3}
    far = fill(ball(), CELL, origin=(9_999_990.0, -9_999_990.0, 1e7), **given).report
    near = fill(ball(), CELL, origin=HOME, **given).report
    assert (far.volume, far.area) == pytest.approx((near.volume, near.area), rel=1e-6)


@pytest.mark.parametrize("content", [b"", b"not STEP at all", b"ISO-10303-21;\nHEADER;\nENDSEC;\n"])
def test_a_file_that_is_no_part_is_an_error(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "part.step").write_bytes(content)
    for path in (tmp_path / "part.step", tmp_path / "none.step"):
        with pytest.raises(ExportError, match=r"part\.step|none\.step"):
            fill(path, CELL, WALL)


def test_where_the_kernel_fails_the_lattice_is_shifted_a_little_and_the_report_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    split, calls = gyroid_cad.kernel.regions.split_by_region, []

    def failing_once(*arguments: Any) -> Any:
        calls.append(arguments)
        if len(calls) == 1:
            raise KernelError("tangent")
        return split(*arguments)

    only_by(monkeypatch, "booleans")
    monkeypatch.setattr(gyroid_cad.filling.roads, "split_by_region", failing_once)
    report = fill(peg(), CELL, WALL, origin=HOME, fit=COARSE).report
    assert len(calls) == 2
    assert 0 < np.linalg.norm(report.shift) < 0.01 * CELL
    assert report.valid


@pytest.mark.parametrize("wrong", ["the part itself", "nothing"])
def test_a_result_of_the_wrong_volume_is_never_handed_out(monkeypatch: pytest.MonkeyPatch, wrong: str) -> None:
    solid = peg().val().wrapped
    made = [Made(solid, *measure(solid))] if wrong == "the part itself" else []
    monkeypatch.setattr(gyroid_cad.filling.part, "taken", lambda *arguments: ({"sheet": made}, 0, 0))
    with pytest.raises(KernelError, match=r"where about .* are expected; nor with the lattice shifted a little, twice"):
        fill(peg(), CELL, WALL, fit=COARSE)


def test_voids_that_a_skin_seals_are_counted_with_place_and_volume_and_warned_of() -> None:
    with pytest.warns(SealedVoidsWarning, match="4 voids that no opening reaches, the largest"):
        sealed = fill(cq.Workplane().box(10, 8, 8), CELL, density=0.3, skin=1.0, fit=COARSE)
    assert len(sealed.report.voids) == 4
    sealed_volume = sum(void.volume for void in sealed.report.voids)
    assert sealed_volume == pytest.approx(10 * 8 * 8 - sealed.report.volume, rel=1e-4)
    assert "sealed voids   4 that no opening reaches: " in str(sealed)
    assert [void["volume"] for void in sealed.report.as_dict()["voids"]] == [v.volume for v in sealed.report.voids]


def test_chips_of_void_in_a_corner_are_closed_and_the_report_holds_the_rest() -> None:
    with pytest.warns(SealedVoidsWarning, match="2 voids"):
        sealed = fill(cq.Workplane().box(18, 10, 10), 8, density=0.3, skin=1.0, fit=COARSE)
    assert measure(sealed.solid()) == pytest.approx((sealed.report.volume, sealed.report.area), rel=1e-6)
    assert len(list(parts_of(sealed.solid(), TopAbs_SHELL))) == 1 + len(sealed.report.voids)


def test_a_core_of_the_users_own_is_filled_and_the_rest_is_skin(tmp_path: Path) -> None:
    core = cq.Workplane().box(8, 6, 7).translate((0, 0, 0.5))
    write_step(core.val().wrapped, tmp_path / "inner.step")
    made = fill(cq.Workplane().box(10, 8, 8), CELL, density=0.3, core=tmp_path / "inner.step", fit=COARSE)
    assert made.report.skin == pytest.approx(1.0)
    assert [void.volume < 1.0 for void in made.report.voids] == [True]
    assert made.report.min_wall < 1.0
    assert made.report.volume == pytest.approx(10 * 8 * 8 - 0.7 * 8 * 6 * 7, rel=0.1)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"skin": 1.0}, "skin = 1.0: expected none beside a core"),
        ({"openings": [">Z"]}, "openings = ['>Z']: expected none beside a core"),
        ({"kind": "surface", "density": None}, "expected none round the bare surface"),
        ({"core": "no solid"}, "no solid could not be read"),
        ({"core": 3.0}, "core = 3.0: expected a shape"),
    ],
)
def test_what_does_not_go_with_a_core_is_refused(given: dict[str, Any], words: str) -> None:
    settings = {"density": 0.3, "core": cq.Workplane().box(2, 2, 2), **given}
    with pytest.raises((ParameterError, ExportError)) as caught:
        fill(cq.Workplane().box(4, 4, 4), CELL, **settings)
    assert words in str(caught.value)

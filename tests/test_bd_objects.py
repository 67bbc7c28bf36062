"""build123d: ``Gyroid`` in builders and in algebra, its place and its modes."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import build123d as bd
import numpy as np
import pytest

from gyroid_cad.bd_objects import Gyroid, GyroidFill
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.makers import linear
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

GYROID: dict[str, Any] = {"cells": (1, 1, 1), "cell_size": 10.0, "thickness": 0.8, "fit": FitSettings(4)}
# Seen from the middle of the lattice, the centre of one of its patches: a small box there cuts few faces.
CHIP = (2.5, -1.25, 0.0)
CHIP_SIDE = 1.5


@pytest.fixture(scope="module")
def lattice() -> Lattice:
    return Lattice(**GYROID)


@pytest.fixture(scope="module")
def volume() -> float:
    return float(Gyroid(**GYROID).volume)


@pytest.fixture(scope="module")
def common_volume() -> float:
    return float((Gyroid(**GYROID) & chip()).volume)


def chip() -> bd.Part:
    return bd.Pos(*CHIP) * bd.Box(CHIP_SIDE, CHIP_SIDE, CHIP_SIDE)


def box_of(shape: bd.Shape) -> np.ndarray:
    box = shape.bounding_box()
    return np.array([tuple(box.min), tuple(box.max)])


def test_a_gyroid_is_a_part_of_one_valid_solid_that_knows_its_lattice(lattice: Lattice) -> None:
    part = Gyroid(**GYROID)
    assert isinstance(part, bd.Part)
    assert len(part.solids()) == 1
    assert part.is_valid
    assert part.lattice == lattice
    assert part.volume == pytest.approx(lattice.wall().volume(), rel=1e-4)


@pytest.mark.parametrize(
    "align",
    [
        bd.Align.MIN,
        bd.Align.CENTER,
        bd.Align.MAX,
        (bd.Align.MIN, bd.Align.CENTER, bd.Align.MAX),
        (bd.Align.CENTER, bd.Align.MAX, bd.Align.MIN),
    ],
)
def test_it_is_aligned_as_a_box_of_its_size_is(lattice: Lattice, align: bd.Align | tuple[bd.Align, ...]) -> None:
    low, high = np.array(lattice.bounding_box())
    box = bd.Box(*(high - low).tolist(), align=align)
    np.testing.assert_allclose(box_of(Gyroid(**GYROID, align=align)), box_of(box), atol=1e-6)


@pytest.mark.parametrize("align", [None, bd.Align.NONE, (bd.Align.NONE, bd.Align.NONE, bd.Align.NONE)])
def test_unaligned_it_stands_where_its_lattice_does(lattice: Lattice, align: Any) -> None:
    np.testing.assert_allclose(box_of(Gyroid(**GYROID, align=align)), lattice.bounding_box(), atol=1e-6)


def test_two_in_a_row_are_in_the_same_place_and_the_cached_lattice_stays_in_its_own(lattice: Lattice) -> None:
    before = lattice.bounding_box()
    first = box_of(Gyroid(**GYROID, align=bd.Align.MIN))
    np.testing.assert_array_equal(box_of(Gyroid(**GYROID, align=bd.Align.MIN)), first)
    assert lattice.solid().Location().IsIdentity()
    assert lattice.bounding_box() == before


def test_moving_or_aligning_one_moves_no_other(lattice: Lattice) -> None:
    moved, other = Gyroid(**GYROID), Gyroid(**GYROID)
    place = box_of(other)
    moved.locate(bd.Location((50, 0, 0)))
    moved.move(bd.Location((0, 60, 0)))
    np.testing.assert_allclose(box_of(moved) - place, [[50, 60, 0], [50, 60, 0]], atol=1e-6)
    np.testing.assert_array_equal(box_of(other), place)
    np.testing.assert_array_equal(box_of(Gyroid(**GYROID)), place)
    assert lattice.solid().Location().IsIdentity()


def test_rotation_turns_about_the_origin_after_aligning(volume: float) -> None:
    rotation = (10, 20, 30)
    turned = Gyroid(**GYROID, align=bd.Align.MIN, rotation=rotation)
    same = bd.Rotation(*rotation) * Gyroid(**GYROID, align=bd.Align.MIN)
    np.testing.assert_allclose(box_of(turned), box_of(same), atol=1e-6)
    assert turned.volume == pytest.approx(volume, rel=1e-6)
    assert not np.allclose(box_of(turned), box_of(Gyroid(**GYROID, align=bd.Align.MIN)), atol=0.1)


def test_a_builder_puts_one_at_each_of_its_locations(volume: float) -> None:
    with bd.BuildPart() as builder, bd.Locations((0, 0, 0), (30, 0, 0), (0, 40, 50)):
        Gyroid(**GYROID)
    solids = builder.part.solids()
    middles = sorted(tuple(np.mean(box_of(solid), axis=0).round(6).tolist()) for solid in solids)
    assert middles == [(0.0, 0.0, 0.0), (0.0, 40.0, 50.0), (30.0, 0.0, 0.0)]
    assert builder.part.volume == pytest.approx(3 * volume, rel=1e-9)


def test_a_location_on_a_turned_plane_turns_the_lattice_with_it(volume: float) -> None:
    plane = bd.Plane(origin=(1, 2, 3), z_dir=(1, 1, 1))
    with bd.BuildPart(plane) as builder:
        Gyroid(**GYROID, align=bd.Align.MIN)
    np.testing.assert_allclose(box_of(builder.part), box_of(plane * Gyroid(**GYROID, align=bd.Align.MIN)), atol=1e-5)
    assert builder.part.volume == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize("mode", [bd.Mode.ADD, bd.Mode.SUBTRACT, bd.Mode.INTERSECT, bd.Mode.REPLACE, bd.Mode.PRIVATE])
def test_each_mode_leaves_the_volume_that_set_theory_says(mode: bd.Mode, volume: float, common_volume: float) -> None:
    box = CHIP_SIDE**3
    expected = {
        bd.Mode.ADD: volume + box - common_volume,
        bd.Mode.SUBTRACT: box - common_volume,
        bd.Mode.INTERSECT: common_volume,
        bd.Mode.REPLACE: volume,
        bd.Mode.PRIVATE: box,
    }
    with bd.BuildPart() as builder:
        with bd.Locations(CHIP):
            bd.Box(CHIP_SIDE, CHIP_SIDE, CHIP_SIDE)
        Gyroid(**GYROID, mode=mode)
    assert 0 < common_volume < box
    assert builder.part.is_valid
    assert builder.part.volume == pytest.approx(expected[mode], abs=1e-4 * box)


def test_algebra_gives_what_the_builder_gives(volume: float, common_volume: float) -> None:
    box = CHIP_SIDE**3
    fused, drilled = Gyroid(**GYROID) + chip(), Gyroid(**GYROID) - chip()
    # The host's own integrals are some 6e-5 off on whole patches, and less on those that were cut.
    assert fused.volume == pytest.approx(volume + box - common_volume, rel=5e-5)
    assert drilled.volume == pytest.approx(volume - common_volume, rel=5e-5)
    assert fused.is_valid
    assert drilled.is_valid


def test_a_copy_is_as_full_and_a_deep_one_shares_nothing(volume: float) -> None:
    part = Gyroid(**GYROID)
    for twin in (copy.copy(part), copy.deepcopy(part)):
        assert twin.volume == pytest.approx(volume, rel=1e-9)
    assert not copy.deepcopy(part).solid().wrapped.IsPartner(part.solid().wrapped)


def test_density_says_the_same_as_the_thickness_it_gives(lattice: Lattice, volume: float) -> None:
    by_density = {**GYROID, "thickness": None, "density": lattice.volume_fraction}
    assert Gyroid(**by_density).volume == pytest.approx(volume, rel=1e-9)


@pytest.mark.parametrize("bad", [{"cells": (0, 1, 1)}, {"thickness": 4.0}, {"density": 0.2}, {"cell_size": -1}])
def test_a_bad_value_is_a_value_error_and_leaves_the_builder_as_it_was(bad: dict[str, Any]) -> None:
    with bd.BuildPart() as builder:
        bd.Box(1, 2, 3)
        with pytest.raises(ValueError, match="expected") as caught:
            Gyroid(**{**GYROID, **bad})
    assert isinstance(caught.value, ParameterError)
    assert builder.part.volume == pytest.approx(6)


def test_it_belongs_to_a_part_and_to_no_sketch() -> None:
    with bd.BuildSketch(), pytest.raises(RuntimeError):
        Gyroid(**GYROID)


def test_fields_and_maps_are_those_of_a_lattice() -> None:
    varying: dict[str, Any] = {
        "density": linear(0.2, z=0.01),
        "scale_field": "1 + 0.01*y",
        "map": "bend:angle=30",
        "tolerance": 1e-2,
    }
    part = Gyroid((1, 1, 1), 10.0, fit=FitSettings(6), align=None, **varying)
    lattice = Lattice((1, 1, 1), 10.0, fit=FitSettings(6), **varying)
    assert part.is_valid
    assert len(part.solids()) == 1
    assert part.volume == pytest.approx(lattice.exact_volume, rel=2e-3)
    np.testing.assert_allclose(box_of(part), lattice.bounding_box(), atol=1e-6)


FILL: dict[str, Any] = {"cell_size": 10, "thickness": 0.9, "fit": FitSettings(4)}


def test_a_builders_part_is_replaced_by_what_is_left_of_it_wherever_its_locations_are() -> None:
    with bd.BuildPart() as builder:
        bd.Box(4, 5, 3)
        with bd.Locations((100, 0, 0), (0, 50, 0)):
            light = GyroidFill(**FILL)
    assert builder.part is not None
    assert builder.part.volume == pytest.approx(light.report.volume, rel=1e-5)
    assert builder.part.is_valid


def test_in_algebra_a_part_is_filled_and_left_as_it_was() -> None:
    box = bd.Box(4, 5, 3)
    light = GyroidFill(box, **FILL)
    assert isinstance(light, bd.Part)
    assert light.volume == pytest.approx(light.report.volume, rel=1e-5)
    assert box.volume == pytest.approx(4 * 5 * 3)


def test_faces_of_the_part_may_be_left_open() -> None:
    box = bd.Box(5, 5, 4)
    light = GyroidFill(box, **FILL, skin=0.5, openings=box.faces().sort_by(bd.Axis.Z)[-1:])
    above = light.faces().filter_by_position(bd.Axis.Z, 2 - 1e-6, 2 + 1e-6)
    assert light.is_valid
    assert sum(face.area for face in above) < 5 * 5 - 1


def test_filling_may_add_to_what_is_there_or_cut_from_it() -> None:
    with bd.BuildPart() as builder:
        bd.Box(4, 5, 3)
        channels = GyroidFill(**FILL, kind="channels", mode=bd.Mode.PRIVATE)
    assert builder.part is not None
    assert builder.part.volume == pytest.approx(4 * 5 * 3)
    assert 0 < channels.volume < 4 * 5 * 3


def test_nothing_to_fill_is_refused() -> None:
    with pytest.raises(ParameterError, match="a builder with one in it"), bd.BuildPart():
        GyroidFill(**FILL)
    with pytest.raises(ParameterError, match="part = None"):
        GyroidFill(**FILL)


@pytest.mark.parametrize(("keep", "solids"), [(False, 1), (True, 3)])
def test_chips_at_the_corners_of_whole_cells_are_dropped_unless_they_are_to_be_kept(keep: bool, solids: int) -> None:
    box = bd.Box(10, 10, 10, align=bd.Align.MIN)
    filled = GyroidFill(box, 10, 0.8, fit=GYROID["fit"], keep_islands=keep)
    assert len(Gyroid(**GYROID, trim="box", keep_islands=keep).solids()) == len(filled.solids()) == solids
    assert filled.report.islands + filled.report.dropped == 2


def test_each_domain_of_a_filled_part_is_a_child_and_keeps_its_name_in_a_file(
    tmp_path: Path,
) -> None:
    fluids = bd.Pos(50, 0, 0) * GyroidFill(bd.Box(6, 5, 4), 10, 0.8, kind="channels")
    assert [child.label for child in fluids.children] == ["channel-a", "channel-b"]
    assert sum(child.volume for child in fluids.children) == pytest.approx(fluids.volume)
    assert bd.export_step(fluids, tmp_path / "fluids.step")
    back = bd.import_step(tmp_path / "fluids.step")
    assert {"channel-a", "channel-b"} <= {shape.label for shape in back.descendants}
    np.testing.assert_allclose(back.bounding_box().center().X, 50, atol=0.5)


def test_one_domain_is_the_label_of_the_part_itself() -> None:
    assert GyroidFill(bd.Box(6, 5, 4), 10, 0.8).label == "sheet"

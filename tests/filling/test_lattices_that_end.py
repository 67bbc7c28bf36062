"""A lattice that ends within a part ends at walls of its own, which the part's boundary cuts as it does the others."""

from __future__ import annotations

import functools
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest
import trimesh

import gyroid_cad.filling.part
import gyroid_cad.filling.roads
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.infill import block_infill
from gyroid_cad.filling.part import part_of
from gyroid_cad.kernel.check import is_valid, measure, topology
from gyroid_cad.lattice import Lattice
from gyroid_cad.maps import Cylinder, SpaceMap
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.surface.symmetry import CELL_QUARTERS
from gyroid_cad.wall.areas import fitted_areas
from gyroid_cad.wall.covering import AT_HOME
from gyroid_cad.wall.offset import Wall

COARSE, CELL = FitSettings(5), 6.0
# Of little more than one cell the patches on its border are left out: they reach beyond where the map ends.
SHEARED = SpaceMap(lambda x, y, z: (x + 0.15 * z, y, z), domain=((-1.3,) * 3, (7.3,) * 3))
CUBE = cq.Workplane().box(20, 20, 20).translate((3.1, 3, 3))
ROD = cq.Workplane().circle(2.2).extrude(12).translate((3.1, 2.9, -3))
WHERE_A_TURN_ENDS = cq.Workplane().box(6, 14, 5).rotate((0, 0, 0), (0, 0, 1), 40).translate((-8.2, -6.7, 2))

pytestmark = pytest.mark.filterwarnings(
    "ignore::gyroid_cad.PartWarning",
    "ignore::gyroid_cad.IslandsWarning",
    "ignore::gyroid_cad.errors.SealedVoidsWarning",
)


def block(surface: Any = "gyroid", **given: Any) -> Lattice:
    described = {"cells": (1, 1, 1), "density": 0.3, "map": SHEARED, **given}
    return Lattice(cell_size=CELL, fit=COARSE, tolerance=1e-2, surface=surface, **described)


@functools.cache
def filled(part: cq.Workplane, lattice: Lattice, road: str = "crossings", **given: Any) -> Filled:
    """Fill a part by one road alone."""
    every = gyroid_cad.filling.roads.taken

    def taken(tried: str, *arguments: Any) -> Any:
        if tried != road:
            raise KernelError("not by this road")
        return every(tried, *arguments)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(gyroid_cad.filling.part, "taken", taken)
        return fill(part, lattice=lattice, partial=True, keep_islands=True, **given)


GRADED = block("primitive", density="0.3 + 0.02*x")


def wall_in(part: cq.Workplane, lattice: Lattice) -> Wall:
    return block_infill(lattice, part_of(part), AT_HOME, lambda stage: nullcontext(), partial=True).wall


@pytest.mark.parametrize("surface", ["gyroid", "diamond", "primitive"])
def test_a_wall_that_ends_within_a_part_is_left_whole(surface: str) -> None:
    made, wall = filled(CUBE, block(surface)).report, wall_in(CUBE, block(surface))
    areas = fitted_areas(wall)
    assert made.volume == pytest.approx(wall.volume(), rel=1e-12)
    assert made.area == pytest.approx(areas.face_a + areas.face_b + areas.rim, rel=1e-6)
    assert made.faces == 2 * wall.complex.patch_count + int(wall.complex.free.sum())


def test_two_halves_of_a_part_hold_as_much_as_the_whole() -> None:
    lattice = block("diamond")
    halves = [filled(CUBE.translate((side * 10, 0, 0)), lattice).report for side in (-1, 1)]
    assert min(half.cut_patches for half in halves) > 0
    assert sum(half.volume for half in halves) == pytest.approx(wall_in(CUBE, lattice).volume(), rel=1e-5)


@pytest.mark.parametrize(
    ("part", "lattice"),
    [(ROD, GRADED), (WHERE_A_TURN_ENDS, block(cells=(2, 1, 1), map=Cylinder(radius=9, angle=80)))],
    ids=["graded", "cylinder"],
)
def test_what_a_part_cuts_off_is_valid_closed_and_of_the_size_that_the_kernel_measures(
    part: cq.Workplane, lattice: Lattice
) -> None:
    made = filled(part, lattice)
    assert 0 < made.report.uncovered < 1
    assert made.report.shift == (0, 0, 0)
    assert is_valid(made.solid())
    assert topology(made.solid()).closed
    assert (made.report.volume, made.report.area) == pytest.approx(measure(made.solid()), rel=1e-5)


def test_the_kernels_fuse_comes_to_the_same_where_a_lattice_ends() -> None:
    ours, theirs = (filled(ROD, GRADED, road).report for road in ("crossings", "booleans"))
    assert (ours.solids, ours.faces) == (theirs.solids, theirs.faces)
    assert (ours.volume, ours.area) == pytest.approx((theirs.volume, theirs.area), rel=1e-5)


def test_files_of_a_lattice_that_ends_in_a_part_are_closed_and_hold_as_much(tmp_path: Path) -> None:
    made = filled(ROD, GRADED)
    made.write(tmp_path / "rod.step", tmp_path / "rod.stl", deviation=0.01)
    read = cq.importers.importStep(str(tmp_path / "rod.step")).val().wrapped
    counted = topology(read)
    assert (counted.solids, counted.faces, counted.closed) == (made.report.solids, made.report.faces, True)
    assert is_valid(read)
    assert measure(read)[0] == pytest.approx(made.report.volume, rel=1e-5)
    mesh = trimesh.load(tmp_path / "rod.stl")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(made.report.volume, rel=3e-3)


def test_a_skin_is_fused_with_a_lattice_whose_posts_meet_at_it() -> None:
    complex = wall_in(CUBE, block()).complex
    # At a corner with two fans two pairs of side walls touch in a line: the core's side goes across it.
    corner = complex.corner_quarters[np.argmax(np.bincount(complex.fan_corner) > 1)] * (CELL / CELL_QUARTERS)
    x, y, z = (float(value) for value in SHEARED.function(*corner))
    skin, half = 0.5, 8.0
    core, part = (
        cq.Workplane().box(size, size, size).translate((x + half + 0.03, y, z))
        for size in (2 * half, 2 * (half + skin))
    )
    within, made = filled(core, block()).report, filled(part, block(), skin=skin).report
    assert (made.solids, len(made.voids)) == (1, 1)
    assert made.shift == (0, 0, 0)
    assert made.volume == pytest.approx(made.part_volume - within.part_volume + within.volume, rel=1e-7)


def test_a_lattice_that_nothing_of_comes_to_the_part_is_an_error() -> None:
    with pytest.raises(ParameterError, match="a block that comes to the part"):
        fill(ROD.translate((40, 0, 0)), lattice=block(), partial=True)

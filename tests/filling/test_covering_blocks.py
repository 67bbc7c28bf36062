"""Blocks of cells go on beyond their ends until the part is covered; what is out of their reach is said."""

from __future__ import annotations

from contextlib import nullcontext
from typing import Any

import cadquery as cq
import numpy as np
import pytest

from gyroid_cad.errors import ParameterError, PartWarning
from gyroid_cad.filling.extent import preimages
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.infill import Infill, block_infill
from gyroid_cad.filling.part import part_of
from gyroid_cad.filling.wanted import SHEET, regions_of
from gyroid_cad.lattice import Lattice
from gyroid_cad.maps import Bend, Cylinder, SpaceMap, Sphere, Twist
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.covering import AT_HOME

COARSE, CELL, DENSITY = FitSettings(5), 10.0, 0.3
JAR = cq.Workplane().circle(14).circle(11).extrude(9)
RING = {"cells": (6, 1, 1), "map": Cylinder(radius=9.5, angle=360)}


def mapped(cells: tuple[int, int, int], **given: Any) -> Lattice:
    return Lattice(cells, CELL, density=DENSITY, tolerance=1e-2, **given)


def covering(lattice: Lattice, part: cq.Workplane, partial: bool = False) -> Infill:
    return block_infill(lattice, part_of(part), AT_HOME, lambda stage: nullcontext(), partial)


@pytest.mark.parametrize("centred", [False, True])
def test_a_block_fills_a_box_of_its_size_wherever_that_stands(centred: bool) -> None:
    box = cq.Workplane().box(20, 20, 20, centered=centred)
    given = fill(box, lattice=Lattice((2, 2, 2), CELL, density=DENSITY, fit=COARSE)).report
    endless = fill(box, CELL, density=DENSITY, fit=COARSE).report
    assert (given.volume, given.faces, given.solids) == pytest.approx((endless.volume, endless.faces, 1))
    assert given.volume == pytest.approx(2400, rel=1e-3)


def test_the_fields_of_a_block_are_asked_where_it_stands_however_far_it_goes_on() -> None:
    box = cq.Workplane().box(8, 8, 8).translate((30, 0, 0))
    lattice = Lattice((1, 1, 1), 8, "0.5 + 0.02*x", tolerance=1e-2, origin=(0, 5, 0), rotation=(0, 0, 90))
    # Turned so, the lattice's x is the part's y - 5.
    given, asked = fill(box, lattice=lattice).report, {"rotation": (0, 0, 90), "origin": (0, 5, 0), "tolerance": 1e-2}
    endless = fill(box, 8, "0.5 + 0.02*(y - 5)", **asked).report
    assert (given.volume, given.min_wall, given.thickness) == pytest.approx(
        (endless.volume, endless.min_wall, endless.thickness)
    )


@pytest.mark.parametrize(
    ("lattice", "part"),
    [
        (mapped(**RING), JAR),
        (mapped((1, 1, 1), map=Twist(angle=20, x=0, y=0)), cq.Workplane().box(16, 10, 12)),
        (mapped((1, 1, 1), scale_field="1 + 0.01*x"), cq.Workplane().box(16, 10, 12)),
        (mapped((2, 1, 1), map=Bend(angle=40)), cq.Workplane().box(30, 6, 6)),
    ],
    ids=["jar", "twist", "scale", "bend"],
)
def test_a_mapped_block_goes_on_until_it_has_covered_the_part(lattice: Lattice, part: cq.Workplane) -> None:
    infill, whole = covering(lattice, part), part_of(part)
    assert infill.uncovered == 0
    (region,) = regions_of(SHEET, CELL, None, DENSITY, lattice.minimal_surface.tube).regions
    points = whole.points_inside(6000)
    # A twentieth of the part without a lattice would take a twentieth of the volume.
    assert np.mean(infill.contains(region, points)) == pytest.approx(DENSITY, abs=0.022)


def test_ends_that_are_joined_stay_and_cells_are_added_along_the_axis_and_outwards() -> None:
    infill = covering(mapped(**RING), JAR.union(cq.Workplane().circle(16).circle(12).extrude(14)))
    low, high = infill.complex.patch_cell.min(axis=0), infill.complex.patch_cell.max(axis=0)
    assert (low[0], high[0]) == (0, 5)
    assert low[1] < 0 < high[1]


def test_what_no_map_reaches_is_an_error_that_says_how_much_and_where_unless_it_may_be() -> None:
    rod = cq.Workplane().circle(8).extrude(5)
    lattice = mapped((5, 1, 1), map=Cylinder(radius=8, angle=360))
    with pytest.raises(ParameterError) as refused:
        fill(rod, lattice=lattice)
    words = str(refused.value)
    assert words.startswith("cells = (5, 1, 1): expected a block that covers the part, or partial: ")
    place = [float(number) for number in words.rpartition("(")[2].removesuffix(") mm").split(",")]
    assert np.hypot(*place[:2]) < 4
    share = covering(lattice, rod, partial=True).uncovered
    assert f"{100 * share:.2g} % of it is out of reach" in words


def test_a_part_filled_as_far_as_a_block_reaches_says_so() -> None:
    arch = cq.Workplane().circle(16).circle(12).extrude(4)
    half = mapped((3, 1, 1), map=Cylinder(radius=12, angle=140))
    with pytest.warns(PartWarning, match="of the part is out of the lattice's reach"):
        made = fill(arch, lattice=half, partial=True).report
    # Round the arch the block goes on up to where its ends would meet.
    assert 0.01 < made.uncovered < 0.2
    assert f"{100 * made.uncovered:.3g} % of the part" in str(made)
    assert made.valid
    assert made.volume == pytest.approx(DENSITY * (1 - made.uncovered) * made.part_volume, rel=0.06)


@pytest.mark.parametrize(
    "given",
    [Cylinder(radius=12, angle=200), Sphere(radius=20), Twist(angle=50, x=3, y=-2), Bend(angle=-60),
     SpaceMap(lambda x, y, z: (x, y, z + np.sqrt(x + 30)))],
    ids=["cylinder", "sphere", "twist", "bend", "function that ends"],
)  # fmt: skip
def test_the_place_that_a_map_carries_to_a_given_one_is_found_beyond_the_block_too(given: Any) -> None:
    lattice = mapped((2, 1, 1), map=given, scale_field="1 + 0.002*y")
    grading = lattice.spec().grading
    points = np.random.default_rng(7).uniform((-4, -4, -3), (24, 14, 12), (200, 3))
    images = grading.image(points)[1]
    found = preimages(grading, lattice.cells, images)
    np.testing.assert_allclose(grading.image(found)[1], images, atol=1e-4)

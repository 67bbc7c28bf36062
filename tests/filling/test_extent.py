"""Where a part is: fields are heeded there, and only there."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest

from gyroid_cad.errors import IslandsWarning, SelfIntersectionError
from gyroid_cad.filling.extent import PartExtent, extent_of
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.part import part_of
from gyroid_cad.kernel.check import is_valid
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings

CELL, RADIUS, MIDDLE = 6.0, 2.2, (5.0, 4.0, 6.0)
SQUARED = "((x - 5)**2 + (y - 4)**2 + (z - 6)**2)"
# Of the wall in the ball's middle, and of what is left of it at the rim.
DENSITY, LEFT = 0.4, 0.02
PARTS = {
    "ball": cq.Workplane(origin=MIDDLE).sphere(RADIUS),
    "plate with holes": cq.Workplane().box(12, 9, 2).faces(">Z").workplane().rarray(5, 4, 2, 2).hole(2.5),
    "wedge": cq.Workplane().polyline([(0, 0), (14, 0), (14, 2)]).close().extrude(6),
}


def falling(to: float) -> str:
    """A density that falls to zero a little beyond a distance from the ball's middle."""
    return f"{DENSITY}*({1 + LEFT} - {SQUARED}/{to**2})"


def test_a_density_that_is_nothing_beyond_the_rim_fills_the_ball() -> None:
    # Patches reach out of it by more than its radius, to where this density is below -2.
    made = fill(PARTS["ball"], CELL, density=falling(RADIUS), fit=FitSettings(6), tolerance=1e-3)
    report = made.report
    assert is_valid(made.solid())
    assert report.closed
    assert report.min_wall == pytest.approx(USUAL.tube.thickness(LEFT * DENSITY) * CELL, rel=0.5)
    assert report.thickness < USUAL.tube.thickness(DENSITY * (1 + LEFT)) * CELL


def test_a_density_that_is_nothing_within_the_part_is_refused_for_a_place_there() -> None:
    with pytest.raises(SelfIntersectionError) as refused:
        fill(PARTS["ball"], CELL, density=falling(0.8 * RADIUS), fit=FitSettings(6), tolerance=1e-3)
    away = np.linalg.norm(np.array(refused.value.place) - MIDDLE)
    assert 0.8 * RADIUS < away < RADIUS


@pytest.mark.parametrize("thickness", ["0.2 - 0.0398*x", "0.2 + 0.0398*x"])
def test_a_wall_that_ends_at_the_sides_of_a_box_fills_it(thickness: str) -> None:
    made = fill(cq.Workplane().box(10, 8, 8), 10.0, thickness, fit=FitSettings(6))
    assert made.report.by_sections
    assert is_valid(made.solid())
    assert made.report.min_wall is not None
    assert 0 < made.report.min_wall < 0.02


def test_a_block_that_is_trimmed_is_asked_for_no_wall_beside_it() -> None:
    density = "0.3*(1.02 - z/10)"
    with pytest.warns(IslandsWarning):
        made = Lattice((1, 1, 1), 10.0, density=density, trim="box", tolerance=1e-3).report()
    assert made.valid
    assert made.closed
    with pytest.raises(SelfIntersectionError, match="above 0"):
        Lattice((1, 1, 1), 10.0, density=density).report()
    with pytest.raises(SelfIntersectionError, match="above 0"):
        Lattice((1, 1, 1), 10.0, density="0.3*(0.9 - z/10)", trim="box").report()


@pytest.mark.parametrize("name", PARTS)
def test_the_extent_of_a_part_is_what_the_kernel_says_of_points(name: str) -> None:
    part = part_of(PARTS[name])
    points = np.random.default_rng(3).uniform(part.low - 2, part.high + 2, (800, 3))
    inside = part.contains(points)
    extent = PartExtent(part, 4.0)
    assert np.array_equal(extent.contains(points), inside)
    assert not np.any(inside & ~extent.near(points, 0.0))
    # A point is near if it is within reach of anything inside.
    away = np.random.default_rng(4).normal(size=(np.sum(inside), 3))
    assert extent.near(points[inside] + away, np.linalg.norm(away, axis=1)).all()
    assert not extent.near(part.high[np.newaxis] + 5.0, 2.0).any()


def test_the_extent_of_a_box_is_known_wherever_it_stands() -> None:
    turned = cq.Workplane().box(8, 6, 4).rotate((0, 0, 0), (1, 2, 3), 40).translate((3, 2, 1))
    part = part_of(turned)
    assert part.box is not None
    points = np.random.default_rng(5).uniform(part.low - 2, part.high + 2, (300, 3))
    assert np.array_equal(extent_of(part, 4.0).contains(points), part.contains(points))

"""The paper's units, and the three specimens it printed."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad import Lattice
from gyroid_cad.errors import ParameterError, SelfIntersectionError
from gyroid_cad.fields.field import Field
from gyroid_cad.fields.makers import PaperUnits, paper_units
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.symmetry import CELL_QUARTERS, placed_corners
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.exact import exact_measures
from gyroid_cad.wall.refit import WALL_PER_TOLERANCE, fitted_nets, graded_wall, measured
from gyroid_cad.wall.self_intersection import require_simple, require_simple_fit

TUBE = USUAL.tube

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]

SCALES = st.floats(0.1, 1e3)
LENGTHS = st.floats(0.1, 10)
POINTS = np.random.default_rng(9).uniform(-2, 8, (3, 30))
THICKNESS, LENGTH = "0.08 + 0.05*x + 0.02*y", "1 + 0.05*x + 0.08*y"
# Sec. 3.2: number of cubic cells, thickness factor, BC length.
SPECIMENS: dict[str, tuple[Cells, float | str, float | str]] = {
    "thickness": ((3, 3, 1), THICKNESS, 1.0),
    "BC length": ((3, 3, 1), 0.08, "1 + 0.3*x + 0.08*y"),
    "both": ((3, 3, 2), THICKNESS, LENGTH),
}
# Bounding cells along a cubic cell.
BC_PER_CELL = 2


def thickness_of(x: Floats, y: Floats) -> Floats:
    return 0.08 + 0.05 * x + 0.02 * y


def values(field: float | Field | None, points: Floats) -> Floats:
    assert isinstance(field, Field)
    return field(*points)


def parts(name: str, cells: Cells | None = None, scale: float = 1.0) -> tuple[Lattice, CellComplex, Any]:
    printed, thickness, length = SPECIMENS[name]
    lattice = Lattice.paper(cells or printed, thickness, length, scale)
    return lattice, build_complex(lattice.cells), lattice.grading()


def nets(lattice: Lattice, control_points: int = 6) -> Floats:
    complex = build_complex(lattice.cells)
    return fitted_nets(complex, lattice.grading(), control_points, np.arange(complex.patch_count))


@given(SCALES, st.floats(0.01, 0.3), LENGTHS)
def test_constant_units_are_those_of_a_plain_lattice(scale: float, factor: float, length: float) -> None:
    units = paper_units(factor, length, scale)
    assert units == PaperUnits(pytest.approx(2 * length * scale), pytest.approx(factor * scale), None)  # type: ignore[arg-type]
    lattice = Lattice.paper((2, 1, 3), 0.1 * length, length, scale)
    plain = Lattice((2, 1, 3), 2 * length * scale, 0.1 * length * scale)
    assert lattice.cell_size == pytest.approx(plain.cell_size, rel=1e-15)
    assert lattice.thickness == pytest.approx(plain.thickness, rel=1e-15)
    assert lattice.scale_field is None
    assert lattice.uniform


@given(SCALES, LENGTHS)
def test_a_thickness_factor_is_a_wall_in_mm_of_places_in_mm(scale: float, length: float) -> None:
    units = paper_units(THICKNESS, length, scale)
    x, y, _ = POINTS
    requested = values(units.thickness, length * scale * POINTS)
    np.testing.assert_allclose(requested, scale * thickness_of(x, y), rtol=1e-12, atol=1e-12 * scale)


@given(SCALES)
def test_a_varying_length_is_a_factor_without_unit_of_places_in_mm(scale: float) -> None:
    units = paper_units(THICKNESS, LENGTH, scale)
    x, y, _ = POINTS
    assert units.cell_size == pytest.approx(BC_PER_CELL * scale)
    np.testing.assert_allclose(values(units.scale_field, scale * POINTS), 1 + 0.05 * x + 0.08 * y, rtol=1e-12)
    requested = values(units.thickness, scale * POINTS)
    np.testing.assert_allclose(requested, scale * thickness_of(x, y), rtol=1e-12, atol=1e-12 * scale)


@settings(max_examples=10)
@given(LENGTHS, SCALES)
def test_a_length_that_is_the_same_everywhere_may_be_a_number_or_a_field(length: float, scale: float) -> None:
    number = Lattice.paper((1, 1, 1), THICKNESS, length, scale)
    constant = Lattice.paper((1, 1, 1), THICKNESS, lambda x, y, z: np.full_like(x, length), scale)
    assert constant.scale_field is not None
    np.testing.assert_allclose(nets(number), nets(constant), rtol=0, atol=1e-11 * length * scale)


@settings(max_examples=10)
@given(SCALES)
@pytest.mark.parametrize("name", SPECIMENS)
def test_the_scale_makes_a_similar_lattice(name: str, scale: float) -> None:
    small, large = (parts(name, (1, 1, 1), s)[0] for s in (1.0, scale))
    np.testing.assert_allclose(nets(large), scale * nets(small), rtol=0, atol=1e-10 * scale)


def test_a_callable_and_a_field_do_as_well_as_a_formula() -> None:
    lattices = [
        Lattice.paper((1, 1, 1), thickness, "1 + 0.1*z", 3.0)
        for thickness in (THICKNESS, lambda x, y, z: thickness_of(x, y), Field(lambda x, y, z: thickness_of(x, y), "t"))
    ]
    for lattice in lattices[1:]:
        np.testing.assert_allclose(nets(lattice), nets(lattices[0]), rtol=0, atol=1e-12)


def test_lattices_of_the_same_formulas_are_equal() -> None:
    one, two = (Lattice.paper((1, 1, 1), THICKNESS, LENGTH, 2.0) for _ in range(2))
    assert one == two
    assert hash(one.grading()) == hash(two.grading())
    assert one != Lattice.paper((1, 1, 1), THICKNESS, LENGTH, 3.0)


def test_fields_in_other_units_print_what_they_are() -> None:
    units = paper_units(THICKNESS, LENGTH, 2.5)
    assert str(units.thickness) == f"2.5*({THICKNESS})(x/2.5, y/2.5, z/2.5)"
    assert str(units.scale_field) == f"({LENGTH})(x/2.5, y/2.5, z/2.5)"


@pytest.mark.parametrize("bad", [0, -1.0, nan, inf, "1", True, None, 1j, 10**400])
def test_the_scale_is_a_positive_number(bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^scale = .*mm per unit of BC length, above 0"):
        Lattice.paper((1, 1, 1), 0.1, scale=bad)


@pytest.mark.parametrize("bad", [0, -1.0, nan, inf, True, None, [1], "1 +", "0*3", "w", "1/0", 10**400])
def test_a_length_is_above_0_or_a_field(bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^bc_length") as caught:
        Lattice.paper((1, 1, 1), 0.1, bc_length=bad)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("bad", [nan, inf, True, None, [1], "0.08 +", "w", "x.y", 10**400])
def test_a_thickness_factor_is_a_number_or_a_field(bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^thickness_factor"):
        Lattice.paper((1, 1, 1), bad)


@pytest.mark.parametrize(
    ("thickness", "length", "parameter"),
    [
        ("0.1 - x", 1.0, "thickness_factor"),
        ("0.1/(x - x)", 1.0, "thickness_factor"),
        (0.1, "1 - x", "bc_length"),
    ],
)
def test_a_field_that_fails_somewhere_is_named_as_the_caller_did(thickness: Any, length: Any, parameter: str) -> None:
    with pytest.raises(ParameterError) as caught:
        nets(Lattice.paper((1, 1, 1), thickness, length))
    assert caught.value.parameter == parameter


@pytest.mark.parametrize("name", SPECIMENS)
@pytest.mark.parametrize("whole", [False, True], ids=["one cell", "as printed"])
def test_the_papers_specimens_are_sound(name: str, whole: bool) -> None:
    _, complex, grading = parts(name, None if whole else (1, 1, 1))
    require_simple(complex, grading)
    wall = graded_wall(complex, grading, 14)
    require_simple_fit(wall, grading)
    made = measured(wall.nets, complex, grading)
    assert made.max_wall_error < WALL_PER_TOLERANCE * 1e-4
    assert made.max_deviation < 1e-4 * grading.cell_size
    assert wall.volume() == pytest.approx(exact_measures(complex, grading).volume, rel=1e-5)


def test_the_first_specimen_comes_to_two_thirds_of_its_limit_at_its_far_corner() -> None:
    _, complex, _ = parts("thickness")
    centres = placed_corners(complex.placements).mean(axis=1)[complex.patch_placement] / CELL_QUARTERS
    x, y, _ = BC_PER_CELL * (centres + complex.patch_cell).T
    max_thickness = int(np.argmax(thickness_of(x, y)))
    doubled = Lattice.paper((3, 3, 1), f"2*({THICKNESS})").grading()
    with pytest.raises(SelfIntersectionError) as caught:
        require_simple(complex, doubled)
    limit, place = caught.value.limit, caught.value.place
    # A little off the patch's centre, where the surface is a little flatter and the wall a little thicker.
    assert BC_PER_CELL * TUBE.thickness_limit <= limit <= 1.001 * BC_PER_CELL * TUBE.thickness_limit
    assert (place[0], place[1]) == pytest.approx((x[max_thickness], y[max_thickness]), abs=0.05)
    assert thickness_of(x, y).max() / limit == pytest.approx(2 / 3, abs=0.02)


def test_the_thickness_factor_is_the_whole_wall() -> None:
    # Read as the half it would pass the limit.
    max_thickness = parts("thickness")[2].requested(np.array([[6.0, 5.5, 0.75]]))[0]
    assert max_thickness < BC_PER_CELL * TUBE.thickness_limit < 2 * max_thickness

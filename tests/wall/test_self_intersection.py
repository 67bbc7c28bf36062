"""Whether a graded wall can exist: where it folds, where it meets another, and what would pass."""

from __future__ import annotations

import pickle
import re
from collections.abc import Callable, Iterator
from math import pi, sqrt
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyroid_cad.errors import SelfIntersectionError
from gyroid_cad.fields.field import Field, as_field
from gyroid_cad.maps.block import parse_map
from gyroid_cad.maps.space import SpaceMap
from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.symmetry import CELL_QUARTERS, placed_corners
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.exact import offset_patches
from gyroid_cad.wall.grading import THINNEST_WALL, Grading
from gyroid_cad.wall.offset import Wall
from gyroid_cad.wall.refit import graded_wall
from gyroid_cad.wall.self_intersection import require_simple, require_simple_fit

TUBE = USUAL.tube

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]
Graded = Callable[[float], Grading]

L = 10.0
ONE: Cells = (1, 1, 1)
RING: Cells = (4, 1, 1)
# A wall that grows to 8.5 mm on the threefold axis through a flat point.
BUMP = "0.5 + 8*exp(-((x-5)**2+(y-5)**2+(z-5)**2)/1.5)"


def field(text: str) -> float | Field:
    return as_field("thickness", text, "")


def affine(matrix: Any, shift: Any = (0, 0, 0)) -> SpaceMap:
    turn = np.array(matrix, dtype=float)
    return SpaceMap(lambda x, y, z: turn @ np.stack([x, y, z]) + np.array(shift)[:, np.newaxis])


def turns(count: float, radius: float, length: float) -> SpaceMap:
    """A block wound round the z axis so many times, through itself past one."""
    rate = 2 * pi * count / length
    return SpaceMap(lambda x, y, z: ((radius + z) * np.cos(rate * x), (radius + z) * np.sin(rate * x), y))


def mapped(spelling: str, cells: Cells = ONE) -> SpaceMap:
    return parse_map(spelling).over((cells[0] * L, cells[1] * L, cells[2] * L))


def graded(text: str, parameter: str = "thickness", **varied: Any) -> Graded:
    """The grading with a field taken so many times."""
    return lambda factor: Grading(L, **{parameter: field(f"{factor!r}*({text})")}, **varied)


def refusal(grading: Grading, cells: Cells = ONE) -> SelfIntersectionError | None:
    try:
        require_simple(build_complex(cells, closed=grading.closed), grading)
    except SelfIntersectionError as error:
        return error
    return None


def refused(grading: Grading, cells: Cells = ONE) -> SelfIntersectionError:
    error = refusal(grading, cells)
    assert error is not None
    return error


def patch_centres(cells: Cells) -> Floats:
    complex = build_complex(cells)
    centres = placed_corners(complex.placements).mean(axis=1) / CELL_QUARTERS
    return np.asarray((centres[complex.patch_placement] + complex.patch_cell) * L)


def test_a_uniform_field_is_limited_as_the_uniform_wall_at_a_patch_centre() -> None:
    error = refused(Grading(L, field("4 + 0*x")), (2, 1, 1))
    assert error.limit == pytest.approx(TUBE.thickness_limit * L, rel=1e-6)
    assert error.value == 4
    assert np.linalg.norm(patch_centres((2, 1, 1)) - error.place, axis=1).min() < 1e-9
    assert (error.parameter, error.accepted, error.unit) == ("thickness", "below", " mm")
    assert "where the wall folds over its own curvature" in str(error)


@pytest.mark.parametrize("parameter", ["thickness", "density"])
def test_refusals_can_be_sent_between_processes(parameter: str) -> None:
    error = refused(graded("0.9", parameter, map=mapped("cylinder:radius=10"))(4 if parameter == "thickness" else 1))
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert vars(again) == vars(error)


@settings(max_examples=10)
@given(st.floats(0.05, 20), st.tuples(*3 * [st.floats(-180, 180)]))
def test_the_limit_scales_with_space_and_not_with_motions(scale: float, angles: Any) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    for varied in ({"scale_field": scale}, {"map": affine(scale * turn, (3, -40, 7))}):
        error = refused(Grading(L, 4 * scale, **varied))
        assert error.limit == pytest.approx(scale * TUBE.thickness_limit * L, rel=1e-6)


LIMITED: dict[str, tuple[Graded, Cells]] = {
    "uniform": (graded("4"), ONE),
    "slope": (graded("2 + 0.3*x"), (2, 1, 1)),
    "waves": (graded("4 + 1.5*sin(x/2)*cos(y/3)"), ONE),
    "scale": (graded("4", scale_field=field("1 + 0.05*x")), ONE),
    "squeezed": (graded("1 + 0.05*x", map=affine(np.diag([1, 1, 0.15]))), ONE),
    "stretched": (graded("4", map=affine(np.diag([1, 1, 3]))), ONE),
    "sheared": (graded("4", map=affine([[1, 0.7, 0], [0, 1, -0.4], [0.3, 0, 1]])), ONE),
    "cylinder": (graded("4", map=mapped("cylinder:radius=10")), ONE),
    "sphere": (graded("4", map=mapped("sphere:radius=20")), ONE),
    "twist": (graded("4", map=mapped("twist:angle=90")), ONE),
    "ring": (graded("4 + sin(2*pi*x/40)", map=mapped("cylinder:radius=7,angle=360", RING)), RING),
    "density": (graded("0.9", "density", map=mapped("twist:angle=60")), ONE),
    "dense slope": (graded("0.6 + 0.03*(x - 5)", "density", map=mapped("cylinder:radius=6")), ONE),
    "flat point": (graded(BUMP), ONE),
    "slit": (graded("0.8", map=mapped("cylinder:radius=6.4", RING)), RING),
    # Here it would fold too, a little later.
    "flat point, broad": (graded("1 + 8*exp(-((x-5)**2+(y-5)**2+(z-5)**2)/4)"), ONE),
}


@pytest.mark.parametrize(("made", "cells"), [pytest.param(*LIMITED[name], id=name) for name in LIMITED])
def test_the_limit_is_the_largest_value_that_would_pass(made: Graded, cells: Cells) -> None:
    error = refused(made(1.0), cells)
    ratio = error.limit / error.value
    assert 0 < ratio < 1
    assert refusal(made(ratio * (1 - 1e-3)), cells) is None
    assert refusal(made(ratio * (1 + 1e-2)), cells) is not None


@pytest.mark.parametrize(
    ("made", "cells", "factor"),
    [
        pytest.param(*LIMITED["slope"], 3, id="slope"),
        pytest.param(*LIMITED["cylinder"], 3, id="cylinder"),
        pytest.param(*LIMITED["flat point"], 1.03, id="flat point"),
        pytest.param(*LIMITED["flat point"], 1.1, id="flat point, thicker"),
    ],
)
def test_the_limit_does_not_depend_on_how_far_it_is_passed(made: Graded, cells: Cells, factor: float) -> None:
    once, more = (refused(made(f), cells) for f in (1.0, factor))
    assert more.limit == pytest.approx(once.limit, rel=1e-6)
    assert more.place == pytest.approx(once.place)


def test_a_wall_that_passes_through_the_next_is_refused() -> None:
    assert refusal(graded(BUMP)(1.2)) is not None


def pores(side: int) -> Iterator[tuple[Floats, float]]:
    """Flat points of one cell with the next wall on one side of the wall only: where, and how far away that is."""
    complex = build_complex(ONE)
    ((_, fitted),) = offset_patches(complex, Grading(L, 1.0), np.array([-1.0, 1]))
    for point, normal in zip(fitted.points, fitted.normals, strict=True):
        # Flat points lie sqrt(3) L / 4 apart on their threefold axes, the wall across them.
        ahead, behind = (point + sign * sqrt(3) * L / 4 * normal for sign in (side, -side))
        if all((np.abs(fitted.points - p).max(axis=1) < 1e-9).any() == there for p, there in ((ahead, 1), (behind, 0))):
            yield point, sqrt(3) * L / 4


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("closed", [False, True])
def test_a_wall_that_grows_on_a_threefold_axis_is_limited_by_the_next_along_it(side: int, closed: bool) -> None:
    # Closed all round, so few patches are neighbours of nearly all others.
    complex = build_complex(ONE, closed=(closed,) * 3)
    for point, pore in list(pores(side))[::4]:
        x, y, z = point.tolist()
        bump = f"0.5 + 8*exp(-((x-{x})**2+(y-{y})**2+(z-{z})**2)/1.5)"
        halves = [0.25 + 4 * np.exp(-(distance**2) / 1.5) for distance in (0, pore)]
        with pytest.raises(SelfIntersectionError, match="where the wall meets the one opposite") as caught:
            require_simple(complex, graded(bump)(1.0))
        assert caught.value.place == pytest.approx((x, y, z))
        assert caught.value.limit / caught.value.value == pytest.approx(pore / sum(halves), rel=1e-9)


@pytest.mark.parametrize(("count", "thickness"), [(1.05, 0.8), (1.3, 0.6), (1.5, 0.8), (2.03, 0.4), (2.0, 0.5)])
def test_a_block_wound_through_itself_is_refused(count: float, thickness: float) -> None:
    error = refused(Grading(L, thickness, map=turns(count, 40 * count / 6.3, 40)), RING)
    assert re.search("meets the one opposite|sheets through each other", str(error))


@pytest.mark.parametrize(
    ("varied", "cells", "thickness"),
    [
        pytest.param({"map": turns(1.3, 8.3, 40)}, RING, 0.1, id="wound"),
        pytest.param({"map": turns(1.05, 6.7, 40)}, RING, 0.1, id="wound a little"),
        pytest.param({"map": mapped("cylinder:radius=8,angle=360", RING), "scale_field": 1.1}, RING, 0.1, id="long"),
        pytest.param({"map": turns(1.05, 63 / 2 / pi, 60)}, (6, 1, 1), 0.05, id="thinner"),
    ],
)
def test_a_thin_wall_wound_through_itself_is_refused(varied: dict[str, Any], cells: Cells, thickness: float) -> None:
    assert refusal(Grading(L, thickness, **varied), cells) is not None


def test_where_mid_surfaces_cross_no_thickness_is_said_to_pass() -> None:
    made = graded("0.5", map=turns(1.3, 8.3, 40))
    error = refused(made(1.0), RING)
    assert error.limit < THINNEST_WALL or refusal(made(error.limit / error.value * (1 - 1e-3)), RING) is not None


@pytest.mark.parametrize("squeeze", [0.3, 0.15, 0.05, 0.02])
def test_a_thin_wall_stays_clear_of_itself_under_affine_maps(squeeze: float) -> None:
    for axis in range(3):
        stretched = np.ones(3)
        stretched[axis] = squeeze
        assert refusal(Grading(L, 1e-3 * squeeze * L, map=affine(np.diag(stretched)))) is None


@pytest.mark.parametrize("gap", [4.0, 2.0, 0.8])
def test_a_ring_with_a_slit_wider_than_its_wall_is_sound(gap: float) -> None:
    # Its ends, once joined, are moved apart along the circumference.
    assert refusal(Grading(L, 0.1, map=mapped(f"cylinder:radius={(4 * L + gap) / 2 / pi}", RING)), RING) is None


def test_a_ring_is_sound_joined_and_refused_where_its_ends_only_touch() -> None:
    ring = mapped("cylinder:radius=8,angle=360", RING)
    assert refusal(Grading(L, 0.8, map=ring), RING) is None
    unjoined = SpaceMap(ring.function, ring.jacobian)
    assert "opposite" in str(refused(Grading(L, 0.8, map=unjoined), RING))


@pytest.mark.parametrize("cells", [(2, 1, 1), RING])
def test_short_rings_are_not_taken_to_meet_themselves(cells: Cells) -> None:
    # Round two cells nearly every patch is a neighbour of every other.
    assert refusal(Grading(L, 0.8, map=mapped("cylinder:radius=7,angle=360", cells)), cells) is None


def least_area(wall: Wall, count: int = 121) -> float:
    """Least area of the faces along the wall, relative to the mid-surface's; negative where they fold over."""
    samples, knots, least = np.linspace(-1, 1, count), (wall.knots, wall.knots), np.inf
    for net in wall.nets:
        half, _, _ = grid_derivatives((net[1] - net[0]) / 2, wall.weights, knots, samples, samples)
        areas = [
            np.cross(*grid_derivatives(n, wall.weights, knots, samples, samples)[1:]) for n in (*net, sum(net) / 2)
        ]
        through = [np.einsum("uvc,uvc->uv", area, half) for area in areas]
        least = min(least, *(float((face / through[2]).min()) for face in through[:2]))
    return least


@pytest.mark.parametrize("part", [0.94, 0.995])
@pytest.mark.parametrize("spelling", ["cylinder:radius=10", "twist:angle=90", "bend:angle=50"])
def test_a_wall_that_passes_does_not_fold_anywhere(spelling: str, part: float) -> None:
    space = mapped(spelling)
    thickness = part * refused(Grading(L, 4.0, map=space)).limit
    grading = Grading(L, thickness, map=space)
    assert refusal(grading) is None
    wall = graded_wall(build_complex(ONE), grading, 16)
    require_simple_fit(wall, grading)
    assert least_area(wall) > 0


def test_what_folds_is_seen_to_fold() -> None:
    grading = Grading(L, 1.02 * TUBE.thickness_limit * L)
    assert least_area(graded_wall(build_complex(ONE), grading, 16)) < 0


@pytest.mark.parametrize("parameter", ["thickness", "density"])
def test_a_fit_that_folds_before_the_exact_wall_is_refused_with_its_own_limit(parameter: str) -> None:
    complex, made = build_complex(ONE), graded("1.0", parameter)
    error = refused(made(4 if parameter == "thickness" else 0.95))
    sound = made(error.limit * (1 - 1e-4))
    assert refusal(sound) is None
    with pytest.raises(SelfIntersectionError, match="where the fit with 8 control points a side folds over") as caught:
        require_simple_fit(graded_wall(complex, sound, 8), sound)
    assert caught.value.parameter == parameter
    assert caught.value.limit < error.limit
    passing, failing = (made(caught.value.limit * factor) for factor in (1 - 1e-6, 1 + 1e-6))
    require_simple_fit(graded_wall(complex, passing, 8), passing)
    with pytest.raises(SelfIntersectionError):
        require_simple_fit(graded_wall(complex, failing, 8), failing)

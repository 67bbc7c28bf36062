"""Which patches a part needs, and which its boundary crosses."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.covering import CROSSING, INSIDE, OUTSIDE, SIDE_SAMPLES, Frame, covering_complex, patch_sides
from gyroid_cad.wall.exact import patch_points_and_normals

Floats = NDArray[np.float64]

L = 6.0
REACH = 0.3
STRAIGHT = Frame(np.zeros(3), np.eye(3))
DENSE = np.linspace(-1, 1, 25)

angles = st.tuples(*3 * [st.floats(-180, 180)])
places = st.tuples(*3 * [st.floats(-50, 50)])


def frame_of(turn: tuple[float, float, float], origin: tuple[float, float, float]) -> Frame:
    return Frame(np.array(origin), Rotation.from_euler("xyz", turn, degrees=True).as_matrix())


def ball(centre: Floats, radius: float) -> tuple[Callable[[Floats], Floats], Callable[[Floats], NDArray[np.bool_]]]:
    def distance(points: Floats) -> Floats:
        return np.abs(np.linalg.norm(points - centre, axis=-1) - radius)

    return distance, lambda points: np.linalg.norm(points - centre, axis=-1) < radius


def sampled(complex: CellComplex, frame: Frame, samples: Floats | None = None) -> Floats:
    along = np.linspace(-1, 1, SIDE_SAMPLES) if samples is None else samples
    return frame.placed(patch_points_and_normals(complex, L, along)[0])


def ids(complex: CellComplex) -> set[tuple[int, ...]]:
    return set(map(tuple, np.column_stack([complex.patch_placement, complex.patch_cell]).tolist()))


@given(angles, places)
def test_a_frame_takes_points_to_its_own_space_and_back(turn: tuple[float, ...], origin: tuple[float, ...]) -> None:
    frame, points = frame_of(turn, origin), np.random.default_rng(0).uniform(-30, 30, (9, 3))  # type: ignore[arg-type]
    np.testing.assert_allclose(frame.placed(frame.own(points)), points, rtol=0, atol=1e-12)


@settings(max_examples=10)
@given(angles, places)
def test_no_patch_that_comes_within_reach_of_the_box_is_missing(
    turn: tuple[float, float, float], origin: tuple[float, float, float]
) -> None:
    frame, low, high = frame_of(turn, origin), np.array([-3.0, 1.0, 2.0]), np.array([4.0, 7.0, 5.0])
    made = covering_complex(low, high, frame, L, REACH)
    middle = np.round(frame.own((low + high) / 2) / L).astype(int)
    block = build_complex((8, 8, 8), first=tuple((middle - 4).tolist()))
    points = sampled(block, frame, DENSE[::3])
    outside = np.maximum(np.maximum(low - points, points - high), 0)
    within = np.linalg.norm(outside, axis=-1).min(axis=1) <= REACH
    block_ids = np.column_stack([block.patch_placement, block.patch_cell])
    assert set(map(tuple, block_ids[within].tolist())) <= ids(made)


def test_few_patches_are_there_in_vain() -> None:
    low, high = np.zeros(3), np.full(3, 5 * L)
    made = covering_complex(low, high, STRAIGHT, L, REACH)
    assert 24 * 5**3 < made.patch_count < 24 * 6.5**3


@settings(max_examples=15)
@given(angles, st.floats(0.5, 12), st.tuples(*3 * [st.floats(-3, 3)]))
def test_what_lies_inside_a_ball_or_outside_is_told_from_what_it_crosses(
    turn: tuple[float, float, float], radius: float, centre: tuple[float, float, float]
) -> None:
    frame, middle = frame_of(turn, (1.0, 2.0, 3.0)), np.array(centre)
    complex = covering_complex(middle - radius, middle + radius, frame, L, REACH)
    sides = patch_sides(complex, sampled(complex, frame), REACH, *ball(middle, radius))
    from_centre = np.linalg.norm(sampled(complex, frame, DENSE) - middle, axis=-1)
    assert np.all(from_centre[sides == INSIDE] < radius - REACH)
    assert np.all(from_centre[sides == OUTSIDE] > radius + REACH)
    assert np.all(sides[(from_centre.min(axis=1) < radius) & (from_centre.max(axis=1) > radius)] == CROSSING)


def test_patches_well_inside_need_no_cutting() -> None:
    middle, radius = np.zeros(3), 2 * L
    complex = covering_complex(middle - radius, middle + radius, STRAIGHT, L, REACH)
    sides = patch_sides(complex, sampled(complex, STRAIGHT), REACH, *ball(middle, radius))
    farthest = np.linalg.norm(sampled(complex, STRAIGHT, DENSE), axis=-1).max(axis=1)
    assert np.all(sides[farthest < radius - REACH - L / 6] == INSIDE)


@pytest.mark.parametrize("inside", [True, False])
def test_where_the_boundary_is_far_one_point_tells_of_all(inside: bool) -> None:
    complex = build_complex((2, 2, 2))
    requested: list[int] = []

    def contains(points: Floats) -> NDArray[np.bool_]:
        requested.append(len(points))
        return np.full(len(points), inside)

    sides = patch_sides(complex, sampled(complex, STRAIGHT), REACH, lambda points: np.full(len(points), 1e3), contains)
    assert np.all(sides == (INSIDE if inside else OUTSIDE))
    assert requested == [complex.component_count]

"""Walls cut to boxes: what is left closes, and has the volume that the lattice has there."""

from __future__ import annotations

from collections import Counter
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyroid_cad.errors import KernelError
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, FittedPatch, fit_patch
from gyroid_cad.trim.box import Box, TrimmedWall, cut_to_box
from gyroid_cad.trim.caps import Cap
from gyroid_cad.trim.edge_crossings import PLANES
from gyroid_cad.wall.covering import AT_HOME, Frame, covering_complex, periodic_offsets
from gyroid_cad.wall.offset import build_wall

Floats = NDArray[np.float64]

L = 10.0
SHEET, ABOVE, BELOW = [(0, True), (1, False)], [(1, True)], [(0, False)]

places = st.tuples(*3 * [st.floats(-L, L)]).map(np.array)
extents = st.tuples(*3 * [st.floats(0.08 * L, 0.55 * L)]).map(np.array)
walls = st.floats(0.02, 0.3).map(lambda part: part * L)
turns = st.tuples(*3 * [st.floats(-180, 180)])


@lru_cache(maxsize=2)
def patch(control_points: int = 6) -> FittedPatch:
    return fit_patch(FitSettings(control_points))


def cut(
    low: Floats, extent: Floats, thickness: float, sides: list[tuple[int, bool]], frame: Frame = AT_HOME, fine: int = 6
) -> TrimmedWall:
    high = low + extent
    complex = covering_complex(low, high, frame, L, thickness / 2)
    wall = build_wall(complex, patch(fine), L, thickness).moved(frame.rotation, frame.origin)
    offset = float(periodic_offsets(frame, L, low[np.newaxis])[0])
    filled = {0: abs(offset) < thickness / 2, 1: offset > thickness / 2, 2: offset < -thickness / 2}
    return cut_to_box(wall, Box(np.eye(3), low, high), sides, L, filled[[SHEET, ABOVE, BELOW].index(sides)])


def volume(*arguments: object, **more: object) -> float:
    try:
        return float(cut(*arguments, **more).volumes.sum())  # type: ignore[arg-type]
    except KernelError:
        # A face that touches the box; were it the rule, hypothesis would say so.
        reject()


def uses_of(made: TrimmedWall) -> Counter[tuple[int, bool]]:
    """How often each edge is used either way, seen from outside what is left."""
    loops = [(loop, face.backwards) for face in made.faces for loop in face.loops]
    loops += [(loop, False) for cap in made.caps for loop in cap.loops]
    return Counter((edge, forward != backwards) for loop, backwards in loops for edge, forward in loop)


@settings(max_examples=4)
@given(places, extents, walls, turns)
def test_the_wall_and_the_labyrinths_beside_it_are_the_whole_box(
    low: Floats, extent: Floats, thickness: float, turn: tuple[float, float, float]
) -> None:
    frame = Frame(np.array([1.0, -2.0, 3.0]), Rotation.from_euler("xyz", turn, degrees=True).as_matrix())
    parts = [volume(low, extent, thickness, sides, frame) for sides in (SHEET, ABOVE, BELOW)]
    assert sum(parts) == pytest.approx(float(np.prod(extent)), rel=1e-6)
    assert min(parts) >= 0


@settings(max_examples=3)
@given(places, extents, walls, st.integers(0, 2), st.floats(0.2, 0.8))
def test_a_box_cut_in_two_holds_what_both_halves_hold(
    low: Floats, extent: Floats, thickness: float, axis: int, part: float
) -> None:
    first, second, shift = extent.copy(), extent.copy(), np.zeros(3)
    first[axis], shift[axis], second[axis] = part * extent[axis], part * extent[axis], (1 - part) * extent[axis]
    whole = volume(low, extent, thickness, SHEET)
    halves = volume(low, first, thickness, SHEET), volume(low + shift, second, thickness, SHEET)
    assert sum(halves) == pytest.approx(whole, abs=1e-6 * float(np.prod(extent)))


@settings(max_examples=3)
@given(places, extents, walls, st.tuples(*3 * [st.integers(-3, 3)]))
def test_a_period_further_on_all_is_the_same(
    low: Floats, extent: Floats, thickness: float, cells: tuple[int, int, int]
) -> None:
    here, there = (volume(some, extent, thickness, SHEET) for some in (low, low + L * np.array(cells)))
    assert there == pytest.approx(here, rel=1e-9)


@settings(max_examples=4)
@given(places, extents, walls)
def test_every_edge_is_used_once_each_way_and_ends_where_its_neighbours_begin(
    low: Floats, extent: Floats, thickness: float
) -> None:
    try:
        made = cut(low, extent, thickness, SHEET)
    except KernelError:
        reject()
    uses = uses_of(made)
    assert set(uses.values()) <= {1}
    assert all((edge, not forward) in uses for edge, forward in uses)
    assert {edge for edge, _ in uses} == set(range(len(made.edges)))
    loops = [loop for face in made.faces for loop in face.loops] + [loop for cap in made.caps for loop in cap.loops]
    for loop in loops:
        ends = [(made.edges[e].start, made.edges[e].end)[:: 1 if forward else -1] for e, forward in loop]
        assert [end for _, end in ends] == [start for start, _ in (*ends[1:], ends[0])]
    # Euler: of closed surfaces, each with its handles, an even number no more than twice as many as there are.
    holes = sum(len(loops) - 1 for loops in [face.loops for face in made.faces] + [cap.loops for cap in made.caps])
    euler = len(made.points) - len(made.edges) + len(made.faces) + len(made.caps) - holes
    assert euler % 2 == 0
    assert euler <= 2 * len(made.volumes)
    points = np.array(made.points).reshape(-1, 3)
    assert np.all(points > low - 1e-6 * L)
    assert np.all(points < low + extent + 1e-6 * L)


def caps_on(made: TrimmedWall, plane: int) -> list[Cap]:
    return [cap for cap in made.caps if cap.plane == plane]


@settings(max_examples=3)
@given(places, extents, walls)
def test_caps_cover_what_points_on_the_boxs_sides_say(low: Floats, extent: Floats, thickness: float) -> None:
    try:
        made = cut(low, extent, thickness, SHEET, fine=10)
    except KernelError:
        reject()
    s = (np.arange(50) + 0.5) / 50
    for plane, (axis, sign) in enumerate(PLANES):
        u, v = np.meshgrid(s, s, indexing="ij")
        part = np.insert(np.stack([u.ravel(), v.ravel()], axis=1), axis, 0.0 if sign > 0 else 1.0, axis=1)
        offsets = periodic_offsets(AT_HOME, L, low + part * extent)
        side = float(np.prod(np.delete(extent, axis)))
        share = np.mean(np.abs(offsets) < thickness / 2)
        assert sum(cap.area for cap in caps_on(made, plane)) == pytest.approx(share * side, abs=0.03 * side)
    assert all(cap.area > 0 for cap in made.caps)


@settings(max_examples=2)
@given(places, walls)
def test_a_box_of_whole_cells_is_as_dense_as_the_tube_formula_says_wherever_it_begins(
    low: Floats, thickness: float
) -> None:
    assert volume(low, np.array([L, L, L]), thickness, SHEET, fine=10) == pytest.approx(
        USUAL.tube.density(thickness / L) * L**3, rel=1e-5
    )


@settings(max_examples=4)
@given(
    st.tuples(*3 * [st.integers(-8, 8)]),
    st.tuples(*3 * [st.integers(1, 4)]),
    st.sampled_from([0.0, 1e-13, 1e-10, -1e-8, 1e-6, -1e-5, 1e-4, 1e-3]),
    st.sampled_from([L / 4, L / 8, 0.1 * L, 0.05 * L]),
)
def test_boxes_through_corners_and_saddles_are_right_or_refused(
    eighths: tuple[int, int, int], size: tuple[int, int, int], off: float, thickness: float
) -> None:
    low, extent = np.array(eighths) * L / 8 + off * L, np.array(size) * L / 8
    parts = []
    for sides in (SHEET, ABOVE, BELOW):
        try:
            parts.append(float(cut(low, extent, thickness, sides).volumes.sum()))
        except KernelError:
            return
    assert sum(parts) == pytest.approx(float(np.prod(extent)), rel=1e-6)


@pytest.mark.parametrize("sides", [SHEET, ABOVE, BELOW])
def test_a_box_that_no_face_meets_is_full_or_empty(sides: list[tuple[int, bool]]) -> None:
    # On the mid-surface, and furthest off it to one side and to the other.
    thickness = 0.3 * L
    spots = np.random.default_rng(0).uniform(0, L, (4000, 3))
    offsets = periodic_offsets(AT_HOME, L, spots)
    extent = np.full(3, 0.01 * L)
    for wanted, deep in (
        (SHEET, np.argmin(np.abs(offsets))),
        (ABOVE, np.argmax(offsets)),
        (BELOW, np.argmin(offsets)),
    ):
        made = cut(spots[deep] - extent / 2, extent, thickness, sides)
        full = wanted == sides
        assert made.volumes.tolist() == pytest.approx([float(np.prod(extent))] if full else [])
        assert len(made.caps) == (6 if full else 0)
        assert made.faces == []


@settings(max_examples=4)
@given(places, st.floats(0.005, 0.03), walls)
def test_boxes_smaller_than_a_patch_are_cut_as_large_ones_are(low: Floats, side: float, thickness: float) -> None:
    extent = np.full(3, side * L)
    # What no face meets is decided by one corner's distance from samples of the surface.
    offset = abs(float(periodic_offsets(AT_HOME, L, low[np.newaxis])[0]))
    assume(abs(offset - thickness / 2) > 2e-3 * L)
    parts = [volume(low, extent, thickness, sides) for sides in (SHEET, ABOVE, BELOW)]
    assert sum(parts) == pytest.approx(float(np.prod(extent)), rel=1e-4)


def test_faces_alike_are_cut_once_however_many_there_are() -> None:
    low = np.array([0.31, 0.17, 0.43]) * L
    made = [cut(low, np.array([n, n, 1]) * L, 0.8, SHEET) for n in (2, 3)]
    (few, many), volumes = (one.distinct for one in made), [float(one.volumes.sum()) for one in made]
    assert many == few
    assert volumes[1] == pytest.approx(9 / 4 * volumes[0], rel=1e-6)


def test_without_caps_the_wall_keeps_its_border() -> None:
    low, extent, thickness = np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 3.0]), 0.8
    wall = build_wall(covering_complex(low, low + extent, AT_HOME, L, thickness / 2), patch(), L, thickness)
    box = Box(np.eye(3), low, low + extent)
    bare = cut_to_box(wall, box, [(1, False)], L, False, capped=False)
    assert (bare.caps, bare.capped) == ([], False)
    closed = cut(low, extent, thickness, ABOVE)
    assert bare.areas.sum() == pytest.approx(closed.areas.sum() - sum(cap.area for cap in closed.caps))


def test_a_box_knows_its_volume_and_its_sides_levels() -> None:
    box = Box(np.eye(3), np.array([1.0, 2, 3]), np.array([2.0, 4, 8]))
    assert box.volume == 10
    assert box.levels.tolist() == [1, 2, 2, 4, 3, 8]

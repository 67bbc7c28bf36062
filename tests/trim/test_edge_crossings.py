"""Where sides of faces cross planes."""

from __future__ import annotations

from contextlib import suppress
from functools import lru_cache

import numpy as np
import pytest
from conftest import Graph
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.trim.edge_crossings import AXES, PLANES, FacesToCut, edge_crossings, square_points
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import Wall, build_wall

Floats = NDArray[np.float64]

L = 10.0
# Far from every corner and saddle of the lattice, for all axes alike.
levels = st.floats(0.02, 0.98).map(lambda part: part * L / 8)


@lru_cache(maxsize=2)
def wall(rational: bool) -> Wall:
    weights = np.ones((6, 6))
    weights[2:4, 2:4] = 1.5
    fit = FitSettings(6, weights=tuple(map(tuple, weights.tolist()))) if rational else FitSettings(6)
    return build_wall(build_complex((1, 1, 1)), fit_patch(fit), L, 0.8)


def cell_faces(level: float, side: int, rational: bool = False) -> FacesToCut:
    """One cell's faces on one side, and planes of one level along x, y, z to keep above."""
    made = wall(rational)
    nets = made.nets[made.patch_net, side] + made.shifts[made.patch_shift][:, np.newaxis, np.newaxis]
    near = np.full((len(nets), len(PLANES)), np.nan)
    for plane, (axis, sign) in enumerate(PLANES):
        crossed = (nets[..., axis].min(axis=(1, 2)) < level) & (nets[..., axis].max(axis=(1, 2)) > level)
        near[crossed & (sign > 0), plane] = level
    return FacesToCut(nets, made.weights, made.knots, near)


@settings(max_examples=15)
@given(levels, st.sampled_from([0, 1]), st.booleans())
def test_crossings_lie_in_their_planes_and_both_faces_that_share_a_side_find_them(
    level: float, side: int, rational: bool
) -> None:
    faces = cell_faces(level, side, rational)
    crossings = edge_crossings(faces)
    points = faces.points(crossings.face, *(x[:, np.newaxis] for x in square_points(crossings.side, crossings.along)))[
        :, 0
    ]
    assert points[np.arange(len(points)), AXES[crossings.plane]] == pytest.approx(
        np.full(len(points), level), abs=1e-12
    )
    complex = wall(rational).complex
    edges = complex.patch_edges[crossings.face, crossings.side]
    for edge in np.flatnonzero(~complex.free):
        on_edge = edges == edge
        first, second = (points[on_edge & (crossings.face == face)] for face in complex.edge_patches[edge])
        assert len(first) == len(second)
        # The two run along it in opposite ways, or alike.
        assert min(np.abs(first - second).max(initial=0), np.abs(first - second[::-1]).max(initial=0)) < 1e-9 * L


@settings(max_examples=15)
@given(levels, st.sampled_from([0, 1]))
def test_curves_enter_a_face_as_often_as_they_leave_and_in_turn(level: float, side: int) -> None:
    faces = cell_faces(level, side)
    crossings = edge_crossings(faces)
    for face in range(len(faces)):
        for plane in range(len(PLANES)):
            entering = crossings.entering[(crossings.face == face) & (crossings.plane == plane)]
            assert np.all(entering != np.roll(entering, 1))


@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("middle", [-0.999, -0.1, 0.0, 0.1, 0.999])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_side_that_dips_through_a_plane_crosses_it_twice_however_little(
    graph: Graph, depth: float, middle: float, sign: int
) -> None:
    faces = graph(lambda x, y: sign * ((x - middle) ** 2 + y), {4 if sign > 0 else 5: sign * (depth - 1)})
    crossings = edge_crossings(faces)
    ends = [middle - np.sqrt(depth), middle + np.sqrt(depth)]
    assert crossings.along[crossings.side == 0] == pytest.approx([end for end in ends if abs(end) < 1], abs=1e-7)


@pytest.mark.parametrize("clear", [1e-3, 1e-5, 1e-9])
def test_a_side_that_stays_clear_of_a_plane_does_not_cross_it(graph: Graph, clear: float) -> None:
    assert len(edge_crossings(graph(lambda x, y: (x - 0.1) ** 2 + y, {4: -1 - clear})).face) == 0


@pytest.mark.parametrize(
    ("slopes", "level"), [((1.0, 1.0), 2.0), ((1.0, 1.0), -2.0), ((1.0, 0.5), 0.5)], ids=["top", "bottom", "one corner"]
)
def test_a_plane_through_a_corner_is_refused_or_missed_by_all(
    graph: Graph, slopes: tuple[float, float], level: float
) -> None:
    faces = graph(lambda x, y: slopes[0] * x + slopes[1] * y, {4: level})
    try:
        crossings = edge_crossings(faces)
    except KernelError:
        return
    # Without the very corner: an even number of crossings, none at the corner itself.
    assert len(crossings.face) % 2 == 0
    assert np.all(np.abs(crossings.along) < 1)


def test_a_side_in_a_plane_is_refused_or_not_crossed(graph: Graph) -> None:
    with suppress(KernelError):
        assert len(edge_crossings(graph(lambda x, y: 1 + y, {4: 0.0})).face) == 0


def test_faces_far_from_all_planes_cross_none(graph: Graph) -> None:
    assert len(edge_crossings(graph(lambda x, y: x * y, {})).face) == 0

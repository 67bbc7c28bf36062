"""Curves in which faces cross planes: where they are, which way they run, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Graph, Height
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from gyroid_cad.errors import KernelError
from gyroid_cad.trim.edge_crossings import FacesToCut, edge_crossings, plane_heights
from gyroid_cad.trim.section_splines import section_knots
from gyroid_cad.trim.sections import Sections, plane_sections

Floats = NDArray[np.float64]

T = np.linspace(0, 1, 501)
SIZE = 1.0


def sections_of(faces: FacesToCut) -> Sections:
    return plane_sections(faces, edge_crossings(faces), SIZE)


def misses(faces: FacesToCut, sections: Sections, curve: int) -> tuple[Floats, Floats]:
    """How far the curve in the square and the one in space are apart, and the latter from its plane."""
    places, points = sections.in_square(curve, T), sections.in_space(curve, T)
    which = sections.face[[curve]]
    apart = faces.points(which, *places.T[:, np.newaxis])[0] - points
    plane = sections.plane[curve]
    return np.linalg.norm(apart, axis=1), np.abs(points[:, plane // 2] - faces.levels[which[0], plane])


def saddle(x: Floats, y: Floats) -> Floats:
    return 0.3 * (x * x - y * y) + 0.1 * x * y


@settings(max_examples=30)
@given(st.floats(-0.9, 0.9), st.floats(-0.5, 0.5), st.sampled_from([0.0, 0.3]), st.sampled_from([4, 5]))
def test_both_curves_stay_together_and_keep_what_is_wanted_on_their_left(
    graph: Graph, level: float, bend: float, lean: float, plane: int
) -> None:
    def height(x: Floats, y: Floats) -> Floats:
        return y + 0.2 * x + bend * x * x

    faces = graph(height, {plane: level}, lean)
    sections = sections_of(faces)
    assert len(sections) >= 1
    for curve in range(len(sections)):
        apart, off = misses(faces, sections, curve)
        assert apart.max() < 3e-6 * SIZE
        assert off.max() < 1e-12
        # The measure between stations holds elsewhere, but for a small factor.
        assert apart.max() <= 3 * sections.deviation[curve] + 1e-12
        places, rates = sections.in_square(curve, T[::50]), sections.in_square(curve, T[::50], 1)
        left = places + 1e-3 * np.column_stack([-rates[:, 1], rates[:, 0]]) / np.linalg.norm(rates, axis=1)[:, None]
        above = height(*left.T) - level
        assert np.all(above > 0 if plane == 4 else above < 0)


@settings(max_examples=30)
@given(st.floats(-0.9, 0.95))
def test_a_circles_arcs_have_its_radius(graph: Graph, at: float) -> None:
    # Quarter circles round a corner, by the paraboloid over it.
    radius = 1.0 + at
    faces = graph(lambda x, y: (x + 1) ** 2 + (y + 1) ** 2, {5: radius**2})
    sections = sections_of(faces)
    assert len(sections) == 1
    from_corner = np.linalg.norm(sections.in_space(0, T)[:, :2] + 1, axis=1)
    assert from_corner == pytest.approx(np.full(len(T), radius), abs=3e-6)


def test_the_same_place_has_the_same_curve_however_many_faces_are_cut_with_it(graph: Graph) -> None:
    one = graph(saddle, {4: 0.05, 0: 0.3})
    many = FacesToCut(np.repeat(one.nets, 3, axis=0), one.weights, one.knots, np.repeat(one.levels, 3, axis=0))
    alone, together = sections_of(one), sections_of(many)
    assert len(together) == 3 * len(alone)
    for curve in range(len(together)):
        np.testing.assert_allclose(together.points[curve], alone.points[curve % len(alone)], atol=1e-12)


@pytest.mark.parametrize("off", [0.0, *(sign * 10.0**-k for k in (2, 3, 4, 6, 9, 14) for sign in (1, -1))])
@pytest.mark.parametrize("height", [saddle, lambda x, y: 0.5 * x * y], ids=["lopsided", "even"])
def test_next_to_a_saddle_curves_are_right_or_refused(graph: Graph, off: float, height: Height) -> None:
    faces = graph(height, {4: off})
    try:
        sections = sections_of(faces)
    except KernelError:
        # Further off than a shift of the lattice would be, they are to be found.
        assert abs(off) < 0.01
        return
    assert len(sections) == 2
    for curve in range(2):
        apart, out = misses(faces, sections, curve)
        assert apart.max() < 3e-6 * SIZE
        assert out.max() < 1e-12
    # Neither crosses over to the other side of the saddle: each stays on its own side of one asymptote or the other.
    places = [sections.in_square(curve, T) for curve in range(2)]
    assert all(np.max(np.abs(height(*some.T) - off)) < 1e-5 for some in places)


@pytest.mark.parametrize("plane", [4, 5])
@pytest.mark.parametrize("radius", [0.9, 0.5, 0.1])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_curve_that_closes_within_the_face_is_refused(graph: Graph, plane: int, radius: float, sign: int) -> None:
    faces = graph(lambda x, y: sign * ((x - 0.02) ** 2 + (y + 0.03) ** 2), {plane: sign * radius**2})
    with pytest.raises(KernelError, match="bulges through"):
        sections_of(faces)


def test_no_crossings_give_no_curves(graph: Graph) -> None:
    assert len(sections_of(graph(saddle, {4: -2.0, 1: 3.0}))) == 0


@pytest.mark.parametrize("count", [17, 33])
def test_sections_are_splines_on_their_knots(graph: Graph, count: int) -> None:
    control = np.random.default_rng(0).normal(size=(count, 3))
    one = np.zeros(1, dtype=np.int64)
    made = Sections(one, one, one, one, [control[:, :2]], [control], np.zeros(1))
    spline = BSpline(section_knots(count), control, 3)
    np.testing.assert_allclose(made.in_space(0, T[:-1]), spline(T[:-1]), atol=1e-12)
    np.testing.assert_allclose(made.in_space(0, T[:-1], 1), spline(T[:-1], 1), atol=1e-9)
    np.testing.assert_allclose(made.in_square(0, T), made.in_space(0, T)[:, :2], atol=1e-14)


def test_heights_of_pairs_and_of_grids_agree(graph: Graph) -> None:
    faces, one = graph(saddle, {4: 0.1, 3: 0.2}), np.zeros(1, dtype=np.int64)
    for plane in (3, 4):
        grid = plane_heights(faces, one, np.array([plane]), T[np.newaxis], T[np.newaxis, ::-1])
        for k in (0, 100, 500):
            pair = plane_heights(faces, one, np.array([plane]), T[[k]], T[::-1][[k]])
            np.testing.assert_allclose(pair[0], grid[0][:, k], atol=1e-15)
            np.testing.assert_allclose(pair[1], grid[1][:, k], atol=1e-14)

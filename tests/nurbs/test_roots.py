"""Roots of sampled functions, those that hide between samples too; nearest places and lines on a sphere."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.nurbs.roots import line_step, nearest_places, roots

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SAMPLES = np.linspace(-1.1, 1.1, 23)


def found(*functions: Callable[[Floats], Floats]) -> list[list[float]]:
    """Roots of each function in [-1, 1]."""

    def at(which: Integers, x: Floats) -> tuple[Floats, Floats]:
        def values(x: Floats) -> Floats:
            return np.array([functions[k](one) for k, one in zip(which.tolist(), x, strict=True)])

        return values(x), (values(x + 1e-5) - values(x - 1e-5)) / 2e-5

    which, places = roots(SAMPLES, np.array([function(SAMPLES) for function in functions]), at)
    return [places[which == k].tolist() for k in range(len(functions))]


@given(st.floats(-0.999, 0.999), st.floats(1e-5, 0.3), st.floats(-3, 3))
# Where samples see a parabola that bends by a quarter more than the function does between them.
@example(0.75, 1e-5, -3.0)
def test_two_roots_are_found_however_close(middle: float, apart: float, lean: float) -> None:
    ends = [middle - apart / 2, middle + apart / 2]
    # Off every sample, where a root would be told from rounding only.
    if any(np.min(np.abs(SAMPLES - end)) < 1e-6 for end in ends):
        return

    def both_ways(sign: float) -> Callable[[Floats], Floats]:
        return lambda x: sign * (x - ends[0]) * (x - ends[1]) * (4 + lean * x)

    for places in found(both_ways(1), both_ways(-1)):
        assert places == pytest.approx([end for end in ends if abs(end) < 1], abs=1e-8)


@given(st.floats(-1, 1), st.floats(1e-9, 1))
def test_what_turns_back_before_zero_has_no_root(middle: float, above: float) -> None:
    assert found(lambda x: (x - middle) ** 2 + above, lambda x: -((x - middle) ** 2) - above) == [[], []]


def test_newton_thrown_off_by_a_flat_place_comes_back() -> None:
    # Between 0 and 0.1 it all but stops, and Newton's step from there would leave.
    assert found(lambda x: np.tanh(300 * (x - 0.07)))[0] == pytest.approx([0.07], abs=1e-9)


def test_functions_not_near_have_no_roots() -> None:
    assert found(lambda x: np.full_like(x, np.inf), lambda x: x - 0.05) == [[], pytest.approx([0.05])]


def test_no_functions_have_no_roots() -> None:
    which, places = roots(SAMPLES, np.zeros((0, len(SAMPLES))), lambda which, x: (x, x))
    assert len(which) == len(places) == 0


def cap(u: Floats, v: Floats) -> tuple[Floats, ...]:
    """A piece of the unit sphere, by longitude and latitude, with its derivatives."""
    cu, su, cv, sv, zero = np.cos(u), np.sin(u), np.cos(v), np.sin(v), np.zeros_like(u)
    vectors = (
        (cu * cv, su * cv, sv),
        (-su * cv, cu * cv, zero),
        (-cu * sv, -su * sv, cv),
        (-cu * cv, -su * cv, zero),
        (su * sv, -cu * sv, zero),
        (-cu * cv, -su * cv, -sv),
    )
    return tuple(np.stack(parts, axis=-1) for parts in vectors)


@example(u=0.0, v=0.5, radius=1.0, off_u=0.25, off_v=0.0)
@given(st.floats(-0.99, 0.99), st.floats(-0.99, 0.99), st.floats(0.5, 3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_the_nearest_place_of_a_sphere_lies_under_the_point(
    u: float, v: float, radius: float, off_u: float, off_v: float
) -> None:
    point = radius * cap(np.array([u]), np.array([v]))[0]
    start = np.clip([u + off_u, v + off_v], -1, 1)
    found_u, found_v, distance = nearest_places(point, start[:1], start[1:], cap)
    assert distance[0] == pytest.approx(abs(radius - 1), abs=1e-12)
    if abs(radius - 1) > 1e-3:
        assert (found_u[0], found_v[0]) == (pytest.approx(u, abs=1e-6), pytest.approx(v, abs=1e-6))


@given(st.floats(1.1, 1.5), st.floats(-0.9, 0.9))
def test_beyond_the_border_the_nearest_place_is_on_it(u: float, v: float) -> None:
    point = 2 * cap(np.array([u]), np.array([v]))[0]
    found_u, found_v, distance = nearest_places(point, np.array([0.8]), np.array([0.0]), cap)
    along = np.linspace(-1, 1, 20_001)
    border = cap(np.ones_like(along), along)[0]
    distances = np.linalg.norm(border - point, axis=-1)
    assert found_u[0] == 1.0
    assert distance[0] == pytest.approx(distances.min(), abs=1e-8)
    assert found_v[0] == pytest.approx(along[np.argmin(distances)], abs=2e-3)


@given(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.2, 0.9))
def test_a_line_meets_a_sphere_after_a_few_steps_and_a_plane_after_one(u: float, v: float, radius: float) -> None:
    direction, start = cap(np.array([u]), np.array([v]))[0], cap(np.array([0.1]), np.array([0.1]))[0] * 0.1
    at_u, at_v = np.array([u]), np.array([v])
    for _ in range(6):
        place, du, dv = cap(at_u, at_v)[:3]
        step_u, step_v, distance = line_step(place - start, du, dv, direction)
        at_u, at_v = at_u + step_u, at_v + step_v
    met = start + distance[:, np.newaxis] * direction
    assert np.linalg.norm(met) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(cap(at_u, at_v)[0], met, atol=1e-12)
    x, y, z = np.eye(3)
    away, slanted = np.array([0.3, -0.2, radius]), np.array([0.1, 0.2, 1.0])
    assert line_step(away, x, y, slanted) == pytest.approx((-0.3 + 0.1 * radius, 0.2 + 0.2 * radius, radius))
    assert z @ away == radius

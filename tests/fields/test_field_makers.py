"""The makers of fields, by what defines each, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from math import nan
from typing import Any

import numpy as np
import pytest
from field_places import DIRECTIONS, LENGTHS, NOT_NUMBERS, NOT_POINTS, NUMBERS, PLACE, PLACES, POINTS, refusal
from hypothesis import given
from numpy.testing import assert_allclose, assert_array_equal

from gyroid_cad.fields.field import Field
from gyroid_cad.fields.makers import (
    between_planes,
    constant,
    distance_from_axis,
    distance_from_point,
    linear,
    radial,
    sampled,
    smooth_maximum,
    smooth_minimum,
)


def along(start: Any, end: Any, parts: Any) -> Any:
    """x, y, z on the way from a point to another, so many parts of it."""
    return [a + (b - a) * np.asarray(parts) for a, b in zip(start, end, strict=True)]


@given(NUMBERS, NUMBERS, NUMBERS, NUMBERS)
def test_a_linear_field_has_its_value_at_the_origin_and_its_slopes(value: float, x: float, y: float, z: float) -> None:
    field = linear(value, x, y, z)
    assert field(0, 0, 0) == value
    corners = np.vstack((np.zeros(3), np.eye(3)))
    assert_allclose(np.diff(field(*corners.T) - value)[0], x, atol=1e-12)
    assert_allclose(field(*PLACE), value + POINTS @ (x, y, z), atol=1e-10)


@given(PLACES, PLACES)
def test_the_distance_from_a_point_is_that_in_space(point: Any, place: Any) -> None:
    assert distance_from_point(point)(*point) == 0
    assert distance_from_point(point)(*place) == pytest.approx(np.linalg.norm(np.subtract(place, point)))


@given(PLACES, DIRECTIONS, NUMBERS, PLACES)
def test_the_distance_from_an_axis_is_that_from_its_nearest_point(
    point: Any, direction: Any, part: float, place: Any
) -> None:
    field, way = distance_from_axis(point, direction), np.subtract(place, point)
    nearest = point + np.dot(way, direction) / np.dot(direction, direction) * np.array(direction)
    assert field(*place) == pytest.approx(np.linalg.norm(place - nearest), abs=1e-9)
    assert field(*(place + part * np.array(direction))) == pytest.approx(float(field(*place)), abs=1e-7)


@pytest.mark.parametrize("size", [1e-200, 1e-3, 1e200])
def test_only_the_direction_of_a_direction_matters(size: float) -> None:
    assert_allclose(distance_from_axis((1, 2, 3), (size, -size, 0))(*PLACE),
                    distance_from_axis((1, 2, 3), (1, -1, 0))(*PLACE))  # fmt: skip


@given(NUMBERS, NUMBERS, LENGTHS, PLACES)
def test_a_radial_field_changes_evenly_up_to_its_radius(inner: float, outer: float, radius: float, centre: Any) -> None:
    field = radial(inner, outer, radius, centre)
    parts = np.array([0.0, 0.25, 0.5, 1.0, 2.0])
    rim = (centre[0] + 0.6 * radius, centre[1], centre[2] - 0.8 * radius)
    expected = inner + (outer - inner) * np.minimum(parts, 1)
    assert_allclose(field(*along(centre, rim, parts)), expected, rtol=1e-7, atol=1e-7)
    assert field(*centre) == inner
    assert field(*(np.array(centre) + 2 * radius)) == outer


def test_a_radial_field_round_an_axis_is_the_same_all_along_it() -> None:
    round_axis = radial(1, 2, 15, (3, 2, 0), axis=(0, 0, 5))
    assert_allclose(round_axis(*PLACE), radial(1, 2, 15, (3, 2, 0))(PLACE[0], PLACE[1], 0))
    assert_allclose(round_axis(*PLACE), 1 + np.minimum(distance_from_axis((3, 2, 9), (0, 0, 1))(*PLACE) / 15, 1))


@given(NUMBERS, NUMBERS, PLACES, DIRECTIONS)
def test_between_planes_a_field_changes_evenly_and_outside_not_at_all(
    first: float, second: float, start: Any, way: Any
) -> None:
    end = tuple(np.add(start, way))
    field = between_planes(first, second, start, end)
    parts = np.array([-3.0, 0.0, 0.25, 0.5, 1.0, 4.0])
    across = np.cross(way, (way[1], way[2], way[0] + 1.0))
    x, y, z = along(start, end, parts) + across[:, np.newaxis] / (1 + np.linalg.norm(across))
    assert_allclose(field(x, y, z), first + (second - first) * np.clip(parts, 0, 1), rtol=1e-8, atol=1e-8)
    assert (field(x, y, z)[0], field(x, y, z)[-1]) == (first, second)


AXES = ([-1.0, 0.0, 2.0, 3.0, 3.5], [0.0, 1.0, 5.0, 6.0], [-2.0, -1.0, 0.0, 1.0, 2.0, 4.0])
GRID = np.meshgrid(*AXES, indexing="ij")


@pytest.mark.parametrize("method", ["linear", "cubic", None])
def test_a_sampled_field_goes_through_its_values(method: str | None) -> None:
    values = np.random.default_rng(3).normal(size=GRID[0].shape)
    assert_allclose(sampled(AXES, values, method)(*GRID), values, rtol=0, atol=1e-13)


def test_samples_of_a_polynomial_give_the_polynomial() -> None:
    def trilinear(x: Any, y: Any, z: Any) -> Any:
        return 1 + x - y * z + x * y * z

    def cubic(x: Any, y: Any, z: Any) -> Any:
        return x**3 - x * y**2 * z**3 + z

    inside = np.random.default_rng(4).uniform([-1, 0, -2], [3.5, 6, 4], (50, 3)).T
    assert_allclose(sampled(AXES, trilinear(*GRID), "linear")(*inside), trilinear(*inside), atol=1e-11)
    assert_allclose(sampled(AXES, cubic(*GRID))(*inside), cubic(*inside), atol=1e-10)
    assert str(sampled(AXES, cubic(*GRID))) == "sampled(5 x 4 x 6 values, 'cubic')"
    short = [AXES[0], AXES[1][:3], AXES[2]]
    values = trilinear(*np.meshgrid(*short, indexing="ij"))
    assert str(sampled(short, values)) == "sampled(5 x 3 x 6 values, 'linear')"
    assert "four coordinates" in refusal("method", sampled, short, values, "cubic")


@pytest.mark.parametrize("method", ["linear", "cubic"])
def test_beyond_the_samples_the_border_continues(method: str) -> None:
    field = sampled(AXES, np.random.default_rng(5).normal(size=GRID[0].shape), method)
    border = [np.clip(place, axis[0], axis[-1]) for place, axis in zip(PLACE, AXES, strict=True)]
    assert_array_equal(field(*PLACE), field(*border))


def test_samples_changed_later_change_nothing() -> None:
    values = np.ones(GRID[0].shape)
    field = sampled(AXES, values)
    values[:] = 9
    assert_allclose(field(*PLACE), 1)


@given(NUMBERS, NUMBERS, LENGTHS)
def test_a_smooth_minimum_is_the_minimum_away_from_the_crease(one: float, other: float, width: float) -> None:
    low, high = (float(blend(one, other, width)(0, 0, 0)) for blend in (smooth_minimum, smooth_maximum))
    assert min(one, other) - width / 4 - 1e-12 <= low <= min(one, other)
    assert low + high == pytest.approx(one + other, abs=1e-9)
    if abs(one - other) >= width:
        assert (low, high) == (min(one, other), max(one, other))
    assert smooth_minimum(one, one, width)(0, 0, 0) == pytest.approx(one - width / 4)


def test_a_smooth_minimum_has_no_crease() -> None:
    x = np.linspace(-2, 2, 4001)
    slopes = np.diff(smooth_minimum("x", "-x", 1.0)(x, 0, 0)) / np.diff(x)
    assert np.abs(np.diff(slopes)).max() < 3e-3
    assert np.abs(np.diff(np.diff(np.minimum(x, -x)) / np.diff(x))).max() > 1


MAKERS: dict[Callable[..., Field], dict[str, Any]] = {
    constant: {"value": 1},
    linear: {"value": 1, "x": 0.1, "y": 0.2, "z": 0.3},
    distance_from_point: {"point": (0, 0, 0)},
    distance_from_axis: {"point": (0, 0, 0), "direction": (0, 0, 1)},
    radial: {"centre_value": 1, "outer_value": 2, "radius": 3, "centre": (0, 0, 0), "axis": (0, 0, 1)},
    between_planes: {"first_value": 1, "second_value": 2, "first_point": (0, 0, 0), "second_point": (0, 0, 1)},
    smooth_minimum: {"first": 1, "second": "x", "width": 3},
    smooth_maximum: {"first": 1, "second": "x", "width": 3},
    linear(1, x=1).clipped: {"lowest": 0, "highest": 1},
}


@pytest.mark.parametrize("maker", MAKERS)
def test_every_argument_of_a_maker_is_checked(maker: Callable[..., Field]) -> None:
    arguments = MAKERS[maker]
    maker(**arguments)
    for name, good in arguments.items():
        bad = NOT_POINTS if isinstance(good, tuple) else NOT_NUMBERS
        for value in bad:
            if name in {"first", "second"} and value == "1":
                continue
            if name in {"axis", "lowest", "highest"} and value is None:
                continue
            refusal(name, maker, **{**arguments, name: value})


@pytest.mark.parametrize("length", [0, -1.0, -0.0])
def test_lengths_are_above_zero_and_directions_and_ways_are_not_zero(length: float) -> None:
    refusal("radius", radial, 1, 2, length)
    refusal("width", smooth_minimum, "x", "y", length)
    refusal("direction", distance_from_axis, (1, 2, 3), (0, 0, 0))
    refusal("axis", radial, 1, 2, 3, axis=(0, -0.0, 0))
    refusal("second_point", between_planes, 1, 2, (1, 2, 3), (1, 2, 3))


BAD_AXES = [None, 5, "abc", AXES[:2], (*AXES, [0, 1]), ([0], *AXES[1:]), ([0, 0, 1], *AXES[1:]), ([1, 0], *AXES[1:])]
BAD_AXES += [([0, nan], *AXES[1:]), ([[0, 1]], *AXES[1:]), (["0", "1"], *AXES[1:]), (None, *AXES[1:]), ([], [], [])]


@pytest.mark.parametrize("axes", BAD_AXES)
def test_axes_of_samples_are_three_increasing_vectors(axes: Any) -> None:
    assert "three vectors of increasing" in refusal("axes", sampled, axes, np.ones(GRID[0].shape))


BAD_VALUES = [None, 1.0, "a", np.ones((5, 4)), np.ones((5, 4, 7)), GRID[0].tolist()[:-1], [[1], 2], GRID[0] > 0]
BAD_VALUES += [np.where(GRID[0] > 3, nan, 1), GRID[0] + 0j, GRID[0].astype(str)]


@pytest.mark.parametrize("values", BAD_VALUES)
def test_samples_are_finite_numbers_in_the_shape_of_the_axes(values: Any) -> None:
    assert "(5, 4, 6)" in refusal("values", sampled, AXES, values)
    for method in ("nearest", "", 3):
        refusal("method", sampled, AXES, GRID[0], method)


def test_axes_too_uneven_for_splines_are_refused() -> None:
    axes = [[0.0, 5e-324, 1.0, 2.0]] * 3
    assert "the method linear" in refusal("axes", sampled, axes, np.ones((4, 4, 4)))
    assert sampled(axes, np.ones((4, 4, 4)), "linear")(1, 1, 1) == 1

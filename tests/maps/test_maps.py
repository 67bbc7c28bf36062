"""Maps of space: what they may give, their Jacobians, and the lattice they carry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from gyroid_cad import Lattice
from gyroid_cad.errors import ParameterError
from gyroid_cad.maps import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.block import as_map
from gyroid_cad.maps.space import BlockMap, Size, SpaceMap, carried, differences
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.exact import exact_measures
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.refit import graded_wall

Floats = NDArray[np.float64]

SIZE = 10.0
STEP = 2e-3
ELEMENTS = st.floats(-5, 5)
POINTS = np.random.default_rng(3).uniform(0, SIZE, (3, 40))


def identity(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Floats]:
    return x, y, z


def unit_jacobian(x: Floats, y: Floats, z: Floats) -> tuple[tuple[int, int, int], ...]:
    return (1, 0, 0), (0, 1, 0), (0, 0, 1)


def raising(x: Floats, y: Floats, z: Floats) -> Any:
    raise ValueError("no such\nplace")


def volume(space: Any) -> float:
    """Of a lattice carried by a map."""
    return Lattice((1, 1, 1), SIZE, 0.8, map=space).exact_volume


@given(arrays(float, (3, 3), elements=ELEMENTS), arrays(float, (3, 1), elements=ELEMENTS))
def test_differences_of_an_affine_map_are_its_matrix(matrix: Floats, shift: Floats) -> None:
    taken = differences(lambda points: matrix @ points + shift, POINTS, STEP)
    np.testing.assert_allclose(taken, np.broadcast_to(matrix[..., np.newaxis], (3, 3, 40)), rtol=0, atol=1e-10)


@given(arrays(float, (4, 3, 3), elements=ELEMENTS))
def test_differences_of_a_quadratic_are_its_derivatives(forms: Floats) -> None:
    symmetric = forms + forms.transpose(0, 2, 1)
    taken = differences(lambda p: np.einsum("kij,in,jn->kn", forms, p, p), POINTS, STEP)
    np.testing.assert_allclose(taken, np.einsum("kij,jn->kin", symmetric, POINTS), rtol=0, atol=2e-9)


def test_differences_err_by_the_square_of_their_step() -> None:
    def error(step: float) -> float:
        exact = np.cos(POINTS) * np.eye(3)[..., np.newaxis]
        return float(np.abs(differences(np.sin, POINTS, step) - exact).max())

    assert np.log2(error(2e-2) / error(1e-2)) == pytest.approx(2, abs=0.01)


@pytest.mark.parametrize("shape", [(), (2,), (3, 3)])
def test_differences_put_the_axis_of_derivation_before_the_points(shape: tuple[int, ...]) -> None:
    def function(points: Floats) -> Floats:
        return np.broadcast_to(points[1] ** 2, (*shape, points.shape[1]))

    taken = differences(function, POINTS, STEP)
    assert taken.shape == (*shape, 3, POINTS.shape[1])
    np.testing.assert_allclose(taken[..., 1, :], np.broadcast_to(2 * POINTS[1], (*shape, 40)), rtol=1e-10)
    assert not taken[..., [0, 2], :].any()


@pytest.mark.parametrize(
    "function",
    [
        lambda x, y, z: np.array([x + 1, y, 2 + 0 * z]),
        lambda x, y, z: [x + 1, y, 2 + 0 * x],
        lambda x, y, z: (c for c in (x + 1, y, np.float32(2))),
        lambda x, y, z: (x + 1, y, np.full(x.shape, 2, dtype=np.int8)),
        lambda x, y, z: (x.__iadd__(1), y, 2),
    ],
    ids=["array", "list", "generator", "integers", "in place"],
)
def test_a_map_may_give_arrays_or_numbers_in_any_sequence(function: Callable[..., Any]) -> None:
    before = POINTS.copy()
    images, jacobian = carried("map", SpaceMap(function), POINTS, STEP)
    np.testing.assert_array_equal(POINTS, before)
    np.testing.assert_allclose(images, [POINTS[0] + 1, POINTS[1], np.full(40, 2.0)], rtol=0, atol=0)
    expected = np.broadcast_to(np.diag([1.0, 1, 0])[..., np.newaxis], (3, 3, 40))
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize(
    "jacobian",
    [
        unit_jacobian,
        lambda x, y, z: np.eye(3),
        lambda x, y, z: np.multiply.outer(np.eye(3), np.ones_like(x)),
        lambda x, y, z: (row for row in ([1 + 0 * x, 0, 0], (0, 1, 0), np.array([0, 0, 1]))),
    ],
    ids=["numbers", "matrix", "arrays", "mixed"],
)
def test_a_jacobian_may_give_arrays_or_numbers_in_any_sequence(jacobian: Callable[..., Any]) -> None:
    taken = carried("map", SpaceMap(identity, jacobian), POINTS, STEP)[1]
    np.testing.assert_array_equal(taken, np.broadcast_to(np.eye(3)[..., np.newaxis], (3, 3, 40)))


BAD_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "two": lambda x, y, z: (x, y),
    "four": lambda x, y, z: (x, y, z, x),
    "nothing": lambda x, y, z: None,
    "one number": lambda x, y, z: 5.0,
    "complex": lambda x, y, z: (x + 0j, y, z),
    "truth": lambda x, y, z: (x > 0, y, z),
    "text": lambda x, y, z: "xyz",
    "objects": lambda x, y, z: (x.astype(object), y, z),
    "fewer points": lambda x, y, z: (x[:-1], y, z),
    "columns": lambda x, y, z: (x[:, np.newaxis], y, z),
    "nested": lambda x, y, z: [[x, y, z]],
    "ragged": lambda x, y, z: (x, y, [1, [2, 3]]),
    "two arguments": lambda x, y: (x, y, x),
    "nan": lambda x, y, z: (x, y, np.nan),
    "nan somewhere": lambda x, y, z: (x, y, np.where(x > 8, np.nan, z)),
    "infinite": lambda x, y, z: (x, np.inf, z),
    "raising": raising,
    "not a division": lambda x, y, z: (x, y, 1 // 0),
}


@pytest.mark.parametrize("name", BAD_FUNCTIONS)
@pytest.mark.parametrize("part", ["function", "jacobian"])
def test_a_map_that_gives_anything_but_finite_numbers_is_refused_in_one_line(name: str, part: str) -> None:
    bad = BAD_FUNCTIONS[name]
    space = SpaceMap(bad) if part == "function" else SpaceMap(identity, bad)
    with pytest.raises(ParameterError, match=r"^map = .*: expected ") as caught:
        volume(space)
    assert "\n" not in str(caught.value)
    assert caught.value.parameter == "map"


@pytest.mark.parametrize(
    "jacobian",
    [lambda x, y, z: (1, 0, 0, 0, 1, 0, 0, 0, 1), lambda x, y, z: ((1, 0), (0, 1), (0, 0))],
    ids=["flat", "3 x 2"],
)
def test_a_jacobian_has_three_rows_of_three(jacobian: Callable[..., Any]) -> None:
    with pytest.raises(ParameterError, match="3 x 3 real arrays"):
        volume(SpaceMap(identity, jacobian))


def test_a_place_without_an_image_is_named() -> None:
    with pytest.raises(ParameterError, match=r"finite values; at \(x, y, z\) = \((8|9|1\d)[.\d]*, ") as caught:
        volume(lambda x, y, z: (x, y, np.where(x > 8, np.nan, z)))
    assert caught.value.parameter == "map"


def test_what_a_map_raised_is_told_and_chained() -> None:
    with pytest.raises(ParameterError, match=r"map = 'raising'.*it raised ValueError: no such place") as caught:
        volume(raising)
    assert isinstance(caught.value.__cause__, ValueError)


@pytest.mark.parametrize("wrong", [((2, 0, 0), (0, 3, 0), (1, 0, 1)), ((0, 1, 0), (1, 0, 0), (0, 0, 1))])
def test_a_jacobian_that_is_not_the_maps_own_is_refused(wrong: Any) -> None:
    with pytest.raises(ParameterError, match=r"^map = .*Jacobian that agrees with differences"):
        volume(SpaceMap(identity, lambda x, y, z: wrong))


@pytest.mark.parametrize("part", ["function", "jacobian"])
@pytest.mark.parametrize("bad", [3, "x", (1, 2, 3)])
def test_both_parts_of_a_map_are_functions(part: str, bad: Any) -> None:
    with pytest.raises(ParameterError, match=rf"^{part} = .*expected a function of x, y, z"):
        SpaceMap(**{"function": identity, part: bad})


@pytest.mark.parametrize(
    "bad",
    [
        (True, False),
        (1, 0, 0),
        "xyz",
        (None,) * 3,
        True,
        None,
    ],
)
def test_closed_is_three_of_true_and_false(bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^closed = .*three of True and False"):
        SpaceMap(identity, closed=bad)


def test_closed_may_be_a_list() -> None:
    assert volume(SpaceMap(identity, closed=[False, False, False])) == pytest.approx(volume(identity))  # type: ignore[arg-type]


def test_a_function_is_a_map_that_knows_nothing_of_the_block() -> None:
    space = as_map(identity)
    assert isinstance(space, BlockMap)
    assert space.over((1.0, 2.0, 3.0)) is space
    assert str(space) == "identity"
    assert as_map(space) is space


@pytest.mark.parametrize("bad", [3, 3.0, [1], (1, 2, 3), np.eye(3), True])
def test_a_map_is_a_map_its_spelling_or_a_function(bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^map = .*SpaceMap, cylinder, sphere, twist, bend, or a function"):
        Lattice((1, 1, 1), SIZE, 0.8, map=bad)


@pytest.mark.parametrize("kind", [Cylinder, Twist])
def test_a_class_of_maps_is_no_map(kind: Any) -> None:
    with pytest.raises(ParameterError, match=r"^map = "):
        volume(kind)


class _Nowhere:
    def over(self, size: Size) -> None:
        return None


class _Unhashable:
    __hash__ = None  # type: ignore[assignment]

    def __call__(self, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Floats]:
        return x, y, z


@dataclass(frozen=True)
class _Matrix:
    """Says it can be hashed, but can't."""

    entries: Floats

    def __call__(self, x: Floats, y: Floats, z: Floats) -> Floats:
        return self.entries @ np.stack([x, y, z])


def test_a_block_map_that_gives_no_map_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^map = "):
        volume(_Nowhere())


@pytest.mark.parametrize(
    "space",
    [
        _Unhashable(),
        SpaceMap(_Unhashable()),
        _Matrix(np.eye(3)),
    ],
    ids=["without a hash", "inside a SpaceMap", "with an array in it"],
)
def test_a_function_without_a_hash_is_a_map_like_any_other(space: Any) -> None:
    assert volume(space) == pytest.approx(volume(identity), rel=1e-12)


@pytest.mark.parametrize(
    ("block_map", "cells"),
    [(Cylinder(10), (1, 1, 1)), (Cylinder(12, 360), (2, 1, 1)), (Sphere(20), (1, 1, 1)), (Twist(60), (1, 1, 1)),
     (Bend(-30), (1, 1, 1))],
    ids=str,
)  # fmt: skip
def test_a_map_without_its_jacobian_carries_to_the_same_lattice(
    block_map: BlockMap, cells: tuple[int, int, int]
) -> None:
    known = block_map.over((cells[0] * SIZE, cells[1] * SIZE, cells[2] * SIZE))
    complex = build_complex(cells, closed=known.closed)
    gradings = [Grading(SIZE, 0.8, map=space) for space in (known, SpaceMap(known.function, closed=known.closed))]
    # That each patch's edges are its neighbours' is part of the fit.
    nets = [graded_wall(complex, grading, 10).nets for grading in gradings]
    np.testing.assert_allclose(nets[0], nets[1], rtol=0, atol=1e-8 * SIZE)
    measures = [exact_measures(complex, grading) for grading in gradings]
    assert measures[0].volume == pytest.approx(measures[1].volume, rel=1e-9)

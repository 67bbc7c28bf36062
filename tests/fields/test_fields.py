"""Fields: arithmetic by that of numbers, coercion and checks by what they refuse."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan, pi
from typing import Any

import numpy as np
import pytest
from field_places import FIRST, PLACE, POINTS, WALK, refusal
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from gyroid_cad.fields.field import Field, as_field, evaluated
from gyroid_cad.fields.makers import (
    between_planes,
    constant,
    distance_from_axis,
    expression,
    linear,
    radial,
    sampled,
    smooth_maximum,
    smooth_minimum,
)


def along(start: Any, end: Any, parts: Any) -> Any:
    """x, y, z on the way from a point to another, so many parts of it."""
    return [a + (b - a) * np.asarray(parts) for a, b in zip(start, end, strict=True)]


OPERANDS = [linear(0.8, x=0.05), expression("2 + sin(y)"), constant(1.5), lambda x, y, z: 3 + 0 * x, 2, np.float32(0.5)]
AXES = [[0.0, 1.0, 2.0, 4.0]] * 3


@pytest.mark.parametrize("symbol", ["+", "-", "*", "/", "**"])
@pytest.mark.parametrize("first", OPERANDS)
@pytest.mark.parametrize("second", OPERANDS)
def test_fields_combine_as_their_values_do(symbol: str, first: Any, second: Any) -> None:
    one, other = (Field(part, "f") if callable(part) and not isinstance(part, Field) else part
                  for part in (first, second))  # fmt: skip
    if not isinstance(one, Field) and not isinstance(other, Field):
        return
    values = [part(*PLACE) if isinstance(part, Field) else part for part in (one, other)]
    with np.errstate(all="ignore"):
        expected = eval(f"a {symbol} b", {"a": values[0], "b": values[1]})
        combined = eval(f"a {symbol} b", {"a": one, "b": other})
    assert_allclose(combined(*PLACE), expected, rtol=1e-14)
    numbers = [part.value if isinstance(part, Field) else part for part in (one, other)]
    assert (combined.value is None) == (None in numbers)
    assert_allclose((-combined)(*PLACE), -expected, rtol=1e-14)


def test_a_field_prints_as_it_was_made() -> None:
    wall, typed = linear(0.8, x=0.05), expression(" 0.8 -\n 0.1*x ")
    assert (str(wall), repr(wall)) == ("linear(0.8, x=0.05)", "linear(0.8, x=0.05)")
    assert (str(typed), repr(typed)) == ("0.8 - 0.1*x", "'0.8 - 0.1*x'")
    assert str(2 * wall - typed) == "((2 * linear(0.8, x=0.05)) - (0.8 - 0.1*x))"
    assert str(-(wall ** (-1))) == "(-(linear(0.8, x=0.05) ** (-1)))"
    assert str(typed.clipped(0.3, None)) == "(0.8 - 0.1*x).clipped(0.3, None)"
    assert repr(smooth_minimum(typed, 1, 0.1)) == "smooth_minimum('0.8 - 0.1*x', 1, 0.1)"
    assert str(radial(1, 2, 3, axis=(0, 0, 1))) == "radial(1, 2, 3, axis=(0, 0, 1))"
    assert str(between_planes(1, 2, (0, 0, 0), (0, 0, 5.5))) == "between_planes(1, 2, (0, 0, 0), (0, 0, 5.5))"


@given(st.recursive(st.sampled_from(["x", "2", "y + 1", "x*y - 3"]).map(lambda text: (expression(text), f"({text})")),
                    lambda inner: st.builds(lambda a, b, op: (eval(f"a {op} b", {"a": a[0], "b": b[0]}),
                                                              f"({a[1]} {op} {b[1]})"),
                                            inner, inner, st.sampled_from("+-*")), max_leaves=6))  # fmt: skip
def test_the_text_of_combined_expressions_means_the_same(made: tuple[Field, str]) -> None:
    field, bracketed = made
    assert_array_equal(expression(field.text)(*PLACE), expression(bracketed)(*PLACE))
    assert_array_equal(expression(field.text)(*PLACE), field(*PLACE))


@pytest.mark.parametrize("other", ["x", None, True, 1j, [1.0], np.ones(3), object()])
def test_fields_combine_with_nothing_but_numbers_and_fields(other: Any) -> None:
    for combine in (lambda: linear(1, x=1) + other, lambda: other + linear(1, x=1), lambda: linear(1, x=1) ** other):
        with pytest.raises(TypeError):
            combine()


def test_clipping_bounds_a_field_on_the_sides_asked_for() -> None:
    field = linear(0, x=1)
    for low, high in ((-3, 5), (None, 5.5), (-3, None), (None, None), (2, 2)):
        assert_array_equal(field.clipped(low, high)(*PLACE), np.clip(PLACE[0], low, high))
    assert (1 / field).clipped(0, 2)(0, 0, 0) == 2
    assert "at most highest" in refusal("lowest", field.clipped, 2, 1)


def test_the_same_text_gives_the_same_field() -> None:
    assert expression("x + 1") is expression("x + 1")
    assert expression("x + 1") == as_field("thickness", "x + 1", "a wall")


@pytest.mark.parametrize("shape", [(), (0,), (3,), (2, 0, 3), (2, 3)])
def test_values_are_doubles_of_the_broadcast_shape(shape: tuple[int, ...]) -> None:
    place = np.ones(shape, dtype=int)
    for field in (constant(2), expression("x"), linear(1, y=1), distance_from_axis((0, 0, 0), (1, 0, 0)),
                  sampled(AXES, np.ones((4, 4, 4))), radial(1, 2, 3), smooth_minimum("x", "y", 1)):  # fmt: skip
        for found in (field(0, place, 0.5), evaluated("field", field, np.stack([place] * 3, axis=-1))):
            assert (found.dtype, found.shape) == (np.float64, shape)


@pytest.mark.parametrize(
    ("given_as", "number"),
    [(0.8, 0.8), (1, 1), (np.float32(0.5), 0.5), (np.int64(3), 3), ("0.8", 0.8), (" -1e-3 ", -1e-3),
     ("2*pi/5", 0.4 * pi), (constant(0.8), 0.8), (linear(2), 2), (constant(2) * 3 - expression("pi"), 6 - pi),
     (-constant(2), -2), (constant(5).clipped(None, 3), 3), (smooth_maximum(1, "2", 0.5), 2), (linear(1, x=0.0), 1),
     ("0 ** 0", 1)],
)  # fmt: skip
def test_what_does_not_vary_becomes_a_float(given_as: Any, number: float) -> None:
    found = as_field("thickness", given_as, "a wall in mm")
    assert type(found) is float
    assert found == number


class Sphere:
    """Callable, without a name, and printed on two lines."""

    def __call__(self, x: Any, y: Any, z: Any) -> Any:
        return np.sqrt(x**2 + y**2 + z**2)

    def __repr__(self) -> str:
        return "Sphere\n()"


def wave(x: Any, y: Any, z: Any) -> Any:
    return np.sin(x)


@pytest.mark.parametrize(
    ("given_as", "text"),
    [("x", "x"), (linear(1, x=1), "linear(1, x=1)"), (wave, "wave"), (Sphere(), "Sphere ()"),
     (lambda x, y, z: x, "<lambda>")],
)  # fmt: skip
def test_what_varies_becomes_a_field_that_says_what_it_is(given_as: Any, text: str) -> None:
    found = as_field("thickness", given_as, "a wall in mm")
    assert isinstance(found, Field)
    assert str(found) == text
    assert_array_equal(evaluated("thickness", found, POINTS), found(*PLACE))


def test_a_field_stays_the_field_it_is() -> None:
    field = linear(1, x=1)
    assert as_field("thickness", field, "a wall") is field


@pytest.mark.parametrize("value", [None, True, np.True_, 1j, b"1", [1.0], np.ones(3), np.array(1.0), {}, ...])
def test_what_is_no_field_is_refused_with_what_would_be(value: Any) -> None:
    message = refusal("thickness", as_field, "thickness", value, "the wall in mm")
    assert message.endswith("the wall in mm: a number, an expression of x, y, z, a Field or a function of them")


@pytest.mark.parametrize("value", [nan, inf, -inf, 10**400, np.float64("nan"), "1/0", "0/0", "1e999", constant(1) / 0])
def test_numbers_that_are_not_finite_are_refused(value: Any) -> None:
    assert "the wall in mm: a finite number" in refusal("thickness", as_field, "thickness", value, "the wall in mm")


@pytest.mark.parametrize("text", ["q", "x.real", "", "nan", "inf", "x" * 2000, "1,2"])
def test_a_bad_expression_is_an_error_of_its_parameter(text: str) -> None:
    assert "an expression of x, y, z; " in refusal("density", as_field, "density", text, "a volume fraction")
    assert "an expression of x, y, z; " in refusal("text", expression, text)
    assert "as text" in refusal("text", expression, [text])


def raising(error: BaseException) -> Callable[..., Any]:
    def function(x: Any, y: Any, z: Any) -> Any:
        raise error

    return function


@pytest.mark.parametrize(
    ("function", "problem"),
    [
        (raising(ValueError("two\nlines")), "it raised ValueError: two lines"),
        (raising(ZeroDivisionError()), "it raised ZeroDivisionError:"),
        (raising(RecursionError("deep")), "it raised RecursionError: deep"),
        (raising(ValueError("a" * 10000)), "a" * 100),
        (lambda x, y: x, "it raised TypeError: "),
        (lambda x, y, z: [1, [2, 3]], "it raised ValueError: "),
        (lambda x, y, z: x[:-1], "one number or an array of shape (3,), not (2,)"),
        (lambda x, y, z: x[:, np.newaxis], "not (3, 1)"),
        (lambda x, y, z: np.stack((x, y, z)), "not (3, 3)"),
        (lambda x, y, z: [1.0], "not (1,)"),
        (lambda x, y, z: x + 0j, "real numbers, not complex128"),
        (lambda x, y, z: x > 0, "real numbers, not bool"),
        (lambda x, y, z: True, "real numbers, not bool"),
        (lambda x, y, z: None, "real numbers, not object"),
        (lambda x, y, z: x.astype(object), "real numbers, not object"),
        (lambda x, y, z: x.astype(str), "real numbers, not <U"),
        (lambda x, y, z: "0.8", "real numbers, not <U3"),
        (lambda x, y, z: np.where(x == 1, nan, x), f"finite values, not nan at {FIRST}"),
        (lambda x, y, z: np.where(x >= 1, -inf, x), f"finite values, not -inf at {FIRST}"),
        (lambda x, y, z: nan, f"finite values, not nan at {FIRST}"),
    ],
)
def test_a_function_that_is_no_field_is_refused_with_what_it_did(function: Any, problem: str) -> None:
    field = as_field("thickness", function, "a wall")
    assert isinstance(field, Field)
    message = refusal("thickness", evaluated, "thickness", field, WALK)
    assert problem in message
    assert len(message) < 500
    assert refusal("thickness", evaluated, "thickness", 1 + field, WALK)


def test_the_first_place_is_named_where_a_value_is_not_finite() -> None:
    message = refusal("thickness", evaluated, "thickness", expression("sqrt(6 - y)"), np.array([WALK, WALK]))
    assert message == "thickness = 'sqrt(6 - y)': expected finite values, not nan at (x, y, z) = (7, 8, 9) mm"


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError(), SystemExit()])
def test_an_interruption_passes(error: BaseException) -> None:
    with pytest.raises(type(error)):
        evaluated("thickness", Field(raising(error), "f"), WALK)


def test_a_function_gets_vectors_of_its_own() -> None:
    def vandal(x: Any, y: Any, z: Any) -> Any:
        for place in (x, y, z):
            assert place.flags.c_contiguous
            assert place.shape == (20,)
            place[:] = 99
        return x

    points = POINTS.copy()
    points.setflags(write=False)
    field = Field(vandal, "vandal")
    assert_array_equal(evaluated("thickness", field, points), np.full((4, 5), 99.0))
    assert_array_equal(evaluated("thickness", 0 * field + linear(0, x=1), points), PLACE[0])


@pytest.mark.parametrize("result", [2, 2.0, np.float32(2), np.int8(2), np.array(2)])
def test_one_number_or_a_list_of_any_real_type_will_do(result: Any) -> None:
    assert_array_equal(evaluated("scale", Field(lambda x, y, z: result, "f"), WALK), [2.0, 2.0, 2.0])
    assert_array_equal(evaluated("scale", Field(lambda x, y, z: [result] * 3, "f"), WALK), [2.0, 2.0, 2.0])


def test_a_function_that_has_no_hash_becomes_a_field_that_has() -> None:
    @dataclass
    class Slope:
        rate: float

        def __call__(self, x: Any, y: Any, z: Any) -> Any:
            return self.rate * x

    slope = Slope(2.0)
    first, second = (as_field("thickness", slope, "a length") for _ in range(2))
    assert hash(first) == hash(second)
    assert first == second
    assert_array_equal(evaluated("thickness", first, WALK), 2 * WALK[:, 0])  # type: ignore[arg-type]


def test_importing_fields_loads_no_scipy() -> None:
    program = "import sys, gyroid_cad.fields.field; sys.exit('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0

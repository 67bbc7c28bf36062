"""Formulas as text: what they may hold, what they are worth, and how everything else is refused."""

from __future__ import annotations

import ast
import pickle
import re
import warnings
from collections.abc import Callable
from math import inf, pi
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.lib.mixins import NDArrayOperatorsMixin
from numpy.testing import assert_array_equal

from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.expressions import DEEPEST_NESTING, FUNCTIONS, LONGEST_EXPRESSION, VARIABLES, compile_expression
from gyroid_cad.fields.makers import smooth_maximum, smooth_minimum

# A column, a row and a single number: of the broadcast shape (2, 3).
PLACE = (np.array([[-1.5], [2.0]]), np.array([0.0, 0.3, 7.0]), np.float64(-0.25))
# What Unicode counts as forms of plain letters, and Python reads as those.
ITALIC_X, BOLD_Y = "\N{MATHEMATICAL ITALIC SMALL X}", "\N{MATHEMATICAL BOLD SMALL Y}"
WIDE_SIN = "".join(chr(ord(letter) + 0xFEE0) for letter in "sin")
BLENDS = {"smooth_maximum": smooth_maximum, "smooth_minimum": smooth_minimum}
UNARY = [name for name in FUNCTIONS if name not in {"arctan2", "hypot", "minimum", "maximum", "clip", *BLENDS}]

FORBIDDEN = [
    '__import__("os")', "__import__", "x.__class__", "x.real", "x[0]", "x[0:1]", "x if x else y", "(x:=3)", "f'{x}'",
    "lambda: x", "sin(x=1)", "sin(**x)", "sin(*x)", "*x", "x<y", "x<y<z", "x==y", "x!=y", "x in y", "x is y", "x and y",
    "x or y", "not x", "~x", "x//y", "x@y", "x^y", "x|y", "x&y", "x<<y", "x>>y", "1j", "x+2j", "True", "None", "'a'",
    "b'a'", "...", "Ellipsis", "x,y", "()", "[x]", "{x}", "{x:y}", "{**x}", "[x for x in y]", "(x for x in y)",
    "sin(x for x in y)", "{x for x in y}", "{x:x for x in y}", "await x", "(yield x)", "x=3", "x;y", "x:y", "import os",
    "sin", "sin+1", "pi(x)", "x(y)", "2(x)", "(x+1)(y)", "sin(x)(y)", "sin.__call__(x)", "sin()", "sin(x,y)", "clip(x)",
    "exec('x')", "eval('x')", "open('x')", "print(x)", "np.sin(x)", "x # y", "x\\\n+y", "x\0", "\0", "\ud800", "x\x1b",
    "x\ufeff", "x\u200b", "x+", "+", "(", ")", "(x", "x)", "x)+(y", "x y", "2x", "0777", "1__0", "0x", "1e", ".",
    "\uff11", "'", '"""', "f'{", "x\\", "$", "?", "!", "", " ", "\n\t ",
]  # fmt: skip


class Quantity(NDArrayOperatorsMixin):
    """A number whose Python operators are NumPy's functions, in double precision, always."""

    def __init__(self, value: Any) -> None:
        self.value = np.float64(value) if np.isscalar(value) else value

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any) -> Quantity:
        assert method == "__call__"
        return Quantity(ufunc(*(part.value if isinstance(part, Quantity) else part for part in inputs)))


PYTHONS_NAMES: dict[str, Any] = {
    **{name: getattr(np, name) for name in FUNCTIONS if name not in BLENDS},
    **{name: Quantity(value) for name, value in zip(VARIABLES, PLACE, strict=True)},
    "clip": lambda value, low, high: np.minimum(np.maximum(value, low), high),
    "pi": Quantity(pi),
    "number": Quantity,
    "__builtins__": {},
}


def grown(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """One level more of a formula."""
    two = st.sampled_from(["arctan2", "hypot", "minimum", "maximum"])
    return st.one_of(
        st.builds("{} {} {}".format, inner, st.sampled_from(["+", "-", "*", "/", "**", "%"]), inner),
        st.builds("{}{}".format, st.sampled_from("+-"), inner),
        st.builds("({})".format, inner),
        st.builds("{}({})".format, st.sampled_from(UNARY), inner),
        st.builds("{}({}, {})".format, two, inner, inner),
        st.builds("clip({},{} , {})".format, inner, inner, inner),
    )


NUMBERS = st.one_of(st.integers(0, 10**6), st.floats(0, allow_infinity=False)).map("number({!r})".format)
# In Python's spelling: what stands in number(...) is a double, as every number here is.
FORMULAS = st.recursive(st.one_of(st.sampled_from([*VARIABLES, "pi"]), NUMBERS), grown, max_leaves=12)
TOKENS = [
    *VARIABLES,
    *FUNCTIONS,
    *"()+-*/%,.[]{}'\":=<>!@#\\ \n\t0123456789ejq_πé𝑥ｘ",
    "**",
    "pi",
    "lambda",
    "if",
    "for",
]
SCRIBBLES = st.one_of(st.text(), st.lists(st.sampled_from(TOKENS), max_size=40).map("".join))


def refusal(text: Any, parameter: str = "expression") -> str:
    """The message of the error a text brings about, a single line that can be printed."""
    with pytest.raises(ParameterError) as caught:
        compile_expression(text, parameter)
    message = str(caught.value)
    assert message.isprintable()
    assert message.startswith(f"{parameter} = ")
    return message


def value(text: str, *place: Any) -> Any:
    return compile_expression(text)(*(place or PLACE))


@settings(max_examples=400)
@given(FORMULAS)
@example("x ** number(2) ** number(0.5) % -y")
@example("-x ** -number(2)")
def test_a_formula_is_worth_what_python_and_numpy_make_of_it(formula: str) -> None:
    with np.errstate(all="ignore"):
        expected = eval(formula, PYTHONS_NAMES).value
    assert_array_equal(value(re.sub(r"number\(([^)]*)\)", r"\1", formula)), np.broadcast_to(expected, (2, 3)))


@settings(max_examples=500)
@given(SCRIBBLES)
def test_nothing_but_a_parameter_error_comes_of_a_scribble(text: str) -> None:
    try:
        compiled = compile_expression(text)
    except ParameterError:
        refusal(text)
    else:
        assert compiled(*PLACE).shape == (2, 3)


@pytest.mark.parametrize("text", FORBIDDEN)
def test_what_is_no_formula_is_refused_on_one_line_wherever_it_stands(text: str) -> None:
    refusal(text)
    refusal(f"x * {text}")


@pytest.mark.parametrize("text", [None, 3, 0.8, b"x", ["x"], True, ast.parse("x", mode="eval"), object()])
def test_what_is_no_text_is_refused(text: object) -> None:
    assert "as text" in refusal(text)


@pytest.mark.parametrize(
    "before", ["", "x + ", "  x*", "\n\tx - ", f"{ITALIC_X}*{BOLD_Y} + ", "(((", "-", "clip(x, 0, "]
)
@pytest.mark.parametrize(
    ("culprit", "named"),
    [
        ("qq", "unknown name 'qq'"),
        ("ü", "unknown name 'ü'"),
        ("x.real", "an attribute 'x.real'"),
        (f"{ITALIC_X}.y", f"an attribute '{ITALIC_X}.y'"),
        ("y[0]", "an index 'y[0]'"),
        ("'a'", """a constant that is no real number, str "'a'\""""),
        ("exp", "the function 'exp'"),
        ("x(1)", "'x'"),
        ("hypot(1)", "'hypot'"),
        ("#", "'#'"),
        ("?", "invalid syntax"),
    ],
)
def test_the_culprit_is_named_with_its_column_in_characters(before: str, culprit: str, named: str) -> None:
    closing = ")" * before.count("(")
    assert f"{named} at column {len(before) + 1}" in refusal(before + culprit + closing)


@pytest.mark.parametrize("symbol", ["^", "|", "&", "<<", ">>", "//", "@"])
def test_an_operator_is_found_between_its_operands(symbol: str) -> None:
    assert f"the operator {symbol!r} at column 13 " in refusal(f" (({ITALIC_X}*(y+1)) {symbol} (z)) + 1")


def test_an_error_bears_the_name_of_the_parameter_and_lists_what_is_known() -> None:
    message = refusal("0.8 - q*x", "thickness")
    assert message.startswith(
        "thickness = '0.8 - q*x': expected an expression of x, y, z; unknown name 'q' at column 7"
    )
    assert "known are x, y, z, pi and the functions abs, arccos," in message


@pytest.mark.parametrize(
    ("typed", "meant"),
    [("sine", "sin"), ("Sin", "sin"), ("PI", "pi"), ("π", "pi"), ("asin", "arcsin"), ("atan2", "arctan2"),
     ("min", "minimum"), ("MAX", "maximum"), ("ln", "log"), ("sqroot", "sqrt"), ("tanhh", "tanh")],
)  # fmt: skip
def test_a_likely_name_is_suggested(typed: str, meant: str) -> None:
    assert f"did you mean '{meant}'?" in refusal(f"{typed}(x)")


def test_a_power_in_the_manner_of_others_is_answered_with_pythons() -> None:
    assert refusal("x^2").endswith("a power is written **")
    assert refusal("2(x + 1)").endswith("a product is written *")


def test_a_long_culprit_is_quoted_in_part() -> None:
    assert f"'{'a' * 37}...' at column 1;" in refusal("a" * 500)


def test_the_longest_expression_passes_and_one_character_more_does_not() -> None:
    longest = "x" + "+x" * (LONGEST_EXPRESSION // 2 - 1) + " "
    assert_array_equal(value(longest), np.broadcast_to(LONGEST_EXPRESSION // 2 * PLACE[0], (2, 3)))
    assert f"at most {LONGEST_EXPRESSION} characters, these are {LONGEST_EXPRESSION + 1}" in refusal(longest + " ")
    assert "these are 10000000" in refusal("x" * 10**7)


NESTS: dict[str, Callable[[int], str]] = {
    "brackets": lambda depth: "(" * depth + "x" + ")" * depth,
    "calls": lambda depth: "sin(" * depth + "x" + ")" * depth,
    "signs": lambda depth: "-" * depth + "x",
    "powers": lambda depth: "**".join(["x"] * (depth + 1)),
    "open brackets": lambda depth: "(" * depth,
    "attributes": lambda depth: "x" + ".x" * depth,
    "lambdas": lambda depth: "lambda:" * depth + "x",
}


@pytest.mark.parametrize("kind", NESTS)
@pytest.mark.parametrize("depth", [DEEPEST_NESTING + 1, 100])
def test_deep_nesting_is_refused_with_its_depth(kind: str, depth: int) -> None:
    assert f"nested at most {DEEPEST_NESTING} deep, this is {depth} deep" in refusal(NESTS[kind](depth))


@pytest.mark.parametrize("kind", ["brackets", "calls", "signs", "powers"])
def test_the_deepest_nesting_passes(kind: str) -> None:
    assert value(NESTS[kind](DEEPEST_NESTING)).shape == (2, 3)


@pytest.mark.parametrize("text", ["(" * 999, "[" * 999, "{" * 999, "-" * 999 + "x", "f(" * 499, "not " * 249 + "x"])
def test_absurd_nesting_is_refused(text: str) -> None:
    assert "nested at most" in refusal(text)


@pytest.mark.parametrize("error", [RecursionError, MemoryError, ValueError, SyntaxError("no place")])
def test_whatever_the_parser_gives_up_with_is_a_parameter_error(error: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def parse(*args: object, **named: object) -> ast.AST:
        raise error

    monkeypatch.setattr(ast, "parse", parse)
    refusal("x")


@pytest.mark.parametrize("text", ["1(2)", "0x1for x in y", "1if x else y", "'\\d'", "x is 1", "1.real", "(x,)(y)"])
def test_warnings_of_the_parser_do_not_leak(text: str) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        refusal(text)
    assert not caught


@pytest.mark.parametrize("text", ["1/0", "0/0", "sqrt(-1)", "log(x - x)", "exp(1e4)", "x % 0", "0 ** -1", "arcsin(2)"])
def test_what_has_no_value_is_not_finite_and_brings_no_warning(text: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not np.isfinite(value(text)).any()


@pytest.mark.parametrize("text", ["9**9**9", "9**9**9**9", "9" * 999, "0x" + "f" * 998, "1e999", "10**400"])
def test_numbers_are_doubles_and_huge_ones_infinite(text: str) -> None:
    assert_array_equal(value(text), np.full((2, 3), inf))


@pytest.mark.parametrize(
    ("text", "plain"), [(ITALIC_X, "x"), (f"{ITALIC_X} + {BOLD_Y}", "x + y"), (f"{WIDE_SIN}(z)", "sin(z)")]
)
def test_letters_in_another_form_are_read_as_python_reads_them(text: str, plain: str) -> None:
    assert_array_equal(value(text), value(plain))
    assert compile_expression(text).variables == compile_expression(plain).variables


@pytest.mark.parametrize("text", [" x+y ", "\n x\n+ y\n", "x\t+\r\ny", "x\u00a0+\u2003y", "x\u2028+\x0cy"])
def test_space_of_any_kind_is_space(text: str) -> None:
    assert_array_equal(value(text), value("x+y"))


@settings(max_examples=50)
@given(st.sampled_from(["1", "x", "x + z", "pi*y"]), st.sampled_from([(), (1,), (0,), (4,), (2, 1, 3)]))
def test_values_are_doubles_of_the_broadcast_shape(text: str, shape: tuple[int, ...]) -> None:
    found = value(text, 1, np.ones(shape, dtype=np.float32), True)
    assert isinstance(found, np.ndarray)
    assert (found.dtype, found.shape) == (np.float64, shape)


def test_values_are_not_the_callers_array() -> None:
    x = np.arange(3.0)
    found = compile_expression("x")(x, 0, 0)
    found[:] = 9
    assert_array_equal(x, np.arange(3.0))


@given(FORMULAS)
def test_variables_are_those_that_stand_in_the_formula(formula: str) -> None:
    text = re.sub(r"number\(([^)]*)\)", r"\1", formula)
    assert compile_expression(text).variables == set(re.findall(r"\b[xyz]\b", text))


def test_expressions_of_one_text_are_equal_and_survive_pickling() -> None:
    one, other = compile_expression("x + 1"), compile_expression("x + 1", "thickness")
    assert one == other == pickle.loads(pickle.dumps(one))
    assert hash(one) == hash(other)
    assert one != compile_expression("1 + x")
    assert_array_equal(pickle.loads(pickle.dumps(one))(*PLACE), one(*PLACE))


def test_every_function_is_numpys_own() -> None:
    for name in UNARY:
        assert_array_equal(value(f"{name}(z + 0.75)"), np.broadcast_to(getattr(np, name)(0.5), (2, 3)))


@settings(max_examples=50)
@given(*3 * [st.floats(-5, 5)], st.floats(0.1, 3))
@example(3.0, 5.0, 1.0, 0.5)
def test_clip_and_the_smooth_functions_mean_what_they_do_in_python(
    one: float, low: float, high: float, width: float
) -> None:
    assert_array_equal(value(f"clip({one}, {low}, {high})", 0, 0, 0), np.clip(one, low, high))
    for name, blend in BLENDS.items():
        by_python = blend(f"x + {one}", f"{low}*y", width)
        assert_array_equal(value(f"{name}(x + {one}, {low}*y, {width})"), by_python(*PLACE))


@pytest.mark.parametrize("name", BLENDS)
@pytest.mark.parametrize("width", ["0", "-1", "x", "1/0", "0*y + 1", "sqrt(-1)"])
def test_a_width_that_is_no_number_above_zero_is_refused_as_in_python(name: str, width: str) -> None:
    assert f"the width {width!r} at column" in refusal(f"{name}(x, y, {width})")
    assert compile_expression(f"{name}(x, y, pi/4)").variables == {"x", "y"}

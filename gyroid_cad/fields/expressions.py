"""Formulas of x, y, z as text: read against a short list of what may stand in them, never run as Python."""

from __future__ import annotations

import ast
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from itertools import accumulate
from math import inf, pi
from operator import itemgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.errors import ParameterError

__all__ = [
    "DEEPEST_NESTING",
    "FUNCTIONS",
    "LONGEST_EXPRESSION",
    "VARIABLES",
    "Expression",
    "compile_expression",
    "smooth_greater",
    "smooth_lesser",
]

Floats = NDArray[np.float64]
Evaluator = Callable[[Mapping[str, Any]], Any]

LONGEST_EXPRESSION = 1000  # characters
DEEPEST_NESTING = 50  # brackets in brackets, calls in calls, signs before signs; a long sum is not deep

VARIABLES = ("x", "y", "z")
_CONSTANTS = {"pi": np.float64(pi)}
_VALUES = (*VARIABLES, *_CONSTANTS)


def smooth_lesser(first: Any, second: Any, width: Any) -> Any:
    """The lesser of two values, with the crease where they cross rounded by a parabola over a width above 0.

    >>> [float(smooth_lesser(1.0, other, 2.0)) for other in (1.0, 2.0, 4.0)]
    [0.5, 0.875, 1.0]
    """
    overlap = np.maximum(1 - np.abs(np.subtract(first, second)) / width, 0)
    return np.minimum(first, second) - overlap**2 * width / 4


def smooth_greater(first: Any, second: Any, width: Any) -> Any:
    """The greater of two values, rounded as by :func:`smooth_lesser`."""
    return -smooth_lesser(np.negative(first), np.negative(second), width)


def _clip(value: Any, lowest: Any, highest: Any) -> Any:
    return np.minimum(np.maximum(value, lowest), highest)


_UFUNCS = (
    np.sin, np.cos, np.tan, np.arcsin, np.arccos, np.arctan, np.arctan2, np.sinh, np.cosh, np.tanh,
    np.exp, np.log, np.log10, np.sqrt, np.cbrt, np.hypot, np.minimum, np.maximum,
)  # fmt: skip
# By name: what it calls, and with how many arguments.
_CALLS: dict[str, tuple[Callable[..., Any], int]] = {
    **{ufunc.__name__: (ufunc, ufunc.nin) for ufunc in _UFUNCS},
    "abs": (np.absolute, 1),
    "clip": (_clip, 3),
    "smooth_maximum": (smooth_greater, 3),
    "smooth_minimum": (smooth_lesser, 3),
}
# Functions whose last argument is the same everywhere, and above 0: as in Python, where it is a number.
_OF_A_WIDTH = ("smooth_maximum", "smooth_minimum")
FUNCTIONS = tuple(sorted(_CALLS))

_OPERATIONS: dict[type[ast.AST], Callable[..., Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.Mod: np.mod,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
}
_REFUSED_OPERATORS: dict[type[ast.AST], str] = {
    ast.BitXor: "^", ast.BitAnd: "&", ast.BitOr: "|", ast.LShift: "<<", ast.RShift: ">>", ast.FloorDiv: "//",
    ast.MatMult: "@", ast.Not: "not", ast.Invert: "~",
}  # fmt: skip
_REFUSED: dict[type[ast.AST], str] = {
    ast.Attribute: "an attribute", ast.Subscript: "an index", ast.Compare: "a comparison", ast.IfExp: "a condition",
    ast.BoolOp: "a logical operation", ast.Lambda: "a lambda", ast.NamedExpr: "an assignment", ast.Tuple: "a tuple",
    ast.List: "a list", ast.Set: "a set", ast.Dict: "a dictionary", ast.JoinedStr: "a formatted string",
    ast.Starred: "a starred argument", ast.ListComp: "a comprehension", ast.SetComp: "a comprehension",
    ast.DictComp: "a comprehension", ast.GeneratorExp: "a comprehension",
}  # fmt: skip
# As other languages spell them; by likeness alone "asin" would be taken for "sin".
_OTHER_SPELLINGS = {
    "asin": "arcsin", "acos": "arccos", "atan": "arctan", "atan2": "arctan2", "min": "minimum", "max": "maximum",
    "ln": "log", "fabs": "abs", "π": "pi",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Expression:
    """A function of x, y, z that was read from text; equal to every other of the same text.

    Attributes
    ----------
    text : str
        As it was given.
    variables : frozenset of str
        Those of x, y, z that stand in it; none in a constant.
    evaluator : callable
        From a mapping of names to arrays to the value.
    """

    text: str
    variables: frozenset[str]
    evaluator: Evaluator = field(compare=False, repr=False)

    def __call__(self, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
        """The values at points.

        Parameters
        ----------
        x, y, z : array_like
            Of shapes that broadcast.

        Returns
        -------
        ndarray of float64
            Of the broadcast shape; nan or infinite where the formula has no value.
        """
        places = [np.asarray(coordinate, dtype=np.float64) for coordinate in (x, y, z)]
        with np.errstate(all="ignore"):
            value = self.evaluator({**_CONSTANTS, **dict(zip(VARIABLES, places, strict=True))})
        return np.array(np.broadcast_to(value, np.broadcast(*places).shape), dtype=np.float64)

    def __reduce__(self) -> tuple[Callable[[str], Expression], tuple[str]]:
        return compile_expression, (self.text,)


def compile_expression(text: str, parameter: str = "expression") -> Expression:
    """Read a formula such as ``"0.8 - 0.1*cos(2*pi*z/10)"``.

    It may hold x, y, z, pi, numbers, ``+ - * / ** %``, brackets and calls of FUNCTIONS, and nothing else. All
    arithmetic is that of float64, without warnings: ``1/0`` is infinite and ``sqrt(-1)`` is nan.

    Parameters
    ----------
    text : str
        At most LONGEST_EXPRESSION characters, nested at most DEEPEST_NESTING deep. A letter that Unicode counts
        as a form of a plain one, such as a mathematical italic x, stands for it, as in Python.
    parameter : str
        What an error calls the text.

    Returns
    -------
    Expression
        Called as ``f(x, y, z)`` with arrays that broadcast.

    Raises
    ------
    ParameterError
        Naming what cannot be used and its column, counted in characters from 1.
    """
    if not isinstance(text, str):
        raise ParameterError(parameter, text, "an expression of x, y, z as text")
    return _Reader(parameter, text).expression()


class _Reader:
    """Reads one text, and knows where in it everything stands."""

    def __init__(self, parameter: str, text: str) -> None:
        self.parameter, self.text = parameter, text
        if len(text) > LONGEST_EXPRESSION:
            raise self._refusal(f"at most {LONGEST_EXPRESSION} characters, these are {len(text)}")
        # One space for each space, tab or line break: columns stay, and everything stands on one line.
        level = "".join(" " if character.isspace() else character for character in text)
        self.source = level.strip()
        self.indent = len(level) - len(level.lstrip())

    def expression(self) -> Expression:
        self._require_plain_text()
        body = self._tree().body
        self._require_shallow(_depth(body))
        evaluator = self._value(body)
        names = {node.id for node in ast.walk(body) if isinstance(node, ast.Name)}
        return Expression(self.text, frozenset(names.intersection(VARIABLES)), evaluator)

    def _refusal(self, problem: str) -> ParameterError:
        return ParameterError(self.parameter, self.text, f"an expression of x, y, z; {problem}")

    def _require_plain_text(self) -> None:
        if not self.source:
            raise self._refusal("there is nothing in it")
        for index, character in enumerate(self.source):
            # Null characters, lone surrogates and the invisible; a comment would swallow a second line.
            if not character.isprintable() or character in "#\\":
                raise self._refusal(f"{character!r} at column {self.indent + index + 1} cannot be used")
        self._require_shallow(max(accumulate((c in "([{") - (c in ")]}") for c in self.source)))

    def _require_shallow(self, depth: int) -> None:
        if depth > DEEPEST_NESTING:
            raise self._refusal(f"nested at most {DEEPEST_NESTING} deep, this is {depth} deep")

    def _tree(self) -> ast.Expression:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                return ast.parse(self.source, mode="eval")
        except SyntaxError as error:
            problem = error.msg.split(". ")[0].split(" (detected")[0]
            # Python gives no place where the text ends too early.
            column = self.indent + (error.offset or len(self.source) + 1)
            raise self._refusal(f"{problem} at column {column}") from None
        except (RecursionError, MemoryError):
            raise self._refusal(f"nested at most {DEEPEST_NESTING} deep, this is too deep to be read") from None
        except ValueError as error:
            raise self._refusal(f"this cannot be read: {error}") from None

    def _column(self, offset: int) -> int:
        return self.indent + len(self.source.encode()[:offset].decode()) + 1

    def _segment(self, node: ast.expr | ast.keyword) -> str:
        return self.source.encode()[node.col_offset : node.end_col_offset].decode()

    def _quoted(self, node: ast.expr | ast.keyword) -> str:
        segment = self._segment(node)
        shown = segment if len(segment) <= 40 else segment[:37] + "..."
        return f"{shown!r} at column {self._column(node.col_offset)}"

    def _value(self, node: ast.expr) -> Evaluator:
        match node:
            case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
                number = _float64(value)
                return lambda at: number
            case ast.Name():
                return self._named(node)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub()):
                operation, operand = _OPERATIONS[type(node.op)], self._value(node.operand)
                return lambda at: operation(operand(at))
            case ast.BinOp():
                return self._chain(node)
            case ast.Call():
                return self._called(node)
        raise self._refusal(f"{_kind(node)} {self._quoted(node)} cannot be used")

    def _named(self, node: ast.Name) -> Evaluator:
        if node.id in _CALLS:
            raise self._refusal(f"the function {self._quoted(node)} needs arguments in brackets")
        if node.id not in _VALUES:
            raise self._unknown(node)
        return itemgetter(node.id)

    def _unknown(self, node: ast.Name) -> ParameterError:
        name = node.id.lower()
        likely = _OTHER_SPELLINGS.get(name) or next(iter(get_close_matches(name, (*_VALUES, *_CALLS), 1)), None)
        known = f"known are {', '.join(_VALUES)} and the functions {', '.join(FUNCTIONS)}"
        hint = f"did you mean {likely!r}?" if likely else known
        return self._refusal(f"unknown name {self._quoted(node)}; {hint}")

    def _chain(self, node: ast.BinOp) -> Evaluator:
        """A long sum is a deep tree that leans to the left: walked down here, not by recursion."""
        links, leftmost = [node], node.left
        while isinstance(leftmost, ast.BinOp):
            links.append(leftmost)
            leftmost = leftmost.left
        first = self._value(leftmost)
        rest = [(self._operation(link), self._value(link.right)) for link in reversed(links)]

        def evaluate(at: Mapping[str, Any]) -> Any:
            value = first(at)
            for operation, operand in rest:
                value = operation(value, operand(at))
            return value

        return evaluate

    def _operation(self, node: ast.BinOp) -> Callable[..., Any]:
        if type(node.op) in _OPERATIONS:
            return _OPERATIONS[type(node.op)]
        symbol = _REFUSED_OPERATORS[type(node.op)]
        column = self._column(self.source.encode().index(symbol.encode(), node.left.end_col_offset))
        hint = "; a power is written **" if symbol == "^" else ""
        raise self._refusal(f"the operator {symbol!r} at column {column} cannot be used{hint}")

    def _called(self, node: ast.Call) -> Evaluator:
        name = node.func
        if not isinstance(name, ast.Name) or name.id in _VALUES:
            raise self._refusal(f"{self._quoted(name)} is not a function; a product is written *")
        if name.id not in _CALLS:
            raise self._unknown(name)
        if node.keywords:
            raise self._refusal(f"the keyword argument {self._quoted(node.keywords[0])} cannot be used")
        function, count = _CALLS[name.id]
        arguments = [self._value(argument) for argument in node.args]
        if len(arguments) != count:
            plural = "s" if count > 1 else ""
            raise self._refusal(f"{self._quoted(name)} takes {count} argument{plural}, not {len(arguments)}")
        if name.id in _OF_A_WIDTH:
            self._require_width(node.args[-1], arguments[-1])
        return lambda at: function(*(argument(at) for argument in arguments))

    def _require_width(self, node: ast.expr, evaluate: Evaluator) -> None:
        varies = any(isinstance(inner, ast.Name) and inner.id in VARIABLES for inner in ast.walk(node))
        if not varies:
            with np.errstate(all="ignore"):
                varies = not 0 < evaluate(_CONSTANTS) < inf
        if varies:
            raise self._refusal(f"the width {self._quoted(node)} must be a finite number above 0")


def _float64(value: float) -> np.float64:
    try:
        return np.float64(float(value))
    except OverflowError:
        return np.float64(inf)


def _kind(node: ast.expr) -> str:
    if isinstance(node, ast.Constant):
        return f"a constant that is no real number, {type(node.value).__name__}"
    if isinstance(node, ast.UnaryOp):
        return f"the operator {_REFUSED_OPERATORS[type(node.op)]!r} in"
    return _REFUSED.get(type(node), "the construct")


def _depth(node: ast.expr) -> int:
    """Levels of a tree below its root; what a chain such as a + b - c links together stands on one level."""
    deepest = 0
    waiting = [(node, 0)]
    while waiting:
        outer, depth = waiting.pop()
        deepest = max(deepest, depth)
        for inner in ast.iter_child_nodes(outer):
            if isinstance(inner, ast.expr):
                linked = isinstance(outer, ast.BinOp) and inner is outer.left and isinstance(inner, ast.BinOp)
                waiting.append((inner, depth if linked else depth + 1))
    return deepest

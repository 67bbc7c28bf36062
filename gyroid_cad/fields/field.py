"""Quantities that vary in space: scalar fields of (x, y, z) in mm, combined, read and checked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isfinite
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.checks import finite_number, hashable
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.expressions import Expression, compile_expression

__all__ = [
    "Field",
    "FieldLike",
    "Floats",
    "as_field",
    "call_text",
    "compiled_field",
    "derived",
    "evaluated",
    "given_as",
    "shown",
]

Floats = NDArray[np.float64]
Function = Callable[[Floats, Floats, Floats], ArrayLike]


def _operator(symbol: str, operation: Callable[[Any, Any], Any], turned: bool = False) -> Callable[[Field, Any], Field]:
    def combine(field: Field, other: object) -> Any:
        second = _operand(other)
        if second is None:
            return NotImplemented
        pair = (second, field) if turned else (field, second)
        return derived(operation, pair, f"({_inner(pair[0])} {symbol} {_inner(pair[1])})")

    return combine


@dataclass(frozen=True, slots=True, repr=False)
class Field:
    """A scalar field of (x, y, z) in mm. Fields and numbers combine by ``+ - * / **``.

    Attributes
    ----------
    function : callable
        From x, y, z, three vectors of one length, to as many real numbers, or to one number.
    text : str
        How the field prints, as one term.
    value : float, optional
        Of a field that is the same everywhere.
    parameter : str, optional
        What a user gave it as, where that is not what it is used for.

    Examples
    --------
    >>> from gyroid_cad import fields
    >>> wall = 0.6 + 0.02 * fields.distance_from_point((0, 0, 0))
    >>> print(wall(3, 4, [0, 12]))
    [0.7  0.86]
    """

    function: Function
    text: str
    value: float | None = None
    parameter: str | None = None

    # A NumPy number on the left leaves the operation to the field.
    __array_ufunc__ = None

    __add__, __radd__ = _operator("+", np.add), _operator("+", np.add, turned=True)
    __sub__, __rsub__ = _operator("-", np.subtract), _operator("-", np.subtract, turned=True)
    __mul__, __rmul__ = _operator("*", np.multiply), _operator("*", np.multiply, turned=True)
    __truediv__, __rtruediv__ = _operator("/", np.divide), _operator("/", np.divide, turned=True)
    __pow__, __rpow__ = _operator("**", np.power), _operator("**", np.power, turned=True)

    def __neg__(self) -> Field:
        return derived(np.negative, (self,), f"(-{_inner(self)})")

    def __call__(self, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
        """The values at points in mm, x, y and z of shapes that broadcast; of the broadcast shape.

        Unlike those of :func:`evaluated`, they may be infinite or nan.

        Raises
        ------
        ParameterError
            If the function gives anything but real numbers, or not as many as there are points.
        """
        places = np.broadcast_arrays(*(np.asarray(coordinate, dtype=np.float64) for coordinate in (x, y, z)))
        return _checked("field", self, _raw(self, *places), places[0])

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return repr(self.text) if isinstance(self.function, Expression) else self.text

    def clipped(self, lowest: float | None = None, highest: float | None = None) -> Field:
        """The field with values outside [lowest, highest] moved to the nearer bound; None leaves a side open.

        Raises
        ------
        ParameterError
            If a bound is not a finite number, or lowest is above highest.
        """
        low = None if lowest is None else finite_number("lowest", lowest)
        high = None if highest is None else finite_number("highest", highest)
        if low is not None and high is not None and low > high:
            raise ParameterError("lowest", lowest, f"at most highest, {high:g}")
        bounds = -inf if low is None else low, inf if high is None else high
        return derived(
            lambda values: np.clip(values, *bounds), (self,), f"{_inner(self)}.{call_text('clipped', low, high)}"
        )


FieldLike = float | str | Field | Callable[..., ArrayLike]


def as_field(parameter: str, value: object, meaning: str) -> float | Field:
    """Turn a parameter's value into a float where it does not vary, or else a Field.

    Parameters
    ----------
    parameter : str
        Its name, for errors.
    value : float, str, Field or callable
        A string is read as an expression.
    meaning : str
        What it stands for, for errors.

    Raises
    ------
    ParameterError
        If it is none of these, or a number that is not finite.
    """
    if isinstance(value, str):
        return as_field(parameter, compiled_field(value, parameter), meaning)
    if isinstance(value, Field):
        if value.value is not None and not isfinite(value.value):
            raise ParameterError(parameter, value, f"{meaning}: a finite number, not {value.value}")
        return value if value.value is None else value.value
    if isinstance(value, Real) and not isinstance(value, bool):
        return finite_number(parameter, value, f"{meaning}: a finite number")
    if not callable(value):
        raise ParameterError(
            parameter, value, f"{meaning}: a number, an expression of x, y, z, a Field or a function of them"
        )
    name = getattr(value, "__name__", None)
    return Field(hashable(value), " ".join((name if isinstance(name, str) else repr(value)).split()))


def given_as(parameter: str, value: float | Field | None) -> str:
    """Name under which a user knows a parameter's field, for errors."""
    return value.parameter if isinstance(value, Field) and value.parameter else parameter


def evaluated(parameter: str, field: Field, points: Floats) -> Floats:
    """The values of a field at points, all of them finite.

    Parameters
    ----------
    parameter : str
        What the field was given for, for errors.
    field : Field
    points : ndarray, shape (..., 3)
        In mm.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ParameterError
        If the function raises anything, gives something else than real numbers, or a value that isn't finite.
    """
    x, y, z = np.moveaxis(points, -1, 0)
    try:
        raw = _raw(field, x, y, z)
    except MemoryError:
        raise
    except Exception as error:
        problem = " ".join(f"{type(error).__name__}: {error}"[:200].split())
        raise ParameterError(parameter, field, f"a function of x, y, z; it raised {problem}") from error
    values = _checked(parameter, field, raw, x)
    finite = np.isfinite(values)
    if not finite.all():
        first = np.unravel_index(np.argmin(finite), values.shape)
        raise ParameterError(parameter, field, f"finite values, not {_at(first, values, points)}")
    return values


@lru_cache(maxsize=256)
def compiled_field(text: str, parameter: str) -> Field:
    function = compile_expression(text, parameter)
    value = None if function.variables else float(function(0.0, 0.0, 0.0))
    return Field(function, " ".join(text.split()), value)


def _raw(field: Field, x: Floats, y: Floats, z: Floats) -> NDArray[Any]:
    # Copies: what a function writes into its arguments reaches nobody else's.
    with np.errstate(all="ignore"):
        return np.asarray(field.function(x.flatten(), y.flatten(), z.flatten()))


def _checked(parameter: str, field: Field, raw: NDArray[Any], x: Floats) -> Floats:
    if raw.dtype.kind not in "iuf":
        raise ParameterError(parameter, field, f"a function that gives real numbers, not {raw.dtype}")
    if raw.shape not in ((), (x.size,)):
        raise ParameterError(
            parameter, field, f"a function that gives one number or an array of shape {(x.size,)}, not {raw.shape}"
        )
    return np.array(np.broadcast_to(raw, (x.size,)), dtype=np.float64).reshape(x.shape)


def _at(index: tuple[np.intp, ...], values: Floats, points: Floats) -> str:
    place = ", ".join(f"{coordinate:.6g}" for coordinate in points[index])
    return f"{values[index]:.6g} at (x, y, z) = ({place}) mm"


def _operand(value: object) -> Field | None:
    if isinstance(value, Field):
        return value
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    number = finite_number("number", value)
    return Field(lambda x, y, z: number, shown(number) if number >= 0 else f"({shown(number)})", number)


def derived(operation: Callable[..., Any], parts: tuple[Field, ...], text: str) -> Field:
    field = Field(lambda x, y, z: operation(*(part(x, y, z) for part in parts)), text)
    varies = any(part.value is None for part in parts)
    return field if varies else replace(field, value=float(field(0.0, 0.0, 0.0)))


def _inner(field: Field) -> str:
    return f"({field.text})" if isinstance(field.function, Expression) and not field.text.isalnum() else field.text


def call_text(name: str, *arguments: object, **named: object) -> str:
    parts = [shown(argument) for argument in arguments] + [f"{key}={shown(value)}" for key, value in named.items()]
    return f"{name}({', '.join(parts)})"


def shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"({', '.join(map(shown, value.tolist()))})"
    return repr(value).removesuffix(".0") if isinstance(value, float) else repr(value)

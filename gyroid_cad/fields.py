"""Quantities that vary in space: scalar fields of (x, y, z) in mm, made, combined, read and checked."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isfinite, nan
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.expressions import Expression, compile_expression

__all__ = [
    "Field", "as_field", "between_planes", "constant", "distance_from_axis", "distance_from_point", "evaluated",
    "expression", "linear", "radial", "require_positive", "sampled", "smooth_maximum", "smooth_minimum",
]  # fmt: skip

Floats = NDArray[np.float64]
Function = Callable[[Floats, Floats, Floats], ArrayLike]
Point = tuple[float, float, float]


def _operator(symbol: str, operation: Callable[[Any, Any], Any], turned: bool = False) -> Callable[[Field, Any], Field]:
    def combine(field: Field, other: object) -> Any:
        second = _operand(other)
        if second is None:
            return NotImplemented
        pair = (second, field) if turned else (field, second)
        return _derived(operation, pair, f"({_inner(pair[0])} {symbol} {_inner(pair[1])})")

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
    """

    function: Function
    text: str
    value: float | None = None

    # A NumPy number on the left leaves the operation to the field.
    __array_ufunc__ = None

    __add__, __radd__ = _operator("+", np.add), _operator("+", np.add, turned=True)
    __sub__, __rsub__ = _operator("-", np.subtract), _operator("-", np.subtract, turned=True)
    __mul__, __rmul__ = _operator("*", np.multiply), _operator("*", np.multiply, turned=True)
    __truediv__, __rtruediv__ = _operator("/", np.divide), _operator("/", np.divide, turned=True)
    __pow__, __rpow__ = _operator("**", np.power), _operator("**", np.power, turned=True)

    def __neg__(self) -> Field:
        return _derived(np.negative, (self,), f"(-{_inner(self)})")

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
        low = None if lowest is None else _number("lowest", lowest)
        high = None if highest is None else _number("highest", highest)
        if low is not None and high is not None and low > high:
            raise ParameterError("lowest", lowest, f"at most highest, {high:g}")
        bounds = -inf if low is None else low, inf if high is None else high
        return _derived(
            lambda values: np.clip(values, *bounds), (self,), f"{_inner(self)}.{_call('clipped', low, high)}"
        )


def constant(value: float) -> Field:
    """The same value everywhere; raises ParameterError if it is not a finite number."""
    number = _number("value", value)
    return Field(lambda x, y, z: number, _call("constant", number), number)


def linear(value: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Field:
    """A value at the origin that changes by the slopes x, y, z per mm along the axes.

    Raises
    ------
    ParameterError
        If any of them is not a finite number.
    """
    origin = _number("value", value)
    a, b, c = _number("x", x), _number("y", y), _number("z", z)
    slopes = {name: slope for name, slope in zip("xyz", (a, b, c), strict=True) if slope}
    text = _call("linear", origin, **slopes)
    return Field(lambda x, y, z: origin + a * x + b * y + c * z, text, None if slopes else origin)


def expression(text: str) -> Field:
    """A formula such as ``"0.8 - 0.1*z"``, as :func:`~gyroid_cad.expressions.compile_expression` reads it.

    The same text gives the same field. Raises ParameterError at what cannot be used, naming its column.
    """
    if not isinstance(text, str):
        raise ParameterError("text", text, "an expression of x, y, z as text")
    return _expression(text, "text")


def distance_from_point(point: Point) -> Field:
    """The distance in mm from a point; raises ParameterError if that isn't three finite numbers."""
    centre = _point("point", point)
    return Field(_distance(centre), _call("distance_from_point", centre))


def distance_from_axis(point: Point, direction: Point) -> Field:
    """The distance in mm from the line through a point along a direction.

    Raises
    ------
    ParameterError
        If either isn't three finite numbers, or the direction is zero.
    """
    through, along = _point("point", point), _point("direction", direction)
    return Field(_distance(through, _unit("direction", along)), _call("distance_from_axis", through, along))


def radial(
    centre_value: float,
    outer_value: float,
    radius: float,
    centre: Point = (0.0, 0.0, 0.0),
    axis: Point | None = None,
) -> Field:
    """A value that changes evenly with the distance from a point or an axis, and no more beyond a radius.

    Parameters
    ----------
    centre_value, outer_value : float
        At no distance; at the radius and beyond.
    radius : float
        In mm.
    centre : tuple of float
        In mm.
    axis : tuple of float, optional
        Direction of the line through the centre from which distances are taken instead.

    Raises
    ------
    ParameterError
        If anything isn't finite, the radius is not above 0 or the axis is zero.
    """
    values = _number("centre_value", centre_value), _number("outer_value", outer_value)
    reach, middle = _positive("radius", radius), _point("centre", centre)
    line = None if axis is None else _point("axis", axis)
    distance = _distance(middle, None if line is None else _unit("axis", line))
    named = {"centre": middle if middle.any() else None, "axis": line}
    text = _call("radial", *values, reach, **{name: value for name, value in named.items() if value is not None})
    return Field(lambda x, y, z: np.interp(distance(x, y, z), (0, reach), values), text)


def between_planes(first_value: float, second_value: float, first_point: Point, second_point: Point) -> Field:
    """A value that changes evenly from one plane to another parallel to it, and no more outside.

    The planes go through the two points (in mm), perpendicular to the line that joins them.

    Raises
    ------
    ParameterError
        If anything isn't finite, or the points are the same.
    """
    values = _number("first_value", first_value), _number("second_value", second_value)
    start, end = _point("first_point", first_point), _point("second_point", second_point)
    length = float(np.linalg.norm(end - start))
    if not 0 < length < inf:
        raise ParameterError("second_point", second_point, f"another point than first_point, {_shown(start)}")
    unit = (end - start) / length
    text = _call("between_planes", *values, start, end)
    return Field(lambda x, y, z: np.interp(unit @ _offsets(start, x, y, z), (0, length), values), text)


def sampled(axes: Sequence[ArrayLike], values: ArrayLike, method: str | None = None) -> Field:
    """A field through values on a grid; a point outside has the value of the nearest one on the border.

    Parameters
    ----------
    axes : three array_like
        Increasing coordinates in mm, at least two along each axis.
    values : array_like, shape (len(axes[0]), len(axes[1]), len(axes[2]))
    method : {"linear", "cubic"}, optional
        Cubic where every axis has the four coordinates it needs, if left out. Cubic splines (not-a-knot) are
        smooth, but may swing above and below the values they join.

    Raises
    ------
    ParameterError
    """
    grid = _grid(axes)
    shape = tuple(len(axis) for axis in grid)
    heights = _numbers("values", values, f"finite numbers in the shape {shape} of the axes", shape)
    allowed = ("linear", "cubic") if min(shape) >= 4 else ("linear",)
    kind = allowed[-1] if method is None else method
    if kind not in allowed:
        raise ParameterError("method", method, "linear, or cubic with four coordinates or more along every axis")
    spline = _spline(grid, heights, 3 if kind == "cubic" else 1)
    lowest, highest = [axis[0] for axis in grid], [axis[-1] for axis in grid]
    text = f"sampled({' x '.join(map(str, shape))} values, {kind!r})"
    return Field(lambda x, y, z: spline(np.clip(np.stack((x, y, z), axis=-1), lowest, highest)), text)


def smooth_minimum(first: Field | float | str, second: Field | float | str, width: float) -> Field:
    """The lesser of two fields, with the crease where they cross rounded by a parabola.

    Where they differ by the width or more it is the lesser itself, where they are equal a quarter of the width below.

    Raises
    ------
    ParameterError
        If the width is not above 0, or one of the two is neither a number, an expression nor a Field.
    """
    return _blend("smooth_minimum", 1.0, first, second, width)


def smooth_maximum(first: Field | float | str, second: Field | float | str, width: float) -> Field:
    """The greater of two fields, rounded as by :func:`smooth_minimum`."""
    return _blend("smooth_maximum", -1.0, first, second, width)


def as_field(parameter: str, value: object, meaning: str) -> float | Field:
    """What a parameter was given as: a float wherever it does not vary, or else a Field.

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
        return as_field(parameter, _expression(value, parameter), meaning)
    if isinstance(value, Field):
        if value.value is not None and not isfinite(value.value):
            raise ParameterError(parameter, value, f"{meaning}: a finite number, not {value.value}")
        return value if value.value is None else value.value
    if isinstance(value, Real) and not isinstance(value, bool):
        return _number(parameter, value, f"{meaning}: a finite number")
    if not callable(value):
        raise ParameterError(
            parameter, value, f"{meaning}: a number, an expression of x, y, z, a Field or a function of them"
        )
    name = getattr(value, "__name__", None)
    return Field(value, " ".join((name if isinstance(name, str) else repr(value)).split()))


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


def require_positive(parameter: str, field: Field, points: Floats, values: Floats) -> None:
    """Refuse a field whose values, shape (...), at points in mm, shape (..., 3), are not all above 0.

    Raises
    ------
    ParameterError
        Naming the parameter, the field, the lowest value and its place.
    """
    if values.size and not values.min() > 0:
        lowest = np.unravel_index(np.argmin(values), values.shape)
        raise ParameterError(parameter, field, f"values above 0, not {_at(lowest, values, points)}")


@lru_cache(maxsize=256)
def _expression(text: str, parameter: str) -> Field:
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
    number = _number("number", value)
    return Field(lambda x, y, z: number, _shown(number) if number >= 0 else f"({_shown(number)})", number)


def _derived(operation: Callable[..., Any], parts: tuple[Field, ...], text: str) -> Field:
    field = Field(lambda x, y, z: operation(*(part(x, y, z) for part in parts)), text)
    varies = any(part.value is None for part in parts)
    return field if varies else replace(field, value=float(field(0.0, 0.0, 0.0)))


def _blend(name: str, sign: float, first: object, second: object, width: float) -> Field:
    given = [as_field(*named, "one of the two to blend") for named in (("first", first), ("second", second))]
    parts = tuple(part if isinstance(part, Field) else constant(part) for part in given)
    reach = _positive("width", width)

    def blend(one: Floats, other: Floats) -> Floats:
        overlap = np.maximum(1 - np.abs(one - other) / reach, 0)
        lesser: Floats = np.minimum(sign * one, sign * other)
        return sign * (lesser - overlap**2 * reach / 4)

    return _derived(blend, parts, _call(name, *given, reach))


def _inner(field: Field) -> str:
    return f"({field.text})" if isinstance(field.function, Expression) and not field.text.isalnum() else field.text


def _call(name: str, *arguments: object, **named: object) -> str:
    shown = [_shown(argument) for argument in arguments] + [f"{key}={_shown(value)}" for key, value in named.items()]
    return f"{name}({', '.join(shown)})"


def _shown(value: object) -> str:
    if isinstance(value, np.ndarray):
        return f"({', '.join(map(_shown, value.tolist()))})"
    return repr(value).removesuffix(".0") if isinstance(value, float) else repr(value)


def _number(parameter: str, value: object, accepted: str = "a finite number") -> float:
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else nan
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise ParameterError(parameter, value, accepted)
    return number


def _positive(parameter: str, value: object) -> float:
    number = _number(parameter, value, accepted := "a finite number above 0")
    if number <= 0:
        raise ParameterError(parameter, value, accepted)
    return number


def _numbers(parameter: str, value: object, accepted: str, shape: tuple[int, ...] | None = None) -> Floats:
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        raise ParameterError(parameter, value, accepted) from None
    fits = array.dtype.kind in "iuf" and (shape is None or array.shape == shape)
    if not fits or not np.isfinite(array).all():
        raise ParameterError(parameter, value, accepted)
    return array.astype(np.float64)


def _point(parameter: str, value: object) -> Floats:
    return _numbers(parameter, value, "three finite numbers", (3,))


def _unit(parameter: str, direction: Floats) -> Floats:
    largest = np.abs(direction).max()
    if not largest:
        raise ParameterError(parameter, direction, "a direction, not zero")
    # Scaled first: the squares of tiny and huge numbers are zero and infinite.
    unit: Floats = direction / largest
    return unit / np.linalg.norm(unit)


def _offsets(start: Floats, x: Floats, y: Floats, z: Floats) -> Floats:
    return np.stack((x, y, z)) - start[:, np.newaxis]


def _distance(start: Floats, unit: Floats | None = None) -> Callable[[Floats, Floats, Floats], Floats]:
    """From a point, or from the line through it."""
    across = np.eye(3) if unit is None else np.eye(3) - np.outer(unit, unit)
    return lambda x, y, z: np.linalg.norm(across @ _offsets(start, x, y, z), axis=0)


def _grid(axes: Sequence[ArrayLike]) -> list[Floats]:
    accepted = "three vectors of increasing finite coordinates in mm, each at least two long"
    if not isinstance(axes, Sequence | np.ndarray) or len(axes) != 3:
        raise ParameterError("axes", axes, accepted)
    grid = [_numbers("axes", axis, accepted) for axis in axes]
    if any(axis.ndim != 1 or axis.size < 2 or not np.all(np.diff(axis) > 0) for axis in grid):
        raise ParameterError("axes", axes, accepted)
    return grid


def _spline(grid: list[Floats], values: Floats, degree: int) -> Callable[[Floats], Floats]:
    from scipy.interpolate import NdBSpline, make_interp_spline

    # One axis after the other is exact; SciPy's interpolator of grids solves for all at once, to 1e-4 or so.
    knots, coefficients = [], values
    for number, axis in enumerate(grid):
        along = make_interp_spline(axis, coefficients, k=degree, axis=number)
        knots.append(along.t)
        coefficients = np.moveaxis(along.c, 0, number)
    spline: Callable[[Floats], Floats] = NdBSpline(tuple(knots), np.ascontiguousarray(coefficients), degree)
    return spline

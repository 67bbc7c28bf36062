"""Fields ready to use: formulas, distances, gradients, samples, and blends of two fields."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import finite_number, finite_numbers, positive_number, three_numbers
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.expressions import smooth_greater, smooth_lesser
from gyroid_cad.fields.field import Field, Floats, as_field, call_text, compiled_field, derived, shown

__all__ = [
    "PaperUnits",
    "between_planes",
    "constant",
    "distance_from_axis",
    "distance_from_point",
    "expression",
    "linear",
    "paper_units",
    "radial",
    "sampled",
    "smooth_maximum",
    "smooth_minimum",
]


def constant(value: float) -> Field:
    """Field of one value everywhere; raises ParameterError if it is not a finite number.

    Examples
    --------
    >>> constant(0.8)(1, 2, [3, 4]).tolist()
    [0.8, 0.8]
    """
    number = finite_number("value", value)
    return Field(lambda x, y, z: number, call_text("constant", number), number)


def linear(value: float, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Field:
    """A value at the origin that changes by the slopes x, y, z per mm along the axes.

    Raises
    ------
    ParameterError
        If any of them is not a finite number.

    Examples
    --------
    >>> linear(0.6, x=0.02)([0, 10], 0, 0).tolist()
    [0.6, 0.8]
    """
    origin = finite_number("value", value)
    a, b, c = finite_number("x", x), finite_number("y", y), finite_number("z", z)
    slopes = {name: slope for name, slope in zip("xyz", (a, b, c), strict=True) if slope}
    text = call_text("linear", origin, **slopes)
    return Field(lambda x, y, z: origin + a * x + b * y + c * z, text, None if slopes else origin)


def expression(text: str) -> Field:
    """A formula such as ``"0.8 - 0.1*z"``, as :func:`~gyroid_cad.fields.expressions.compile_expression` reads it.

    The same text gives the same field. Raises ParameterError at what cannot be used, naming its column.

    Examples
    --------
    >>> print(expression("0.8 - 0.1*z")(0, 0, [0, 1]))
    [0.8 0.7]
    """
    if not isinstance(text, str):
        raise ParameterError("text", text, "an expression of x, y, z as text")
    return compiled_field(text, "text")


def distance_from_point(point: Point) -> Field:
    """The distance in mm from a point; raises ParameterError if that isn't three finite numbers.

    Examples
    --------
    >>> distance_from_point((0, 0, 12))(3, 4, [0, 12]).tolist()
    [13.0, 5.0]
    """
    centre = three_numbers("point", point)
    return Field(_distance(centre), call_text("distance_from_point", centre))


def distance_from_axis(point: Point, direction: Point) -> Field:
    """The distance in mm from the line through a point along a direction.

    Raises
    ------
    ParameterError
        If either isn't three finite numbers, or the direction is zero.

    Examples
    --------
    >>> distance_from_axis((0, 0, 0), (0, 0, 1))(3, 4, [0, 12]).tolist()
    [5.0, 5.0]
    """
    through, along = three_numbers("point", point), three_numbers("direction", direction)
    return Field(_distance(through, _unit("direction", along)), call_text("distance_from_axis", through, along))


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

    Examples
    --------
    >>> radial(1.0, 0.5, radius=10)([0, 5, 20], 0, 0).tolist()
    [1.0, 0.75, 0.5]
    """
    values = finite_number("centre_value", centre_value), finite_number("outer_value", outer_value)
    reach, middle = positive_number("radius", radius), three_numbers("centre", centre)
    line = None if axis is None else three_numbers("axis", axis)
    distance = _distance(middle, None if line is None else _unit("axis", line))
    named = {"centre": middle if middle.any() else None, "axis": line}
    text = call_text("radial", *values, reach, **{name: value for name, value in named.items() if value is not None})
    return Field(lambda x, y, z: np.interp(distance(x, y, z), (0, reach), values), text)


def between_planes(first_value: float, second_value: float, first_point: Point, second_point: Point) -> Field:
    """A value that changes evenly from one plane to another parallel to it, and no more outside.

    The planes go through the two points (in mm), perpendicular to the line that joins them.

    Raises
    ------
    ParameterError
        If anything isn't finite, or the points are the same.

    Examples
    --------
    >>> between_planes(0.5, 1.0, (0, 0, 0), (0, 0, 10))(0, 0, [-5, 5, 20]).tolist()
    [0.5, 0.75, 1.0]
    """
    values = finite_number("first_value", first_value), finite_number("second_value", second_value)
    start, end = three_numbers("first_point", first_point), three_numbers("second_point", second_point)
    length = float(np.linalg.norm(end - start))
    if not 0 < length < inf:
        raise ParameterError("second_point", second_point, f"another point than first_point, {shown(start)}")
    unit = (end - start) / length
    text = call_text("between_planes", *values, start, end)
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

    Examples
    --------
    >>> field = sampled(([0, 10], [0, 10], [0, 10]), [[[0, 0], [0, 0]], [[1, 1], [1, 1]]])
    >>> field([0, 5, 20], 0, 0).tolist()
    [0.0, 0.5, 1.0]
    """
    grid = _grid(axes)
    shape = tuple(len(axis) for axis in grid)
    heights = finite_numbers("values", values, f"finite numbers in the shape {shape} of the axes", shape)
    allowed = ("linear", "cubic") if min(shape) >= 4 else ("linear",)
    kind = allowed[-1] if method is None else method
    if kind not in allowed:
        raise ParameterError("method", method, "linear, or cubic with four coordinates or more along every axis")
    try:
        spline = _spline(grid, heights, 3 if kind == "cubic" else 1)
    except ValueError:
        raise ParameterError("axes", axes, "coordinates of less unlike steps, or the method linear") from None
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

    Examples
    --------
    >>> smooth_minimum("x", 5, width=2)([0, 5, 9], 0, 0).tolist()
    [0.0, 4.5, 5.0]
    """
    return _blend("smooth_minimum", smooth_lesser, first, second, width)


def smooth_maximum(first: Field | float | str, second: Field | float | str, width: float) -> Field:
    """The greater of two fields, rounded as by :func:`smooth_minimum`.

    Examples
    --------
    >>> smooth_maximum("x", 5, width=2)([0, 5, 9], 0, 0).tolist()
    [5.0, 5.5, 9.0]
    """
    return _blend("smooth_maximum", smooth_greater, first, second, width)


def _blend(name: str, blend: Callable[..., Floats], first: object, second: object, width: float) -> Field:
    given = [as_field(*named, "one of the two to blend") for named in (("first", first), ("second", second))]
    parts = tuple(part if isinstance(part, Field) else constant(part) for part in given)
    reach = positive_number("width", width)
    return derived(lambda one, other: blend(one, other, reach), parts, call_text(name, *given, reach))


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
    """Distance from a point, or from the line through it."""
    across = np.eye(3) if unit is None else np.eye(3) - np.outer(unit, unit)
    return lambda x, y, z: np.linalg.norm(across @ _offsets(start, x, y, z), axis=0)


def _grid(axes: Sequence[ArrayLike]) -> list[Floats]:
    accepted = "three vectors of increasing finite coordinates in mm, each at least two long"
    if not isinstance(axes, Sequence | np.ndarray) or len(axes) != 3:
        raise ParameterError("axes", axes, accepted)
    grid = [finite_numbers("axes", axis, accepted) for axis in axes]
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


# A cubic cell is two bounding cells long.
_CELL = 2


@dataclass(frozen=True, slots=True)
class PaperUnits:
    """The paper's thickness factor and BC length, in millimetres.

    Attributes
    ----------
    cell_size : float
        In mm.
    thickness : float or Field
        In mm, of places in mm.
    scale_field : Field, optional
        Without unit, of places in mm.
    """

    cell_size: float
    thickness: float | Field
    scale_field: Field | None


@dataclass(frozen=True, slots=True)
class _InUnits:
    """A field of places in BC units, as a function of places in mm; unlike a lambda it can be compared."""

    field: Field
    unit: float
    factor: float

    def __call__(self, x: Floats, y: Floats, z: Floats) -> ArrayLike:
        return self.factor * np.asarray(self.field.function(x / self.unit, y / self.unit, z / self.unit))


def paper_units(
    thickness_factor: float | str | Field | Callable[..., ArrayLike],
    bc_length: float | str | Field | Callable[..., ArrayLike],
    scale: float,
) -> PaperUnits:
    """Translate the paper's description of a specimen.

    Parameters
    ----------
    thickness_factor : float, str, Field or callable
        Whole wall in BC units, of places in BC units before they are moved.
    bc_length : float, str, Field or callable
        Length of a bounding cell in BC units: a place p is moved to b(p) p.
    scale : float
        Millimetres per BC unit.

    Returns
    -------
    PaperUnits

    Raises
    ------
    ParameterError
    """
    scale = positive_number("scale", scale, "a finite number of mm per unit of BC length, above 0")
    thickness = as_field("thickness_factor", thickness_factor, "the wall in BC units")
    length = as_field("bc_length", bc_length, "a length in BC units")
    if isinstance(length, float):
        unit, scale_field = positive_number("bc_length", length, "a length in BC units above 0") * scale, None
    else:
        unit, scale_field = scale, _in_units("bc_length", length, scale, 1.0)
    wall = thickness * scale if isinstance(thickness, float) else _in_units("thickness_factor", thickness, unit, scale)
    return PaperUnits(_CELL * unit, wall, scale_field)


def _in_units(parameter: str, field: Field, unit: float, factor: float) -> Field:
    text = f"({field})(x/{unit:g}, y/{unit:g}, z/{unit:g})"
    text = text if factor == 1 else f"{factor:g}*{text}"
    return Field(_InUnits(field, unit, factor), text, parameter=parameter)

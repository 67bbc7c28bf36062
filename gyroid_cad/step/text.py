"""Entities of a STEP file (ISO 10303-21) as text: numbered, streamed, every number and shared part written once."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.step.digits import decimal_text, integer_text, joined_rows, text_rows
from gyroid_cad.step.geometry import Geometry, Knots, Line, Placed, Spline, SweptSurface, Triple

__all__ = ["StepText", "counting", "escaped", "flag", "quoted", "real", "refs", "step_knots"]

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Coordinates are written to so many places after the point, in mm: half a unit of the last is 5e-10 mm, less than a
# hundredth of the kernel's smallest distance, wherever the part stands.
_DECIMALS = 9
# Of parts below a millimetre, more: they keep as many digits.
_MOST_DECIMALS = 15
# Far from the origin fewer: digits before the point and behind it, one less than a number holds.
_MOST_DIGITS = 15
# Directions are rounding noise about 0 below this.
_DIRECTION_DECIMALS = 15
# Of the steps of knots, relative: rounding only.
_EVEN = 1e-12
# Characters that no string may hold as they are.
_OTHERS = re.compile(r"[^\x20-\x7e]+")
# Bytes of text that are made at once, about.
_BLOCK = 2_000_000


class StepText:
    """The data section of a file, as it is written.

    Parameters
    ----------
    out : BinaryIO
    extent : float
        The largest coordinate in mm, for the number of digits.
    """

    def __init__(self, out: BinaryIO, extent: float) -> None:
        self._out = out
        self._last = 0
        self._once: dict[str, int] = {}
        before = math.floor(math.log10(extent or 1.0))
        self._decimals = min(_DECIMALS + max(0, -before), _MOST_DECIMALS, _MOST_DIGITS - 1 - before)

    def add(self, entity: str) -> int:
        """Write an entity; returns its number."""
        self._last += 1
        self._out.write(f"#{self._last}={entity};\n".encode("ascii"))
        return self._last

    def table(self, *columns: str | list[str] | NDArray[Any]) -> Integers:
        """Write entities that are alike, a row each; returns their numbers.

        Parameters
        ----------
        *columns
            A text that all have; a list of texts; or an array whose first axis is the row: whole numbers are
            references, in nested brackets by its other axes, truth values flags, and others coordinates in mm.
        """
        count = next(len(column) for column in columns if not isinstance(column, str))
        made = np.arange(self._last + 1, self._last + 1 + count)
        self._last += count
        # A reference takes about ten bytes.
        width = 10 * sum(column[:1].size if isinstance(column, np.ndarray) else 2 for column in columns) + 1
        for rows in (slice(at, at + _BLOCK // width + 1) for at in range(0, count, _BLOCK // width + 1)):
            numbers = made[rows]
            shown = [column if isinstance(column, str) else self._shown(column[rows]) for column in columns]
            texts = [_constant("#"), integer_text(numbers), _constant("="), *map(_constant, shown), _constant(";\n")]
            self._out.write(joined_rows(*(np.broadcast_to(text, (len(numbers), text.shape[-1])) for text in texts)))
        return made

    def _shown(self, column: list[str] | NDArray[Any]) -> Bytes:
        if isinstance(column, list):
            return text_rows(column)
        if column.dtype == np.bool_:
            return np.asarray(text_rows([flag(False), flag(True)])[column.astype(int)])
        if column.dtype.kind == "f":
            return decimal_text(column, self._decimals)
        return _references(column)

    def once(self, entity: str) -> int:
        """The number of an entity, written if it has not been so far."""
        number = self._once.get(entity)
        if number is None:
            number = self._once[entity] = self.add(entity)
        return number

    def point(self, place: Triple) -> int:
        """A point that others may refer to as well."""
        x, y, z = (real(round(part, self._decimals) + 0.0) for part in place)
        return self.once(f"CARTESIAN_POINT('',({x},{y},{z}))")

    def points(self, places: Floats) -> Integers:
        """Numbers of points.

        Parameters
        ----------
        places : ndarray, shape (n, 3)
        """
        x, y, z = places.T
        return self.table("CARTESIAN_POINT('',(", x, ",", y, ",", z, "))")

    def shared_points(self, places: Floats) -> Integers:
        """Numbers of points, of which those at one place are one; shape (n,)."""
        values, coordinates = np.unique(np.round(places, self._decimals) + 0.0, return_inverse=True)
        kept, which = _distinct_rows(coordinates.reshape(-1, 3), len(values))
        return self.points(values[kept])[which]

    def direction(self, way: Triple) -> int:
        x, y, z = (real(round(part, _DIRECTION_DECIMALS) + 0.0) for part in way)
        return self.once(f"DIRECTION('',({x},{y},{z}))")

    def frame(self, origin: Triple, axis: Triple = (0.0, 0.0, 1.0), along: Triple = (1.0, 0.0, 0.0)) -> int:
        """An AXIS2_PLACEMENT_3D."""
        numbers = self.point(origin), self.direction(axis), self.direction(along)
        return self.once(f"AXIS2_PLACEMENT_3D('',{','.join(f'#{number}' for number in numbers)})")

    def geometries(self, found: Sequence[Geometry]) -> Integers:
        """Write curves and surfaces; returns their numbers."""
        curves = iter(self.geometries([one.curve for one in found if isinstance(one, SweptSurface)]) if found else ())
        made = np.zeros(len(found), dtype=np.int64)
        splines = [index for index, one in enumerate(found) if isinstance(one, Spline)]
        made[splines] = self._splines([one for one in found if isinstance(one, Spline)])
        for index, one in enumerate(found):
            if isinstance(one, Placed):
                sizes = "".join(f",{real(size)}" for size in one.sizes)
                made[index] = self.once(f"{one.kind}('',#{self.frame(one.origin, one.axis, one.along)}{sizes})")
            elif isinstance(one, Line):
                made[index] = self.once(f"LINE('',#{self.point(one.origin)},#{self._vector(one.direction)})")
            elif isinstance(one, SweptSurface):
                made[index] = self._swept(one, next(curves))
        return made

    def _splines(self, splines: Sequence[Spline]) -> Integers:
        made = np.zeros(len(splines), dtype=np.int64)
        if not splines:
            return made
        poles = self.shared_points(np.concatenate([one.poles.reshape(-1, 3) for one in splines]))
        ends = np.cumsum([0, *(one.poles.size // 3 for one in splines)]).tolist()
        alike: dict[tuple[Any, ...], list[int]] = {}
        for index, one in enumerate(splines):
            weights = None if one.weights is None else one.weights.tobytes()
            alike.setdefault((one.degrees, one.poles.shape, one.knots, one.closed, weights), []).append(index)
        for indices in alike.values():
            one = splines[indices[0]]
            places = np.array([ends[index] for index in indices])[:, np.newaxis] + np.arange(one.poles.size // 3)
            nets = poles[places].reshape(-1, *one.poles.shape[:-1])
            made[indices] = self.spline_table(one.degrees, nets, one.knots, one.closed, one.weights)
        return made

    def spline_table(
        self,
        degrees: tuple[int, ...],
        nets: Integers,
        knots: tuple[Knots, ...],
        closed: tuple[bool, ...],
        weights: Floats | None = None,
        counted: bool = True,
    ) -> Integers:
        """Write splines that differ by their control points alone.

        Parameters
        ----------
        degrees, knots, closed : tuple
            As of :class:`~gyroid_cad.step.geometry.Spline`.
        nets : ndarray of int, shape (k, n) or (k, n, m)
            Numbers of the control points.
        weights : ndarray, shape (n,) or (n, m), optional
            None where they are polynomial.
        counted : bool
            Whether a curve's knots become 0, 1, 2 and so on where they are evenly spaced (:func:`counting`).

        Returns
        -------
        ndarray of int, shape (k,)
        """
        knots = _counted(knots) if counted else knots
        kind = "CURVE" if len(degrees) == 1 else "SURFACE"
        start = f"{_listed(degrees)},"
        end = f",.UNSPECIFIED.,{','.join(map(flag, closed))},.F."
        if weights is None:
            start, end = f"B_SPLINE_{kind}_WITH_KNOTS('',{start}", f"{end},{_knots(knots)})"
        else:
            # The parts of a complex entity come in the order of the alphabet.
            before, after = ("CURVE()", "") if kind == "CURVE" else ("", "SURFACE()")
            start = f"(BOUNDED_{kind}()B_SPLINE_{kind}({start}"
            end += f")B_SPLINE_{kind}_WITH_KNOTS({_knots(knots)}){before}GEOMETRIC_REPRESENTATION_ITEM()"
            end += f"RATIONAL_B_SPLINE_{kind}({_nested(weights.tolist())})REPRESENTATION_ITEM(''){after})"
        return self.table(start, nets, end)

    def _vector(self, way: Triple) -> int:
        return self.once(f"VECTOR('',#{self.direction(way)},1.)")

    def _swept(self, swept: SweptSurface, curve: int) -> int:
        if swept.origin is None:
            return self.add(f"SURFACE_OF_LINEAR_EXTRUSION('',#{curve},#{self._vector(swept.direction)})")
        axis = self.once(f"AXIS1_PLACEMENT('',#{self.point(swept.origin)},#{self.direction(swept.direction)})")
        return self.add(f"SURFACE_OF_REVOLUTION('',#{curve},#{axis})")


def real(value: float) -> str:
    """A number as ISO 10303-21 wants it: always with a point, an exponent in capitals.

    Examples
    --------
    >>> real(2.0), real(0.1), real(-1e-7), real(1.5e20)
    ('2.', '0.1', '-1.E-07', '1.5E+20')
    """
    text = repr(value)
    if "e" in text:
        mantissa, _, exponent = text.partition("e")
        return f"{mantissa}{'' if '.' in mantissa else '.'}E{exponent}"
    return text.removesuffix("0") if text.endswith(".0") else text


def quoted(text: str) -> str:
    """A string as ISO 10303-21 wants it.

    Examples
    --------
    >>> print(quoted("Schoen's surface"))
    'Schoen''s surface'
    >>> print(quoted("Müller"))
    'M\\X2\\00FC\\X0\\ller'
    """
    return "'" + escaped(text.replace("\\", "\\\\").replace("'", "''")) + "'"


def escaped(text: str) -> str:
    """Text in the characters that a file has (ISO 10303-21, 6.4.3): others by their numbers, in runs.

    Examples
    --------
    >>> print(escaped("Löß"))
    L\\X2\\00F600DF\\X0\\
    """
    return _OTHERS.sub(lambda run: _numbered(run.group()), text)


def _numbered(run: str) -> str:
    wide = len(run.encode("utf-16-be")) > 2 * len(run)
    return f"\\X{4 if wide else 2}\\{run.encode('utf-32-be' if wide else 'utf-16-be').hex().upper()}\\X0\\"


def refs(numbers: Iterable[int]) -> str:
    """References to entities, in brackets.

    Examples
    --------
    >>> refs([3, 5])
    '(#3,#5)'
    """
    return "(#" + ",#".join(map(str, numbers)) + ")"


def flag(value: bool) -> str:
    """Return true or false as ISO 10303-21 has them.

    Examples
    --------
    >>> flag(True)
    '.T.'
    """
    return ".T." if value else ".F."


def _distinct_rows(rows: Integers, count: int) -> tuple[Integers, Integers]:
    """Rows of three numbers below ``count``, each once in the order they come in, and which of them each row is."""
    pairs, pair = np.unique(rows[:, 0] * count + rows[:, 1], return_inverse=True)
    del pairs
    _, first, which = np.unique(pair * count + rows[:, 2], return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rows[first[order]], rank[which]


def step_knots(vector: Floats) -> Knots:
    """Distinct knots and their multiplicities.

    Examples
    --------
    >>> step_knots(np.array([-1.0, -1.0, 1.0, 1.0]))
    ((-1.0, 1.0), (2, 2))
    """
    values, counts = np.unique(vector, return_counts=True)
    return tuple(values.tolist()), tuple(counts.tolist())


def _listed(numbers: Iterable[int]) -> str:
    return ",".join(map(str, numbers))


@lru_cache(maxsize=256)
def _knots(knots: tuple[Knots, ...]) -> str:
    multiplicities = [f"({_listed(counts)})" for _, counts in knots]
    values = [_nested(list(some)) for some, _ in knots]
    return ",".join([*multiplicities, *values, ".UNSPECIFIED."])


def counting(values: Sequence[float]) -> tuple[float, float]:
    """Parameter where a curve's knots begin to count, and its step from each to the next; 0 and 1 if they are uneven.

    Knots that are evenly spaced are written as 0, 1, 2 and so on: the same spline, in a tenth of the digits.

    Examples
    --------
    >>> counting((-1.0, 0.0, 1.0)), counting((-1.0, -0.5, 1.0))
    ((-1.0, 1.0), (0.0, 1.0))
    >>> counting((0.25, 0.75))
    (0.25, 0.5)
    """
    steps = np.diff(values)
    even = bool(np.ptp(steps) <= _EVEN * steps.mean())
    return (float(values[0]), float(steps.mean())) if even else (0.0, 1.0)


def _counted(knots: tuple[Knots, ...]) -> tuple[Knots, ...]:
    # By the square from -1 to 1 a lattice's faces are known again in a file.
    if len(knots) > 1:
        return knots
    ((values, counts),) = knots
    even = counting(values) != (0.0, 1.0)
    return ((tuple(map(float, range(len(values)))) if even else values, counts),)


def _nested(values: list[float] | list[list[float]]) -> str:
    parts = (real(value) if isinstance(value, float) else _nested(value) for value in values)
    return "(" + ",".join(parts) + ")"


def _constant(text: str | Bytes) -> Bytes:
    """One row of bytes of a text; rows stay what they are."""
    return text_rows([text]) if isinstance(text, str) else text


def _references(numbers: Integers) -> Bytes:
    """Rows of references, in nested brackets by all axes but the first."""
    digits = integer_text(numbers)
    shown = np.concatenate([np.broadcast_to(text_rows(["#"]), (*numbers.shape, 1)), digits], axis=-1)
    for _ in numbers.shape[1:]:
        comma = np.full((*shown.shape[:-1], 1), ord(","), dtype=np.uint8)
        comma[..., -1, :] = ord(")")
        shown = np.concatenate([shown, comma], axis=-1)
        shown = shown.reshape(*shown.shape[:-2], -1)
        shown = np.concatenate([np.full((*shown.shape[:-1], 1), ord("("), dtype=np.uint8), shown], axis=-1)
    return shown

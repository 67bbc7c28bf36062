"""Entities of a STEP file (ISO 10303-21) as text: numbered, streamed, every number and shared part written once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import count, pairwise
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.kernel.step_geometry import Geometry, Knots, Line, Placed, Spline, SweptSurface, Triple

__all__ = ["StepText", "flag", "quoted", "real", "refs"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Coordinates are written to so many places after the point, in mm: half a unit of the last is 5e-11 mm, less than a
# thousandth of the kernel's smallest distance, wherever the part stands.
_DECIMALS = 10
# Of parts below a millimetre, more: they keep as many digits.
_MOST_DECIMALS = 15
# Directions are rounding noise about 0 below this.
_DIRECTION_DECIMALS = 15
# Points whose text is made at once.
_BLOCK = 20_000
_POINT = "#%d=CARTESIAN_POINT('',(%s,%s,%s));\n"


class StepText:
    """The data section of a file, as it is written.

    Parameters
    ----------
    out : TextIO
    extent : float
        The largest coordinate in mm, for the number of digits.
    """

    def __init__(self, out: TextIO, extent: float) -> None:
        self._out = out
        self._last = 0
        self._once: dict[str, int] = {}
        self._decimals = min(_DECIMALS + max(0, -math.floor(math.log10(extent or 1.0))), _MOST_DECIMALS)

    def add(self, entity: str) -> int:
        """Write an entity; returns its number."""
        self._last += 1
        self._out.write(f"#{self._last}={entity};\n")
        return self._last

    def add_all(self, entities: Iterable[str]) -> range:
        """Write entities; returns their numbers."""
        first = self._last + 1
        self._out.writelines(self._numbered(entities))
        return range(first, self._last + 1)

    def _numbered(self, entities: Iterable[str]) -> Iterator[str]:
        for entity in entities:
            self._last += 1
            yield f"#{self._last}={entity};\n"

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

    def points(self, places: Floats, shared: bool) -> list[int]:
        """Numbers of points.

        Parameters
        ----------
        places : ndarray, shape (n, 3)
        shared : bool
            Whether points at one place are one.
        """
        values, coordinates = np.unique(np.round(places, self._decimals) + 0.0, return_inverse=True)
        coordinates = coordinates.reshape(-1, 3)
        kept, which = _distinct_rows(coordinates, len(values)) if shared else (coordinates, np.arange(len(places)))
        texts, first = [real(value) for value in values.tolist()], self._last + 1
        self._last += len(kept)
        for start in range(0, len(kept), _BLOCK):
            x, y, z = (map(texts.__getitem__, column.tolist()) for column in kept[start : start + _BLOCK].T)
            self._out.writelines(map(_POINT.__mod__, zip(count(first + start), x, y, z, strict=False)))
        return (which + first).tolist() if len(places) else []

    def direction(self, way: Triple) -> int:
        x, y, z = (real(round(part, _DIRECTION_DECIMALS) + 0.0) for part in way)
        return self.once(f"DIRECTION('',({x},{y},{z}))")

    def frame(self, origin: Triple, axis: Triple = (0.0, 0.0, 1.0), along: Triple = (1.0, 0.0, 0.0)) -> int:
        """An AXIS2_PLACEMENT_3D."""
        numbers = self.point(origin), self.direction(axis), self.direction(along)
        return self.once(f"AXIS2_PLACEMENT_3D('',{','.join(f'#{number}' for number in numbers)})")

    def geometries(self, found: Sequence[Geometry]) -> list[int]:
        """Write curves and surfaces; returns their numbers."""
        curves = iter(self.geometries([one.curve for one in found if isinstance(one, SweptSurface)]) if found else ())
        poles = [one.poles.reshape(-1, 3) for one in found if isinstance(one, Spline)]
        numbers = self.points(np.concatenate(poles), shared=True) if poles else []
        ends = np.cumsum([0, *map(len, poles)]).tolist()
        splines = pairwise(ends)
        made = []
        for one in found:
            if isinstance(one, Spline):
                start, end = next(splines)
                made.append(self.add(_spline(one, tuple(numbers[start:end]))))
            elif isinstance(one, Placed):
                sizes = "".join(f",{real(size)}" for size in one.sizes)
                made.append(self.once(f"{one.kind}('',#{self.frame(one.origin, one.axis, one.along)}{sizes})"))
            elif isinstance(one, Line):
                made.append(self.once(f"LINE('',#{self.point(one.origin)},#{self._vector(one.direction)})"))
            else:
                made.append(self._swept(one, next(curves)))
        return made

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
    """
    return "'" + text.replace("\\", "\\\\").replace("'", "''") + "'"


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


def _spline(spline: Spline, numbers: tuple[int, ...]) -> str:
    kind = "CURVE" if len(spline.degrees) == 1 else "SURFACE"
    degrees = ",".join(map(str, spline.degrees))
    body = f"{degrees},{_net(spline.poles.shape[:-1]) % numbers},.UNSPECIFIED.,{','.join(map(flag, spline.closed))},.F."
    knots = _knots(spline.knots)
    if spline.weights is None:
        return f"B_SPLINE_{kind}_WITH_KNOTS('',{body},{knots})"
    weights = _nested(spline.weights.tolist())
    return (
        f"(BOUNDED_{kind}()B_SPLINE_{kind}({body})B_SPLINE_{kind}_WITH_KNOTS({knots})"
        f"{'CURVE()' if kind == 'CURVE' else ''}GEOMETRIC_REPRESENTATION_ITEM()"
        f"RATIONAL_B_SPLINE_{kind}({weights})REPRESENTATION_ITEM(''){'SURFACE()' if kind == 'SURFACE' else ''})"
    )


@lru_cache(maxsize=256)
def _net(shape: tuple[int, ...]) -> str:
    """Places for references, in brackets by rows."""
    inner = "(" + ",".join(["#%d"] * shape[-1]) + ")"
    return inner if len(shape) == 1 else "(" + ",".join([inner] * shape[0]) + ")"


@lru_cache(maxsize=256)
def _knots(knots: tuple[Knots, ...]) -> str:
    multiplicities = ["(" + ",".join(map(str, counts)) + ")" for _, counts in knots]
    values = [_nested(list(some)) for some, _ in knots]
    return ",".join([*multiplicities, *values, ".UNSPECIFIED."])


def _nested(values: list[float] | list[list[float]]) -> str:
    parts = (real(value) if isinstance(value, float) else _nested(value) for value in values)
    return "(" + ",".join(parts) + ")"

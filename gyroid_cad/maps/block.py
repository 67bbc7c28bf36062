"""The maps that have a name: cylinder, sphere, twist and bend of a block of cells."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache
from math import inf, pi, radians
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.checks import finite_number, positive_number
from gyroid_cad.errors import ParameterError
from gyroid_cad.maps.space import BlockMap, Size, SpaceMap

__all__ = ["MAPS", "Bend", "Cylinder", "Sphere", "Twist", "as_map", "parse_map", "space_over"]

Floats = NDArray[np.float64]

FULL_TURN = 360.0
# In mm, 10 km; and in degrees. Beyond, a place on the map has too few digits for its neighbours to be told from it.
_LARGEST_RADIUS, _MOST_TWIST = 1e7, 36_000.0
# A block within a thousandth of the circumference is stretched to close: a radius rounded to a few digits fits.
CLOSING_TOLERANCE = 1e-3


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Wrap the block round the z axis: x runs round it, y along it, z outwards.

    The block's underside, z = 0, lies on the cylinder of the given radius.

    Parameters
    ----------
    radius : float
        In mm.
    angle : float, optional
        In degrees, above 0 to 360: what the block's whole x extent takes up. If left out, lengths along x are
        kept on the cylinder of that radius. A block that takes up the full turn is joined to itself.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> from gyroid_cad.maps import Cylinder
    >>> ring = Lattice((8, 1, 1), 10, thickness=0.8, map=Cylinder(radius=16, angle=360))
    >>> str(ring.map)
    'cylinder:radius=16.0,angle=360.0'
    """

    radius: float
    angle: float | None = None

    def __post_init__(self) -> None:
        _check_round(self)

    def over(self, size: Size) -> SpaceMap:
        """The wrap of a block of this size, closed if it takes up the full turn.

        Raises
        ------
        ParameterError
            If the block is longer than the circumference.
        """
        rate, closed = _round(self, size[0])
        radius = self.radius

        def function(x: Floats, y: Floats, z: Floats) -> Sequence[ArrayLike]:
            return (radius + z) * np.cos(rate * x), (radius + z) * np.sin(rate * x), y

        def jacobian(x: Floats, y: Floats, z: Floats) -> Sequence[Sequence[ArrayLike]]:
            cosine, sine, along = np.cos(rate * x), np.sin(rate * x), rate * (radius + z)
            return (-along * sine, 0, cosine), (along * cosine, 0, sine), (0, 1, 0)

        low, high = _one_turn(size[0], rate, closed)
        domain = (low, -inf, -radius), (high, inf, inf)
        return SpaceMap(function, jacobian, (closed, False, False), str(self), domain)

    def __str__(self) -> str:
        return _spelled(self)


@dataclass(frozen=True, slots=True)
class Sphere:
    """Lay the block on a sphere about the origin: x runs east, y north, z outwards.

    The block's underside, z = 0, lies on the sphere of the given radius; the middle of its y extent is on the
    equator. Lengths along the equator and along meridians are kept on that sphere.

    Parameters
    ----------
    radius : float
        In mm.
    angle : float, optional
        In degrees of longitude, above 0 to 360: what the block's whole x extent takes up, as of a cylinder.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> from gyroid_cad.maps import Sphere
    >>> cap = Lattice((2, 2, 1), 10, thickness=0.8, map=Sphere(radius=30))
    >>> str(cap.map)
    'sphere:radius=30.0'
    """

    radius: float
    angle: float | None = None

    def __post_init__(self) -> None:
        _check_round(self)

    def over(self, size: Size) -> SpaceMap:
        """The patch of a sphere under a block of this size, closed if it takes up the whole equator.

        Raises
        ------
        ParameterError
            If the block is longer than the equator.
        """
        rate, closed = _round(self, size[0])
        radius, middle = self.radius, size[1] / 2

        def function(x: Floats, y: Floats, z: Floats) -> Sequence[ArrayLike]:
            longitude, latitude, out = rate * x, (y - middle) / radius, radius + z
            level = out * np.cos(latitude)
            return level * np.cos(longitude), level * np.sin(longitude), out * np.sin(latitude)

        def jacobian(x: Floats, y: Floats, z: Floats) -> Sequence[Sequence[ArrayLike]]:
            out, latitude = radius + z, (y - middle) / radius
            east_x, east_y = np.cos(rate * x), np.sin(rate * x)
            north, level = np.sin(latitude), np.cos(latitude)
            round_rate, rise = rate * out * level, out / radius
            return (
                (-round_rate * east_y, -rise * north * east_x, level * east_x),
                (round_rate * east_x, -rise * north * east_y, level * east_y),
                (0, rise * level, north),
            )

        (low, high), quarter = _one_turn(size[0], rate, closed), pi / 2 * radius
        domain = (low, middle - quarter, -radius), (high, middle + quarter, inf)
        return SpaceMap(function, jacobian, (closed, False, False), str(self), domain)

    def __str__(self) -> str:
        return _spelled(self)


@dataclass(frozen=True, slots=True)
class Twist:
    """Turn the block about an upright axis, evenly with height.

    Parameters
    ----------
    angle : float
        In degrees, from the block's bottom to its top; a hundred turns at most.
    x, y : float, optional
        Where the axis stands, in mm; in the block's middle if left out.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> from gyroid_cad.maps import Twist
    >>> Lattice((1, 1, 2), 10, thickness=0.8, map=Twist(angle=30)) == Lattice((1, 1, 2), 10, 0.8, map="twist:angle=30")
    True
    >>> str(Twist(angle=30, x=0, y=0))
    'twist:angle=30.0,x=0.0,y=0.0'
    """

    angle: float
    x: float | None = None
    y: float | None = None

    def __post_init__(self) -> None:
        for name in ("x", "y"):
            if (place := getattr(self, name)) is not None:
                object.__setattr__(self, name, _place_of_axis(name, place))
        angle = finite_number("angle", self.angle, "a finite number of degrees")
        if abs(angle) > _MOST_TWIST:
            raise ParameterError("angle", angle, f"-{_MOST_TWIST:,.0f} to {_MOST_TWIST:,.0f} degrees, a hundred turns")
        object.__setattr__(self, "angle", angle)

    def over(self, size: Size) -> SpaceMap:
        """The twist of a block of this size."""
        middle_x, middle_y = (
            extent / 2 if place is None else place for extent, place in zip(size, (self.x, self.y), strict=False)
        )
        rate = radians(self.angle) / size[2]

        def function(x: Floats, y: Floats, z: Floats) -> Sequence[ArrayLike]:
            cosine, sine, x, y = np.cos(rate * z), np.sin(rate * z), x - middle_x, y - middle_y
            return middle_x + cosine * x - sine * y, middle_y + sine * x + cosine * y, z

        def jacobian(x: Floats, y: Floats, z: Floats) -> Sequence[Sequence[ArrayLike]]:
            cosine, sine, x, y = np.cos(rate * z), np.sin(rate * z), x - middle_x, y - middle_y
            return (
                (cosine, -sine, -rate * (sine * x + cosine * y)),
                (sine, cosine, rate * (cosine * x - sine * y)),
                (0, 0, 1),
            )

        return SpaceMap(function, jacobian, text=str(self))

    def __str__(self) -> str:
        return _spelled(self)


@dataclass(frozen=True, slots=True)
class Bend:
    """Bend the block about an axis along y, its ends up; its middle layer keeps its length.

    Parameters
    ----------
    angle : float
        In degrees, not 0, from -360 to 360: between the block's two ends along x. Negative bends the ends down.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> from gyroid_cad.maps import Bend
    >>> bent = Lattice((2, 1, 1), 10, thickness=0.8, map=Bend(angle=40))
    >>> bent.uniform
    False
    """

    angle: float

    def __post_init__(self) -> None:
        angle = finite_number("angle", self.angle, "a finite number of degrees")
        if not 0 < abs(angle) <= FULL_TURN:
            raise ParameterError("angle", angle, "-360 to 360 degrees, not 0")
        object.__setattr__(self, "angle", angle)

    def over(self, size: Size) -> SpaceMap:
        """The bend of a block of this size."""
        middle, level = size[0] / 2, size[2] / 2
        radius = size[0] / radians(self.angle)

        def function(x: Floats, y: Floats, z: Floats) -> Sequence[ArrayLike]:
            turned, height = (x - middle) / radius, z - level
            # radius (1 - cos) without the cancellation of a large radius.
            rise = 2 * radius * np.sin(turned / 2) ** 2
            return middle + (radius - height) * np.sin(turned), y, level + rise + height * np.cos(turned)

        def jacobian(x: Floats, y: Floats, z: Floats) -> Sequence[Sequence[ArrayLike]]:
            turned, stretch = (x - middle) / radius, 1 - (z - level) / radius
            cosine, sine = np.cos(turned), np.sin(turned)
            return (stretch * cosine, 0, -sine), (0, 1, 0), (stretch * sine, 0, cosine)

        half, sides = pi * abs(radius), (-inf, level + radius) if radius > 0 else (level + radius, inf)
        domain = (middle - half, -inf, sides[0]), (middle + half, inf, sides[1])
        return SpaceMap(function, jacobian, (abs(self.angle) == FULL_TURN, False, False), str(self), domain)

    def __str__(self) -> str:
        return _spelled(self)


MAPS: Mapping[str, Callable[..., BlockMap]] = MappingProxyType(
    {"cylinder": Cylinder, "sphere": Sphere, "twist": Twist, "bend": Bend}
)


def parse_map(text: str) -> BlockMap:
    """A map from its spelling on the command line, such as "cylinder:radius=30,angle=360".

    Raises
    ------
    ParameterError
    """
    accepted = "one of " + ", ".join(f"{name}:{'=...,'.join(_parameters(kind))}=..." for name, kind in MAPS.items())
    name, _, rest = text.partition(":")
    kind = MAPS.get(name.strip())
    if kind is None:
        raise ParameterError("map", text, accepted)
    given: dict[str, float] = {}
    for part in filter(None, (part.strip() for part in rest.split(","))):
        key, _, number = (piece.strip() for piece in part.partition("="))
        if key not in _parameters(kind) or key in given:
            raise ParameterError("map", text, f"{' and '.join(_parameters(kind))} of {name}, each once, not {part!r}")
        try:
            given[key] = float(number)
        except ValueError:
            raise ParameterError("map", text, f"a number for {key}, not {number!r}") from None
    try:
        return kind(**given)
    except ParameterError as problem:
        raise ParameterError("map", text, f"{problem.parameter}: {problem.accepted}") from None
    except TypeError:
        raise ParameterError("map", text, f"{_parameters(kind)[0]} of {name} to be given") from None


def as_map(value: object) -> BlockMap:
    """A map from what a user gives for one: a map, its spelling, or a function of (x, y, z).

    Raises
    ------
    ParameterError
    """
    if isinstance(value, BlockMap) and not isinstance(value, type):
        return value
    if isinstance(value, str):
        return parse_map(value)
    if callable(value) and not isinstance(value, type):
        return SpaceMap(value)
    raise ParameterError("map", value, f"a SpaceMap, {', '.join(MAPS)}, or a function of x, y, z")


def space_over(block_map: BlockMap, cells: tuple[int, int, int], cell_size: float) -> SpaceMap:
    """The map for a block of cells; of equal maps and blocks the same object, so that equal lattices are built once.

    Raises
    ------
    ParameterError
        If it does not suit the block.
    """
    x, y, z = (n * cell_size for n in cells)
    try:
        hash(block_map)
    except TypeError:
        space = block_map.over((x, y, z))
    else:
        space = _remembered(block_map, (x, y, z))  # type: ignore[arg-type]
    if not isinstance(space, SpaceMap):
        raise ParameterError("map", block_map, f"a map whose `over` gives a SpaceMap, not {type(space).__name__}")
    return space


@lru_cache(maxsize=16)
def _remembered(block_map: BlockMap, size: Size) -> SpaceMap:
    return block_map.over(size)


def _parameters(kind: Callable[..., BlockMap]) -> list[str]:
    return [parameter.name for parameter in fields(kind)]  # type: ignore[arg-type]


def _spelled(block_map: Any) -> str:
    """As :func:`parse_map` reads it."""
    name = type(block_map).__name__.lower()
    given = {key: getattr(block_map, key) for key in _parameters(type(block_map))}
    return f"{name}:" + ",".join(f"{key}={value!r}" for key, value in given.items() if value is not None)


def _round(block_map: Cylinder | Sphere, length: float) -> tuple[float, bool]:
    """Radians a mm that a block of this length turns by, and whether it closes."""
    if block_map.angle is not None:
        return radians(block_map.angle) / length, block_map.angle == FULL_TURN
    turns = length / (2 * pi * block_map.radius)
    if abs(turns - 1) <= CLOSING_TOLERANCE:
        return 2 * pi / length, True
    if turns > 1:
        raise ParameterError(
            "map",
            str(block_map),
            f"a radius of at least {length / (2 * pi):.6g} mm, round which the block's {length:.6g} mm close, "
            f"or angle={FULL_TURN:g} to close them round this one",
        )
    return 1 / block_map.radius, False


def _one_turn(length: float, rate: float, closed: bool) -> tuple[float, float]:
    """Ends of what goes round once, as far beyond the one end of a block as beyond the other, in mm."""
    half = length / 2 if closed else pi / rate
    return length / 2 - half, length / 2 + half


def _place_of_axis(name: str, value: object) -> float:
    accepted = f"-{_LARGEST_RADIUS:,.0f} to {_LARGEST_RADIUS:,.0f} mm"
    number = finite_number(name, value, accepted)
    if abs(number) > _LARGEST_RADIUS:
        raise ParameterError(name, number, accepted)
    return number


def _check_round(block_map: Cylinder | Sphere) -> None:
    accepted = f"a finite number of mm above 0, at most {_LARGEST_RADIUS:,.0f}"
    radius = positive_number("radius", block_map.radius, accepted)
    if radius > _LARGEST_RADIUS:
        raise ParameterError("radius", radius, accepted)
    object.__setattr__(block_map, "radius", radius)
    if block_map.angle is not None:
        object.__setattr__(block_map, "angle", _turn(block_map.angle))


def _turn(angle: object) -> float:
    accepted = f"degrees above 0, at most {FULL_TURN:g}"
    number = positive_number("angle", angle, accepted)
    if number > FULL_TURN:
        raise ParameterError("angle", angle, accepted)
    return number

"""Regions of space between offsets of the mid-surface, with which a part may be filled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import positive_number
from gyroid_cad.common.choices import KINDS, Kind
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field, FieldLike, as_field
from gyroid_cad.surface.families import TubeLaw
from gyroid_cad.wall.grading import THINNEST_WALL
from gyroid_cad.wall.limits import network_density, require_density, require_one, require_thickness, wall_beside_network

__all__ = [
    "BODIES",
    "CHANNELS",
    "FLUID_A",
    "FLUID_B",
    "NETWORK_A",
    "NETWORK_B",
    "SHEET",
    "SKIN",
    "SURFACE",
    "WALL",
    "Region",
    "Regions",
    "checked_skin",
    "grams_of",
    "kind_beside",
    "regions_of",
]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Of materials, in g/cm3: osmium has 22.6, and steel in kg/m3 7850.
_DENSEST = 100.0

SHEET, NETWORK_A, NETWORK_B, CHANNELS, BODIES, SURFACE = KINDS
# Of bodies that share their faces.
WALL, FLUID_A, FLUID_B, SKIN = "wall", "fluid-a", "fluid-b", "skin"


@dataclass(frozen=True, slots=True)
class Region:
    """Space between two offsets of the mid-surface.

    Attributes
    ----------
    name : str
    lowest, highest : float, optional
        In half walls along the common normal; None where there is no end.
    surface : bool
        Whether it is not space at all, but the mid-surface alone.
    fluid : bool
        Whether it is what the wall leaves: then a skin bounds it, and is no part of it.
    """

    name: str
    lowest: float | None
    highest: float | None
    surface: bool = False
    fluid: bool = False

    def contains(self, offsets: Floats, half_thickness: Floats) -> Booleans:
        """Mask of the offsets, in mm, that lie in the region where the wall's half thickness is so many mm."""
        low = -np.inf if self.lowest is None else self.lowest * half_thickness
        high = np.inf if self.highest is None else self.highest * half_thickness
        return np.asarray((offsets > low) & (offsets < high))

    @property
    def end(self) -> float:
        """End of a network, in half walls from the mid-surface: below 0 it has the wall, or some of it, too."""
        return -(self.highest or 0.0) if self.lowest is None else self.lowest

    @property
    def sides(self) -> list[tuple[int, bool]]:
        """The wall's faces, 0 or 1, that bound the region, each with whether it runs against the common normal."""
        if self.surface:
            return [(1, False)]
        below = [] if self.lowest is None else [(int(self.lowest >= 0), True)]
        return below + ([] if self.highest is None else [(int(self.highest > 0), False)])


@dataclass(frozen=True, slots=True)
class Regions:
    """The regions of a kind, and the wall between or round them.

    Attributes
    ----------
    regions : tuple of Region
    thickness, density : float or Field, optional
        Of the wall, one of the two: whole wall in mm, 0 where the two faces of it are one; or its volume fraction.
    """

    regions: tuple[Region, ...]
    thickness: float | Field | None = None
    density: float | Field | None = None

    @property
    def uniform(self) -> bool:
        """True where the wall is the same everywhere."""
        return not isinstance(self.thickness, Field | None)

    def at_least(self, thickness: float) -> Regions:
        """The same regions, a uniform wall of so many mm where theirs is thinner."""
        thin = isinstance(self.thickness, float) and self.thickness < thickness
        return replace(self, thickness=thickness) if thin else self


def regions_of(
    kind: Kind, cell_size: float, thickness: FieldLike | None, density: FieldLike | None, tube: TubeLaw
) -> Regions:
    """The regions that a kind is made of.

    Parameters
    ----------
    kind : {"sheet", "network-a", "network-b", "channels", "bodies", "surface"}
    cell_size : float
        In mm.
    thickness, density : number or field, optional
        Exactly one, but none for the bare surface.
    tube : TubeLaw
        Of the surface.

    Raises
    ------
    ParameterError
    """
    if kind not in KINDS:
        raise ParameterError("kind", kind, " or ".join(KINDS))
    if kind == SURFACE:
        for name, value in (("thickness", thickness), ("density", density)):
            if value is not None:
                raise ParameterError(name, value, "none: the bare surface has no wall")
        return Regions((Region(SURFACE, None, None, surface=True),), thickness=0.0)
    require_one(thickness, density)
    if kind in (NETWORK_A, NETWORK_B):
        return _network(kind, cell_size, network_density(density, thickness, tube), tube)
    names = ("channel-a", "channel-b") if kind == CHANNELS else (FLUID_A, FLUID_B)
    fluids = Region(names[0], 1.0, None, fluid=True), Region(names[1], None, -1.0, fluid=True)
    wall = Region(WALL if kind == BODIES else SHEET, -1.0, 1.0)
    regions = fluids if kind == CHANNELS else (wall, *fluids) if kind == BODIES else (wall,)
    return _wall(regions, cell_size, thickness, density, tube)


def _wall(
    regions: tuple[Region, ...],
    cell_size: float,
    thickness: FieldLike | None,
    density: FieldLike | None,
    tube: TubeLaw,
) -> Regions:
    if thickness is not None:
        wall = as_field("thickness", thickness, "a length in mm")
        if isinstance(wall, float):
            require_thickness(wall, cell_size, tube)
        return Regions(regions, thickness=wall)
    fraction = as_field("density", density, "a volume fraction")
    if isinstance(fraction, float):
        require_density(fraction, cell_size, tube)
        return Regions(regions, thickness=float(tube.thickness(fraction) * cell_size))
    return Regions(regions, density=fraction)


def _network(kind: Kind, cell_size: float, density: float | Field, tube: TubeLaw) -> Regions:
    if isinstance(density, Field):
        region = Region(kind, 1.0, None) if kind == NETWORK_A else Region(kind, None, -1.0)
        return Regions((region,), density=wall_beside_network(density))
    offset = float(tube.network_offset(density) * cell_size)
    end = float(np.sign(offset)) if offset else 0.0
    region = Region(kind, end, None) if kind == NETWORK_A else Region(kind, None, -end)
    return Regions((region,), thickness=2 * abs(offset))


def kind_beside(own: Kind | None, kind: Kind) -> Kind:
    """Kind that is filled with a lattice of a kind of its own, if one is given; raises ParameterError.

    >>> kind_beside("network-a", "sheet"), kind_beside("sheet", "bodies"), kind_beside(None, "channels")
    ('network-a', 'bodies', 'channels')
    """
    if own in (None, SHEET, kind):
        return kind
    if kind != SHEET:
        raise ParameterError("kind", kind, f"none beside a lattice whose own is {own}")
    return own


def grams_of(material_density: float) -> float:
    """Density of a material in g/mm3, of what is given in g/cm3; raises ParameterError.

    >>> grams_of(2.7)
    0.0027
    """
    number = positive_number("material_density", material_density)
    if number > _DENSEST:
        raise ParameterError("material_density", material_density, f"g/cm3, at most {_DENSEST:g}: of water it is 1")
    return number / 1000


def checked_skin(skin: float | None, openings: Sequence[Any], core: Any, kind: Kind) -> float | None:
    """Thickness of a skin in mm, if there is to be one of a thickness; raises ParameterError.

    Parameters
    ----------
    skin, openings, core, kind
        As of :func:`gyroid_cad.fill`.
    """
    if core is not None and skin is not None:
        raise ParameterError("skin", skin, "none beside a core: the skin is the part less its core")
    if core is not None and openings:
        raise ParameterError("openings", openings, "none beside a core, which comes to the boundary where it is open")
    if openings and skin is None:
        raise ParameterError("openings", openings, "none without a skin")
    name, given = ("core", core) if skin is None else ("skin", skin)
    if given is not None and kind == SURFACE:
        raise ParameterError(name, given, "none round the bare surface, which is no solid")
    if skin is None:
        return None
    thickness = positive_number("skin", skin, "a length in mm, a finite number above 0")
    if thickness < THINNEST_WALL:
        raise ParameterError("skin", skin, f"at least {THINNEST_WALL:g} mm, the thinnest wall")
    return thickness

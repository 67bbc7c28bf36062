"""The table of surfaces: three members of one Bonnet family, and what follows from the few data of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from gyroid_cad.errors import ParameterError
from gyroid_cad.surface import bounding_cells
from gyroid_cad.surface.symmetry import Neighbour, Patch, Placements, orbit
from gyroid_cad.surface.tube import TubeLaw, tube_law
from gyroid_cad.surface.weierstrass import DIAMOND, GYROID, PRIMITIVE, Family

__all__ = ["SURFACES", "USUAL", "MinimalSurface", "surface_named"]


@dataclass(frozen=True, slots=True)
class MinimalSurface:
    """A triply periodic minimal surface.

    Attributes
    ----------
    patch : Patch
        Bonnet angle and scale, corners, neighbour rule.
    first : tuple of int
        Centre of one of its patches, in quarters: where the lattice stands in its cell.
    arrangement : callable, optional
        Which patches make up one cell, if not those whose centres lie in it.
    """

    patch: Patch
    first: tuple[int, int, int]
    arrangement: Callable[[Patch], Placements] | None = None

    @property
    def name(self) -> str:
        return self.family.name

    @property
    def family(self) -> Family:
        return self.patch.family

    @property
    def cell(self) -> Placements:
        """The patches of one cubic cell."""
        return _cell(self)

    @property
    def tube(self) -> TubeLaw:
        """How thickness and density go together."""
        return tube_law(self.family, len(self.cell))


@lru_cache(maxsize=8)
def _cell(surface: MinimalSurface) -> Placements:
    return orbit(surface.patch, surface.first) if surface.arrangement is None else surface.arrangement(surface.patch)


_EVERY = (
    MinimalSurface(
        Patch(GYROID, ((-2, 0, 1), (0, -2, -1), (2, 0, 1), (0, 2, -1)), Neighbour.HALF_TURN_ABOUT_NORMAL),
        (4, 6, 5),
        bounding_cells.cubic_cell,
    ),
    MinimalSurface(
        Patch(DIAMOND, ((-1, 1, 1), (-1, -1, -1), (1, -1, 1), (1, 1, -1)), Neighbour.HALF_TURN_ABOUT_EDGE, (1, 1, 0)),
        (1, 1, 1),
    ),
    MinimalSurface(
        Patch(PRIMITIVE, ((-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)), Neighbour.REFLECTION_IN_PLANE, (1, 0, 0)),
        (6, 2, 4),
    ),
)
SURFACES: Mapping[str, MinimalSurface] = MappingProxyType({surface.name: surface for surface in _EVERY})
# Where none is named.
USUAL = SURFACES[GYROID.name]


def surface_named(name: str) -> MinimalSurface:
    """The surface of a name.

    Raises
    ------
    ParameterError
        If there is none, with those there are.
    """
    if not isinstance(name, str) or name not in SURFACES:
        raise ParameterError("surface", name, " or ".join(SURFACES))
    return SURFACES[name]

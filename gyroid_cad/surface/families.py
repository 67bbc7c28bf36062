"""The table of surfaces, and the exact relation between thickness and density that follows for each.

Area, curvature and the tube formula: a wall of constant thickness t round a surface of area A and Euler
characteristic chi has the volume ``A t + (2 pi chi) t^3 / 12`` (Weyl's tube formula; Gauss-Bonnet turns the integral
of the Gaussian curvature into 2 pi chi). Lengths are in cell sizes L.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt
from types import MappingProxyType
from typing import overload

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.symmetry import Neighbour, Patch, Placements, cubic_cell, orbit
from gyroid_cad.surface.weierstrass import DIAMOND, GYROID, K_PRIME, PRIMITIVE, Family, K

__all__ = ["SURFACES", "USUAL", "MinimalSurface", "TubeLaw", "surface_named", "tube_law"]

Floats = NDArray[np.float64]

# Of a patch: its normals cover one of the six faces of the cube seen from its middle, 4 pi / 6 of the sphere.
_PATCH_CURVATURE = -4 * pi / 6
# At the limit itself the wall is a cusp. A fit folds over a little earlier, which the wall checks.
_SOUNDNESS_MARGIN = 1e-5


@dataclass(frozen=True, slots=True)
class TubeLaw:
    """Tube law of a surface: the relation between its wall's thickness and density.

    Attributes
    ----------
    area : float
        Of the surface in a cell, in squared cell sizes.
    euler_characteristic : float
        Of the surface in a cell.
    thickness_limit : float
        Twice the smallest radius of curvature, in cell sizes.
    """

    area: float
    euler_characteristic: float
    thickness_limit: float

    @property
    def max_thickness(self) -> float:
        """The wall must be thinner, in cell sizes."""
        return self.thickness_limit * (1 - _SOUNDNESS_MARGIN)

    @property
    def max_density(self) -> float:
        """The wall must take up less than this part of space."""
        return self.density(self.max_thickness)

    @property
    def _cubic(self) -> float:
        return -2 * pi * self.euler_characteristic / 12

    def density(self, thickness: float) -> float:
        """Volume fraction of a wall of constant thickness.

        Parameters
        ----------
        thickness : float
            Whole wall, in cell sizes.
        """
        return self.area * thickness - self._cubic * thickness**3

    @overload
    def thickness(self, density: float) -> float: ...
    @overload
    def thickness(self, density: Floats) -> Floats: ...
    def thickness(self, density: float | Floats) -> float | Floats:
        """The inverse of :meth:`density`, by Viete's formula for three real roots.

        Parameters
        ----------
        density : float or ndarray
            From 0 to :attr:`max_density`.

        Returns
        -------
        float or ndarray
            Whole wall, in cell sizes.
        """
        turning = sqrt(self.area / (3 * self._cubic))
        at_turning = 2 * self._cubic * turning**3
        thickness = 2 * turning * np.cos((np.arccos(-np.asarray(density) / at_turning) - 2 * pi) / 3)
        thickness = np.where(np.asarray(density) == 0, 0.0, thickness)
        return thickness if thickness.ndim else float(thickness)

    def face_area(self, thickness: float) -> float:
        """Area per cell of each face of the wall, in squared cell sizes; thickness in cell sizes."""
        return self.area + 2 * pi * self.euler_characteristic * (thickness / 2) ** 2

    def network_offset(self, density: float) -> float:
        """Distance from the surface at which a network begins that takes up a given part of space.

        One network is half of space less half of a wall: 1/2 - A s - (2 pi chi / 3) s^3 at the distance s.

        Parameters
        ----------
        density : float
            Above (1 - largest density) / 2, below (1 + largest density) / 2.

        Returns
        -------
        float
            Along the normal, in cell sizes; negative where the network takes up more than half.
        """
        half = self.thickness(abs(1 - 2 * density)) / 2
        return half if density < 0.5 else -half


def tube_law(family: Family, patches: int) -> TubeLaw:
    """The law of a surface with so many patches a cell.

    Parameters
    ----------
    family : Family
        Associate surfaces are isometric, so the area goes with the square of the scale alone; the smallest radius of
        curvature, at the patch's centre, is half the scale.
    patches : int
    """
    # In cell sizes, two bounding-cell lengths.
    scale = family.scale / 2
    return TubeLaw(
        area=patches * scale**2 * K * K_PRIME / 4,
        euler_characteristic=patches * _PATCH_CURVATURE / (2 * pi),
        thickness_limit=scale,
    )


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
        """Relation between thickness and density."""
        return tube_law(self.family, len(self.cell))


@lru_cache(maxsize=8)
def _cell(surface: MinimalSurface) -> Placements:
    return orbit(surface.patch, surface.first) if surface.arrangement is None else surface.arrangement(surface.patch)


_EVERY = (
    MinimalSurface(
        Patch(GYROID, ((-2, 0, 1), (0, -2, -1), (2, 0, 1), (0, 2, -1)), Neighbour.HALF_TURN_ABOUT_NORMAL),
        (4, 6, 5),
        cubic_cell,
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

"""Area, curvature and the tube formula of the gyroid: exact relations between thickness and density.

A wall of constant thickness t round a surface of area A and Euler characteristic chi has the volume
``A t + (2 pi chi) t^3 / 12`` (Weyl's tube formula; Gauss-Bonnet turns the integral of the Gaussian
curvature into 2 pi chi). Lengths here are in cell sizes L.
"""

from __future__ import annotations

from math import pi, sqrt
from typing import overload

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.weierstrass import GYROID, K_PRIME, K

__all__ = [
    "AREA_PER_CELL",
    "EULER_CHARACTERISTIC",
    "LARGEST_DENSITY",
    "LARGEST_THICKNESS",
    "THICKNESS_LIMIT",
    "density_of_thickness",
    "face_area",
    "offset_of_network",
    "thickness_of_density",
]

Floats = NDArray[np.float64]

# The associate surfaces are isometric: the area goes with the square of the scale.
AREA_PER_CELL = 1.5 * (K / K_PRIME + K_PRIME / K)
EULER_CHARACTERISTIC = -8
# Twice the smallest radius of curvature, scale a / 2 at the patch's centre, with a = L / 2.
THICKNESS_LIMIT = GYROID.scale / 2
# At the limit itself the wall is a cusp. A fit folds over a little earlier, which the wall checks.
_SOUNDNESS_MARGIN = 1e-5
LARGEST_THICKNESS = THICKNESS_LIMIT * (1 - _SOUNDNESS_MARGIN)
_CUBIC = -2 * pi * EULER_CHARACTERISTIC / 12


def density_of_thickness(thickness: float) -> float:
    """Volume fraction of a wall of constant thickness.

    Parameters
    ----------
    thickness : float
        Whole wall, in cell sizes.

    Returns
    -------
    float
    """
    return AREA_PER_CELL * thickness - _CUBIC * thickness**3


LARGEST_DENSITY = density_of_thickness(LARGEST_THICKNESS)


@overload
def thickness_of_density(density: float) -> float: ...
@overload
def thickness_of_density(density: Floats) -> Floats: ...
def thickness_of_density(density: float | Floats) -> float | Floats:
    """The inverse of :func:`density_of_thickness`, by Viete's formula for three real roots.

    Parameters
    ----------
    density : float or ndarray
        From 0 to LARGEST_DENSITY.

    Returns
    -------
    float or ndarray
        Whole wall, in cell sizes.
    """
    turning = sqrt(AREA_PER_CELL / (3 * _CUBIC))
    at_turning = 2 * _CUBIC * turning**3
    thickness = 2 * turning * np.cos((np.arccos(-np.asarray(density) / at_turning) - 2 * pi) / 3)
    thickness = np.where(np.asarray(density) == 0, 0.0, thickness)
    return thickness if thickness.ndim else float(thickness)


def face_area(thickness: float) -> float:
    """Area per cell of each face of the wall, in squared cell sizes; thickness in cell sizes."""
    return AREA_PER_CELL + 2 * pi * EULER_CHARACTERISTIC * (thickness / 2) ** 2


def offset_of_network(density: float) -> float:
    """How far from the surface a labyrinth begins that takes up a given part of space.

    One labyrinth is half of space less half of a wall: 1/2 - A s - (2 pi chi / 3) s^3 at the distance s.

    Parameters
    ----------
    density : float
        Above (1 - LARGEST_DENSITY) / 2, below (1 + LARGEST_DENSITY) / 2.

    Returns
    -------
    float
        Along the normal, in cell sizes; negative where the labyrinth takes up more than half.
    """
    half = thickness_of_density(abs(1 - 2 * density)) / 2
    return half if density < 0.5 else -half

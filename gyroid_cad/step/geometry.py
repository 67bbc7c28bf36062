"""Curves and surfaces as the entities that ISO 10303-42 has for them, in arrays and numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "AxisPlacement",
    "Geometry",
    "Knots",
    "Line",
    "ParameterCurve",
    "ParameterLine",
    "Placed",
    "Spline",
    "SweptSurface",
    "Triple",
]

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]
# Origin, axis and direction of the first axis.
AxisPlacement = tuple[Triple, Triple, Triple]
Knots = tuple[tuple[float, ...], tuple[int, ...]]


@dataclass(frozen=True, slots=True, eq=False)
class Spline:
    """A B-spline curve or surface.

    Attributes
    ----------
    degrees : tuple of int
        One of a curve, two of a surface.
    poles : ndarray, shape (n, 3) or (n, m, 3)
        In mm; of a curve in the parameters of a surface (n, 2).
    weights : ndarray, shape (n,) or (n, m), or None
        None where it is polynomial.
    knots : tuple of (values, multiplicities)
        By parameter.
    closed : tuple of bool
        By parameter.
    """

    degrees: tuple[int, ...]
    poles: Floats
    weights: Floats | None
    knots: tuple[Knots, ...]
    closed: tuple[bool, ...]


@dataclass(frozen=True, slots=True)
class Placed:
    """A conic, a plane, or a surface that turns about an axis.

    Attributes
    ----------
    kind : str
        Name of the entity.
    origin, axis, along : tuple of float
        Of its frame: in mm, and two directions at right angles.
    sizes : tuple of float
        Radii in mm and angles in radians, in the entity's order.
    left_handed : bool
        Whether the kernel's frame is, so that its normal is the opposite of the entity's.
    """

    kind: str
    origin: Triple
    axis: Triple
    along: Triple
    sizes: tuple[float, ...] = ()
    left_handed: bool = False


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line.

    Attributes
    ----------
    origin, direction : tuple of float
    """

    origin: Triple
    direction: Triple


@dataclass(frozen=True, slots=True)
class SweptSurface:
    """The surface that a curve leaves as it moves along a direction, or turns about an axis.

    Attributes
    ----------
    curve : Spline, Placed or Line
    direction : tuple of float
    origin : tuple of float, optional
        Of the axis that it turns about.
    """

    curve: Spline | Placed | Line
    direction: Triple
    origin: Triple | None = None


@dataclass(frozen=True, slots=True)
class ParameterLine:
    """A straight line in the parameters of a surface.

    Attributes
    ----------
    origin, direction : tuple of float
        The direction of length 1.
    rate : float
        How far it goes while its parameter grows by 1.
    """

    origin: tuple[float, float]
    direction: tuple[float, float]
    rate: float = 1.0


@dataclass(frozen=True, slots=True)
class ParameterCurve:
    """An edge's curve in the parameters of one of its surfaces (PCURVE).

    Attributes
    ----------
    edge, surface : int
        Numbers in their body.
    curve : Spline or ParameterLine
        With the parameter that the edge's curve in space has in the file.
    """

    edge: int
    surface: int
    curve: Spline | ParameterLine


Geometry = Spline | Placed | Line | SweptSurface

"""Verdicts on what was measured: the worst value of each kind, its limit, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point

__all__ = ["Check", "Worst", "as_point", "counted", "largest", "smallest"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Worst:
    """Worst of the values that were measured.

    Attributes
    ----------
    value : float or str, optional
        None where there was nothing to measure.
    place : tuple of float, optional
        In mm; None where it has none.
    """

    value: float | str | None = None
    place: Point | None = None


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was checked.

    Attributes
    ----------
    name : str
    worst : float or str, optional
        None where there was nothing to measure.
    limit : float, optional
        None where any value will do.
    ok : bool
    place : tuple of float, optional
        Of the worst value, x, y, z in mm.
    """

    name: str
    worst: float | str | None
    limit: float | None
    ok: bool
    place: Point | None


def as_point(place: Floats) -> Point:
    """Coordinates of a place as plain numbers."""
    x, y, z = place.tolist()
    return x, y, z


def smallest(values: Floats, places: Floats) -> Worst:
    """Return the smallest of some values, shape (n,), and its place, of (n, 3); those that are NaN are left out."""
    known = np.flatnonzero(~np.isnan(values))
    if not len(known):
        return Worst()
    worst = known[np.argmin(values[known])]
    return Worst(float(values[worst]), as_point(places[worst]))


def largest(values: Floats, places: Floats) -> Worst:
    """Return the largest of some values, as :func:`smallest` the smallest."""
    found = smallest(-values, places)
    return found if found.value is None else Worst(-float(found.value), found.place)


def counted(places: Floats) -> Worst:
    """Return how many places, shape (n, 3), there are, and the first of them.

    >>> counted(np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]))
    Worst(value=2, place=(1.0, 2.0, 3.0))
    """
    return Worst(len(places), as_point(places[0]) if len(places) else None)

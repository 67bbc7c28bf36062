"""Verdicts on what was measured: the worst value of each kind, its limit, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

from gyroid_cad.common.arrays import Point

__all__ = ["Check", "Worst"]


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

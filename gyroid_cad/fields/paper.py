"""The paper's own units: everything in bounding-cell lengths, with one scale to millimetres (its sec. 3.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.checks import positive_number
from gyroid_cad.fields.field import Field, as_field

__all__ = ["PaperUnits", "paper_units"]

Floats = NDArray[np.float64]

# A cubic cell is two bounding cells long.
_CELL = 2


@dataclass(frozen=True, slots=True)
class PaperUnits:
    """What the paper's thickness factor and BC length are in millimetres.

    Attributes
    ----------
    cell_size : float
        In mm.
    thickness : float or Field
        In mm, of places in mm.
    scale_field : Field, optional
        Without unit, of places in mm.
    """

    cell_size: float
    thickness: float | Field
    scale_field: Field | None


@dataclass(frozen=True, slots=True)
class _InUnits:
    """A field of places in BC units, as a function of places in mm; unlike a lambda it can be compared."""

    field: Field
    unit: float
    factor: float

    def __call__(self, x: Floats, y: Floats, z: Floats) -> ArrayLike:
        return self.factor * np.asarray(self.field.function(x / self.unit, y / self.unit, z / self.unit))


def paper_units(
    thickness_factor: float | str | Field | Callable[..., ArrayLike],
    bc_length: float | str | Field | Callable[..., ArrayLike],
    scale: float,
) -> PaperUnits:
    """Translate the paper's description of a specimen.

    Parameters
    ----------
    thickness_factor : float, str, Field or callable
        Whole wall in BC units, of places in BC units before they are moved.
    bc_length : float, str, Field or callable
        Length of a bounding cell in BC units: a place p is moved to b(p) p.
    scale : float
        Millimetres per BC unit.

    Returns
    -------
    PaperUnits

    Raises
    ------
    ParameterError
    """
    scale = positive_number("scale", scale, "a finite number of mm per unit of BC length, above 0")
    thickness = as_field("thickness_factor", thickness_factor, "the wall in BC units")
    length = as_field("bc_length", bc_length, "a length in BC units")
    if isinstance(length, float):
        unit, scale_field = positive_number("bc_length", length, "a length in BC units above 0") * scale, None
    else:
        unit, scale_field = scale, _in_units("bc_length", length, scale, 1.0)
    wall = thickness * scale if isinstance(thickness, float) else _in_units("thickness_factor", thickness, unit, scale)
    return PaperUnits(_CELL * unit, wall, scale_field)


def _in_units(parameter: str, field: Field, unit: float, factor: float) -> Field:
    text = f"({field})(x/{unit:g}, y/{unit:g}, z/{unit:g})"
    text = text if factor == 1 else f"{factor:g}*{text}"
    return Field(_InUnits(field, unit, factor), text, parameter=parameter)

"""Forecast of what filling a part takes, from its volume, its area, its faces and the size of its box alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.memory import require_room
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import FieldLike
from gyroid_cad.filling.extent import BoundedExtent
from gyroid_cad.kernel.part import Part

__all__ = ["Forecast", "forecast_of", "require_cover", "require_thicker"]

Floats = NDArray[np.float64]

# Of a wall's two faces: so many patches has a cell, and so many curves and pieces the boundary makes of those that it
# crosses, for each square of its area that is as wide as a cell. Measured on plates, balls and boxes, within a fifth.
_FACES_PER_CELL, _CROSSINGS_PER_SQUARE, _PIECES_PER_SQUARE = 48, 34, 14
# Of the cells that a boundary runs through, so many for each such square.
_CELLS_PER_SQUARE = 3
# On two quiet processors of 2026, for a STEP file: the program's start, a crossing with a surface in closed form and
# with any other, a face of the part, and one of a box by sections. Measured on 14 parts: 13 of them within a sixth.
_START, _PER_CROSSING, _PER_FREE_CROSSING, _PER_PART_FACE, _PER_FACE = 2.5, 0.003, 0.0055, 0.006, 0.0015
# Peak memory for each cell of the box round triangles that are filled.
_BYTES_PER_CELL = 10_000_000
# Peak memory of filling and writing, for each face, as measured, rounded up; and a face in a STEP file.
_BYTES_PER_FACE, _STEP_BYTES_PER_FACE = 150_000, 10_000


@dataclass(frozen=True, slots=True)
class Forecast:
    """Forecast of what filling a part takes.

    Attributes
    ----------
    cells : float
        That the part takes up or its boundary runs through.
    crossings, faces : float
        Curves in which the part's boundary meets the lattice's faces, and faces of what is left.
    seconds : float
        Of a whole command that writes STEP.
    memory, step_bytes : float
        In bytes: at the peak, and of a STEP file.
    """

    cells: float
    crossings: float
    faces: float
    seconds: float
    memory: float
    step_bytes: float

    def __str__(self) -> str:
        amounts = f"{_round(self.crossings):,} crossings, {_round(self.faces):,} faces"
        return f"about {amounts}, {self.memory / 1e9:.1g} GB of memory, {self.step_bytes / 1e6:.2g} MB of STEP"

    def require_memory(self, cell_size: float) -> None:
        """Check that there is memory for all of it, before anything is made.

        Parameters
        ----------
        cell_size : float
            In mm.

        Raises
        ------
        ParameterError
            Saying how many cells there are, and which size would do.
        """

        def accepted(left: int) -> str:
            least = max(left, self.memory / self.cells)
            return f"at least about {cell_size * (self.memory / least) ** (1 / 3):.3g} mm for this part"

        require_room("cell_size", cell_size, int(self.memory), accepted, subject=f"about {self.cells:,.0f} cells")


def forecast_of(part: Part, cell_size: float, control_points: int = 10) -> Forecast:
    """Forecast of what filling a part with cells of a size takes.

    Parameters
    ----------
    part : Part
    cell_size : float
        In mm.
    control_points : int
        Of a patch, along a side.
    """
    whole, squares = part.volume / cell_size**3, part.area / cell_size**2
    box = float(np.prod(np.maximum((part.high - part.low) / cell_size, 1)))
    cells = min(whole + _CELLS_PER_SQUARE * squares, box)
    crossings = _CROSSINGS_PER_SQUARE * squares
    faces = _FACES_PER_CELL * whole + _PIECES_PER_SQUARE * squares + (0 if part.box else part.face_count)
    return Forecast(
        cells,
        crossings,
        faces,
        _START + (_by_crossings(part, cell_size, crossings) if part.box is None else _PER_FACE * faces),
        faces * _BYTES_PER_FACE * max(1.0, (control_points / 10) ** 2),
        faces * _STEP_BYTES_PER_FACE,
    )


def _by_crossings(part: Part, cell_size: float, crossings: float) -> float:
    """Seconds that crossings take."""
    free = _CROSSINGS_PER_SQUARE * part.free_form_area / cell_size**2
    return _PER_CROSSING * (crossings - free) + _PER_FREE_CROSSING * free + _PER_PART_FACE * part.face_count


def require_cover(low: Floats, high: Floats, cell_size: float, control_points: int) -> None:
    """Check that there is memory for the cells that cover a part, before any of them is made.

    Parameters
    ----------
    low, high : ndarray, shape (3,)
        Corners of the box round the part, in mm.
    cell_size : float
        In mm.
    control_points : int
        Of a patch, along a side.

    Raises
    ------
    ParameterError
        Saying how many cells that would be, and which size would do.
    """
    count = float(np.prod(np.maximum((high - low) / cell_size, 1)))
    each = _BYTES_PER_CELL * max(1.0, (control_points / 10) ** 2)

    def accepted(left: int) -> str:
        return f"at least about {cell_size * (count * each / max(left, each)) ** (1 / 3):.3g} mm for this part"

    require_room("cell_size", cell_size, int(count * each), accepted, subject=f"about {count:,.0f} cells")


def require_thicker(
    part: Part | BoundedExtent, wall: float, thickness: FieldLike | None, density: FieldLike | None
) -> None:
    """Check that a part is somewhere thicker than the wall that is to fill it.

    Parameters
    ----------
    part : Part or BoundedExtent
        Of the latter the box is looked at.
    wall : float
        Whole wall where it is thickest, in mm; 0 where that is not known yet.
    thickness, density : number or field, optional
        As the user gave it.

    Raises
    ------
    ParameterError
    """
    if not wall:
        return
    thickest = part.thickest(wall) if isinstance(part, Part) else float(np.min(part.high - part.low))
    if thickest <= wall:
        name, given = ("thickness", thickness) if density is None else ("density", density)
        accepted = f"a wall below the part's thickness, about {thickest:.3g} mm where it is thickest"
        raise ParameterError(name, given, f"{accepted}; it would be {wall:.6g} mm")


def _round(number: float) -> int:
    """A number with two digits of its own."""
    return int(float(f"{number:.1e}"))

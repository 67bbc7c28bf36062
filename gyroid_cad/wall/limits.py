"""Limits of a lattice: how many cells, of what size, with what wall."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral

from gyroid_cad.common.checks import finite_number
from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.families import TubeLaw
from gyroid_cad.wall.grading import THINNEST_WALL

__all__ = [
    "percent_hint",
    "require_cell_size",
    "require_density",
    "require_one",
    "require_thickness",
    "valid_tolerance",
    "whole_cells",
]

# In mm. The kernel takes lengths under 1e-7 mm for nothing; these keep every edge well above.
SMALLEST_CELL, LARGEST_CELL = 1e-2, 1e5
MOST_CELLS_ALONG = 1_000_000


def require_cell_size(cell_size: float) -> None:
    """Refuse cells too small or too large for the kernel.

    Raises
    ------
    ParameterError
    """
    if not SMALLEST_CELL <= cell_size <= LARGEST_CELL:
        raise ParameterError("cell_size", cell_size, f"{SMALLEST_CELL:g} to {LARGEST_CELL:g} mm")


def require_thickness(thickness: float, cell_size: float, tube: TubeLaw) -> None:
    """Refuse a constant wall, in mm, that is thinner than the kernel bears or past the curvature limit.

    Raises
    ------
    ParameterError
    """
    limit = tube.max_thickness * cell_size
    if not THINNEST_WALL <= thickness < limit:
        raise ParameterError(
            "thickness",
            thickness,
            f"{THINNEST_WALL:g} mm or more and below {limit:.5g} mm, "
            f"the curvature limit {tube.max_thickness:.5f} x cell_size",
        )


def require_density(density: float, cell_size: float, tube: TubeLaw) -> None:
    """Refuse a constant volume fraction whose wall is thinner than the kernel bears or past the curvature limit.

    Raises
    ------
    ParameterError
    """
    if not 0 < density < tube.max_density:
        accepted = f"above 0 and below {tube.max_density:.5f}, where the wall meets itself"
        raise ParameterError("density", density, accepted + percent_hint(density))
    if tube.thickness(density) * cell_size < THINNEST_WALL:
        min_thickness = tube.density(THINNEST_WALL / cell_size)
        raise ParameterError("density", density, f"at least {min_thickness:.3g} (a wall of {THINNEST_WALL} mm)")


def percent_hint(fraction: float) -> str:
    """Return what a fraction given in percent would be, to be added to an error; nothing of what is no percentage.

    Examples
    --------
    >>> percent_hint(30.0)
    '; 30 % is 0.30'
    """
    if not 1 < fraction <= 100:
        return ""
    two, four = f"{fraction / 100:.2f}", f"{fraction / 100:.4g}"
    return f"; {fraction:g} % is {two if float(two) == float(four) else four}"


def require_one(thickness: object, density: object) -> None:
    """Refuse both or neither of thickness and density.

    Raises
    ------
    ParameterError
    """
    if (thickness is None) == (density is None):
        given = {"thickness": thickness, "density": density}
        raise ParameterError("thickness, density", given, "exactly one of the two")


def valid_tolerance(tolerance: float) -> float:
    """The largest deviation of a fit, in cell sizes.

    Raises
    ------
    ParameterError
        If it is not above 0 and below 1.
    """
    accepted = "a part of the cell size, a finite number above 0 and below 1"
    number = finite_number("tolerance", tolerance, accepted)
    if not 0 < number < 1:
        raise ParameterError("tolerance", tolerance, accepted)
    return number


def whole_cells(cells: Sequence[int]) -> tuple[int, int, int]:
    """Numbers of cells along x, y, z.

    Raises
    ------
    ParameterError
    """
    accepted = f"three whole numbers, each from 1 to {MOST_CELLS_ALONG}"
    try:
        counts = tuple(cells)
    except TypeError:
        raise ParameterError("cells", cells, accepted) from None
    whole = all(isinstance(n, Integral) and not isinstance(n, bool) and 1 <= n <= MOST_CELLS_ALONG for n in counts)
    if len(counts) != 3 or not whole:
        raise ParameterError("cells", cells, accepted)
    return int(counts[0]), int(counts[1]), int(counts[2])

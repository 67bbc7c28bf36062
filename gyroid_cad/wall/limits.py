"""Limits of what describes a lattice: each is refused in one line that says what is accepted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from numbers import Integral
from typing import Any

from gyroid_cad.common.choices import BLOCK_KINDS, Kind
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field, FieldLike, as_field
from gyroid_cad.surface.families import TubeLaw
from gyroid_cad.wall.grading import LARGEST_CELL, SMALLEST_CELL, THINNEST_WALL

__all__ = [
    "NETWORK_KINDS",
    "SHEET_KIND",
    "network_density",
    "percent_hint",
    "require_cell_size",
    "require_density",
    "require_none_beside_lattice",
    "require_one",
    "require_sheet",
    "require_thickness",
    "wall_beside_network",
    "whole_cells",
]

SHEET_KIND, *NETWORK_KINDS = BLOCK_KINDS[:3]
_MOST_CELLS_ALONG = 1_000_000


def whole_cells(cells: Sequence[int]) -> tuple[int, int, int]:
    """Numbers of cells along x, y, z.

    Raises
    ------
    ParameterError
    """
    accepted = f"three whole numbers, each from 1 to {_MOST_CELLS_ALONG}"
    try:
        counts = tuple(cells)
    except TypeError:
        raise ParameterError("cells", cells, accepted) from None
    whole = all(isinstance(n, Integral) and not isinstance(n, bool) and 1 <= n <= _MOST_CELLS_ALONG for n in counts)
    if len(counts) != 3 or not whole:
        raise ParameterError("cells", cells, accepted)
    return int(counts[0]), int(counts[1]), int(counts[2])


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


def require_sheet(kind: Kind) -> None:
    """Refuse what there is of the wall alone to other kinds.

    Raises
    ------
    ParameterError
    """
    if kind != SHEET_KIND:
        accepted = f"{SHEET_KIND}: other kinds have solids, files and a report, but no control nets and no meshes"
        raise ParameterError("kind", kind, accepted)


def network_density(density: FieldLike | None, thickness: FieldLike | None, tube: TubeLaw) -> float | Field:
    """Volume fraction of a network, which alone describes it.

    Raises
    ------
    ParameterError
    """
    if thickness is not None:
        raise ParameterError("thickness", thickness, "none of a network, which is told by its density")
    low, high = (1 - tube.max_density) / 2, (1 + tube.max_density) / 2
    meaning = "the network's volume fraction"
    accepted = f"{meaning}, above {low:.5f} and below {high:.5f}"
    fraction = as_field("density", density, meaning)
    if isinstance(fraction, float) and not low < fraction < high:
        raise ParameterError("density", fraction, accepted + percent_hint(fraction))
    return fraction


def wall_beside_network(density: Field) -> Field:
    """Density of the wall that two networks leave between them, each of which takes up so much, below a half.

    >>> from gyroid_cad.fields import constant
    >>> float(wall_beside_network(constant(0.3))(0, 0, 0))
    0.4
    """
    wall = 1 - 2 * density
    return replace(wall, parameter="1 - 2 x density")


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


def require_none_beside_lattice(given: Mapping[str, Any]) -> None:
    """Refuse what a lattice that is given has of its own.

    Raises
    ------
    ParameterError
    """
    for name, value in given.items():
        if value is not None:
            raise ParameterError(name, value, "none beside a lattice, which has its own")

"""Islands, pieces that a cut leaves unconnected to the largest one, and sealed voids: what is kept, what is said."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal, Protocol, TypeVar

from gyroid_cad.common.arrays import Point
from gyroid_cad.errors import IslandsWarning, ParameterError, SealedVoidsWarning

__all__ = [
    "SMALL_ISLAND",
    "IslandRule",
    "Islands",
    "SealedVoid",
    "island_rule",
    "islands_of",
    "kept_pieces",
    "piece_size",
    "speck_below",
    "warn_caller",
    "warn_of_voids",
    "without_islands",
]


class Piece(Protocol):
    """A solid with its volume in mm3, or a shell without any, and its area in mm2."""

    @property
    def volume(self) -> float: ...
    @property
    def area(self) -> float: ...


P = TypeVar("P", bound=Piece)
IslandRule = Literal["drop small", "drop all", "keep all"]

# A small island has less than this part of what one cell holds, and of the largest piece. The chips at two corners of
# a block of whole cells have a quarter of that where walls are thickest, and a tenth at usual densities.
SMALL_ISLAND = 0.01
# What is smaller is no void, in mm3 and in parts of a cell: a chip in a corner, far below what anything can make.
_SPECK, _SPECK_OF_CELL = 1e-4, 1e-5


@dataclass(frozen=True, slots=True)
class Islands:
    """Count and volume in mm3 of the islands that were kept, and of those that were dropped."""

    kept: int = 0
    kept_volume: float = 0.0
    dropped: int = 0
    dropped_volume: float = 0.0

    def __add__(self, other: Islands) -> Islands:
        return Islands(
            self.kept + other.kept,
            self.kept_volume + other.kept_volume,
            self.dropped + other.dropped,
            self.dropped_volume + other.dropped_volume,
        )

    def warn(self, remedy: str = "") -> None:
        """Emit an :class:`~gyroid_cad.IslandsWarning` at the line that called this package, if there is any island.

        Parameters
        ----------
        remedy : str
            How islands that were kept can be dropped.
        """
        said = []
        if self.dropped:
            said.append(f"{_counted(self.dropped)}, {self.dropped_volume:.4g} mm3 in all: dropped (keep_islands keeps)")
        if self.kept:
            said.append(f"{_counted(self.kept)}, {self.kept_volume:.4g} mm3 in all: left{remedy and f' ({remedy})'}")
        if said:
            text = "not connected to the largest piece: " + "; ".join(said)
            warn_caller(text, IslandsWarning)


def island_rule(keep_islands: bool, drop_islands: bool = False) -> IslandRule:
    """Return the rule that two switches stand for: neither drops small islands only.

    Raises
    ------
    ParameterError
        If both are set.
    """
    if keep_islands and drop_islands:
        raise ParameterError("keep_islands", True, "one of keep_islands and drop_islands, not both")
    return "keep all" if keep_islands else "drop all" if drop_islands else "drop small"


def kept_pieces(sizes: Sequence[float], one_cell: float, rule: IslandRule) -> list[int]:
    """Return the indices of the pieces that a rule keeps, the largest first: that one is always kept.

    Parameters
    ----------
    sizes : sequence of float
        Volumes, or areas of a bare surface.
    one_cell : float
        What one cell holds, in the same unit.
    rule : {"drop small", "drop all", "keep all"}

    Examples
    --------
    >>> kept_pieces([0.03, 500.0, 7.0], one_cell=100.0, rule="drop small")
    [1, 2]
    """
    order = sorted(range(len(sizes)), key=lambda index: -sizes[index])
    if rule == "keep all" or not order:
        return order
    least = inf if rule == "drop all" else SMALL_ISLAND * min(sizes[order[0]], one_cell)
    return order[:1] + [index for index in order[1:] if sizes[index] >= least]


def islands_of(volumes: Sequence[float], kept: Sequence[int]) -> Islands:
    """Return what :func:`kept_pieces` kept besides the largest piece, and what it dropped.

    Parameters
    ----------
    volumes : sequence of float
        Of all pieces, in mm3.
    kept : sequence of int
    """
    dropped = [index for index in range(len(volumes)) if index not in kept]
    left, lost = (sum(volumes[index] for index in some) for some in (kept[1:], dropped))
    return Islands(len(kept[1:]), left, len(dropped), lost)


def _counted(number: int) -> str:
    return "1 island" if number == 1 else f"{number} islands"


@dataclass(frozen=True, slots=True)
class SealedVoid:
    """Space that a solid encloses: its volume in mm3, and its centre of mass in mm."""

    volume: float
    place: Point

    def __str__(self) -> str:
        place = ", ".join(f"{round(coordinate, 3) + 0.0:g}" for coordinate in self.place)
        return f"{self.volume:.4g} mm3 round ({place})"


def speck_below(cell_size: float) -> float:
    """Volume in mm3 below which space that is enclosed is no void, where cells have a size in mm.

    Examples
    --------
    >>> speck_below(2.0), speck_below(0.1)
    (0.0001, 1e-05)
    """
    cell = cell_size**3
    return round(min(max(_SPECK, _SPECK_OF_CELL * cell), SMALL_ISLAND * cell), 15)


def warn_of_voids(voids: Sequence[SealedVoid]) -> None:
    """Emit a :class:`~gyroid_cad.errors.SealedVoidsWarning` at the line that called this package, if there is any void.

    Examples
    --------
    >>> warn_of_voids([])
    """
    if voids:
        counted = "1 void" if len(voids) == 1 else f"{len(voids)} voids"
        text = f"{counted} that no opening reaches, the largest {max(voids, key=lambda void: void.volume)}"
        warn_caller(text, SealedVoidsWarning)


def warn_caller(text: str, category: type[Warning]) -> None:
    """Emit a warning at the line that called this package."""
    package = __name__.partition(".")[0]
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] == package:
        level, frame = level + 1, frame.f_back
    warnings.warn(text, category, stacklevel=level)


def piece_size(piece: Piece) -> float:
    """Volume, or of a bare surface its area."""
    return piece.volume or piece.area


def without_islands(domains: dict[str, list[P]], cells: float, rule: IslandRule) -> tuple[dict[str, list[P]], Islands]:
    """Return the pieces of every domain that a rule keeps, and what is left or dropped besides the largest ones.

    Parameters
    ----------
    domains : dict
        Pieces by the name of their region.
    cells : float
        How many cells what is filled is as large as.
    rule : IslandRule
    """
    chosen, islands = {}, Islands()
    for name, some in domains.items():
        sizes = [piece_size(piece) for piece in some]
        kept = kept_pieces(sizes, sum(sizes) / cells, rule)
        chosen[name] = [some[index] for index in kept]
        islands += islands_of([piece.volume for piece in some], kept)
    return chosen, islands

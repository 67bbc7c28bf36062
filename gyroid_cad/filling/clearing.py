"""Where a lattice without end stands clear of the parts that it fills: so that no edge is too short for receivers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.filling.part import FilledBy
from gyroid_cad.trim.clearance import NearMisses, clear_shift
from gyroid_cad.wall.covering import Frame

__all__ = ["clear_frame"]

Floats = NDArray[np.float64]

# The shortest edge wanted: receivers refuse some under 0.02 mm; of small cells a part of the cell.
_SHORTEST, _SHORTEST_OF_CELL = 0.025, 1 / 120
# How far a lattice may be shifted, in cells; and how often, for where curved faces end up is not foretold exactly.
_FURTHEST, _ROUNDS = 0.04, 3
# A shift that leaves more than this of the near misses is not worth being out of place.
_WORTHWHILE = 0.5


def clear_frame(fillings: Sequence[FilledBy], frame: Frame, cell_size: float) -> Frame:
    """Move a lattice by a few hundredths of a cell, where that leaves none or fewer of the edges that are too short.

    Parameters
    ----------
    fillings : sequence of FilledBy
        All with the same lattice.
    frame : Frame
        Where it stands.
    cell_size : float
        In mm.

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError
    """
    least, most = min(_SHORTEST, _SHORTEST_OF_CELL * cell_size), _FURTHEST * cell_size
    best, fewest, tried = frame, 0, frame
    for round_ in range(_ROUNDS):
        misses = NearMisses.joined([filling.near_misses(tried, least + most) for filling in fillings])
        short = misses.count_below(least)
        if not round_:
            fewest = short
        elif short < min(fewest, 1) or short <= _WORTHWHILE * fewest:
            best, fewest = tried, short
        if not short:
            break
        shift = clear_shift(misses, least, most)
        if misses.moved(shift).count_below(least) > _WORTHWHILE * fewest:
            break
        tried = replace(tried, origin=tried.origin + shift)
    return best

"""A block of cells that is filled as a part is: of any kind, not the wall alone."""

from __future__ import annotations

from collections.abc import Hashable

import numpy as np

from gyroid_cad.common.cache import Cache
from gyroid_cad.common.progress import Progress
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.kernel.extent import solid_of_box
from gyroid_cad.trim.box import Box
from gyroid_cad.wall.parameters import LatticeParameters

__all__ = ["filled_block"]

_filled: Cache[Hashable, Filled] = Cache()


def filled_block(lattice: LatticeParameters, progress: Progress | None = None) -> Filled:
    """The block of cells of a lattice as the box that it is, filled with the lattice; the last few are remembered.

    Parameters
    ----------
    lattice : LatticeParameters
        Trimmed.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError, KernelError
    """

    def made() -> Filled:
        axes, origin = lattice.spec().frame.rotation, lattice.spec().frame.origin
        low = origin @ axes
        box = Box(axes, low, low + np.array(lattice.cells) * lattice.cell_size)
        return fill(solid_of_box(box), lattice=lattice, keep_islands=lattice.keep_islands, progress=progress)

    return _filled.get((lattice.spec(), lattice.kind, lattice.density), made)

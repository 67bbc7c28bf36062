"""Space that a part takes up, asked of many points at once."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.kernel.part import Part
from gyroid_cad.wall.covering import BoxExtent, Frame, PlacedExtent
from gyroid_cad.wall.grading import Extent

__all__ = ["BoundedExtent", "PartExtent", "extent_of"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Points on the boundary, in cell sizes: so far apart that the patches it crosses are told closely, and quickly.
_BOUNDARY_SPACING = 1 / 12


class PartExtent:
    """Space that a part takes up, by points on its boundary and a mesh of it.

    Parameters
    ----------
    part : Part
    cell_size : float
        In mm, of the lattice that it is asked for.
    """

    def __init__(self, part: Part, cell_size: float) -> None:
        points, _, self._error = part.surface_samples(_BOUNDARY_SPACING * cell_size)
        self._part, self._tree = part, cKDTree(points)

    def clearance(self, points: Floats) -> Floats:
        """No more than the distance of points from the boundary, in mm; shape (n,)."""
        return np.asarray(self._tree.query(points)[0]) - self._error

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        return self._part.contains(points)

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm; it may hold some a little further off."""
        found: Booleans = self.clearance(points) <= reach
        far = np.flatnonzero(~found)
        found[far] = self.contains(points[far])
        return found


class BoundedExtent(Extent, Protocol):
    """Space to be filled that answers for itself, with the corners of the box round it in mm."""

    @property
    def low(self) -> Floats: ...

    @property
    def high(self) -> Floats: ...


def extent_of(part: Part | BoundedExtent, cell_size: float) -> Extent:
    """The space that a part takes up: a box is known at once, any other solid by points on its boundary."""
    if not isinstance(part, Part):
        return part
    if part.box is not None:
        low, high = (tuple(corner.tolist()) for corner in (part.box.low, part.box.high))
        return PlacedExtent(BoxExtent(low, high), Frame(np.zeros(3), part.box.axes.T))
    return PartExtent(part, cell_size)

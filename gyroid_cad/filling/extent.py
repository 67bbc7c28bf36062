"""Space that a part takes up, asked of many points at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot
from gyroid_cad.kernel.part import Part
from gyroid_cad.wall.covering import BoxExtent
from gyroid_cad.wall.grading import Extent

__all__ = ["PartExtent", "extent_of"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Points on the boundary, in cell sizes: so far apart that the patches it crosses are told closely, and quickly.
_BOUNDARY_SPACING = 1 / 12
# A point this much nearer to the boundary than those points are to each other, or this far aside from the normal of the
# nearest one, may be on either side of it.
_DOUBTFUL_HEIGHT, _DOUBTFUL_COSINE = 0.5, 0.6


class PartExtent:
    """Space that a part takes up, by points on its boundary; the kernel is asked where they leave a doubt.

    Parameters
    ----------
    part : Part
    cell_size : float
        In mm, of the lattice that it is asked for.
    """

    def __init__(self, part: Part, cell_size: float) -> None:
        self._part, self._spacing = part, _BOUNDARY_SPACING * cell_size
        points, self._normals, self._error = part.surface_samples(self._spacing)
        self._tree = cKDTree(points)

    def clearance(self, points: Floats) -> Floats:
        """No more than the distance of points from the boundary, in mm; shape (n,)."""
        return np.asarray(self._tree.query(points)[0]) - self._error

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        return self._inside(points, *self._tree.query(points))

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm; it may hold some a little further off."""
        distance, nearest = (np.asarray(found) for found in self._tree.query(points))
        found = np.asarray(distance <= reach + self._error)
        far = np.flatnonzero(~found)
        found[far] = self._inside(points[far], distance[far], nearest[far])
        return found

    def _inside(self, points: Floats, distance: Floats, nearest: NDArray[np.intp]) -> Booleans:
        height = dot(points - self._tree.data[nearest], self._normals[nearest])
        inside = np.asarray(height < 0)
        least = np.maximum(_DOUBTFUL_HEIGHT * self._spacing, _DOUBTFUL_COSINE * distance)
        doubtful = np.flatnonzero(np.abs(height) < least)
        inside[doubtful] = self._part.contains(points[doubtful])
        return inside


def extent_of(part: Part, cell_size: float) -> Extent:
    """The space that a part takes up: a box is known at once, anything else by points on its boundary."""
    if part.box is not None:
        return BoxExtent(part.box.axes, part.box.low, part.box.high)
    return PartExtent(part, cell_size)

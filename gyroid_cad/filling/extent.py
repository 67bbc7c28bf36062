"""Space that a part takes up, asked of many points at once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot
from gyroid_cad.kernel.part import Part
from gyroid_cad.wall.covering import BoxExtent, Frame, PlacedExtent
from gyroid_cad.wall.grading import Extent

__all__ = ["PartExtent", "extent_of"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Points on the boundary, in cell sizes: so far apart that the patches it crosses are told closely, and quickly.
_BOUNDARY_SPACING = 1 / 12
# Which side of the boundary a place is on so many points near it tell, if it is on the same side of all of them. Of a
# face there is one such point in a cube of this part of the distance between points, so that no face outvotes another.
_LOOKED_AT, _ONE_IN = 12, 0.5
# A place further off than this many distances between points lies along the normal of the nearest one, but at edges.
_FAR, _LEAST_COSINE = 1.5, 0.6


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
        self._points, self._normals, self._error = part.surface_samples(self._spacing)
        self._tree = cKDTree(self._points)

    def clearance(self, points: Floats) -> Floats:
        """No more than the distance of points from the boundary, in mm; shape (n,)."""
        return np.asarray(self._tree.query(points)[0]) - self._error

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        tree, normals = self._spread_evenly
        distance, nearest = (np.asarray(found) for found in tree.query(points, min(_LOOKED_AT, tree.n)))
        heights = dot(points[:, np.newaxis] - tree.data[nearest], normals[nearest])
        first = heights[:, 0]
        inside: Booleans = first < 0
        alike = ((heights < 0) == inside[:, np.newaxis]).all(axis=1)
        # Points lie on triangles; and what the points differ by, one of them may be off by.
        least = self._error - self._spacing + np.ptp(heights, axis=1)
        aside = (distance[:, 0] > _FAR * self._spacing) & (np.abs(first) < _LEAST_COSINE * distance[:, 0])
        doubtful = np.flatnonzero(~alike | (np.abs(first) < least) | aside)
        inside[doubtful] = self._part.contains(points[doubtful])
        return inside

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm; it may hold some a little further off."""
        found: Booleans = self.clearance(points) <= reach
        far = np.flatnonzero(~found)
        found[far] = self.contains(points[far])
        return found

    @cached_property
    def _spread_evenly(self) -> tuple[cKDTree, Floats]:
        """Points chosen to be looked at, to be found by place, and their normals."""
        cubes = np.round(np.hstack([self._points / (_ONE_IN * self._spacing), self._normals]))
        few = np.unique(cubes, axis=0, return_index=True)[1]
        few = few[np.any(self._normals[few] != 0, axis=1)]
        return cKDTree(self._points[few]), self._normals[few]


def extent_of(part: Part, cell_size: float) -> Extent:
    """The space that a part takes up: a box is known at once, anything else by points on its boundary."""
    if part.box is not None:
        low, high = (tuple(corner.tolist()) for corner in (part.box.low, part.box.high))
        return PlacedExtent(BoxExtent(low, high), Frame(np.zeros(3), part.box.axes.T))
    return PartExtent(part, cell_size)

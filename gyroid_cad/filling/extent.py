"""Space that a part takes up, asked of many points at once, and what of it a mapped block of cells covers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.memory import require_room
from gyroid_cad.common.processes import processors
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.part import Part
from gyroid_cad.surface.symmetry import CELL_QUARTERS, placed_corners
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.covering import BoxExtent, Frame, PlacedExtent, periodic_patches
from gyroid_cad.wall.grading import Extent, Grading

__all__ = ["BoundedExtent", "MappedExtent", "PartExtent", "block_round", "extent_of", "preimages", "uncovered"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
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
        return np.asarray(self._tree.query(points, workers=processors())[0]) - self._error

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

    def points_inside(self, count: int) -> Floats:
        """Points spread at random over the inside, the same ones each time; shape (n, 3)."""

    def surface_samples(self, spacing: float) -> tuple[Floats, Floats, float]:
        """Points on the boundary, as :meth:`gyroid_cad.kernel.part.Part.surface_samples` gives them."""


def extent_of(part: Part | BoundedExtent, cell_size: float) -> Extent:
    """The space that a part takes up: a box is known at once, any other solid by points on its boundary."""
    if not isinstance(part, Part):
        return part
    if part.box is not None:
        low, high = (tuple(corner.tolist()) for corner in (part.box.low, part.box.high))
        return PlacedExtent(BoxExtent(low, high), Frame(np.zeros(3), part.box.axes.T))
    return PartExtent(part, cell_size)


@dataclass(frozen=True, slots=True, eq=False)
class MappedExtent:
    """An extent as it is seen from the flat space that a grading carries to where it is.

    Attributes
    ----------
    extent : Extent
    grading : Grading
    """

    extent: Extent
    grading: Grading

    def contains(self, points: Floats) -> Booleans:
        return self.extent.contains(self.grading.image(points)[1])

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        _, images, jacobian = self.grading.image(points)
        return self.extent.near(images, reach * np.linalg.norm(jacobian, axis=(1, 2)))


# Starts for the places that a map carries to given ones: so many along each side of the block at most.
_STARTS = 24
# Newton's steps, the longest of them in cell sizes, and what they must come to.
_STEPS, _LONGEST_STEP, _FOUND = 40, 2.0, 1e-6
# Round the corners of a patch and its middle the wall may reach out by so much of the distance between these.
_REACH = 1.6
# In cell sizes: that much of a domain's ends is left free, for the half walls that come from both sides.
_APART = 0.2
# In bytes, for each cell of the box round what is needed.
_BYTES_PER_CANDIDATE = 6000


def preimages(grading: Grading, cells: tuple[int, int, int], images: Floats) -> Floats:
    """Places of the lattice's flat space that are carried to given ones; NaN where none is found.

    By Newton's method, from the nearest of a grid of places of the block.

    Parameters
    ----------
    grading : Grading
    cells : tuple of int
        Of the block.
    images : ndarray, shape (n, 3)

    Returns
    -------
    ndarray, shape (n, 3)
    """
    size = grading.cell_size
    along = [np.linspace(0, count * size, min(2 * count + 1, _STARTS)) for count in cells]
    starts = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    points = starts[cKDTree(grading.image(starts)[1]).query(images)[1]]
    for _ in range(_STEPS):
        _, reached, jacobian = _wherever(grading.image, points)
        misses = reached - images
        steps = np.full(points.shape, np.nan)
        regular = np.abs(np.linalg.det(np.nan_to_num(jacobian))) > _FOUND
        steps[regular] = np.linalg.solve(jacobian[regular], misses[regular][..., np.newaxis])[..., 0]
        lengths = np.linalg.norm(steps, axis=1, keepdims=True)
        points = points - steps * np.minimum(1, _LONGEST_STEP * size / np.maximum(lengths, _FOUND * size))
        if not np.nanmax(lengths, initial=0.0) > _FOUND * size:
            break
    _, reached, jacobian = _wherever(grading.image, points)
    found = np.linalg.norm(reached - images, axis=1) < _FOUND**0.5 * size
    points[~found | (np.linalg.det(np.nan_to_num(jacobian)) <= 0)] = np.nan
    return points


def _wherever(image: Callable[[Floats], tuple[Floats, ...]], points: Floats) -> list[Floats]:
    """Values that a map gives at points, NaN where it gives none."""
    nothing = [np.full((len(points), *rest), np.nan) for rest in ((3,), (3,), (3, 3))]
    finite = np.flatnonzero(np.isfinite(points).all(axis=1))
    waiting = [finite] if len(finite) else []
    while waiting:
        some = waiting.pop()
        try:
            for found, part in zip(nothing, image(points[some]), strict=True):
                found[some] = part
        except ParameterError:
            if len(some) > 1:
                waiting += np.array_split(some, 2)
    return nothing


def block_round(
    grading: Grading, cells: tuple[int, int, int], extent: Extent, wanted: Floats, limits: Floats
) -> CellComplex:
    """The patches of a block that goes on beyond its cells as far as a part needs it and its map allows.

    Parameters
    ----------
    grading : Grading
    cells : tuple of int
        Of the block. Where its ends are joined it stays as it is.
    extent : Extent
        Of the part, in the space that the grading carries to.
    wanted : ndarray, shape (n, 3)
        Places all over the part, in the lattice's flat space.
    limits : ndarray, shape (2, 3)
        Lowest and highest coordinates, in mm, that patches may have.

    Raises
    ------
    ParameterError
        If memory would not do for so many cells.
    """
    size, placements = grading.cell_size, grading.surface.cell
    known = wanted[np.isfinite(wanted).all(axis=1)]
    low, high = (known.min(axis=0), known.max(axis=0)) if len(known) else (np.zeros(3), np.zeros(3))
    first = np.floor(np.maximum(low, limits[0]) / size).astype(np.int64) - 1
    count = np.ceil(np.minimum(high, limits[1]) / size).astype(np.int64) + 1 - first
    first, count = (np.where(grading.closed, own, found) for own, found in ((0, first), (cells, count)))
    count = np.maximum(count, 1)
    box = float(np.prod(count.astype(float)))
    require_room(
        "cells",
        cells,
        int(box * _BYTES_PER_CANDIDATE),
        lambda left: f"cells larger than {size:g} mm for this part",
        subject=f"{box:,.0f} cells round it",
    )
    middles = placements.translations / CELL_QUARTERS * size
    corners = placed_corners(placements) / CELL_QUARTERS * size
    domain = None if grading.map is None else np.array(grading.map.domain)

    def near(placement: Integers, cell: Integers) -> Booleans:
        own = np.concatenate([middles[placement][:, np.newaxis], corners[placement]], axis=1)
        own += cell[:, np.newaxis] * size
        scaled, images, jacobian = (
            part.reshape(len(own), 5, -1) for part in _wherever(grading.image, own.reshape(-1, 3))
        )
        kept = ((own[:, 0] >= limits[0]) & (own[:, 0] <= limits[1])).all(axis=1)
        kept &= (np.linalg.det(np.nan_to_num(jacobian.reshape(-1, 5, 3, 3))) > 0).all(axis=1)
        if domain is not None:
            free = np.where(grading.closed, -np.inf, _APART * size)
            kept &= ((scaled >= domain[0] + free) & (scaled <= domain[1] - free)).all(axis=(1, 2))
        reach = _REACH * np.linalg.norm(images[kept, 1:] - images[kept, :1], axis=-1).max(axis=1)
        kept[kept] = extent.near(images[kept, 0], reach)
        if not kept.any():
            raise ParameterError(
                "cells", cells, "a block that comes to the part: nothing of it does, so far as it goes on"
            )
        return np.asarray(kept)

    (nx, ny, nz), (x, y, z) = count.tolist(), first.tolist()
    return build_complex((nx, ny, nz), placements, grading.closed, (x, y, z), near)


def uncovered(grading: Grading, complex: CellComplex, cells: tuple[int, int, int], points: Floats) -> Booleans:
    """Mask of the places, of the lattice's flat space, whose nearest patch is none of a block's; shape (n,).

    Parameters
    ----------
    grading : Grading
    complex : CellComplex
        Of the block, as :func:`block_round` gives it.
    cells : tuple of int
    points : ndarray, shape (n, 3)
        NaN is nowhere.
    """
    known = np.flatnonzero(np.isfinite(points).all(axis=1))
    placement, cell = periodic_patches(grading.cell_size, points[known], grading.surface)
    cell = np.where(grading.closed, cell % np.array(cells), cell)
    there = set(map(tuple, np.column_stack([complex.patch_placement, complex.patch_cell]).tolist()))
    missing = np.ones(len(points), dtype=bool)
    missing[known] = [tuple(patch) not in there for patch in np.column_stack([placement, cell]).tolist()]
    return missing

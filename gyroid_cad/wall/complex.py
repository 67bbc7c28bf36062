"""The lattice's cell complex: which patches exist and which edges and corners they share, by integer id.

Corners are told apart by their integer coordinates, edges by the two corners they join and the way between them; no
distance is ever compared. Where the lattice's border leaves only some of the six patches at a corner, those that hang
together by edges form a fan. Two fans at one corner would touch in a line through the wall only; each
has vertices of its own, so that the wall's surface stays a two-manifold.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.graph import connected
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.symmetry import CELL_QUARTERS, Placements, placed_corners

__all__ = ["CellComplex", "build_complex"]

Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_NO_PATCH = -1


@dataclass(frozen=True, slots=True, eq=False)
class CellComplex:
    """Patches, edges, fans and corners of a lattice.

    Patch-local corners and edges are numbered round the patch: edge k runs from corner k to corner k + 1.
    An edge runs from its corner of lower id to that of higher id.

    Attributes
    ----------
    cells : tuple of int
        Number of cubic cells along x, y, z.
    placements : Placements
        Of the patches of one cell.
    patch_placement : ndarray of int, shape (patches,)
        Index into ``placements``.
    patch_cell : ndarray of int, shape (patches, 3)
        Which cell a patch belongs to.
    patch_corners, patch_edges, patch_fans : ndarray of int, shape (patches, 4)
    edge_forward : ndarray of bool, shape (patches, 4)
        Whether the patch's edge k runs the same way as the edge itself.
    edge_patches : ndarray of int, shape (edges, 2)
        The patches that share an edge, lower id first; -1 in the second place where there is none.
    edge_fans : ndarray of int, shape (edges, 2)
        The fans at the edge's start and end.
    fan_corner : ndarray of int, shape (fans,)
    corner_quarters : ndarray of int, shape (corners, 3)
        Corner positions in quarters of the bounding-cell length.
    patch_component : ndarray of int, shape (patches,)
        Which piece of the lattice, connected by edges, a patch belongs to.
    """

    cells: tuple[int, int, int]
    placements: Placements
    patch_placement: Integers
    patch_cell: Integers
    patch_corners: Integers
    patch_edges: Integers
    edge_forward: Booleans
    edge_patches: Integers
    patch_fans: Integers
    edge_fans: Integers
    fan_corner: Integers
    corner_quarters: Integers
    patch_component: Integers

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def patch_count(self) -> int:
        return len(self.patch_placement)

    @property
    def edge_count(self) -> int:
        return len(self.edge_patches)

    @property
    def fan_count(self) -> int:
        return len(self.fan_corner)

    @property
    def component_count(self) -> int:
        return int(self.patch_component.max()) + 1

    @property
    def free(self) -> Booleans:
        """Mask of the edges that bound one patch only; shape (edges,)."""
        return np.asarray(self.edge_patches[:, 1] == _NO_PATCH)

    @property
    def border_fans(self) -> Booleans:
        """Mask of the fans that do not close round their corner; shape (fans,)."""
        border = np.zeros(self.fan_count, dtype=bool)
        border[self.edge_fans[self.free].ravel()] = True
        return border

    @property
    def non_manifold_edges(self) -> int:
        """Corners at which more than one fan meets: lines through the wall where patches touch without joining."""
        return int(np.sum(np.bincount(self.fan_corner) > 1))


def build_complex(
    cells: tuple[int, int, int],
    placements: Placements | None = None,
    closed: tuple[bool, bool, bool] = (False, False, False),
    first: tuple[int, int, int] = (0, 0, 0),
    wanted: Callable[[Integers, Integers], Booleans] | None = None,
) -> CellComplex:
    """Number the patches, edges, corners and fans of a block of cubic cells.

    Parameters
    ----------
    cells : tuple of int
        Number of cells along x, y, z.
    placements : Placements, optional
        The patches of one cell; those of the usual surface if left out.
    closed : tuple of bool
        Along which axes the last cells join the first ones, as round a cylinder: a corner at the far end is the
        same as that at the near end.
    first : tuple of int
        The cell with the lowest indices.
    wanted : callable, optional
        Which patches to keep, from their placements (patches,) and cells (patches, 3); all if left out.

    Returns
    -------
    CellComplex
    """
    placements = USUAL.cell if placements is None else placements
    grid = np.stack(np.meshgrid(*map(np.arange, cells), indexing="ij"), axis=-1).reshape(-1, 3)
    patch_placement = np.tile(np.arange(len(placements)), len(grid))
    patch_cell = np.repeat(grid + np.array(first), len(placements), axis=0)
    if wanted is not None:
        kept = wanted(patch_placement, patch_cell)
        patch_placement, patch_cell = patch_placement[kept], patch_cell[kept]
    quarters = placed_corners(placements)[patch_placement] + CELL_QUARTERS * patch_cell[:, np.newaxis]

    along = np.roll(quarters, -1, axis=1) - quarters
    for axis in np.flatnonzero(closed):
        quarters[..., axis] %= CELL_QUARTERS * cells[axis]
    corner_quarters, patch_corners = _numbered_corners(quarters)
    following = np.roll(patch_corners, -1, axis=1)
    edge_forward = patch_corners < following
    ends = np.stack([np.minimum(patch_corners, following), np.maximum(patch_corners, following)], axis=-1)
    # Round a ring of one cell two edges may join the same corners, one each way.
    way = np.where(edge_forward[..., np.newaxis], along, -along) + CELL_QUARTERS
    number = (ends[..., 0] * len(corner_quarters) + ends[..., 1]) * (2 * CELL_QUARTERS + 1) ** 3
    number += way @ ((2 * CELL_QUARTERS + 1) ** np.arange(3))
    keys, flat_edges = np.unique(number, return_inverse=True)
    patch_edges = flat_edges.reshape(-1, 4)
    edge_patches = _patches_of_edges(patch_edges, len(keys))

    patch_fans, fan_corner = _fans(patch_corners, patch_edges, edge_forward, edge_patches)
    next_fan = np.roll(patch_fans, -1, axis=1)
    edge_fans = np.empty((len(keys), 2), dtype=np.int64)
    edge_fans[patch_edges, 0] = np.where(edge_forward, patch_fans, next_fan)
    edge_fans[patch_edges, 1] = np.where(edge_forward, next_fan, patch_fans)

    shared = edge_patches[edge_patches[:, 1] != _NO_PATCH]
    return CellComplex(
        cells=cells,
        placements=placements,
        patch_placement=patch_placement,
        patch_cell=patch_cell,
        patch_corners=patch_corners,
        patch_edges=patch_edges,
        edge_forward=edge_forward,
        edge_patches=edge_patches,
        patch_fans=patch_fans,
        edge_fans=edge_fans,
        fan_corner=fan_corner,
        corner_quarters=corner_quarters,
        patch_component=connected(len(patch_placement), shared[:, 0], shared[:, 1]),
    )


def _numbered_corners(quarters: Integers) -> tuple[Integers, Integers]:
    """Distinct corners (n, 3) and, for each patch, the ids of its four."""
    lowest = quarters.min(axis=(0, 1))
    extent = quarters.max(axis=(0, 1)) - lowest + 1
    x, y, z = np.moveaxis(quarters - lowest, -1, 0)
    keys, inverse = np.unique((x * extent[1] + y) * extent[2] + z, return_inverse=True)
    xy, z = np.divmod(keys, extent[2])
    x, y = np.divmod(xy, extent[1])
    return np.stack([x, y, z], axis=-1) + lowest, inverse.reshape(quarters.shape[:2])


def _patches_of_edges(patch_edges: Integers, edge_count: int) -> Integers:
    order = np.argsort(patch_edges.ravel(), kind="stable")
    edges = patch_edges.ravel()[order]
    first = np.searchsorted(edges, np.arange(edge_count))
    uses = np.diff(np.append(first, len(edges)))
    if uses.max() > 2:
        raise ValueError("placements are no surface: an edge belongs to more than two patches")
    patches = np.full((edge_count, 2), _NO_PATCH, dtype=np.int64)
    patches[:, 0] = order[first] // 4
    patches[uses == 2, 1] = order[first[uses == 2] + 1] // 4
    return patches


def _fans(
    patch_corners: Integers, patch_edges: Integers, edge_forward: Booleans, edge_patches: Integers
) -> tuple[Integers, Integers]:
    """Fan ids of each patch's corners, and each fan's corner.

    Two patches that share an edge belong to the same fan at each end of that edge.
    """
    places = np.arange(patch_corners.size).reshape(-1, 4)
    following = np.roll(places, -1, axis=1)
    # The patch-corner at the start and at the end of each patch's edges, gathered by edge.
    ends = np.stack([np.where(edge_forward, places, following), np.where(edge_forward, following, places)], axis=-1)
    order = np.argsort(patch_edges.ravel(), kind="stable")
    gathered = ends.reshape(-1, 2)[order]
    shared = np.flatnonzero(np.diff(patch_edges.ravel()[order]) == 0)
    labels = connected(patch_corners.size, gathered[shared].ravel(), gathered[shared + 1].ravel())
    fan_corner = np.empty(labels.max() + 1, dtype=np.int64)
    fan_corner[labels] = patch_corners.ravel()
    return labels.reshape(-1, 4), fan_corner

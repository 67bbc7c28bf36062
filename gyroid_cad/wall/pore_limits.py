"""Pore limiting diameters: the largest spheres that pass through a lattice's channels.

A network's throats are where the largest sphere that can travel through it without end is held: the places with the
greatest least distance from the mid-surface along a path (the pore-limiting diameter of porous media). A wall's face
lies half the wall off the mid-surface along its normals, so the sphere's diameter falls by exactly the wall's
thickness.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.graph import runs_on
from gyroid_cad.nurbs.roots import nearest_places
from gyroid_cad.surface.families import MinimalSurface
from gyroid_cad.surface.symmetry import CELL_QUARTERS
from gyroid_cad.wall.covering import AT_HOME, covering_complex
from gyroid_cad.wall.distances import distances_from_patches, nearest_offsets, nearest_patches
from gyroid_cad.wall.exact import patch_derivatives, patch_points_and_normals
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall

__all__ = ["PoreLimits", "narrowest_opening", "network_throats", "pore_limiting_diameter"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Nodes along a cell. Throats lie where symmetries of the surface leave points fixed, which are eighths of the cell; and
# the channels of all three surfaces run along edges and diagonals of the grid, along which its nodes are joined.
_NODES = 16
# Samples of the mid-surface along a patch's side.
_EXACT_SAMPLES = 25
# Nodes whose distances agree so closely, in cell sizes, lie equally far: symmetric ones do, to rounding.
_EQUALLY_FAR = 1e-9
# Distances to samples that may yet turn out the least, as a part of the least; and how many are looked at closely.
_MAY_BE_LEAST, _LOOKED_AT = 1.05, 64
# Of the 26 steps to the next nodes, across diagonals too, one of each two that are opposite.
_ONWARD = np.array([step for step in np.ndindex(3, 3, 3) if step > (1, 1, 1)]) - 1


@dataclass(frozen=True, slots=True, eq=False)
class PoreLimits:
    """The throats of a surface's two networks, and the spheres that fit where those are widest.

    Attributes
    ----------
    centres : ndarray, shape (n, 3)
        Of one cell, in cell sizes, within [0, 1).
    above : ndarray of bool, shape (n,)
        Whether they lie in the network that the common normal points to.
    radius : float
        Distance from the mid-surface, in cell sizes: the less of the two networks'.
    inscribed : float
        The largest distance of any place from the mid-surface, in cell sizes: the less of the two networks'.
    """

    centres: Floats
    above: Booleans
    radius: float
    inscribed: float

    def __post_init__(self) -> None:
        freeze_arrays(self)


def pore_limiting_diameter(surface: MinimalSurface, cell_size: float, thickness: float) -> float:
    """Diameter of the largest sphere that can pass through both networks beside a constant wall, in mm.

    Parameters
    ----------
    surface : MinimalSurface
    cell_size, thickness : float
        In mm.
    """
    return 2 * network_throats(surface).radius * cell_size - thickness


@lru_cache(maxsize=8)
def network_throats(surface: MinimalSurface) -> PoreLimits:
    """Throats of a surface's networks, where they are narrowest for what travels through them.

    A grid is flooded from the places furthest from the surface until the flood runs through the cell without end; the
    node that joins it is the throat, and its distance is then worked out to rounding from the exact surface.

    Parameters
    ----------
    surface : MinimalSurface
    """
    complex = covering_complex(np.full(3, -0.5), np.full(3, 1.5), AT_HOME, 1.0, 0.0, surface)
    samples = np.linspace(-1, 1, _EXACT_SAMPLES)
    places, normals = (part.reshape(-1, 3) for part in patch_points_and_normals(complex, 1.0, samples))
    nodes = np.stack(np.meshgrid(*3 * [np.arange(_NODES) / _NODES], indexing="ij"), axis=-1).reshape(-1, 3)
    offsets, nearest = nearest_offsets(places, normals, nodes)
    distance, above = np.linalg.norm(nodes - places[nearest], axis=1), offsets > 0
    chosen, radii, widest = [], [], []

    def exactly(node: int) -> float:
        """Distance of a node from the exact surface, by Newton's method from the nearest sample."""
        patch, sample = divmod(int(nearest[node]), _EXACT_SAMPLES**2)
        turn = complex.placements.matrices[complex.patch_placement[patch]]
        middle = complex.placements.translations[complex.patch_placement[patch]] / CELL_QUARTERS
        # In the patch's own frame, whose unit is half a cell.
        own = 2 * (nodes[[node]] - middle - complex.patch_cell[patch]) @ turn
        start_u, start_v = samples[np.array(divmod(sample, _EXACT_SAMPLES))][:, np.newaxis]
        return float(nearest_places(own, start_u, start_v, partial(patch_derivatives, surface.family))[2][0]) / 2

    for side in (True, False):
        held = _held(np.where(above == side, distance, 0.0).reshape(3 * [_NODES]))
        at = np.flatnonzero((above == side) & (np.abs(distance - held) < _EQUALLY_FAR))
        chosen.append(at)
        radii.append(exactly(int(at[0])))
        widest.append(exactly(int(np.argmax(np.where(above == side, distance, 0.0)))))
    every = np.concatenate(chosen)
    return PoreLimits(nodes[every], above[every], min(radii), min(widest))


def narrowest_opening(wall: Wall, grading: Grading, cells: tuple[int, int, int]) -> float:
    """Diameter of the largest sphere about the throats' centres of a graded lattice, in mm.

    The centres are carried along with space. Where a wall or a map is lopsided a sphere somewhat larger passes beside
    the centre: so this is on the safe side. Distances are measured to the nets' own faces.

    Parameters
    ----------
    wall : Wall
    grading : Grading
    cells : tuple of int

    Returns
    -------
    float
    """
    centres = _throats_of_block(network_throats(grading.surface).centres, cells) * grading.cell_size
    images = grading.carry(centres)[0].T
    distance, patch = nearest_patches(wall, images)
    near = np.argsort(distance)[:_LOOKED_AT]
    near = near[distance[near] <= _MAY_BE_LEAST * distance.min()]
    # The nearest place may lie just across an edge of the patch with the nearest sample.
    beside = wall.complex.edge_patches[wall.complex.patch_edges[patch[near]]].reshape(len(near), -1)
    which, index = np.nonzero(beside >= 0)
    pairs = np.unique(np.column_stack([near[which], beside[which, index]]), axis=0)
    return 2 * float(distances_from_patches(wall, images[pairs[:, 0]], pairs[:, 1]).min())


def _throats_of_block(centres: Floats, cells: tuple[int, int, int]) -> Floats:
    """Throats of all cells of a block and of its far sides; shape (n, 3)."""
    grid = np.stack(np.meshgrid(*(np.arange(n + 1) for n in cells), indexing="ij"), axis=-1).reshape(-1, 1, 3)
    every = (grid + centres).reshape(-1, 3)
    return np.asarray(every[np.all(every <= np.array(cells), axis=1)])


def _held(distance: Floats) -> float:
    """The greatest value at which the nodes of a periodic grid that have it run through the grid without end."""
    values = np.unique(distance[distance > 0])
    low, high = 0, len(values)
    while high - low > 1:
        middle = (low + high) // 2
        if _endless(distance >= values[middle] - _EQUALLY_FAR):
            low = middle
        else:
            high = middle
    return float(values[low])


def _endless(filled: Booleans) -> bool:
    """Tell whether filled nodes of a periodic grid, joined along edges and diagonals, lead to their own images."""
    number = np.flatnonzero(filled)
    at = np.stack(np.unravel_index(number, filled.shape), axis=1)
    first, second, cells = [], [], []
    for step in _ONWARD:
        cell, other = np.divmod(at + step, filled.shape)
        there = np.ravel_multi_index(tuple(other.T), filled.shape)
        joined = filled.ravel()[there]
        first.append(number[joined])
        second.append(there[joined])
        cells.append(cell[joined])
    return runs_on(filled.size, np.concatenate(first), np.concatenate(second), np.concatenate(cells))

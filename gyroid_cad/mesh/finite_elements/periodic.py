"""Nodes of a mesh that are one and the same in the endless lattice: what periodic boundary conditions tie together."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import ABAQUS, require_formats
from gyroid_cad.mesh.finite_elements.data import MeshData
from gyroid_cad.surface.symmetry import CELL_QUARTERS
from gyroid_cad.wall.complex import CellComplex

__all__ = ["PeriodicPairs", "periodic_pairs"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of what a pair's translation may be off by, in parts of the mesh's size: rounding leaves 1e-15.
_DIGITS = 12
_SAME_PLACE = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class PeriodicPairs:
    """Pairs of nodes that a translation by whole blocks of cells carries onto each other.

    Attributes
    ----------
    first, second : ndarray of int, shape (pairs,)
        No node is a second twice, and none is both.
    blocks : ndarray of int, shape (pairs, 3)
        How many blocks along x, y and z the second lies beyond the first.
    period : ndarray, shape (3,)
        Of the block along its own axes, in mm.
    axes : ndarray, shape (3, 3)
        Those of the block, unit vectors in the columns.
    """

    first: Integers
    second: Integers
    blocks: Integers
    period: Floats
    axes: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def __len__(self) -> int:
        return len(self.first)

    def by_translation(self) -> dict[tuple[int, int, int], tuple[Integers, Integers]]:
        """First and second nodes, for each number of blocks along x, y and z between them."""
        groups = np.unique(self.blocks, axis=0).tolist()
        chosen = [np.all(self.blocks == group, axis=1) for group in groups]
        return {
            (x, y, z): (self.first[some], self.second[some]) for (x, y, z), some in zip(groups, chosen, strict=True)
        }

    def write(self, *paths: str | os.PathLike[str], reference: int) -> None:
        """Write Abaqus input that ties the pairs by ``*EQUATION``, for a deck to ``*INCLUDE``; CalculiX reads it too.

        The second node of a pair moves as the first, and as the block is stretched between them.

        Parameters
        ----------
        *paths : path-like
            Ending in .inp.
        reference : int
            Number of a node of the user's own, which holds in its three degrees of freedom how much longer the block
            gets along x, y and z: prescribed, they are mean strains times the block's period. The mesh's own nodes
            are numbered from 1.

        Raises
        ------
        ParameterError, ExportError
        """
        for target in require_formats(paths, [ABAQUS]):
            with replacing(target) as temporary, temporary.open("w", encoding="ascii") as file:
                file.writelines(self.equations(reference))

    def equations(self, reference: int) -> Iterator[str]:
        """Give the text of :meth:`write` piece by piece, for a deck of one's own."""
        yield "*EQUATION\n"
        # How far the two lie apart along x, y and z, in periods of the block.
        spans = np.round(self.blocks * self.period @ self.axes.T / self.period, _DIGITS)
        together = zip(self.first.tolist(), self.second.tolist(), spans.tolist(), strict=True)
        for first, second, span in together:
            for axis in range(3):
                terms = [(second + 1, 1.0), (first + 1, -1.0), *([(reference, -span[axis])] if span[axis] else [])]
                line = ",".join(f"{node},{axis + 1},{factor:.{_DIGITS}g}" for node, factor in terms)
                yield f"{len(terms)}\n{line}\n"


def periodic_pairs(mesh: MeshData, cell_size: float, axes: Floats | None = None) -> PeriodicPairs:
    """Pair the nodes on the free walls of a block of cells with those where the next block would join.

    Free edges that differ by whole blocks are told by their ends' integer coordinates. Where walls or cells vary, only
    those pairs are given whose nodes really lie a whole block apart.

    Parameters
    ----------
    mesh : MeshData
    cell_size : float
        In mm.
    axes : ndarray, shape (3, 3), optional
        Of the block, if it was turned.
    """
    axes = np.eye(3) if axes is None else axes
    complex = mesh.complex
    inner = mesh.element.order * mesh.subdivisions - 1
    first, second, blocks = _paired_nodes(complex, inner)
    place, level = mesh.columns
    numbers = np.full((int(place.max()) + 1, mesh.levels), -1)
    numbers[place, level] = np.arange(len(mesh.points))
    pair = np.stack([numbers[first], numbers[second]], axis=-1).reshape(-1, 2)
    blocks = np.repeat(blocks, mesh.levels, axis=0)
    # Quadratic elements of 20 nodes have none at some levels.
    there = np.all(pair >= 0, axis=1)
    pair, blocks = pair[there], blocks[there]
    period = np.array(complex.cells) * cell_size
    apart = mesh.points[pair[:, 1]] - mesh.points[pair[:, 0]] - blocks * period @ axes.T
    good = np.abs(apart).max(axis=1, initial=0.0) < _SAME_PLACE * np.ptp(mesh.points)
    return PeriodicPairs(pair[good, 0], pair[good, 1], blocks[good], period, axes)


def _paired_nodes(complex: CellComplex, inner: int) -> tuple[Integers, Integers, Integers]:
    """Pairs of nodes of :mod:`gyroid_cad.mesh.nodes` on boundary edges and at their ends, and the blocks between."""
    block = CELL_QUARTERS * np.array(complex.cells)
    free = np.flatnonzero(complex.free)
    ends = complex.corner_quarters[complex.fan_corner[complex.edge_fans[free]]]
    # Run every edge towards higher coordinates, so that copies of one edge run alike.
    along = ends[:, 1] - ends[:, 0]
    leading = along[np.arange(len(along)), np.argmax(along != 0, axis=1)]
    forward = leading > 0
    start = np.where(forward[:, np.newaxis], ends[:, 0], ends[:, 1])
    direction = np.where(forward[:, np.newaxis], along, -along)
    one, other = _alike(np.concatenate([start % block, direction], axis=1))
    run = np.arange(inner)

    def places(edges: Integers) -> Integers:
        on_edge = np.where(forward[edges, np.newaxis], run, inner - 1 - run)
        return np.asarray(complex.fan_count + free[edges, np.newaxis] * inner + on_edge)

    fans = np.flatnonzero(complex.border_fans)
    corner = complex.corner_quarters[complex.fan_corner[fans]]
    fan, other_fan = _alike(corner % block)
    first = np.concatenate([places(one).ravel(), fans[fan]])
    second = np.concatenate([places(other).ravel(), fans[other_fan]])
    blocks = np.concatenate(
        [
            np.repeat((start[other] - start[one]) // block, inner, axis=0),
            (corner[other_fan] - corner[fan]) // block,
        ]
    )
    return first, second, blocks


def _alike(keys: Integers) -> tuple[Integers, Integers]:
    """Pairs of equal rows: the first one, over and over, and each of the others."""
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    leader = first[group.ravel()]
    others = np.flatnonzero(leader != np.arange(len(keys)))
    return leader[others], others

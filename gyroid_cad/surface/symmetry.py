"""Symmetry: the semi-fundamental patch (SFP), its bounding cell and cubic cell, in integers.

Every corner of every patch lies on the grid of quarters of the bounding-cell length, so placements are
signed permutations and translations in quarters: nothing here is rounded, and equality is exact.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.surface.patch import ROTOINVERSION
from gyroid_cad.surface.weierstrass import Family

__all__ = [
    "CELL_QUARTERS",
    "ORIGIN",
    "QUARTER",
    "Isometry",
    "Neighbour",
    "Patch",
    "Placements",
    "bounding_cell",
    "cubic_cell",
    "orbit",
    "placed_corners",
]

Integers = NDArray[np.int64]
# p -> M p + m, in quarters.
Isometry = tuple[Integers, Integers]
QuarterCorners = tuple[tuple[int, int, int], ...]

QUARTER = 0.25
CELL_QUARTERS = 8
ORIGIN = np.zeros(3, dtype=np.int64)
_ROTOINVERSION = ROTOINVERSION.astype(np.int64)
# At the midpoint of edge 3, of every family.
_NORMAL = np.array([1, 0, 1])


class Neighbour(Enum):
    """Rule by which a patch's neighbour across an edge follows: the isometry, and the side it leads to."""

    HALF_TURN_ABOUT_NORMAL = "half-turn about the surface's normal at the edge's midpoint"
    HALF_TURN_ABOUT_EDGE = "half-turn about the edge, a straight line"
    REFLECTION_IN_PLANE = "reflection in the plane of the edge"


@dataclass(frozen=True, slots=True)
class Patch:
    """A family's patch as its lattice knows it: where its corners are and what lies beyond its edges.

    Attributes
    ----------
    family : Family
    corners : tuple
        About the centre, in quarters, in the order of :func:`gyroid_cad.surface.patch.parameter_corners`.
    neighbour : Neighbour
    mirror : tuple, optional
        A reflection that maps the patch onto itself, if it has one: that in the plane with this normal.
    """

    family: Family
    corners: QuarterCorners
    neighbour: Neighbour
    mirror: tuple[int, int, int] | None = None

    @property
    def corner_array(self) -> Integers:
        """Corners; shape (4, 3)."""
        return np.array(self.corners)

    def beyond(self, edge: int) -> tuple[Isometry, int]:
        """The isometry that carries the patch to its neighbour across an edge, and -1 if it exchanges the sides."""
        start, end = self.corner_array[3], self.corner_array[0]
        chord = end - start
        match self.neighbour:
            case Neighbour.HALF_TURN_ABOUT_NORMAL:
                matrix, fixed, side = _half_turn(_NORMAL), (start, end), 1
            case Neighbour.HALF_TURN_ABOUT_EDGE:
                matrix, fixed, side = _half_turn(chord), (start, start), -1
            case Neighbour.REFLECTION_IN_PLANE:
                matrix, fixed, side = -_half_turn(np.cross(chord, _NORMAL)), (start, start), 1
        # Found for edge 3; the patch's own rotoinversion carries that to the others.
        turn = np.linalg.matrix_power(_ROTOINVERSION, (edge + 1) % 4)
        shift = fixed[1] - matrix @ fixed[0]
        return (turn @ matrix @ turn.T, turn @ shift), side


def _half_turn(axis: Integers) -> Integers:
    """About an axis along which a half-turn permutes the coordinate axes."""
    square = int(axis @ axis)
    matrix, rest = np.divmod(2 * np.outer(axis, axis), square)
    if np.any(rest):
        raise ValueError(f"a half-turn about {axis} does not permute the axes")
    return np.asarray(matrix - np.eye(3, dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Placements:
    """Isometries p -> M p + m that carry a patch, centred at the origin, to its places.

    Attributes
    ----------
    patch : Patch
    matrices : ndarray of int, shape (n, 3, 3)
        Signed permutations.
    translations : ndarray of int, shape (n, 3)
        In quarters of the bounding-cell length.
    bounding_cell : ndarray of int, shape (n,)
        Which part of the cell a placement belongs to, from 0: the gyroid's BC.
    """

    patch: Patch
    matrices: Integers
    translations: Integers
    bounding_cell: Integers

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def __len__(self) -> int:
        return len(self.matrices)

    @property
    def sides(self) -> Integers:
        """+1 where the patch's own normal, carried along, points to the common side, else -1; shape (n,).

        Every patch is placed so that du x dv points to the common side: improper placements carry its own normal to
        the other. So the sign is the determinant.
        """
        return np.asarray(np.rint(np.linalg.det(self.matrices)), dtype=np.int64)

    def transformed(self, matrix: Integers, translation: tuple[int, int, int]) -> Placements:
        """Follow every placement by p -> matrix p + translation (in quarters)."""
        return replace(
            self, matrices=matrix @ self.matrices, translations=self.translations @ matrix.T + np.array(translation)
        )

    def joined(self, *others: Placements) -> Placements:
        """Join these placements and those of others after them."""
        every = (self, *others)
        return Placements(
            self.patch,
            np.concatenate([p.matrices for p in every]),
            np.concatenate([p.translations for p in every]),
            np.concatenate([p.bounding_cell for p in every]),
        )


def placed_corners(placements: Placements) -> Integers:
    """Corners of the placed patches, in quarters; shape (n, 4, 3)."""
    turned = np.einsum("nij,kj->nki", placements.matrices, placements.patch.corner_array)
    return np.asarray(turned + placements.translations[:, np.newaxis])


def orbit(patch: Patch, first: tuple[int, int, int]) -> Placements:
    """One cell's patches, each found from a neighbour across an edge, the centre of the first one given.

    Two places are one if they differ by whole cells. Their centres are brought into the cell [0, 8)^3, and its
    octants, those in which there are any, are the parts they belong to.

    Parameters
    ----------
    patch : Patch
    first : tuple of int
        Centre of the patch that keeps its own orientation, in quarters.

    Raises
    ------
    ValueError
        If the neighbour rule makes no surface of two sides.
    """
    steps = [patch.beyond(edge) for edge in range(4)]
    identity: tuple[Integers, Integers, int] = (np.eye(3, dtype=np.int64), np.array(first), 1)
    found = {_place(patch, identity[0], identity[1]): identity}
    waiting = [identity]
    while waiting:
        matrix, translation, side = waiting.pop(0)
        for (onward, shift), exchanged in steps:
            beyond = matrix @ onward, matrix @ shift + translation, side * exchanged
            key = _place(patch, beyond[0], beyond[1])
            if key not in found:
                found[key] = beyond
                waiting.append(beyond)
            elif _normal(found[key]) != _normal(beyond):
                raise ValueError("the neighbour rule makes a surface of one side")
    upright = [_upright(patch, *placed) for placed in found.values()]
    matrices, translations = (np.array(some) for some in zip(*upright, strict=True))
    translations %= CELL_QUARTERS
    octants = translations // (CELL_QUARTERS // 2) @ np.array([4, 2, 1])
    octant = np.unique(octants, return_inverse=True)[1]
    order = np.lexsort((*translations.T[::-1], octant))
    return Placements(patch, matrices[order], translations[order], octant[order])


def _place(patch: Patch, matrix: Integers, translation: Integers) -> Hashable:
    """Key that tells places apart that differ by more than whole cells and symmetries of the patch."""
    corners = patch.corner_array @ matrix.T
    return tuple((translation % CELL_QUARTERS).tolist()), frozenset(map(tuple, corners.tolist()))


def _normal(placed: tuple[Integers, Integers, int]) -> tuple[int, ...]:
    """The normal at the patch's centre, where it is upright, on the common side."""
    matrix, _, side = placed
    return tuple((side * matrix[:, 2]).tolist())


def _upright(patch: Patch, matrix: Integers, translation: Integers, side: int) -> Isometry:
    """The placement, turned over within its place if need be, so that du x dv points to the common side."""
    if round(float(np.linalg.det(matrix))) == side:
        return matrix, translation
    if patch.mirror is None:
        raise ValueError("a patch without a mirror cannot be turned over within its place")
    return matrix @ -_half_turn(np.array(patch.mirror)), translation


# Eqs. (4), (5) at the angles the paper uses.
_T_X, _T_Y, _T_Z = np.diag([-1, 1, 1]), np.diag([1, -1, 1]), np.diag([1, 1, -1])
_R_X_BACK = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
_R_Y_BACK = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
_D = _T_Z @ _R_Y_BACK @ _R_X_BACK
_A = 4  # one bounding-cell length, in quarters


def bounding_cell(patch: Patch) -> Placements:
    """The six patches of eqs. (15) to (17), which meet at (1/2, 1/2, 1/2).

    Parameters
    ----------
    patch : Patch
        The gyroid's.
    """
    centred = Placements(patch, np.eye(3, dtype=np.int64)[np.newaxis], ORIGIN[np.newaxis], ORIGIN[:1])
    placed = [centred.transformed(np.eye(3, dtype=np.int64), (4, 2, 1))]
    for _ in range(5):
        placed.append(placed[-1].transformed(_D, (0, 0, _A)))
    return placed[0].joined(*placed[1:])


def cubic_cell(patch: Patch) -> Placements:
    """The 24 patches of eqs. (18), (19), corrected: B2 = T_y B + A(1, 0, 0).

    Four bounding cells at alternate places of a 2 x 2 x 2 block; the block is moved so that its lowest
    corner is the origin.

    Parameters
    ----------
    patch : Patch
        The gyroid's.
    """
    b = bounding_cell(patch)
    cells = [
        b,
        b.transformed(_T_Y, (_A, 0, 0)),
        b.transformed(_T_Y @ _T_Z, (_A, _A, 0)),
        b.transformed(_T_X @ _T_Y, (_A, 0, -_A)),
    ]
    numbers = np.repeat(np.arange(len(cells)), len(b))
    every = cells[0].joined(*cells[1:]).transformed(np.eye(3, dtype=np.int64), (0, _A, _A))
    return Placements(patch, every.matrices, every.translations, numbers)

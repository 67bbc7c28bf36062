"""From the semi-fundamental patch (SFP) to the bounding cell (BC) and the cubic cell (CC), in integers.

Every corner of every patch lies on the grid of quarters of the bounding-cell length, so placements are
signed permutations and translations in quarters: nothing here is rounded, and equality is exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.arrays import freeze_arrays

__all__ = [
    "CELL_QUARTERS",
    "PATCH_CORNERS",
    "QUARTER",
    "Placements",
    "bounding_cell",
    "cubic_cell",
    "placed_corners",
]

Integers = NDArray[np.int64]

QUARTER = 0.25
CELL_QUARTERS = 8
# Corners of the patch about its centre, in the order of patch.parameter_corners().
PATCH_CORNERS = np.array([[-2, 0, 1], [0, -2, -1], [2, 0, 1], [0, 2, -1]])
PATCH_CORNERS.setflags(write=False)

# The paper's eqs. (4), (5) at the angles it uses.
_T_X, _T_Y, _T_Z = np.diag([-1, 1, 1]), np.diag([1, -1, 1]), np.diag([1, 1, -1])
_R_X_BACK = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
_R_Y_BACK = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])
_D = _T_Z @ _R_Y_BACK @ _R_X_BACK
_A = 4  # one bounding-cell length, in quarters


@dataclass(frozen=True, slots=True, eq=False)
class Placements:
    """Isometries p -> M p + m that carry the patch, centred at the origin, to its places.

    Attributes
    ----------
    matrices : ndarray of int, shape (n, 3, 3)
        Signed permutations.
    translations : ndarray of int, shape (n, 3)
        In quarters of the bounding-cell length.
    bounding_cell : ndarray of int, shape (n,)
        Which BC of the cell (0 to 3) a placement belongs to.
    """

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

        Proper motions of the gyroid keep its two sides, improper ones exchange them, so the sign is the
        determinant.
        """
        return np.asarray(np.rint(np.linalg.det(self.matrices)), dtype=np.int64)

    def transformed(self, matrix: Integers, translation: tuple[int, int, int]) -> Placements:
        """Follow every placement by p -> matrix p + translation (in quarters)."""
        return Placements(
            matrix @ self.matrices,
            self.translations @ matrix.T + np.array(translation),
            self.bounding_cell,
        )


def bounding_cell() -> Placements:
    """The six patches of eqs. (15) to (17), which meet at (1/2, 1/2, 1/2)."""
    first = Placements(np.eye(3, dtype=np.int64)[np.newaxis], np.array([[4, 2, 1]]), np.zeros(1, dtype=np.int64))
    patches = [first]
    for _ in range(5):
        patches.append(patches[-1].transformed(_D, (0, 0, _A)))
    return _joined(patches)


def cubic_cell() -> Placements:
    """The 24 patches of eqs. (18), (19), corrected: B2 = T_y B + A(1, 0, 0).

    Four bounding cells at alternate places of a 2 x 2 x 2 block; the block is moved so that its lowest
    corner is the origin.
    """
    b = bounding_cell()
    cells = [
        b,
        b.transformed(_T_Y, (_A, 0, 0)),
        b.transformed(_T_Y @ _T_Z, (_A, _A, 0)),
        b.transformed(_T_X @ _T_Y, (_A, 0, -_A)),
    ]
    labelled = [Placements(c.matrices, c.translations, np.full(len(c), k)) for k, c in enumerate(cells)]
    return _joined(labelled).transformed(np.eye(3, dtype=np.int64), (0, _A, _A))


def placed_corners(placements: Placements) -> Integers:
    """Corners of the placed patches, in quarters; shape (n, 4, 3)."""
    return np.asarray(
        np.einsum("nij,kj->nki", placements.matrices, PATCH_CORNERS) + placements.translations[:, np.newaxis]
    )


def _joined(parts: list[Placements]) -> Placements:
    return Placements(
        np.concatenate([p.matrices for p in parts]),
        np.concatenate([p.translations for p in parts]),
        np.concatenate([p.bounding_cell for p in parts]),
    )

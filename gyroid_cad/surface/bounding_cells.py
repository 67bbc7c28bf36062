"""The paper's bounding cell (BC) and cubic cell (CC): where a user of it expects the gyroid's patches."""

from __future__ import annotations

import numpy as np

from gyroid_cad.surface.symmetry import ORIGIN, Patch, Placements

__all__ = ["bounding_cell", "cubic_cell"]

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

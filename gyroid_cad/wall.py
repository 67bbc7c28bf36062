"""The wall: two control nets a patch, in millimetres, and where they stand.

Everything downstream (solid, meshes, volumes) reads these nets; nothing derives the surface again. Side
0 is the face on the far side of the common normal, side 1 the one it points to. On both, du x dv points
along the common normal, for a placement that exchanges the sides also turns the patch over.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.arrays import freeze_arrays
from gyroid_cad.complex import CellComplex
from gyroid_cad.errors import ParameterError
from gyroid_cad.fit import FittedPatch, largest_offset, require_shared_edges
from gyroid_cad.nurbs import NurbsSurface, basis, edge_row, gauss_points
from gyroid_cad.symmetry import QUARTER

__all__ = ["SIDES", "Wall", "build_wall"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SIDES = (0, 1)


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """Control nets of the wall's two faces, shared between patches that differ by a translation.

    Attributes
    ----------
    complex : CellComplex
    nets : ndarray, shape (distinct, 2, n, n, 3)
        Control points in mm, by distinct patch and side.
    patch_net : ndarray of int, shape (patches,)
        Which distinct net a patch has.
    shifts : ndarray, shape (shifts, 3)
        Translations in mm.
    patch_shift : ndarray of int, shape (patches,)
        Which translation a patch has.
    weights : ndarray, shape (n, n)
    knots : ndarray, shape (n + 4,)
    """

    complex: CellComplex
    nets: Floats
    patch_net: Integers
    shifts: Floats
    patch_shift: Integers
    weights: Floats
    knots: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def face(self, net: int, side: int) -> NurbsSurface:
        """One face of a distinct patch, before its translation."""
        return NurbsSurface(self.nets[net, side], self.weights, self.knots, self.knots)

    def side_wall(self, net: int, edge: int) -> NurbsSurface:
        """The ruled surface through the wall along edge ``edge``, from side 0 to side 1.

        u runs along the edge as the patch does, v from 0 to 1 across; du x dv points out of the patch.
        """
        rows = np.stack([edge_row(self.nets[net, side], edge) for side in SIDES], axis=1)
        weights = np.repeat(edge_row(self.weights, edge)[:, np.newaxis], 2, axis=1)
        return NurbsSurface(rows, weights, self.knots, np.array([0.0, 0.0, 1.0, 1.0]))

    def volume(self) -> float:
        """Volume in mm3, by Gauss quadrature of the Jacobian determinant over the ruled patches.

        Exact to rounding for polynomial nets: no kernel is asked.
        """
        uses = np.bincount(self.patch_net, minlength=len(self.nets))
        volumes = [self._patch_volume(net) if uses[net] else 0.0 for net in range(len(self.nets))]
        return float(uses @ np.array(volumes))

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box round the wall, in mm, to about 1e-6 of its size."""
        low, high = np.empty((len(self.nets), 3)), np.empty((len(self.nets), 3))
        for net in range(len(self.nets)):
            boxes = [_extent(self.face(net, side)) for side in SIDES]
            low[net] = np.min([box[0] for box in boxes], axis=0)
            high[net] = np.max([box[1] for box in boxes], axis=0)
        shift = self.shifts[self.patch_shift]
        return (low[self.patch_net] + shift).min(axis=0), (high[self.patch_net] + shift).max(axis=0)

    def _patch_volume(self, net: int) -> float:
        u, v, weights = self.face(net, 0).quadrature()
        below, above = (self.face(net, side).derivatives(u, v) for side in SIDES)
        through = above[0, 0] - below[0, 0]
        total = 0.0
        for height, height_weight in zip(*gauss_points(np.array([0.0, 1.0]), 2), strict=True):
            du, dv = ((1 - height) * below[i] + height * above[i] for i in ((1, 0), (0, 1)))
            total += height_weight * float(np.sum(weights * np.sum(np.cross(du, dv) * through, axis=-1)))
        return total


def build_wall(complex: CellComplex, patch: FittedPatch, cell_size: float, thickness: float) -> Wall:
    """Lay a wall of constant thickness off along the patch's normals.

    Parameters
    ----------
    complex : CellComplex
    patch : FittedPatch
    cell_size, thickness : float
        In mm.

    Returns
    -------
    Wall

    Raises
    ------
    FitError
        If the fit's edges do not meet those of its neighbours.
    ParameterError
        If the wall is so thick that the fit folds over.
    """
    require_shared_edges(patch)
    bounding_cell_length = cell_size / 2
    limit = 2 * largest_offset(patch) * bounding_cell_length
    if not thickness < limit:
        raise ParameterError(
            "thickness",
            thickness,
            f"below {limit:.6g} mm, where the fit with {patch.settings.control_points} control points folds over",
        )
    placements = complex.placements
    half = thickness / 2 / bounding_cell_length
    nets = []
    for matrix, translation, sign in zip(placements.matrices, placements.translations, placements.sides, strict=True):
        faces = [
            patch.offset(sign * side * half).transformed(matrix, translation * QUARTER).control_points
            for side in (-1, 1)
        ]
        nets.append(np.stack(faces) * bounding_cell_length)
    cells, patch_shift = np.unique(complex.patch_cell, axis=0, return_inverse=True)
    return Wall(
        complex=complex,
        nets=np.stack(nets),
        patch_net=complex.patch_placement,
        shifts=np.asarray(cells * cell_size, dtype=float),
        patch_shift=patch_shift.ravel(),
        weights=patch.surface.weights,
        knots=patch.surface.knots_u,
    )


def _extent(surface: NurbsSurface, samples: int = 25, rounds: int = 4) -> tuple[Floats, Floats]:
    """Box of a surface on [-1, 1]^2: a grid of samples, refined round each extreme one."""
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):
        for bound, best in ((low, np.argmin), (high, np.argmax)):
            centre_u = centre_v = 0.0
            reach = 1.0
            for _ in range(rounds):
                u, v = (np.clip(centre + reach * np.linspace(-1, 1, samples), -1, 1) for centre in (centre_u, centre_v))
                values = _grid_coordinate(surface, u, v, axis)
                i, j = np.unravel_index(best(values), values.shape)
                centre_u, centre_v, reach = float(u[i]), float(v[j]), reach * 3 / samples
                bound[axis] = values[i, j]
    return low, high


def _grid_coordinate(surface: NurbsSurface, u: Floats, v: Floats, axis: int) -> Floats:
    along_u = basis(surface.knots_u, surface.degree_u, u)
    along_v = basis(surface.knots_v, surface.degree_v, v)
    denominator = along_u @ surface.weights @ along_v.T
    return np.asarray(along_u @ (surface.weights * surface.control_points[..., axis]) @ along_v.T / denominator)

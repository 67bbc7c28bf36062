"""The wall: two control nets a patch, in millimetres, and where they stand.

Everything downstream (solid, meshes, volumes) reads these nets; nothing derives the surface again. Side
0 is the face on the far side of the common normal, side 1 the one it points to. On both, du x dv points
along the common normal, for a placement that exchanges the sides also turns the patch over. Sides 2 to 5 are
the walls through the lattice along a patch's edges 0 to 3, from side 0 to side 1; on them du x dv points out
of the patch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.basis import greville
from gyroid_cad.nurbs.surface import NurbsSurface, edge_row, grid_derivatives, layer_volumes
from gyroid_cad.surface.fit import FittedPatch, max_offset, require_shared_edges
from gyroid_cad.surface.symmetry import QUARTER
from gyroid_cad.wall.complex import CellComplex

__all__ = ["SIDES", "Wall", "build_wall", "side_along"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SIDES = (0, 1)
# Through a straight line from -1 to 1, in the parameter that runs from side 0 to side 1.
_ACROSS = np.array([-1.0, -1.0, 1.0, 1.0])
# So few that what is computed for them stays in the processor's cache.
_NETS_AT_ONCE = 64


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

        u runs along the edge as the patch does, v from -1 to 1 across; du x dv points out of the patch.
        """
        rows = np.stack([edge_row(self.nets[net, side], edge) for side in SIDES], axis=1)
        weights = np.repeat(edge_row(self.weights, edge)[:, np.newaxis], 2, axis=1)
        return NurbsSurface(rows, weights, self.knots, _ACROSS)

    def nets_of(self, net: Integers, side: Integers) -> Floats:
        """Control points of sides of distinct patches, each in the basis that the faces have.

        A side wall is linear across: its net lies evenly between both rims, at Greville's abscissae. Of weights it
        knows none, as walls that end somewhere have none.

        Parameters
        ----------
        net, side : ndarray of int, shape (m,)
            Sides from 0 to 5.

        Returns
        -------
        ndarray, shape (m, n, n, 3)
        """
        made = self.nets[net, np.minimum(side, SIDES[1])]
        share = ((greville(self.knots, 3) + 1) / 2)[:, np.newaxis]
        for edge in range(4):
            some = np.flatnonzero(side == side_along(edge))
            low, high = (edge_row(np.moveaxis(self.nets[net[some], face], 0, 2), edge) for face in SIDES)
            made[some] = np.moveaxis((1 - share) * low[:, :, np.newaxis] + share * high[:, :, np.newaxis], 1, 0)
        return made

    def volume(self, patches: Integers | None = None) -> float:
        """Volume in mm3 of the wall, or of some of its patches, by Gauss quadrature of the Jacobian determinant.

        Exact to rounding for polynomial nets: no kernel is asked.
        """
        uses = np.bincount(self.patch_net if patches is None else self.patch_net[patches], minlength=len(self.nets))
        return float(
            sum(
                uses[first : first + _NETS_AT_ONCE]
                @ _volumes(self.nets[first : first + _NETS_AT_ONCE], self.face(0, 0))
                for first in range(0, len(self.nets), _NETS_AT_ONCE)
            )
        )

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box round the wall, in mm, to about 1e-6 of its size."""
        # Surfaces lie in the box of their control points: only those that could reach furthest are looked at closely.
        shift = self.shifts[self.patch_shift]
        bounds = []
        for reaches, towards in ((np.min, 1), (np.max, -1)):
            hull = towards * (reaches(self.nets, axis=(1, 2, 3))[self.patch_net] + shift)
            bounds.append([towards * self._furthest(axis, towards, hull[:, axis]) for axis in range(3)])
        return np.array(bounds[0]), np.array(bounds[1])

    def moved(self, rotation: Floats, translation: Floats) -> Wall:
        """The wall after p -> rotation p + translation, in mm."""
        return replace(self, nets=self.nets @ rotation.T, shifts=self.shifts @ rotation.T + translation)

    def _furthest(self, axis: int, towards: int, hull: Floats) -> float:
        """Least value of ``towards`` times a coordinate over all faces, given what their control points reach."""
        furthest = np.inf
        known: dict[int, float] = {}
        for patch in np.argsort(hull).tolist():
            if hull[patch] >= furthest:
                break
            net = int(self.patch_net[patch])
            if net not in known:
                known[net] = min(towards * _extreme(self.face(net, side), axis, towards) for side in SIDES)
            furthest = min(furthest, known[net] + towards * float(self.shifts[self.patch_shift[patch], axis]))
        return furthest


def side_along(edge: int) -> int:
    """Number of the side that is the wall along an edge of a patch.

    Examples
    --------
    >>> [side_along(edge) for edge in range(4)]
    [2, 3, 4, 5]
    """
    return len(SIDES) + edge


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
    limit = 2 * max_offset(patch) * bounding_cell_length
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


def _volumes(nets: Floats, like: NurbsSurface) -> Floats:
    """Volume between the two faces of each net; shape (nets,)."""
    u, v, weights = like.quadrature()
    knots = (like.knots_u, like.knots_v)
    below, above = np.moveaxis(nets, 1, 0)
    _, middle_u, middle_v = grid_derivatives((above + below) / 2, like.weights, knots, u.ravel(), v.ravel())
    half, half_u, half_v = grid_derivatives((above - below) / 2, like.weights, knots, u.ravel(), v.ravel())
    return np.asarray(np.einsum("uv,puv->p", weights, layer_volumes((middle_u, middle_v), (half_u, half_v), half)))


def _extreme(surface: NurbsSurface, axis: int, towards: int, samples: int = 25, rounds: int = 4) -> float:
    """Least (``towards`` 1) or largest (-1) coordinate on [-1, 1]^2: samples, refined round the extreme one."""
    centre_u = centre_v = best = 0.0
    reach = 1.0
    for _ in range(rounds):
        u, v = (np.clip(centre + reach * np.linspace(-1, 1, samples), -1, 1) for centre in (centre_u, centre_v))
        values = surface.evaluate(u[:, np.newaxis], v[np.newaxis])[..., axis]
        i, j = np.unravel_index(np.argmin(towards * values), values.shape)
        centre_u, centre_v, reach, best = float(u[i]), float(v[j]), reach * 3 / samples, float(values[i, j])
    return best

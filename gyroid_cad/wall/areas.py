"""Areas of a wall's faces and of the side walls that close its rim; sizes of the solids that they bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.nurbs.quadrature import shifted_integrals
from gyroid_cad.nurbs.surface import face_integrals, grid_derivatives
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.exact import differentiation_matrix, grid_rates, offset_patches
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["ShapeSize", "WallAreas", "distinct_patches", "exact_areas", "fitted_areas", "joint_size", "piece_sizes"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Gauss points along each side of an exact patch, and across a side wall, in whose direction the integrand is the root
# of a polynomial that is nearly constant.
_EXACT_POINTS, _ACROSS_POINTS = 16, 4
# So few that what is computed for them stays in the processor's cache.
_NETS_AT_ONCE = 64


@dataclass(frozen=True, slots=True)
class ShapeSize:
    """Size of a shape, by quadrature.

    Attributes
    ----------
    volume, area : float
        In mm3 and mm2, of all its bodies; shells have no volume.
    centroid : tuple of float, optional
        Of the volume, in mm; none where it is not known as exactly.
    """

    volume: float
    area: float
    centroid: Point | None = None


def joint_size(sizes: Sequence[ShapeSize]) -> ShapeSize:
    """Size of several shapes together; its centroid is known if all of theirs are.

    Examples
    --------
    >>> joint_size([ShapeSize(1.0, 6.0, (0.5, 0.5, 0.5)), ShapeSize(3.0, 9.0, (2.5, 0.5, 0.5))])
    ShapeSize(volume=4.0, area=15.0, centroid=(2.0, 0.5, 0.5))
    """
    volume, area = sum(size.volume for size in sizes), sum(size.area for size in sizes)
    known = [(size.volume, size.centroid) for size in sizes if size.centroid is not None]
    if not volume or len(known) < len(sizes):
        return ShapeSize(volume, area)
    x, y, z = (sum(share * centroid[axis] for share, centroid in known) / volume for axis in range(3))
    return ShapeSize(volume, area, (x, y, z))


@dataclass(frozen=True, slots=True)
class WallAreas:
    """Areas in mm2 of a wall's surfaces.

    Attributes
    ----------
    face_a, face_b : float
        Towards the network that the common normal points to, and towards the other.
    rim : float
        Of the side walls in which a block of whole patches ends.
    """

    face_a: float
    face_b: float
    rim: float = 0.0

    @property
    def faces(self) -> float:
        """Area of both faces."""
        return self.face_a + self.face_b

    @property
    def total(self) -> float:
        """Area of all that bounds the wall."""
        return self.faces + self.rim


def fitted_areas(wall: Wall) -> WallAreas:
    """Areas of the fitted faces, and of the side walls that close the lattice's rim, by Gauss quadrature of the nets.

    Parameters
    ----------
    wall : Wall

    Returns
    -------
    WallAreas
    """
    uses = np.bincount(wall.patch_net, minlength=len(wall.nets))
    rule = wall.face(0, 0).quadrature()
    face_b, face_a = (uses @ face_integrals(wall.nets, wall.weights, (wall.knots, wall.knots), *rule)[..., 4]).tolist()
    return WallAreas(face_a=face_a, face_b=face_b, rim=float(_rim_areas(wall).sum()))


def piece_sizes(wall: Wall) -> list[ShapeSize]:
    """Sizes of the solids that a wall of whole patches is, one a piece that is connected by edges.

    Volumes and centroids by the divergence theorem: Gauss quadrature of the flux of p / 3, and of x^2 / 2 along each
    axis, out of every fitted face and side wall, exact for polynomial nets. :meth:`Wall.volume` integrates the Jacobian
    determinant between the faces instead, so that the two agree only if the faces close. A volume is negative if the
    faces look inwards.
    """
    complex, knots = wall.complex, wall.knots
    shifts = wall.shifts[wall.patch_shift]
    # Moments are taken about it, so that digits are not lost far from the origin.
    middle = (shifts + wall.nets.mean(axis=(1, 2, 3))[wall.patch_net]).mean(axis=0)
    shifts = shifts - middle
    both = face_integrals(wall.nets, wall.weights, (knots, knots), *wall.face(0, 0).quadrature(), moments=True)
    # Side 0 looks the other way.
    flux, moments = shifted_integrals((both[:, 1] - both[:, 0])[wall.patch_net], shifts)
    areas = both[..., 4].sum(axis=1)[wall.patch_net] + _rim_areas(wall)
    for edge in range(4):
        ends = np.flatnonzero(complex.free[complex.patch_edges[:, edge]])
        nets, which = np.unique(wall.patch_net[ends], return_inverse=True)
        sides = [wall.side_wall(net, edge) for net in nets.tolist()]
        if sides:
            rows, one = np.stack([side.control_points for side in sides]), sides[0]
            rule = (one.knots_u, one.knots_v), *one.quadrature()
            found = shifted_integrals(face_integrals(rows, one.weights, *rule, moments=True)[which], shifts[ends])
            flux[ends] += found[0]
            moments[ends] += found[1]
    sums = np.zeros((complex.component_count, 5))
    np.add.at(sums, complex.patch_component, np.column_stack([flux, areas, moments]))
    centroids = middle + sums[:, 2:] / sums[:, :1]
    return [
        ShapeSize(volume, area, (x, y, z))
        for volume, area, (x, y, z) in zip(*sums[:, :2].T.tolist(), centroids.tolist(), strict=True)
    ]


def exact_areas(complex: CellComplex, grading: Grading, patches: Integers, uses: Integers) -> WallAreas:
    """Areas of the exact wall's faces, by quadrature; patches are analytic, so it converges faster than any power.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading
    patches, uses : ndarray of int
        Which patches are looked at, and for how many each of them stands.

    Returns
    -------
    WallAreas
        Without a rim.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_EXACT_POINTS)
    rate, shape = differentiation_matrix(nodes), (-1, len(nodes), len(nodes), 3)
    totals = np.zeros(2)
    for some, exact in offset_patches(complex, grading, nodes, patches):
        offset = exact.normals * (exact.thickness / 2)[:, np.newaxis]
        for side in SIDES:
            face = (exact.points + (2 * side - 1) * offset).reshape(shape)
            area = np.linalg.norm(np.cross(*grid_rates(rate, face)), axis=-1)
            totals[side] += float(np.einsum("p,u,v,puv->", uses[some], weights, weights, area))
    return WallAreas(face_a=float(totals[1]), face_b=float(totals[0]))


def distinct_patches(wall: Wall) -> tuple[Integers, Integers]:
    """One of the patches that are alike, and how many are like it."""
    _, patches, uses = np.unique(wall.patch_net, return_index=True, return_counts=True)
    return patches.astype(np.int64), uses.astype(np.int64)


def _rim_areas(wall: Wall) -> Floats:
    """Area of each patch's ruled side walls, along its free edges; shape (patches,)."""
    free = wall.complex.free[wall.complex.patch_edges]
    ended = np.unique(wall.patch_net[free.any(axis=1)])
    areas = np.zeros((len(wall.nets), 4))
    for first in range(0, len(ended), _NETS_AT_ONCE):
        some = ended[first : first + _NETS_AT_ONCE]
        areas[some] = _side_wall_areas(wall, wall.nets[some])
    return np.asarray(np.sum(free * areas[wall.patch_net], axis=1))


def _side_wall_areas(wall: Wall, nets: Floats) -> Floats:
    """Areas of the four side walls of each net; shape (nets, 4)."""
    along, along_weights = gauss_points(wall.knots, _ACROSS_POINTS)
    nodes, across_weights = np.polynomial.legendre.leggauss(_ACROSS_POINTS)
    across, across_weights = (nodes + 1) / 2, across_weights / 2
    knots, ends = (wall.knots, wall.knots), (-1.0, 1.0)
    at_v, rate_u, _ = grid_derivatives(nets, wall.weights, knots, along, ends)
    at_u, _, rate_v = grid_derivatives(nets, wall.weights, knots, ends, along)
    areas = np.empty((len(nets), 4))
    # As edges run round the square: v = -1, u = 1, v = 1, u = -1.
    curves = (
        (at_v[..., 0, :], rate_u[..., 0, :]),
        (at_u[..., 1, :, :], rate_v[..., 1, :, :]),
        (at_v[..., 1, :], rate_u[..., 1, :]),
        (at_u[..., 0, :, :], rate_v[..., 0, :, :]),
    )
    for edge, (points, rates) in enumerate(curves):
        through = (points[:, 1] - points[:, 0])[:, np.newaxis]
        s = across[:, np.newaxis, np.newaxis]
        between = (1 - s) * rates[:, 0, np.newaxis] + s * rates[:, 1, np.newaxis]
        element = np.linalg.norm(np.cross(between, through), axis=-1)
        areas[:, edge] = np.einsum("s,a,psa->p", across_weights, along_weights, element)
    return areas

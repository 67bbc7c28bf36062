"""Faces of a wall near a part's boundary, in place, and which of the part's faces may cross each."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.nurbs.basis import basis
from gyroid_cad.nurbs.roots import foot_step
from gyroid_cad.nurbs.surface import edge_row, grid_points, point_derivatives
from gyroid_cad.trim.boundary import Boundary
from gyroid_cad.wall.offset import SIDES, Wall, side_along

__all__ = ["GRID", "LatticeFaces", "Pairs", "pairs_of"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places along each side of the square at which faces are looked at, and how many faces at a time.
GRID = 33
_AT_ONCE = 256
# Along each side, places from the nearest of which the foot of a perpendicular is looked for; in so many steps; and
# how far beyond the rim.
_STARTS, _FOOT_STEPS, _REACHED = 7, 5, 1.15


@dataclass(frozen=True, eq=False)
class LatticeFaces:
    """Some faces of a wall: sides of its patches, and walls where it ends.

    Their borders are rims: edges of the complex on side 0, the same on side 1, then the posts through the wall at its
    fans. Corners are known by fans on side 0, then on side 1.

    Attributes
    ----------
    wall : Wall
    patch, side : ndarray of int, shape (faces,)
        Sides from 0 to 5, as of :class:`~gyroid_cad.wall.offset.Wall`.
    """

    wall: Wall
    patch: Integers
    side: Integers

    @cached_property
    def nets(self) -> Floats:
        """Control points in place, in mm; shape (faces, n, n, 3)."""
        shifts = self.wall.shifts[self.wall.patch_shift[self.patch]]
        return np.asarray(self.wall.nets_of(self.wall.patch_net[self.patch], self.side) + shifts[:, None, None])

    @cached_property
    def rims(self) -> Integers:
        """Number of the rim along each side of the square; shape (faces, 4)."""
        complex = self.wall.complex
        edge, (start, end) = complex.patch_edges[self._edge], self._fans
        rims = self.side[:, None] * complex.edge_count + complex.patch_edges[self.patch]
        through = len(SIDES) * complex.edge_count
        own = np.stack([edge, through + end, complex.edge_count + edge, through + start], axis=1)
        return np.where(self._ends, own, rims)

    @cached_property
    def forward(self) -> Booleans:
        """Mask of the sides of the square that run the way the rim does; shape (faces, 4).

        Those through the wall run from side 0 to side 1.
        """
        own = self.wall.complex.edge_forward[self._edge]
        yes = np.ones(len(self), dtype=bool)
        return np.where(
            self._ends, np.stack([own, yes, ~own, ~yes], axis=1), self.wall.complex.edge_forward[self.patch]
        )

    @cached_property
    def fans(self) -> Integers:
        """Number of the fan at each corner of the square; shape (faces, 4)."""
        count, (start, end) = self.wall.complex.fan_count, self._fans
        fans = self.side[:, None] * count + self.wall.complex.patch_fans[self.patch]
        return np.where(self._ends, np.stack([start, end, count + end, count + start], axis=1), fans)

    def corners(self, rims: Integers) -> Integers:
        """The complex's corner of every rim that is a post, -1 of others: posts of fans at one corner are one line."""
        fans = rims - len(SIDES) * self.wall.complex.edge_count
        return np.where(fans >= 0, self.wall.complex.fan_corner[np.maximum(fans, 0)], -1)

    @property
    def _ends(self) -> Booleans:
        """Mask of the walls where the lattice ends; shape (faces, 1)."""
        return (self.side >= side_along(0))[:, None]

    @property
    def _edge(self) -> tuple[Integers, Integers]:
        """Index of the edge that each of these runs along in arrays by patch and edge."""
        return self.patch, np.maximum(self.side - side_along(0), 0)

    @property
    def _fans(self) -> tuple[Integers, Integers]:
        """Fans at the beginning and at the end of that edge, as the patch runs."""
        patch, edge = self._edge
        fans = self.wall.complex.patch_fans
        return fans[patch, edge], fans[patch, (edge + 1) % 4]

    def __len__(self) -> int:
        return len(self.patch)

    @property
    def size(self) -> float:
        """Largest extent of a face, in mm."""
        return float(np.ptp(self.nets, axis=(1, 2)).max(initial=0.0))

    def derivatives(self, face: Integers, u: Floats, v: Floats, order: int = 1) -> tuple[Floats, ...]:
        """Points and derivatives of faces (m,) at parameters (m, q); each of shape (m, q, 3)."""
        wall = self.wall
        return point_derivatives(self.nets[face], wall.weights, (wall.knots, wall.knots), u, v, order)

    def along_sides(self, faces: Integers, sides: Integers, along: Floats) -> Floats:
        """Points of one side each of faces (m,), at parameters (q,) as one runs round the square; shape (m, q, 3)."""
        wall = self.wall
        points = np.empty((len(faces), len(along), 3))
        for side in range(4):
            rows = np.flatnonzero(sides == side)
            weights = edge_row(wall.weights, side)
            net = edge_row(np.moveaxis(self.nets[faces[rows]], 0, 2), side) * weights[:, None, None]
            functions = basis(wall.knots if side < 2 else -wall.knots[::-1], 3, along)
            points[rows] = np.moveaxis(np.tensordot(functions, net, 1), 1, 0) / (functions @ weights)[:, None]
        return points

    def on_grid(self, faces: Integers, count: int) -> Floats:
        """Points on an even grid of parameters; shape (m, count, count, 3)."""
        along, wall = np.linspace(-1, 1, count), self.wall
        return grid_points(self.nets[faces], wall.weights, (wall.knots, wall.knots), along, along)

    def heights(self, faces: Integers, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances of points (m, q, 3) from faces (m,) that go on a little beyond their rims, and the places.

        Returns
        -------
        heights : ndarray, shape (m, q)
            In mm, positive where the face's own normal points to.
        places : ndarray, shape (m, q, 2)
            Parameters of the feet of the perpendiculars.
        """
        starts = np.linspace(-1, 1, _STARTS)
        used, which = np.unique(faces, return_inverse=True)
        grid = self.on_grid(used, _STARTS).reshape(len(used), _STARTS**2, 3)[which]
        nearest = np.stack(
            [np.argmin(np.sum((grid - points[:, k, None]) ** 2, axis=-1), axis=1) for k in range(points.shape[1])],
            axis=1,
        )
        places = np.stack([starts[nearest // _STARTS], starts[nearest % _STARTS]], axis=-1)
        for step in range(_FOOT_STEPS + 1):
            last = step == _FOOT_STEPS
            x, du, dv, *bends = self.derivatives(faces, places[..., 0], places[..., 1], 1 if last else 2)
            if last:
                break
            u, v, sound = foot_step(points - x, du, dv, *bends)
            change = np.where(sound[..., None], np.stack([u, v], axis=-1), 0.0)
            places = np.clip(places + np.clip(change, -0.3, 0.3), -_REACHED, _REACHED)
        normals = np.cross(du, dv)
        return dot(points - x, normals) / np.linalg.norm(normals, axis=-1), places


@dataclass(frozen=True, eq=False)
class Pairs:
    """Faces of a wall with faces of a part that may cross them.

    Attributes
    ----------
    faces : LatticeFaces
    boundary : Boundary
    face, part : ndarray of int, shape (pairs,)
        Faces of the wall, in the order of their numbers, and of the part.
    """

    faces: LatticeFaces
    boundary: Boundary
    face: Integers
    part: Integers

    def by_rim(self) -> tuple[Integers, Integers, Integers, Integers, Integers]:
        """Rims, each on the first face that has it, against every face of the part that one of its faces may meet.

        Returns
        -------
        numbers, owner, side : ndarray of int, shape (rims,)
            Numbers of the rims, and of which face, and which of its sides, each is looked at.
        rim, part : ndarray of int, shape (m,)
            Positions of rims in these arrays, and faces of the part.
        """
        numbers, first = np.unique(self.faces.rims.ravel(), return_index=True)
        owner, side = np.divmod(first, 4)
        index = np.searchsorted(numbers, self.faces.rims)
        both = np.stack([index[self.face].ravel(), np.repeat(self.part, 4)], axis=1)
        rim, part = np.unique(both, axis=0).T
        return numbers, owner, side, rim, part

    def heights(
        self, pair: Integers, u: Floats, v: Floats, near: Floats | None = None, tangent: bool = False
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Depths below the part's faces at places of the wall's, how they change, and the places that are nearest.

        Parameters
        ----------
        pair : ndarray of int, shape (m,)
        u, v : ndarray, shape (m, q)
        near : ndarray, shape (m, q, 2), optional
            Parameters of the part's faces near those looked for.
        tangent : bool
            Whether to measure from the tangent planes there.

        Returns
        -------
        heights : ndarray, shape (m, q)
            In mm, positive inside.
        slopes : ndarray, shape (m, q, 2)
            Along u and v.
        places : ndarray, shape (m, q, 2)
            Parameters of the part's faces.
        points : ndarray, shape (m, q, 3)
        """
        points, du, dv = self.faces.derivatives(self.face[pair], u, v)
        heights, inwards, places = self.boundary.depths(self.part[pair], points, near, tangent)
        return heights, np.stack([dot(du, inwards), dot(dv, inwards)], axis=-1), places, points


def pairs_of(faces: LatticeFaces, boundary: Boundary) -> Pairs:
    """Find the pairs of faces whose boxes meet, and that are no further apart than the wall's face reaches."""
    low, high = (reach(faces.nets, axis=(1, 2)) for reach in (np.min, np.max))
    middle = faces.derivatives(np.arange(len(faces)), np.zeros((len(faces), 1)), np.zeros((len(faces), 1)), 0)[0][:, 0]
    radius = np.linalg.norm(faces.nets - middle[:, None, None], axis=-1).max(axis=(1, 2))
    found: list[tuple[Integers, Integers]] = []
    for number, part in enumerate(boundary.faces):
        near = np.flatnonzero(np.all((low <= part.high) & (high >= part.low), axis=1))
        found.append((near, np.full(len(near), number)))
    face, part_of = (np.concatenate(some) for some in zip(*found, strict=True))
    rough, error = boundary.rough_depths(part_of, middle[face, None])
    near = np.abs(rough[:, 0]) <= radius[face] + error[:, 0]
    face, part_of = face[near], part_of[near]
    order = np.lexsort((part_of, face))
    return Pairs(faces, boundary, face[order], part_of[order])

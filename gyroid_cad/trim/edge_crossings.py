"""Faces of the wall, the planes of a box near them, and where sides of the parameter square cross the planes.

The crossings are found on the square's sides alone, so that neighbours who share a side find the same places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.roots import roots
from gyroid_cad.nurbs.surface import point_derivatives

__all__ = ["AXES", "PLANES", "EdgeCrossings", "FacesToCut", "edge_crossings", "plane_heights", "square_points"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of a box: low and high along x, then y, then z. What is kept lies above the low ones, below the high ones.
PLANES = tuple((axis, sign) for axis in range(3) for sign in (1, -1))
AXES = np.array([axis for axis, _ in PLANES])
_SIGNS = np.array([sign for _, sign in PLANES], dtype=float)
_INWARDS = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
# Along each side of the square: so close that between two of them a height is all but a parabola.
_RIM_SAMPLES = 65
# A gradient across a side, or of the coordinate itself, that small means that face and plane touch; nearer a corner, an
# edge would be too short for the kernel.
_TOUCHING = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class FacesToCut:
    """Faces of the wall, in coordinates along a box's axes, and the planes that come near them.

    Attributes
    ----------
    nets : ndarray, shape (faces, n, n, 3)
        In mm.
    weights : ndarray, shape (n, n)
    knots : ndarray, shape (n + 4,)
    levels : ndarray, shape (faces, 6)
        Coordinate of each of :data:`PLANES`, in mm; not a number where a plane is not near.
    """

    nets: Floats
    weights: Floats
    knots: Floats
    levels: Floats

    def __len__(self) -> int:
        return len(self.nets)

    def chunk(self, first: int, count: int) -> FacesToCut:
        """Some of the faces."""
        chosen = slice(first, first + count)
        return FacesToCut(self.nets[chosen], self.weights, self.knots, self.levels[chosen])

    def derivatives(self, which: Integers, u: Floats, v: Floats) -> tuple[Floats, Floats, Floats]:
        """Points and first derivatives of chosen faces (A4.4), extended past the square's sides.

        Parameters
        ----------
        which : ndarray of int, shape (m,)
        u, v : ndarray, shape (m, q)

        Returns
        -------
        points, du, dv : ndarray, shape (m, q, 3)
        """
        place, du, dv = point_derivatives(self.nets[which], self.weights, (self.knots, self.knots), u, v)
        return place, du, dv

    def points(self, which: Integers, u: Floats, v: Floats) -> Floats:
        """Points of chosen faces alone; shape (m, q, 3)."""
        return point_derivatives(self.nets[which], self.weights, (self.knots, self.knots), u, v, 0)[0]

    def heights(self, which: Integers, u: Floats, v: Floats) -> Floats:
        """Height of points over every plane, on its kept side, in mm; shape (m, q, 6), infinite for planes not near."""
        points = self.points(which, u, v)
        heights = _SIGNS * (points[..., AXES] - self.levels[which][:, np.newaxis])
        return np.where(np.isnan(heights), np.inf, heights)


@dataclass(frozen=True, slots=True, eq=False)
class EdgeCrossings:
    """Crossings of the square's sides with planes, ordered by face, then side, then along the side.

    Attributes
    ----------
    face, side, plane : ndarray of int, shape (crossings,)
    along : ndarray, shape (crossings,)
        In [-1, 1], as one runs round the square.
    entering : ndarray of bool, shape (crossings,)
        Whether the curve that keeps what is wanted on its left enters the square there.
    """

    face: Integers
    side: Integers
    plane: Integers
    along: Floats
    entering: Booleans

    @property
    def places(self) -> Floats:
        """Places of the crossings in the square; shape (crossings, 2)."""
        return np.stack(square_points(self.side, self.along), axis=-1)


def square_points(side: Integers | int, along: Floats) -> tuple[Floats, Floats]:
    """Parameters (u, v) of places on the square's sides, run round it."""
    along = np.asarray(along)
    one = np.ones_like(along)
    u = np.choose(side, [along, one, -along, -one])
    v = np.choose(side, [-one, along, one, -along])
    return u, v


def edge_crossings(faces: FacesToCut) -> EdgeCrossings:
    """Find the crossings of faces' sides with the planes near them.

    Raises
    ------
    KernelError
        If a side only touches a plane, or a corner lies in one.
    """
    step = 2 / (_RIM_SAMPLES - 1)
    samples = np.linspace(-1 - step, 1 + step, _RIM_SAMPLES + 2)
    every = np.arange(len(faces))
    uv = [square_points(side, samples) for side in range(4)]
    u, v = (np.tile(np.concatenate([pair[k] for pair in uv]), (len(faces), 1)) for k in (0, 1))
    heights = faces.heights(every, u, v).reshape(len(faces), 4, len(samples), len(PLANES))
    face, side, plane = np.nonzero(np.isfinite(heights[:, :, 0]))

    def along_side(which: Integers, along: Floats) -> tuple[Floats, Floats]:
        height, slopes = plane_heights(faces, face[which], plane[which], *square_points(side[which], along))
        return height, _rate_along(side[which], slopes)

    which, along = roots(samples, heights[face, side, :, plane], along_side)
    face, side, plane = face[which], side[which], plane[which]
    height, slopes = plane_heights(faces, face, plane, *square_points(side, along))
    steepness = np.linalg.norm(slopes, axis=-1)
    across = slopes[:, 1] * _INWARDS[side, 0] - slopes[:, 0] * _INWARDS[side, 1]
    size = np.ptp(faces.nets) if len(faces) else 1.0
    touching = (np.abs(across) <= _TOUCHING * steepness) | (np.abs(height) > 1e-10 * size)
    if np.any(touching | (np.abs(along) > 1 - _TOUCHING)):
        raise KernelError("an edge of the lattice touches the box")
    order = np.lexsort((along, side, face))
    return EdgeCrossings(face[order], side[order], plane[order], along[order], (across > 0)[order])


def plane_heights(faces: FacesToCut, face: Integers, plane: Integers, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Heights above one plane each, shape of u and v, (m,) or (m, q); and their slopes along u and v, (..., 2)."""
    flat = u.ndim == 1
    if flat:
        u, v = u[:, np.newaxis], v[:, np.newaxis]
    rows = np.arange(len(face))
    values = [d[rows, :, AXES[plane]] for d in faces.derivatives(face, u, v)]
    sign = _SIGNS[plane][:, np.newaxis]
    height = sign * (values[0] - faces.levels[face, plane][:, np.newaxis])
    slopes = sign[..., np.newaxis] * np.stack(values[1:], axis=-1)
    return (height[:, 0], slopes[:, 0]) if flat else (height, slopes)


def _rate_along(side: Integers, slopes: Floats) -> Floats:
    """Rate of change along the side, from the slopes along u and v."""
    return np.choose(side, [slopes[:, 0], slopes[:, 1], -slopes[:, 0], -slopes[:, 1]])

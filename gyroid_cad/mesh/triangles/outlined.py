"""Faces by their borders in the plane of their parameters, and how fine a grid over each must be."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot

__all__ = ["Bending", "Outlines", "Surfaces", "bending"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Places along a face's both parameters from which its bending is estimated.
_SAMPLES = 7
# Squares of a grid along one parameter at most; what is still too coarse is parted.
_MOST_SQUARES = 1000


class Surfaces(Protocol):
    """Surfaces of numbered faces."""

    def evaluated(self, faces: Integers, places: Floats) -> tuple[Floats, Floats]:
        """Points in mm and products of the derivatives by both parameters, (n, 3), on faces (n,) at places (n, 2)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """Borders of faces in the planes of their parameters: polygons, each with its face to the left.

    Attributes
    ----------
    places : ndarray, shape (corners, 2)
        Parameters of the polygons' corners, one polygon after another.
    vertices : ndarray of int, shape (corners,)
        Number of the vertex in space at each.
    loops : ndarray of int, shape (polygons + 1,)
        First corner of each polygon, and the end.
    faces : ndarray of int, shape (polygons,)
        Face of each, in ascending order; every face has one.
    squares : ndarray of int, shape (faces, 4)
        Of a whole patch, whose only polygon begins at its lowest parameters and runs along its four sides in equal
        steps, how many along each; of other faces 0.

    Examples
    --------
    >>> triangle = np.array([(0.0, 1.0), (4.0, 0.0), (3.0, 2.0)])
    >>> one = Outlines(triangle, np.arange(3), np.array([0, 3]), np.array([0]), np.zeros((1, 4), dtype=int))
    >>> one.firsts.tolist(), [some.tolist() for some in one.ranges]
    ([0, 3], [[[0.0, 0.0]], [[4.0, 2.0]]])
    """

    places: Floats
    vertices: Integers
    loops: Integers
    faces: Integers
    squares: Integers

    @property
    def firsts(self) -> Integers:
        """First corner of each face, and the end."""
        return np.asarray(self.loops[np.searchsorted(self.faces, np.arange(len(self.squares) + 1))])

    @property
    def owners(self) -> Integers:
        """Face of each corner."""
        return np.repeat(self.faces, np.diff(self.loops))

    @property
    def ranges(self) -> tuple[Floats, Floats]:
        """Lowest and highest parameters of each face, each of shape (faces, 2)."""
        starts = self.firsts[:-1]
        return np.minimum.reduceat(self.places, starts), np.maximum.reduceat(self.places, starts)


@dataclass(frozen=True, slots=True, eq=False)
class Bending:
    """Bending of faces between samples of a grid over each.

    Attributes
    ----------
    second : ndarray, shape (faces, samples, 3)
        Deviations in the middles of squares' sides along u, of their diagonals, and of their sides along v, in mm.
    turned : ndarray, shape (faces, 2)
        Largest angles between neighbouring samples along u and v, in radians.
    lengths : ndarray, shape (faces, 2)
        Mean lengths along u and v, in mm.
    extent : ndarray, shape (faces, 2)
        Of the borders in parameters.
    """

    second: Floats
    turned: Floats
    lengths: Floats
    extent: Floats

    def squares(self, limit: float, angle: float) -> Integers:
        """Count of squares along both parameters with which the triangles of a grid are near enough.

        A triangle between places of a quadratic surface is furthest off in the middle of one of its sides.

        Parameters
        ----------
        limit : float
            Largest distance from the face, in mm.
        angle : float
            Between neighbouring triangles, in radians.

        Returns
        -------
        ndarray of int, shape (faces, 2)

        Examples
        --------
        >>> bent = Bending(np.array([[(0.09, 0.0, 0.0)]]), np.zeros((1, 2)), np.ones((1, 2)), np.ones((1, 2)))
        >>> bent.squares(0.01, 1.0).tolist()
        [[18, 1]]
        """
        uu, uv, vv = np.moveaxis(self.second, -1, 0)
        least = np.maximum(self.turned * (_SAMPLES - 1) / angle, 1.0) / (_SAMPLES - 1)
        own = np.stack([np.abs(some).max(axis=1, initial=0.0) for some in (uu, vv)], axis=1)
        counts = np.maximum(np.sqrt(own / limit), least)
        a, b = counts[:, :1], counts[:, 1:]
        off = np.abs(uu / a**2 + uv / (a * b) + vv / b**2).max(axis=1, initial=0.0)
        counts *= np.sqrt(np.maximum(off / limit, 1.0))[:, np.newaxis]
        return np.asarray(np.clip(np.ceil(counts * (_SAMPLES - 1) - 1e-9), 1, _MOST_SQUARES), dtype=np.int64)


def bending(outlines: Outlines, surfaces: Surfaces) -> Bending:
    """Bending of faces within their borders' ranges of parameters.

    Examples
    --------
    >>> class Plane:
    ...     def evaluated(self, faces, places):
    ...         return np.pad(places, ((0, 0), (0, 1))), np.tile([0.0, 0.0, 1.0], (len(faces), 1))
    >>> square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 2.0), (0.0, 2.0)])
    >>> one = Outlines(square, np.arange(4), np.array([0, 4]), np.array([0]), np.ones((1, 4), dtype=int))
    >>> flat = bending(one, Plane())
    >>> flat.lengths.tolist(), float(np.abs(flat.second).max()), flat.turned.tolist()
    ([[4.0, 2.0]], 0.0, [[0.0, 0.0]])
    """
    (low, high), count = outlines.ranges, len(outlines.squares)
    along = np.linspace(0, 1, _SAMPLES)
    grid = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    places = low[:, np.newaxis] + grid * (high - low)[:, np.newaxis]
    faces = np.repeat(np.arange(count), len(grid))
    shape = (count, _SAMPLES, _SAMPLES, 3)
    found, normals = (some.reshape(shape) for some in surfaces.evaluated(faces, places.reshape(-1, 2)))
    size = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = normals / np.where(size > 1e-9 * size.max(axis=(1, 2), keepdims=True), size, np.inf)
    x, n = found[:, 1:-1, 1:-1], normals[:, 1:-1, 1:-1]
    uu, vv = (found[:, 2:, 1:-1] + found[:, :-2, 1:-1] - 2 * x), (found[:, 1:-1, 2:] + found[:, 1:-1, :-2] - 2 * x)
    uv = (found[:, 2:, 2:] + found[:, :-2, :-2] - found[:, 2:, :-2] - found[:, :-2, 2:]) / 4
    second = np.stack([dot(some, n) / 8 for some in (uu, 2 * uv, vv)], axis=-1).reshape(count, -1, 3)
    turned, lengths = [], []
    for axis in (1, 2):
        one, other = (np.take(normals, range(*span), axis=axis) for span in ((1, _SAMPLES), (0, _SAMPLES - 1)))
        both = (dot(one, one) > 0) & (dot(other, other) > 0)
        turned.append((np.arccos(np.clip(dot(one, other), -1, 1)) * both).reshape(count, -1).max(axis=1))
        chords = np.linalg.norm(np.diff(found, axis=axis), axis=-1).sum(axis=axis)
        lengths.append(chords.mean(axis=1))
    extent = np.maximum(high - low, np.finfo(float).tiny)
    return Bending(second, np.stack(turned, axis=1), np.stack(lengths, axis=1), extent)

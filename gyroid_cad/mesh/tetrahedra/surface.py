"""Triangles on the faces of bodies, with the panels they lie on, and the sides that they share.

A panel is a smooth connected piece of what lies between the same two regions under one name. Where panels meet there
is a crease: an edge of some body, or the line along which wall, fluid and outside come together. Borders between
patches of the lattice are none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import cross, unit
from gyroid_cad.common.graph import connected

__all__ = ["Sides", "SurfaceMesh", "panels_of", "sides_of", "triangle_normals", "triangle_quality"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Between neighbouring triangles of one panel, in degrees: more than those of one face are turned.
_CREASE = 35.0
# In degrees: a crease that turns by more has a corner.
_CORNER = 40.0


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceMesh:
    """Triangles that share vertices by number, and the panel of each.

    Attributes
    ----------
    points : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    panels : ndarray of int, shape (triangles,)
    """

    points: Floats
    triangles: Integers
    panels: Integers


@dataclass(frozen=True, slots=True, eq=False)
class Sides:
    """Sides of triangles, each once.

    Attributes
    ----------
    ends : ndarray of int, shape (sides, 2)
        The lower number first, in ascending order.
    of : ndarray of int, shape (triangles, 3)
        Side from each corner of a triangle to the next.
    uses : ndarray of int, shape (sides,)
        Triangles at each.
    creases : ndarray of bool, shape (sides,)
        Sides that are not between two triangles of one panel.
    keys : ndarray of int, shape (sides,)
        Number of the set of panels at each.
    """

    ends: Integers
    of: Integers
    uses: Integers
    creases: Booleans
    keys: Integers

    def lengths(self, points: Floats) -> Floats:
        """Lengths of the sides, in mm."""
        return np.asarray(np.linalg.norm(points[self.ends[:, 0]] - points[self.ends[:, 1]], axis=1))

    def on_creases(self, count: int) -> Integers:
        """Sides on creases that end at each of so many vertices."""
        return np.bincount(self.ends[self.creases].ravel(), minlength=count)

    def corners(self, points: Floats) -> Booleans:
        """Mask of the vertices where creases end, meet, change panels or turn sharply."""
        count, ends = len(points), self.ends[self.creases]
        low, high = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
        tangents = np.zeros((count, 3))
        along = unit(points[ends[:, 1]] - points[ends[:, 0]])
        for end, sign in ((0, 1.0), (1, -1.0)):
            np.minimum.at(low, ends[:, end], self.keys[self.creases])
            np.maximum.at(high, ends[:, end], self.keys[self.creases])
            np.add.at(tangents, ends[:, end], sign * along)
        uses = self.on_creases(count)
        turned = np.linalg.norm(tangents, axis=1) > 2 * np.sin(np.radians(_CORNER) / 2)
        return np.asarray((uses > 0) & ((uses != 2) | (low != high) | turned))


def sides_of(mesh: SurfaceMesh) -> Sides:
    """Sides of triangles.

    Examples
    --------
    >>> square = SurfaceMesh(np.zeros((4, 3)), np.array([[0, 1, 2], [0, 2, 3]]), np.array([0, 0]))
    >>> sides = sides_of(square)
    >>> sides.ends.tolist(), sides.creases.tolist()
    ([[0, 1], [0, 2], [0, 3], [1, 2], [2, 3]], [True, False, True, True, True])
    """
    both = np.sort(np.stack([mesh.triangles, np.roll(mesh.triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    count = len(mesh.points)
    found, of, uses = np.unique(both[:, 0] * count + both[:, 1], return_inverse=True, return_counts=True)
    of, panels = of.ravel(), np.repeat(mesh.panels, 3)
    # A sum of numbers drawn at random, one a panel, tells sets of panels apart.
    drawn = np.random.default_rng(0).integers(1, 2**55, int(mesh.panels.max(initial=0)) + 1)[panels]
    keys, low, high = np.zeros(len(found), np.int64), np.full(len(found), 2**62), np.zeros(len(found), np.int64)
    np.add.at(keys, of, drawn)
    np.minimum.at(low, of, drawn)
    np.maximum.at(high, of, drawn)
    ends = np.stack([found // count, found % count], axis=1)
    return Sides(ends, of.reshape(-1, 3), uses, (uses != 2) | (low != high), keys)


def panels_of(points: Floats, triangles: Integers, kinds: Integers) -> Integers:
    """Panel of each triangle: those of one kind that hang together with no crease between them.

    Parameters
    ----------
    points : ndarray, shape (vertices, 3)
    triangles : ndarray of int, shape (triangles, 3)
    kinds : ndarray of int, shape (triangles,)

    Examples
    --------
    >>> corners = np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, 0.1), (2, 0, 2)])
    >>> panels_of(corners, np.array([[0, 1, 2], [1, 3, 2], [1, 4, 3]]), np.zeros(3, dtype=int)).tolist()
    [0, 0, 1]
    """
    sides = sides_of(SurfaceMesh(points, triangles, kinds))
    order = np.argsort(sides.of.ravel(), kind="stable") // 3
    first = (np.cumsum(sides.uses) - sides.uses)[~sides.creases]
    one, other = order[first], order[first + 1]
    normals = unit(triangle_normals(points, triangles))
    smooth = np.sum(normals[one] * normals[other], axis=1) > np.cos(np.radians(_CREASE))
    return connected(len(triangles), one[smooth], other[smooth])


def triangle_normals(points: Floats, triangles: Integers) -> Floats:
    """Normals as long as twice the area; shape (triangles, 3)."""
    a, b, c = points[triangles].transpose(1, 2, 0)
    return np.ascontiguousarray(cross(b - a, c - a).T)


def triangle_quality(points: Floats, triangles: Integers) -> Floats:
    """Quality of triangles: area by the sum of the squared sides, 1 for an equilateral one (Bhatia and Lawrence, 1990).

    Examples
    --------
    >>> corners = np.array([(0.0, 0, 0), (1, 0, 0), (0.5, 0.75**0.5, 0), (0.5, 0, 0)])
    >>> triangle_quality(corners, np.array([[0, 1, 2], [0, 1, 3]])).round(9).tolist()
    [1.0, 0.0]
    """
    a, b, c = points[triangles].transpose(1, 2, 0)
    area = np.linalg.norm(cross(b - a, c - a), axis=0)
    squares = sum(np.sum(side * side, axis=0) for side in (b - a, c - b, a - c))
    return np.asarray(2 * np.sqrt(3) * area / np.maximum(squares, np.finfo(float).tiny))

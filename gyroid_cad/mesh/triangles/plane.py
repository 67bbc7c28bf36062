"""Triangles of polygons in the plane, made Delaunay by exchanging sides, and parted in the middles of sides.

Polygons are filled by manifold3d, which needs no library besides those that are here, always gives triangles that have
each side of the polygons once, and takes tens of microseconds a polygon. It adds no places and cares little for shape:
sides are exchanged until every triangle's circle is empty, as C. L. Lawson does (Software for C1 surface
interpolation, 1977), in all polygons at once.
"""

from __future__ import annotations

from collections.abc import Sequence

import manifold3d
import numpy as np
from numpy.typing import NDArray

__all__ = ["delaunay", "filled", "parted", "shared_sides", "twice_area"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Rounds of exchanges: each mends most of what the last one left.
_ROUNDS = 60
# Sine of an angle that is no better than 0, and of how far two opposite angles must exceed 180 degrees.
_STRAIGHT, _EXCEEDS = 1e-9, 1e-6


def filled(loops: Sequence[Floats]) -> Integers:
    """Triangles of what lies to the left of closed polygons, as numbers of their corners, one polygon after another.

    Parameters
    ----------
    loops : sequence of ndarray, shape (corners, 2)

    Returns
    -------
    ndarray of int, shape (triangles, 3)
        Counterclockwise, but where polygons cross each other.

    Examples
    --------
    >>> square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
    >>> hole = 1 + square[::-1] / 2
    >>> len(filled([square])), len(filled([square, hole]))
    (2, 8)
    """
    # Its quick way for convex polygons leaves thin triangles.
    found = manifold3d.triangulate([np.ascontiguousarray(loop) for loop in loops], -1.0, False)
    return np.asarray(found, dtype=np.int64).reshape(-1, 3)


def twice_area(places: Floats, triangles: Integers) -> Floats:
    """Twice the area of triangles in the plane, below zero where they run clockwise; shape (triangles,).

    Examples
    --------
    >>> twice_area(np.array([(0.0, 0.0), (2.0, 0.0), (0.0, 3.0)]), np.array([(0, 1, 2), (0, 2, 1)])).tolist()
    [6.0, -6.0]
    """
    a, b, c = places[triangles[:, 0]], places[triangles[:, 1]], places[triangles[:, 2]]
    return _cross(b - a, c - a)


def shared_sides(triangles: Integers) -> tuple[Integers, Integers]:
    """Pairs of sides that two triangles share: three times the number of each triangle, and which of its sides.

    Examples
    --------
    >>> [side.tolist() for side in shared_sides(np.array([(0, 1, 2), (2, 1, 3)]))]
    [[1], [3]]
    """
    starts, ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    keys = np.minimum(starts, ends) * (int(triangles.max(initial=0)) + 1) + np.maximum(starts, ends)
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    return order[same], order[same + 1]


def delaunay(places: Floats, triangles: Integers, owner: Integers) -> Integers:
    """Triangles whose inner sides are exchanged until all circles through their corners are empty.

    Parameters
    ----------
    places : ndarray, shape (places, 2)
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise. Sides of one triangle only stay.
    owner : ndarray of int, shape (triangles,)
        Which polygon each is of: those where nothing is left to be done are not looked at again.

    Returns
    -------
    ndarray of int, shape (triangles, 3)

    Examples
    --------
    >>> kite = np.array([(0.0, 0.0), (9.0, -1.0), (18.0, 0.0), (9.0, 1.0)])
    >>> delaunay(kite, np.array([(0, 1, 2), (0, 2, 3)]), np.zeros(2, dtype=int)).tolist()
    [[1, 2, 3], [3, 0, 1]]
    """
    found, live = triangles.copy(), np.arange(len(triangles))
    for _ in range(_ROUNDS):
        some = found[live]
        one, other, gain = _exchangeable(places, some)
        if not len(one):
            break
        chosen = _apart(len(some), one // 3, other // 3, gain)
        one, other = one[chosen], other[chosen]
        a, b, c = _from_side(some, one)
        d = _from_side(some, other)[2]
        some[one // 3] = np.stack([c, a, d], axis=1)
        some[other // 3] = np.stack([d, b, c], axis=1)
        found[live] = some
        moved = np.zeros(int(owner.max()) + 1, dtype=bool)
        moved[owner[live[one // 3]]] = True
        live = live[moved[owner[live]]]
    return found


def parted(triangles: Integers, sides: tuple[Integers, Integers], places: Integers) -> tuple[Integers, Integers]:
    """Triangles with places in the middles of some inner sides, of each triangle one at most.

    Parameters
    ----------
    triangles : ndarray of int, shape (triangles, 3)
    sides : tuple of ndarray of int
        As :func:`shared_sides` gives them.
    places : ndarray of int
        Number of the new place on each.

    Returns
    -------
    triangles : ndarray of int, shape (more, 3)
        In the order they were in, then new ones.
    origin : ndarray of int, shape (more,)
        The triangle that each was.

    Examples
    --------
    >>> two = np.array([(0, 1, 2), (2, 1, 3)])
    >>> parted(two, shared_sides(two), np.array([4]))[0].tolist()
    [[1, 4, 0], [2, 4, 3], [4, 2, 0], [4, 1, 3]]
    """
    found, new, origin = triangles.copy(), [], []
    for side in sides:
        a, b, c = _from_side(triangles, side)
        found[side // 3] = np.stack([a, places, c], axis=1)
        new.append(np.stack([places, b, c], axis=1))
        origin.append(side // 3)
    return np.concatenate([found, *new]), np.concatenate([np.arange(len(triangles)), *origin])


def _apart(count: int, one: Integers, other: Integers, gain: Floats) -> Booleans:
    """Mask of pairs of triangles of which none is in two, those that gain most first."""
    rank = np.empty(len(gain), dtype=np.int64)
    rank[np.argsort(-gain, kind="stable")] = np.arange(len(gain))
    best = np.full(count, len(gain))
    np.minimum.at(best, one, rank)
    np.minimum.at(best, other, rank)
    return np.asarray((best[one] == rank) & (best[other] == rank))


def _exchangeable(places: Floats, triangles: Integers) -> tuple[Integers, Integers, Floats]:
    """Inner sides that the other diagonal should replace, and by how much the angles opposite are too wide."""
    one, other = shared_sides(triangles)
    (a, b, c), d = _from_side(triangles, one), _from_side(triangles, other)[2]
    pa, pb, pc, pd = places[a], places[b], places[c], places[d]
    across_c, along_c = _cross(pa - pc, pb - pc), np.sum((pa - pc) * (pb - pc), axis=1)
    across_d, along_d = _cross(pb - pd, pa - pd), np.sum((pb - pd) * (pa - pd), axis=1)
    size = np.hypot(across_c, along_c) * np.hypot(across_d, along_d)
    sine = (across_c * along_d + along_c * across_d) / np.maximum(size, np.finfo(float).tiny)
    # Both new triangles must be counterclockwise.
    squared = np.sum((pa - pb) ** 2, axis=1) + np.sum((pc - pd) ** 2, axis=1)
    convex = np.minimum(_cross(pa - pc, pd - pc), _cross(pb - pd, pc - pd)) > _STRAIGHT * squared
    wanted = np.flatnonzero((sine < -_EXCEEDS) & convex)
    return one[wanted], other[wanted], -sine[wanted]


def _from_side(triangles: Integers, sides: Integers) -> tuple[Integers, Integers, Integers]:
    """Both ends of sides and the corners opposite."""
    triangle, k = np.divmod(sides, 3)
    return triangles[triangle, k], triangles[triangle, (k + 1) % 3], triangles[triangle, (k + 2) % 3]


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])

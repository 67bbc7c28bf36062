"""Faults of triangles: edges that are open or shared by many, triangles without area, and such as cross each other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.common.graph import connected
from gyroid_cad.common.verdicts import Worst, as_point, counted
from gyroid_cad.mesh.triangles.measures import edge_uses

__all__ = ["Hole", "crossing_triangles", "flat_triangles", "holes_of", "open_edges", "triangle_faults"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Triangles in a leaf of the tree, and pairs that are looked at together.
_LEAF, _PAIRS_AT_ONCE = 4, 2**18
# Bits of each coordinate by which triangles are put in order.
_BITS = 20
# So far inside a triangle, in parts of it, an edge must come through: bodies that touch have edges through its border.
_INSIDE = 1e-6
# An edge that comes through a triangle by less, in parts of the extent, touches it: so do corners that were rounded.
_TOUCHES = 1e-6
# Corners of a triangle from which its edges run, and to which.
_FROM, _TO = np.array([0, 1, 2]), np.array([1, 2, 0])


# Triangles so flat, in parts of the extent, have no normal in single precision.
_FLAT = 1e-7


@dataclass(frozen=True, slots=True)
class Hole:
    """Edges of triangles that no other triangle shares, connected to each other."""

    edges: int
    place: tuple[float, float, float]

    def __str__(self) -> str:
        place = ", ".join(f"{round(coordinate, 3) + 0.0:g}" for coordinate in self.place)
        return f"{self.edges} edges round ({place})"


def holes_of(vertices: Floats, triangles: Integers) -> list[Hole]:
    """Holes of triangles, the one with the most edges first.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> [str(hole) for hole in holes_of(corners, sides)]
    ['3 edges round (0.333, 0.333, 0.333)']
    """
    edges, label = open_edges(triangles, len(vertices))
    found = []
    for number in range(int(label.max(initial=-1)) + 1):
        own = edges[label == number]
        x, y, z = vertices[np.unique(own)].mean(axis=0).tolist()
        found.append(Hole(len(own), (x, y, z)))
    return sorted(found, key=lambda hole: -hole.edges)


def open_edges(triangles: Integers, count: int) -> tuple[Integers, Integers]:
    """Edges that are used more often one way than the other, as they are used, and the hole of each."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    order = np.argsort(keys, kind="stable")
    own, first, uses = np.unique(keys[order], return_index=True, return_counts=True)
    others = back[order][first]
    where = np.searchsorted(own, others).clip(max=max(len(own) - 1, 0))
    reverse = np.where(own[where] == others, uses[where], 0)
    found = np.repeat(edges[order][first], np.maximum(uses - reverse, 0), axis=0)
    corners, numbers = np.unique(found, return_inverse=True)
    ends = numbers.reshape(-1, 2)
    return found, connected(len(corners), ends[:, 0], ends[:, 1])[ends[:, 0]] if len(found) else np.empty(0, np.int64)


def triangle_faults(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> dict[str, Worst]:
    """Count the faults of triangles, each kind with the place of one.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)

    Returns
    -------
    dict of str to Worst
        "watertight": edges of one triangle; "manifold": edges of more than two; "orientation": edges that two triangles
        run the same way; "self-intersection": pairs of triangles that cross.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faults = triangle_faults(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]]))
    >>> {name: worst.value for name, worst in faults.items() if worst.value}
    {'watertight': 3}
    """
    points, facets = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    order, first, one_way, uses = edge_uses(facets)
    extent = float(np.ptp(points, axis=0).max())
    kinds = {"watertight": uses == 1, "manifold": uses > 2, "orientation": (uses == 2) & (one_way != 1)}
    begins = points[facets.ravel()[order[first]]]
    pairs, places = crossing_triangles(points, facets, _TOUCHES * extent)
    return {
        **{name: counted(begins[mask]) for name, mask in kinds.items()},
        "self-intersection": Worst(len(pairs), as_point(places[0]) if len(pairs) else None),
    }


def flat_triangles(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> Floats:
    """First corners, shape (n, 3), of the triangles so flat that they have no normal in single precision.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    >>> flat_triangles(corners, np.array([[0, 1, 3], [1, 2, 0]])).tolist()
    [[1.0, 0.0, 0.0]]
    """
    points = np.asarray(vertices, dtype=float)
    corners = points[triangles]
    sides = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=-1).max(axis=1)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(corners[areas <= _FLAT * np.ptp(points, axis=0).max() * sides, 0])


def crossing_triangles(
    vertices: NDArray[np.floating], triangles: NDArray[np.integer], tolerance: float
) -> tuple[Integers, Floats]:
    """Pairs of triangles that cross, and a place of each.

    Two cross where an edge of one, beside the corners they share, comes through the other from one side to the other.
    Triangles with an edge in common, and those that lie in one plane, do not.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    tolerance : float
        How far past the plane of a triangle an edge must reach on both sides, in mm.

    Returns
    -------
    pairs : ndarray of int, shape (n, 2)
        The lower number first.
    places : ndarray, shape (n, 3)
        In mm.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [4, 0, 0], [0, 4, 0], [1, 1, -1], [1, 1, 1], [9, 9, 1]])
    >>> pairs, places = crossing_triangles(corners, np.array([[0, 1, 2], [3, 4, 5]]), 1e-9)
    >>> pairs.tolist(), places.tolist()
    ([[0, 1]], [[2.0, 2.0, 0.0]])
    """
    points, facets = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    pairs, places = [np.empty((0, 2), np.int64)], [np.empty((0, 3))]
    for some in _near_pairs(points[facets]):
        found, where = _crossing(points, facets, some, tolerance)
        pairs.append(np.sort(found, axis=1))
        places.append(where)
    return np.concatenate(pairs), np.concatenate(places)


def _near_pairs(corners: Floats) -> Iterator[Integers]:
    """Pairs of triangles whose boxes overlap, each pair once, in portions; shape (n, 2)."""
    if not len(corners):
        return
    low, high = corners.min(axis=1), corners.max(axis=1)
    order = _in_order((low + high) / 2)
    depth = max(0, int(np.ceil(np.log2(max(1, len(order) / _LEAF)))))
    # Triangles that fill the tree up have boxes that overlap nothing.
    count = _LEAF << depth
    lows, highs = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    lows[: len(order)], highs[: len(order)] = low[order], high[order]
    levels = [(lows, highs)]
    lows, highs = lows.reshape(-1, _LEAF, 3).min(axis=1), highs.reshape(-1, _LEAF, 3).max(axis=1)
    levels.append((lows, highs))
    for _ in range(depth):
        lows, highs = lows.reshape(-1, 2, 3).min(axis=1), highs.reshape(-1, 2, 3).max(axis=1)
        levels.append((lows, highs))
    waiting = [(len(levels) - 1, np.zeros((1, 2), dtype=np.int64))]
    while waiting:
        level, pairs = waiting.pop()
        if len(pairs) > _PAIRS_AT_ONCE:
            waiting += [(level, half) for half in np.array_split(pairs, 2)]
        elif level == 0:
            yield order[pairs]
        else:
            waiting.append((level - 1, _among_children(pairs, 2 if level > 1 else _LEAF, *levels[level - 1])))


def _in_order(places: Floats) -> Integers:
    """Order of places along a curve that keeps near ones near (Morton)."""
    low, extent = places.min(axis=0), float(np.ptp(places, axis=0).max())
    cells = ((places - low) * ((2**_BITS - 1) / (extent or 1.0))).astype(np.uint64)
    code = np.zeros(len(places), dtype=np.uint64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return np.argsort(code, kind="stable")


def _among_children(pairs: Integers, children: int, lows: Floats, highs: Floats) -> Integers:
    """Pairs of children of boxes that overlap: of a box with itself, each pair of its children once."""
    one, other = (index.ravel() for index in np.indices((children, children)))
    first = (children * pairs[:, :1] + one).ravel()
    second = (children * pairs[:, 1:] + other).ravel()
    below = first <= second
    first, second = first[below], second[below]
    overlap = np.all((lows[first] <= highs[second]) & (lows[second] <= highs[first]), axis=1)
    return np.stack([first[overlap], second[overlap]], axis=1)


def _crossing(points: Floats, facets: Integers, pairs: Integers, tolerance: float) -> tuple[Integers, Floats]:
    """Return those of some pairs that cross, and where."""
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    shared = facets[pairs[:, 0]][:, :, np.newaxis] == facets[pairs[:, 1]][:, np.newaxis]
    apart = shared.sum(axis=(1, 2)) < 2
    pairs, shared = pairs[apart], shared[apart]
    # Most pairs are neighbours, of which one lies on one side of the other.
    for cut in (0, 1):
        heights = _heights(points, facets, pairs, cut, shared.any(axis=1 + cut))
        through = (heights.min(axis=1) < -tolerance) & (heights.max(axis=1) > tolerance)
        pairs, shared = pairs[through], shared[through]
    found, places = np.zeros(len(pairs), dtype=bool), np.empty((len(pairs), 3))
    for cut in (0, 1):
        heights = _heights(points, facets, pairs, cut, shared.any(axis=1 + cut))
        start, end = heights[:, _FROM], heights[:, _TO]
        row, edge = np.nonzero((start * end < 0) & (np.minimum(np.abs(start), np.abs(end)) > tolerance))
        corners, others = points[facets[pairs[row, cut]]], points[facets[pairs[row, 1 - cut]]]
        part = (start / np.where(start == end, 1.0, start - end))[row, edge, np.newaxis]
        index = np.arange(len(row))
        place = (1 - part) * others[index, _FROM[edge]] + part * others[index, _TO[edge]]
        inside = _inside(place - corners[:, 0], corners[:, 1:] - corners[:, :1])
        found[row[inside]], places[row[inside]] = True, place[inside]
    return pairs[found], places[found]


def _heights(points: Floats, facets: Integers, pairs: Integers, cut: int, common: Booleans) -> Floats:
    """Heights of the corners of one triangle of each pair over the plane of the other, ``cut``; shape (n, 3).

    A corner in common lies in the plane, whatever rounding says.
    """
    first, second, third = (points[facets[pairs[:, cut], k]] for k in range(3))
    normals = unit(np.cross(second - first, third - first))
    heights = dot(points[facets[pairs[:, 1 - cut]]] - first[:, np.newaxis], normals[:, np.newaxis])
    return np.where(common, 0.0, heights)


def _inside(offset: Floats, along: Floats) -> Booleans:
    """Tell which places in the planes of triangles, from their first corners, lie well inside them."""
    normal = np.cross(along[:, 0], along[:, 1])
    square = dot(normal, normal)
    second = dot(np.cross(offset, along[:, 1]), normal) / square
    third = dot(np.cross(along[:, 0], offset), normal) / square
    return np.asarray(np.minimum(np.minimum(second, third), 1 - second - third) > _INSIDE)

"""Places where an edge of one side meets a face of the other: rims of the wall's faces, and edges of the part.

Each is found once, on its edge alone, and then belongs to every face round that edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot, grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.roots import roots
from gyroid_cad.trim.boundary import Boundary
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.lattice_faces import LatticeFaces, Pairs

__all__ = ["PartNodes", "RimNodes", "edge_segments", "part_nodes", "rim_nodes", "twin_nodes"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Samples along a rim, as close as those of planes.
_RIM_SAMPLES = 65
# A side is first looked at in so many places, to see whether it comes near at all.
_LOOKED_AT = 9
# The sine of an angle at which an edge touches a face, and how near a corner a node may be, in parts of the edge.
_TOUCHING, _AT_CORNER = 1e-6, 1e-6
# Parts of a segment at whose ends heights above a face are measured.
_PARTS, _MARGIN = 5, 0.2
_SEGMENT, _TURN, _MOST_SEGMENTS = 0.1, 0.15, 4096
_NEWTON_STEPS = 20
_AT_ONCE = 2**12


@dataclass(frozen=True, slots=True, eq=False)
class RimNodes:
    """Crossings of rims of the wall's faces with the part's boundary, ordered by rim and along it.

    Attributes
    ----------
    rim, part : ndarray of int, shape (nodes,)
        Rims, and the part's faces there.
    along : ndarray, shape (nodes,)
        Parameter, in [-1, 1], the way the complex's edge runs.
    inwards : ndarray of bool, shape (nodes,)
        Whether one comes into the part there, running along.
    places : ndarray, shape (nodes, 2)
        Parameters of the part's face.
    points : ndarray, shape (nodes, 3)
    """

    rim: Integers
    part: Integers
    along: Floats
    inwards: Booleans
    places: Floats
    points: Floats


@dataclass(frozen=True, slots=True, eq=False)
class PartNodes:
    """Crossings of edges of the part with faces of the wall, ordered by edge and along it.

    Attributes
    ----------
    edge, face : ndarray of int, shape (nodes,)
        Edges of the part, and faces of the wall.
    along : ndarray, shape (nodes,)
        Parameter of the edge's curve.
    upwards : ndarray of bool, shape (nodes,)
        Whether the edge runs there to the side that the face's own normal points to.
    places : ndarray, shape (nodes, 2)
        Parameters of the wall's face.
    points : ndarray, shape (nodes, 3)
    """

    edge: Integers
    face: Integers
    along: Floats
    upwards: Booleans
    places: Floats
    points: Floats


def rim_nodes(pairs: Pairs) -> RimNodes:
    """Find where rims cross the part's faces.

    Parameters
    ----------
    pairs : Pairs

    Raises
    ------
    KernelError
        If a rim only touches the part, or crosses it at an edge of the part or at a corner of the face.
    """
    flat, owner, owned_side, rim, part = pairs.by_rim()
    near = _may_cross(pairs, owner[rim], owned_side[rim], part)
    rim, part = rim[near], part[near]
    step = 2 / (_RIM_SAMPLES - 1)
    samples = np.linspace(-1 - step, 1 + step, _RIM_SAMPLES + 2)
    asked = Pairs(pairs.faces, pairs.boundary, owner[rim], part)
    values = _rough_heights(asked, owned_side[rim], samples, pairs.faces.size)

    def along_side(which: Integers, along: Floats) -> tuple[Floats, Floats]:
        u, v = square_points(owned_side[rim[which]], along)
        height, slopes, _, _ = asked.heights(which, u[:, None], v[:, None])
        return height[:, 0], _rate(owned_side[rim[which]], slopes[:, 0])

    which, along = roots(samples, values, along_side)
    side = owned_side[rim[which]]
    u, v = square_points(side, along)
    heights, slopes, places, points = (some[:, 0] for some in asked.heights(which, u[:, None], v[:, None]))
    # Elsewhere a distance changes its sign by a leap, where another place of the surface becomes the nearest.
    real = np.abs(heights) < 1e-8 * pairs.faces.size
    real &= _in_faces(pairs.boundary, part[which], places, real)
    which, side, along = which[real], side[real], along[real]
    slopes, places, points = slopes[real], places[real], points[real]
    rate, steepness = _rate(side, slopes), np.linalg.norm(slopes, axis=1)
    if np.any(np.abs(rate) <= _TOUCHING * steepness) or np.any(np.abs(along) > 1 - _AT_CORNER):
        raise KernelError("an edge of the lattice touches the part")
    runs_on = pairs.faces.forward[owner[rim[which]], side]
    along, inwards = np.where(runs_on, along, -along), np.where(runs_on, rate > 0, rate < 0)
    order = np.lexsort((along, rim[which]))
    which = which[order]
    return RimNodes(flat[rim[which]], part[which], along[order], inwards[order], places[order], points[order])


def twin_nodes(faces: LatticeFaces, nodes: RimNodes) -> dict[int, int]:
    """Nodes at which posts of several fans at one corner come to the same place, each by that of the first of them."""
    corners = faces.corners(nodes.rim)
    first: dict[tuple[int, int, int], int] = {}
    twins = {}
    for node in np.flatnonzero(corners >= 0).tolist():
        key = int(corners[node]), int(nodes.part[node]), round(float(nodes.along[node]) / _AT_CORNER)
        if first.setdefault(key, node) != node:
            twins[node] = first[key]
    return twins


def _may_cross(pairs: Pairs, face: Integers, side: Integers, part: Integers) -> Booleans:
    """Mask of the sides that come as near a face of the part as they reach between a few places."""
    points = pairs.faces.along_sides(face, side, np.linspace(-1, 1, _LOOKED_AT))
    reach = np.linalg.norm(np.diff(points, axis=1), axis=2).max(axis=1)
    bottom, top = points.min(axis=1) - reach[:, None], points.max(axis=1) + reach[:, None]
    low, high = (some[part] for some in pairs.boundary.boxes)
    near = np.all((bottom <= high) & (top >= low), axis=1)
    found, error = pairs.boundary.rough_depths(part[near], points[near])
    near[near] = np.min(np.abs(found) - error, axis=1) <= reach[near]
    return np.asarray(near)


def _rough_heights(pairs: Pairs, side: Integers, samples: Floats, size: float) -> Floats:
    """Heights along sides, exact where they are near zero; shape (pairs, samples)."""
    points = pairs.faces.along_sides(pairs.face, side, samples)
    heights, error = pairs.boundary.rough_depths(pairs.part, points)
    row, sample = np.nonzero((np.abs(heights) <= 4 * error) & (error > 0) & (np.abs(heights) < size))
    heights[row, sample] = pairs.boundary.depths(pairs.part[row], points[row, sample, None])[0][:, 0]
    return heights


def _rate(side: Integers, slopes: Floats) -> Floats:
    return np.choose(side, [slopes[:, 0], slopes[:, 1], -slopes[:, 0], -slopes[:, 1]])


def _in_faces(boundary: Boundary, part: Integers, places: Floats, asked: Booleans) -> Booleans:
    inside = np.zeros(len(part), dtype=bool)
    some = np.flatnonzero(asked)
    for number, rows in grouped(part[some]):
        inside[some[rows]] = boundary.faces[number].contains(places[some[rows]])
    return inside


def part_nodes(faces: LatticeFaces, boundary: Boundary) -> PartNodes:
    """Find where edges of a part cross faces of the wall.

    Raises
    ------
    KernelError
        If an edge only touches a face, or crosses it at its rim.
    """
    integers, numbers = np.zeros(0, dtype=np.int64), np.zeros(0)
    none = PartNodes(integers, integers, numbers, numbers > 0, np.zeros((0, 2)), np.zeros((0, 3)))
    if not len(faces):
        return none
    edge, low, high, start, end = edge_segments(boundary, faces.size)
    if not len(edge):
        return none
    face, segment = _near(faces, start, end)
    if not len(face):
        return none
    row, along, u, v = _tried(faces, boundary, face, edge[segment], low[segment], high[segment])
    return _converged(faces, boundary, edge[segment][row], face[row], along, u, v)


def edge_segments(boundary: Boundary, size: float) -> tuple[Integers, Floats, Floats, Floats, Floats]:
    """Edges of the part as straight segments: their edges, parameters of both ends, and both ends."""
    edges, lows, highs = [np.zeros(0, dtype=np.int64)], [np.zeros(0)], [np.zeros(0)]
    starts, ends = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for number, one in enumerate(boundary.edges):
        if one.curve is None:
            continue
        points, rates, *_ = one.curve(np.linspace(one.first, one.last, 2 if one.straight else 33))
        length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
        along = rates / np.maximum(np.linalg.norm(rates, axis=1, keepdims=True), np.finfo(float).tiny)
        turn = np.linalg.norm(np.diff(along, axis=0), axis=1).sum()
        count = int(np.clip(np.ceil(max(length / (_SEGMENT * size), turn / _TURN)), 1, _MOST_SEGMENTS))
        t = np.linspace(one.first, one.last, count + 1)
        places = one.curve(t)[0]
        edges.append(np.full(count, number))
        for some, added in ((lows, t[:-1]), (highs, t[1:]), (starts, places[:-1]), (ends, places[1:])):
            some.append(added)
    return tuple(np.concatenate(some) for some in (edges, lows, highs, starts, ends))  # type: ignore[return-value]


def _near(faces: LatticeFaces, start: Floats, end: Floats) -> tuple[Integers, Integers]:
    """Faces with the segments whose boxes meet theirs."""
    low, high = (reach(faces.nets, axis=(1, 2)) for reach in (np.min, np.max))
    margin = _MARGIN * np.linalg.norm(end - start, axis=1).max()
    middle = (low + high) / 2
    radius = np.linalg.norm(high - low, axis=1) / 2 + np.linalg.norm(end - start, axis=1).max() / 2 + margin
    found = cKDTree((start + end) / 2).query_ball_point(middle, radius)
    counts = np.array([len(some) for some in found])
    face = np.repeat(np.arange(len(faces)), counts)
    segment = np.concatenate([np.asarray(some, dtype=np.int64) for some in found] or [np.zeros(0, dtype=np.int64)])
    bottom, top = np.minimum(start, end) - margin, np.maximum(start, end) + margin
    meets = np.all((low[face] <= top[segment]) & (high[face] >= bottom[segment]), axis=1)
    return face[meets], segment[meets]


def _tried(
    faces: LatticeFaces, boundary: Boundary, face: Integers, edge: Integers, low: Floats, high: Floats
) -> tuple[Integers, Floats, Floats, Floats]:
    """Places along segments of the part's edges where the height above a face changes its sign, or all but does.

    Returns
    -------
    row : ndarray of int, shape (n,)
        Of the given pairs.
    along, u, v : ndarray, shape (n,)
    """
    parts = np.linspace(0, 1, _PARTS + 1)
    found: list[tuple[Integers, Floats, Floats, Floats]] = []
    for first in range(0, len(face), _AT_ONCE):
        rows = np.arange(first, min(first + _AT_ONCE, len(face)))
        ends = np.stack([low[rows], high[rows]], axis=1)
        points, _ = boundary.along_edges(edge[rows], ends)
        heights, _ = faces.heights(face[rows], points)
        length = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
        # No place of a segment is further from one of its ends than its length.
        rows = rows[np.abs(heights).min(axis=1) <= length]
        t = low[rows, None] + parts * (high - low)[rows, None]
        points, _ = boundary.along_edges(edge[rows], t)
        heights, places = faces.heights(face[rows], points)
        above = heights > 0
        row, index = np.nonzero(above[:, 1:] != above[:, :-1])
        before, after = heights[row, index], heights[row, index + 1]
        share = before / (before - after)
        found.append(_between(rows, t, places, row, index, share))
        # Where a height turns back between samples it may cross zero twice: both are tried.
        bend = heights[:, :-2] - 2 * heights[:, 1:-1] + heights[:, 2:]
        turning = (np.sign(heights[:, 1:-1]) * bend > 0) & (np.abs(heights[:, 1:-1]) < np.abs(bend))
        row, index = np.nonzero(turning)
        found += [_between(rows, t, places, row, index + k, np.full(len(row), 0.5)) for k in (0, 1)]
    return tuple(np.concatenate(some) for some in zip(*found, strict=True))  # type: ignore[return-value]


def _between(
    rows: Integers, t: Floats, places: Floats, row: Integers, index: Integers, share: Floats
) -> tuple[Integers, Floats, Floats, Floats]:
    """Rows, parameters and places of a face so far between a sample and the next."""
    along = t[row, index] + share * (t[row, index + 1] - t[row, index])
    place = places[row, index] + share[:, None] * (places[row, index + 1] - places[row, index])
    return rows[row], along, place[:, 0], place[:, 1]


def _converged(
    faces: LatticeFaces, boundary: Boundary, edge: Integers, face: Integers, along: Floats, u: Floats, v: Floats
) -> PartNodes:
    """Exact places by Newton's method, each once."""
    unknown = np.stack([along, u, v], axis=-1)
    sharp = np.zeros(len(edge))
    upwards = np.zeros(len(edge), dtype=bool)
    left = np.zeros((len(edge), 3))
    points = np.zeros((len(edge), 3))
    first, last = (np.array([getattr(boundary.edges[k], name) for k in edge.tolist()]) for name in ("first", "last"))
    longest = np.stack([(last - first) / 10, np.full(len(edge), 0.2), np.full(len(edge), 0.2)], axis=-1)
    some = np.arange(len(edge))
    for step in range(_NEWTON_STEPS + 1):
        place, rate = boundary.along_edges(edge[some], unknown[some, 0])
        u, v = unknown[some, 1:, None].transpose(1, 0, 2)
        point, du, dv = (value[:, 0] for value in faces.derivatives(face[some], u, v))
        normal = np.cross(du, dv)
        left[some], points[some] = place - point, point
        steepness = np.linalg.norm(rate, axis=1) * np.linalg.norm(normal, axis=1)
        slope = dot(rate, normal) / np.maximum(steepness, np.finfo(float).tiny)
        sharp[some], upwards[some] = np.abs(slope), slope > 0
        if step == _NEWTON_STEPS or not len(some):
            break
        jacobian = np.stack([rate, -du, -dv], axis=-1)
        jacobian[np.abs(slope) < 1e-12] = np.eye(3)
        change = np.linalg.solve(jacobian, -(place - point)[..., None])[..., 0]
        unknown[some] += np.clip(change, -longest[some], longest[some])
        unknown[some, 1:] = np.clip(unknown[some, 1:], -1.3, 1.3)
        some = some[np.abs(change[:, 1:]).max(axis=1) >= 1e-14]
    t = (unknown[:, 0] - first) / (last - first)
    size = faces.size
    solved = np.linalg.norm(left, axis=1) < 1e-9 * size
    edge_margin = np.maximum(np.abs(unknown[:, 1:]).max(axis=1) - 1, np.maximum(-t, t - 1))
    solved &= edge_margin < _AT_CORNER
    if np.any(solved & (edge_margin > -_AT_CORNER)) or np.any(sharp[solved] < _TOUCHING):
        raise KernelError("an edge of the part touches the lattice, or meets an edge of it")
    keep = np.flatnonzero(solved)
    order = keep[np.lexsort((t[keep], face[keep], edge[keep]))]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (
        (edge[order][1:] != edge[order][:-1])
        | (face[order][1:] != face[order][:-1])
        | (np.linalg.norm(np.diff(points[order], axis=0), axis=1) > 1e-7 * size)
    )
    order = order[fresh]
    order = order[np.lexsort((t[order], edge[order]))]
    return PartNodes(edge[order], face[order], unknown[order, 0], upwards[order], unknown[order, 1:], points[order])

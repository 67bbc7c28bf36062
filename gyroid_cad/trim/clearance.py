"""Places at which a lattice all but touches a part, and how far to shift it so that none is left.

Where a corner of the lattice lies a hundredth of a millimetre off the part's boundary the cut leaves an edge or a face
of that size, which receivers refuse. A lattice that has no end may stand anywhere: shifted by some hundredths of its
cell it is clear of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot, grouped, unit
from gyroid_cad.trim.boundary import Boundary
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.lattice_faces import LatticeFaces, pairs_of
from gyroid_cad.trim.nodes import edge_segments
from gyroid_cad.wall.covering import Frame

__all__ = ["NearMisses", "clear_frame", "clear_shift", "near_misses"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Places along a rim: between two of them it departs from its chord by a ten-thousandth of its length.
_ALONG_RIM = 17
# A strip between a rim and a curve beside it may be so much narrower than an edge may be short.
_NARROWER = 0.5
# Shifts that are tried, the shortest first, and how many numbers are held at a time.
_SHIFTS, _AT_ONCE = 4096, 2**22
_NEWTON_STEPS = 4
# Of a place that belongs to a face or all but does, how far out it is in the square.
_BESIDE = 1.1
# The shortest edge wanted: receivers refuse some under 0.02 mm; of small cells a part of the cell.
_SHORTEST, _SHORTEST_OF_CELL = 0.025, 1 / 120
# How far a lattice may be shifted, in cells; and how often, for where curved faces end up is not foretold exactly.
_FURTHEST, _ROUNDS = 0.04, 3
# A shift that leaves more than this of the near misses is not worth being out of place.
_WORTHWHILE = 0.5
# The sine of an angle at which two curves run side by side: no shift across both parts them.
_ALONGSIDE = 1e-2


@dataclass(frozen=True, slots=True, eq=False)
class NearMisses:
    """Places where an edge or corner of one side is near the other's.

    Attributes
    ----------
    heights : ndarray, shape (n,)
        Signed distances, in mm.
    directions : ndarray, shape (n, 3)
        How a shift of the lattice changes them.
    least : ndarray, shape (n,)
        What each should be away from zero, in parts of the shortest edge wanted.
    """

    heights: Floats
    directions: Floats
    least: Floats

    def moved(self, shift: Floats) -> NearMisses:
        """The same after a shift of the lattice (3,), in mm."""
        return replace(self, heights=self.heights + self.directions @ shift)

    def count_below(self, least: float) -> int:
        """Count those that are nearer than wanted, for a shortest edge in mm."""
        return int(np.count_nonzero(np.abs(self.heights) < least * self.least))

    @classmethod
    def joined(cls, some: Sequence[NearMisses]) -> NearMisses:
        """Join several: none, of no parts."""
        if not some:
            return cls(np.zeros(0), np.zeros((0, 3)), np.zeros(0))
        return cls(*(np.concatenate([getattr(one, name) for one in some]) for name in cls.__slots__))


def near_misses(faces: LatticeFaces, boundary: Boundary, within: float) -> NearMisses:
    """Find where corners and rims of a lattice's faces come near a part's faces, edges and vertices.

    Rims near faces are told at their corners and where they turn back; near edges, where both are nearest.

    Parameters
    ----------
    faces : LatticeFaces
        That the boundary may cross.
    boundary : Boundary
    within : float
        How near, in mm.
    """
    pairs = pairs_of(faces, boundary)
    _, owner, side, rim, part = pairs.by_rim()
    rims = faces.along_sides(owner, side, np.linspace(-1, 1, _ALONG_RIM))
    near_edges = _near_edges(faces, boundary, owner, side, rims, within)
    near_corners = _near_corners(faces, boundary.vertices, within)
    return NearMisses.joined([_near_faces(rims[rim], part, boundary, within), near_edges, near_corners])


def clear_shift(misses: NearMisses, least: float, most: float) -> Floats:
    """Find the shortest shift of a lattice that leaves no near miss, or the fewest; zero where none is needed.

    Parameters
    ----------
    misses : NearMisses
        Within ``least + most``.
    least : float
        What their distances should be at least, in mm.
    most : float
        How far the lattice may be shifted, in mm.

    Returns
    -------
    ndarray, shape (3,)
        In mm.

    Examples
    --------
    >>> plane = NearMisses(np.array([0.001]), np.array([[0.0, 0.0, 1.0]]), np.ones(1))
    >>> shift = clear_shift(plane, least=0.02, most=0.1)
    >>> bool(abs(0.001 + shift[2]) >= 0.02)
    True
    """
    wanted = least * misses.least
    if not misses.count_below(least):
        return np.zeros(3)
    random = np.random.default_rng(0)
    ways = random.normal(size=(_SHIFTS, 3))
    lengths = most * np.linspace(1 / _SHIFTS, 1, _SHIFTS) ** (1 / 3)
    shifts = np.concatenate([np.zeros((1, 3)), ways * (lengths / np.linalg.norm(ways, axis=1))[:, np.newaxis]])
    best, fewest = shifts[0], len(wanted) + 1
    count = max(1, _AT_ONCE // len(wanted))
    for first in range(0, len(shifts), count):
        some = shifts[first : first + count]
        left = np.count_nonzero(np.abs(misses.heights + some @ misses.directions.T) < wanted, axis=1)
        if left.min() < fewest:
            best, fewest = some[np.argmin(left)], int(left.min())
        if not fewest:
            break
    return np.asarray(best)


def clear_frame(misses_in: Callable[[Frame, float], NearMisses], frame: Frame, cell_size: float) -> Frame:
    """Move a lattice by a few hundredths of a cell, where that leaves none or fewer of the edges that are too short.

    Parameters
    ----------
    misses_in : callable
        Near misses of a lattice in a frame, within so many mm.
    frame : Frame
        Where it stands.
    cell_size : float
        In mm.
    """
    least, most = min(_SHORTEST, _SHORTEST_OF_CELL * cell_size), _FURTHEST * cell_size
    best, fewest, tried = frame, 0, frame
    for round_ in range(_ROUNDS):
        misses = misses_in(tried, least + most)
        short = misses.count_below(least)
        if not round_:
            fewest = short
        elif short <= _WORTHWHILE * fewest:
            best, fewest = tried, short
        if not short:
            break
        shift = clear_shift(misses, least, most)
        if misses.moved(shift).count_below(least) > _WORTHWHILE * fewest:
            break
        tried = replace(tried, origin=tried.origin + shift)
    return best


def _near_faces(rims: Floats, part: Integers, boundary: Boundary, within: float) -> NearMisses:
    """Corners and turning places of rims (m, q, 3) near faces of the part (m,)."""
    rough, error = boundary.rough_depths(part, rims)
    near = np.any(np.abs(rough) - error <= within, axis=1)
    rims, part = rims[near], part[near]
    heights, inwards, places = boundary.depths(part, rims)
    told = np.abs(heights) <= within
    rate = np.diff(heights, axis=1)
    told[:, 1:-1] &= rate[:, 1:] * rate[:, :-1] <= 0
    row, index = np.nonzero(told)
    # A corner belongs to several rims.
    key = np.concatenate([part[row, None], np.round(rims[row, index] / (1e-6 * within))], axis=1)
    _, fresh = np.unique(key, axis=0, return_index=True)
    row, index = row[fresh], index[fresh]
    real = np.zeros(len(row), dtype=bool)
    for number, some in grouped(part[row]):
        real[some] = boundary.faces[number].comes_near(places[row[some], index[some]], within)
    row, index = row[real], index[real]
    at_corner = (index == 0) | (index == _ALONG_RIM - 1)
    return NearMisses(heights[row, index], inwards[row, index], np.where(at_corner, 1.0, _NARROWER))


def _near_edges(
    faces: LatticeFaces, boundary: Boundary, owner: Integers, side: Integers, rims: Floats, within: float
) -> NearMisses:
    """Rims (m, q, 3) near edges of the part."""
    edge, low, high, start, end = edge_segments(boundary, faces.size)
    if not len(edge):
        return NearMisses.joined([])
    first, last = rims[:, :-1].reshape(-1, 3), rims[:, 1:].reshape(-1, 3)
    reach = (np.linalg.norm(last - first, axis=1).max() + np.linalg.norm(end - start, axis=1).max()) / 2 + within
    found = cKDTree((first + last) / 2).query_ball_point((start + end) / 2, reach)
    counts = np.array([len(some) for some in found])
    segment = np.repeat(np.arange(len(edge)), counts)
    piece = np.concatenate([np.asarray(some, dtype=np.int64) for some in found])
    apart = _apart(first[piece], last[piece], start[segment], end[segment])
    # Chords are off their curves by some tenth of a segment's length at most, where it turns.
    length = np.linalg.norm(end - start, axis=1)[segment]
    near = np.flatnonzero(apart <= within + 0.02 * length)
    rim, index = np.divmod(piece[near], _ALONG_RIM - 1)
    edge, t = edge[segment[near]], (low + high)[segment[near]] / 2
    along = -1 + (index + 0.5) * 2 / (_ALONG_RIM - 1)
    return _nearest(faces, boundary, owner[rim], side[rim], along, edge, t, within)


def _near_corners(faces: LatticeFaces, corners: Floats, within: float) -> NearMisses:
    """Faces near corners (n, 3) of the part."""
    low, high = (reach(faces.nets, axis=(1, 2)) for reach in (np.min, np.max))
    face, corner = np.nonzero(np.all((low[:, None] <= corners + within) & (high[:, None] >= corners - within), axis=-1))
    if not len(face):
        return NearMisses.joined([])
    heights, places = faces.heights(face, corners[corner, None])
    near = np.flatnonzero((np.abs(heights[:, 0]) <= within) & (np.abs(places[:, 0]).max(axis=1) < _BESIDE))
    _, du, dv = faces.derivatives(face[near], places[near, :, 0], places[near, :, 1])
    # Where the lattice goes, a corner of the part stays behind.
    directions = -unit(np.cross(du, dv)[:, 0])
    return NearMisses(heights[near, 0], directions, np.ones(len(near)))


def _apart(a: Floats, b: Floats, c: Floats, d: Floats) -> Floats:
    """Distances of segments (n, 3) to (n, 3) from others."""
    u, v, w = b - a, d - c, a - c
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    tiny = np.finfo(float).tiny
    s = np.clip((uv * vw - vv * uw) / np.maximum(uu * vv - uv * uv, tiny), 0, 1)
    t = np.clip((uv * s + vw) / np.maximum(vv, tiny), 0, 1)
    s = np.clip((uv * t - uw) / np.maximum(uu, tiny), 0, 1)
    return np.asarray(np.linalg.norm(w + s[:, None] * u - t[:, None] * v, axis=1))


def _nearest(
    faces: LatticeFaces,
    boundary: Boundary,
    face: Integers,
    side: Integers,
    along: Floats,
    edge: Integers,
    t: Floats,
    within: float,
) -> NearMisses:
    """Find where rims and edges are nearest to each other, by steps to where their tangents are."""
    first, last = (np.array([getattr(boundary.edges[k], name) for k in edge.tolist()]) for name in ("first", "last"))
    for step in range(_NEWTON_STEPS + 1):
        u, v = square_points(side, along)
        point, du, dv = (some[:, 0] for some in faces.derivatives(face, u[:, None], v[:, None]))
        rate = np.choose(side[:, None], [du, dv, -du, -dv])
        place, along_edge = boundary.along_edges(edge, t)
        if step == _NEWTON_STEPS:
            break
        apart = place - point
        uu, uv, vv = dot(rate, rate), dot(rate, along_edge), dot(along_edge, along_edge)
        uw, vw = dot(rate, apart), dot(along_edge, apart)
        square = np.maximum(uu * vv - uv * uv, 1e-6 * uu * vv)
        along = np.clip(along + np.clip((uw * vv - uv * vw) / square, -0.2, 0.2), -1, 1)
        t = np.clip(t + np.clip((uv * uw - uu * vw) / square, -(last - first) / 5, (last - first) / 5), first, last)
    across = np.cross(rate, along_edge)
    sine = np.linalg.norm(across, axis=1) / np.sqrt(dot(rate, rate) * dot(along_edge, along_edge))
    inner = (np.abs(along) < 1) & (t > first) & (t < last) & (sine > _ALONGSIDE)
    directions = across[inner] / np.linalg.norm(across[inner], axis=1, keepdims=True)
    heights = dot((point - place)[inner], directions)
    near = np.abs(heights) <= within
    # Neighbouring segments lead to the same place.
    key = np.round(np.concatenate([point[inner][near], place[inner][near]], axis=1) / (1e-3 * within))
    _, fresh = np.unique(key, axis=0, return_index=True)
    return NearMisses(heights[near][fresh], directions[near][fresh], np.ones(len(fresh)))

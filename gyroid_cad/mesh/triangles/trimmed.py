"""Triangles of faces that are trimmed by curves: each filled in the plane of its own parameters, joined by number.

Places along edges come with the faces, the same ones for both faces of an edge, and stay: so what is closed as faces is
closed as triangles. Whole patches, of four edges, are cut as those of whole lattices are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.mesh.triangles.grids import gridded
from gyroid_cad.mesh.triangles.plane import delaunay, inner_sides, parted, twice_area
from gyroid_cad.mesh.triangles.templates import FEWEST_STEPS, face_template

__all__ = ["FaceTriangles", "Outline", "Surfaces", "triangulated_faces"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places along a face's both parameters from which its bending is estimated.
_SAMPLES = 7
# Squares of a grid along one parameter at most; what is still too coarse is parted.
_MOST_SQUARES = 1000
# Where counts of a whole patch are more than these they are rounded up to three binary digits: few templates.
_FEW_COUNTS = 4
# Rounds in which triangles that are too far off are parted, and those that two faces have alike.
_ROUNDS, _REPAIRS = 12, 6


class Surfaces(Protocol):
    """Surfaces of numbered faces."""

    def evaluated(self, faces: Integers, places: Floats) -> tuple[Floats, Floats]:
        """Points in mm and products of the derivatives by both parameters, (n, 3), on faces (n,) at places (n, 2)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Border of a face in the plane of its parameters.

    Attributes
    ----------
    loops : list of (places, vertices)
        Polygons, the face to their left: shape (corners, 2), and the number of the vertex in space at each corner.
    square : tuple of int, optional
        Of a whole patch, whose only loop begins at its lowest parameters and runs along its four sides in equal steps:
        how many along each.
    """

    loops: list[tuple[Floats, Integers]]
    square: tuple[int, int, int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class FaceTriangles:
    """Triangles of faces.

    Attributes
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm: those given, then those inside the faces.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise in the parameters of their faces.
    faces : ndarray of int, shape (triangles,)
    crossed : ndarray of bool, shape (faces,)
        Faces whose borders cross themselves, with the steps they have.
    """

    vertices: Floats
    triangles: Integers
    faces: Integers
    crossed: Booleans


@dataclass(frozen=True, slots=True, eq=False)
class _Work:
    """Triangles of trimmed faces in their parameters: places, their faces, scaled copies, vertices and points."""

    surfaces: Surfaces
    scale: Floats
    places: Floats
    owner: Integers
    vertices: Integers
    points: Floats
    triangles: Integers
    # Number of the next vertex.
    following: int

    @property
    def flat(self) -> Floats:
        return self.places * self.scale[self.owner]


def triangulated_faces(
    outlines: Sequence[Outline], surfaces: Surfaces, points: Floats, limit: float, angle: float
) -> FaceTriangles:
    """Triangles of faces, with the places along their borders as they are and others inside them.

    Parameters
    ----------
    outlines : sequence of Outline
    surfaces : Surfaces
    points : ndarray, shape (vertices, 3)
        In mm.
    limit : float
        Largest distance of a triangle from its face, in mm.
    angle : float
        Between neighbouring triangles of a grid, in radians.
    """
    bends = _bending(outlines, surfaces)
    counts = _counts(bends, limit, angle)
    squares = np.array([outline.square is not None for outline in outlines], dtype=bool)
    steps = _rounded(np.maximum(counts.max(axis=1), FEWEST_STEPS))
    vertices, triangles, faces = _whole(outlines, np.flatnonzero(squares), steps, surfaces, points)
    # Where a surface bends more along one parameter than along the other, triangles are long along the other.
    flat = counts.max(axis=1, keepdims=True) == 1
    scale = np.where(flat, bends.lengths, counts) / bends.extent
    work = _begun(outlines, np.flatnonzero(~squares), counts, scale, surfaces, points, len(vertices))
    work = _near_enough(work, limit)
    work = _told_apart(work, triangles)
    made = work.vertices[work.triangles]
    owner = work.owner[work.triangles[:, 0]]
    area = twice_area(work.flat, work.triangles)
    crossed = np.zeros(len(outlines), dtype=bool)
    crossed[owner[area < -limit * limit * 1e-6]] = True
    # At a pole all places are one.
    kept = np.all(made != np.roll(made, 1, axis=1), axis=1)
    inside = work.points[_first_of(work.vertices, len(vertices))]
    return FaceTriangles(
        np.concatenate([vertices, inside]),
        np.concatenate([triangles, made[kept]]),
        np.concatenate([faces, owner[kept]]),
        crossed,
    )


def _first_of(vertices: Integers, first: int) -> Integers:
    """Places of the vertices from a first one on, all of which are there."""
    own = np.flatnonzero(vertices >= first)
    return own[np.argsort(vertices[own], kind="stable")]


# Steps ----------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Bending:
    """Bending of faces between samples: deviations by uu, uv and vv, angles by u and v; and the faces' sizes.

    Their lengths in mm and their extents in parameters, along both, have shape (faces, 2).
    """

    second: Floats
    turned: Floats
    lengths: Floats
    extent: Floats


def _bending(outlines: Sequence[Outline], surfaces: Surfaces) -> _Bending:
    low, high = _ranges(outlines)
    along = np.linspace(0, 1, _SAMPLES)
    grid = np.stack(np.meshgrid(along, along, indexing="ij"), axis=-1).reshape(-1, 2)
    places = low[:, np.newaxis] + grid * (high - low)[:, np.newaxis]
    faces = np.repeat(np.arange(len(outlines)), len(grid))
    shape = (len(outlines), _SAMPLES, _SAMPLES, 3)
    found, normals = (some.reshape(shape) for some in surfaces.evaluated(faces, places.reshape(-1, 2)))
    size = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = normals / np.where(size > 1e-9 * size.max(axis=(1, 2), keepdims=True), size, np.inf)
    x, n = found[:, 1:-1, 1:-1], normals[:, 1:-1, 1:-1]
    uu, vv = (found[:, 2:, 1:-1] + found[:, :-2, 1:-1] - 2 * x), (found[:, 1:-1, 2:] + found[:, 1:-1, :-2] - 2 * x)
    uv = (found[:, 2:, 2:] + found[:, :-2, :-2] - found[:, 2:, :-2] - found[:, :-2, 2:]) / 4
    second = np.stack([dot(some, n) / 8 for some in (uu, 2 * uv, vv)], axis=-1).reshape(len(outlines), -1, 3)
    turned, lengths = [], []
    for axis in (1, 2):
        one, other = (np.take(normals, range(*span), axis=axis) for span in ((1, _SAMPLES), (0, _SAMPLES - 1)))
        both = (dot(one, one) > 0) & (dot(other, other) > 0)
        turned.append((np.arccos(np.clip(dot(one, other), -1, 1)) * both).reshape(len(outlines), -1).max(axis=1))
        chords = np.linalg.norm(np.diff(found, axis=axis), axis=-1).sum(axis=axis)
        lengths.append(chords.mean(axis=1))
    extent = np.maximum(high - low, np.finfo(float).tiny)
    return _Bending(second, np.stack(turned, axis=1), np.stack(lengths, axis=1), extent)


def _ranges(outlines: Sequence[Outline]) -> tuple[Floats, Floats]:
    """Lowest and highest parameters of each face."""
    low = np.array([np.min([loop.min(axis=0) for loop, _ in outline.loops], axis=0) for outline in outlines])
    high = np.array([np.max([loop.max(axis=0) for loop, _ in outline.loops], axis=0) for outline in outlines])
    return low, high


def _counts(bends: _Bending, limit: float, angle: float) -> Integers:
    """Squares along both parameters with which the triangles of a grid are near enough; shape (faces, 2).

    A triangle between places of a quadratic surface is furthest off in the middle of one of its sides.
    """
    uu, uv, vv = np.moveaxis(bends.second, -1, 0)
    least = np.maximum(bends.turned * (_SAMPLES - 1) / angle, 1.0) / (_SAMPLES - 1)
    own = np.stack([np.abs(some).max(axis=1, initial=0.0) for some in (uu, vv)], axis=1)
    counts = np.maximum(np.sqrt(own / limit), least)
    a, b = counts[:, :1], counts[:, 1:]
    off = np.abs(uu / a**2 + uv / (a * b) + vv / b**2).max(axis=1, initial=0.0)
    counts *= np.sqrt(np.maximum(off / limit, 1.0))[:, np.newaxis]
    return np.asarray(np.clip(np.ceil(counts * (_SAMPLES - 1) - 1e-9), 1, _MOST_SQUARES), dtype=np.int64)


def _rounded(steps: Integers) -> Integers:
    if len(np.unique(steps)) <= _FEW_COUNTS:
        return steps
    unit = 2 ** np.maximum(0, np.floor(np.log2(steps)).astype(np.int64) - 2)
    return np.asarray(-(-steps // unit) * unit)


# Whole patches --------------------------------------------------------------------------------------------------------


def _whole(
    outlines: Sequence[Outline], faces: Integers, steps: Integers, surfaces: Surfaces, points: Floats
) -> tuple[Floats, Integers, Integers]:
    """All points with those inside whole patches, the triangles of these, and the face of each triangle."""
    keys = np.array([(int(steps[face]), *(outlines[face].square or ())) for face in faces.tolist()], dtype=np.int64)
    kinds, which = np.unique(keys.reshape(-1, 5), axis=0, return_inverse=True)
    made, triangles, owners, count = [points], [np.empty((0, 3), dtype=np.int64)], [faces[:0]], len(points)
    for number, kind in enumerate(kinds.tolist()):
        template = face_template(kind[0], (kind[1], kind[2], kind[3], kind[4]))
        some = faces[which.ravel() == number]
        rim = sum(kind[1:])
        inner = template.places[rim:]
        low, high = _ranges([outlines[face] for face in some.tolist()])
        middle, half = (low + high) / 2, (high - low) / 2
        places = middle[:, np.newaxis] + inner * half[:, np.newaxis]
        found, _ = surfaces.evaluated(np.repeat(some, len(inner)), places.reshape(-1, 2))
        # Of a template the corners come first, then what lies between them.
        starts = np.cumsum([0, *kind[1:]])
        order = np.concatenate([starts[:4], *(np.arange(starts[k] + 1, starts[k + 1]) for k in range(4))])
        border = np.array([outlines[face].loops[0][1][order] for face in some.tolist()])
        inside = count + np.arange(len(some) * len(inner)).reshape(len(some), -1)
        numbers = np.concatenate([border, inside], axis=1)
        made.append(found)
        triangles.append(numbers[:, template.triangles].reshape(-1, 3))
        owners.append(np.repeat(some, len(template.triangles)))
        count += len(found)
    return np.concatenate(made), np.concatenate(triangles), np.concatenate(owners)


# Trimmed ones ---------------------------------------------------------------------------------------------------------


def _begun(
    outlines: Sequence[Outline],
    faces: Integers,
    counts: Integers,
    scale: Floats,
    surfaces: Surfaces,
    points: Floats,
    first: int,
) -> _Work:
    """Grids and bands of trimmed faces; places inside them are vertices from a first one on."""
    places, owner, vertices, triangles = [np.empty((0, 2))], [faces[:0]], [faces[:0]], [np.empty((0, 3), np.int64)]
    count = 0
    low, high = _ranges([outlines[face] for face in faces.tolist()]) if len(faces) else (np.empty((0, 2)),) * 2
    for index, face in enumerate(faces.tolist()):
        loops = [loop for loop, _ in outlines[face].loops]
        stretch, shape = scale[face], (int(counts[face, 0]), int(counts[face, 1]))
        nodes, made = gridded(
            [loop * stretch for loop in loops],
            low[index] * stretch,
            (high - low)[index] * stretch / np.array(shape),
            shape,
        )
        own = [*loops, nodes / stretch]
        places += own
        vertices += [*(numbers for _, numbers in outlines[face].loops), first + np.arange(len(nodes))]
        first += len(nodes)
        triangles.append(made + count)
        here = sum(map(len, own))
        owner.append(np.full(here, face))
        count += here
    work = _Work(
        surfaces,
        scale,
        np.concatenate(places),
        np.concatenate(owner),
        np.concatenate(vertices),
        np.empty((count, 3)),
        np.concatenate(triangles),
        first,
    )
    known = work.vertices < len(points)
    work.points[known] = points[work.vertices[known]]
    work.points[~known] = surfaces.evaluated(work.owner[~known], work.places[~known])[0]
    return _exchanged(work)


def _exchanged(work: _Work) -> _Work:
    return replace(work, triangles=delaunay(work.flat, work.triangles, work.owner[work.triangles[:, 0]]))


def _near_enough(work: _Work, limit: float) -> _Work:
    """Triangles parted until the middles of their sides inside the faces are near enough."""
    for _ in range(_ROUNDS):
        one, other = inner_sides(work.triangles)
        off = _off(work, one)
        far = off > limit
        if not far.any():
            break
        work = _exchanged(_with_middles(work, one[far], other[far], off[far]))
    return work


def _told_apart(work: _Work, others: Integers) -> _Work:
    """Triangles parted where a side inside a face joins vertices that another side joins too, or a vertex to itself."""
    for _ in range(_REPAIRS):
        made = np.concatenate([others, work.vertices[work.triangles]])
        starts, ends = made.ravel(), np.roll(made, -1, axis=1).ravel()
        keys = np.minimum(starts, ends) * (int(made.max(initial=0)) + 1) + np.maximum(starts, ends)
        distinct = np.all(made != np.roll(made, 1, axis=1), axis=1)
        _, which, uses = np.unique(keys[np.repeat(distinct, 3)], return_inverse=True, return_counts=True)
        shared = np.zeros(len(keys), dtype=bool)
        shared[np.repeat(distinct, 3)] = uses[which.ravel()] > 2
        shared = shared[3 * len(others) :]
        one, other = inner_sides(work.triangles)
        a, b = work.triangles.ravel()[one], np.roll(work.triangles, -1, axis=1).ravel()[one]
        wrong = shared[one] | shared[other] | ((work.vertices[a] == work.vertices[b]) & (_length(work, a, b) > 0))
        if not wrong.any():
            break
        work = _with_middles(work, one[wrong], other[wrong], _length(work, a, b)[wrong])
    return work


def _length(work: _Work, a: Integers, b: Integers) -> Floats:
    """Distance of the surface from both ends half way between them: 0 along a pole."""
    middle = work.surfaces.evaluated(work.owner[a], (work.places[a] + work.places[b]) / 2)[0]
    away = np.linalg.norm(middle - work.points[a], axis=1) + np.linalg.norm(middle - work.points[b], axis=1)
    return np.where(away > 1e-6 * np.abs(work.points).max(initial=1.0), away, 0.0)


def _off(work: _Work, sides: Integers) -> Floats:
    """Distances of the middles of sides from the surface, along its normal."""
    a, b = work.triangles.ravel()[sides], np.roll(work.triangles, -1, axis=1).ravel()[sides]
    found, normals = work.surfaces.evaluated(work.owner[a], (work.places[a] + work.places[b]) / 2)
    away = (work.points[a] + work.points[b]) / 2 - found
    size = np.linalg.norm(normals, axis=1)
    return np.where(
        size > 0, np.abs(dot(away, normals)) / np.maximum(size, np.finfo(float).tiny), np.linalg.norm(away, axis=1)
    )


def _with_middles(work: _Work, one: Integers, other: Integers, off: Floats) -> _Work:
    """Some inner sides parted in their middles, of each triangle the one that matters most."""
    rank = np.empty(len(off), dtype=np.int64)
    rank[np.argsort(-off, kind="stable")] = np.arange(len(off))
    best = np.full(len(work.triangles), len(off))
    np.minimum.at(best, one // 3, rank)
    np.minimum.at(best, other // 3, rank)
    chosen = (best[one // 3] == rank) & (best[other // 3] == rank)
    one, other = one[chosen], other[chosen]
    a, b = work.triangles.ravel()[one], np.roll(work.triangles, -1, axis=1).ravel()[one]
    owner, places = work.owner[a], (work.places[a] + work.places[b]) / 2
    new = len(work.places) + np.arange(len(one))
    return replace(
        work,
        triangles=parted(work.triangles, (one, other), new)[0],
        places=np.concatenate([work.places, places]),
        owner=np.concatenate([work.owner, owner]),
        vertices=np.concatenate([work.vertices, work.following + np.arange(len(new))]),
        following=work.following + len(new),
        points=np.concatenate([work.points, work.surfaces.evaluated(owner, places)[0]]),
    )

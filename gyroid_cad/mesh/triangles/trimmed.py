"""Triangles of faces that are trimmed by curves: each filled in the plane of its own parameters, joined by number.

Places along edges come with the faces, the same ones for both faces of an edge, and stay: so what is closed as faces is
closed as triangles. Whole patches, of four edges, are cut as those of whole lattices are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import cross, dot, unit
from gyroid_cad.mesh.triangles.grids import gridded
from gyroid_cad.mesh.triangles.outlined import Outlines, Surfaces, bending
from gyroid_cad.mesh.triangles.plane import delaunay, parted, shared_sides, twice_area
from gyroid_cad.mesh.triangles.templates import FEWEST_STEPS, face_template, few_counts

__all__ = ["FaceTriangles", "triangulated_faces"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Rounds in which triangles that are too far off are parted, and those that two faces have alike.
_ROUNDS, _REPAIRS = 12, 6


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
    places : ndarray, shape (triangles, 3, 2)
        Parameters of the corners, on their faces.
    """

    vertices: Floats
    triangles: Integers
    faces: Integers
    crossed: Booleans
    places: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Placed:
    """Triangles, their faces, and the parameters of their corners there, of shape (triangles, 3, 2)."""

    vertices: Floats
    triangles: Integers
    faces: Integers
    corners: Floats


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
    outlines: Outlines, surfaces: Surfaces, points: Floats, limit: float, angle: float
) -> FaceTriangles:
    """Triangles of faces, with the places along their borders as they are and others inside them.

    Parameters
    ----------
    outlines : Outlines
    surfaces : Surfaces
    points : ndarray, shape (vertices, 3)
        In mm.
    limit : float
        Largest distance of a triangle from its face, in mm.
    angle : float
        Between neighbouring triangles of a grid, in radians.
    """
    bends = bending(outlines, surfaces)
    counts = bends.squares(limit, angle)
    square = outlines.squares[:, 0] > 0
    steps = few_counts(np.maximum(counts.max(axis=1), FEWEST_STEPS))
    whole = _whole(outlines, np.flatnonzero(square), steps, surfaces, points)
    # Where a surface bends more along one parameter than along the other, triangles are long along the other.
    flat = counts.max(axis=1, keepdims=True) == 1
    scale = np.where(flat, bends.lengths, counts) / bends.extent
    work = _begun(outlines, np.flatnonzero(~square), counts, scale, surfaces, whole.vertices)
    work = _near_enough(work, limit)
    work = _told_apart(work, whole.triangles)
    made = work.vertices[work.triangles]
    owner = work.owner[work.triangles[:, 0]]
    area = twice_area(work.flat, work.triangles)
    crossed = np.bincount(owner[area < -limit * limit * 1e-6], minlength=len(square)) > 0
    # At a pole all places are one.
    kept = np.all(made != np.roll(made, 1, axis=1), axis=1)
    inside = work.points[_first_of(work.vertices, len(whole.vertices))]
    both = _Placed(
        np.concatenate([whole.vertices, inside]),
        np.concatenate([whole.triangles, made[kept]]),
        np.concatenate([whole.faces, owner[kept]]),
        np.concatenate([whole.corners, work.places[work.triangles[kept]]]),
    )
    return FaceTriangles(_of_volume(both, surfaces, len(points)), both.triangles, both.faces, crossed, both.corners)


def _first_of(vertices: Integers, first: int) -> Integers:
    """Places of the vertices from a first one on, all of which are there."""
    own = np.flatnonzero(vertices >= first)
    return own[np.argsort(vertices[own], kind="stable")]


# Volume ---------------------------------------------------------------------------------------------------------------


def _of_volume(made: _Placed, surfaces: Surfaces, first: int) -> Floats:
    """Vertices, those inside faces moved along the normals until each face has as much on one side as on the other.

    Between a triangle and a quadratic surface through its corners lies its area times 3/4 of the distance in its
    middle. The vertices of a face, from a first number on, all move by as much, never further than the triangles are
    off: those along borders, which other faces have too, stay.
    """
    vertices, triangles, faces = made.vertices, made.triangles, made.faces
    found, normals = surfaces.evaluated(faces, made.corners.mean(axis=1))
    normals = unit(normals)
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    off = dot((a + b + c) / 3 - found, normals)
    area = np.linalg.norm(cross((b - a).T, (c - a).T), axis=0) / 2
    inside = triangles >= first
    count = int(faces.max(initial=-1)) + 1
    excess = np.bincount(faces, 3 / 4 * area * off, count)
    movable = np.bincount(faces, area * inside.sum(axis=1) / 3, count)
    furthest = np.zeros(count)
    np.maximum.at(furthest, faces, np.abs(off))
    by = np.divide(-excess, movable, out=np.zeros(count), where=movable > 0).clip(-furthest, furthest)
    # The normal at a vertex is the mean of those in the middles of the triangles round it.
    corner, of = triangles[inside] - first, np.nonzero(inside)[0]
    total = len(vertices) - first
    weighted = area[:, np.newaxis] * normals
    mean = np.zeros((total, 3))
    for axis in range(3):
        mean[:, axis] = np.bincount(corner, weighted[of, axis], total)
    owner = np.zeros(total, dtype=np.int64)
    owner[corner] = faces[of]
    return np.concatenate([vertices[:first], vertices[first:] + by[owner, np.newaxis] * unit(mean)])


# Whole patches --------------------------------------------------------------------------------------------------------


def _whole(outlines: Outlines, faces: Integers, steps: Integers, surfaces: Surfaces, points: Floats) -> _Placed:
    """All points with those inside whole patches, and the triangles of these."""
    kinds, which = np.unique(np.column_stack([steps, outlines.squares])[faces], axis=0, return_inverse=True)
    (low, high), firsts = outlines.ranges, outlines.firsts
    middle, half = (low + high) / 2, (high - low) / 2
    made, triangles, owners, count = [points], [np.empty((0, 3), dtype=np.int64)], [faces[:0]], len(points)
    corners = [np.empty((0, 3, 2))]
    for number, (inner, *edges) in enumerate(kinds.tolist()):
        template = face_template(inner, (edges[0], edges[1], edges[2], edges[3]))
        some = faces[which.ravel() == number]
        rim = sum(edges)
        places = middle[some, np.newaxis] + template.places * half[some, np.newaxis]
        inside = len(template.places) - rim
        found, _ = surfaces.evaluated(np.repeat(some, inside), places[:, rim:].reshape(-1, 2))
        # Of a template the corners come first, then what lies between them.
        starts = np.cumsum([0, *edges])
        order = np.concatenate([starts[:4], *(np.arange(starts[k] + 1, starts[k + 1]) for k in range(4))])
        border = outlines.vertices[firsts[some, np.newaxis] + order]
        numbers = np.concatenate([border, count + np.arange(len(found)).reshape(len(some), inside)], axis=1)
        made.append(found)
        triangles.append(numbers[:, template.triangles].reshape(-1, 3))
        owners.append(np.repeat(some, len(template.triangles)))
        corners.append(places[:, template.triangles].reshape(-1, 3, 2))
        count += len(found)
    return _Placed(np.concatenate(made), np.concatenate(triangles), np.concatenate(owners), np.concatenate(corners))


# Trimmed ones ---------------------------------------------------------------------------------------------------------


def _begun(
    outlines: Outlines,
    faces: Integers,
    counts: Integers,
    scale: Floats,
    surfaces: Surfaces,
    vertices: Floats,
) -> _Work:
    """Grids and bands of trimmed faces, their places numbered after the vertices that are there."""
    low, owners = outlines.ranges[0], outlines.owners
    units = (outlines.places - low[owners]) * scale[owners]
    nodes, faces_of_nodes, triangles = gridded(outlines, faces, units, counts)
    inside = low[faces_of_nodes] + nodes / scale[faces_of_nodes]
    work = _Work(
        surfaces,
        scale,
        np.concatenate([outlines.places, inside]),
        np.concatenate([owners, faces_of_nodes]),
        np.concatenate([outlines.vertices, len(vertices) + np.arange(len(nodes))]),
        np.concatenate([vertices[outlines.vertices], surfaces.evaluated(faces_of_nodes, inside)[0]]),
        triangles,
        len(vertices) + len(nodes),
    )
    return _exchanged(work)


def _exchanged(work: _Work) -> _Work:
    return replace(work, triangles=delaunay(work.flat, work.triangles, work.owner[work.triangles[:, 0]]))


def _near_enough(work: _Work, limit: float) -> _Work:
    """Triangles parted until the middles of their sides inside the faces are near enough."""
    looked_at = np.ones(len(work.scale), dtype=bool)
    for _ in range(_ROUNDS):
        one, other = shared_sides(work.triangles)
        owner = work.owner[work.triangles[one // 3, 0]]
        some = looked_at[owner]
        one, other, owner = one[some], other[some], owner[some]
        off = _off(work, one)
        far = off > limit
        if not far.any():
            break
        work = _exchanged(_with_middles(work, one[far], other[far], off[far]))
        looked_at = np.bincount(owner[far], minlength=len(looked_at)) > 0
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
        one, other = shared_sides(work.triangles)
        a, b = work.triangles.ravel()[one], np.roll(work.triangles, -1, axis=1).ravel()[one]
        looped = work.vertices[a] == work.vertices[b]
        some = np.flatnonzero(shared[one] | shared[other] | looped)
        length = _length(work, a[some], b[some])
        wrong = ~looped[some] | (length > 0)
        if not wrong.any():
            break
        some = some[wrong]
        work = _with_middles(work, one[some], other[some], length[wrong])
    return work


def _length(work: _Work, a: Integers, b: Integers) -> Floats:
    """Distance of the surface from both ends half way between them: 0 along a pole."""
    middle = work.surfaces.evaluated(work.owner[a], (work.places[a] + work.places[b]) / 2)[0]
    away = np.linalg.norm(middle - work.points[a], axis=1) + np.linalg.norm(middle - work.points[b], axis=1)
    return np.asarray(np.where(away > 1e-6 * np.abs(work.points).max(initial=1.0), away, 0.0))


def _off(work: _Work, sides: Integers) -> Floats:
    """Distances of the middles of sides from the surface, along its normal."""
    a, b = work.triangles.ravel()[sides], np.roll(work.triangles, -1, axis=1).ravel()[sides]
    found, normals = work.surfaces.evaluated(work.owner[a], (work.places[a] + work.places[b]) / 2)
    away = (work.points[a] + work.points[b]) / 2 - found
    flat = np.linalg.norm(normals, axis=1) == 0
    return np.asarray(np.where(flat, np.linalg.norm(away, axis=1), np.abs(dot(away, unit(normals)))))


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

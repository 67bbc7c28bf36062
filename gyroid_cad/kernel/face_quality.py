"""Quality of a shape's faces: degree and knots of their surfaces, their width and curvature, and where they cross."""

from __future__ import annotations

from math import radians

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import by_number
from gyroid_cad.common.verdicts import Worst, as_point, largest, smallest
from gyroid_cad.errors import ExportError, KernelError
from gyroid_cad.kernel.borders import Splines
from gyroid_cad.kernel.check import compound_of
from gyroid_cad.kernel.outlines import face_triangles
from gyroid_cad.kernel.sampled import SampledShape
from gyroid_cad.kernel.stl import diagonal, meshed_by_face
from gyroid_cad.mesh.triangles.faults import crossing_triangles
from gyroid_cad.nurbs.surface import grid_points
from gyroid_cad.trim.loops import within_polygons

__all__ = ["face_quality"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of the triangles by which faces are measured, in parts of the shape's diagonal; and between neighbours, in degrees.
_DEVIATION, _FINEST, _ANGLE = 1e-3, 1e-6, 20.0
# Where faces seem to cross they are looked at again, so many times, by triangles so many times as near.
_ROUNDS, _NEARER = 2, 4.0
# An edge that comes through a triangle by less, in parts of the diagonal, touches it.
_TOUCHES = 1e-7
# Places along each parameter of a face where its curvature is looked at.
_GRID = 9
_SPLINES_AT_ONCE = 64
_NO_TRIANGLES = np.empty((0, 3)), np.empty((0, 3), np.int64), np.empty(0, np.int64)


def face_quality(sampled: SampledShape, areas: Floats) -> dict[str, Worst]:
    """Measure the faces of a shape.

    Parameters
    ----------
    sampled : SampledShape
    areas : ndarray, shape (faces,)
        In mm2.

    Returns
    -------
    dict of str to Worst
        "degree" of surfaces; "knot distance", in mm in space between lines of neighbouring knots; "narrowest face", its
        mean width in mm; "radius of curvature" in mm; "self-intersection", the number of pairs of faces that cross.
    """
    surfaces = sampled.surfaces
    knots = [_knot_distance(splines) for splines in surfaces.groups]
    degrees = [max(splines.first.degree_u, splines.first.degree_v) for splines in surfaces.groups]
    places = np.array([splines.nets[0, 0, 0] for splines in surfaces.groups]).reshape(-1, 3)
    vertices, triangles, owner = _triangles(sampled)
    return {
        "degree": largest(np.array(degrees, dtype=float), places),
        "knot distance": smallest(
            np.array([distance for distance, _ in knots]), np.array([place for _, place in knots]).reshape(-1, 3)
        ),
        "narrowest face": _narrowest(sampled, areas),
        "radius of curvature": _smallest_radius(sampled),
        "self-intersection": _crossings(sampled, vertices, triangles, owner, diagonal(sampled.shape)),
    }


def _knot_distance(splines: Splines) -> tuple[float, Floats]:
    """Smallest distance in space between lines of neighbouring knots, at their widest, and a place between them.

    The middle of each span is looked at too: a surface that closes may be one span.
    """
    one, lines = splines.first, []
    for knots in (one.knots_u, one.knots_v):
        values = np.unique(knots)
        lines.append(np.interp(np.arange(2 * len(values) - 1) / 2, np.arange(len(values)), values))
    worst, place = np.inf, np.zeros(3)
    for start in range(0, len(splines.nets), _SPLINES_AT_ONCE):
        nets = splines.nets[start : start + _SPLINES_AT_ONCE]
        points = grid_points(nets, one.weights, (one.knots_u, one.knots_v), *lines)
        for grid in (points, points.swapaxes(1, 2)):
            steps = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
            spans = (steps[:, ::2] + steps[:, 1::2]).max(axis=2)
            index = np.unravel_index(np.argmin(spans), spans.shape)
            if spans[index] < worst:
                worst, place = float(spans[index]), grid[index[0], 2 * index[1] + 1, grid.shape[2] // 2]
    return worst, place


def _triangles(sampled: SampledShape) -> tuple[Floats, Integers, Integers]:
    """Triangles of the faces of a shape, and the face of each; none where they cannot be made."""
    deviation = max(_DEVIATION * diagonal(sampled.shape), _FINEST)
    if not sampled.faces:
        return _NO_TRIANGLES
    try:
        made = face_triangles(sampled.faces, deviation, radians(_ANGLE), (sampled.surfaces, sampled.borders))
        return made.vertices, made.triangles, made.faces
    except KernelError:
        pass
    try:
        return meshed_by_face(compound_of(sampled.faces), "the check", deviation, _ANGLE)
    except ExportError:
        return _NO_TRIANGLES


def _narrowest(sampled: SampledShape, areas: Floats) -> Worst:
    """Smallest mean width of a face, in mm: twice its area, over the length of its border."""
    borders, count = sampled.borders, len(sampled.faces)
    length = np.bincount(borders.owner, np.nan_to_num(sampled.lengths[borders.edge]), count)
    places = np.array(
        [sampled.points[borders.edge[borders.loops[np.searchsorted(borders.face, k)]], 0] for k in range(count)]
    )
    return smallest(np.where(length > 0, 2 * areas / np.maximum(length, np.finfo(float).tiny), np.nan), places)


def _smallest_radius(sampled: SampledShape) -> Worst:
    """Smallest radius of curvature of a face, in mm, where it is looked at: along its border and on a grid inside."""
    surfaces, borders = sampled.surfaces, sampled.borders
    whole = np.zeros(len(sampled.faces), dtype=bool)
    whole[borders.owner[borders.whole_patches(surfaces.domains)[:, 0]]] = True
    owner, places = borders.owner[sampled.uses], sampled.on_faces[0]
    faces, looked_at = [np.repeat(owner, places.shape[1])], [places.reshape(-1, 2)]
    for number, uses in by_number(owner).items():
        own = places[uses]
        grid = _grid(*(surfaces.domains[number] if whole[number] else (own.min(axis=(0, 1)), own.max(axis=(0, 1)))))
        if not whole[number]:
            if getattr(surfaces.others.get(number), "kind", "") in ("plane", "cylinder", "sphere"):
                continue
            scale = np.maximum(np.ptp(own, axis=(0, 1)), np.finfo(float).tiny)
            ends = (own[:, :-1].reshape(-1, 2) / scale, own[:, 1:].reshape(-1, 2) / scale)
            grid = grid[within_polygons(grid / scale, *ends)[0]]
        faces.append(np.full(len(grid), number))
        looked_at.append(grid)
    face, place = np.concatenate(faces), np.concatenate(looked_at)
    radii = surfaces.smallest_radii(face, place)
    found = smallest(np.where(np.isfinite(radii), radii, np.nan), np.zeros((len(radii), 3)))
    if found.value is None:
        return found
    worst = int(np.nanargmin(radii))
    return Worst(found.value, as_point(surfaces.evaluated(face[[worst]], place[[worst]])[0][0]))


def _grid(low: Floats, high: Floats) -> Floats:
    """Places inside a rectangle of parameters; shape (n, 2)."""
    fractions = (np.arange(_GRID) + 0.5) / _GRID
    along = [a + fractions * (b - a) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)


def _crossings(sampled: SampledShape, vertices: Floats, triangles: Integers, owner: Integers, extent: float) -> Worst:
    """Pairs of faces of one body that cross, or faces that cross themselves: how many, and where.

    Triangles cross where they are too coarse, too: what crosses is looked at again by finer ones.
    """
    faces, bodies = np.arange(len(sampled.faces)), sampled.bodies
    deviation = _DEVIATION * extent
    for again in range(_ROUNDS + 1):
        pairs, places = crossing_triangles(vertices, triangles, _TOUCHES * extent)
        both = faces[owner[pairs]]
        inside = bodies[both[:, 0]] == bodies[both[:, 1]]
        both, places = np.unique(np.sort(both[inside], axis=1), axis=0), places[inside]
        if not len(both) or again == _ROUNDS:
            break
        deviation /= _NEARER
        faces = np.unique(both)
        try:
            finer = face_triangles([sampled.faces[face] for face in faces.tolist()], deviation, radians(_ANGLE))
        except KernelError:
            break
        vertices, triangles, owner = finer.vertices, finer.triangles, finer.faces
    return Worst(len(both), as_point(places[0]) if len(both) else None)

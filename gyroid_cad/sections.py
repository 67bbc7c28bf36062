"""Curves in which the wall's faces cross planes, found in the parameter square and fitted there and in space.

A crossing is a level curve of one coordinate. Where it enters and leaves the square is found on the square's sides
alone, so that neighbours who share a side find the same places. From every entry the curve is followed to its exit;
stations evenly spread along it are then made exact by Newton's method and interpolated by one cubic spline for the
curve in the square and one for that in space, with the same parameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs import basis

__all__ = ["PLANES", "Faces", "Rims", "Sections", "plane_sections", "rim_crossings", "section_knots", "square_points"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of a box: low and high along x, then y, then z. What is kept lies above the low ones, below the high ones.
PLANES = tuple((axis, sign) for axis in range(3) for sign in (1, -1))
_AXES = np.array([axis for axis, _ in PLANES])
_SIGNS = np.array([sign for _, sign in PLANES], dtype=float)
_INWARDS = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
# Along each side of the square: so close that a side crosses no plane twice between two of them, unless it touches it.
_RIM_SAMPLES = 65
# In the square, whose sides are 2 long; finer where a curve is not followed to an exit.
_STEPS = (0.1, 0.025, 0.006)
_LONGEST = 24.0
# Cubic splines through so many stations; the fewest that are close, in cell sizes, or the most if near enough.
_STATIONS = (16, 32, 64, 128)
_CLOSE, _NEAR_ENOUGH = 1e-7, 2e-6
_NEWTON_STEPS = 8
_LEAST_OWN = 1e-3
# A curve in the square that swings out so far is no fit.
_WIDEST = 1.1
# Of Newton's method in the square: near a saddle it would leap out of where the face is defined.
_LONGEST_STEP = 0.1
# A gradient across a side, or of the coordinate itself, that small means that face and plane touch.
_TOUCHING = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
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

    def chunk(self, first: int, count: int) -> Faces:
        """Some of the faces."""
        chosen = slice(first, first + count)
        return Faces(self.nets[chosen], self.weights, self.knots, self.levels[chosen])

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
        along_u, along_v = ([self._functions(x, k) for k in (0, 1)] for x in (u, v))
        homogeneous = self._homogeneous(which)
        point, du, dv = (
            _products(homogeneous, *pair)
            for pair in ((along_u[0], along_v[0]), (along_u[1], along_v[0]), (along_u[0], along_v[1]))
        )
        weight = point[..., 3:]
        place = point[..., :3] / weight
        return place, (du[..., :3] - du[..., 3:] * place) / weight, (dv[..., :3] - dv[..., 3:] * place) / weight

    def points(self, which: Integers, u: Floats, v: Floats) -> Floats:
        """Points of chosen faces alone; shape (m, q, 3)."""
        point = _products(self._homogeneous(which), self._functions(u, 0), self._functions(v, 0))
        return np.asarray(point[..., :3] / point[..., 3:])

    def _homogeneous(self, which: Integers) -> Floats:
        weights = self.weights[..., np.newaxis]
        nets = self.nets[which]
        return np.concatenate([nets * weights, np.broadcast_to(weights, (*nets.shape[:3], 1))], axis=-1)

    def _functions(self, x: Floats, derivative: int) -> Floats:
        return basis(self.knots, 3, x.ravel(), derivative).reshape(*x.shape, -1)

    def heights(self, which: Integers, u: Floats, v: Floats) -> Floats:
        """How far points lie on the kept side of every plane, in mm; shape (m, q, 6), infinite for planes not near."""
        points = self.points(which, u, v)
        heights = _SIGNS * (points[..., _AXES] - self.levels[which][:, np.newaxis])
        return np.where(np.isnan(heights), np.inf, heights)


@dataclass(frozen=True, slots=True, eq=False)
class Rims:
    """Where sides of the square cross planes, ordered by face, then side, then along the side.

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
        """In the square; shape (crossings, 2)."""
        return np.stack(square_points(self.side, self.along), axis=-1)


@dataclass(frozen=True, slots=True, eq=False)
class Sections:
    """Curves in which faces cross planes, what is wanted on their left.

    Attributes
    ----------
    face, plane : ndarray of int, shape (curves,)
    start, end : ndarray of int, shape (curves,)
        Rim crossings that a curve joins.
    parameters : list of ndarray, shape (m, 2)
        Control points of each curve in the square.
    points : list of ndarray, shape (m, 3)
        Control points in space, as many, in mm along the box's axes.
    deviation : ndarray, shape (curves,)
        Of the two from each other, in mm.
    """

    face: Integers
    plane: Integers
    start: Integers
    end: Integers
    parameters: list[Floats]
    points: list[Floats]
    deviation: Floats

    def __len__(self) -> int:
        return len(self.face)

    def in_square(self, curve: int, t: Floats, derivative: int = 0) -> Floats:
        """Places in the square, or their rate of change; shape (q, 2)."""
        return _on_section(self.parameters[curve], t, derivative)

    def in_space(self, curve: int, t: Floats, derivative: int = 0) -> Floats:
        """Points in mm, or their rate of change; shape (q, 3)."""
        return _on_section(self.points[curve], t, derivative)


@lru_cache
def section_knots(control_points: int) -> Floats:
    """Knots on [0, 1] of a cubic through as many evenly spaced stations, none at the second and last but one."""
    inner = np.linspace(0, 1, control_points)[2:-2]
    return np.concatenate([np.zeros(4), inner, np.ones(4)])


def _on_section(control: Floats, t: Floats, derivative: int) -> Floats:
    return np.asarray(_section_basis(len(control), np.asarray(t, float).tobytes(), derivative) @ control)


@lru_cache(maxsize=256)
def _section_basis(control_points: int, t: bytes, derivative: int) -> Floats:
    """Most curves are looked at in the same places: at evenly spread ones, or at Gauss points from end to end."""
    return basis(section_knots(control_points), 3, np.frombuffer(t), derivative)


def _products(nets: Floats, along_u: Floats, along_v: Floats) -> Floats:
    """Sums over nets (m, n, n, 4) of functions (m, q, n) along u and v; shape (m, q, 4)."""
    rows = (along_u @ nets.reshape(*nets.shape[:2], -1)).reshape(*along_u.shape[:2], *nets.shape[2:])
    return np.asarray(np.einsum("mqjc,mqj->mqc", rows, along_v))


def square_points(side: Integers | int, along: Floats) -> tuple[Floats, Floats]:
    """Parameters (u, v) of places on the square's sides, run round it."""
    along = np.asarray(along)
    one = np.ones_like(along)
    u = np.choose(side, [along, one, -along, -one])
    v = np.choose(side, [-one, along, one, -along])
    return u, v


def rim_crossings(faces: Faces) -> Rims:
    """Where the sides of faces cross the planes near them.

    Raises
    ------
    KernelError
        If a side only touches a plane, or a corner lies in one.
    """
    samples = np.linspace(-1, 1, _RIM_SAMPLES)
    every = np.arange(len(faces))
    uv = [square_points(side, samples) for side in range(4)]
    u, v = (np.tile(np.concatenate([pair[k] for pair in uv]), (len(faces), 1)) for k in (0, 1))
    heights = faces.heights(every, u, v).reshape(len(faces), 4, _RIM_SAMPLES, 6)
    above = heights > 0
    face, side, before, plane = np.nonzero(above[:, :, 1:] != above[:, :, :-1])
    here, there = heights[face, side, before, plane], heights[face, side, before + 1, plane]
    step = samples[1] - samples[0]
    lowest = samples[before]
    along = lowest + step * here / (here - there)
    for _ in range(_NEWTON_STEPS):
        height, slopes = _height(faces, face, plane, *square_points(side, along))
        rate = _rate_along(side, slopes)
        with np.errstate(divide="ignore", invalid="ignore"):
            along = np.clip(np.nan_to_num(along - height / rate), lowest, lowest + step)
    height, slopes = _height(faces, face, plane, *square_points(side, along))
    steepness = np.linalg.norm(slopes, axis=-1)
    across = slopes[:, 1] * _INWARDS[side, 0] - slopes[:, 0] * _INWARDS[side, 1]
    size = np.ptp(faces.nets) if len(faces) else 1.0
    touching = (np.abs(across) <= _TOUCHING * steepness) | (np.abs(height) > 1e-10 * size) | (np.abs(along) >= 1)
    if np.any(touching):
        raise KernelError("an edge of the lattice touches the box")
    order = np.lexsort((along, side, face))
    return Rims(face[order], side[order], plane[order], along[order], (across > 0)[order])


def plane_sections(faces: Faces, rims: Rims, size: float) -> Sections:
    """The curves between the crossings of the sides.

    Parameters
    ----------
    faces : Faces
    rims : Rims
    size : float
        Of a cell in mm, by which closeness is measured.

    Raises
    ------
    KernelError
        If a curve cannot be followed from one side to another: then the face touches the plane.
    """
    starts = np.flatnonzero(rims.entering)
    for step in _STEPS:
        paths = _followed(faces, rims, starts, step)
        ends = _exits(rims, starts, paths, 2 * step)
        if ends is not None:
            break
    else:
        raise KernelError("a face of the lattice touches the box: where they cross cannot be followed")
    ways = [np.vstack([path[:-1], rims.places[end]]) for path, end in zip(paths, ends.tolist(), strict=True)]
    return _fitted_closely(faces, rims, starts, ends, ways, size)


def _rate_along(side: Integers, slopes: Floats) -> Floats:
    """Rate of change along the side, from the slopes along u and v."""
    return np.choose(side, [slopes[:, 0], slopes[:, 1], -slopes[:, 0], -slopes[:, 1]])


def _height(faces: Faces, face: Integers, plane: Integers, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Heights above one plane each, shape of u and v, (m,) or (m, q); and their slopes along u and v, (..., 2)."""
    flat = u.ndim == 1
    if flat:
        u, v = u[:, np.newaxis], v[:, np.newaxis]
    rows = np.arange(len(face))
    values = [d[rows, :, _AXES[plane]] for d in faces.derivatives(face, u, v)]
    sign = _SIGNS[plane][:, np.newaxis]
    height = sign * (values[0] - faces.levels[face, plane][:, np.newaxis])
    slopes = sign[..., np.newaxis] * np.stack(values[1:], axis=-1)
    return (height[:, 0], slopes[:, 0]) if flat else (height, slopes)


def _followed(faces: Faces, rims: Rims, starts: Integers, step: float) -> list[Floats]:
    """Places along the curve from each start until it has left the square, the last one outside."""
    place = rims.places[starts]
    paths = [[point] for point in place]
    live = np.arange(len(starts))
    for _ in range(int(_LONGEST / step)):
        face, plane = rims.face[starts[live]], rims.plane[starts[live]]
        onward = _along(faces, face, plane, place)
        place = place + step * _along(faces, face, plane, place + step / 2 * onward)
        for _ in range(2):
            place = place + _towards(*_height(faces, face, plane, *place.T))
        for curve, point in zip(live.tolist(), place, strict=True):
            paths[curve].append(point)
        inside = np.all(np.abs(place) < 1, axis=1)
        live, place = live[inside], place[inside]
        if not len(live):
            break
    return [np.array(path) for path in paths]


def _along(faces: Faces, face: Integers, plane: Integers, place: Floats) -> Floats:
    """The unit direction that keeps what is higher on its left."""
    slopes = _height(faces, face, plane, *place.T)[1]
    turned = np.stack([slopes[:, 1], -slopes[:, 0]], axis=-1)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def _towards(height: Floats, slopes: Floats) -> Floats:
    """A Newton step back to the level curve, straight across it; short where the face all but touches the plane."""
    steepness = np.maximum(np.sum(slopes * slopes, axis=-1), np.finfo(float).tiny)
    step = -slopes * (height / steepness)[..., np.newaxis]
    length = np.linalg.norm(step, axis=-1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, _LONGEST_STEP / np.maximum(length, _LONGEST_STEP)))


def _exits(rims: Rims, starts: Integers, paths: list[Floats], reach: float) -> Integers | None:
    """The crossing at which each path leaves; None if they are not one for one."""
    leaving = np.flatnonzero(~rims.entering)
    if len(leaving) != len(starts):
        return None
    places = rims.places
    alike: dict[tuple[int, int], list[int]] = {}
    for index in leaving.tolist():
        alike.setdefault((int(rims.face[index]), int(rims.plane[index])), []).append(index)
    ends = []
    for start, path in zip(starts.tolist(), paths, strict=True):
        candidates = alike.get((int(rims.face[start]), int(rims.plane[start])), [])
        if not candidates:
            return None
        distance = np.linalg.norm(places[candidates] - (path[-1] + path[-2]) / 2, axis=1)
        nearest = int(np.argmin(distance))
        if distance[nearest] > reach:
            return None
        ends.append(candidates.pop(nearest))
    return np.array(ends)


def _fitted_closely(
    faces: Faces, rims: Rims, starts: Integers, ends: Integers, ways: list[Floats], size: float
) -> Sections:
    """Each curve with as few control points as keep the one in the square and the one in space together."""
    face, plane = rims.face[starts], rims.plane[starts]
    none = np.zeros((0, 3))
    found = Sections(face, plane, starts, ends, [none] * len(face), [none] * len(face), np.full(len(face), np.inf))
    left = np.arange(len(face))
    for count in _STATIONS:
        if not len(left):
            break
        parameters, points, deviation = _fitted(faces, face[left], plane[left], [ways[k] for k in left.tolist()], count)
        for index, curve in enumerate(left.tolist()):
            found.parameters[curve], found.points[curve] = parameters[index], points[index]
        found.deviation[left] = deviation
        left = left[deviation > _CLOSE * size]
    worst = found.deviation.max(initial=0.0)
    if not worst <= _NEAR_ENOUGH * size:
        raise KernelError(f"a curve where the lattice crosses the box was fitted to {worst:.2g} mm only")
    return found


def _fitted(
    faces: Faces, face: Integers, plane: Integers, ways: list[Floats], count: int
) -> tuple[Floats, Floats, Floats]:
    """Control points in the square and in space, and how far the two curves are from each other."""
    even = np.linspace(0, 1, count + 1)
    stations = np.array([_spread(way, _run(way), even) for way in ways])
    points = _onto_level(faces, face, plane, stations)
    # Evenly spread in the square, then in space.
    stations = np.array([_spread(way, _run(some), even) for way, some in zip(stations, points, strict=True)])
    stations[:, [0, -1]] = [[way[0], way[-1]] for way in ways]
    points = _onto_level(faces, face, plane, stations)
    # Parameters by chord length: nearly even, and smooth however the stations are not quite so.
    t = np.array([_run(some) for some in points])
    through = basis(section_knots(count + 1), 3, t.ravel()).reshape(len(face), count + 1, count + 1)
    # A spline goes through stations only where each lies well within a function of its own (Schoenberg and Whitney).
    crowded = np.diagonal(through, axis1=1, axis2=2).min(axis=1) < _LEAST_OWN
    through[crowded] = np.eye(count + 1)
    control = np.linalg.solve(through, np.concatenate([stations, points], axis=-1))
    between = basis(section_knots(count + 1), 3, (even[1:] + even[:-1]) / 2) @ control
    astray = np.any(np.abs(between[..., :2]) > _WIDEST, axis=(1, 2))
    exact = faces.points(face, *np.clip(between[..., :2], -_WIDEST, _WIDEST).transpose(2, 0, 1))
    deviation = np.linalg.norm(exact - between[..., 2:], axis=-1).max(axis=1)
    return control[..., :2], control[..., 2:], np.where(crowded | astray, np.inf, deviation)


def _onto_level(faces: Faces, face: Integers, plane: Integers, stations: Floats) -> Floats:
    """Move stations between the ends onto the level curve, in place; their points in space."""
    for _ in range(_NEWTON_STEPS):
        step = _towards(*_height(faces, face, plane, stations[..., 0], stations[..., 1]))
        stations[:, 1:-1] += step[:, 1:-1]
        if np.max(np.abs(step[:, 1:-1])) < 1e-13:
            break
    points = faces.points(face, stations[..., 0], stations[..., 1])
    points[np.arange(len(face)), :, _AXES[plane]] = faces.levels[face, plane][:, np.newaxis]
    return points


def _run(points: Floats) -> Floats:
    """Length of the chords up to each point, in parts of all."""
    run = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.asarray(run / run[-1])


def _spread(way: Floats, run: Floats, t: Floats) -> Floats:
    """Places of a way in the square at parameters t, where its own points have parameters ``run``."""
    return np.stack([np.interp(t, run, way[:, axis]) for axis in (0, 1)], axis=-1)

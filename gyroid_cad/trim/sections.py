"""Curves in which the wall's faces cross planes, found in the parameter square and fitted there and in space.

A crossing is a level curve of one coordinate. Where it enters and leaves the square is found on the square's sides
alone, so that neighbours who share a side find the same places. From every entry the curve is followed to its exit;
stations evenly spread along it are then made exact by Newton's method and interpolated by one cubic spline for the
curve in the square and one for that in space, with the same parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.basis import basis
from gyroid_cad.nurbs.surface import grid_points
from gyroid_cad.trim.edge_crossings import AXES, EdgeCrossings, FacesToCut, plane_heights
from gyroid_cad.trim.section_splines import (
    BETWEEN,
    NEAR_ENOUGH,
    chord_lengths,
    close_enough,
    more_stations,
    on_section,
    section_knots,
    spread_along,
    through_stations,
)

__all__ = ["Sections", "level_step", "plane_sections"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# In the square, whose sides are 2 long; finer where a curve is not followed to an exit.
_STEPS = (0.1, 0.025)
_LONGEST = 8.0
# Samples along each side, to see that no curve closes within the square.
_GRID = 33
# Of stations, at first.
_FIRST = 16
_NEWTON_STEPS = 8
# A curve in the square that swings out so far is no fit.
_WIDEST = 1.1
# Of Newton's method in the square: near a saddle it would leap out of where the face is defined.
_LONGEST_STEP = 0.1


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
        return on_section(self.parameters[curve], t, derivative)

    def in_space(self, curve: int, t: Floats, derivative: int = 0) -> Floats:
        """Points in mm, or their rate of change; shape (q, 3)."""
        return on_section(self.points[curve], t, derivative)


def plane_sections(faces: FacesToCut, crossings: EdgeCrossings, size: float) -> Sections:
    """The curves between the crossings of the sides.

    Parameters
    ----------
    faces : FacesToCut
    crossings : EdgeCrossings
    size : float
        Of a cell in mm, by which closeness is measured.

    Raises
    ------
    KernelError
        If a curve cannot be followed from one side to another: then the face touches the plane. Or if one closes
        within the square, as only a graded wall wildly has them.
    """
    _require_open_curves(faces)
    starts = np.flatnonzero(crossings.entering)
    for step in _STEPS:
        paths = _followed(faces, crossings, starts, step)
        ends = _exits(crossings, starts, paths, 2 * step)
        if ends is not None:
            break
    else:
        raise KernelError("a face of the lattice touches the box: where they cross cannot be followed")
    ways = [np.vstack([path[:-1], crossings.places[end]]) for path, end in zip(paths, ends.tolist(), strict=True)]
    return _fitted_closely(faces, crossings, starts, ends, ways, size)


def _require_open_curves(faces: FacesToCut) -> None:
    """Wherever a face lies above a plane, or below, one can go on doing so to a side of the square."""
    face, plane = np.nonzero(~np.isnan(faces.levels))
    coordinates, along = faces.nets[face, ..., AXES[plane]][..., np.newaxis], np.linspace(-1, 1, _GRID)
    points = grid_points(coordinates, faces.weights, (faces.knots, faces.knots), along, along)[..., 0]
    above = points > faces.levels[face, plane][:, np.newaxis, np.newaxis]
    reached = np.ones_like(above)
    reached[:, 1:-1, 1:-1] = False
    along_u, along_v = above[:, 1:] == above[:, :-1], above[:, :, 1:] == above[:, :, :-1]
    count = 0
    while count < (count := int(np.count_nonzero(reached))):
        reached[:, 1:] |= reached[:, :-1] & along_u
        reached[:, :-1] |= reached[:, 1:] & along_u
        reached[:, :, 1:] |= reached[:, :, :-1] & along_v
        reached[:, :, :-1] |= reached[:, :, 1:] & along_v
    if count < above.size:
        raise KernelError("a face of the lattice bulges through a side of the box")


def _followed(faces: FacesToCut, crossings: EdgeCrossings, starts: Integers, step: float) -> list[Floats]:
    """Places along the curve from each start until it has left the square, the last one outside."""
    place = crossings.places[starts]
    paths = [[point] for point in place]
    live = np.arange(len(starts))
    for _ in range(int(_LONGEST / step)):
        face, plane = crossings.face[starts[live]], crossings.plane[starts[live]]
        onward = _along(faces, face, plane, place)
        place = place + step * _along(faces, face, plane, place + step / 2 * onward)
        for _ in range(2):
            place = place + _towards(*plane_heights(faces, face, plane, *place.T))
        for curve, point in zip(live.tolist(), place, strict=True):
            paths[curve].append(point)
        inside = np.all(np.abs(place) < 1, axis=1)
        live, place = live[inside], place[inside]
        if not len(live):
            break
    return [np.array(path) for path in paths]


def _along(faces: FacesToCut, face: Integers, plane: Integers, place: Floats) -> Floats:
    """The unit direction that keeps what is higher on its left."""
    slopes = plane_heights(faces, face, plane, *place.T)[1]
    turned = np.stack([slopes[:, 1], -slopes[:, 0]], axis=-1)
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))


def level_step(height: Floats, slopes: Floats) -> Floats:
    """One step of Newton's method from heights (...) with slopes (..., 2) straight across to their level curves."""
    steepness = np.maximum(np.sum(slopes * slopes, axis=-1), np.finfo(float).tiny)
    return np.asarray(-slopes * (height / steepness)[..., np.newaxis])


def _towards(height: Floats, slopes: Floats) -> Floats:
    """A Newton step back to the level curve, straight across it; short where the face all but touches the plane."""
    step = level_step(height, slopes)
    length = np.linalg.norm(step, axis=-1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, _LONGEST_STEP / np.maximum(length, _LONGEST_STEP)))


def _exits(crossings: EdgeCrossings, starts: Integers, paths: list[Floats], reach: float) -> Integers | None:
    """The crossing at which each path leaves; None if they are not one for one."""
    leaving = np.flatnonzero(~crossings.entering)
    if len(leaving) != len(starts):
        return None
    places = crossings.places
    alike: dict[tuple[int, int], list[int]] = {}
    for index in leaving.tolist():
        alike.setdefault((int(crossings.face[index]), int(crossings.plane[index])), []).append(index)
    ends = []
    for start, path in zip(starts.tolist(), paths, strict=True):
        candidates = alike.get((int(crossings.face[start]), int(crossings.plane[start])), [])
        if not candidates:
            return None
        distance = np.linalg.norm(places[candidates] - (path[-1] + path[-2]) / 2, axis=1)
        nearest = int(np.argmin(distance))
        if distance[nearest] > reach:
            return None
        ends.append(candidates.pop(nearest))
    return np.array(ends)


def _fitted_closely(
    faces: FacesToCut, crossings: EdgeCrossings, starts: Integers, ends: Integers, ways: list[Floats], size: float
) -> Sections:
    """Each curve with as few control points as keep the one in the square and the one in space together."""
    face, plane = crossings.face[starts], crossings.plane[starts]
    none = np.zeros((0, 3))
    found = Sections(face, plane, starts, ends, [none] * len(face), [none] * len(face), np.full(len(face), np.inf))
    counts = np.full(len(face), _FIRST)
    while np.any(counts):
        for count, some in grouped(counts):
            if not count:
                continue
            made = _fitted(faces, face[some], plane[some], [ways[k] for k in some.tolist()], count)
            for curve, parameters, points in zip(some.tolist(), *made[:2], strict=True):
                found.parameters[curve], found.points[curve] = parameters, points
            found.deviation[some] = made[2]
        counts = more_stations(counts, found.deviation / close_enough(size))
    worst = found.deviation.max(initial=0.0)
    if not worst <= NEAR_ENOUGH * size:
        raise KernelError(f"a curve where the lattice crosses the box was fitted to {worst:.2g} mm only")
    return found


def _fitted(
    faces: FacesToCut, face: Integers, plane: Integers, ways: list[Floats], count: int
) -> tuple[Floats, Floats, Floats]:
    """Control points in the square and in space, and how far the two curves are from each other."""
    even = np.linspace(0, 1, count + 1)
    stations = spread_along(ways, [chord_lengths(way) for way in ways], even)
    points = _onto_level(faces, face, plane, stations)
    # Evenly spread in the square, then in space.
    stations = spread_along(stations, chord_lengths(points), even)
    stations[:, [0, -1]] = [[way[0], way[-1]] for way in ways]
    points = _onto_level(faces, face, plane, stations)
    # Parameters by chord length: nearly even, and smooth however the stations are not quite so.
    control, crowded = through_stations(points, np.concatenate([stations, points], axis=-1))
    looked_at = (even[:-1, None] + even[1] * BETWEEN).ravel()
    between = basis(section_knots(count + 1), 3, looked_at) @ control
    astray = np.any(np.abs(between[..., :2]) > _WIDEST, axis=(1, 2))
    exact = faces.points(face, *np.clip(between[..., :2], -_WIDEST, _WIDEST).transpose(2, 0, 1))
    deviation = np.linalg.norm(exact - between[..., 2:], axis=-1).max(axis=1)
    return control[..., :2], control[..., 2:], np.where(crowded | astray, np.inf, deviation)


def _onto_level(faces: FacesToCut, face: Integers, plane: Integers, stations: Floats) -> Floats:
    """Move stations between the ends onto the level curve, in place; their points in space."""
    for _ in range(_NEWTON_STEPS):
        step = _towards(*plane_heights(faces, face, plane, stations[..., 0], stations[..., 1]))
        stations[:, 1:-1] += step[:, 1:-1]
        if np.max(np.abs(step[:, 1:-1])) < 1e-13:
            break
    points = faces.points(face, stations[..., 0], stations[..., 1])
    points[np.arange(len(face)), :, AXES[plane]] = faces.levels[face, plane][:, np.newaxis]
    return points

"""Followed curves as splines: in the parameters of both faces and in space, with one parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.basis import basis
from gyroid_cad.trim.lattice_faces import Pairs
from gyroid_cad.trim.paths import Paths
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
from gyroid_cad.trim.sections import level_step

__all__ = ["SectionCurve", "fitted_sections"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Short curves, by their length in the square, are tried with the fewest stations: receivers take close knots for tiny
# segments.
_FEWEST, _USUAL, _SHORT = 3, 8, 0.2
# Steps of Newton's method.
_NEWTON_STEPS = 12
# How short the last is in the square, and in parts of the ranges of the part's parameters, where its square is what is
# left: of stations to fit, and of those by which they are spread.
_CLOSELY, _ROUGHLY = (1e-11, 1e-6), (1e-4, 1e-2)
# How far from its stations a curve in the square may swing between them, in the length of all.
_WIDEST = 1.2
_AT_ONCE = 256
# How often a curve is parted that cannot be fitted, and of how many places each half then is.
_PARTINGS, _HALF = 4, 32


@dataclass(frozen=True, slots=True, eq=False)
class SectionCurve:
    """A curve in which a face of the wall crosses one of the part.

    Attributes
    ----------
    pair : int
    start, end : int
        Nodes; -1 if it closes.
    in_square, in_space, on_part : ndarray, shape (m, 2), (m, 3), (m, 2)
        Control points on the knots of :func:`~gyroid_cad.trim.section_splines.section_knots`.
    deviation : float
        Of the three from each other, in mm.
    """

    pair: int
    start: int
    end: int
    in_square: Floats
    in_space: Floats
    on_part: Floats
    deviation: float

    def square(self, t: Floats, derivative: int = 0) -> Floats:
        """Places in the square at parameters in [0, 1], or their rate of change; shape (q, 2)."""
        return on_section(self.in_square, t, derivative)

    def part(self, t: Floats, derivative: int = 0) -> Floats:
        """Parameters of the part's face, or their rate of change; shape (q, 2)."""
        return on_section(self.on_part, t, derivative)


def fitted_sections(
    pairs: Pairs, paths: Paths, cell_size: float, first: int
) -> tuple[list[SectionCurve], list[Floats]]:
    """Fit curves that were followed, each with as few control points as keep the splines together.

    One that is not close with the most control points is parted in two, a few times over: near the pole of a sphere a
    curve turns about it within a fraction of its length.

    Parameters
    ----------
    pairs : Pairs
    paths : Paths
    cell_size : float
        In mm, by which closeness is measured.
    first : int
        The number that the first new node gets.

    Returns
    -------
    sections : list of SectionCurve
    points : list of ndarray, shape (3,)
        Of new nodes.

    Raises
    ------
    KernelError
        If one is not close however often it is parted.
    """
    sections: list[SectionCurve] = []
    points: list[Floats] = []
    for parting in range(_PARTINGS + 1):
        control, deviation = _closely(pairs, paths, cell_size)
        far = ~(deviation <= NEAR_ENOUGH * cell_size)
        if np.any(far) and parting == _PARTINGS:
            worst = float(deviation.max())
            raise KernelError(f"a curve where the lattice crosses the part was fitted to {worst:.2g} mm only")
        for path in np.flatnonzero(~far).tolist():
            ends = int(paths.pair[path]), int(paths.start[path]), int(paths.end[path])
            some = control[path]
            sections.append(SectionCurve(*ends, some[:, :2], some[:, 2:5], some[:, 5:], float(deviation[path])))
        if not np.any(far):
            break
        paths, added = _parted(pairs, paths, np.flatnonzero(far), first + len(points))
        points += added
    return sections, points


def _closely(pairs: Pairs, paths: Paths, cell_size: float) -> tuple[list[Floats], Floats]:
    """Control points, in the square, in space and on the part's face, and how far the three are apart."""
    control: list[Floats] = [np.zeros((0, 7))] * len(paths.pair)
    deviation = np.full(len(paths.pair), np.inf)
    lengths = [np.linalg.norm(np.diff(places, axis=0), axis=1).sum() for places in paths.places]
    counts = np.where(np.array(lengths) < _SHORT, _FEWEST, _USUAL)
    while np.any(counts):
        for count, left in grouped(counts):
            if not count:
                continue
            for some in np.split(left, range(_AT_ONCE, len(left), _AT_ONCE)):
                made, deviation[some] = _fitted(pairs, paths, some, count)
                for index, path in enumerate(some.tolist()):
                    control[path] = made[index]
        counts = more_stations(counts, deviation / close_enough(cell_size))
    return control, deviation


def _parted(pairs: Pairs, paths: Paths, which: Integers, first: int) -> tuple[Paths, list[Floats]]:
    """Some of the curves in two, where they are halfway, between nodes with numbers of their own; and those points."""
    halves: list[tuple[int, int, int]] = []
    places: list[Floats] = []
    near: list[Floats] = []
    points: list[Floats] = []
    for path in which.tolist():
        pair, start, end = int(paths.pair[path]), int(paths.start[path]), int(paths.end[path])
        way = np.hstack([paths.places[path], paths.near[path]])
        even = spread_along([way], [chord_lengths(way[:, :2])], np.linspace(0, 1, 2 * _HALF + 1))
        found, even = _onto_curve(pairs, np.array([pair]), even, even[:, [0, -1]])
        node = first + len(points)
        points.append(found[0, _HALF])
        halves += [(pair, start, node), (pair, node, end)]
        for half in (slice(0, _HALF + 1), slice(_HALF, None)):
            places.append(even[0, half, :2])
            near.append(even[0, half, 2:])
    numbers = np.array(halves, dtype=np.int64)
    return Paths(numbers[:, 0], numbers[:, 1], numbers[:, 2], places, near), points


def _fitted(pairs: Pairs, paths: Paths, which: Integers, count: int) -> tuple[Floats, Floats]:
    """Control points, in the square, in space and on the part's face, and how far the three are apart."""
    even = np.linspace(0, 1, count + 1)
    pair = paths.pair[which]
    ways = [np.hstack([paths.places[k], paths.near[k]]) for k in which.tolist()]
    ends = np.array([[way[0], way[-1]] for way in ways])
    stations = spread_along(ways, [chord_lengths(way[:, :2]) for way in ways], even)
    points, stations = _onto_curve(pairs, pair, stations, ends, _ROUGHLY)
    stations = spread_along(stations, chord_lengths(points), even)
    points, stations = _onto_curve(pairs, pair, stations, ends)
    values = np.concatenate([stations[..., :2], points, stations[..., 2:]], axis=-1)
    control, crowded = through_stations(points, values)
    looked_at = (even[:-1, None] + even[1] * BETWEEN).ravel()
    between = basis(section_knots(count + 1), 3, looked_at) @ control
    astray = np.any(np.abs(between[..., :2]) > _WIDEST, axis=(1, 2))
    u, v = np.clip(between[..., :2], -_WIDEST, _WIDEST).transpose(2, 0, 1)
    exact = pairs.faces.derivatives(pairs.face[pair], u, v, 0)[0]
    deviation = np.linalg.norm(exact - between[..., 2:5], axis=-1).max(axis=1)
    on_part = pairs.boundary.points(pairs.part[pair], between[..., 5:])
    deviation = np.maximum(deviation, np.linalg.norm(on_part - between[..., 2:5], axis=-1).max(axis=1))
    return control, np.where(crowded | astray | ~np.isfinite(deviation), np.inf, deviation)


def _onto_curve(
    pairs: Pairs, pair: Integers, stations: Floats, ends: Floats, closely: tuple[float, float] = _CLOSELY
) -> tuple[Floats, Floats]:
    """Points of stations moved onto the curve, and those stations; the first and last are what they are."""
    converged, astray = closely
    stations = stations.copy()
    stations[:, [0, -1]] = ends
    points = np.zeros((*stations.shape[:2], 3))
    ranges = pairs.boundary.spans[pairs.part[pair]]
    left = np.arange(len(pair))
    for _ in range(_NEWTON_STEPS):
        some = stations[left]
        heights, slopes, near, points[left] = pairs.heights(pair[left], some[..., 0], some[..., 1], some[..., 2:], True)
        step = level_step(heights, slopes)
        step[:, [0, -1]] = 0
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        aside = np.abs(near - some[..., 2:]) / ranges[left, None]
        moving = (length.max(axis=(1, 2)) >= converged) | (aside.max(axis=(1, 2)) >= astray)
        some[moving, :, :2] += (step * np.minimum(1.0, 0.1 / np.maximum(length, 0.1)))[moving]
        some[..., 2:] = near
        stations[left] = some
        left = left[moving]
        if not len(left):
            break
    return points, stations

"""Free-form surfaces of a part, and profiles turned or moved: signed distances by Newton's method.

The nearest place is looked for from the nearest of many samples; what lies off the border is measured from the surface
that goes on there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.nurbs.roots import foot_step

__all__ = ["FreeForm", "Swept"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Newton's method to the nearest place, in parts of the parameters' ranges.
# Of a step so short the next one, which is its square, is rounding; of one by Gauss's and Newton's method it is not.
_STEPS, _SQUARED, _CONVERGED, _LONGEST_STEP = 12, 1e-6, 1e-8, 0.05
# How far past its border a surface is followed.
_BEYOND = 0.02
# How many samples it has, and how many along a side at least and at most.
_SAMPLES, _FEWEST, _MOST = 2**14, 33, 1025
# So many samples on, the curvature that a distance allows for is looked for.
_RINGS = 3
# How far a squared distance must bend upwards at least for a whole step, in parts of the squared rate.
_BENT = 1e-2
# Of a curve's extent: so far aside of a plane it still lies in it.
_IN_PLANE = 1e-9


@dataclass(frozen=True, eq=False)
class FreeForm:
    """Any other surface, by its derivatives.

    Attributes
    ----------
    derivatives : callable
        From parameters s and t, shape (n, 2), and an order of 0, 1 or 2, to points and derivatives by s, t, ss, st and
        tt as far as that order, each of shape (n, 3).
    low, high : ndarray, shape (2,)
        Of the parameters.
    breaks : tuple of ndarray
        Values of s and of t where its polynomials end.
    """

    derivatives: Callable[[Floats, int], tuple[Floats, ...]]
    low: Floats
    high: Floats
    breaks: tuple[Floats, Floats] = (np.zeros(0), np.zeros(0))

    def distances(self, points: Floats, near: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`."""
        places = np.array(self.nearest_samples(points) if near is None else near, dtype=float)
        reach = self.high - self.low
        low, high = self.low - _BEYOND * reach, self.high + _BEYOND * reach
        left = np.arange(len(points))
        for _ in range(_STEPS):
            found = self.derivatives(places[left], 2)
            step, bent = _nearer(points[left] - found[0], found)
            step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(np.abs(step / reach).max(axis=1), _LONGEST_STEP))[
                :, None
            ]
            moved = np.clip(places[left] + step, low, high)
            change = np.abs((moved - places[left]) / reach).max(axis=1)
            places[left] = moved
            left = left[change > np.where(bent, _SQUARED, _CONVERGED)]
            if not len(left):
                break
        x, ds, dt = self.derivatives(places, 1)
        normals = unit(np.cross(ds, dt))
        return dot(points - x, normals), normals, places

    def tangent_distances(self, points: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`."""
        x, ds, dt = self.derivatives(near, 1)
        normals = unit(np.cross(ds, dt))
        beyond = _BEYOND * (self.high - self.low)
        places = np.clip(near + _along_tangents(points - x, ds, dt), self.low - beyond, self.high + beyond)
        return dot(points - x, normals), normals, places

    def nearest_samples(self, points: Floats) -> Floats:
        """Parameters of the sample that is nearest to each point; shape (n, 2)."""
        return np.asarray(self._samples.places[self._tree.query(points)[1]])

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """As of :class:`PartSurface`: from the tangent plane at the nearest sample."""
        samples = self._samples
        distance, nearest = (np.asarray(some) for some in self._tree.query(points))
        # Samples round the nearest one tell how much the surface bends there, as far as they reach.
        bend = np.where(distance <= samples.reach[nearest], samples.bend[nearest], samples.largest_bend)
        found: Floats = np.asarray(dot(points - samples.points[nearest], samples.normals[nearest]))
        error: Floats = np.asarray(bend * distance**2 + 1e-12)
        # No place of the surface is further from a sample than they are apart: what is far from all is far from it.
        far = distance > 2 * samples.cover
        error[far] = 0.0
        found[far] = np.copysign(np.maximum(np.abs(found[far]), distance[far] - samples.cover), found[far])
        return found, error

    def points(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        return self.derivatives(places, 0)[0]

    def area_vectors(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        _, ds, dt = self.derivatives(places, 1)
        return np.cross(ds, dt)

    @cached_property
    def _samples(self) -> _Samples:
        """Samples on a grid, about as far apart one way as the other."""
        along = [np.linspace(low, high, _FEWEST) for low, high in zip(self.low, self.high, strict=True)]
        grid = self.points(np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2))
        grid = grid.reshape(_FEWEST, _FEWEST, 3)
        long, wide = (np.linalg.norm(np.diff(grid, axis=axis), axis=-1).sum(axis=axis).max() for axis in (0, 1))
        count = np.sqrt(_SAMPLES * max(long, _MOST * np.finfo(float).tiny) / max(wide, np.finfo(float).tiny))
        count = int(np.clip(count, max(_FEWEST, _SAMPLES // _MOST), min(_MOST, _SAMPLES // _FEWEST)))
        counts = count, max(_FEWEST, _SAMPLES // count)
        along = [np.linspace(low, high, some) for low, high, some in zip(self.low, self.high, counts, strict=True)]
        places = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
        return _sampled(places, self.derivatives(places, 2), counts)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._samples.points)


@dataclass(frozen=True, slots=True, eq=False)
class _Samples:
    """Places of a surface, shape (n, 2), their points and normals (n, 3), and how it bends round each.

    ``bend`` is half the largest curvature as far as ``reach``, shape (n,), and ``largest_bend`` that of all; no place
    is further than ``cover`` from the nearest sample.
    """

    places: Floats
    points: Floats
    normals: Floats
    bend: Floats
    reach: Floats
    largest_bend: float
    cover: float


def _sampled(places: Floats, found: tuple[Floats, ...], counts: tuple[int, int]) -> _Samples:
    x, ds, dt, dss, dst, dtt = found
    with np.errstate(divide="ignore", invalid="ignore"):
        normals = unit(np.cross(ds, dt))
        bends = [
            np.abs(dot(second, normals)) / squared
            for second, squared in (
                (dss, dot(ds, ds)),
                (dtt, dot(dt, dt)),
                (dst, np.sqrt(dot(ds, ds) * dot(dt, dt))),
            )
        ]
    bend = np.max([np.where(np.isfinite(some), some, 0.0) for some in bends], axis=0).reshape(counts)
    grid = x.reshape(*counts, 3)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1) for axis in (0, 1)]
    shortest = np.minimum(
        np.pad(np.minimum(steps[0][:-1], steps[0][1:]), ((1, 1), (0, 0)), mode="edge"),
        np.pad(np.minimum(steps[1][:, :-1], steps[1][:, 1:]), ((0, 0), (1, 1)), mode="edge"),
    )
    # A foot is at most twice as far from the nearest sample as the point is.
    reach = _RINGS / 2 * minimum_filter(shortest, 2 * _RINGS + 1, mode="nearest")
    local = maximum_filter(bend, 2 * _RINGS + 1, mode="nearest")
    sound = np.isfinite(normals).all(axis=1)
    kept = [np.asarray(some[sound]) for some in (places, x, normals, local.ravel(), reach.ravel())]
    cover = float(np.hypot(*(some.max() for some in steps)))
    return _Samples(kept[0], kept[1], kept[2], kept[3], kept[4], float(bend.max()), cover)


@dataclass(frozen=True, eq=False)
class Swept:
    """A curve turned about an axis in whose plane it lies, or moved along a direction.

    Attributes
    ----------
    free : FreeForm
        The same surface, by its derivatives.
    origin : ndarray, shape (3,)
        On the axis.
    axis : ndarray, shape (3,)
        Unit vector along the axis, or of the direction.
    curve : callable
        From parameters (n,) to points and two derivatives.
    turned : bool
    """

    free: FreeForm
    origin: Floats
    axis: Floats
    curve: Callable[[Floats], tuple[Floats, ...]]
    turned: bool

    @property
    def planar(self) -> bool:
        """True if the axis lies in the curve's plane, and the curve on one side of it."""
        points = self.curve(np.linspace(self.free.low[1], self.free.high[1], 33))[0] - self.origin
        x, y = self._across
        size = np.ptp(points, axis=0).max()
        return bool(np.abs(points @ y).max() < _IN_PLANE * size and np.min(points @ x) > -_IN_PLANE * size)

    def distances(self, points: Floats, near: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`: of the curve's own plane only one parameter is looked for."""
        along = int(self.turned)
        if near is None:
            near = self.free.nearest_samples(points)
        flat, frame, angle = self._flattened(points)
        place = np.array(near[:, along], dtype=float)
        low, high = (
            bound[along] + sign * _BEYOND * (self.free.high - self.free.low)[along]
            for bound, sign in ((self.free.low, -1), (self.free.high, 1))
        )
        left, reach = np.arange(len(points)), high - low
        for _ in range(_STEPS):
            at, rate, bend = self._profile(place[left])
            apart = flat[left] - at
            slope, curved = dot(apart, rate), dot(rate, rate)
            whole = curved - dot(apart, bend)
            step = slope / np.where(whole > _BENT * curved, whole, curved)
            moved = np.clip(place[left] + np.clip(step, -_LONGEST_STEP * reach, _LONGEST_STEP * reach), low, high)
            change = np.abs(moved - place[left]) / reach
            place[left] = moved
            left = left[change > np.where(whole > _BENT * curved, _SQUARED, _CONVERGED)]
            if not len(left):
                break
        at, rate, _ = self._profile(place)
        across = unit(np.stack([rate[:, 1], -rate[:, 0]], axis=-1))
        distance = dot(flat - at, across)
        normals = across[:, :1] * frame[0] + across[:, 1:] * frame[1]
        if self.turned:
            return distance, normals, np.stack([angle, place], axis=-1)
        height = (points - self.curve(place)[0]) @ self.axis
        return distance, normals, np.stack([place, height], axis=-1)

    def tangent_distances(self, points: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`."""
        return self.free.tangent_distances(points, near)

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """As of :class:`PartSurface`."""
        return self.free.roughly(points)

    def points(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        return self.free.points(places)

    def area_vectors(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        return self.free.area_vectors(places)

    def _flattened(self, points: Floats) -> tuple[Floats, tuple[Floats, Floats], Floats]:
        """Points in the plane of the profile, its two directions in space at each, and angles about the axis."""
        own = points - self.origin
        if not self.turned:
            x, y = self._across
            return own @ np.stack([x, y], axis=-1), (x, y), np.zeros(len(own))
        height = own @ self.axis
        out = own - height[:, np.newaxis] * self.axis
        x, y = self._across
        angle = np.arctan2(out @ y, out @ x)
        along = np.linalg.norm(out, axis=1)
        radial = np.cos(angle)[:, np.newaxis] * x + np.sin(angle)[:, np.newaxis] * y
        return np.stack([along, height], axis=-1), (radial, np.broadcast_to(self.axis, own.shape)), angle

    def _profile(self, t: Floats) -> tuple[Floats, ...]:
        """The curve in that plane, and its derivatives."""
        point, *rates = self.curve(t)
        x, y = self._across
        plane = np.stack([x, self.axis if self.turned else y], axis=-1)
        return (point - self.origin) @ plane, *(rate @ plane for rate in rates)

    @cached_property
    def _across(self) -> tuple[Floats, Floats]:
        """Directions across the axis: of a turned curve the first lies in its own plane."""
        if self.turned:
            middle = self.curve(np.linspace(self.free.low[1], self.free.high[1], 5))[0] - self.origin
            out = middle - (middle @ self.axis)[:, np.newaxis] * self.axis
            x = unit(out[np.argmax(np.linalg.norm(out, axis=1))][np.newaxis])[0]
        else:
            x = unit(np.cross(self.axis, np.eye(3)[np.argmin(np.abs(self.axis))])[np.newaxis])[0]
        return x, np.cross(self.axis, x)


def _nearer(apart: Floats, found: tuple[Floats, ...]) -> tuple[Floats, Booleans]:
    """Steps to the nearest place, and a mask: of Newton's method, or past a centre of curvature Gauss and Newton's."""
    ds, dt, *bends = found[1:]
    du, dv, sound = foot_step(apart, ds, dt, *bends)
    plain = _along_tangents(apart, ds, dt)
    return np.where(sound[:, np.newaxis], np.stack([du, dv], axis=-1), plain), sound


def _along_tangents(apart: Floats, ds: Floats, dt: Floats) -> Floats:
    """Steps of the parameters to the foot of the perpendicular on the tangent plane."""
    a, b, c = dot(ds, ds), dot(ds, dt), dot(dt, dt)
    determinant = np.maximum(a * c - b * b, np.finfo(float).tiny)
    along_s, along_t = dot(apart, ds), dot(apart, dt)
    return np.stack([(c * along_s - b * along_t) / determinant, (a * along_t - b * along_s) / determinant], axis=-1)

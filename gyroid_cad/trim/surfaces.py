"""Surfaces of a part as functions of place: the signed distance from each, in closed form where it has one.

Plane, cylinder, cone, sphere and torus are known at once. Of any other surface the nearest place is found by Newton's
method from the nearest of many samples; what lies off its border is measured from the surface that goes on there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.nurbs.roots import foot_step

__all__ = ["FreeForm", "PartSurface", "Quadric", "QuadricKind", "Swept"]

Floats = NDArray[np.float64]
QuadricKind = Literal["plane", "cylinder", "cone", "sphere", "torus"]

# Newton's method to the nearest place, in parts of the parameters' ranges.
# Of a step so short the next one, which is its square, is rounding.
_STEPS, _CONVERGED, _LONGEST_STEP = 12, 1e-8, 0.05
# How far past its border a surface is followed, and how many samples it has along each side.
_BEYOND, _SAMPLES = 0.02, 65
# How far a squared distance must bend upwards at least for a whole step, in parts of the squared rate.
_BENT = 1e-2
# Of a curve's extent: so far aside of a plane it still lies in it.
_IN_PLANE = 1e-9


class PartSurface(Protocol):
    """A surface with parameters s and t, and what is known of any place near it."""

    def distances(self, points: Floats, near: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """Signed distances (n,) in mm, their gradients (n, 3), and the parameters (n, 2) of the nearest places.

        Parameters
        ----------
        points : ndarray, shape (n, 3)
            In mm.
        near : ndarray, shape (n, 2), optional
            Parameters close to those looked for.
        """
        ...

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (n,), and how far off at most each is where it is near zero, in mm."""
        ...

    def points(self, places: Floats) -> Floats:
        """Points (n, 3) at parameters (n, 2)."""
        ...

    def area_vectors(self, places: Floats) -> Floats:
        """Cross products of the derivatives by s and t, (n, 3), at parameters (n, 2)."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Quadric:
    """A plane, cylinder, cone, sphere or torus, with the parameters that the kernel gives it.

    Attributes
    ----------
    kind : str
    origin : ndarray, shape (3,)
    axes : ndarray, shape (3, 3)
        Its directions x, y and z, in the rows.
    radius, second : float
        Of a torus the larger and the smaller one; of a cone the radius at the origin, and half the angle, in radians.
    crossed : bool
        Whether it is looked at where its profile has crossed the axis: past a cone's apex, or the inner sheet of a
        torus whose smaller radius is the larger one.
    """

    kind: QuadricKind
    origin: Floats
    axes: Floats
    radius: float = 0.0
    second: float = 0.0
    crossed: bool = False

    def distances(self, points: Floats, near: Floats | None = None) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`."""
        own = (points - self.origin) @ self.axes.T
        x, y, z = own.T
        if self.kind == "plane":
            return self._handed * z, np.broadcast_to(self._handed * self.axes[2], own.shape), own[:, :2]
        # Past the axis a meridian is that of the opposite angle, at a negative distance.
        side = -1.0 if self.crossed else 1.0
        along = side * np.hypot(x, y)
        safe = np.where(along, along, side * np.finfo(float).tiny)
        radial = np.stack([x / safe, y / safe, np.zeros_like(x)], axis=-1)
        upwards = np.array([0.0, 0.0, 1.0])
        angle = np.arctan2(side * y, side * x)
        if self.kind == "cylinder":
            found, gradient, height = along - self.radius, radial, z
        elif self.kind == "cone":
            sine, cosine = np.sin(self.second), np.cos(self.second)
            found = (along - self.radius) * cosine - z * sine
            gradient, height = cosine * radial - sine * upwards, (along - self.radius) * sine + z * cosine
        elif self.kind == "sphere":
            found, gradient, height = np.hypot(along, z) - self.radius, unit(own), np.arctan2(z, along)
        else:
            out = along - self.radius
            found, height = np.hypot(out, z) - self.second, np.arctan2(z, out)
            gradient = unit(out[:, np.newaxis] * radial + z[:, np.newaxis] * upwards)
        sign = side * self._handed
        return sign * found, sign * gradient @ self.axes, np.stack([angle, height], axis=-1)

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """As of :class:`PartSurface`: exact."""
        found = self.distances(points)[0]
        return found, np.zeros(len(found))

    def points(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        s, t = places.T
        if self.kind == "plane":
            own = np.stack([s, t, np.zeros_like(s)], axis=-1)
        else:
            along, z = self._profile(t)
            own = np.stack([along * np.cos(s), along * np.sin(s), z], axis=-1)
        return np.asarray(self.origin + own @ self.axes)

    def area_vectors(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        s, t = places.T
        cosine, sine, one = np.cos(s), np.sin(s), np.ones_like(s)
        if self.kind == "plane":
            own = np.stack([0 * one, 0 * one, one], axis=-1)
        elif self.kind == "cylinder":
            own = self.radius * np.stack([cosine, sine, 0 * one], axis=-1)
        elif self.kind == "cone":
            flat, steep = np.cos(self.second), np.sin(self.second)
            along = (self.radius + t * steep)[:, np.newaxis]
            own = along * np.stack([flat * cosine, flat * sine, -steep * one], axis=-1)
        else:
            minor = self.radius if self.kind == "sphere" else self.second
            outwards = np.stack([np.cos(t) * cosine, np.cos(t) * sine, np.sin(t)], axis=-1)
            own = minor * self._profile(t)[0][:, np.newaxis] * outwards
        return np.asarray(self._handed * own @ self.axes)

    def crosses_at(self, place: Floats) -> bool:
        """Tell whether the profile has crossed the axis at parameters, shape (2,)."""
        return self.kind != "plane" and float(self._profile(place[1:])[0][0]) < 0

    @property
    def _handed(self) -> float:
        """-1 if the axes are left-handed: then the normal of the parameters points inwards."""
        return 1.0 if np.linalg.det(self.axes) > 0 else -1.0

    def _profile(self, t: Floats) -> tuple[Floats, Floats]:
        """Distance from the axis, negative where the meridian has crossed it, and along it."""
        if self.kind == "cylinder":
            return np.full_like(t, self.radius), t
        if self.kind == "cone":
            return self.radius + t * np.sin(self.second), t * np.cos(self.second)
        if self.kind == "sphere":
            return self.radius * np.cos(t), self.radius * np.sin(t)
        return self.radius + self.second * np.cos(t), self.second * np.sin(t)


@dataclass(frozen=True, eq=False)
class FreeForm:
    """Any other surface, by its derivatives.

    Attributes
    ----------
    derivatives : callable
        From parameters s, t, shape (n,), to points and derivatives by s, t, ss, st and tt, each of shape (n, 3).
    low, high : ndarray, shape (2,)
        Of the parameters.
    breaks : tuple of ndarray
        Values of s and of t where its polynomials end.
    """

    derivatives: Callable[[Floats, Floats], tuple[Floats, ...]]
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
            found = self.derivatives(*places[left].T)
            step = _nearer(points[left] - found[0], found)
            step *= np.minimum(1.0, _LONGEST_STEP / np.maximum(np.abs(step / reach).max(axis=1), _LONGEST_STEP))[
                :, None
            ]
            moved = np.clip(places[left] + step, low, high)
            change = np.abs((moved - places[left]) / reach).max(axis=1)
            places[left] = moved
            left = left[change > _CONVERGED]
            if not len(left):
                break
        x, ds, dt, *_ = self.derivatives(*places.T)
        normals = unit(np.cross(ds, dt))
        return dot(points - x, normals), normals, places

    def nearest_samples(self, points: Floats) -> Floats:
        """Parameters of the sample that is nearest to each point; shape (n, 2)."""
        return np.asarray(self._samples[0][self._tree.query(points)[1]])

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """As of :class:`PartSurface`: from the tangent plane at the nearest sample."""
        distance, nearest = self._tree.query(points)
        _, at, normals, bend = self._samples
        return dot(points - at[nearest], normals[nearest]), np.asarray(bend * distance**2 + 1e-12)

    def points(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        return self.derivatives(*places.T)[0]

    def area_vectors(self, places: Floats) -> Floats:
        """As of :class:`PartSurface`."""
        _, ds, dt, *_ = self.derivatives(*places.T)
        return np.cross(ds, dt)

    @cached_property
    def _samples(self) -> tuple[Floats, Floats, Floats, float]:
        """Parameters, points and normals of a grid, and half the largest curvature there."""
        along = [np.linspace(low, high, _SAMPLES) for low, high in zip(self.low, self.high, strict=True)]
        places = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 2)
        x, ds, dt, dss, dst, dtt = self.derivatives(*places.T)
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
        sound = np.isfinite(normals).all(axis=1)
        bend = float(np.max([np.max(some[np.isfinite(some)], initial=0.0) for some in bends]))
        return places[sound], x[sound], normals[sound], bend

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._samples[1])


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
            left = left[change > _CONVERGED]
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


def _nearer(apart: Floats, found: tuple[Floats, ...]) -> Floats:
    """A step of Newton's method to the nearest place; of Gauss's and Newton's past the centre of curvature."""
    ds, dt, *bends = found[1:]
    du, dv, sound = foot_step(apart, ds, dt, *bends)
    a, b, c = dot(ds, ds), dot(ds, dt), dot(dt, dt)
    determinant = np.maximum(a * c - b * b, np.finfo(float).tiny)
    along_s, along_t = dot(apart, ds), dot(apart, dt)
    plain = np.stack([(c * along_s - b * along_t) / determinant, (a * along_t - b * along_s) / determinant], axis=-1)
    return np.where(sound[:, np.newaxis], np.stack([du, dv], axis=-1), plain)

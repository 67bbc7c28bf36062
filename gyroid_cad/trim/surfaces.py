"""Surfaces of a part as functions of place: the signed distance from each, in closed form where it has one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import unit

__all__ = ["PartSurface", "Quadric", "QuadricKind"]

Floats = NDArray[np.float64]
QuadricKind = Literal["plane", "cylinder", "cone", "sphere", "torus"]


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

    def tangent_distances(self, points: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
        """As of ``distances``, from the tangent planes at parameters near those looked for, and the next ones.

        That is a step of Newton's method where both sides of a crossing are moved at once.
        """
        ...

    def roughly(self, points: Floats) -> tuple[Floats, Floats]:
        """Signed distances (n,), and how far off at most each is where it is near zero, in mm.

        Of a point far from the surface only the sign, and a distance that it is at least from it.
        """
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
            return self.handed * z, np.broadcast_to(self.handed * self.axes[2], own.shape), own[:, :2]
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
        sign = side * self.handed
        return sign * found, sign * gradient @ self.axes, np.stack([angle, height], axis=-1)

    def tangent_distances(self, points: Floats, near: Floats) -> tuple[Floats, Floats, Floats]:
        """As of :class:`PartSurface`: the distances themselves, which cost no more."""
        return self.distances(points, near)

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
        return np.asarray(self.handed * own @ self.axes)

    def radii(self, places: Floats) -> Floats:
        """Smaller radii of curvature (n,) at parameters (n, 2), in mm; infinite in a plane.

        >>> torus = Quadric("torus", np.zeros(3), np.eye(3), 5.0, 1.0)
        >>> torus.radii(np.array([[0.0, 0.0], [2.0, np.pi]])).round(9).tolist()
        [1.0, 1.0]
        """
        if self.kind == "plane":
            return np.full(len(places), np.inf)
        along = np.abs(self._profile(places[:, 1])[0])
        if self.kind == "cone":
            return np.asarray(along / np.cos(self.second))
        if self.kind != "torus":
            return np.full(len(places), self.radius)
        # Of a parallel, as it bends along the normal.
        steep = np.maximum(np.abs(np.cos(places[:, 1])), np.finfo(float).tiny)
        return np.minimum(self.second, along / steep)

    def crosses_at(self, place: Floats) -> bool:
        """Tell whether the profile has crossed the axis at parameters, shape (2,)."""
        return self.kind != "plane" and float(self._profile(place[1:])[0][0]) < 0

    @property
    def handed(self) -> float:
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

"""Distances between points and a wall: nearest samples, feet of perpendiculars, and lines that meet the faces.

Three grades of the same question: :func:`nearest_offsets` takes the nearest sample for the foot, :class:`WallFaces`
goes on from samples by one step, :func:`distances_from_patches` goes on to rounding; so does :func:`in_wall`, to
tell inside from outside.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.nurbs.roots import foot_step, nearest_places
from gyroid_cad.nurbs.surface import grid_derivatives, grid_points, point_derivatives
from gyroid_cad.wall.grading import WallPoints
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = [
    "Feet",
    "WallFaces",
    "distances_from_patches",
    "in_wall",
    "met_along_normals",
    "nearest_offsets",
    "nearest_patches",
    "tree_of",
    "wall_faces",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Samples of all faces together, which take 250 bytes each.
_MOST_SAMPLES = 800_000
_FEWEST_STEPS, _MOST_STEPS = 6, 48
# Along a patch's side, of the faces alone; and how many patches at a time.
_PATCH_SAMPLES, _PATCHES_AT_ONCE = 9, 4_000
# Samples of a face from which its nearest place is looked for.
_STARTS = 6
# So many queries and neighbours at a time that what is computed for them stays small.
_PAIRS_AT_ONCE = 200_000
# Samples from whose patches places in the wall are looked for, steps of Newton's method, how far out they may come, and
# how near a side a place is on it, in the patches' parameters.
_NEIGHBOURS, _LAYER_STEPS, _OUTSIDE, _ON_SIDE = 12, 12, 1.5, 1e-9
_BEFORE = np.tri(_NEIGHBOURS, k=-1, dtype=bool)
# In steps between samples: the foot belongs to the nearest sample along each side, and a little is overlap.
_OWN_FOOT = 0.6
# A place lies in the wall only if it stands over its foot: beyond a boundary edge the foot is aside.
_UPRIGHT = 0.9


@dataclass(frozen=True, slots=True, eq=False)
class Feet:
    """The nearest places of the faces, for each of some points and of the nearest samples to it.

    Attributes
    ----------
    away : ndarray, shape (points, neighbours, 3)
        From the foot to the point, in mm.
    distance : ndarray, shape (points, neighbours)
        In mm.
    outside : ndarray of bool, shape (points, neighbours)
        Whether the point is not behind the foot's face, in the wall.
    side : ndarray of int, shape (points, neighbours)
        Which face the foot is on, 0 or 1.
    found : ndarray of bool, shape (points, neighbours)
        Whether there is a foot next to the sample; else the sample itself stands for it.
    """

    away: Floats
    distance: Floats
    outside: Booleans
    side: Integers
    found: Booleans

    def nearest(self) -> tuple[Floats, Booleans, Integers]:
        """Distance, whether outside the wall, and face of the nearest foot of each point."""
        rows, best = np.arange(len(self.distance)), np.argmin(self.distance, axis=1)
        return self.distance[rows, best], self.outside[rows, best], self.side[rows, best]


@dataclass(frozen=True, slots=True, eq=False)
class WallFaces:
    """Samples of the faces of a wall, with the first and second derivatives there.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        In mm.
    derivatives : ndarray, shape (5, n, 3)
        By u, v, uu, uv and vv.
    outwards : ndarray, shape (n, 3)
        Unit normals out of the wall.
    side : ndarray of int, shape (n,)
        Which face, 0 or 1.
    step : float
        Between samples, in parameters.
    period : float, optional
        In mm, along x, y and z alike, if the wall goes on endlessly.
    tree : scipy.spatial.cKDTree
        Of the points.
    """

    points: Floats
    derivatives: Floats
    outwards: Floats
    side: Integers
    step: float
    period: float | None
    tree: Any

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def feet(self, places: Floats, neighbours: int) -> Feet:
        """Feet on the faces of perpendiculars from places, one near each of the nearest samples.

        From the sample one step of :func:`~gyroid_cad.nurbs.roots.foot_step`, with the surface taken as its quadratic
        there: so the distance is true to the third order of the samples' spacing.

        Parameters
        ----------
        places : ndarray, shape (m, 3)
            In mm.
        neighbours : int
            How many samples near each to start from.
        """
        size = max(1, _PAIRS_AT_ONCE // neighbours)
        parts = [self._feet(places[first : first + size], neighbours) for first in range(0, len(places), size)]
        away, distance, outside, side, found = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Feet(away, distance, outside, side, found)

    def _feet(self, places: Floats, neighbours: int) -> tuple[Floats, Floats, Booleans, Integers, Booleans]:
        wrapped = places if self.period is None else np.mod(places, self.period)
        nearest = np.asarray(self.tree.query(wrapped, k=list(range(1, neighbours + 1)))[1])
        apart = wrapped[:, np.newaxis] - self.points[nearest]
        if self.period is not None:
            apart -= self.period * np.round(apart / self.period)
        du, dv, duu, duv, dvv = self.derivatives[:, nearest]
        # Past the centre of curvature there is no foot nearby: the sample itself stands for it.
        u, v, sound = foot_step(apart, du, dv, duu, duv, dvv)
        # A foot further away is that of another sample, and known better from there.
        sound &= np.maximum(np.abs(u), np.abs(v)) <= _OWN_FOOT * self.step
        u, v = (np.where(sound, along, 0.0)[..., np.newaxis] for along in (u, v))
        away = apart - (du * u + dv * v + duu * (u * u / 2) + duv * (u * v) + dvv * (v * v / 2))
        normal = self.outwards[nearest]
        distance = np.linalg.norm(away, axis=-1)
        inside = dot(away, normal) < -_UPRIGHT * distance
        return away, distance, ~inside, self.side[nearest], sound


def wall_faces(wall: Wall, period: float | None) -> WallFaces:
    """Samples of a wall's faces, evenly spaced on every patch.

    Parameters
    ----------
    wall : Wall
    period : float, optional
        Of an endless wall, in mm: then of patches that are alike one is sampled.
    """
    patches = np.arange(wall.complex.patch_count)
    if period is not None:
        patches = np.unique(wall.patch_net, return_index=True)[1]
    affordable = int(np.sqrt(_MOST_SAMPLES / (len(SIDES) * len(patches))))
    steps = int(np.clip(affordable - 1, _FEWEST_STEPS, _MOST_STEPS))
    nets, along = wall.nets[wall.patch_net[patches]], np.linspace(-1, 1, steps + 1)
    values = np.stack(grid_derivatives(nets, wall.weights, (wall.knots, wall.knots), along, along, 2))
    values = values.reshape(6, len(patches), 2, -1, 3)
    shape = values.shape[1:-1]
    points = values[0] + wall.shifts[wall.patch_shift[patches]][:, np.newaxis, np.newaxis]
    side = np.broadcast_to(np.arange(2)[np.newaxis, :, np.newaxis], shape).ravel()
    normals = np.cross(values[1], values[2]).reshape(-1, 3)
    normals *= (np.where(side == 1, 1.0, -1.0) / np.linalg.norm(normals, axis=1))[:, np.newaxis]
    points = points.reshape(-1, 3)
    if period is not None:
        points = within_period(points, period)
    derivatives = values[1:].reshape(5, -1, 3)
    return WallFaces(points, derivatives, normals, side, 2 / steps, period, tree_of(points, period))


def tree_of(points: Floats, period: float | None = None) -> Any:
    """A tree in which to look up points (``scipy.spatial.cKDTree``), which repeat if there is a period."""
    from scipy.spatial import cKDTree

    if period is None:
        return cKDTree(points)
    return cKDTree(within_period(points, period), boxsize=period)  # type: ignore[call-overload]


def within_period(points: Floats, period: float) -> Floats:
    """Images of points in the period that begins at zero.

    >>> within_period(np.array([-1.0, -1e-20, 10.0, 12.0]), 10.0)
    array([9., 0., 0., 2.])
    """
    points = np.mod(points, period)
    # Rounding leaves a small negative number at the period itself.
    return np.where(points >= period, 0.0, points)


def nearest_offsets(places: Floats, normals: Floats, points: Floats) -> tuple[Floats, Integers]:
    """Distance of points from samples of a surface, along its normal.

    Parameters
    ----------
    places, normals : ndarray, shape (..., 3)
        Of the surface.
    points : ndarray, shape (n, 3)

    Returns
    -------
    offsets : ndarray, shape (n,)
    nearest : ndarray of int, shape (n,)
        Flat indices of the samples.
    """
    places, normals = places.reshape(-1, 3), normals.reshape(-1, 3)
    nearest = np.asarray(tree_of(places).query(points)[1], dtype=np.int64)
    return dot(points - places[nearest], normals[nearest]), nearest


def nearest_patches(wall: Wall, points: Floats) -> tuple[Floats, Integers]:
    """Distances of points from the nearest samples of all faces, and the patches these are of.

    Parameters
    ----------
    wall : Wall
    points : ndarray, shape (n, 3)
        In mm.

    Returns
    -------
    distance : ndarray, shape (n,)
        In mm.
    patch : ndarray of int, shape (n,)
    """
    samples, knots = np.linspace(-1, 1, _PATCH_SAMPLES), (wall.knots, wall.knots)
    distance, patch = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    for first in range(0, wall.complex.patch_count, _PATCHES_AT_ONCE):
        some = slice(first, first + _PATCHES_AT_ONCE)
        places = grid_points(wall.nets[wall.patch_net[some]], wall.weights, knots, samples, samples)
        places = places.reshape(len(places), -1, 3) + wall.shifts[wall.patch_shift[some]][:, np.newaxis]
        found = tree_of(places.reshape(-1, 3)).query(points)
        nearer = np.asarray(found[0]) < distance
        distance[nearer] = np.asarray(found[0])[nearer]
        patch[nearer] = first + np.asarray(found[1])[nearer] // places.shape[1]
    return distance, patch


def in_wall(wall: Wall, points: Floats) -> Booleans:
    """Tell which points lie in a wall, up to the side walls where it ends.

    A place in it has parameters of its own, those of its patch and a third one through the wall, which Newton's method
    finds from samples of the mid-surface nearby.

    Parameters
    ----------
    wall : Wall
    points : ndarray, shape (n, 3)
        In mm.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    knots = (wall.knots, wall.knots)
    middles, halves = (wall.nets[:, 1] + wall.nets[:, 0]) / 2, (wall.nets[:, 1] - wall.nets[:, 0]) / 2
    point, patch, start = _starts_nearby(wall, middles, np.linalg.norm(halves, axis=-1).max(), points)
    net = wall.patch_net[patch]
    own = points[point] - wall.shifts[wall.patch_shift[patch]]
    found = np.append(start, np.zeros((1, len(point))), axis=0).T
    for _ in range(_LAYER_STEPS):
        u, v, w = found.T[..., np.newaxis]
        middle, half = (
            np.stack(point_derivatives(some[net], wall.weights, knots, u, v))[:, :, 0] for some in (middles, halves)
        )
        place, along_u, along_v = middle + w * half
        jacobian = np.stack([along_u, along_v, half[0]], axis=-1)
        regular = np.abs(np.linalg.det(jacobian)) > np.finfo(float).tiny
        jacobian[~regular] = np.eye(3)
        step = np.linalg.solve(jacobian, (own - place)[..., np.newaxis])[..., 0]
        found = np.clip(found + np.clip(step, -0.5, 0.5), -_OUTSIDE, _OUTSIDE)
    inside = regular & np.all(np.abs(found) <= 1 + _ON_SIDE, axis=1) & np.all(np.abs(step) < _ON_SIDE, axis=1)
    return np.bincount(point[inside], minlength=len(points)) > 0


def _starts_nearby(wall: Wall, middles: Floats, half: float, points: Floats) -> tuple[Integers, Integers, Floats]:
    """Points, patches whose mid-surfaces have samples nearby, each once, and the nearest sample's parameters (2, m)."""
    samples = np.linspace(-1, 1, _PATCH_SAMPLES)
    grids = grid_points(middles, wall.weights, (wall.knots, wall.knots), samples, samples)
    between = sum(np.linalg.norm(np.diff(grids, axis=axis), axis=-1).max() for axis in (1, 2))
    places = grids.reshape(len(grids), -1, 3)[wall.patch_net] + wall.shifts[wall.patch_shift][:, np.newaxis]
    apart, nearest = tree_of(places.reshape(-1, 3)).query(points, k=_NEIGHBOURS)
    patch, sample = np.divmod(nearest, len(samples) ** 2)
    # Samples come in the order of their distances: of those of one patch the first is the nearest.
    known = (patch[:, :, np.newaxis] == patch[:, np.newaxis]) & _BEFORE
    point, rank = np.nonzero(~known.any(axis=2) & (apart <= half + between))
    return point, patch[point, rank], samples[np.stack(np.divmod(sample[point, rank], len(samples)))]


def distances_from_patches(wall: Wall, points: Floats, patches: Integers) -> Floats:
    """Distance of each point from both faces of a patch of its own, to rounding.

    Parameters
    ----------
    wall : Wall
    points : ndarray, shape (n, 3)
        In mm.
    patches : ndarray of int, shape (n,)

    Returns
    -------
    ndarray, shape (n,)
        From the nearer of the two, in mm.
    """
    knots, samples = (wall.knots, wall.knots), np.linspace(-1, 1, _PATCH_SAMPLES)
    nets = wall.nets[wall.patch_net[patches]].reshape(-1, *wall.nets.shape[2:])
    own = np.repeat(points - wall.shifts[wall.patch_shift[patches]], len(SIDES), axis=0)
    apart = grid_points(nets, wall.weights, knots, samples, samples).reshape(len(nets), -1, 3) - own[:, np.newaxis]
    # From several samples: the nearest one may be a saddle of the distance.
    starts = np.argpartition(dot(apart, apart), _STARTS, axis=1)[:, :_STARTS].ravel()
    face, (u, v) = np.repeat(np.arange(len(nets)), _STARTS), samples[np.stack(np.divmod(starts, len(samples)))]

    def derivatives(u: Floats, v: Floats) -> tuple[Floats, ...]:
        found = point_derivatives(nets, wall.weights, knots, u.reshape(-1, _STARTS), v.reshape(-1, _STARTS), 2)
        return tuple(values.reshape(-1, 3) for values in found)

    distance = nearest_places(own[face], u, v, derivatives)[2]
    return np.asarray(distance.reshape(len(points), -1).min(axis=1))


def met_along_normals(
    nets: Floats, weights: Floats, knots: Floats, samples: Floats, exact: WallPoints
) -> tuple[Floats, Floats, Floats, Floats]:
    """Distances along the exact normals to the two fitted faces, each taken for its tangent plane.

    The plane is that at the same parameters, less than the fit's own deviation away: what that leaves out goes with
    the square of the deviation.

    Parameters
    ----------
    nets : ndarray, shape (patches, 2, n, n, 3)
        In mm.
    weights, knots : ndarray
        Of the nets.
    samples : ndarray, shape (m,)
        Along each side of a patch.
    exact : WallPoints
        The mid-surface at the samples of these patches.

    Returns
    -------
    met : ndarray, shape (patches, 2, m, m)
        From the mid-surface, in mm, with their signs.
    du, dv, across : ndarray, shape (patches, 2, m, m, 3)
        Derivatives of the faces there, and du x dv.
    """
    points, du, dv = grid_derivatives(nets, weights, (knots, knots), samples, samples)
    shape = (len(nets), 1, len(samples), len(samples), 3)
    middle, normal = exact.points.reshape(shape), exact.normals.reshape(shape)
    across = np.cross(du, dv)
    return dot(points - middle, across) / dot(normal, across), du, dv, across

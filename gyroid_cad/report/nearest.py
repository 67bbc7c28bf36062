"""Nearest points of the wall's faces: samples of the faces, and their shape round them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["Feet", "WallFaces", "distinct", "settled", "tree_of", "wall_faces"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Samples of all faces together, which take 250 bytes each.
_MOST_SAMPLES = 800_000
_FEWEST_STEPS, _MOST_STEPS = 6, 48
# So many queries and neighbours at a time that what is computed for them stays small.
_PAIRS_AT_ONCE = 200_000
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

        From the sample one step of Newton's method for the foot (The NURBS Book, eq. (6.6)), with the surface taken as
        its quadratic there: so the distance is true to the third order of the samples' spacing.

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
        a, b, c = dot(du, du) - dot(apart, duu), dot(du, dv) - dot(apart, duv), dot(dv, dv) - dot(apart, dvv)
        along_u, along_v = dot(apart, du), dot(apart, dv)
        determinant = a * c - b * b
        # Past the centre of curvature there is no foot nearby: the sample itself stands for it.
        sound = (determinant > 0) & (a > 0)
        determinant = np.where(sound, determinant, 1.0)
        u, v = (c * along_u - b * along_v) / determinant, (a * along_v - b * along_u) / determinant
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
        points = np.mod(points, period)
        # Rounding may leave a small negative number at the period itself.
        points[points >= period] = 0.0
    derivatives = values[1:].reshape(5, -1, 3)
    return WallFaces(points, derivatives, normals, side, 2 / steps, period, tree_of(points, period))


def tree_of(points: Floats, period: float | None) -> Any:
    """A tree in which to look up points (``scipy.spatial.cKDTree``), which repeat if there is a period."""
    from scipy.spatial import cKDTree

    return cKDTree(points, boxsize=period)  # type: ignore[arg-type]


# Samples of the walls looked at round a centre, which is as near to three walls or more.
_TOUCHING = 200
# Centres are moved until the radius they gain is this part of the grid's spacing; coarser where they are many.
_SETTLED, _SETTLED_ENOUGH = 1e-6, 1e-3
_MANY = 100
_MOST_MOVES = 40
# One step of the linear programme must give this part of what it promises, or the next is to be shorter.
_KEPT_PROMISE = 0.25


def settled(faces: WallFaces, centres: Floats, radii: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Move centres until their spheres are as large as they get.

    The radius is the least of the distances to the feet, and each of these grows with the way along its own
    direction: a linear programme says where all of them grow most, within a step that gets shorter where it promised
    too much (sequential linear programming).
    """
    centres, radii = centres.copy(), radii.copy()
    reach = np.full(len(centres), spacing / 2)
    moving = np.arange(len(centres))
    least = spacing * (_SETTLED if len(centres) <= _MANY else _SETTLED_ENOUGH)
    for _ in range(_MOST_MOVES):
        steps, gains = _best_steps(faces.feet(centres[moving], _TOUCHING), reach[moving])
        tried, outside, _ = faces.feet(centres[moving] + steps, _TOUCHING).nearest()
        better = outside & (tried > radii[moving])
        promised = better & (tried - radii[moving] >= _KEPT_PROMISE * gains)
        centres[moving[better]] += steps[better]
        radii[moving[better]] = tried[better]
        reach[moving[~promised]] /= 4
        moving = moving[(gains > least) & (reach[moving] > least)]
        if not len(moving):
            break
    return centres, radii


def _best_steps(feet: Feet, reach: Floats) -> tuple[Floats, Floats]:
    """Steps, each coordinate within reach, that let the least distance to the feet grow most, and by how much.

    The programmes of all centres are solved as one: nothing joins them but that their gains are added.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    count = len(feet.distance)
    nearest = np.arange(_TOUCHING) == np.argmin(feet.distance, axis=1)[:, np.newaxis]
    which, foot = np.nonzero(feet.found | nearest)
    distance = feet.distance[which, foot]
    # r - (away / distance) . step <= distance, in the unknowns x, y, z and r of each centre.
    values = np.column_stack([-feet.away[which, foot] / distance[:, np.newaxis], np.ones(len(which))])
    columns = 4 * which[:, np.newaxis] + np.arange(4)
    rows = csr_array((values.ravel(), columns.ravel(), 4 * np.arange(len(which) + 1)), shape=(len(which), 4 * count))
    bounds = np.repeat(np.column_stack([-reach, reach]), 4, axis=0)
    bounds[3::4] = [-np.inf, np.inf]
    gain = np.tile([0.0, 0.0, 0.0, -1.0], count)
    # SciPy takes sparse rows, which its stubs do not know.
    best: Any = linprog(gain, rows, distance, bounds=bounds)  # type: ignore[call-overload]
    if best.status != 0:
        return np.zeros((count, 3)), np.zeros(count)
    found = best.x.reshape(count, 4)
    return found[:, :3], found[:, 3] - feet.distance.min(axis=1)


def distinct(centres: Floats, radii: Floats, apart: float, period: float | None) -> Integers:
    """Keep the largest of spheres with nearly one centre."""
    order = np.argsort(-radii, kind="stable")
    tree = tree_of(centres[order], period)
    kept = np.ones(len(order), dtype=bool)
    for first, second in tree.query_pairs(apart, output_type="ndarray"):
        kept[max(first, second)] = False
    return np.sort(order[kept])

"""Fillets where a lattice meets a skin: what a ball that rolls along both cannot reach is filled.

Its middle runs on a spine, the curves on which the distances from the lattice and from the skin are both the radius.
Between the ball, the two places where it touches and the junction lies the fillet, whatever the angle of the two; it is
nothing where the spine is further away. So what is not at the junction stays as it is, and so do pockets along it that
are too narrow for the ball.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import cross, dot, unit
from gyroid_cad.common.checks import positive_number
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.infill import Infill
from gyroid_cad.filling.wanted import Region
from gyroid_cad.kernel.part import AS_FAR
from gyroid_cad.mesh.triangles.booleans import Body, body_of
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.level_set import Grid, level_surface, portioned, told_apart
from gyroid_cad.wall.exact import offset_patches, patch_points_and_normals
from gyroid_cad.wall.grading import THINNEST_WALL
from gyroid_cad.wall.pore_limits import pore_limiting_diameter

__all__ = ["checked_fillet", "require_narrower", "rounded"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of the radius: steps of the grid and of the spine at most, and how near to each other places of the junction are one.
_STEP, _SPACING, _MERGED = 1 / 3, 1 / 4, 1 / 5
# How far fillets go on below the faces that they lie on, in steps: no two faces then lie in one another.
_BELOW = 1.5
# Of the sagitta of an arc of a step, how far the arc is moved outwards: its ends dip below the faces without burrs.
_DIP = 1 / 4
# A place of the spine is found when its distances are off by less than so much of the radius; in so many steps.
_FOUND, _STEPS = 1e-4, 30
# The ball begins so small, in parts of its radius, and grows in so many sizes.
_SMALLEST, _SIZES = 1 / 8, 6
# How far a ball's middle may be from the junction, in radii: further off, the two faces all but touch.
_FURTHEST = 6.0
# Of the square of the sine of the angle between the ways off both faces: less is taken for so much.
_BLUNT = 1e-3
# Ways off both faces that differ by less, as the cosine: they are one face.
_ONE_FACE = 0.99
# Points of a grid at most, of a byte each.
_MOST_POINTS = 400_000_000
# How often a spine is halved at most.
_DOUBLINGS = 5
# Where a grid gives no manifold, another one a little finer mostly does.
_FINER, _TRIES = 0.93, 4


def checked_fillet(fillet: float | None, skin: float | None, core: Any) -> float | None:
    """Radius in mm, if there is to be one; raises ParameterError.

    Parameters
    ----------
    fillet, skin, core
        As of :func:`gyroid_cad.fill`.
    """
    if fillet is None:
        return None
    radius = positive_number("fillet", fillet, "a length in mm, a finite number above 0")
    if skin is None and core is None:
        raise ParameterError("fillet", fillet, "none without a skin or a core, where the wall would meet it")
    if radius < THINNEST_WALL:
        raise ParameterError("fillet", fillet, f"at least {THINNEST_WALL:g} mm, the thinnest wall")
    return radius


def require_narrower(fillet: float, infill: Infill, regions: Sequence[Region]) -> None:
    """Check that a ball of a fillet's radius passes through the lattice's pores.

    Raises
    ------
    ParameterError
        With the largest radius that does.
    """
    region = regions[0]
    wall = infill.max_thickness
    if not region.fluid and (region.lowest is None or region.highest is None):
        # Beside a network lies all the rest, the wall too or less of it.
        wall *= -region.end
    widest = pore_limiting_diameter(infill.grading.surface, _least_cell(infill), wall) / 2
    if fillet >= widest:
        accepted = f"below {widest:.3g} mm, half of what the pores are wide where they are narrowest"
        raise ParameterError("fillet", fillet, accepted)


def _least_cell(infill: Infill) -> float:
    """Cell size where a map or a scale makes it least, by the sides of patches, in mm."""
    if infill.endless:
        return infill.grading.cell_size
    ends = np.array([-1.0, 1.0])
    carried = np.concatenate([some.points for _, some in offset_patches(infill.complex, infill.grading, ends)])
    plain = patch_points_and_normals(infill.complex, 1.0, ends)[0]
    sides = [np.linalg.norm(np.diff(own.reshape(-1, 2, 2, 3), axis=1), axis=-1) for own in (carried, plain)]
    return float((sides[0] / sides[1]).min())


@dataclass(frozen=True, slots=True, eq=False)
class _Spine:
    """Places of a ball that touches the lattice and the skin.

    Attributes
    ----------
    middles : ndarray, shape (n, 3)
    up, off : ndarray, shape (n, 3)
        Unit vectors to them from where the lattice and the skin are touched.
    corners : ndarray, shape (n, 3)
        Places of the junction that they belong to.
    """

    middles: Floats
    up: Floats
    off: Floats
    corners: Floats

    def __getitem__(self, chosen: NDArray[Any]) -> _Spine:
        return _Spine(self.middles[chosen], self.up[chosen], self.off[chosen], self.corners[chosen])

    def __add__(self, other: _Spine) -> _Spine:
        pairs = zip(self.arrays, other.arrays, strict=True)
        return _Spine(*(np.concatenate(pair) for pair in pairs))

    @property
    def arrays(self) -> tuple[Floats, Floats, Floats, Floats]:
        return self.middles, self.up, self.off, self.corners


def rounded(void: Body, part: Body, core: Body, skin: float | None, radius: float, deviation: float) -> Body:
    """Space that a lattice leaves in a core, its corners along the skin filled.

    Parameters
    ----------
    void : Body
        The core less the lattice.
    part, core : Body
    skin : float, optional
        How thin it is at least, in mm.
    radius : float
        Of the fillets, in mm.
    deviation : float
        Largest one of their triangles, in mm.

    Raises
    ------
    ParameterError
        If the part is too large for fillets so small.
    KernelError
        If the fillets' triangles do not close.
    """
    inside = void & part
    vertices, triangles = inside.triangles()
    origins = inside.origins()
    # Where a core comes to the part's boundary there is no skin.
    of_core = np.isin(origins, core.origins()) & ~_on(part, vertices[triangles].mean(axis=1))
    of_wall = ~np.isin(origins, np.concatenate([core.origins(), part.origins()]))
    start, edges = _junction(vertices, triangles, of_wall, of_core, radius * _MERGED)
    if not len(edges):
        return void
    lattice, hull = (SignedDistances(vertices, triangles[own]) for own in (of_wall, of_core))
    boundary = SignedDistances(vertices, triangles)
    spine = _spine(start, edges, radius, lattice, hull, boundary)
    if not len(spine.middles):
        return void
    step = min(radius * _STEP, float(np.sqrt(8 * deviation * radius)))
    for _ in range(_TRIES):
        rounding = _Rounding(spine, boundary, radius, step, min(_BELOW * step, skin / 2 if skin else np.inf))
        filled = rounding.body()
        if filled is not None:
            return void - filled
        step *= _FINER
    raise KernelError(f"the triangles of fillets of {radius:g} mm do not close")


def _on(part: Body, points: Floats) -> Booleans:
    """Mask of points that lie on a part's boundary."""
    size = float(np.ptp(part.bounds, axis=0).max())
    return SignedDistances(*part.triangles()).near(points, AS_FAR * size)


def _junction(
    vertices: Floats, triangles: Integers, of_wall: Booleans, of_core: Booleans, apart: float
) -> tuple[_Spine, Integers]:
    """Places where lattice and skin meet, a little apart, with the ways into the void; and which are neighbours."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    inwards = np.cross(c - a, b - a)
    ends = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    order = np.lexsort(np.sort(ends, axis=1).T)
    one, other = order[0::2] // 3, order[1::2] // 3
    one, other = np.where(of_wall[one], one, other), np.where(of_wall[one], other, one)
    met = of_wall[one] & of_core[other]
    edges = ends[order[0::2][met]]
    used, numbers = np.unique(edges, return_inverse=True)
    ways = []
    for own in (one[met], other[met]):
        total = np.zeros((len(used), 3))
        np.add.at(total, numbers.reshape(-1, 2), inwards[own][:, np.newaxis])
        ways.append(unit(total))
    places = vertices[used]
    # The two sides of a thin wall stay apart: their ways differ.
    keys = np.column_stack([np.floor(places / apart), *(np.round(way) for way in ways)])
    _, first, label = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    linked = np.unique(np.sort(label.ravel()[numbers.reshape(-1, 2)], axis=1), axis=0)
    start = _Spine(places, ways[0], ways[1], places)[first]
    return start, linked[linked[:, 0] < linked[:, 1]]


def _spine(
    start: _Spine,
    edges: Integers,
    radius: float,
    lattice: SignedDistances,
    hull: SignedDistances,
    boundary: SignedDistances,
) -> _Spine:
    """Places of the ball along a junction, close to each other."""
    # Between two planes the ball's middle lies so far from the line in which they meet.
    away = (start.up + start.off) / np.maximum(1 + dot(start.up, start.off), _BLUNT)[:, np.newaxis]
    spine, size, kept = replace(start, middles=start.corners + _no_longer(away, _FURTHEST)), 1.0, np.arange(len(away))
    # The ball grows where it is, so that it stays on its side of thin skins and walls.
    for grown in radius * np.geomspace(_SMALLEST, 1.0, _SIZES):
        grown_middles = spine.corners + (spine.middles - spine.corners) * (grown / size)
        spine, held = _settled(replace(spine, middles=grown_middles), grown, lattice, hull, boundary)
        size, kept = grown, kept[held]
    number = np.full(len(away), -1)
    number[kept] = np.arange(len(kept))
    edges = number[edges[np.isin(edges, kept).all(axis=1)]]
    spine = spine + _beyond_ends(spine, edges, radius)
    for _ in range(_DOUBLINGS):
        one, other = spine[edges[:, 0]], spine[edges[:, 1]]
        far = np.linalg.norm(one.middles - other.middles, axis=1) > radius * _SPACING
        if not far.any():
            break
        between = _Spine(*((p + q) / 2 for p, q in zip(one[far].arrays, other[far].arrays, strict=True)))
        found, held = _settled(between, radius, lattice, hull, boundary)
        new = len(spine.middles) + np.arange(len(found.middles))
        ends = edges[far][held]
        edges = np.concatenate([np.column_stack([ends[:, 0], new]), np.column_stack([new, ends[:, 1]])])
        spine = spine + found
    # Where both faces go on as one there is nothing to round.
    return spine[dot(spine.up, spine.off) < _ONE_FACE]


def _settled(
    spine: _Spine, radius: float, lattice: SignedDistances, hull: SignedDistances, boundary: SignedDistances
) -> tuple[_Spine, Booleans]:
    """Spine whose ball touches both, by Newton's method, and which of its points that could be reached for."""
    middles, up, off = spine.middles.copy(), spine.up.copy(), spine.off.copy()
    wrong = np.full(len(middles), np.inf)
    for _ in range(_STEPS):
        left = np.flatnonzero(wrong > _FOUND * radius)
        if not len(left):
            break
        outside, gaps = boundary(middles[left]), []
        for surface, ways in ((lattice, up), (hull, off)):
            apart = middles[left] - surface.nearest(middles[left])
            distance = np.linalg.norm(apart, axis=1)
            # Beyond the nearest face, the way back is through it.
            side = np.where((outside > 0) & (distance < outside * (1 + _FOUND)), -1.0, 1.0)
            ways[left] = unit(apart) * side[:, np.newaxis]
            gaps.append(radius - distance * side)
        wrong[left] = np.abs(gaps).max(axis=0)
        still = wrong[left] > _FOUND * radius
        a, b = _shares(up[left], off[left], *gaps)
        middles[left[still]] += _no_longer(a * up[left] + b * off[left], radius)[still]
    held = (wrong <= _FOUND * radius) & (boundary(middles) < 0)
    return _Spine(middles, up, off, spine.corners)[held], held


def _shares(up: Floats, off: Floats, along_up: Floats, along_off: Floats) -> tuple[Floats, Floats]:
    """Parts of two unit vectors whose sum has given lengths along each; shape (n, 1)."""
    cosine = dot(up, off)
    square = np.maximum(1 - cosine**2, _BLUNT)
    return (
        ((along_up - cosine * along_off) / square)[:, np.newaxis],
        ((along_off - cosine * along_up) / square)[:, np.newaxis],
    )


def _no_longer(vectors: Floats, length: float) -> Floats:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors * np.minimum(1.0, length / np.maximum(lengths, np.finfo(float).tiny)))


def _beyond_ends(spine: _Spine, edges: Integers, radius: float) -> _Spine:
    """Straight pieces that go on from the ends of a spine: at openings, fillets reach the part's boundary."""
    ends = np.flatnonzero(np.bincount(edges.ravel(), minlength=len(spine.middles)) == 1)
    last = edges[np.isin(edges, ends).any(axis=1)]
    last = np.where(np.isin(last[:, :1], ends), last, last[:, ::-1])
    end, before = spine[last[:, 0]], spine[last[:, 1]]
    along = unit(end.middles - before.middles) * (radius * _SPACING)
    pieces = [
        _Spine(end.middles + k * along, end.up, end.off, end.corners + k * along) for k in range(1, round(2 / _SPACING))
    ]
    return reduce(_Spine.__add__, pieces)


class _Rounding:
    """Space that fillets take up and a little below them: positive inside, zero on its boundary."""

    def __init__(self, spine: _Spine, boundary: SignedDistances, radius: float, step: float, below: float) -> None:
        self._spine, self._boundary, self._step, self._below = spine, boundary, step, below
        self._asked, self._radius = radius, radius + _DIP * step**2 / (8 * radius)
        self._spacing = radius * _SPACING
        self._tree = cKDTree(spine.middles)
        self._along = unit(cross(spine.up.T, spine.off.T).T)
        self._reach = np.linalg.norm(spine.middles - spine.corners, axis=1) + below + step

    def body(self) -> Body | None:
        """The body of all fillets; None where their triangles do not close."""
        furthest = float(self._reach.max())
        low = self._spine.middles.min(axis=0) - furthest - 1.37 * self._step
        high = self._spine.middles.max(axis=0) + furthest
        x, y, z = (ceil(extent / self._step) + 3 for extent in (high - low).tolist())
        a, b, c = low.tolist()
        grid = Grid((a, b, c), self._step, (x, y, z))
        if (count := float(np.prod(grid.shape))) > _MOST_POINTS:
            possible = self._asked * (count / _MOST_POINTS) ** (2 / 3)
            accepted = f"about {possible:.2g} mm or more in a part of this size; this one takes {count:,.0f} points"
            raise ParameterError("fillet", self._asked, accepted)
        inside = told_apart(lambda points: furthest - np.asarray(self._tree.query(points)[0]), grid)
        near = np.argwhere(inside)
        inside[inside] = portioned(self, grid.points(near)) > 0
        return body_of(*level_surface(inside, grid, self, self.normals, self.project))

    def __call__(self, points: Floats) -> Floats:
        return np.asarray(self._bounds(points)[0].min(axis=0))

    def normals(self, points: Floats) -> Floats:
        """Out of the fillets."""
        bounds, nearest, away = self._bounds(points)
        up, off = self._spine.up[nearest], self._spine.off[nearest]
        cosine = dot(up, off)[:, np.newaxis]
        ways = np.stack([-unit(away), unit(up - cosine * off), unit(off - cosine * up), unit(away)])
        which = bounds.argmin(axis=0)
        found = ways[np.minimum(which, 3), np.arange(len(points))]
        deep = which == len(ways)
        found[deep] = unit(points[deep] - self._boundary.nearest(points[deep]))
        return np.asarray(found)

    def project(self, points: Floats) -> Floats:
        """Places on the ball next to points that lie nearest to it."""
        bounds, _, away = self._bounds(points)
        onto = points + unit(away) * (self._radius - np.linalg.norm(away, axis=1, keepdims=True))
        return np.where((bounds.argmin(axis=0) == 0)[:, np.newaxis], onto, points)

    def _bounds(self, points: Floats) -> tuple[Floats, Integers, Floats]:
        """Distances from what bounds the fillets, the nearest places of the spine, and vectors from it.

        The ball; the planes through its middle and where it touches one face and the other; an end of the spine; and
        the depth below the faces.
        """
        nearest = np.asarray(self._tree.query(points)[1], dtype=np.int64)
        up, off, along = self._spine.up[nearest], self._spine.off[nearest], self._along[nearest]
        away = points - self._spine.middles[nearest]
        further = np.clip(dot(away, along), -self._spacing, self._spacing)
        away = away - further[:, np.newaxis] * along
        distance = np.linalg.norm(away, axis=1)
        sine = np.sqrt(np.maximum(1 - dot(up, off) ** 2, _BLUNT))
        a, b = (part[:, 0] * sine for part in _shares(up, off, -dot(away, up), -dot(away, off)))
        bounds = np.stack([distance - self._radius, a, b, self._reach[nearest] - distance, np.full(len(a), np.inf)])
        close = bounds.min(axis=0) > -2 * self._step
        bounds[4, close] = self._below - self._boundary(points[close])
        return bounds, nearest, away

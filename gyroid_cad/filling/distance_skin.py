"""Skins of parts known by their triangles: the inner side is where the distance from the boundary is the skin's.

Distances know no features: what is smaller than the skin vanishes by itself, and no part is refused for its shape.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import ceil
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point, dot, unit
from gyroid_cad.common.checks import three_numbers
from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.triangle_part import TrianglePart, triangle_part
from gyroid_cad.kernel.part import AS_FAR, ON_FACE, OPENINGS, selected_way
from gyroid_cad.kernel.skin_room import shown_place
from gyroid_cad.mesh.triangles.booleans import Body, body_of
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.level_set import Grid, level_surface, told_apart
from gyroid_cad.trim.islands import SealedVoid

__all__ = ["Shell", "given_core", "opened_facets", "without_small_voids"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]

# Steps of the grid in a skin, at least: what lies between two walls of it is told apart.
_STEPS_IN_SKIN = 2.0
# Of an opening, how far beyond the part the core is taken, in skins, so that no two surfaces lie in one another.
_BEYOND = 0.5
# Points of a grid on the surface, at most: as many as some hundred MB of memory.
_MOST_POINTS = 2_000_000
# Where a grid gives no manifold, another one a little finer mostly does.
_FINER, _TRIES = 0.93, 4
# Of the smallest void of a part, what is left of it at least where its triangles are simplified.
_OWN = 0.5
# Facets that turn by less belong to one flat region, as the cosine.
_FLAT = np.cos(np.radians(1.0))


@dataclass(frozen=True, slots=True, eq=False)
class Shell:
    """Skin that a part is to have.

    Attributes
    ----------
    skin : float, optional
        In mm.
    openings : sequence
    core : shape, Workplane or path-like, optional
    fillet : float, optional
        Radius in mm where the lattice meets it.
    """

    skin: float | None = None
    openings: Sequence[Any] = ()
    core: Any = None
    fillet: float | None = None

    def core_of(
        self, part: TrianglePart, opened: Booleans | None, deviation: float
    ) -> tuple[TrianglePart | None, float | None]:
        """Core that the skin leaves of a part, if there is one, and how thin the skin is at least, in mm.

        Raises
        ------
        ParameterError
        """
        if self.core is not None:
            inner, skin = given_core(part, self.core, deviation)
            return TrianglePart(inner), skin
        if self.skin is None or opened is None:
            return None, None
        depth = _Depth(part, self.skin, opened)
        return TrianglePart(_core_within(part, self.skin, depth, deviation), depth=depth), self.skin


class _Depth:
    """Depth below the boundary less the skin, openings left out: positive in the core, zero on its boundary."""

    def __init__(self, part: TrianglePart, skin: float, opened: Booleans) -> None:
        vertices, triangles = part.body.triangles()
        self._signed, self._skin, self._open = part.facets, skin, bool(opened.any())
        self._walls = SignedDistances(vertices, triangles[~opened]) if self._open else self._signed

    def __call__(self, points: Floats) -> Floats:
        signed = self._signed(points)
        if not self._open:
            return -signed - self._skin
        return np.minimum(self._walls.away(points) - self._skin, _BEYOND * self._skin - signed)

    def between(self, points: Floats) -> Floats:
        """The same at places less than the skin away from some in the core: on which side they are needs no telling."""
        return self(points) if self._open else self._walls.away(points) - self._skin

    def normals(self, points: Floats) -> Floats:
        """Out of the core: towards the nearest place of the skin's outside, or away from that of an opening."""
        return self._nearest(points)[1]

    def project(self, points: Floats) -> Floats:
        """Places next to points on the core's boundary."""
        for _ in range(2):
            places, normals, distances = self._nearest(points)
            points = places - distances[:, np.newaxis] * normals
        return points

    def _nearest(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Nearest places of what bounds the core there, normals towards them, and the distances that are wanted."""
        places, wanted = self._walls.nearest(points), np.full(len(points), self._skin)
        if self._open:
            beyond = np.linalg.norm(points - places, axis=1) - self._skin > _BEYOND * self._skin - self._signed(points)
            places[beyond], wanted[beyond] = self._signed.nearest(points[beyond]), -_BEYOND * self._skin
        away = (places - points) * np.sign(wanted)[:, np.newaxis]
        return places, away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), np.finfo(float).tiny), wanted


def _core_within(part: TrianglePart, skin: float, depth: _Depth, deviation: float) -> Body:
    """Body that a skin leaves of a part; through openings it reaches beyond.

    Parameters
    ----------
    part : TrianglePart
    skin : float
        In mm.
    depth : callable
        Below its inner side.
    deviation : float
        Largest distance of the inner side's triangles from where it should be, in mm.

    Raises
    ------
    ParameterError
        If nothing is left, or the deviation would take too many points.
    """
    # Chords of a surface that is rounded by no less than the skin, as it is round an edge that faces inwards.
    step = min(skin / _STEPS_IN_SKIN, float(np.sqrt(8 * deviation * skin)))
    for _ in range(_TRIES):
        grid = _grid_round(part, skin, step)
        _require_few(part, grid, deviation)
        inside = told_apart(depth, grid)
        if not inside.any():
            raise ParameterError("skin", skin, _thinner(part))
        vertices, triangles = level_surface(inside, grid, depth.between, depth.normals, depth.project)
        body = body_of(vertices, triangles)
        if body is not None and body.volume > 0:
            return body
        step *= _FINER
    raise KernelError(f"the inner side of a skin of {skin:g} mm does not close")


def _grid_round(part: TrianglePart, skin: float, step: float) -> Grid:
    # Odd parts of a step: no plane of the part lies on points of the grid.
    low = part.low - skin - 1.37 * step
    x, y, z = (ceil(extent / step) + 3 for extent in (part.high + skin - low).tolist())
    a, b, c = low.tolist()
    return Grid((a, b, c), step, (x, y, z))


def _require_few(part: TrianglePart, grid: Grid, deviation: float) -> None:
    count = part.body.area / grid.step**2
    if count > _MOST_POINTS or float(np.prod(grid.shape)) > _MOST_POINTS * 200:
        possible = deviation * max(count / _MOST_POINTS, (np.prod(grid.shape) / (_MOST_POINTS * 200)) ** (2 / 3))
        accepted = f"about {possible:.1e} mm or more with this skin, whose inner side takes {count:,.0f} points"
        raise ParameterError("deviation", deviation, accepted)


def _thinner(part: TrianglePart) -> str:
    """Thickness of skin that leaves a core, by the depths of points of a grid."""
    along = [np.linspace(low, high, 42)[1:-1] for low, high in zip(part.low, part.high, strict=True)]
    points = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
    depths = -part.distances(points)
    deepest = int(np.argmax(depths))
    where = f"its deepest place, round {shown_place(points[deepest])}"
    return f"below about {depths[deepest]:.3g} mm, the depth of {where}: nothing is left to be filled"


def given_core(part: TrianglePart, core: Any, deviation: float) -> tuple[Body, float | None]:
    """Body of a user's own core, and how thin the skin round it is in mm; None where there is none.

    Parameters
    ----------
    part : TrianglePart
    core : shape, Workplane or path-like
    deviation : float
        Of its triangles, in mm.

    Raises
    ------
    ParameterError
        If it isn't inside the part, or leaves no skin.
    """
    try:
        inner = triangle_part(core, (), deviation)
    except ParameterError as refused:
        raise ParameterError("core", refused.value, refused.accepted) from None
    size = float(np.max(part.high - part.low))
    vertices = inner.body.triangles()[0]
    depths = -part.distances(vertices)
    # Two meshes of one curved face may be apart by the deviations of both.
    if depths.min() < -2 * deviation - AS_FAR * size:
        x, y, z = vertices[int(depths.argmin())].tolist()
        where = f"{-depths.min():.4g} mm outside at ({x:.6g}, {y:.6g}, {z:.6g})"
        raise ParameterError("core", f"{inner.body.volume:.6g} mm3", f"a solid inside the part; it is {where}")
    if (part.body - inner.body).volume <= AS_FAR * part.body.volume:
        raise ParameterError("core", f"{inner.body.volume:.6g} mm3", "less than the whole part, so that a skin is left")
    walls = depths[depths > 2 * deviation + AS_FAR * size]
    return inner.body, float(walls.min()) if len(walls) else None


def without_small_voids(
    pieces: Sequence[Body], part: Body, middle: Floats, least: float
) -> tuple[list[list[Body]], list[SealedVoid]]:
    """Shells of pieces without voids below a volume in mm3, and the voids they seal but for the part's own.

    The largest void comes first.
    """
    left: list[list[Body]] = []
    voids: list[SealedVoid] = []
    own = part.moved(-middle) if part.void_count else None
    # Space outside the part is a void of its own, and no smaller than that: less is a film that a cut left there.
    least_own = min((-_OWN * void.volume for void in part.shells()[1]), default=0.0)
    for piece in pieces:
        shells, sealed = piece.shells()
        if own is not None:
            parted = [(shell.inside_out() & own).volume > 0 for shell in sealed]
            voids_of_part = [shell for shell, in_part in zip(sealed, parted, strict=True) if not in_part]
            shells = shells + [shell for shell in voids_of_part if -shell.volume >= least_own]
            sealed = [shell for shell, in_part in zip(sealed, parted, strict=True) if in_part]
        sealed = [shell for shell in sealed if -shell.volume >= least]
        left.append([*shells, *sealed])
        voids += [SealedVoid(-shell.volume, _point(shell.centre + middle)) for shell in sealed]
    return left, sorted(voids, key=lambda void: -void.volume)


def _point(place: Floats) -> Point:
    x, y, z = place.tolist()
    return x, y, z


def opened_facets(part: TrianglePart, openings: Sequence[Any]) -> Booleans:
    """Mask of the body's triangles that lie at openings; shape (triangles,).

    Parameters
    ----------
    part : TrianglePart
    openings : sequence
        As of :func:`gyroid_cad.fill`: of a part that came as triangles, selectors or points, each for the flat region
        of triangles there.

    Raises
    ------
    ParameterError
    """
    if isinstance(openings, str) or not isinstance(openings, Iterable):
        raise ParameterError("openings", openings, f"a sequence of {OPENINGS}")
    vertices, triangles = part.body.triangles()
    chosen = np.zeros(len(triangles), dtype=bool)
    if not openings:
        return chosen
    if part.shape is not None:
        # Solids that were united share no triangles with what they were: faces are told by their places.
        middles = vertices[triangles].mean(axis=1)
        off = np.linalg.norm(SignedDistances(*part.facets_of(openings)).nearest(middles) - middles, axis=1)
        return np.asarray(off < AS_FAR * float(np.max(part.high - part.low)))
    regions = _flat_regions(vertices, triangles)
    for given in openings:
        chosen |= np.isin(regions, _regions_at(part, given, vertices, triangles, regions))
    return chosen


def _flat_regions(vertices: Floats, triangles: Integers) -> Integers:
    """Label of the flat region that each triangle is a part of; shape (triangles,)."""
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normals = unit(np.cross(b - a, c - a))
    edges = np.sort(np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    one, other = order[0::2] // 3, order[1::2] // 3
    flat = dot(normals[one], normals[other]) > _FLAT
    return connected(len(triangles), one[flat], other[flat])


def _regions_at(part: TrianglePart, given: Any, vertices: Floats, triangles: Integers, regions: Integers) -> Integers:
    """Labels of the regions that a selector or a point means."""
    corners = vertices[triangles]
    if isinstance(given, str):
        sign, axis = selected_way(given)
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        reach = sign * np.bincount(regions, area * corners[:, :, axis].mean(axis=1)) / np.bincount(regions, area)
        return np.flatnonzero(reach >= reach.max() - AS_FAR * float(np.max(part.high - part.low)))
    try:
        point = three_numbers("openings", given)
    except ParameterError:
        raise ParameterError("openings", given, OPENINGS) from None
    place = part.facets.nearest(point[np.newaxis])[0]
    if (away := float(np.linalg.norm(place - point))) > ON_FACE * float(np.max(part.high - part.low)):
        shown = tuple(point.tolist())
        raise ParameterError("openings", shown, f"a point on the part; the nearest is {away:.4g} mm away")
    off = [
        np.linalg.norm(SignedDistances(vertices, some[np.newaxis]).nearest(place[np.newaxis])[0] - place)
        for some in triangles[_nearby(corners, place)]
    ]
    return regions[_nearby(corners, place)[[int(np.argmin(off))]]]


def _nearby(corners: Floats, place: Floats) -> Integers:
    """Triangles whose boxes hold a place, or all but hold it."""
    size = float(np.ptp(corners, axis=(0, 1)).max())
    low, high = corners.min(axis=1) - AS_FAR * size, corners.max(axis=1) + AS_FAR * size
    return np.flatnonzero(np.all((low <= place) & (place <= high), axis=1))

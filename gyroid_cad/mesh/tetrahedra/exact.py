"""Places on the exact faces next to given ones: looked up by fine triangles, then by the faces themselves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, grouped, unit
from gyroid_cad.mesh.tetrahedra.surface import SurfaceMesh, sides_of, triangle_normals
from gyroid_cad.mesh.triangles.outlined import Surfaces
from gyroid_cad.wall.distances import tree_of

__all__ = ["ExactPanels", "PanelPairs", "PlacedTriangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
# Of rows of points, and panels that each of these lies on.
PanelPairs = tuple[Integers, Integers]
# From points (n, 1, 3) and pieces (n, k) to weights (n, k, ...) of the nearest places, and how far off these are.
Closest = Callable[[Floats, Integers], tuple[Floats, Floats]]

# Fine triangles, or pieces of a crease, looked at for each point at first, and at most.
_NEAREST, _MOST_NEAREST = 8, 2000
# In parts of the longest fine side: so close is a place that is the nearest.
_CLOSE = 0.05
_ROUNDS = 12
# Of parameters' ranges, for derivatives; rounds towards the foot on a face, and towards where panels meet.
_STEP, _FOOT_ROUNDS, _MEETING_ROUNDS = 1e-5, 2, 4
# Squared sine of half the angle between panels that have no sure direction across their crease.
_ALIKE = 3e-4


@dataclass(frozen=True, slots=True, eq=False)
class PlacedTriangles:
    """Triangles with their faces, and the parameters of their corners there.

    Attributes
    ----------
    mesh : SurfaceMesh
    faces : ndarray of int, shape (triangles,)
    places : ndarray, shape (triangles, 3, 2)
    """

    mesh: SurfaceMesh
    faces: Integers
    places: Floats

    def finer(self, surfaces: Surfaces, longest: float) -> PlacedTriangles:
        """Return triangles whose sides have been halved, on their faces, until none is longer."""
        made = self
        for _ in range(_ROUNDS):
            sides = sides_of(made.mesh)
            lengths = sides.lengths(made.mesh.points)
            if not (lengths > longest).any():
                break
            made = made._halved(surfaces, np.where(lengths > longest, lengths, 0.0)[sides.of], sides.of, sides.uses)
        return made

    def _halved(self, surfaces: Surfaces, wanted: Floats, of: Integers, uses: Integers) -> PlacedTriangles:
        """Triangles parted by the side that they want parted most, where all triangles at it do."""
        rows, best, number = chosen_sides(wanted, of, uses)
        mesh, corner = self.mesh, best[rows]
        a, b, c = ((corner + k) % 3 for k in range(3))
        middles = (self.places[rows, a] + self.places[rows, b]) / 2
        new = number[of[rows, corner]]
        made, first = np.unique(new, return_index=True)
        points = surfaces.evaluated(self.faces[rows[first]], middles[first])[0]
        t, p = mesh.triangles, self.places
        numbers = new + len(mesh.points)
        halves = (
            np.stack([t[rows, a], numbers, t[rows, c]], axis=1),
            np.stack([numbers, t[rows, b], t[rows, c]], axis=1),
        )
        corners = (
            np.stack([p[rows, a], middles, p[rows, c]], axis=1),
            np.stack([middles, p[rows, b], p[rows, c]], axis=1),
        )
        kept = np.ones(len(t), dtype=bool)
        kept[rows] = False
        where = np.concatenate([np.flatnonzero(kept), rows, rows])
        assert len(points) == len(made)
        triangles = np.concatenate([t[kept], *halves])
        finer = SurfaceMesh(np.concatenate([mesh.points, points]), triangles, mesh.panels[where])
        return PlacedTriangles(finer, self.faces[where], np.concatenate([p[kept], *corners]))


def chosen_sides(wanted: Floats, of: Integers, uses: Integers) -> tuple[Integers, Integers, Integers]:
    """Sides to be parted at once, of each triangle one at most.

    Parameters
    ----------
    wanted : ndarray, shape (triangles, 3)
        How much each side is to be parted, above 0.
    of, uses : ndarray of int
        As of :class:`~gyroid_cad.mesh.tetrahedra.surface.Sides`.

    Returns
    -------
    rows : ndarray of int
        Triangles that are parted.
    best : ndarray of int, shape (triangles,)
        Corner from which each one's side runs.
    number : ndarray of int, shape (sides,)
        Number of each side that is chosen, from 0; of others -1.
    """
    best = np.argmax(wanted, axis=1)
    side = of[np.arange(len(of)), best]
    some = wanted.max(axis=1) > 0
    chosen = np.bincount(side[some], minlength=len(uses)) == uses
    number = np.where(chosen, np.cumsum(chosen) - 1, -1)
    return np.flatnonzero(some & chosen[side]), best, number


class ExactPanels:
    """Panels of exact faces, on which the nearest places are found.

    Parameters
    ----------
    surfaces : Surfaces
        Of the faces.
    domains : ndarray, shape (faces, 2, 2)
        Lowest and highest parameters that they have; NaN where they have none.
    placed : PlacedTriangles
        As fine as the triangles that are to be placed, or finer.
    """

    def __init__(self, surfaces: Surfaces, domains: Floats, placed: PlacedTriangles) -> None:
        self._surfaces, self._domains, self._placed = surfaces, domains, placed
        mesh = placed.mesh
        self._normals = unit(triangle_normals(mesh.points, mesh.triangles))
        middles = mesh.points[mesh.triangles].mean(axis=1)
        self._trees = {panel: (tree_of(middles[own]), own) for panel, own in grouped(mesh.panels)}
        sides = sides_of(mesh)
        self._reach = float(sides.lengths(mesh.points).max())
        creases, keys = sides.ends[sides.creases], sides.keys[sides.creases]
        self._creases = {
            key: (tree_of(mesh.points[creases[own]].mean(axis=1)), creases[own]) for key, own in grouped(keys)
        }
        low, high = np.full((2, len(domains), 2), np.nan)
        for corner in range(3):
            np.fmin.at(low, placed.faces, placed.places[:, corner])
            np.fmax.at(high, placed.faces, placed.places[:, corner])
        self._extent, self._middle = high - low, (high + low) / 2

    def along_creases(self, points: Floats, keys: Integers) -> Floats:
        """Nearest places on the fine chords of creases, by the numbers of the sets of panels that meet there."""
        found, vertices = np.empty_like(points), self._placed.mesh.points
        for key, rows in grouped(keys):
            tree, ends = self._creases[key]
            start = vertices[ends[:, 0]]
            chord = vertices[ends[:, 1]] - start
            near, part = self._nearest(tree, points[rows], partial(_along, start, chord))
            found[rows] = start[near] + part * chord[near]
        return found

    def on_triangles(self, points: Floats, panels: Integers) -> tuple[Floats, Integers, Floats]:
        """Nearest places on the fine triangles of panels, one a point; with the triangles and the corners' weights."""
        mesh = self._placed.mesh
        triangle, weights = np.empty(len(points), dtype=np.int64), np.empty((len(points), 3))
        for panel, rows in grouped(panels):
            tree, own = self._trees[panel]
            corners = mesh.points[mesh.triangles[own]]
            near, weights[rows] = self._nearest(tree, points[rows], partial(_closest, corners))
            triangle[rows] = own[near]
        places = np.sum(weights[..., np.newaxis] * mesh.points[mesh.triangles[triangle]], axis=1)
        return places, triangle, weights

    def _nearest(self, tree: Any, points: Floats, closest: Closest) -> tuple[Integers, Floats]:
        """Nearest pieces of points, and the weights there: among those whose middles are nearest.

        Where small pieces lie round a point, the middle of a large one that holds it is further away: more are looked
        at where none of those comes close.
        """
        best, weights = np.empty(len(points), dtype=np.int64), np.empty((len(points), 0))
        rows, count = np.arange(len(points)), _NEAREST
        while len(rows):
            near = tree.query(points[rows], min(count, tree.n))[1].reshape(len(rows), -1)
            part, away = closest(points[rows][:, np.newaxis], near)
            first = np.arange(len(rows)), away.argmin(axis=1)
            if not weights.size:
                weights = np.empty((len(points), part.shape[-1]))
            best[rows], weights[rows] = near[first], part[first]
            rows, count = rows[away[first] > _CLOSE * self._reach], 6 * count
            if near.shape[1] == tree.n or count > _MOST_NEAREST:
                break
        return best, weights

    def exact(self, points: Floats, pairs: PanelPairs) -> Floats:
        """Places on all panels that each point is paired with, next to it.

        On one panel that is the foot of the point. On several the least step leads to where the planes that touch them
        meet, again and again (Newton); across a crease that is all but smooth it takes none.
        """
        rows, panels = pairs
        found = points.copy()
        _, triangle, weights = self.on_triangles(points[rows], panels)
        faces = self._placed.faces[triangle]
        places = np.sum(weights[..., np.newaxis] * self._placed.places[triangle], axis=1)
        alone = np.bincount(rows, minlength=len(points))[rows] == 1
        for _ in range(_MEETING_ROUNDS):
            feet, normals, places = self._feet(found[rows], faces, places)
            matrix, right = np.zeros((len(points), 3, 3)), np.zeros((len(points), 3))
            np.add.at(matrix, rows, normals[:, :, np.newaxis] * normals[:, np.newaxis])
            np.add.at(right, rows, normals * dot(feet - found[rows], normals)[:, np.newaxis])
            values, vectors = np.linalg.eigh(matrix)
            inverse = np.where(values > _ALIKE, 1 / np.maximum(values, _ALIKE), 0.0)
            found += np.einsum("nij,nj,nkj,nk->ni", vectors, inverse, vectors, right)
            found[rows[alone]] = feet[alone]
        return found

    def normals_at(self, points: Floats, panels: Integers) -> tuple[Floats, Floats]:
        """Feet of points on panels, one a point, and the unit normals of the fine triangles there."""
        _, triangle, weights = self.on_triangles(points, panels)
        places = np.sum(weights[..., np.newaxis] * self._placed.places[triangle], axis=1)
        return self._feet(points, self._placed.faces[triangle], places)[0], self._normals[triangle]

    def _feet(self, points: Floats, faces: Integers, places: Floats) -> tuple[Floats, Floats, Floats]:
        """Feet of points on faces, unit normals and parameters there (Gauss and Newton, from parameters nearby)."""
        low, high = np.moveaxis(self._domains[faces], 1, 0)
        # Differences are taken towards the middle, for beyond its border a surface may have no places.
        steps = _STEP * self._extent[faces] * np.where(places > self._middle[faces], -1.0, 1.0)
        for _ in range(_FOOT_ROUNDS):
            found = self._surfaces.evaluated(faces, places)[0]
            along = [
                (self._surfaces.evaluated(faces, places + steps * axis)[0] - found) / (steps @ axis)[:, np.newaxis]
                for axis in np.eye(2)
            ]
            away = points - found
            a, b, c = dot(along[0], along[0]), dot(along[0], along[1]), dot(along[1], along[1])
            p, q = dot(along[0], away), dot(along[1], away)
            area = np.maximum(a * c - b * b, np.finfo(float).tiny)
            places = places + np.stack([(c * p - b * q) / area, (a * q - b * p) / area], axis=1)
            places = np.fmin(np.fmax(places, low), high)
        found, normals = self._surfaces.evaluated(faces, places)
        return found, unit(normals), places


def _closest(corners: Floats, points: Floats, own: Integers) -> tuple[Floats, Floats]:
    """Weights at the places nearest to points (n, 1, 3) on triangles (m, 3, 3) of these (n, k), and how far off."""
    corners = corners[own]
    a, b, c = np.moveaxis(corners, -2, 0)
    ab, ac, away = b - a, c - a, points - a
    aa, bb, cc, x, y = dot(ab, ab), dot(ab, ac), dot(ac, ac), dot(away, ab), dot(away, ac)
    area = np.maximum(aa * cc - bb * bb, np.finfo(float).tiny)
    v, w = (cc * x - bb * y) / area, (aa * y - bb * x) / area
    inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    best, weights = np.full(v.shape, np.inf), np.stack([1 - v - w, v, w], axis=-1)
    for start, end, first, second in ((a, b, 0, 1), (b, c, 1, 2), (c, a, 2, 0)):
        side = end - start
        along = np.clip(dot(points - start, side) / np.maximum(dot(side, side), np.finfo(float).tiny), 0, 1)
        off = points - start - along[..., np.newaxis] * side
        nearer = ~inside & (dot(off, off) < best)
        best = np.where(nearer, dot(off, off), best)
        part = np.zeros_like(weights)
        part[..., first], part[..., second] = 1 - along, along
        weights = np.where(nearer[..., np.newaxis], part, weights)
    off = np.sum(weights[..., np.newaxis] * corners, axis=-2) - points
    return weights, np.linalg.norm(off, axis=-1)


def _along(starts: Floats, chords: Floats, points: Floats, own: Integers) -> tuple[Floats, Floats]:
    """Parts (n, k, 1) of chords (m, 3) at the places nearest to points (n, 1, 3), and how far off."""
    start, chord = starts[own], chords[own]
    part = np.clip(dot(points - start, chord) / np.maximum(dot(chord, chord), np.finfo(float).tiny), 0, 1)
    part = part[..., np.newaxis]
    return part, np.linalg.norm(start + part * chord - points, axis=-1)

"""Even triangles on exact panels: long sides parted, short ones taken out, others turned, vertices evened out.

As of Botsch and Kobbelt, A Remeshing Approach to Multiresolution Modeling (2004), with all changes that do not meet
made at once, for any number of triangles at a side, and with creases and their corners kept.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import numbered_groups, unit
from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.mesh.tetrahedra.exact import ExactPanels, PanelPairs, chosen_sides
from gyroid_cad.mesh.tetrahedra.surface import Sides, SurfaceMesh, sides_of, triangle_normals, triangle_quality
from gyroid_cad.mesh.triangles.faults import crossing_triangles
from gyroid_cad.wall.distances import tree_of

__all__ = ["Remeshing", "narrow_places", "panels_round"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In parts of the size wanted: sides longer are parted, shorter ones taken out, and none becomes longer by that.
_LONG, _SHORT, _LONGEST = 4 / 3, 0.75, 1.5
# By how much of the distance sizes may grow, and how much larger than a narrow place they are.
_GROWTH, _NARROW = 0.3, 1.5
# The smallest size, in parts of the one wanted.
_SMALLEST = 0.2
_ROUNDS, _MORE_ROUNDS = 5, 3
_PASSES = 30
# Changes in parts of the vertices, so few that no further pass is worth its while.
_FEW = 500
# Cosines that the normal of a triangle may turn by: where a side is taken out or turned, or a vertex moved.
_TURNS, _EXCHANGED, _MOVED = 0.6, 0.8, 0.7
# Of triangles: what a change may leave, whatever was there.
_FAIR, _GOOD = 0.3, 0.4
# Of what quality they had, what triangles keep as vertices are put on the panels.
_SLIM = 0.5
# Of the way to the middle of what is round a vertex.
_STEP = 0.7
# Cosine of the angle between triangles that are all but folded on each other.
_FOLDED = np.cos(np.radians(0.5))


def panels_round(mesh: SurfaceMesh, which: Integers) -> PanelPairs:
    """Rows of some vertices, and the panels that each of these lies on."""
    row = np.full(len(mesh.points), -1)
    row[which] = np.arange(len(which))
    at, panel = row[mesh.triangles.ravel()], np.repeat(mesh.panels, 3)
    count = int(mesh.panels.max(initial=0)) + 1
    rows, panels = np.divmod(np.unique(at[at >= 0] * count + panel[at >= 0]), count)
    return rows, panels


class Remeshing:
    """Triangles on panels that are made even.

    Parameters
    ----------
    exact : ExactPanels
    mesh : SurfaceMesh
        Any triangles of the panels.
    size : float
        Wanted length of the sides, in mm; where panels are narrow they are shorter.

    Attributes
    ----------
    mesh : SurfaceMesh
    """

    def __init__(self, exact: ExactPanels, mesh: SurfaceMesh, size: float) -> None:
        self._exact, self.mesh, self._size = exact, mesh, size
        self._fixed = sides_of(mesh).corners(mesh.points)
        self._sizes = np.full(len(mesh.points), size)
        self._spots = np.empty((0, 3)), np.empty(0)

    def run(self, progress: Progress | None = None) -> None:
        """Make the triangles even."""
        for number in range(_ROUNDS):
            report_progress(progress, "even triangles", number, _ROUNDS)
            self._round()
        report_progress(progress, "even triangles", _ROUNDS, _ROUNDS)

    def refine(self, places: Floats, sizes: Floats) -> None:
        """Make triangles finer round some places, shape (n, 3), in mm, to sizes (n,)."""
        self._spots = np.concatenate([self._spots[0], places]), np.concatenate([self._spots[1], sizes])
        for _ in range(_MORE_ROUNDS):
            self._round()

    def placed(self) -> SurfaceMesh:
        """Triangles with their vertices on the exact faces."""
        moved = np.flatnonzero(~self._fixed)
        points = self._snapped(moved, self.mesh, exactly=True)
        return SurfaceMesh(points, self.mesh.triangles, self.mesh.panels)

    def _round(self) -> None:
        self._resize()
        # Slim triangles that are halved again and again stay slim: sides are turned in between.
        for _ in range(_PASSES):
            if not self._split():
                break
            self._exchange()
            self._exchange()
        for change in (self._collapse, self._exchange):
            for _ in range(_PASSES):
                if change() < 1 + len(self.mesh.points) // _FEW:
                    break
        self._smooth()
        self._smooth()

    def _snapped(self, which: Integers, mesh: SurfaceMesh, exactly: bool = False) -> Floats:
        """Points with some of them put on their panels, or creases: on fine triangles and chords, or exactly."""
        sides, points = sides_of(mesh), mesh.points.copy()
        keys = np.full(len(points), -1)
        for end in (0, 1):
            keys[sides.ends[sides.creases, end]] = sides.keys[sides.creases]
        on_crease = which[keys[which] >= 0]
        points[on_crease] = self._exact.along_creases(points[on_crease], keys[on_crease])
        if exactly:
            points[which] = self._exact.exact(points[which], panels_round(mesh, which))
            return points
        which = which[keys[which] < 0]
        rows, panels = panels_round(mesh, which)
        points[which[rows]] = self._exact.on_triangles(points[which[rows]], panels)[0]
        return points

    def _resize(self) -> None:
        """Sizes wanted at vertices: small where a panel is narrow, round the spots, and growing slowly from there."""
        mesh, sides = self.mesh, sides_of(self.mesh)
        lengths, ends = sides.lengths(mesh.points), sides.ends
        on_creases = sides.on_creases(len(mesh.points)) > 0
        narrow = np.where(sides.creases, self._fixed[ends].all(axis=1), on_creases[ends].all(axis=1))
        sizes, smallest = np.full(len(mesh.points), self._size), _SMALLEST * self._size
        for end in (0, 1):
            np.minimum.at(sizes, ends[narrow, end], np.maximum(_NARROW * lengths[narrow], smallest))
        places, wanted = self._spots
        if len(places):
            away, near = tree_of(places).query(mesh.points, min(8, len(places)))
            away, near = away.reshape(len(sizes), -1), near.reshape(len(sizes), -1)
            grown = wanted[near] + _GROWTH * np.maximum(away - wanted[near], 0)
            sizes = np.minimum(sizes, grown.min(axis=1))
        for _ in range(_PASSES):
            before = sizes.copy()
            for one, other in ((0, 1), (1, 0)):
                np.minimum.at(sizes, ends[:, one], before[ends[:, other]] + _GROWTH * lengths)
        self._sizes = sizes

    def _ratios(self, sides: Sides) -> Floats:
        return np.asarray(sides.lengths(self.mesh.points) / self._sizes[sides.ends].mean(axis=1))

    def _split(self) -> int:
        """Part long sides, the longest of each triangle."""
        mesh, sides = self.mesh, sides_of(self.mesh)
        ratios = self._ratios(sides)
        rows, best, number = chosen_sides(np.where(ratios > _LONG, ratios, 0.0)[sides.of], sides.of, sides.uses)
        if not len(rows):
            return 0
        corner, chosen = best[rows], sides.ends[number >= 0]
        a, b, c = (mesh.triangles[rows, (corner + k) % 3] for k in range(3))
        new = number[sides.of[rows, corner]] + len(mesh.points)
        kept = np.ones(len(mesh.triangles), dtype=bool)
        kept[rows] = False
        halves = np.stack([a, new, c], axis=1), np.stack([new, b, c], axis=1)
        triangles = np.concatenate([mesh.triangles[kept], *halves])
        panels = np.concatenate([mesh.panels[kept], mesh.panels[rows], mesh.panels[rows]])
        first = len(mesh.points)
        points = np.concatenate([mesh.points, mesh.points[chosen].mean(axis=1)])
        self._sizes = np.concatenate([self._sizes, self._sizes[chosen].mean(axis=1)])
        self._fixed = np.concatenate([self._fixed, np.zeros(len(chosen), dtype=bool)])
        mesh = SurfaceMesh(points, triangles, panels)
        placed = self._snapped(np.arange(first, len(points)), mesh)
        # Beside a crease that bends inwards the nearest place may be on it, and the triangles there flat.
        made = triangles[kept.sum() :]
        straight = unit(triangle_normals(points, made))
        turned = np.sum(unit(triangle_normals(placed, made)) * straight, axis=1) < _TURNS
        bad = turned | (triangle_quality(placed, made) < _SLIM * triangle_quality(points, made))
        back = made[bad][made[bad] >= first]
        placed[back] = points[back]
        self.mesh = SurfaceMesh(placed, triangles, panels)
        return len(chosen)

    def _collapse(self) -> int:
        """Take short sides out, one end of each put on the other."""
        mesh, sides = self.mesh, sides_of(self.mesh)
        count, ratios = len(mesh.points), self._ratios(sides)
        short = np.flatnonzero(ratios < _SHORT)
        side = np.concatenate([short, short])
        gone, left = np.concatenate([sides.ends[short], sides.ends[short, ::-1]]).T
        on_creases = sides.on_creases(count) > 0
        allowed = ~self._fixed[gone] & (~on_creases[gone] | sides.creases[side])
        allowed &= _common_neighbours(sides.ends, count, gone, left) == sides.uses[side]
        side, gone, left = side[allowed], gone[allowed], left[allowed]
        allowed = self._stays_fair(gone, left)
        side, gone, left = side[allowed], gone[allowed], left[allowed]
        if not len(side):
            return 0
        rank = np.empty(len(side), dtype=np.int64)
        rank[np.argsort(ratios[side], kind="stable")] = np.arange(len(side))
        first = np.full(count, len(side))
        np.minimum.at(first, gone, rank)
        np.minimum.at(first, left, rank)
        for _ in range(2):
            before = first.copy()
            for one, other in ((0, 1), (1, 0)):
                np.minimum.at(first, sides.ends[:, one], before[sides.ends[:, other]])
        chosen = (first[gone] == rank) & (first[left] == rank)
        into = np.arange(count)
        into[gone[chosen]] = left[chosen]
        triangles = into[mesh.triangles]
        kept = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
        used = into == np.arange(count)
        number = np.cumsum(used) - 1
        self.mesh = SurfaceMesh(mesh.points[used], number[triangles[kept]], mesh.panels[kept])
        self._sizes, self._fixed = self._sizes[used], self._fixed[used]
        return int(chosen.sum())

    def _stays_fair(self, gone: Integers, left: Integers) -> Booleans:
        """Tell which vertices can be put on which others: no triangle turns over, becomes flat, long, or one twice."""
        points, triangles = self.mesh.points, self.mesh.triangles
        order = np.argsort(triangles.ravel(), kind="stable")
        first = np.searchsorted(triangles.ravel()[order], np.arange(len(points) + 1))
        which, index = numbered_groups(first[gone + 1] - first[gone])
        old = triangles[order[first[gone][which] + index] // 3]
        stays = ~np.any(old == left[which, np.newaxis], axis=1)
        which, old = which[stays], old[stays]
        new = np.where(old == gone[which, np.newaxis], left[which, np.newaxis], old)
        before, after = unit(triangle_normals(points, old)), unit(triangle_normals(points, new))
        bad = np.sum(before * after, axis=1) < _TURNS
        bad |= np.isin(_names(new, len(points)), _names(triangles, len(points)))
        longest = np.linalg.norm(points[new] - np.roll(points[new], 1, axis=1), axis=-1).max(axis=1)
        bad |= longest > _LONGEST * self._sizes[left[which]]
        worst, worse = np.full((2, len(gone)), np.inf)
        np.minimum.at(worst, which, triangle_quality(points, old))
        np.minimum.at(worse, which, triangle_quality(points, new))
        fair = (np.bincount(which[bad], minlength=len(gone)) == 0) & ((worse > _FAIR) | (worse > worst))
        return np.asarray(fair)

    def _exchange(self) -> int:
        """Turn sides between two triangles of a panel where both become better."""
        mesh, sides = self.mesh, sides_of(self.mesh)
        points, triangles, count = mesh.points, mesh.triangles, len(mesh.points)
        order = np.argsort(sides.of.ravel(), kind="stable")
        start = (np.cumsum(sides.uses) - sides.uses)[~sides.creases]
        (one, k), (other, m) = np.divmod(order[start], 3), np.divmod(order[start + 1], 3)
        a, b, c = (triangles[one, (k + step) % 3] for step in range(3))
        d = triangles[other, (m + 2) % 3]
        pair = np.stack([np.stack([a, d, c], axis=1), np.stack([d, b, c], axis=1)])
        before = np.minimum(triangle_quality(points, triangles[one]), triangle_quality(points, triangles[other]))
        after = np.minimum(*(triangle_quality(points, new) for new in pair))
        mean = unit(triangle_normals(points, triangles[one]) + triangle_normals(points, triangles[other]))
        turned = np.minimum(*(np.sum(unit(triangle_normals(points, new)) * mean, axis=1) for new in pair))
        key = np.minimum(c, d) * count + np.maximum(c, d)
        known = np.isin(key, sides.ends[:, 0] * count + sides.ends[:, 1])
        better = np.flatnonzero((after > 1.02 * before + 1e-3) & (turned > _EXCHANGED) & ~known & (c != d))
        better = better[np.argsort((before - after)[better], kind="stable")]
        better = better[np.sort(np.unique(key[better], return_index=True)[1])]
        rank, first = np.arange(len(better)), np.full(len(triangles), len(better))
        for some in (one, other):
            np.minimum.at(first, some[better], rank)
        chosen = better[(first[one[better]] == rank) & (first[other[better]] == rank)]
        triangles = triangles.copy()
        triangles[one[chosen]], triangles[other[chosen]] = pair[0, chosen], pair[1, chosen]
        self.mesh = SurfaceMesh(points, triangles, mesh.panels)
        return len(chosen)

    def _smooth(self) -> None:
        """Move vertices towards the middle of what is round them, and back where a triangle suffers."""
        mesh, old = self.mesh, self.mesh.points
        triangles, moved = mesh.triangles, np.flatnonzero(~self._fixed)
        points = old.copy()
        points[moved] += _STEP * (self._middles() - old)[moved]
        points = self._snapped(moved, SurfaceMesh(points, triangles, mesh.panels))
        far = np.linalg.norm(points - old, axis=1) > self._sizes / 2
        points[far] = old[far]
        normals, before = unit(triangle_normals(old, triangles)), triangle_quality(old, triangles)
        worst = np.full(len(old), np.inf)
        for corner in range(3):
            np.minimum.at(worst, triangles[:, corner], before)
        around = worst[triangles].min(axis=1)
        for _ in range(_PASSES):
            quality = triangle_quality(points, triangles)
            turned = np.sum(unit(triangle_normals(points, triangles)) * normals, axis=1) < _MOVED
            bad = turned | ((quality < _GOOD) & (quality < around))
            if not bad.any():
                break
            back = np.unique(triangles[bad])
            points[back] = old[back]
        self.mesh = SurfaceMesh(points, triangles, mesh.panels)

    def _middles(self) -> Floats:
        """Middle of the triangles round each vertex, by their areas in parts of the size; on creases of the sides."""
        mesh, sides, sizes = self.mesh, sides_of(self.mesh), self._sizes
        points, triangles = mesh.points, mesh.triangles
        weight = np.linalg.norm(triangle_normals(points, triangles), axis=1) / sizes[triangles].mean(axis=1) ** 2
        middle, total = np.zeros((len(points), 4)), points[triangles].mean(axis=1)
        for corner in range(3):
            np.add.at(middle, triangles[:, corner], np.column_stack([weight[:, np.newaxis] * total, weight]))
        ends = sides.ends[sides.creases]
        weight = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1) / sizes[ends].mean(axis=1)
        middle[np.unique(ends)] = 0
        total = points[ends].mean(axis=1)
        for end in (0, 1):
            np.add.at(middle, ends[:, end], np.column_stack([weight[:, np.newaxis] * total, weight]))
        return np.asarray(middle[:, :3] / np.maximum(middle[:, 3:], np.finfo(float).tiny))


def narrow_places(mesh: SurfaceMesh) -> tuple[Floats, Floats]:
    """Middles of triangles that cross others or are folded on them, and the mean lengths of their sides."""
    points, triangles, sides = mesh.points, mesh.triangles, sides_of(mesh)
    bad = [np.unique(crossing_triangles(points, triangles, 0.0)[0])]
    order = np.argsort(sides.of.ravel(), kind="stable")
    use, group = (
        order[np.repeat(sides.creases, sides.uses)],
        np.repeat(sides.creases.nonzero()[0], sides.uses[sides.creases]),
    )
    triangle, corner = np.divmod(use, 3)
    start, tip = (points[triangles[triangle, (corner + step) % 3]] for step in (0, 2))
    along = unit(points[sides.ends[group, 1]] - points[sides.ends[group, 0]])
    away = tip - start
    away = unit(away - np.sum(away * along, axis=1, keepdims=True) * along)
    for step in range(1, int(sides.uses.max(initial=1))):
        same = np.flatnonzero(group[step:] == group[:-step])
        folded = np.sum(away[same] * away[same + step], axis=1) > _FOLDED
        bad += [triangle[same[folded]], triangle[same[folded] + step]]
    some = np.unique(np.concatenate(bad))
    corners = points[triangles[some]]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).mean(axis=1)
    return corners.mean(axis=1), lengths


def _common_neighbours(ends: Integers, count: int, one: Integers, other: Integers) -> Integers:
    """Number of vertices that are joined to both of two, for each pair."""
    both = np.concatenate([ends, ends[:, ::-1]])
    both = both[np.lexsort([both[:, 1], both[:, 0]])]
    first, keys = np.searchsorted(both[:, 0], np.arange(count + 1)), both[:, 0] * count + both[:, 1]
    pair, index = numbered_groups(first[one + 1] - first[one])
    third = both[first[one][pair] + index, 1]
    return np.bincount(pair[np.isin(other[pair] * count + third, keys)], minlength=len(one))


def _names(triangles: Integers, count: int) -> Integers:
    """A number of each triangle that does not depend on where it begins."""
    a, b, c = np.sort(triangles, axis=1).T
    return np.asarray((a * count + b) * count + c)

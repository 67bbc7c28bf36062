"""Self-intersection of graded walls: local, beyond their own curvature, and global, with the walls opposite.

The kernel's check says "valid" to a wall that meets itself, so this is decided here, on the exact wall, before
anything is fitted. That the map turns nothing inside out is seen to by :mod:`gyroid_cad.wall.grading`, wherever it
is evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.errors import SelfIntersectionError
from gyroid_cad.fields.field import given_as
from gyroid_cad.nurbs.surface import first_fold, grid_derivatives, layer_areas
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.exact import differentiation_matrix, interpolation_matrix, offset_patches, sampled_point
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall

__all__ = ["CLEARANCE_SAMPLES", "FOLD_SAMPLES", "require_simple", "require_simple_fit"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Along each side of a patch, denser towards its border: every L/23 and L/12 at most. Odd, so that the centre of the
# patch, where it curves most, is among them; the second are every other one of the first.
FOLD_SAMPLES = 17
CLEARANCE_SAMPLES = 9
# Patches this near to folding are looked at again, on a grid this fine.
_NEAR_FOLDING, _FINE_SAMPLES = 1.25, 65
# Parts of the half wall at which a wall that reaches past another is looked for.
_ALONG_THE_WALL = np.arange(1, 8) / 8
_COMPARED = 12
# In steps between samples: borders are not straight, and what lies beside a border is not over the patch.
_WITHIN_BORDER = 0.3
# Two sheets that cross do so at more than this slope somewhere; side by side in one plane they do not.
_LEAST_SLOPE = 0.3
_FOLDS = "where the wall folds over its own curvature"
_MEETS = "where the wall meets the one opposite"
_CROSSES = "where the map carries two sheets through each other, whatever their thickness"
_PATCHES_AT_ONCE = 64


@dataclass(frozen=True, slots=True)
class _Worst:
    """Place where the wall would have to be scaled most to pass, and the factor."""

    factor: float
    patch: int
    index: int
    samples: Floats
    reason: str


def require_simple(complex: CellComplex, grading: Grading) -> None:
    """Refuse a wall thicker than its curvature lets it be, or that meets another across a pore or elsewhere.

    Laid off by s times its half thickness the mid-surface's area vector along the wall is a quadratic in s; the
    face folds over where that reaches zero for an s from -1 to 1. This is checked at 17 x 17 places a patch, and at
    65 x 65 of patches that come near it. At 9 x 9 of the places the points of both faces are looked up among
    those of all mid-surfaces: none may lie in, or beyond, the wall of a patch it faces or of one that is no neighbour.

    Where no map carries the surface it is enough that the wall is nowhere thicker than a constant one may be: the
    normals that reach through that one do not meet, so those of a thinner one, however it varies, do not either.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading

    Raises
    ------
    ParameterError
        If a field or the map is no good somewhere.
    SelfIntersectionError
        Naming the place that is furthest from sound, what is there, and what would pass.
    """
    nodes = -np.cos(np.pi * np.arange(FOLD_SAMPLES) / (FOLD_SAMPLES - 1))
    if grading.cells_alike:
        limit = grading.surface.tube.max_thickness * grading.cell_size
        if all(np.all(np.abs(fitted.thickness) < limit) for _, fitted in offset_patches(complex, grading, nodes)):
            return
    middles, halves, found = [], [], []
    for some, fitted in offset_patches(complex, grading, nodes):
        shape = (-1, FOLD_SAMPLES, FOLD_SAMPLES)
        middle, normal = fitted.points.reshape(*shape, 3), fitted.normals.reshape(*shape, 3)
        reach = (fitted.thickness / 2).reshape(shape)[..., np.newaxis]
        found.append(_nearest_to_folding(grading, nodes, middle, normal, reach, some.start))
        middles.append(middle[:, ::2, ::2].reshape(-1, 3))
        halves.append((reach * normal)[:, ::2, ::2].reshape(-1, 3))
    meeting = _meeting(complex, grading, nodes[::2], np.concatenate(middles), np.concatenate(halves))
    worst = min([*found, *meeting], key=lambda place: place.factor)
    if not worst.factor > 1:
        raise _too_thick(complex, grading, worst)


def _nearest_to_folding(
    grading: Grading, nodes: Floats, middle: Floats, normal: Floats, reach: Floats, first: int
) -> _Worst:
    """The place of some patches where the wall comes nearest to folding over."""
    factor = _where_wanted(grading, *_exact_fold_factor(nodes, nodes, middle, normal, reach))
    patch = int(np.argmin(factor.min(axis=1)))
    worst = _Worst(float(factor[patch].min()), first + patch, int(np.argmin(factor[patch])), nodes, _FOLDS)
    near = np.flatnonzero(factor.min(axis=1) < _NEAR_FOLDING)
    fine = np.linspace(-1, 1, _FINE_SAMPLES)
    for patch in near.tolist():
        # One patch at a time: they are few, and 65 x 65 places are many.
        few = (a[patch : patch + 1] for a in (middle, normal, reach))
        closer = _where_wanted(grading, *_exact_fold_factor(nodes, fine, *few))[0]
        index = int(np.argmin(closer))
        if closer[index] < worst.factor:
            worst = _Worst(float(closer[index]), first + patch, index, fine, _FOLDS)
    return worst


def _where_wanted(grading: Grading, factor: Floats, middle: Floats, half: Floats) -> Floats:
    """Factors of patches on a grid, infinite where they fail and no wall is wanted; shape (patches, m * m)."""
    if grading.extent is None:
        return factor.reshape(len(factor), -1)
    bad = grading.wanted(factor.ravel() <= 1, middle.reshape(-1, 3), np.linalg.norm(half, axis=-1).ravel())
    return np.where((factor.ravel() > 1) | bad, factor.ravel(), np.inf).reshape(len(factor), -1)


def _exact_fold_factor(
    nodes: Floats, places: Floats, middle: Floats, normal: Floats, reach: Floats
) -> tuple[Floats, Floats, Floats]:
    """Fold factors at a grid of places, the places and half walls, from the polynomials through values at the nodes."""
    values, rate = interpolation_matrix(nodes, places), differentiation_matrix(nodes)
    slope = values @ rate

    def at_places(along_u: Floats, along_v: Floats, samples: Floats) -> Floats:
        count, components = len(samples), samples.shape[-1]
        wide = along_u @ samples.reshape(count, len(nodes), -1)
        return np.asarray(along_v @ wide.reshape(count, len(places), len(nodes), components))

    # How the thickness itself changes moves the faces along the normal only: it has no part in this.
    half = at_places(values, values, reach)
    middle_u, normal_u = (at_places(slope, values, a) for a in (middle, normal))
    middle_v, normal_v = (at_places(values, slope, a) for a in (middle, normal))
    through = at_places(values, values, normal)
    factor = first_fold(*layer_areas((middle_u, middle_v), (half * normal_u, half * normal_v), through))
    return factor, at_places(values, values, middle), half


def require_simple_fit(wall: Wall, grading: Grading) -> None:
    """Refuse a fitted wall that folds over, as one within the fit's error of the limit may.

    Parameters
    ----------
    wall : Wall
        With a net of its own for every patch.
    grading : Grading

    Raises
    ------
    SelfIntersectionError
        As :func:`require_simple` does.
    """
    coarse, fine = (np.linspace(-1, 1, count) for count in (FOLD_SAMPLES, _FINE_SAMPLES))
    reason = f"where the fit with {len(wall.weights)} control points a side folds over"
    worst = _Worst(np.inf, 0, 0, coarse, reason)
    for first in range(0, len(wall.nets), _PATCHES_AT_ONCE):
        some = slice(first, first + _PATCHES_AT_ONCE)
        factor = _where_wanted(grading, *_fitted_fold_factor(wall, some, coarse))
        for patch in (first + np.flatnonzero(factor.min(axis=1) < _NEAR_FOLDING)).tolist():
            closer = _where_wanted(grading, *_fitted_fold_factor(wall, slice(patch, patch + 1), fine))[0]
            if closer.min() < worst.factor:
                worst = _Worst(float(closer.min()), patch, int(np.argmin(closer)), fine, reason)
    if not worst.factor > 1:
        raise _too_thick(wall.complex, grading, worst)


def _fitted_fold_factor(wall: Wall, some: slice, samples: Floats) -> tuple[Floats, Floats, Floats]:
    """Fold factors of some fitted patches at a grid of samples; the places, and half walls."""
    knots = (wall.knots, wall.knots)
    below, above = np.moveaxis(wall.nets[some], 1, 0)
    middle, middle_u, middle_v = grid_derivatives((above + below) / 2, wall.weights, knots, samples, samples)
    half, half_u, half_v = grid_derivatives((above - below) / 2, wall.weights, knots, samples, samples)
    # Beyond an extent the wall may be turned inside out: then this is not the way from face to face.
    through = np.cross(middle_u, middle_v)
    return first_fold(*layer_areas((middle_u, middle_v), (half_u, half_v), through)), middle, half


def _meeting(complex: CellComplex, grading: Grading, samples: Floats, middle: Floats, half: Floats) -> list[_Worst]:
    """Places where walls meet others most, if they do."""
    from scipy.spatial import cKDTree

    patch = np.repeat(np.arange(complex.patch_count), CLEARANCE_SAMPLES**2)
    reach = np.linalg.norm(half, axis=1)
    lookup = _Lookup(cKDTree(middle), middle, half, reach, patch, complex.patch_corners, _grid_steps(middle))
    everywhere = np.arange(len(middle))
    near, crossed = lookup.beside(everywhere)
    if len(crossed):
        return [_Worst(0.0, *divmod(int(crossed[0]), CLEARANCE_SAMPLES**2), samples, _CROSSES)]
    found = [near]
    for side in (-1, 1):
        met, beyond = lookup.met(everywhere, side * half)
        found.append(met)
        found += [lookup.met(beyond, side * part * half[beyond])[0] for part in _ALONG_THE_WALL]
    worst = []
    for places, factors in found:
        wanted = grading.wanted(np.ones(len(places), dtype=bool), middle[places], reach[places])
        where, factor = places[wanted], factors[wanted]
        if len(where):
            place = int(np.argmin(factor))
            at = divmod(int(where[place]), CLEARANCE_SAMPLES**2)
            worst.append(_Worst(float(factor[place]), *at, samples, _MEETS))
    return worst


def _grid_steps(middle: Floats) -> Floats:
    """At every sample, the longer of the two steps to the next samples along u, and along v; shape (n, 2, 3)."""
    grid = middle.reshape(-1, CLEARANCE_SAMPLES, CLEARANCE_SAMPLES, 3)
    steps = []
    for axis in (1, 2):
        between = np.diff(grid, axis=axis)
        edge = np.take(between, [0], axis=axis), np.take(between, [-1], axis=axis)
        before, after = (np.concatenate(pair, axis=axis) for pair in ((edge[0], between), (between, edge[1])))
        longer = np.linalg.norm(before, axis=-1) > np.linalg.norm(after, axis=-1)
        steps.append(np.where(longer[..., np.newaxis], before, after).reshape(-1, 3))
    return np.stack(steps, axis=1)


@dataclass(frozen=True, slots=True)
class _Lookup:
    """Samples of all mid-surfaces, to be found by place."""

    tree: Any
    middle: Floats
    half: Floats
    reach: Floats
    patch: Integers
    corners: Integers
    steps: Floats

    def met(self, samples: Integers, offsets: Floats) -> tuple[tuple[Integers, Floats], Integers]:
        """Samples that, moved by the offsets, lie in other walls, and the factor on both walls that would part them.

        Also those that only come nearer to another mid-surface than to their own: they may have passed its wall.
        """
        places = self.middle[samples] + offsets
        distance, nearest = (np.asarray(found) for found in self.tree.query(places))
        near = distance < np.maximum(self.reach[nearest], np.linalg.norm(offsets, axis=1))
        candidates = np.flatnonzero(near & (self.patch[samples] != self.patch[nearest]))
        first, second = samples[candidates], nearest[candidates]
        across = dot(places[candidates] - self.middle[second], self.half[second])
        facing = dot(offsets[candidates], self.half[second]) * across < 0
        other = facing | ~self._neighbours(first, second)
        inside = other & (distance[candidates] < self.reach[second])
        apart = (self.middle[second] - self.middle[first])[inside]
        side = np.sign(dot(offsets[candidates], self.half[first]))[inside, np.newaxis]
        factor = _meeting_factor(apart, side * self.half[first[inside]], self.reach[second[inside]])
        return (first[inside], factor), first[other & ~inside]

    def beside(self, samples: Integers) -> tuple[tuple[Integers, Floats], Integers]:
        """Samples over a mid-surface that is no neighbour, nearer than both walls reach, and the same factor.

        Walls thinner than the places looked at lie apart would else pass unseen. Also those that the other mid-surface
        parts from one of the places next to them: whatever the walls, these cross.
        """
        nearest = np.asarray(self.tree.query(self.middle[samples], k=min(_COMPARED, len(self.middle)))[1])
        first, second = np.repeat(samples, nearest.shape[1]), nearest.ravel()
        strangers = ~self._neighbours(first, second)
        first, second = first[strangers], second[strangers]
        over, height = self._over(first, second)
        first, second, height = first[over], second[over], height[over]
        factor = np.abs(height) / (self.reach[first] + self.reach[second])
        parted = np.zeros(len(first), dtype=bool)
        for next_to in (-1, 1, -CLEARANCE_SAMPLES, CLEARANCE_SAMPLES):
            other = np.clip(first + next_to, 0, len(self.middle) - 1)
            over, other_height = self._over(other, second)
            rise = np.abs(height - other_height)
            steep = rise > _LEAST_SLOPE * np.linalg.norm(self.middle[first] - self.middle[other], axis=1)
            parted |= over & steep & (self.patch[other] == self.patch[first]) & (height * other_height < 0)
        return (first[factor < 1], factor[factor < 1]), first[parted]

    def _over(self, first: Integers, second: Integers) -> tuple[Booleans, Floats]:
        """Mask of the first samples that stand over the cells round the second ones, and their heights."""
        apart = self.middle[first] - self.middle[second]
        steps = self.steps[second]
        # In steps of the grid, by least squares in the tangent plane.
        products = np.einsum("psc,ptc->pst", steps, steps)
        along = np.linalg.solve(products, np.einsum("psc,pc->ps", steps, apart)[..., np.newaxis])[..., 0]
        height = dot(apart, self.half[second]) / self.reach[second]
        # Beyond its border a patch goes on in its neighbour, or not at all.
        place = np.stack(np.divmod(second % CLEARANCE_SAMPLES**2, CLEARANCE_SAMPLES), axis=1)
        low = np.where(place == 0, _WITHIN_BORDER, -1.0)
        high = np.where(place == CLEARANCE_SAMPLES - 1, -_WITHIN_BORDER, 1.0)
        return np.all((low <= along) & (along <= high), axis=1), height

    def _neighbours(self, first: Integers, second: Integers) -> Booleans:
        """Mask of the sample pairs whose patches share a corner."""
        corners = (self.corners[self.patch[samples]] for samples in (first, second))
        one, other = corners
        return np.asarray((one[:, :, np.newaxis] == other[:, np.newaxis, :]).any(axis=(1, 2)))


def _meeting_factor(apart: Floats, half: Floats, other_reach: Floats) -> Floats:
    """Factor by which two walls are to be scaled so that they just touch.

    It is the least s for which one, up to s half, comes within s other_reach of the other's place on its mid-surface:
    where its tip does, |apart - s half| = s other_reach, unless the tip has passed the place before.
    """
    squared, along, own = dot(apart, apart), dot(apart, half), dot(half, half)
    foot = np.maximum(along / own, 0)
    aside = np.sqrt(np.maximum(squared - foot**2 * own, 0))
    discriminant = along * along - (own - other_reach**2) * squared
    with np.errstate(divide="ignore", invalid="ignore"):
        by_tip = squared / (along + np.sqrt(np.maximum(discriminant, 0)))
    return np.where(aside <= foot * other_reach, by_tip, aside / other_reach)


def _too_thick(complex: CellComplex, grading: Grading, worst: _Worst) -> SelfIntersectionError:
    place = sampled_point(complex, grading.cell_size, worst.samples, worst.patch, worst.index)
    requested = float(grading.requested(np.array([place]))[0])
    if grading.density is None:
        name = given_as("thickness", grading.thickness)
        return SelfIntersectionError(name, requested, place, worst.factor * requested, worst.reason, unit=" mm")
    tube = grading.surface.tube
    limit = tube.density(worst.factor * tube.thickness(requested))
    return SelfIntersectionError(given_as("density", grading.density), requested, place, limit, worst.reason)

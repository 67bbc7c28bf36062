"""Whether a wall that varies can exist: inside its own curvature, and clear of the walls opposite.

The kernel's check says "valid" to a wall that meets itself, so this is decided here, on the exact wall, before
anything is fitted. That the map turns nothing inside out is seen to by :mod:`gyroid_cad.grading`, wherever it
is evaluated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.complex import CellComplex
from gyroid_cad.errors import SoundnessError
from gyroid_cad.exact_wall import differentiation_matrix, laid_patches, sampled_place
from gyroid_cad.grading import Grading
from gyroid_cad.nurbs import grid_derivatives
from gyroid_cad.tube import density_of_thickness, thickness_of_density
from gyroid_cad.wall import Wall

__all__ = ["CLEARANCE_SAMPLES", "FOLD_SAMPLES", "require_sound", "require_sound_fit"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Along each side of a patch, denser towards its border: every L/23 and L/12 at most. Odd, so that the centre of the
# patch, where it curves most, is among them; the second are every other one of the first.
FOLD_SAMPLES = 17
CLEARANCE_SAMPLES = 9
_PATCHES_AT_ONCE = 64


def require_sound(complex: CellComplex, grading: Grading) -> None:
    """Refuse a wall thicker than its curvature lets it be, or that meets another across a pore or elsewhere.

    Laid off by s times its half thickness the mid-surface's area vector along the wall is a quadratic in s; the
    face folds over where that reaches zero for an s from -1 to 1. This is checked at 17 x 17 places a patch. At 9 x 9
    of them the points of both faces are looked up among those of all mid-surfaces: none may lie in the wall of a
    patch it faces, or of one that is no neighbour.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading

    Raises
    ------
    ParameterError
        If a field or the map is no good somewhere.
    SoundnessError
        Naming the place that is furthest from sound, what is there, and what would pass.
    """
    samples = -np.cos(np.pi * np.arange(FOLD_SAMPLES) / (FOLD_SAMPLES - 1))
    rate = differentiation_matrix(samples)
    middles, halves = [], []
    least, worst = np.inf, 0
    for some, laid in laid_patches(complex, grading, samples):
        shape = (-1, FOLD_SAMPLES, FOLD_SAMPLES, 3)
        middle, normal = laid.points.reshape(shape), laid.normals.reshape(shape)
        reach = (laid.thickness / 2).reshape(shape[:3])[..., np.newaxis]
        middle_u, normal_u = (np.einsum("ab,pbvc->pavc", rate, a) for a in (middle, normal))
        middle_v, normal_v = (np.einsum("ab,pubc->puac", rate, a) for a in (middle, normal))
        # How the thickness itself changes moves the faces along the normal only: it has no part in this.
        factor = _fold_factor(normal, middle_u, reach * normal_u, middle_v, reach * normal_v)
        place = int(np.argmin(factor))
        if factor.ravel()[place] < least:
            least, worst = float(factor.ravel()[place]), place + some.start * FOLD_SAMPLES**2
        middles.append(middle[:, ::2, ::2].reshape(-1, 3))
        halves.append((reach * normal)[:, ::2, ::2].reshape(-1, 3))
    if not least > 1:
        raise _too_thick(complex, grading, samples, worst, least, "where the wall folds over its own curvature")
    _require_clear(complex, grading, samples[::2], np.concatenate(middles), np.concatenate(halves))


def require_sound_fit(wall: Wall, grading: Grading) -> None:
    """Refuse a fitted wall that folds over, as one within the fit's error of the limit may.

    Parameters
    ----------
    wall : Wall
        With a net of its own for every patch.
    grading : Grading

    Raises
    ------
    SoundnessError
        As :func:`require_sound` does.
    """
    samples = np.linspace(-1, 1, FOLD_SAMPLES)
    knots = (wall.knots, wall.knots)
    least, worst = np.inf, 0
    for first in range(0, len(wall.nets), _PATCHES_AT_ONCE):
        below, above = np.moveaxis(wall.nets[first : first + _PATCHES_AT_ONCE], 1, 0)
        _, middle_u, middle_v = grid_derivatives((above + below) / 2, wall.weights, knots, samples, samples)
        half, half_u, half_v = grid_derivatives((above - below) / 2, wall.weights, knots, samples, samples)
        factor = _fold_factor(half, middle_u, half_u, middle_v, half_v)
        place = int(np.argmin(factor))
        if factor.ravel()[place] < least:
            least, worst = float(factor.ravel()[place]), place + first * FOLD_SAMPLES**2
    if not least > 1:
        reason = f"where the fit with {len(wall.weights)} control points a side folds over"
        raise _too_thick(wall.complex, grading, samples, worst, least, reason)


def _require_clear(complex: CellComplex, grading: Grading, samples: Floats, middle: Floats, half: Floats) -> None:
    from scipy.spatial import cKDTree

    reach = np.linalg.norm(half, axis=1)
    tree = cKDTree(middle)
    patch = np.repeat(np.arange(complex.patch_count), CLEARANCE_SAMPLES**2)
    least, worst = 1.0, -1
    for side in (-1, 1):
        tips = middle + side * half
        distance, nearest = (np.asarray(found) for found in tree.query(tips))
        inside = np.flatnonzero((distance < reach[nearest]) & (patch != patch[nearest]))
        other = nearest[inside]
        across = _dot(tips[inside] - middle[other], half[other])
        facing = side * _dot(half[inside], half[other]) * across < 0
        met = facing | ~_neighbours(complex.patch_corners, patch[inside], patch[other])
        inside, other = inside[met], other[met]
        if len(inside):
            factor = _meeting_factor(middle[other] - middle[inside], side * half[inside], reach[other])
            place = int(np.argmin(factor))
            if factor[place] < least:
                least, worst = float(factor[place]), int(inside[place])
    if worst >= 0:
        raise _too_thick(complex, grading, samples, worst, least, "where the wall meets the one opposite")


def _fold_factor(through: Floats, middle_u: Floats, half_u: Floats, middle_v: Floats, half_v: Floats) -> Floats:
    """Smallest |s| at which the area vector (M_u + s H_u) x (M_v + s H_v) has no part through the wall; inf if none."""
    constant = _dot(np.cross(middle_u, middle_v), through)
    linear = _dot(np.cross(middle_u, half_v) + np.cross(half_u, middle_v), through)
    square = _dot(np.cross(half_u, half_v), through)
    discriminant = linear * linear - 4 * constant * square
    with np.errstate(divide="ignore", invalid="ignore"):
        root = 2 * np.abs(constant) / (np.abs(linear) + np.sqrt(discriminant))
    # Where the mid-surface is inside out no thickness is sound.
    return np.where(constant <= 0, 0.0, np.where(discriminant < 0, np.inf, root))


def _meeting_factor(apart: Floats, half: Floats, other_reach: Floats) -> Floats:
    """By what both walls are to be scaled so that the tip of one just touches the other, 0 if they cross anyway.

    Solves |apart - s half| = s other_reach.
    """
    squared, along = _dot(apart, apart), _dot(apart, half)
    discriminant = along * along - (_dot(half, half) - other_reach**2) * squared
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = squared / (along + np.sqrt(np.maximum(discriminant, 0)))
    return np.where((factor > 0) & (factor < 1), factor, 0.0)


def _neighbours(patch_corners: Integers, first: Integers, second: Integers) -> Booleans:
    """Whether patches share a corner."""
    shared = patch_corners[first][:, :, np.newaxis] == patch_corners[second][:, np.newaxis, :]
    return np.asarray(shared.any(axis=(1, 2)))


def _too_thick(
    complex: CellComplex, grading: Grading, samples: Floats, worst: int, factor: float, reason: str
) -> SoundnessError:
    """The error for a sample, by its index among all, that would pass at ``factor`` of its thickness."""
    place = sampled_place(complex, grading.cell_size, samples, *divmod(worst, len(samples) ** 2))
    asked = float(grading.asked(np.array([place]))[0])
    if grading.density is None:
        return SoundnessError("thickness", asked, place, factor * asked, reason, unit=" mm")
    limit = density_of_thickness(factor * thickness_of_density(asked))
    return SoundnessError("density", asked, place, limit, reason)


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.einsum("...c,...c->...", a, b))

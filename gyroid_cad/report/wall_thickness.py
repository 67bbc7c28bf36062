"""Thickness of the fitted wall: measured along the exact normal, from one fitted face to the other, by area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.wall.exact import differentiation_matrix, offset_patches
from gyroid_cad.wall.fitted import FittedWall
from gyroid_cad.wall.offset import SIDES

__all__ = [
    "BINS",
    "Distribution",
    "FaceAreas",
    "WallThickness",
    "distribution_of",
    "exact_areas",
    "fitted_areas",
    "wall_thickness",
]

Floats = NDArray[np.float64]

BINS = 24
# Of quantiles that a distribution tells of.
_QUANTILES = (0.1, 0.5, 0.9)


@dataclass(frozen=True, slots=True, eq=False)
class Distribution:
    """Values and what share of the whole has them.

    Attributes
    ----------
    smallest, mean, largest : float
    tenth, median, ninetieth : float
        Below which lie 10, 50 and 90 percent of the whole.
    edges : ndarray, shape (bins + 1,)
        From the smallest value to the largest.
    shares : ndarray, shape (bins,)
        Of the whole, by bin; their sum is 1.
    """

    smallest: float
    mean: float
    largest: float
    tenth: float
    median: float
    ninetieth: float
    edges: Floats
    shares: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def as_dict(self) -> dict[str, Any]:
        """As plain values, ready for JSON."""
        values = {name: getattr(self, name) for name in self.__slots__}
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}


def distribution_of(values: ArrayLike, weights: ArrayLike | None = None, bins: int = BINS) -> Distribution:
    """The distribution of some values.

    Parameters
    ----------
    values : array_like
    weights : array_like, optional
        How much of the whole each value stands for; all the same if left out.
    bins : int

    Raises
    ------
    ParameterError
        If there are no values.
    """
    x = np.ravel(np.asarray(values, dtype=float))
    if not len(x):
        raise ParameterError("values", "none", "one value or more")
    w = np.full(len(x), 1.0) if weights is None else np.ravel(np.asarray(weights, dtype=float))
    order = np.argsort(x)
    x, w = x[order], w[order] / w.sum()
    # Half of each value's own share lies below it.
    below = np.cumsum(w) - w / 2
    tenth, median, ninetieth = np.interp(_QUANTILES, below, x).tolist()
    shares, edges = np.histogram(x, bins=bins, range=_range(float(x[0]), float(x[-1])), weights=w)
    return Distribution(float(x[0]), float(w @ x), float(x[-1]), tenth, median, ninetieth, edges, shares)


def _range(low: float, high: float) -> tuple[float, float]:
    """Range of a histogram: one of equal values has some width too."""
    # Bins must be told apart in double precision.
    least = 1e-12 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > least else (low - least, high + least)


Integers = NDArray[np.int64]

# Gauss points along each side of a patch: of what is integrated exactly, and of what is counted, so many in all.
_QUADRATURE_POINTS = 16
_FEWEST_MEASURED, _MOST_MEASURED, _MEASURED = 8, 48, 200_000
# In mm to micrometres.
_MICRO = 1e3


@dataclass(frozen=True, slots=True)
class WallThickness:
    """The wall as fitted.

    Attributes
    ----------
    thickness : Distribution
        In mm, by area of the mid-surface.
    error : Distribution
        The wall less the wall asked for, in micrometres, by area of the mid-surface.
    """

    thickness: Distribution
    error: Distribution


@dataclass(frozen=True, slots=True)
class FaceAreas:
    """Areas in mm2 of surfaces of a wall.

    Attributes
    ----------
    face_a, face_b : float
        Towards the network that the common normal points to, and towards the other.
    """

    face_a: float
    face_b: float


def wall_thickness(fitted: FittedWall) -> WallThickness:
    """Measure the wall along the normals of the exact mid-surface, to where they meet the two fitted faces.

    Each face is taken for its tangent plane at the same parameters, less than the fit's own deviation away: what that
    leaves out goes with the square of the deviation. A lattice cut to its block is measured inside it.

    Parameters
    ----------
    fitted : FittedWall

    Returns
    -------
    WallThickness
    """
    grading, wall = fitted.spec.grading, fitted.wall
    patches = _told_apart(fitted)
    along = int(np.clip(np.sqrt(_MEASURED / len(patches)), _FEWEST_MEASURED, _MOST_MEASURED))
    nodes, gauss = np.polynomial.legendre.leggauss(along)
    rate, shape = differentiation_matrix(nodes), (-1, along, along)
    walls, requested, weights = [], [], []
    for some, exact in offset_patches(fitted.complex, grading, nodes, patches):
        chosen = patches[some]
        faces = grid_derivatives(
            wall.nets[wall.patch_net[chosen]], wall.weights, (wall.knots, wall.knots), nodes, nodes
        )
        normal = exact.normals.reshape(*shape, 3)
        place = exact.points.reshape(*shape, 3) - wall.shifts[wall.patch_shift[chosen]][:, np.newaxis, np.newaxis]
        off = faces[0] - place[:, np.newaxis]
        outwards = np.cross(faces[1], faces[2])
        met = dot(off, outwards) / dot(outwards, normal[:, np.newaxis])
        middle = exact.points.reshape(*shape, 3)
        along_u, along_v = np.einsum("ab,pbvc->pavc", rate, middle), np.einsum("ab,pubc->puac", rate, middle)
        area = np.linalg.norm(np.cross(along_u, along_v), axis=-1) * np.outer(gauss, gauss)
        if fitted.spec.trimmed and not grading.uniform:
            size = np.array(fitted.spec.cells) * grading.cell_size
            area = np.where(np.all((middle >= 0) & (middle <= size), axis=-1), area, 0.0)
        walls.append((met[:, 1] - met[:, 0]).ravel())
        requested.append(exact.thickness)
        weights.append(area.ravel())
    thickness, wanted, weight = (np.concatenate(parts) for parts in (walls, requested, weights))
    counted = weight > 0
    return WallThickness(
        distribution_of(thickness[counted], weight[counted]),
        distribution_of((thickness - wanted)[counted] * _MICRO, weight[counted]),
    )


def exact_areas(fitted: FittedWall) -> FaceAreas:
    """Areas of the exact wall's faces, by quadrature; patches are analytic, so it converges faster than any power."""
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    rate, shape = differentiation_matrix(nodes), (-1, len(nodes), len(nodes), 3)
    patches = _told_apart(fitted)
    uses = _uses(fitted, patches)
    totals = np.zeros(2)
    for some, exact in offset_patches(fitted.complex, fitted.spec.grading, nodes, patches):
        offset = exact.normals * (exact.thickness / 2)[:, np.newaxis]
        for side in SIDES:
            face = (exact.points + (2 * side - 1) * offset).reshape(shape)
            along_u, along_v = np.einsum("ab,pbvc->pavc", rate, face), np.einsum("ab,pubc->puac", rate, face)
            area = np.linalg.norm(np.cross(along_u, along_v), axis=-1)
            totals[side] += float(np.einsum("p,u,v,puv->", uses[some], weights, weights, area))
    return FaceAreas(face_a=float(totals[1]), face_b=float(totals[0]))


def fitted_areas(fitted: FittedWall) -> tuple[FaceAreas, float]:
    """Areas of the fitted faces, and of the free side walls that close the lattice's rim, in mm2, by quadrature."""
    wall, complex = fitted.wall, fitted.complex
    u, v, weights = wall.face(0, 0).quadrature()
    uses = np.bincount(wall.patch_net, minlength=len(wall.nets))
    totals = np.zeros(2)
    for first in range(0, len(wall.nets), 64):
        some = slice(first, first + 64)
        _, du, dv = grid_derivatives(wall.nets[some], wall.weights, (wall.knots, wall.knots), u.ravel(), v.ravel())
        area = np.linalg.norm(np.cross(du, dv), axis=-1)
        totals += np.einsum("p,uv,psuv->s", uses[some], weights, area)
    patches = complex.edge_patches[complex.free, 0]
    edges = np.argmax(complex.patch_edges[patches] == np.flatnonzero(complex.free)[:, np.newaxis], axis=1)
    kinds, counts = np.unique(np.stack([wall.patch_net[patches], edges]), axis=1, return_counts=True)
    rim = sum(
        count * _area_of_side_wall(fitted, net, edge)
        for (net, edge), count in zip(kinds.T.tolist(), counts.tolist(), strict=True)
    )
    return FaceAreas(face_a=float(totals[1]), face_b=float(totals[0])), float(rim)


def _area_of_side_wall(fitted: FittedWall, net: int, edge: int) -> float:
    surface = fitted.wall.side_wall(net, edge)
    u, v, weights = surface.quadrature()
    both = surface.derivatives(u, v)
    return float(np.sum(weights * np.linalg.norm(np.cross(both[1, 0], both[0, 1]), axis=-1)))


def _told_apart(fitted: FittedWall) -> Integers:
    """One of the patches that are alike."""
    return np.asarray(np.unique(fitted.wall.patch_net, return_index=True)[1], dtype=np.int64)


def _uses(fitted: FittedWall, patches: Integers) -> Integers:
    counts = np.bincount(fitted.wall.patch_net, minlength=len(fitted.wall.nets))
    return np.asarray(counts[fitted.wall.patch_net[patches]])

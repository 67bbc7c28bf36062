"""Thickness of the fitted wall: measured along the exact normal, from one fitted face to the other, by area."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.wall.areas import distinct_patches
from gyroid_cad.wall.distances import met_along_normals
from gyroid_cad.wall.exact import differentiation_matrix, grid_rates, offset_patches
from gyroid_cad.wall.fitted import FittedWall

__all__ = [
    "BINS",
    "Distribution",
    "WallThickness",
    "distribution_of",
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

# Gauss points along each side of a patch, so many in all.
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
    # As the exact surface knows it.
    fitted = fitted.at_home()
    grading, wall = fitted.spec.grading, fitted.wall
    patches, _ = distinct_patches(fitted.wall)
    along = int(np.clip(np.sqrt(_MEASURED / len(patches)), _FEWEST_MEASURED, _MOST_MEASURED))
    nodes, gauss = np.polynomial.legendre.leggauss(along)
    rate, shape = differentiation_matrix(nodes), (-1, along, along)
    walls, requested, weights = [], [], []
    for some, exact in offset_patches(fitted.complex, grading, nodes, patches):
        chosen = patches[some]
        shifts = wall.shifts[wall.patch_shift[chosen]][:, np.newaxis, np.newaxis, np.newaxis]
        nets = wall.nets[wall.patch_net[chosen]] + shifts
        met = met_along_normals(nets, wall.weights, wall.knots, nodes, exact)[0]
        middle = exact.points.reshape(*shape, 3)
        area = np.linalg.norm(np.cross(*grid_rates(rate, middle)), axis=-1) * np.outer(gauss, gauss)
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

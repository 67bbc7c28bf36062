"""How values are distributed: a histogram with weights, its extremes, mean and quantiles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.errors import ParameterError

__all__ = ["BINS", "Distribution", "distribution_of"]

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
    """Of a histogram: one of values that are all alike has some width too."""
    # Bins must be told apart in double precision.
    least = 1e-12 * max(abs(low), abs(high), 1.0)
    return (low, high) if high - low > least else (low - least, high + least)

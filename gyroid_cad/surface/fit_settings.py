"""How the patch is fitted: control points, knots, weights, parameterisation; ours and the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.surface import uniform_knots
from gyroid_cad.surface.patch import PARAMETERISATIONS

__all__ = ["DEGREE", "FitSettings", "more_control_points"]

Floats = NDArray[np.float64]

DEGREE = 3
FEWEST_CONTROL_POINTS, MOST_CONTROL_POINTS = 4, 40
# The error of a cubic fit falls with the fourth power of the number of spans; a little more than needed is taken.
_ORDER, _SURPLUS = 4, 1.05


@dataclass(frozen=True, slots=True)
class FitSettings:
    """How the patch is fitted.

    Attributes
    ----------
    control_points : int
        Along each side, 4 to 40.
    knots : tuple of float, optional
        Clamped on [-1, 1], symmetric about 0, control_points + 4 long; evenly spaced if left out.
    weights : tuple of tuples of float, optional
        Positive, control_points x control_points; all 1 if left out.
    parameterisation : {"smooth", "polar"}
        "polar" is the paper's: its cloud of points has no edges of its own, so it is fitted all at once.

    Raises
    ------
    ParameterError
    """

    control_points: int = 10
    knots: tuple[float, ...] | None = None
    weights: tuple[tuple[float, ...], ...] | None = None
    parameterisation: str = "smooth"

    def __post_init__(self) -> None:
        n = self.control_points
        if isinstance(n, bool) or not isinstance(n, int | np.integer):
            raise ParameterError("control_points", n, "a whole number")
        if not FEWEST_CONTROL_POINTS <= n <= MOST_CONTROL_POINTS:
            raise ParameterError("control_points", n, f"{FEWEST_CONTROL_POINTS} to {MOST_CONTROL_POINTS} a side")
        if self.parameterisation not in tuple(PARAMETERISATIONS):
            raise ParameterError("parameterisation", self.parameterisation, " or ".join(PARAMETERISATIONS))
        if self.knots is not None:
            object.__setattr__(self, "knots", _validated_knots(self.knots, n))
        if self.weights is not None:
            object.__setattr__(self, "weights", _validated_weights(self.weights, n))

    @classmethod
    def paper(cls) -> Self:
        """The paper's fit: its polar cloud, the knots of eq. (14), the weights of Fig. 7."""
        inner = (-0.6, -0.4, -0.2, 0.2, 0.4, 0.6)
        weights = np.ones((10, 10))
        weights[3:7, 3:7] = 3 / 2
        weights[4:6, 4:6] = 3 / 4
        weights[np.ix_([0, -1], [0, -1])] = 1 / 4
        rows = tuple(tuple(row) for row in weights.tolist())
        return cls(10, (-1.0,) * 4 + inner + (1.0,) * 4, rows, "polar")

    @property
    def plain(self) -> bool:
        """Whether the knots are evenly spaced and the weights equal, so that the number can change."""
        return self.knots is None and self.weights is None and self.parameterisation == "smooth"

    def knot_vector(self) -> Floats:
        """The knots, evenly spaced where none were given; shape (control_points + 4,)."""
        return uniform_knots(self.control_points, DEGREE) if self.knots is None else np.array(self.knots)

    def weight_net(self) -> Floats:
        """The weights, 1 where none were given; shape (control_points, control_points)."""
        return np.ones((self.control_points,) * 2) if self.weights is None else np.array(self.weights)


def more_control_points(control_points: int, excess: float) -> int:
    """How many to try next, where the error of a fit is ``excess`` times what it may be."""
    wanted = DEGREE + (control_points - DEGREE) * (_SURPLUS * excess) ** (1 / _ORDER)
    return int(min(max(control_points + 1, ceil(wanted)), MOST_CONTROL_POINTS))


def _validated_knots(knots: tuple[float, ...], control_points: int) -> tuple[float, ...]:
    accepted = (
        f"{control_points + DEGREE + 1} non-decreasing numbers, four times -1, four times 1 "
        "and between them distinct ones symmetric about 0"
    )
    try:
        vector = np.array(knots, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError("knots", knots, accepted) from None
    good = (
        vector.shape == (control_points + DEGREE + 1,)
        and np.all(vector[:4] == -1)
        and np.all(vector[-4:] == 1)
        and np.all(np.diff(vector[3:-3]) > 0)
        and np.allclose(vector, -vector[::-1], rtol=0, atol=1e-12)
    )
    if not good:
        raise ParameterError("knots", knots, accepted)
    return tuple(vector.tolist())


def _validated_weights(weights: tuple[tuple[float, ...], ...], control_points: int) -> tuple[tuple[float, ...], ...]:
    accepted = f"{control_points} x {control_points} positive numbers"
    try:
        net = np.array(weights, dtype=float)
    except (TypeError, ValueError):
        raise ParameterError("weights", weights, accepted) from None
    if net.shape != (control_points, control_points) or not np.all(np.isfinite(net) & (net > 0)):
        raise ParameterError("weights", weights, accepted)
    return tuple(tuple(row) for row in net.tolist())

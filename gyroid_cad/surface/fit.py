"""Least-squares fit of the semi-fundamental patch by a NURBS surface: the paper's eqs. (11) to (13).

Points and unit normals are fitted in one basis, so that the faces of a wall of thickness t are the
control nets ``P +- t/2 N``. In the smooth parameterisation an edge's control points depend on nothing but the edge, so
two patches that meet there get the same ones, and tangent planes along it are the exact surface's.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from math import ceil
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.nurbs.basis import uniform_knots
from gyroid_cad.nurbs.surface import NurbsSurface, first_fold, layer_areas
from gyroid_cad.surface.fit_nets import cloud_net, staged_net
from gyroid_cad.surface.patch import (
    EDGE_HALF_TURN,
    PARAMETERISATIONS,
    ROTOINVERSION,
    edge_half_turn_shift,
)
from gyroid_cad.surface.weierstrass import GYROID, Family

__all__ = [
    "DEGREE",
    "FitSettings",
    "FittedPatch",
    "edge_gap",
    "error_within_reach",
    "fit_patch",
    "max_offset",
    "more_control_points",
    "require_shared_edges",
]

Floats = NDArray[np.float64]

DEGREE = 3
FEWEST_CONTROL_POINTS, MOST_CONTROL_POINTS = 4, 40
# The error of a cubic fit falls with the fourth power of the number of spans; a little more than needed is taken.
_ORDER, _SURPLUS = 4, 1.05


@dataclass(frozen=True, slots=True)
class FitSettings:
    """Settings of the patch's fit.

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

    Examples
    --------
    >>> from gyroid_cad import FitSettings
    >>> FitSettings(14).control_points, FitSettings.paper().parameterisation
    (14, 'polar')
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
        """True where knots are evenly spaced and weights equal, so that the number can change."""
        return self.knots is None and self.weights is None and self.parameterisation == "smooth"

    def knot_vector(self) -> Floats:
        """The knots, evenly spaced where none were given; shape (control_points + 4,)."""
        return uniform_knots(self.control_points, DEGREE) if self.knots is None else np.array(self.knots)

    def weight_net(self) -> Floats:
        """The weights, 1 where none were given; shape (control_points, control_points)."""
        return np.ones((self.control_points,) * 2) if self.weights is None else np.array(self.weights)


def error_within_reach(control_points: int, error: float) -> float:
    """About the error of the finest fit, where one of so many control points, six or more, has ``error``."""
    return error * ((control_points - DEGREE) / (MOST_CONTROL_POINTS - DEGREE)) ** _ORDER


def more_control_points(control_points: int, excess: float) -> int:
    """Number of control points to try next, where the error of a fit is ``excess`` times what it may be."""
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


# Edges further apart than this, in units of the cell size, are not one edge: rounding leaves 1e-15.
EDGE_GAP_LIMIT = 1e-12
# Odd, so that the patch's centre, where it curves most, is among them.
_FOLD_SAMPLES = 97
_OURS = FitSettings()
# Lengths here are in bounding-cell lengths a; reports are in cell sizes L = 2 a.
CELL_SIZE = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class FittedPatch:
    """The fitted mid-surface and, in the same basis, its fitted unit normals.

    Attributes
    ----------
    settings : FitSettings
    family : Family
    surface : NurbsSurface
        In units of the bounding-cell length, centred at the origin.
    normals : NurbsSurface
        Same knots and weights; its "points" are unit vectors on the side of dS/du x dS/dv.
    """

    settings: FitSettings
    family: Family
    surface: NurbsSurface
    normals: NurbsSurface

    def offset(self, distance: float) -> NurbsSurface:
        """The parallel surface at ``distance`` along the normal: the control net P + distance N."""
        net = self.surface.control_points + distance * self.normals.control_points
        return NurbsSurface(net, self.surface.weights, self.surface.knots_u, self.surface.knots_v)


@lru_cache(maxsize=32)
def fit_patch(settings: FitSettings = _OURS, family: Family = GYROID) -> FittedPatch:
    """Fit the semi-fundamental patch.

    Parameters
    ----------
    settings : FitSettings
    family : Family

    Returns
    -------
    FittedPatch
    """
    knots, weights = settings.knot_vector(), settings.weight_net()
    fit = cloud_net if settings.parameterisation == "polar" else staged_net
    net = fit(knots, weights, partial(PARAMETERISATIONS[settings.parameterisation], family=family))
    surface, normals = (NurbsSurface(net[..., part], weights, knots, knots) for part in (slice(3), slice(3, 6)))
    return FittedPatch(settings, family, surface, normals)


def edge_gap(fitted: FittedPatch) -> float:
    """Largest distance, in cell sizes, between an edge of the fit and the same edge of its neighbour.

    The neighbour is the patch's image under the half-turn about the normal at the edge's midpoint. It meets the edge
    with one of its own, run backwards; which one depends on the placement, so every pair is compared.
    """
    return _gap(fitted.surface, edge_half_turn_shift(fitted.family)) / CELL_SIZE


@lru_cache(maxsize=32)
def max_offset(fitted: FittedPatch) -> float:
    """Largest offset of the fit to both sides before it folds over, in bounding-cell lengths.

    The exact surface folds at its smallest radius of curvature; the fit a little before. Where it is
    offset by s, its area vector along the normal is a + b s + c s^2; the smallest root over a dense grid counts.
    """
    samples = np.linspace(-1, 1, _FOLD_SAMPLES)
    u, v = samples[:, np.newaxis], samples[np.newaxis]
    surface, normals = fitted.surface.derivatives(u, v), fitted.normals.derivatives(u, v)
    middle, through = ((d[1, 0], d[0, 1]) for d in (surface, normals))
    return float(first_fold(*layer_areas(middle, through, normals[0, 0])).min())


def require_shared_edges(fitted: FittedPatch) -> None:
    """Refuse a fit whose neighbouring patches do not meet.

    Raises
    ------
    FitError
        Saying how far apart the edges are.
    """
    gap = edge_gap(fitted)
    normals_gap = _gap(fitted.normals, np.zeros(3), turned_over=-1.0)
    if max(gap, normals_gap) > EDGE_GAP_LIMIT:
        raise FitError(
            f"the edges of neighbouring patches are {gap:.2e} of the cell size apart in the "
            f"{fitted.settings.parameterisation} parameterisation, and their unit normals {normals_gap:.1e}; a solid "
            f"needs both within {EDGE_GAP_LIMIT:.0e}: use the smooth one, with symmetric weights"
        )


def _gap(surface: NurbsSurface, shift: Floats, turned_over: float = 1.0) -> float:
    """Largest distance between any edge, brought to edge 3, and any other's half-turn there.

    The rotoinversion that brings edge k to edge k + 1 turns normals over as well.
    """
    along = np.linspace(-1, 1, 201)
    turn = turned_over * ROTOINVERSION
    edges = [surface.edge(k).evaluate(along) @ np.linalg.matrix_power(turn, 3 - k).T for k in range(4)]
    images = [edge[::-1] @ EDGE_HALF_TURN.T + shift for edge in edges]
    return float(max(np.max(np.linalg.norm(edge - image, axis=1)) for edge in edges for image in images))

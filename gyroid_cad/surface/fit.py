"""Least-squares fit of the semi-fundamental patch by a NURBS surface: the paper's eqs. (11) to (13).

Points and unit normals are fitted in one basis, so that the faces of a wall of thickness t are the
control nets ``P +- t/2 N``. In the smooth parameterisation an edge's control points depend on nothing but the edge, so
two patches that meet there get the same ones, and tangent planes along it are the exact surface's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.nurbs.basis import (
    border_rates,
    gauss_points,
    inner_controls,
    least_change,
    rational_basis,
    uniform_knots,
)
from gyroid_cad.nurbs.surface import NurbsSurface, edge_row, first_fold, layer_areas
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
    "fit_patch",
    "max_offset",
    "require_shared_edges",
]

Floats = NDArray[np.float64]
Exact = Callable[[Floats, Floats], tuple[Floats, Floats]]

DEGREE = 3
FEWEST_CONTROL_POINTS, MOST_CONTROL_POINTS = 4, 40


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
_SAMPLES_PER_SPAN = 4
_CLOUD_RADII = 48
# Places on an edge at which its tangent plane is asked for, by control points; and how firmly, against the samples:
# more so, the inner control points wander along the surface.
_PLACES_PER_CONTROL_POINT = 2
_FIRMNESS = 1e3
# With fewer control points a side there are none to spare: turned, the fit gets further off than it gains.
_FEWEST_TO_TURN = 7
# Offset, in bounding-cell lengths, about which the two faces of a wall get the tangent planes: of walls a tenth of the
# cell size thick.
_OFFSET = 0.1
# The integral of the Gaussian curvature over the patch: its normals cover a sixth of the sphere.
_TOTAL_CURVATURE = -4 * np.pi / 6
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
    fit = _cloud_net if settings.parameterisation == "polar" else _staged_net
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


def _staged_net(knots: Floats, weights: Floats, exact: Exact) -> Floats:
    """Corners, then edges, then interior; returns the net of (point, normal), shape (n, n, 6)."""
    net = np.zeros((*weights.shape, 6))
    samples, sample_weights = gauss_points(knots, _SAMPLES_PER_SPAN)
    for k, corner in enumerate(_round_the_border(exact, np.array([-1.0]))):
        edge_row(net, k)[0] = corner
    for k, values in enumerate(_round_the_border(exact, samples)):
        _fit_edge(edge_row(net, k), edge_row(weights, k), knots, (samples, sample_weights), values)

    inner = inner_controls(len(weights))
    flat = net.reshape(-1, 6)
    places = np.stack(np.meshgrid(samples, samples, indexing="ij"), axis=-1).reshape(-1, 2)
    rational = rational_basis(weights, (knots, knots), places)[0]
    quadrature = np.outer(sample_weights, sample_weights).ravel()
    wanted = np.concatenate(exact(*places.T), axis=-1) - rational[:, ~inner] @ flat[~inner]
    along = np.linspace(-1, 1, _PLACES_PER_CONTROL_POINT * len(weights))
    running, inward = (rates.reshape(-1, len(flat)) for rates in border_rates(weights, knots, along))
    found = _least_squares(rational[:, inner], quadrature, wanted, inward[:, inner].T)
    flat[inner], responses = found[:, :6], found[:, 6:]
    if len(weights) >= _FEWEST_TO_TURN:
        normals = np.concatenate(_round_the_border(exact, along))[:, 3:]
        _turn_to_exact(flat, inner, (running, inward, responses), normals)
    _carry_whole_layers(net, knots, weights, rational, quadrature)
    return net


def _round_the_border(exact: Exact, along: Floats) -> list[Floats]:
    """Exact points and normals along each edge, in running order; shape (q, 6) each."""
    ones = np.ones_like(along)
    u, v = np.concatenate([along, ones, -along, -ones]), np.concatenate([-ones, along, ones, -along])
    return np.split(np.concatenate(exact(u, v), axis=-1), 4)


def _least_squares(functions: Floats, sample_weights: Floats, wanted: Floats, *beside: Floats) -> Floats:
    """Eqs. (12), (13), with one weight a sample, (R^T W R)^-1 R^T W S; beside it (R^T W R)^-1 of other columns."""
    weighted = functions.T * sample_weights
    return np.asarray(np.linalg.solve(weighted @ functions, np.hstack([weighted @ wanted, *beside])))


def _fit_edge(row: Floats, weights: Floats, knots: Floats, samples: tuple[Floats, Floats], values: Floats) -> None:
    """The inner control points of an edge, which at its ends keeps to the corners' tangent planes, as all edges do."""
    rational = rational_basis(weights, (knots,), samples[0][:, np.newaxis])[0]
    rates = rational_basis(weights, (knots,), np.array([[-1.0], [1.0]]), 1)[1]
    wanted = values - rational[:, [0, -1]] @ row[[0, -1]]
    found = _least_squares(rational[:, 1:-1], samples[1], wanted, rates[:, 1:-1].T)
    row[1:-1], responses = found[:, :6], found[:, 6:]
    if len(row) < _FEWEST_TO_TURN:
        return
    corner_normals = row[[0, -1], 3:].copy()
    for part in (slice(3), slice(3, 6)):
        off = -dot(rates @ row[:, part], corner_normals)
        row[1:-1, part] += least_change(responses, rates[:, 1:-1], corner_normals, off)


def _turn_to_exact(
    flat: Floats, inner: NDArray[np.bool_], borders: tuple[Floats, Floats, Floats], exact_normals: Floats
) -> None:
    """Turn the tangent planes along the edges of points P, and of P + h N to first order in h, to the exact ones.

    Edges are a little off themselves, so that no surface with such an edge has quite the exact normal: the nearest
    direction that is perpendicular to the edge is taken. Neighbours, who share it, take the same one.
    """
    running, inward, responses = borders
    tangent, tangent_rate = running @ flat[:, :3], running @ flat[:, 3:]

    def normals(offset: float) -> Floats:
        edge = tangent + offset * tangent_rate
        along = dot(exact_normals, edge) / dot(edge, edge)
        return np.asarray(exact_normals - along[:, np.newaxis] * edge)

    def turn(part: slice, towards: Floats, wanted: Floats) -> None:
        off = wanted - dot(inward @ flat[:, part], towards)
        flat[inner, part] += least_change(responses, inward[:, inner], towards, off, _FIRMNESS)

    turn(slice(3), normals(0.0), np.zeros(len(inward)))
    below, above = normals(-_OFFSET), normals(_OFFSET)
    turn(slice(3, 6), (above + below) / 2, -dot(inward @ flat[:, :3], (above - below) / (2 * _OFFSET)))


def _carry_whole_layers(net: Floats, knots: Floats, weights: Floats, rational: Floats, quadrature: Floats) -> None:
    """Correct the normals so that they carry the surface's whole area, and its whole curvature.

    The layer between P - h N and P + h N has the volume ``2 h A + 2/3 h^3 C`` with A the sum of N . dA and C that of
    N . (N_u x N_v) du dv. Least squares leave A short by 7.5e-7 of the area at 10 x 10, and every wall's volume with
    it. What is missing is spread along both vectors of area, where no tangent plane at an edge is turned by it.
    """
    samples = gauss_points(knots, _SAMPLES_PER_SPAN)[0]
    rates, turns = (
        NurbsSurface(net[..., part], weights, knots, knots).derivatives(samples[:, np.newaxis], samples[np.newaxis])
        for part in (slice(3), slice(3, 6))
    )
    normals = turns[0, 0].reshape(-1, 3)
    vectors = [np.cross(d[1, 0], d[0, 1]).reshape(-1, 3) for d in (rates, turns)]
    area, curvature = vectors
    missing = [
        quadrature @ (np.linalg.norm(area, axis=1) - dot(normals, area)),
        _TOTAL_CURVATURE - quadrature @ dot(normals, curvature),
    ]
    free = inner_controls(len(weights), 2 if len(weights) >= _FEWEST_TO_TURN else 1)
    functions = rational[:, free]
    spread = _least_squares(functions, quadrature, np.hstack(vectors)).reshape(-1, 2, 3)
    ways = np.tensordot(functions, spread, axes=1)
    # C is of third degree in the normals: its rate is three times that of the one factor.
    effect = [times * quadrature @ dot(ways, v[:, np.newaxis]) for times, v in zip((1, 3), vectors, strict=True)]
    net.reshape(-1, 6)[free, 3:] += np.tensordot(np.linalg.solve(effect, missing), spread, axes=(0, 1))


def _cloud_net(knots: Floats, weights: Floats, exact: Exact) -> Floats:
    """All control points at once, from a cloud even in radius and angle (Fig. 5); shape (n, n, 6)."""
    radius = np.arange(1, _CLOUD_RADII + 1) / _CLOUD_RADII
    along = np.linspace(-1, 1, _CLOUD_RADII, endpoint=False)
    ones = np.ones_like(along)
    border_u = np.concatenate([along, ones, -along, -ones])
    border_v = np.concatenate([-ones, along, ones, -along])
    u = np.append(np.outer(radius, border_u).ravel(), 0.0)
    v = np.append(np.outer(radius, border_v).ravel(), 0.0)
    rational = rational_basis(weights, (knots, knots), np.stack([u, v], axis=-1))[0]
    samples = np.concatenate(exact(u, v), axis=-1)
    return _least_squares(rational, np.ones(len(u)), samples).reshape(*weights.shape, 6)

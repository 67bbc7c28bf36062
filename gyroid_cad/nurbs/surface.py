"""Rational B-spline curves and surfaces as frozen arrays.

Algorithms after Piegl and Tiller, The NURBS Book (2nd ed.); numbers such as A2.2 are theirs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import prod
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.errors import ParameterError

__all__ = [
    "NurbsCurve",
    "NurbsSurface",
    "basis",
    "edge_row",
    "gauss_points",
    "grid_derivatives",
    "grid_points",
    "uniform_knots",
]

Floats = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

# S . (dS/du x dS/dv) of a cubic surface has degree 8 on each span. A quotient is no polynomial: with the
# paper's weights, which vary sixfold, so many points leave 1e-12.
_CUBIC_POINTS_PER_SPAN = 5
_RATIONAL_POINTS_PER_SPAN = 24


def uniform_knots(control_points: int, degree: int = 3) -> Floats:
    """Clamped knot vector on [-1, 1] with evenly spaced inner knots; shape (control_points + degree + 1,)."""
    inner = np.linspace(-1.0, 1.0, control_points - degree + 1)
    return np.concatenate([np.full(degree, -1.0), inner, np.full(degree, 1.0)])


def basis(knots: Floats, degree: int, parameters: ArrayLike, derivative: int = 0) -> Floats:
    """B-spline basis functions, or a derivative of them (A2.2, eq. (2.9)), for all parameters at once.

    Parameters
    ----------
    knots : ndarray, shape (n + degree + 1,)
        Clamped.
    degree : int
    parameters : array_like, shape (m,)
    derivative : int
        Order of the derivative; 0 gives the functions themselves.

    Returns
    -------
    ndarray, shape (m, n)
    """
    x = np.atleast_1d(np.asarray(parameters, float))
    count = len(knots) - degree - 1
    if derivative > degree:
        return np.zeros((len(x), count))
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, degree, count - 1)
    functions = np.zeros((len(x), len(knots) - 1))
    functions[np.arange(len(x)), span] = 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        for p in range(1, degree + 1):
            width = knots[p:] - knots[:-p]
            inverse = np.where(width > 0, 1 / width, 0.0)
            if p > degree - derivative:
                scaled = p * functions * inverse
                functions = scaled[:, :-1] - scaled[:, 1:]
            else:
                scaled = functions * inverse
                rising = (x[:, np.newaxis] - knots[: -p - 1]) * scaled[:, :-1]
                falling = (knots[p + 1 :] - x[:, np.newaxis]) * scaled[:, 1:]
                functions = rising + falling
    return functions


@lru_cache
def _gauss_rule(count: int) -> tuple[Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes, weights


def gauss_points(knots: Floats, per_span: int) -> tuple[Floats, Floats]:
    """Gauss-Legendre points and weights on every span of a knot vector.

    Parameters
    ----------
    knots : ndarray
    per_span : int
        Exact for polynomials of degree ``2 per_span - 1`` on each span.

    Returns
    -------
    points, weights : ndarray, shape (spans * per_span,)
    """
    nodes, weights = _gauss_rule(per_span)
    breaks = np.unique(knots)
    half = np.diff(breaks)[:, np.newaxis] / 2
    middle = (breaks[1:, np.newaxis] + breaks[:-1, np.newaxis]) / 2
    return (middle + half * nodes).ravel(), (half * weights).ravel()


@dataclass(frozen=True, slots=True, eq=False)
class NurbsCurve:
    """A rational B-spline curve.

    Attributes
    ----------
    control_points : ndarray, shape (n, 3)
    weights : ndarray, shape (n,)
    knots : ndarray, shape (n + degree + 1,)
    """

    control_points: Floats
    weights: Floats
    knots: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def degree(self) -> int:
        return len(self.knots) - len(self.control_points) - 1

    def evaluate(self, parameters: ArrayLike) -> Floats:
        """Points (A4.1); shape (m, 3)."""
        functions = basis(self.knots, self.degree, parameters) * self.weights
        return np.asarray(functions @ self.control_points / functions.sum(axis=1, keepdims=True))

    def reversed(self) -> NurbsCurve:
        """Curve run backwards on the same domain."""
        flipped = self.knots[0] + self.knots[-1] - self.knots[::-1]
        return NurbsCurve(self.control_points[::-1], self.weights[::-1], flipped)


@dataclass(frozen=True, slots=True, eq=False)
class NurbsSurface:
    """A rational B-spline surface.

    Attributes
    ----------
    control_points : ndarray, shape (n, m, 3)
    weights : ndarray, shape (n, m)
    knots_u : ndarray, shape (n + degree_u + 1,)
    knots_v : ndarray, shape (m + degree_v + 1,)
    """

    control_points: Floats
    weights: Floats
    knots_u: Floats
    knots_v: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)
        if self.control_points.ndim != 3 or self.weights.shape != self.control_points.shape[:2]:
            raise ParameterError(
                "weights", self.weights.shape, f"one weight per control point: {self.control_points.shape[:2]}"
            )

    @property
    def degree_u(self) -> int:
        return len(self.knots_u) - int(self.control_points.shape[0]) - 1

    @property
    def degree_v(self) -> int:
        return len(self.knots_v) - int(self.control_points.shape[1]) - 1

    @property
    def rational(self) -> bool:
        """True where the weights differ, so that the surface is not polynomial."""
        return bool(np.ptp(self.weights) > 0)

    def evaluate(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Points at pairs (u, v) (A4.3).

        Parameters
        ----------
        u, v : array_like
            Broadcast against each other.

        Returns
        -------
        ndarray, shape (*broadcast, 3)
        """
        return np.asarray(self.derivatives(u, v, order=0)[0, 0])

    def derivatives(self, u: ArrayLike, v: ArrayLike, order: int = 1) -> Floats:
        """Points and partial derivatives at pairs (u, v) (A4.4).

        Parameters
        ----------
        u, v : array_like
            Broadcast against each other; a grid given open, shapes (m, 1) and (1, k), costs far less.
        order : int
            0, 1 or 2: highest total order wanted.

        Returns
        -------
        ndarray, shape (order + 1, order + 1, *broadcast, 3)
            ``[k, l]`` holds d^(k+l)S / du^k dv^l; entries with k + l > order are zero.
        """
        u, v = np.asarray(u, float), np.asarray(v, float)
        shape = np.broadcast_shapes(u.shape, v.shape)
        open_grid = u.ndim == v.ndim == 2 and u.shape[1] == v.shape[0] == 1
        if not open_grid:
            u, v = np.broadcast_arrays(u, v)
        along_u = [basis(self.knots_u, self.degree_u, u.ravel(), k) for k in range(order + 1)]
        along_v = [basis(self.knots_v, self.degree_v, v.ravel(), k) for k in range(order + 1)]
        homogeneous = _homogeneous(self.control_points, self.weights)
        rows = [(b @ homogeneous.reshape(len(homogeneous), -1)).reshape(u.size, -1, 4) for b in along_u]
        numerator = np.zeros((order + 1, order + 1, prod(shape), 4))
        for k in range(order + 1):
            for m in range(order + 1 - k):
                row, functions = rows[k], along_v[m]
                values = functions @ row if open_grid else np.einsum("pjc,pj->pc", row, functions)
                numerator[k, m] = values.reshape(-1, 4)
        return _quotient(numerator, order).reshape(order + 1, order + 1, *shape, 3)

    def normals(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Unit normals dS/du x dS/dv / |...|, the paper's eq. (20); shape (*broadcast, 3)."""
        d = self.derivatives(u, v, order=1)
        cross = np.cross(d[1, 0], d[0, 1])
        return np.asarray(cross / np.linalg.norm(cross, axis=-1, keepdims=True))

    def mean_curvature(self, u: ArrayLike, v: ArrayLike) -> Floats:
        """Mean curvature H (half the trace of the shape operator), in 1/length; shape (*broadcast,)."""
        d = self.derivatives(u, v, order=2)
        su, sv = d[1, 0], d[0, 1]
        cross = np.cross(su, sv)
        normal = cross / np.linalg.norm(cross, axis=-1, keepdims=True)
        e, f, g = dot(su, su), dot(su, sv), dot(sv, sv)
        second_uu, second_uv, second_vv = dot(d[2, 0], normal), dot(d[1, 1], normal), dot(d[0, 2], normal)
        return np.asarray((e * second_vv - 2 * f * second_uv + g * second_uu) / (2 * (e * g - f * f)))

    def quadrature(self) -> tuple[Floats, Floats, Floats]:
        """Points and weights that integrate fluxes and volumes of the surface to rounding.

        Returns
        -------
        u : ndarray, shape (m, 1)
        v : ndarray, shape (1, k)
        weights : ndarray, shape (m, k)
        """
        per_span = _RATIONAL_POINTS_PER_SPAN if self.rational else _CUBIC_POINTS_PER_SPAN
        u, u_weights = gauss_points(self.knots_u, per_span)
        v, v_weights = gauss_points(self.knots_v, per_span)
        return u[:, np.newaxis], v[np.newaxis], np.outer(u_weights, v_weights)

    def edge(self, index: int) -> NurbsCurve:
        """Border curve ``index``, run round the square: v = -1, u = 1, v = 1 backwards, u = -1 backwards."""
        row = edge_row(self.control_points, index)
        weights = edge_row(self.weights, index)
        knots = self.knots_u if index % 2 == 0 else self.knots_v
        if index >= 2:
            knots = knots[0] + knots[-1] - knots[::-1]
        return NurbsCurve(row, weights, knots)

    def transformed(self, matrix: ArrayLike, translation: ArrayLike = (0.0, 0.0, 0.0)) -> NurbsSurface:
        """The image under ``p -> matrix p + translation`` (sec. 4.1: affine maps act on the control points)."""
        moved = self.control_points @ np.asarray(matrix, float).T + np.asarray(translation, float)
        return NurbsSurface(moved, self.weights, self.knots_u, self.knots_v)


def edge_row(net: NDArray[Scalar], index: int) -> NDArray[Scalar]:
    """The row of a net (its first two axes) that controls border curve ``index``, in running order."""
    return (net[:, 0], net[-1, :], net[::-1, -1], net[0, ::-1])[index]


def grid_derivatives(
    nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: ArrayLike, v: ArrayLike
) -> tuple[Floats, Floats, Floats]:
    """Points and first derivatives of many surfaces of one basis on one grid of parameters (A4.4).

    Parameters
    ----------
    nets : ndarray, shape (..., n, m, 3)
        Control points.
    weights : ndarray, shape (n, m)
    knots : tuple of ndarray
        Along u and v.
    u : array_like, shape (a,)
    v : array_like, shape (b,)

    Returns
    -------
    points, du, dv : ndarray, shape (..., a, b, 3)
    """
    n, m = nets.shape[-3:-1]
    along_u, along_u_rate = (basis(knots[0], len(knots[0]) - n - 1, u, k) for k in (0, 1))
    along_v, along_v_rate = (basis(knots[1], len(knots[1]) - m - 1, v, k) for k in (0, 1))

    def products(rows: Floats, columns: Floats, net: Floats) -> Floats:
        wide = (rows @ net.reshape(*net.shape[:-3], n, -1)).reshape(*net.shape[:-3], len(rows), m, -1)
        return np.asarray(columns @ wide)

    pairs = ((along_u, along_v), (along_u_rate, along_v), (along_u, along_v_rate))
    if np.ptp(weights) == 0:
        points, du, dv = (products(*pair, nets) for pair in pairs)
        return points, du, dv
    weight, weight_u, weight_v = (products(*pair, weights[..., np.newaxis]) for pair in pairs)
    numerator, numerator_u, numerator_v = (products(*pair, nets * weights[..., np.newaxis]) for pair in pairs)
    points = numerator / weight
    return points, (numerator_u - weight_u * points) / weight, (numerator_v - weight_v * points) / weight


def grid_points(nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: ArrayLike, v: ArrayLike) -> Floats:
    """Points of many surfaces of one basis on one grid of parameters (A4.3).

    Parameters
    ----------
    nets, weights, knots, u, v
        As of :func:`grid_derivatives`.

    Returns
    -------
    ndarray, shape (..., a, b, 3)
    """
    n, m = nets.shape[-3:-1]
    along_u, along_v = (basis(k, len(k) - count - 1, x) for k, count, x in zip(knots, (n, m), (u, v), strict=True))
    weighted = nets if np.ptp(weights) == 0 else nets * weights[..., np.newaxis]
    rows = (along_u @ weighted.reshape(*nets.shape[:-3], n, -1)).reshape(*nets.shape[:-3], len(along_u), m, -1)
    points = along_v @ rows
    return np.asarray(points if np.ptp(weights) == 0 else points / (along_u @ weights @ along_v.T)[..., np.newaxis])


def _homogeneous(control_points: Floats, weights: Floats) -> Floats:
    return np.concatenate([control_points * weights[..., np.newaxis], weights[..., np.newaxis]], axis=-1)


def _quotient(numerator: Floats, order: int) -> Floats:
    """Derivatives of S from those of (wS, w), by the product rule on wS = w * S."""
    result = np.zeros((*numerator.shape[:-1], 3))
    weight = numerator[..., 3:]
    result[0, 0] = numerator[0, 0, :, :3] / weight[0, 0]
    if order >= 1:
        for k, m in ((1, 0), (0, 1)):
            result[k, m] = (numerator[k, m, :, :3] - weight[k, m] * result[0, 0]) / weight[0, 0]
    if order >= 2:
        for k, m in ((2, 0), (0, 2)):
            mixed = 2 * weight[k // 2, m // 2] * result[k // 2, m // 2] + weight[k, m] * result[0, 0]
            result[k, m] = (numerator[k, m, :, :3] - mixed) / weight[0, 0]
        mixed = weight[1, 0] * result[0, 1] + weight[0, 1] * result[1, 0] + weight[1, 1] * result[0, 0]
        result[1, 1] = (numerator[1, 1, :, :3] - mixed) / weight[0, 0]
    return result

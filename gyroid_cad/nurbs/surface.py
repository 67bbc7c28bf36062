"""Rational B-spline curves and surfaces as frozen arrays.

Algorithms after Piegl and Tiller, The NURBS Book (2nd ed.); numbers such as A2.2 are theirs.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.basis import basis, gauss_points, orders, quotients, rational_basis

__all__ = [
    "NurbsCurve",
    "NurbsSurface",
    "edge_row",
    "face_densities",
    "face_integrals",
    "first_fold",
    "grid_derivatives",
    "grid_points",
    "layer_areas",
    "layer_volumes",
    "point_derivatives",
]

Floats = NDArray[np.float64]
Scalar = TypeVar("Scalar", bound=np.generic)

# S . (dS/du x dS/dv) of a cubic surface has degree 8 on each span. A quotient is no polynomial: with the
# paper's weights, which vary sixfold, so many points leave 1e-12.
_CUBIC_POINTS_PER_SPAN = 5
_RATIONAL_POINTS_PER_SPAN = 24
# So few that what is computed for them stays in the processor's cache.
_FACES_AT_ONCE = 64


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
        places = np.atleast_1d(np.asarray(parameters, float))[:, np.newaxis]
        return np.asarray(rational_basis(self.weights, (self.knots,), places)[0] @ self.control_points)

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
        given = (self.control_points[np.newaxis], self.weights, (self.knots_u, self.knots_v))
        if u.ndim == v.ndim == 2 and u.shape[1] == v.shape[0] == 1:
            found = grid_derivatives(*given, u.ravel(), v.ravel(), order)
        else:
            u, v = np.broadcast_arrays(u, v)
            found = point_derivatives(*given, u.reshape(1, -1), v.reshape(1, -1), order)
        result = np.zeros((order + 1, order + 1, *shape, 3))
        for (k, m), values in zip(orders(order, 2), found, strict=True):
            result[k, m] = values.reshape(*shape, 3)
        return result

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
    nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: ArrayLike, v: ArrayLike, order: int = 1
) -> tuple[Floats, ...]:
    """Points and derivatives of many surfaces of one basis on one grid of parameters (A4.4).

    Parameters
    ----------
    nets : ndarray, shape (..., n, m, components)
        Control points.
    weights : ndarray, shape (n, m)
    knots : tuple of ndarray
        Along u and v.
    u : array_like, shape (a,)
    v : array_like, shape (b,)
    order : int
        Highest total order wanted.

    Returns
    -------
    tuple of ndarray, shape (..., a, b, components)
        Points, then derivatives by u, v, uu, uv, vv and so on.
    """

    def products(along_u: Floats, along_v: Floats, net: Floats) -> Floats:
        n, m = net.shape[-3:-1]
        components = net.shape[-1]
        wide = along_u @ net.reshape(*net.shape[:-3], n, m * components)
        wide = wide.reshape(*net.shape[:-3], len(along_u), m, components)
        return np.asarray(along_v @ wide)

    return _derivatives(nets, weights, knots, (u, v), order, products)


def grid_points(nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: ArrayLike, v: ArrayLike) -> Floats:
    """Points alone, as of :func:`grid_derivatives` (A4.3); shape (..., a, b, components)."""
    return grid_derivatives(nets, weights, knots, u, v, 0)[0]


def point_derivatives(
    nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: Floats, v: Floats, order: int = 1
) -> tuple[Floats, ...]:
    """Points and derivatives of many surfaces of one basis, of each at places of its own (A4.4).

    Beyond the square the polynomials at its border go on.

    Parameters
    ----------
    nets : ndarray, shape (surfaces, n, m, components)
    weights, knots, order
        As of :func:`grid_derivatives`.
    u, v : ndarray, shape (surfaces, q)

    Returns
    -------
    tuple of ndarray, shape (surfaces, q, components)
        Points, then derivatives by u, v, uu, uv, vv and so on.
    """

    def products(along_u: Floats, along_v: Floats, net: Floats) -> Floats:
        count, n, m, components = net.shape
        rows = (along_u @ net.reshape(count, n, m * components)).reshape(*along_u.shape[:2], m, components)
        return np.asarray(np.einsum("pqjc,pqj->pqc", rows, along_v))

    return _derivatives(nets, weights[np.newaxis], knots, (u, v), order, products)


def _derivatives(
    nets: Floats,
    weights: Floats,
    knots: tuple[Floats, Floats],
    places: tuple[ArrayLike, ArrayLike],
    order: int,
    products: Callable[[Floats, Floats, Floats], Floats],
) -> tuple[Floats, ...]:
    """The same, by what sums the products of functions along u, along v and of control points."""
    along: list[list[Floats]] = []
    for k, count, given in zip(knots, weights.shape[-2:], places, strict=True):
        x = np.asarray(given, float)
        functions = [basis(k, len(k) - count - 1, x.ravel(), derivative) for derivative in range(order + 1)]
        along.append([some.reshape(*x.shape, count) for some in functions])

    def summed(net: Floats) -> dict[tuple[int, ...], Floats]:
        return {(k, m): products(along[0][k], along[1][m], net) for k, m in orders(order, 2)}

    if np.ptp(weights) == 0:
        return tuple(summed(nets).values())
    weight = weights[..., np.newaxis]
    return tuple(quotients(summed(nets * weight), summed(weight)).values())


def face_integrals(
    nets: Floats, weights: Floats, knots: tuple[Floats, Floats], *rule: Floats, moments: bool = False
) -> Floats:
    """Flux of p / 3, area vector and area of many faces of one basis, by quadrature.

    Parameters
    ----------
    nets : ndarray, shape (..., n, m, 3)
    weights, knots
        As of :func:`grid_derivatives`.
    *rule : ndarray
        Places along u, places along v and weights of both, as of :meth:`NurbsSurface.quadrature`.
    moments : bool
        Whether what first moments take is wanted too.

    Returns
    -------
    ndarray, shape (..., 5) or (..., 11)
        As of :func:`face_densities`. Of closed faces together the flux is the volume they enclose.
    """
    u, v, both = rule
    flat, count = nets.reshape(-1, *nets.shape[-3:]), 11 if moments else 5
    sums = [np.zeros((0, count))]
    for first in range(0, len(flat), _FACES_AT_ONCE):
        some = flat[first : first + _FACES_AT_ONCE]
        density = face_densities(some, weights, knots, u.ravel(), v.ravel(), moments)
        sums.append(np.einsum("uv,fuvk->fk", both, density))
    return np.concatenate(sums).reshape(*nets.shape[:-3], count)


def face_densities(
    nets: Floats, weights: Floats, knots: tuple[Floats, Floats], u: Floats, v: Floats, moments: bool = False
) -> Floats:
    """Flux of p / 3, area vector and area of faces, per du dv; shape (faces, u, v, 5).

    With moments six more: flux of (x, 0, 0), (0, y, 0) and (0, 0, z), and of (x^2 / 2, 0, 0) and so on. Of closed faces
    together these are the volume three times, and the first moments of what they enclose.
    """
    points, du, dv = grid_derivatives(nets, weights, knots, u, v)
    across = np.cross(du, dv)
    along = points * across
    columns = [along.sum(axis=-1, keepdims=True) / 3, across, np.linalg.norm(across, axis=-1, keepdims=True)]
    if moments:
        columns += [along, points * along / 2]
    return np.concatenate(columns, axis=-1)


def layer_areas(
    middle: tuple[Floats, Floats], through: tuple[Floats, Floats], direction: Floats
) -> tuple[Floats, Floats, Floats]:
    """Coefficients of the area vector of a surface that is moved by s H, along a direction, as a quadratic in s.

    Parameters
    ----------
    middle, through : tuple of ndarray, shape (..., 3)
        Derivatives by u and v of the surface M and of what it is moved by, H.
    direction : ndarray, shape (..., 3)

    Returns
    -------
    constant, linear, square : ndarray, shape (...)
        Of (M_u + s H_u) x (M_v + s H_v) . direction.
    """
    (middle_u, middle_v), (through_u, through_v) = middle, through
    constant = dot(np.cross(middle_u, middle_v), direction)
    linear = dot(np.cross(middle_u, through_v) + np.cross(through_u, middle_v), direction)
    return constant, linear, dot(np.cross(through_u, through_v), direction)


def layer_volumes(middle: tuple[Floats, Floats], through: tuple[Floats, Floats], half: Floats) -> Floats:
    """Volume per du dv between M - H and M + H: the integral of :func:`layer_areas` along H over s from -1 to 1.

    Parameters
    ----------
    middle, through
        As of :func:`layer_areas`.
    half : ndarray, shape (..., 3)
        H itself.
    """
    constant, square = (dot(np.cross(*pair), half) for pair in (middle, through))
    return 2 * constant + 2 / 3 * square


def first_fold(constant: Floats, linear: Floats, square: Floats) -> Floats:
    """Smallest \\|s\\| at which a layer of :func:`layer_areas` folds over; infinite if none does.

    Zero where the surface itself is turned over, so that no layer is sound.
    """
    discriminant = linear * linear - 4 * constant * square
    with np.errstate(divide="ignore", invalid="ignore"):
        root = 2 * np.abs(constant) / (np.abs(linear) + np.sqrt(discriminant))
    return np.where(constant <= 0, 0.0, np.where(discriminant < 0, np.inf, root))

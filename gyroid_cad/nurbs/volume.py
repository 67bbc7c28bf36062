"""Rational B-spline volumes as frozen arrays.

Algorithms after Piegl and Tiller, The NURBS Book (2nd ed.), with a third parameter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.basis import basis, gauss_points, orders, quotients

__all__ = ["NurbsVolume"]

Floats = NDArray[np.float64]

# The determinant of a polynomial volume of degree p has degree at most 3 p - 1 in each parameter on each span.
# A quotient is no polynomial: so many points more leave 1e-12 with the paper's weights, which vary sixfold.
_RATIONAL_POINTS_MORE = 18


@dataclass(frozen=True, slots=True, eq=False)
class NurbsVolume:
    """A rational B-spline volume.

    Attributes
    ----------
    control_points : ndarray, shape (n, m, k, 3)
    weights : ndarray, shape (n, m, k)
    knots_u : ndarray, shape (n + degree_u + 1,)
    knots_v : ndarray, shape (m + degree_v + 1,)
    knots_w : ndarray, shape (k + degree_w + 1,)
    """

    control_points: Floats
    weights: Floats
    knots_u: Floats
    knots_v: Floats
    knots_w: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)
        if self.control_points.ndim != 4 or self.weights.shape != self.control_points.shape[:3]:
            raise ParameterError(
                "weights", self.weights.shape, f"one weight per control point: {self.control_points.shape[:3]}"
            )

    @property
    def knots(self) -> tuple[Floats, Floats, Floats]:
        return self.knots_u, self.knots_v, self.knots_w

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Along u, v and w."""
        u, v, w = (len(k) - count - 1 for k, count in zip(self.knots, self.weights.shape, strict=True))
        return u, v, w

    def evaluate(self, u: ArrayLike, v: ArrayLike, w: ArrayLike) -> Floats:
        """Points at triples (u, v, w) (A4.3 with a third parameter).

        Parameters
        ----------
        u, v, w : array_like
            Broadcast against each other; a grid given open, shapes (a, 1, 1), (b, 1) and (c,), costs far less.

        Returns
        -------
        ndarray, shape (*broadcast, 3)
        """
        return self._derivatives(u, v, w, 0)[0]

    def jacobian(self, u: ArrayLike, v: ArrayLike, w: ArrayLike) -> Floats:
        """Matrices of first derivatives at triples (u, v, w) (A4.4 with a third parameter).

        Parameters
        ----------
        u, v, w : array_like
            Broadcast against each other.

        Returns
        -------
        ndarray, shape (*broadcast, 3, 3)
            ``[..., i, j]`` is the derivative of coordinate i by parameter j.
        """
        return np.stack(self._derivatives(u, v, w, 1)[1:], axis=-1)

    def jacobian_determinant(self, u: ArrayLike, v: ArrayLike, w: ArrayLike) -> Floats:
        """Volume per volume of parameters, negative where the volume is folded over; shape (*broadcast,)."""
        return np.asarray(np.linalg.det(self.jacobian(u, v, w)))

    def volume(self) -> float:
        """Integral of the Jacobian determinant by Gauss quadrature, exact to rounding."""
        more = _RATIONAL_POINTS_MORE if np.ptp(self.weights) > 0 else 0
        rules = [gauss_points(k, (3 * p + 1) // 2 + more) for k, p in zip(self.knots, self.degrees, strict=True)]
        (u, along_u), (v, along_v), (w, along_w) = rules
        determinants = self.jacobian_determinant(u[:, np.newaxis, np.newaxis], v[:, np.newaxis], w)
        return float(np.einsum("uvw,u,v,w->", determinants, along_u, along_v, along_w))

    def _derivatives(self, u: ArrayLike, v: ArrayLike, w: ArrayLike, order: int) -> tuple[Floats, ...]:
        """Points, then derivatives by u, v and w up to an order; shape (*broadcast, 3) each."""
        given = [np.asarray(parameter, float) for parameter in (u, v, w)]
        shape = np.broadcast_shapes(*(parameter.shape for parameter in given))
        subscripts = "ai,bj,ck,ijkd->abcd"
        if not _open_grid(given, shape):
            given = list(np.broadcast_arrays(*given))
            subscripts = "ai,aj,ak,ijkd->ad"
        along = [
            [basis(knots, degree, parameter.ravel(), derivative) for derivative in range(order + 1)]
            for parameter, knots, degree in zip(given, self.knots, self.degrees, strict=True)
        ]

        def summed(net: Floats) -> dict[tuple[int, ...], Floats]:
            return {
                each: np.einsum(
                    subscripts, *(along[axis][derivative] for axis, derivative in enumerate(each)), net, optimize=True
                ).reshape(*shape, -1)
                for each in orders(order, 3)
            }

        weight = self.weights[..., np.newaxis]
        return tuple(quotients(summed(self.control_points * weight), summed(weight)).values())


def _open_grid(given: list[Floats], shape: tuple[int, ...]) -> bool:
    """Tell whether parameters are a grid given open: (a, 1, 1), (1, b, 1) and (1, 1, c)."""
    if len(shape) != 3:
        return False
    wanted = ((shape[0], 1, 1), (1, shape[1], 1), (1, 1, shape[2]))
    return all((1,) * (3 - g.ndim) + g.shape == along for g, along in zip(given, wanted, strict=True))

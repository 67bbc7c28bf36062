"""Integrals over part of a face, whose border in the parameter square is known, by Green's theorem.

What is integrated is sampled once on the whole square, at Gauss points between the knots, and stands for the polynomial
through the samples of each span. The integral over what a border runs round is that of an antiderivative along u, taken
along the border in v.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import grouped
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.nurbs.surface import face_densities, face_integrals

__all__ = ["SquareQuadrature", "shifted_integrals"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# The flux through a cubic face without weights has degree 8 along each side.
_PER_SPAN = 9


class SquareQuadrature:
    """Flux, area vector and area of faces of one basis, over all or part of the parameter square.

    Parameters
    ----------
    knots : ndarray
        Along u and v.
    """

    def __init__(self, knots: Floats) -> None:
        self.knots = knots
        self.breaks = np.unique(knots)
        self.places, self.weights = gauss_points(knots, _PER_SPAN)
        nodes, weights = np.polynomial.legendre.leggauss(_PER_SPAN)
        order = np.arange(_PER_SPAN)
        # From values at a span's nodes to coefficients of Legendre's polynomials, transposed.
        self._coefficients = np.polynomial.legendre.legvander(nodes, _PER_SPAN - 1) * (order + 0.5)
        self._coefficients *= weights[:, np.newaxis]

    def densities(self, nets: Floats, weights: Floats, moments: bool = False) -> Floats:
        """Flux of p / 3, area vector, area and moments, as :func:`face_densities`; shape (faces, nodes, nodes, k)."""
        return face_densities(nets, weights, (self.knots, self.knots), self.places, self.places, moments)

    def over_square(self, nets: Floats, weights: Floats, moments: bool = False) -> Floats:
        """Integrals over whole faces; shape (faces, k)."""
        rule = self.places, self.places, np.outer(self.weights, self.weights)
        return face_integrals(nets, weights, (self.knots, self.knots), *rule, moments=moments)

    def over(self, places: Floats, rates: Floats, density: Floats) -> Floats:
        """Sum over places of their shares of an integral, shape (k,)."""
        return np.asarray(self.shares(places, rates, density).sum(axis=0))

    def shares(self, places: Floats, rates: Floats, density: Floats) -> Floats:
        """Of each place a rate times the integral of a density along u, from -1 to the place.

        Parameters
        ----------
        places : ndarray, shape (m, 2)
            On the border.
        rates : ndarray, shape (m,)
            Of v along it, times the weight of the place in a quadrature along the border.
        density : ndarray, shape (nodes, nodes, k)
            Of one face.

        Returns
        -------
        ndarray, shape (m, k)
        """
        spans = len(self.breaks) - 1
        blocks = density.reshape(spans, _PER_SPAN, spans, _PER_SPAN, -1)
        whole = np.einsum("sp,sptqk->stqk", self.weights.reshape(spans, -1), blocks)
        before = np.cumsum(whole, axis=0) - whole
        (span_u, _, up_to), (span_v, at, _) = (self._functions(x) for x in places.T)
        at *= rates[:, np.newaxis]
        found = np.zeros((len(places), density.shape[-1]))
        # Places of one span along both are taken together: a product of small matrices.
        for block, some in grouped(span_u * spans + span_v):
            u, v = divmod(block, spans)
            along_u = up_to[some] @ blocks[u, :, v].reshape(_PER_SPAN, -1) + before[u, v].ravel()
            found[some] = np.einsum("mq,mqk->mk", at[some], along_u.reshape(len(some), _PER_SPAN, -1))
        return found

    def _functions(self, x: Floats) -> tuple[Integers, Floats, Floats]:
        """Span of each x; there Lagrange's polynomials on its nodes, and their integrals from its start to x."""
        span = np.clip(np.searchsorted(self.breaks, x, side="right") - 1, 0, len(self.breaks) - 2)
        half = np.diff(self.breaks)[span] / 2
        local = (x - self.breaks[span]) / half - 1
        legendre = np.polynomial.legendre.legvander(local, _PER_SPAN)
        integrals = np.empty_like(legendre[:, :-1])
        integrals[:, 0] = local + 1
        integrals[:, 1:] = (legendre[:, 2:] - legendre[:, :-2]) / (2 * np.arange(1, _PER_SPAN) + 1)
        values, sums = legendre[:, :-1] @ self._coefficients.T, integrals @ self._coefficients.T
        return span.astype(np.int64), np.asarray(values), np.asarray(half[:, np.newaxis] * sums)


def shifted_integrals(integrals: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Flux of p / 3 and first moments of faces that are shifted, from their integrals where they were.

    Parameters
    ----------
    integrals : ndarray, shape (..., 11)
        As of :func:`~gyroid_cad.nurbs.surface.face_integrals`, with moments.
    shift : ndarray, shape (..., 3)

    Returns
    -------
    flux : ndarray, shape (...)
    moments : ndarray, shape (..., 3)
    """
    vector, along, moments = integrals[..., 1:4], integrals[..., 5:8], integrals[..., 8:11]
    flux = integrals[..., 0] + np.sum(shift * vector, axis=-1) / 3
    return np.asarray(flux), np.asarray(moments + shift * (along + shift * vector / 2))

"""The exact minimal surface: Enneper-Weierstrass map from the complex plane to space.

The surface is ``Re`` of the integral of ``scale e^{i angle} (1-w^2, i(1+w^2), 2w) / sqrt(w^8-14w^4+1)``;
the paper's eq. (1), corrected, writes that integral with elliptic integrals of the first kind.
Lengths are in units of the bounding-cell length ``a``.

``w`` is a poor coordinate at the patch's corners (the flat points): there ``w`` behaves as the square
of a length on the surface. Near the corner ``c`` the chart ``w = c (1 - tau^2)`` is used instead; in
``tau`` the surface is analytic up to and including the corner. The fourfold rotoinversion
``X(iw) = (y, -x, -z)`` carries every other corner to that one.
"""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal, localcontext
from math import atan2, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.errors import ParameterError

__all__ = [
    "CORNER",
    "DIAMOND",
    "GYROID",
    "PRIMITIVE",
    "Family",
    "corner_chart_omega",
    "corner_chart_points",
    "corner_chart_tangents",
    "normals",
    "points",
    "quadrature_point",
    "rotoinversion",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def _complete_integral(m: float) -> float:
    """K(m) by the arithmetic-geometric mean."""
    a, g = 1.0, sqrt(1 - m)
    while abs(a - g) > 1e-15:
        a, g = (a + g) / 2, sqrt(a * g)
    return pi / (2 * a)


K = _complete_integral(0.25)
K_PRIME = _complete_integral(0.75)

with localcontext() as _context:
    _context.prec = 50
    _corner = (Decimal(6).sqrt() - Decimal(2).sqrt()) / 2
    CORNER = float(_corner)
    # The rounding error of CORNER: with it, c - w is known to full precision for every double w.
    _CORNER_REMAINDER = float(_corner - Decimal(CORNER))

_DOMAIN_SLACK = 1e-9
_DUPLICATIONS = 6
# Square roots change sign at their cut, which values a rounding error beyond the corner would meet.
_BESIDE_CUT = 1e-300j


@dataclass(frozen=True, slots=True)
class Family:
    """A member of the Bonnet family of triply periodic minimal surfaces.

    Attributes
    ----------
    name : str
    bonnet_angle : float
        The angle of the associate surface, in radians.
    scale : float
        The normalization factor (the paper's kappa), in units of the bounding-cell length, half the period.
    interior_shift : tuple of complex
        How the smooth parameterisation shifts the patch's interior; see :func:`gyroid_cad.surface.patch.smooth`.
    edge_shift : tuple of float
        How it shifts places along the edges.
    """

    name: str
    bonnet_angle: float
    scale: float
    interior_shift: tuple[complex, complex] = (0.0, 0.0)
    edge_shift: tuple[float, float] = (0.0, 0.0)


# Scales at which the patch's corners fall on the grid of quarters of the bounding-cell length.
GYROID = Family(
    "gyroid",
    atan2(K, K_PRIME),
    sqrt(K * K + K_PRIME * K_PRIME) / (K * K_PRIME),
    (0.0386, -0.0142j),
    (-0.0014, 0.0045),
)
DIAMOND = Family("diamond", 0.0, 1 / K, (0.0676, -0.0148), (-0.0105, 0.0004))
PRIMITIVE = Family("primitive", pi / 2, 2 / K_PRIME, (0.005, 0.01))


def rotoinversion(vectors: ArrayLike, times: int = 1) -> Floats:
    """Apply ``(x, y, z) -> (y, -x, -z)``, the map of the surface onto itself that takes w to iw.

    Parameters
    ----------
    vectors : array_like, shape (..., 3)
    times : int
        How often; four times is the identity.

    Returns
    -------
    ndarray, shape (..., 3)
    """
    image = np.asarray(vectors, dtype=float)
    for _ in range(times % 4):
        image = np.stack([image[..., 1], -image[..., 0], -image[..., 2]], axis=-1)
    return image


def normals(omega: ArrayLike) -> Floats:
    """Exact unit normals: the inverse stereographic projection of ``omega`` (the Gauss map).

    Parameters
    ----------
    omega : array_like of complex, any shape

    Returns
    -------
    ndarray, shape (*omega.shape, 3)
    """
    w = np.asarray(omega, dtype=complex)
    squared = np.abs(w) ** 2
    vectors = np.stack([2 * w.real, 2 * w.imag, squared - 1], axis=-1)
    return np.asarray(vectors / (1 + squared)[..., np.newaxis])


def points(omega: ArrayLike, family: Family = GYROID) -> Floats:
    """Exact points of the semi-fundamental patch about the origin, eq. (1) corrected.

    Parameters
    ----------
    omega : array_like of complex, any shape
        Inside or on the four circles of radius sqrt(2) that bound the patch (Fig. 2, repeated by w -> iw).
    family : Family

    Returns
    -------
    ndarray, shape (*omega.shape, 3)
        In units of the bounding-cell length.

    Raises
    ------
    ParameterError
        If a value lies outside the patch's domain.
    """
    w = np.asarray(omega, dtype=complex)
    flat = w.ravel()
    _require_domain(flat)
    quarter = np.round(np.angle(flat) / (pi / 2)).astype(int) % 4
    result = np.empty((flat.size, 3))
    for turn in range(4):
        chosen = quarter == turn
        if chosen.any():
            turned = flat[chosen] * (1, -1j, -1, 1j)[turn]
            result[chosen] = rotoinversion(_sector_points(turned, _below_corner(turned), family), turn)
    return result.reshape((*w.shape, 3))


def corner_chart_omega(tau: ArrayLike) -> Complexes:
    """``w = c (1 - tau^2)``: the chart in which the surface is analytic at the corner c."""
    t = np.asarray(tau, dtype=complex)
    return np.asarray(CORNER * (1 - t * t))


def corner_chart_points(tau: ArrayLike, family: Family = GYROID) -> Floats:
    """Exact points at ``w = c (1 - tau^2)``, to rounding even at the corner itself.

    Parameters
    ----------
    tau : array_like of complex, any shape
    family : Family

    Returns
    -------
    ndarray, shape (*tau.shape, 3)
    """
    t = np.asarray(tau, dtype=complex)
    # Beside the cut of the square root, on the side that tau comes from.
    below = CORNER * t * t + _BESIDE_CUT * np.where(t.imag < 0, -1, 1)
    positions = _sector_points(corner_chart_omega(t), below, family)
    # The corner is a centre of inversion of the surface, tau -> -tau; the integrals see only tau^2.
    beyond = t.real < 0
    if np.any(beyond):
        corner = _sector_points(np.array(CORNER + 0j), np.array(0j), family)
        positions = np.where(beyond[..., np.newaxis], 2 * corner - positions, positions)
    return positions


def corner_chart_tangents(tau: ArrayLike, family: Family = GYROID) -> Complexes:
    """The holomorphic derivative ``f`` for which ``dX = Re(f dtau)``.

    Parameters
    ----------
    tau : array_like of complex, any shape
    family : Family

    Returns
    -------
    ndarray of complex, shape (*tau.shape, 3)
    """
    t = np.asarray(tau, dtype=complex)
    w = corner_chart_omega(t)
    square, corner_square = w * w, CORNER * CORNER
    # sqrt(w^8 - 14 w^4 + 1) without its factor sqrt(c - w) = tau sqrt(c), which dw/dtau cancels.
    regular = (CORNER + w) * (square + corner_square) * (corner_square**-2 - square * square)
    factor = -2 * family.scale * np.exp(1j * family.bonnet_angle) * sqrt(CORNER) / np.sqrt(regular)
    return np.stack([factor * (1 - square), factor * 1j * (1 + square), factor * 2 * w], axis=-1)


def quadrature_point(omega: complex, family: Family = GYROID, digits: int = 30) -> Floats:
    """One point by adaptive quadrature of the Weierstrass integral: the slow, independent check.

    Parameters
    ----------
    omega : complex
    family : Family
    digits : int
        Decimal digits mpmath works with.

    Returns
    -------
    ndarray, shape (3,)
    """
    import mpmath

    with mpmath.workdps(digits):
        end = mpmath.mpc(omega)

        # w = end (1 - s^2): the square root at a corner becomes smooth in s.
        def integrand(component: int, s: object) -> object:
            w = end * (1 - s * s)  # type: ignore[operator]
            forms = (1 - w**2, 1j * (1 + w**2), 2 * w)
            return forms[component] / mpmath.sqrt(w**8 - 14 * w**4 + 1) * 2 * s * end

        turn = family.scale * mpmath.expj(family.bonnet_angle)
        integrals = [mpmath.quad(lambda s, i=i: integrand(i, s), [0, 1]) for i in range(3)]
        return np.array([float(mpmath.re(turn * value)) for value in integrals])


def _require_domain(omega: Complexes) -> None:
    if omega.size == 0:
        return
    centres = np.exp(1j * (pi / 4 + pi / 2 * np.arange(4)))
    excess = np.max(np.abs(omega[:, np.newaxis] + centres) - sqrt(2), axis=1)
    worst = int(np.argmax(np.where(np.isnan(excess), np.inf, excess)))
    if not excess[worst] <= _DOMAIN_SLACK:
        raise ParameterError(
            "omega",
            complex(omega[worst]),
            "a point of the semi-fundamental patch: |omega + e^{i pi (2k+1)/4}| <= sqrt(2) for k = 0..3",
        )


def _below_corner(omega: Complexes) -> Complexes:
    return np.asarray((CORNER - omega) + _CORNER_REMAINDER + _BESIDE_CUT)


def _sector_points(omega: Complexes, below: Complexes, family: Family) -> Floats:
    """Points for |arg w| <= 45 degrees, given ``below`` = c - w to full relative precision.

    ``1 - s^2`` is written through its factor ``c - w``: formed by subtraction it would lose half the
    digits at the corner.
    """
    square, corner_square = omega * omega, CORNER * CORNER
    below_square = below * (CORNER + omega)
    quartic = square * square + 4 * square + 1
    s = 2 * sqrt(2) * omega / np.sqrt(quartic)
    s_complement = below_square * (1 / corner_square - square) / quartic
    s_vertical = square / corner_square
    s_vertical_complement = below_square * (corner_square + square) / corner_square**2
    turn = family.scale * np.exp(1j * family.bonnet_angle)
    x = (turn * _elliptic_f(s, s_complement, 0.25)).real / (2 * sqrt(2))
    y = -(turn * _elliptic_f(s, s_complement, 0.75)).imag / (2 * sqrt(2))
    z = (turn * _elliptic_f(s_vertical, s_vertical_complement, corner_square**4)).real * corner_square
    return np.stack([x, y, z], axis=-1)


def _elliptic_f(s: Complexes, complement: Complexes, m: float) -> Complexes:
    """Incomplete elliptic integral F(arcsin s | m) by Carlson's symmetric form; complement = 1 - s^2."""
    return np.asarray(s * _carlson_rf(complement, 1 - m * s * s, np.ones_like(s)))


def _carlson_rf(x: Complexes, y: Complexes, z: Complexes) -> Complexes:
    """Carlson's R_F by duplication, for all arguments at once (B. C. Carlson, Numer. Algorithms 10, 1995).

    ``scipy.special.elliprf`` gives the same digits, but importing it takes four times as long as the first fit.
    """
    start = mean = (x + y + z) / 3
    dx, dy = start - x, start - y
    # Each duplication brings the arguments four times nearer to one another; the series' error is their sixth power.
    for _ in range(_DUPLICATIONS):
        root_x, root_y, root_z = np.sqrt(x), np.sqrt(y), np.sqrt(z)
        shift = root_x * root_y + root_x * root_z + root_y * root_z
        x, y, z, mean = (x + shift) / 4, (y + shift) / 4, (z + shift) / 4, (mean + shift) / 4
    scale = 4.0**_DUPLICATIONS * mean
    dx, dy = dx / scale, dy / scale
    dz = -dx - dy
    e2, e3 = dx * dy - dz * dz, dx * dy * dz
    return np.asarray((1 - e2 / 10 + e3 / 14 + e2 * e2 / 24 - 3 * e2 * e3 / 44) / np.sqrt(mean))

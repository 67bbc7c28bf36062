"""The semi-fundamental patch (SFP) as an exact function on the square [-1, 1]^2.

The patch is centred at the origin, its axes along the cubic cell's (after the 45 degree turn of the
paper's eq. (6)), in units of the bounding-cell length ``a``. Corners and edges are numbered round the
square: corner 0 at (u, v) = (-1, -1), then (1, -1), (1, 1), (-1, 1); edge k runs from corner k to
corner k + 1. The fourfold rotoinversion of the patch carries corner k to corner k + 1, edge k to edge
k + 1, and (u, v) to (-v, u).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import pi, sqrt
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.surface.weierstrass import (
    CORNER,
    GYROID,
    Family,
    corner_chart_omega,
    corner_chart_points,
    corner_chart_tangents,
    normals,
    points,
    rotoinversion,
)

__all__ = [
    "EDGE_HALF_TURN",
    "PARAMETERISATIONS",
    "ROTOINVERSION",
    "edge_half_turn_shift",
    "exact_edge",
    "parameter_corners",
    "polar",
    "smooth",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


class Parameterisation(Protocol):
    """Points and normals of the patch at (u, v)."""

    def __call__(self, u: ArrayLike, v: ArrayLike, family: Family = ...) -> tuple[Floats, Floats]: ...


# From the Weierstrass frame to the cell's axes: T_yz R_z(-45 deg) of eq. (6).
_TO_CELL_AXES = np.array([[1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 0.0, -sqrt(2)]]) / sqrt(2)
# The patch's rotoinversion, and H of the half-turn p -> H p + h about the normal at the midpoint of edge 3, in the
# cell's axes: of every family, for they have the same normals.
ROTOINVERSION = np.array([[0, -1, 0], [1, 0, 0], [0, 0, -1]])
EDGE_HALF_TURN = np.array([[0, 0, 1], [0, -1, 0], [1, 0, 0]])

_ARC_HALF_ANGLE = pi / 12
_NEWTON_STEPS = 12
# Convergence is quadratic: after a step this small the error is below rounding.
_NEWTON_TOLERANCE = 1e-10


def parameter_corners() -> Floats:
    """The corners of the parameter square in the order of the patch's corners; shape (4, 2)."""
    return np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def smooth(u: ArrayLike, v: ArrayLike, family: Family = GYROID) -> tuple[Floats, Floats]:
    """Exact points and normals, in a parameterisation analytic up to and including the corners.

    Seen along the patch's axis, the four exact edge curves are filled by transfinite interpolation (The
    NURBS Book, sec. 10.6, Coons), and the interior, which is free to lie anywhere between them, is shifted by two small
    fields with the patch's fourfold symmetry, the family's own: 2.5 times closer 10 x 10 fits
    (benchmarks/parameterisation.py scans them). The exact surface is a graph over
    that view. On the edges the parameter is the coordinate along the chord, which the half-turn about the normal at
    the edge's midpoint reverses: so neighbours agree on their common edge.

    Parameters
    ----------
    u, v : array_like
        In [-1, 1], broadcast against each other.
    family : Family

    Returns
    -------
    points, normals : ndarray, shape (*broadcast, 3)
        Points in units of a; unit normals on the side of dX/du x dX/dv.
    """
    u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
    plan = _plan(u.ravel(), v.ravel(), family)
    surface, unit_normals = _lift(plan, family)
    shape = (*u.shape, 3)
    return (surface @ _TO_CELL_AXES.T).reshape(shape), (unit_normals @ _TO_CELL_AXES.T).reshape(shape)


def polar(u: ArrayLike, v: ArrayLike, family: Family = GYROID) -> tuple[Floats, Floats]:
    """Exact points and normals in the paper's parameterisation (Figs. 2 and 5).

    Rays from the centre of the square are mapped evenly onto rays from ``w = 0``, and the square's
    border evenly onto the arcs that bound the domain. At the corners it has a square-root singularity.

    Parameters
    ----------
    u, v : array_like
        In [-1, 1], broadcast against each other.
    family : Family

    Returns
    -------
    points, normals : ndarray, shape (*broadcast, 3)
        Points in units of a; unit normals on the side of dX/du x dX/dv.
    """
    u, v = np.broadcast_arrays(np.asarray(u, float), np.asarray(v, float))
    radius = np.maximum(np.abs(u), np.abs(v))
    # Edge k faces the direction (0,-1), (1,0), (0,1), (-1,0); along is -1 at corner k and 1 at corner k+1.
    edge = np.select([-v >= radius, u >= radius, v >= radius], [0, 1, 2], 3)
    along = np.choose(edge, [u, v, -u, -v]) / np.where(radius == 0, 1, radius)
    arc = sqrt(2) * np.exp(1j * _ARC_HALF_ANGLE * along) - 1
    omega = radius * arc * np.exp(1j * pi / 4) * np.array([1j, -1, -1j, 1])[edge]
    return points(omega, family) @ _TO_CELL_AXES.T, normals(omega) @ _TO_CELL_AXES.T


PARAMETERISATIONS: Mapping[str, Parameterisation] = MappingProxyType({"smooth": smooth, "polar": polar})


def exact_edge(along: ArrayLike, family: Family = GYROID) -> Floats:
    """Exact points of edge 3, from corner 3 (-1) to corner 0 (+1), by the coordinate along the chord.

    Parameters
    ----------
    along : array_like, any shape
        In [-1, 1].
    family : Family

    Returns
    -------
    ndarray, shape (*along.shape, 3)
        In units of a.
    """
    return _edge(np.asarray(along, float), family) @ _TO_CELL_AXES.T


def edge_half_turn_shift(family: Family = GYROID) -> Floats:
    """h of the half-turn p -> :data:`EDGE_HALF_TURN` p + h about the normal at the midpoint of edge 3; shape (3,).

    It is a symmetry of every associate surface: the Gauss map's half-turn about that normal carries the Weierstrass
    integrand to itself, whatever the angle.
    """
    end, start = exact_edge(np.array([-1.0, 1.0]), family)
    return np.asarray(start - EDGE_HALF_TURN @ end)


def _edge(along: Floats, family: Family) -> Floats:
    """Edge 3 in the Weierstrass frame, where it leaves the corner w = c and ends at w = ic."""
    start, middle = _edge_chart(np.array([0.0, 1.0]), family)[0]
    end = rotoinversion(start)
    half_chord = np.linalg.norm(end - start) / 2
    direction = (end - start) / (2 * half_chord)
    # Newton on the arc's chart sigma (0 at the corner, 1 in the middle).
    target = -np.abs(along) * half_chord
    sigma = 1 - np.abs(along)
    for _ in range(_NEWTON_STEPS):
        position, velocity = _edge_chart(sigma, family)
        step = (target - (position - middle) @ direction) / (velocity @ direction)
        sigma = sigma + step
        if np.max(np.abs(step), initial=0.0) < _NEWTON_TOLERANCE:
            break
    first_half = _edge_chart(sigma, family)[0] - middle
    axis = normals((sqrt(2) - 1) * np.exp(1j * pi / 4))
    half_turned = 2 * (first_half @ axis)[..., np.newaxis] * axis - first_half
    return np.asarray(middle + np.where((along <= 0)[..., np.newaxis], first_half, half_turned))


def _edge_chart(sigma: Floats, family: Family) -> tuple[Floats, Floats]:
    """Points and derivatives on the first half of edge 3; sigma is analytic at the corner (sigma = 0).

    The arc is ``w = e^{i pi/4} (sqrt(2) e^{i phi} - 1)`` with ``phi = phi_0 (sigma^2 - 1)``; with
    ``w = c (1 - tau^2)`` that gives ``tau = sigma g(sigma)``, g smooth and not zero.
    """
    squared = sigma * sigma
    factor = sqrt(2) * np.exp(1j * (pi / 4 - _ARC_HALF_ANGLE)) / CORNER
    turned = 1j * _ARC_HALF_ANGLE * squared
    growth = np.where(squared == 0, 1j * _ARC_HALF_ANGLE, np.expm1(turned) / np.where(squared == 0, 1, squared))
    ratio = np.sqrt(-factor * growth)
    tau = sigma * ratio
    tau_rate = -factor * 1j * _ARC_HALF_ANGLE * np.exp(turned) / ratio
    return corner_chart_points(tau, family), (corner_chart_tangents(tau, family) * tau_rate[..., np.newaxis]).real


def _plan(u: Floats, v: Floats, family: Family) -> Floats:
    """Place of (u, v) in the view along the patch's axis (x, y of the Weierstrass frame)."""
    u, v = (_shifted(parameter, family) for parameter in (u, v))
    parameters, inverse = np.unique(np.concatenate([u, v, -u, -v]), return_inverse=True)
    edge = _edge(parameters, family)
    at_u, at_v, at_minus_u, at_minus_v = edge[inverse].reshape(4, -1, 3)
    left = at_minus_v[:, :2]
    bottom = rotoinversion(at_u, 1)[:, :2]
    right = rotoinversion(at_v, 2)[:, :2]
    top = rotoinversion(at_minus_u, 3)[:, :2]
    corners = [rotoinversion(_edge(np.array([1.0]), family)[0], k)[:2] for k in range(4)]
    a, b, c, d = (weight[:, np.newaxis] for weight in ((1 - u) / 2, (1 + u) / 2, (1 - v) / 2, (1 + v) / 2))
    plan = a * left + b * right + c * bottom + d * top
    plan -= a * c * corners[0] + b * c * corners[1] + b * d * corners[2] + a * d * corners[3]
    # x + iy turns like v + iu: the rotoinversion takes (x, y) to (y, -x) and (u, v) to (-v, u).
    position = v + 1j * u
    size = complex(*corners[0]) / (-1 - 1j)
    radial, cubic = family.interior_shift
    shift = size * (1 - u * u) * (1 - v * v) * (radial * position + cubic * np.conj(position) ** 3)
    return np.asarray(plan + np.stack([shift.real, shift.imag], axis=-1))


def _shifted(along: Floats, family: Family) -> Floats:
    """The family's odd shift of a parameter, which keeps the ends and is the same run backwards."""
    squared = along * along
    linear, cubic = family.edge_shift
    return np.asarray(along + along * (1 - squared) * (linear + cubic * squared))


def _lift(plan: Floats, family: Family) -> tuple[Floats, Floats]:
    """Points and normals of the exact surface over points of its view along the axis."""
    # At the centre x - iy = scale e^{i angle} w, so the sector |arg w| < 45 deg about corner w = c is seen
    # about the direction -angle; it twists by a few degrees outwards, which the corner's chart bears.
    direction = np.arctan2(plan[:, 1], plan[:, 0]) + family.bonnet_angle
    quarter = np.round(-direction / (pi / 2)).astype(int) % 4
    surface = np.empty((len(plan), 3))
    unit_normals = np.empty((len(plan), 3))
    # Each rotoinversion turns the view by -90 deg.
    for turn in range(4):
        chosen = quarter == turn
        if not chosen.any():
            continue
        x, y = plan[chosen].T
        tau = _solve_corner_chart(*[(x, y), (-y, x), (-x, -y), (y, -x)][turn], family)
        surface[chosen] = rotoinversion(corner_chart_points(tau, family), turn)
        unit_normals[chosen] = normals(corner_chart_omega(tau) * (1, 1j, -1, -1j)[turn])
    return surface, unit_normals


def _solve_corner_chart(x: Floats, y: Floats, family: Family) -> Complexes:
    """Newton's method for the chart value above (x, y) in the sector of corner c."""
    coefficients = _inverse_chart(family)
    tau = np.polynomial.polynomial.polyval2d(x / family.scale, y / family.scale, coefficients)
    for _ in range(_NEWTON_STEPS):
        position = corner_chart_points(tau, family)
        tangent = corner_chart_tangents(tau, family)
        x_rate, y_rate = tangent[:, 0], tangent[:, 1]
        dx, dy = x - position[:, 0], y - position[:, 1]
        # Re(x_rate step) = dx and Re(y_rate step) = dy.
        step = 1j * (np.conj(y_rate) * dx - np.conj(x_rate) * dy) / (np.conj(x_rate) * y_rate).imag
        tau = tau + step
        if np.max(np.abs(step), initial=0.0) < _NEWTON_TOLERANCE:
            break
    return np.asarray(tau)


@lru_cache(maxsize=8)
def _inverse_chart(family: Family, degree: int = 4) -> Complexes:
    """Polynomial coefficients of tau(x, y), fitted to exact samples of the sector: Newton's start."""
    half_arc = np.exp(1j * pi / 4) * (sqrt(2) * np.exp(1j * _ARC_HALF_ANGLE * np.linspace(-1, 0, 8)) - 1)
    arc = np.concatenate([half_arc, np.conj(half_arc)])
    omega = np.linspace(0, 1, 13)[:, np.newaxis] * arc
    tau = np.sqrt(1 - omega / CORNER).ravel()
    x, y, _ = corner_chart_points(tau, family).T
    powers = np.polynomial.polynomial.polyvander2d(x / family.scale, y / family.scale, [degree, degree])
    solution = np.linalg.solve(powers.T @ powers, powers.T @ tau)
    return np.asarray(solution.reshape(degree + 1, degree + 1))

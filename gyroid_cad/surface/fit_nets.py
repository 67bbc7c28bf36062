"""Control nets of the semi-fundamental patch by least squares: the paper's eqs. (11) to (13), stage by stage or at once.

A net holds points and unit normals, in one basis. Stage by stage, the corners are interpolated, each edge is fitted
from its own samples alone, then the interior, with a tangent plane along each edge that is the exact surface's: so
neighbours, who share the edge, meet smoothly there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.nurbs.basis import gauss_points, rational_basis
from gyroid_cad.nurbs.surface import NurbsSurface, edge_row
from gyroid_cad.nurbs.tangency import border_rates, inner_controls, least_change
from gyroid_cad.surface.patch import parameter_corners

__all__ = ["cloud_net", "staged_net"]

Floats = NDArray[np.float64]
Exact = Callable[[Floats, Floats], tuple[Floats, Floats]]

_SAMPLES_PER_SPAN = 4
_CLOUD_RADII = 48
# Places on an edge at which its tangent plane is asked for, by control points; and how firmly, against the samples:
# more so, the inner control points wander along the surface.
_PLACES_PER_CONTROL_POINT = 2
_FIRMNESS = 1e3
# With fewer control points a side there are none to spare: turned, the fit gets further off than it gains.
_FEWEST_TO_TURN = 6
# Offset, in bounding-cell lengths, about which the two faces of a wall get the tangent planes: of walls a tenth of the
# cell size thick.
_OFFSET = 0.1
# The integral of the Gaussian curvature over the patch: its normals cover a sixth of the sphere.
_TOTAL_CURVATURE = -4 * np.pi / 6


def staged_net(knots: Floats, weights: Floats, exact: Exact) -> Floats:
    """Corners, then edges, then interior.

    Parameters
    ----------
    knots : ndarray, shape (n + 4,)
    weights : ndarray, shape (n, n)
    exact : callable
        Points and normals at (u, v), in bounding-cell lengths.

    Returns
    -------
    ndarray, shape (n, n, 6)
        Of (point, normal).
    """
    net = np.zeros((*weights.shape, 6))
    samples, sample_weights = gauss_points(knots, _SAMPLES_PER_SPAN)
    for k, (u, v) in enumerate(parameter_corners()):
        edge_row(net, k)[0] = np.concatenate(exact(u, v), axis=-1)
    ones = np.ones_like(samples)
    square = ((samples, -ones), (ones, samples), (-samples, ones), (-ones, -samples))
    for k, (u, v) in enumerate(square):
        values = np.concatenate(exact(u, v), axis=-1)
        _fit_edge(edge_row(net, k), edge_row(weights, k), knots, samples, sample_weights, values)

    inner = inner_controls(len(weights))
    flat = net.reshape(-1, 6)
    places = np.stack(np.meshgrid(samples, samples, indexing="ij"), axis=-1).reshape(-1, 2)
    rational = rational_basis(weights, (knots, knots), places)[0]
    quadrature = np.outer(sample_weights, sample_weights).ravel()
    wanted = np.concatenate(exact(*places.T), axis=-1) - rational[:, ~inner] @ flat[~inner]
    along = np.linspace(-1, 1, _PLACES_PER_CONTROL_POINT * len(weights))
    running, inward = (rates.reshape(-1, len(flat)) for rates in border_rates(weights, knots, along))

    weighted = rational[:, inner].T * quadrature
    found = np.linalg.solve(weighted @ rational[:, inner], np.hstack([weighted @ wanted, inward[:, inner].T]))
    flat[inner], responses = found[:, :6], found[:, 6:]
    if len(weights) >= _FEWEST_TO_TURN:
        _turn_to_exact(flat, inner, (running, inward, responses), _edge_normals(exact, along))
    _carry_whole_layers(net, knots, weights, rational, quadrature)
    return net


def _fit_edge(
    row: Floats, weights: Floats, knots: Floats, samples: Floats, sample_weights: Floats, values: Floats
) -> None:
    """The inner control points of an edge; at its ends it keeps to the tangent planes of the corners.

    The other edges at a corner do the same, so that there all rates lie in one plane.
    """
    rational = rational_basis(weights, (knots,), samples[:, np.newaxis])[0]
    rates = rational_basis(weights, (knots,), np.array([[-1.0], [1.0]]), 1)[1]
    weighted = rational[:, 1:-1].T * sample_weights
    wanted = values - rational[:, [0, -1]] @ row[[0, -1]]
    found = np.linalg.solve(weighted @ rational[:, 1:-1], np.hstack([weighted @ wanted, rates[:, 1:-1].T]))
    row[1:-1], responses = found[:, :6], found[:, 6:]
    corner_normals = row[[0, -1], 3:].copy()
    for part in (slice(3), slice(3, 6)):
        off = -dot(rates @ row[:, part], corner_normals)
        row[1:-1, part] += least_change(responses, rates[:, 1:-1], corner_normals, off)


def _edge_normals(exact: Exact, along: Floats) -> Floats:
    """Exact normals at places on the four edges, in running order; shape (4 * q, 3)."""
    ones = np.ones_like(along)
    square = ((along, -ones), (ones, along), (-along, ones), (-ones, -along))
    return np.concatenate([exact(u, v)[1] for u, v in square])


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
    free = inner_controls(len(weights), 2 if len(weights) > _FEWEST_TO_TURN else 1)
    functions = rational[:, free]
    weighted = functions.T * quadrature
    spread = np.linalg.solve(weighted @ functions, weighted @ np.hstack(vectors)).reshape(-1, 2, 3)
    ways = np.tensordot(functions, spread, axes=1)
    # C is of third degree in the normals: its rate is three times that of the one factor.
    effect = [times * quadrature @ dot(ways, v[:, np.newaxis]) for times, v in zip((1, 3), vectors, strict=True)]
    net.reshape(-1, 6)[free, 3:] += np.tensordot(np.linalg.solve(effect, missing), spread, axes=(0, 1))


def cloud_net(knots: Floats, weights: Floats, exact: Exact) -> Floats:
    """All control points at once, from a cloud even in radius and angle (Fig. 5).

    Parameters
    ----------
    knots, weights, exact
        As of :func:`staged_net`.

    Returns
    -------
    ndarray, shape (n, n, 6)
    """
    radius = np.arange(1, _CLOUD_RADII + 1) / _CLOUD_RADII
    along = np.linspace(-1, 1, _CLOUD_RADII, endpoint=False)
    ones = np.ones_like(along)
    border_u = np.concatenate([along, ones, -along, -ones])
    border_v = np.concatenate([-ones, along, ones, -along])
    u = np.append(np.outer(radius, border_u).ravel(), 0.0)
    v = np.append(np.outer(radius, border_v).ravel(), 0.0)
    rational = rational_basis(weights, (knots, knots), np.stack([u, v], axis=-1))[0]
    samples = np.concatenate(exact(u, v), axis=-1)
    # Eqs. (12), (13): (R^T R)^-1 R^T S.
    return np.asarray(np.linalg.solve(rational.T @ rational, rational.T @ samples)).reshape(*weights.shape, 6)

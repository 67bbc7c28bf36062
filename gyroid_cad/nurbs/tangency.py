"""Tangent planes along the border of spline surfaces, and the least changes of control points that turn them.

Two surfaces with a border curve in common meet smoothly where both have the same normal ``m`` there: where the rate
``X_w`` from the border inwards has no part along it, ``X_w . m = 0``. That is linear in the control points. Conditions
of this kind are met by the change that moves the points of a surface least, in the mean square: what least squares
found is kept as well as can be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.basis import rational_basis

__all__ = ["border_rates", "inner_controls", "least_change"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]


def border_rates(weights: Floats, knots: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Rates of a surface at its border, on the square [-1, 1]^2, as matrices on control points.

    Parameters
    ----------
    weights : ndarray, shape (n, n)
    knots : ndarray
        Along u as along v.
    along : ndarray, shape (q,)
        Places on each border curve, in running order round the square.

    Returns
    -------
    running, inward : ndarray, shape (4, q, n * n)
        The way the border runs, and from there into the square: their vector product is along du x dv.

    Examples
    --------
    >>> from gyroid_cad.nurbs.basis import uniform_knots
    >>> running, inward = border_rates(np.ones((4, 4)), uniform_knots(4), np.array([-1.0, 0.0]))
    >>> net = np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 4)], indexing="ij"), axis=-1).reshape(-1, 2)
    >>> (running @ net)[:, 0].round(9).tolist(), (inward @ net)[:, 0].round(9).tolist()
    ([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]], [[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
    """
    ones = np.ones_like(along)
    borders = ((along, -ones), (ones, along), (-along, ones), (-ones, -along))
    running, inward = [], []
    for k, (u, v) in enumerate(borders):
        _, by_u, by_v = rational_basis(weights, (knots, knots), np.stack([u, v], axis=-1), 1)
        running.append((by_u, by_v, -by_u, -by_v)[k])
        inward.append((by_v, -by_u, -by_v, by_u)[k])
    return np.stack(running), np.stack(inward)


def inner_controls(count: int, rows: int = 1) -> Booleans:
    """Mask of the control points inside so many outer rows; shape (count * count,).

    Inside one, none moves a border curve; inside two, none turns a tangent plane there.
    """
    inner = np.zeros((count, count), dtype=bool)
    inner[rows:-rows, rows:-rows] = True
    return inner.ravel()


def least_change(
    responses: Floats, rates: Floats, normals: Floats, wanted: Floats, firmness: float | None = None
) -> Floats:
    """Least change of control points by which rates get the wanted parts along normals.

    With x the change, the minimum of ``x . gram x`` under ``m . (rates x) = wanted``, by Lagrange multipliers; or, for a
    finite firmness, of that and a penalty on what is missed, so that conditions may be more than control points can
    meet.

    Parameters
    ----------
    responses : ndarray, shape (k, q)
        Inverse of the Gram matrix of the basis functions, times ``rates`` transposed.
    rates : ndarray, shape (q, k)
        On the control points that may move.
    normals : ndarray, shape (..., q, 3)
    wanted : ndarray, shape (..., q)
    firmness : float, optional
        Weight of the penalty, in units of the mean compliance; conditions are met exactly if left out.

    Returns
    -------
    ndarray, shape (..., k, 3)

    Examples
    --------
    >>> least_change(np.ones((2, 1)), np.ones((1, 2)), np.array([[0.0, 0.0, 1.0]]), np.array([3.0])).tolist()
    [[0.0, 0.0, 1.5], [0.0, 0.0, 1.5]]
    """
    compliance = rates @ responses
    system = compliance * (normals @ np.swapaxes(normals, -1, -2))
    if firmness is not None:
        system += np.eye(len(rates)) * (np.trace(compliance) / len(rates) / firmness)
    multipliers = np.linalg.solve(system, wanted[..., np.newaxis])
    return np.asarray(responses @ (multipliers * normals))

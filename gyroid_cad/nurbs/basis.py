"""B-spline basis functions, rational ones, and how quotients of B-splines are differentiated.

Algorithms after Piegl and Tiller, The NURBS Book (2nd ed.); numbers such as A2.2 are theirs. All others than this room
ask for points and derivatives of :mod:`gyroid_cad.nurbs.surface` and :mod:`gyroid_cad.nurbs.volume`, or for the
matrices of functions made here: nobody else evaluates a B-spline.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache, reduce
from itertools import product
from math import comb, prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "basis",
    "border_rates",
    "component_images",
    "gauss_points",
    "greville",
    "images",
    "inner_controls",
    "least_change",
    "orders",
    "quotients",
    "rational_basis",
    "uniform_knots",
]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Order = tuple[int, ...]

# Of rows, columns and length of a product.
_ONE_THREAD, _ROWS_AT_ONCE = 2**18, 64


def uniform_knots(control_points: int, degree: int = 3) -> Floats:
    """Clamped knot vector on [-1, 1] with evenly spaced inner knots; shape (control_points + degree + 1,)."""
    inner = np.linspace(-1.0, 1.0, control_points - degree + 1)
    return np.concatenate([np.full(degree, -1.0), inner, np.full(degree, 1.0)])


def greville(knots: Floats, degree: int) -> Floats:
    """Places of control points that make a straight line of itself: averages of so many knots as the degree (Greville).

    Parameters
    ----------
    knots : ndarray, shape (n + degree + 1,)
        Clamped.
    degree : int

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> greville(uniform_knots(5), 3).round(6).tolist()
    [-1.0, -0.666667, 0.0, 0.666667, 1.0]
    """
    places = np.lib.stride_tricks.sliding_window_view(knots[1:-1], degree).mean(axis=1)
    return np.asarray(np.clip(places, knots[0], knots[-1]))


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
    functions = np.zeros((len(x), count))
    if derivative > degree:
        return functions
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, degree, count - 1)
    # Of each degree only those functions are held that do not vanish on the span: they are one more than the degree.
    held = [np.ones(len(x))]
    for p in range(1, degree + 1):
        raised = [np.zeros(len(x)) for _ in range(p + 1)]
        for i, function in enumerate(held):
            low, high = knots[span + 1 - p + i], knots[span + 1 + i]
            scaled = function / (high - low)
            if p > degree - derivative:
                raised[i] -= p * scaled
                raised[i + 1] += p * scaled
            else:
                raised[i] += (high - x) * scaled
                raised[i + 1] += (x - low) * scaled
        held = raised
    rows = np.arange(len(x))
    for i, function in enumerate(held):
        functions[rows, span - degree + i] = function
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


@lru_cache
def orders(highest: int, parameters: int) -> tuple[Order, ...]:
    """Orders of derivatives by each of some parameters, up to a total, lower ones first.

    Examples
    --------
    >>> orders(2, 2)
    ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
    """
    every = (order for order in product(range(highest + 1), repeat=parameters) if sum(order) <= highest)
    return tuple(sorted(every, key=lambda order: (sum(order), [-along for along in order])))


def quotients(values: Mapping[Order, Floats], weights: Mapping[Order, Floats]) -> dict[Order, Floats]:
    """Derivatives of A / w from those of A and of w, by the product rule on A = w (A / w) (A4.2, A4.4).

    Parameters
    ----------
    values, weights : mapping of order to ndarray
        Of A and w, by the orders of their derivatives; lower ones first, as :func:`orders` gives them.

    Returns
    -------
    dict of order to ndarray
    """
    found: dict[Order, Floats] = {}
    for order, value in values.items():
        rest = value
        for lower in product(*(range(k + 1) for k in order)):
            if any(lower):
                left = tuple(k - i for k, i in zip(order, lower, strict=True))
                rest = rest - prod(map(comb, order, lower)) * weights[lower] * found[left]
        found[order] = rest / weights[(0,) * len(order)]
    return found


def rational_basis(weights: Floats, knots: tuple[Floats, ...], places: Floats, order: int = 0) -> Floats:
    """Rational basis functions (eqs. (4.2), (4.12)) and their derivatives, as matrices on control points.

    Parameters
    ----------
    weights : ndarray, shape (n,), (n, m) or (n, m, k)
        Of a curve, a surface or a volume.
    knots : tuple of ndarray
        Along each parameter.
    places : ndarray, shape (places, parameters)
    order : int
        Highest total order of derivatives wanted.

    Returns
    -------
    ndarray, shape (orders, places, control points)
        In the order of :func:`orders`.

    Examples
    --------
    >>> rational_basis(np.ones(4), (uniform_knots(4),), np.array([[0.0]]))
    array([[[0.125, 0.375, 0.375, 0.125]]])
    """
    along = [
        [basis(k, len(k) - count - 1, x, derivative) for derivative in range(order + 1)]
        for k, count, x in zip(knots, weights.shape, places.T, strict=True)
    ]
    values, sums = {}, {}
    for each in orders(order, weights.ndim):
        functions = [along[axis][derivative] for axis, derivative in enumerate(each)]
        products = reduce(lambda a, b: (a[:, :, np.newaxis] * b[:, np.newaxis]).reshape(len(a), -1), functions)
        values[each] = products * weights.ravel()
        sums[each] = values[each].sum(axis=1, keepdims=True)
    return np.stack(list(quotients(values, sums).values()))


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


def images(matrix: Floats, controls: Floats) -> Floats:
    """Points of many surfaces: products of one matrix of basis functions with the control points of each.

    Parameters
    ----------
    matrix : ndarray, shape (places, controls)
    controls : ndarray, shape (surfaces, controls, components)

    Returns
    -------
    ndarray, shape (surfaces, places, components)
    """
    return np.moveaxis(component_images(matrix, controls), 0, -1)


def component_images(matrix: Floats, controls: Floats) -> Floats:
    """The same, component by component; shape (components, surfaces, places).

    Of all surfaces together, for products with three columns each take twice as long. In portions so small that
    OpenBLAS keeps to one thread (``GEMM_MULTITHREAD_THRESHOLD`` in its sources): on a busy machine its threads wait for
    each other, and products of this size take twenty times as long.

    Parameters
    ----------
    matrix, controls
        As of :func:`images`.
    """
    count, among, components = controls.shape
    rows = np.moveaxis(controls, 2, 0).reshape(-1, among)
    found = np.empty((len(rows), len(matrix)))
    wide = max(1, _ONE_THREAD // (_ROWS_AT_ONCE * max(among, 1)))
    for start in range(0, len(matrix), wide):
        columns = np.ascontiguousarray(matrix[start : start + wide].T)
        for first in range(0, len(rows), _ROWS_AT_ONCE):
            part = slice(first, first + _ROWS_AT_ONCE)
            np.matmul(rows[part], columns, out=found[part, start : start + wide])
    return found.reshape(components, count, len(matrix))


def least_change(
    responses: Floats, rates: Floats, normals: Floats, wanted: Floats, firmness: float | None = None
) -> Floats:
    """Least change of control points by which rates get the wanted parts along normals.

    Two surfaces with a border curve in common meet smoothly where the rates X_w from there inwards have no part along
    one normal m, ``m . X_w = 0``, which is linear in the control points. With x the change, it is the minimum of
    ``x . gram x`` under ``m . (rates x) = wanted``, by Lagrange multipliers: points of the surface move least in the
    mean square. With a finite firmness what is missed is a penalty, and there may be more conditions than can be met.

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

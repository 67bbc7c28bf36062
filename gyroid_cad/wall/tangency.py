"""Tangent planes along the edges of a graded wall: faces of neighbours are turned to meet smoothly.

Fits of neighbours, each made by itself, have their edge in common and differ, by the error of the fit, in how they
leave it: by a tenth of a degree at 10 x 10. Both are turned to the mean of their normals: first the edges' ends, so
that at every corner all rates lie in one plane, then each patch along its four edges, by the least change of its inner
control points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.nurbs.basis import (
    basis,
    border_rates,
    gauss_points,
    images,
    inner_controls,
    least_change,
    uniform_knots,
)
from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["smoothed"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]

_DEGREE = 3
# In degrees. Faces that meet so well are left as they are; where they meet at more than the larger angle, the field
# itself has an edge, or the fit is too coarse to tell.
_SMOOTH_ENOUGH, _MEANT_SMOOTH = 0.015, 0.5
# Turned, faces meet at a new mean: once more halves what is left.
_ROUNDS = 2
# Places on an edge at which its tangent plane is asked for, by control points; and how firmly.
_PLACES_PER_CONTROL_POINT = 1.5
_FIRMNESS = 1e3
# Of an edge's ends: exactly, but for normals that have no mean.
_FIRMLY = 1e9
# So few that their systems of equations stay in the processor's cache.
_FACES_AT_ONCE = 32


@dataclass(frozen=True, slots=True, eq=False)
class _Borders:
    """Rates at the borders of a patch, and how its control points answer.

    Attributes
    ----------
    inner : ndarray of bool, shape (n * n,)
        Control points that no edge has.
    end_rates, end_responses : ndarray, shape (2, n), (n - 2, 2)
        Of a curve at its ends; of its inner control points to unit conditions there.
    running, inward : ndarray, shape (4 q, n * n)
        Along the edges, and across.
    responses : ndarray, shape (inner, 4 q)
    follow : ndarray, shape (inner, n * n - inner)
        Change of the inner control points by which least squares answer one of the edges'.
    """

    inner: Booleans
    end_rates: Floats
    end_responses: Floats
    running: Floats
    inward: Floats
    responses: Floats
    follow: Floats


@lru_cache(maxsize=8)
def _borders(control_points: int) -> _Borders:
    knots = uniform_knots(control_points)
    places, quadrature = gauss_points(knots, _DEGREE + 1)
    functions = basis(knots, _DEGREE, places)
    gram = functions.T * quadrature @ functions
    compliance = np.linalg.inv(gram[1:-1, 1:-1])
    end_rates = basis(knots, _DEGREE, np.array([-1.0, 1.0]), 1)
    inner = inner_controls(control_points)
    # At the ends the edges beyond say how the surface leaves.
    along = np.linspace(-1, 1, round(_PLACES_PER_CONTROL_POINT * control_points))[1:-1]
    running, inward = (
        rates.reshape(-1, len(inner)) for rates in border_rates(np.ones((control_points,) * 2), knots, along)
    )
    compliances = np.kron(compliance, compliance)
    return _Borders(
        inner=inner,
        end_rates=end_rates,
        end_responses=compliance @ end_rates[:, 1:-1].T,
        running=running,
        inward=inward,
        responses=compliances @ inward[:, inner].T,
        follow=-compliances @ np.kron(gram, gram)[np.ix_(inner, ~inner)],
    )


def smoothed(wall: Wall) -> Wall:
    """Turn the faces of neighbouring patches to common tangent planes along their edges.

    Edges stay common, to rounding. Where faces meet at half a degree and more they are left as they are.

    Parameters
    ----------
    wall : Wall
        In which every patch has a net of its own, without weights.

    Returns
    -------
    Wall
    """
    borders = _borders(len(wall.weights))
    nets = wall.nets.reshape(-1, len(borders.inner), 3).copy()
    for turn in range(_ROUNDS):
        common, wanted, apart = _conditions(wall, nets, borders)
        worst = apart.reshape(len(wall.nets), -1).max(axis=1)
        if worst.max() <= _SMOOTH_ENOUGH:
            break
        if turn == 0:
            _turn_ends(wall, nets, borders)
            common, wanted, _ = _conditions(wall, nets, borders)
        faces = np.flatnonzero(np.repeat(worst > _SMOOTH_ENOUGH, len(SIDES)))
        inner, rates = np.flatnonzero(borders.inner), borders.inward[:, borders.inner]
        for first in range(0, len(faces), _FACES_AT_ONCE):
            some = faces[first : first + _FACES_AT_ONCE]
            change = least_change(borders.responses, rates, common[some], wanted[some], _FIRMNESS)
            nets[some[:, np.newaxis], inner] += change
    return replace(wall, nets=nets.reshape(wall.nets.shape))


def _conditions(wall: Wall, nets: Floats, borders: _Borders) -> tuple[Floats, Floats, Floats]:
    """Normals that neighbours are to have in common along the edges of each face, and what is missing.

    Returns
    -------
    common : ndarray, shape (faces, 4 q, 3)
    wanted : ndarray, shape (faces, 4 q)
        Change of the parts along them of the rates inwards.
    apart : ndarray, shape (faces, 4 q)
        Angle between neighbours' normals, in degrees; nothing where they are not to have one in common.
    """
    inward = images(borders.inward, nets)
    common, apart = _at_edges(wall, unit(np.cross(images(borders.running, nets), inward)))
    meant = apart <= _MEANT_SMOOTH
    return common, np.where(meant, -dot(inward, common), 0.0), np.where(meant, apart, 0.0)


def _at_edges(wall: Wall, normals: Floats) -> tuple[Floats, Floats]:
    """The mean of each face's and its neighbour's normals along its edges, and their angle, as of :func:`_common`."""
    complex = wall.complex
    # By patch, edge and side; along the edge as the edge runs, whichever way the patch does.
    by_edge = np.ascontiguousarray(np.swapaxes(normals.reshape(complex.patch_count, len(SIDES), 4, -1, 3), 1, 2))
    backwards = ~complex.edge_forward
    by_edge[backwards] = by_edge[backwards][..., ::-1, :]
    mean, apart = _common(complex.patch_edges.ravel(), by_edge.reshape(-1, *by_edge.shape[2:]))
    mean, apart = mean.reshape(by_edge.shape), apart.reshape(by_edge.shape[:-1])
    mean[backwards] = mean[backwards][..., ::-1, :]
    apart[backwards] = apart[backwards][..., ::-1]
    return np.swapaxes(mean, 1, 2).reshape(normals.shape), np.swapaxes(apart, 1, 2).reshape(normals.shape[:-1])


def _common(numbers: Integers, normals: Floats) -> tuple[Floats, Floats]:
    """Mean of the normals of the same number, and the angle between them.

    Parameters
    ----------
    numbers : ndarray of int, shape (m,)
    normals : ndarray, shape (m, ..., 3)

    Returns
    -------
    mean : ndarray, shape (m, ..., 3)
    apart : ndarray, shape (m, ...)
        Twice the largest angle from the mean, in degrees.
    """
    order = np.argsort(numbers, kind="stable")
    _, first, group = np.unique(numbers[order], return_index=True, return_inverse=True)
    member = np.empty(len(numbers), dtype=np.int64)
    member[order] = group
    mean = unit(np.add.reduceat(normals[order], first))[member]
    chord = np.linalg.norm(normals - mean, axis=-1)
    widest = np.maximum.reduceat(chord[order], first)[member]
    return mean, np.degrees(4 * np.arcsin(np.minimum(widest / 2, 1.0)))


def _turn_ends(wall: Wall, nets: Floats, borders: _Borders) -> None:
    """Turn the ends of all edges into the tangent planes of the corners, the means of the faces' that meet there."""
    complex, count = wall.complex, len(wall.weights)
    grid = nets.reshape(-1, count, count, 3)
    change = np.zeros_like(grid)
    rows, changes = (np.moveaxis(net, (1, 2), (0, 1)) for net in (grid, change))
    rates = np.stack([np.einsum("ei,ifc->fec", borders.end_rates, edge_row(rows, k)) for k in range(4)], axis=1)
    # An edge leaves a corner where the one before it comes in.
    normals = unit(np.cross(np.roll(rates[:, :, 1], 1, axis=1), rates[:, :, 0]))
    by_corner = np.swapaxes(normals.reshape(-1, len(SIDES), 4, 3), 1, 2)
    mean, apart = _common(complex.patch_fans.ravel(), by_corner.reshape(-1, len(SIDES), 3))
    common = np.swapaxes(mean.reshape(by_corner.shape), 1, 2).reshape(normals.shape)
    meant = np.swapaxes(apart.reshape(by_corner.shape[:-1]), 1, 2).reshape(normals.shape[:-1]) <= _MEANT_SMOOTH
    ends = np.stack([common, np.roll(common, -1, axis=1)], axis=2)
    both_meant = np.stack([meant, np.roll(meant, -1, axis=1)], axis=2)
    wanted = np.where(both_meant, -dot(rates, ends), 0.0)
    turned = least_change(borders.end_responses, borders.end_rates[:, 1:-1], ends, wanted, _FIRMLY)
    for k in range(4):
        edge_row(changes, k)[1:-1] = np.moveaxis(turned[:, k], 1, 0)
    flat = change.reshape(nets.shape)
    flat[:, borders.inner] = images(borders.follow, flat[:, ~borders.inner])
    nets += flat

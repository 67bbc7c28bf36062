"""Deviation of triangles from the faces they stand for, and the volume they enclose.

Everything is linear in the control points: of each template there are matrices, and all patches that share it are
measured by a few products.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import cross
from gyroid_cad.mesh.triangles.templates import (
    Template,
    face_template,
    wall_template,
)
from gyroid_cad.nurbs.basis import component_images, rational_basis
from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.wall.offset import Wall

__all__ = ["canonical_edges", "face_cases", "face_deviations", "side_deviations", "triangulated_volume"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# So few that their matrices, and what is worked out of them, stay small.
_SAMPLES_AT_ONCE = 4000
_PLACES_AT_ONCE = 100_000
_ACROSS_KNOTS = np.array([0.0, 0.0, 1.0, 1.0])


def canonical_edges(wall: Wall, edges: Integers) -> tuple[Integers, Integers]:
    """Patches on which edges are evaluated, once for all that share them.

    Returns
    -------
    patches, rows : ndarray of int, shape (edges,)
        The first patch of each edge, and four times the number of its net plus which of its edges it is.
    """
    patches = wall.complex.edge_patches[edges, 0]
    sides = np.argmax(wall.complex.patch_edges[patches] == edges[:, np.newaxis], axis=1)
    return patches, wall.patch_net[patches] * 4 + sides


def face_cases(wall: Wall, patch_steps: Integers, edge_steps: Integers) -> tuple[Integers, Integers]:
    """Distinct pairs of net and template, and which of them each patch has.

    Returns
    -------
    cases : ndarray of int, shape (cases, 6)
        Steps inside, steps along edges 0 to 3, net; in this order.
    which : ndarray of int, shape (patches,)
    """
    keys = np.column_stack([patch_steps, edge_steps[wall.complex.patch_edges], wall.patch_net])
    cases, which = np.unique(keys, axis=0, return_inverse=True)
    return cases, which.ravel()


def face_deviations(wall: Wall, cases: Integers) -> Floats:
    """Largest distance in mm between triangles and faces, along the normal, of each case; the worse of both faces.

    Parameters
    ----------
    wall : Wall
    cases : ndarray of int, shape (cases, 6)
        As of :func:`face_cases`.
    """
    deviations = np.zeros((len(cases), 2))
    for template, members in _by_template(cases):
        for chords, rates in _sampled(template, wall.weights, (wall.knots, wall.knots)):
            for some in _portions(members, 2 * len(chords)):
                controls = wall.nets[cases[some, 5]].reshape(2 * len(some), -1, 3)
                found = _deviations(chords, rates, controls).reshape(-1, 2)
                deviations[some] = np.maximum(deviations[some], found)
    return np.asarray(deviations.max(axis=1))


def side_deviations(
    wall: Wall, free: Integers, steps: Integers, template: Callable[[int], Template]
) -> tuple[Floats, Integers]:
    """Deviations of distinct side walls with distinct steps along them, and the one that each boundary edge has.

    Parameters
    ----------
    wall : Wall
    free : ndarray of int, shape (boundary edges,)
    steps : ndarray of int, shape (boundary edges,)
    template : callable
        From the steps along a side wall to its triangles.
    """
    keys, which = _side_cases(wall, free, steps)
    deviations = np.zeros(len(keys))
    for along, weights, members in _by_weights(wall, keys):
        rails = _rails(wall, keys[members, 1])
        for chords, rates in _sampled(template(along), weights, (wall.knots, _ACROSS_KNOTS)):
            deviations[members] = np.maximum(deviations[members], _deviations(chords, rates, rails))
    return deviations, which


def triangulated_volume(wall: Wall, patch_steps: Integers, edge_steps: Integers, across: int) -> float:
    """Volume in mm3 that the triangles of faces and side walls enclose, by the divergence theorem."""
    shifts = wall.shifts[wall.patch_shift]
    cases, which = face_cases(wall, patch_steps, edge_steps)
    # Of each case the sum of det(a, b, c) / 6, and then the vector of area.
    sums = np.zeros((len(cases), 4))
    for template, members in _by_template(cases):
        nodes = rational_basis(wall.weights, (wall.knots, wall.knots), template.places)[0]
        for some in _portions(members, 2 * len(nodes)):
            controls = wall.nets[cases[some, 5]].reshape(2 * len(some), -1, 3)
            below, above = np.moveaxis(_sums(template, nodes, controls).reshape(-1, 2, 4), 1, 0)
            sums[some] = above - below
    volume = _shifted(sums[which], shifts)
    free = np.flatnonzero(wall.complex.free)
    keys, which = _side_cases(wall, free, edge_steps[free])
    sums = np.zeros((len(keys), 4))
    for along, weights, members in _by_weights(wall, keys):
        template = wall_template(along, across)
        nodes = rational_basis(weights, (wall.knots, _ACROSS_KNOTS), template.places)[0]
        sums[members] = _sums(template, nodes, _rails(wall, keys[members, 1]))
    return volume + _shifted(sums[which], shifts[canonical_edges(wall, free)[0]])


def _by_template(cases: Integers) -> Iterator[tuple[Template, Integers]]:
    keys, which = np.unique(cases[:, :5], axis=0, return_inverse=True)
    for number, key in enumerate(keys.tolist()):
        yield face_template(key[0], (key[1], key[2], key[3], key[4])), np.flatnonzero(which.ravel() == number)


def _side_cases(wall: Wall, free: Integers, steps: Integers) -> tuple[Integers, Integers]:
    """Distinct pairs of steps and canonical edge, and which of them each boundary edge has."""
    keys, which = np.unique(np.column_stack([steps, canonical_edges(wall, free)[1]]), axis=0, return_inverse=True)
    return keys, which.ravel()


def _by_weights(wall: Wall, keys: Integers) -> Iterator[tuple[int, Floats, Integers]]:
    """Steps, weights (n, 2) of the side wall, and the side walls that have both: mostly all edges are alike."""
    rows = np.stack([edge_row(wall.weights, edge) for edge in range(4)])
    kinds, kind_of_edge = np.unique(rows, axis=0, return_inverse=True)
    kind = kind_of_edge.ravel()[keys[:, 1] % 4]
    for along, number in np.unique(np.column_stack([keys[:, 0], kind]), axis=0).tolist():
        weights = np.repeat(kinds[number][:, np.newaxis], 2, axis=1)
        yield along, weights, np.flatnonzero((keys[:, 0] == along) & (kind == number))


def _rails(wall: Wall, rows: Integers) -> Floats:
    """Control points (rows, 2 n, 3) of side walls, those of ``Wall.side_wall`` for many at once."""
    count = wall.nets.shape[2]
    rails = np.empty((len(rows), count, 2, 3))
    for edge in range(4):
        some = np.flatnonzero(rows % 4 == edge)
        # The first two axes are to be those of the patch's grid.
        rails[some] = edge_row(wall.nets[rows[some] // 4].transpose(2, 3, 0, 1, 4), edge).transpose(1, 0, 2, 3)
    return rails.reshape(len(rows), 2 * count, 3)


def _sampled(template: Template, weights: Floats, knots: tuple[Floats, Floats]) -> Iterator[tuple[Floats, Floats]]:
    """Matrices on control points, of some centroids of triangles and middles of their sides at a time.

    Yields
    ------
    chords : ndarray, shape (samples, controls)
        From the surface to the triangles.
    rates : ndarray, shape (2, samples, controls)
        Derivatives of the surface.
    """
    nodes = rational_basis(weights, knots, template.places)[0]
    # Centroids are a third of each of three corners, middles a half of each of two.
    corners = np.concatenate([template.triangles, template.sides[:, [0, 1, 0]]])
    shares = np.concatenate(
        [np.full((len(template.triangles), 3), 1 / 3), np.tile([0.5, 0.5, 0.0], (len(template.sides), 1))]
    )
    for first in range(0, len(corners), _SAMPLES_AT_ONCE):
        some, share = corners[first : first + _SAMPLES_AT_ONCE], shares[first : first + _SAMPLES_AT_ONCE, :, np.newaxis]
        at, flat = (sum(values[some[:, k]] * share[:, k] for k in range(3)) for values in (template.places, nodes))
        surface = rational_basis(weights, knots, np.asarray(at), 1)
        yield flat - surface[0], surface[1:]


def _deviations(chords: Floats, rates: Floats, controls: Floats) -> Floats:
    normals = cross(component_images(rates[0], controls), component_images(rates[1], controls))
    along = np.abs(np.sum(component_images(chords, controls) * normals, axis=0))
    return np.asarray(np.max(along / np.sqrt(np.sum(normals**2, axis=0)), axis=1))


def _sums(template: Template, nodes: Floats, controls: Floats) -> Floats:
    """Sums over the triangles of surfaces of det(a, b, c) / 6 and of the vectors of area; shape (surfaces, 4)."""
    points = component_images(nodes, controls)
    a, b, c = (points[:, :, template.triangles[:, k]] for k in range(3))
    twice = cross(b - a, c - a)
    return np.column_stack([np.sum(a * twice, axis=(0, 2)) / 6, twice.sum(axis=2).T / 2])


def _shifted(sums: Floats, shifts: Floats) -> float:
    """Volume, when every surface is shifted from where it was summed."""
    return float(sums[:, 0].sum() + np.sum(sums[:, 1:] * shifts) / 3)


def _portions(members: Integers, places_each: int) -> Iterator[Integers]:
    size = max(1, _PLACES_AT_ONCE // places_each)
    return (members[first : first + size] for first in range(0, len(members), size))

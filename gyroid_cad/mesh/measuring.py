"""How far triangles are from the faces they stand for, and what volume they enclose.

Everything is linear in the control points: of each template there are matrices, and all patches that share it are
measured by a few products.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.mesh.templates import Template, face_template, images, rational_basis, wall_template
from gyroid_cad.nurbs import edge_row
from gyroid_cad.wall import Wall

__all__ = ["Measured", "canonical_edges", "enclosed_volume", "face_cases", "measured_faces", "measured_side_walls"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Key = tuple[int, int, int, int, int]

_NUMBERS_AT_ONCE = 3_000_000
_ACROSS_KNOTS = np.array([0.0, 0.0, 1.0, 1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """What was measured of faces, or of side walls.

    Attributes
    ----------
    deviation : ndarray, shape (cases,)
        Largest distance between triangles and surface, along its normal, in mm.
    volume : ndarray, shape (cases,)
        Sum over the triangles of det(a, b, c) / 6, in mm3.
    area : ndarray, shape (cases, 3)
        Sum of their vectors of area, in mm2.
    """

    deviation: Floats
    volume: Floats
    area: Floats


def canonical_edges(wall: Wall, edges: Integers) -> tuple[Integers, Integers]:
    """Where edges are evaluated, once for all that share them.

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


def measured_faces(wall: Wall, cases: Integers, deviation: bool = True) -> Measured:
    """The worse of both faces of each case; volume and area of both together, oriented outwards.

    Parameters
    ----------
    wall : Wall
    cases : ndarray of int, shape (cases, 6)
        As of :func:`face_cases`.
    deviation : bool
        Whether to measure it; else it is 0.
    """
    result = _empty(len(cases))
    keys, which = np.unique(cases[:, :5], axis=0, return_inverse=True)
    for number, key in enumerate(keys.tolist()):
        template = face_template(key[0], (key[1], key[2], key[3], key[4]))
        matrices = _Matrices.of(template, wall.weights, (wall.knots, wall.knots), deviation)
        for some in _portions(np.flatnonzero(which.ravel() == number), 2 * matrices.size):
            controls = wall.nets[cases[some, 5]]
            both = matrices.measured(controls.reshape(2 * len(some), -1, 3))
            result.deviation[some] = both.deviation.reshape(-1, 2).max(axis=1)
            result.volume[some] = np.diff(both.volume.reshape(-1, 2))[:, 0]
            result.area[some] = np.diff(both.area.reshape(-1, 2, 3), axis=1)[:, 0]
    return result


def measured_side_walls(
    wall: Wall, free: Integers, steps: Integers, template: Callable[[int], Template]
) -> tuple[Measured, Integers]:
    """Distinct side walls with distinct steps along them, and which of them each free edge has.

    Parameters
    ----------
    wall : Wall
    free : ndarray of int, shape (free edges,)
    steps : ndarray of int, shape (free edges,)
    template : callable
        From the steps along a side wall to its triangles.
    """
    rows = canonical_edges(wall, free)[1]
    keys, which = np.unique(np.column_stack([steps, rows]), axis=0, return_inverse=True)
    result = _empty(len(keys))
    for along, edge in np.unique(np.column_stack([keys[:, 0], keys[:, 1] % 4]), axis=0).tolist():
        weights = np.repeat(edge_row(wall.weights, edge)[:, np.newaxis], 2, axis=1)
        matrices = _Matrices.of(template(along), weights, (wall.knots, _ACROSS_KNOTS))
        for some in _portions(np.flatnonzero((keys[:, 0] == along) & (keys[:, 1] % 4 == edge)), matrices.size):
            # Of the nets' axes (wall, side, u, v, component) the first two of each patch's own grid are wanted first.
            nets = wall.nets[keys[some, 1] // 4].transpose(2, 3, 0, 1, 4)
            rails = edge_row(nets, edge).transpose(1, 0, 2, 3)
            measured = matrices.measured(rails.reshape(len(some), -1, 3))
            result.deviation[some] = measured.deviation
            result.volume[some] = measured.volume
            result.area[some] = measured.area
    return result, which.ravel()


def enclosed_volume(wall: Wall, patch_steps: Integers, edge_steps: Integers, across: int) -> float:
    """Volume in mm3 that the triangles of faces and side walls enclose, by the divergence theorem."""
    shifts = wall.shifts[wall.patch_shift]
    cases, which = face_cases(wall, patch_steps, edge_steps)
    volume = _shifted_volume(measured_faces(wall, cases, deviation=False), which, shifts)
    free = np.flatnonzero(wall.complex.free)
    sides, which = measured_side_walls(wall, free, edge_steps[free], lambda along: wall_template(along, across))
    return volume + _shifted_volume(sides, which, shifts[canonical_edges(wall, free)[0]])


def _shifted_volume(measured: Measured, which: Integers, shifts: Floats) -> float:
    """Sum over places of what det(a, b, c) / 6 becomes when everything is shifted."""
    return float(measured.volume[which].sum() + np.sum(measured.area[which] * shifts) / 3)


def _empty(count: int) -> Measured:
    return Measured(np.zeros(count), np.zeros(count), np.zeros((count, 3)))


def _portions(members: Integers, numbers_each: int) -> Iterator[Integers]:
    size = max(1, _NUMBERS_AT_ONCE // numbers_each)
    return (members[first : first + size] for first in range(0, len(members), size))


@dataclass(frozen=True, slots=True, eq=False)
class _Matrices:
    """A template's places, and the places where it is measured, as matrices on control points.

    Attributes
    ----------
    triangles : ndarray of int, shape (triangles, 3)
    nodes : ndarray, shape (places, controls)
    chords : ndarray, shape (samples, controls)
        From the surface to the triangles, at centroids of triangles and at middles of sides.
    rates : ndarray, shape (2, samples, controls)
        Derivatives of the surface there.
    """

    triangles: Integers
    nodes: Floats
    chords: Floats
    rates: Floats

    @classmethod
    def of(cls, template: Template, weights: Floats, knots: tuple[Floats, Floats], deviation: bool = True) -> _Matrices:
        nodes = rational_basis(weights, knots, template.places)[0]
        parts = (template.triangles, template.sides) if deviation else ()
        at = np.concatenate([np.empty((0, 2)), *(template.places[part].mean(axis=1) for part in parts)])
        flat = np.concatenate([np.empty((0, weights.size)), *(nodes[part].mean(axis=1) for part in parts)])
        samples = rational_basis(weights, knots, at)
        return cls(template.triangles, nodes, flat - samples[0], samples[1:])

    @property
    def size(self) -> int:
        """Numbers that one surface takes while it is measured."""
        return 9 * (len(self.chords) + len(self.nodes))

    def measured(self, controls: Floats) -> Measured:
        """Measure surfaces, control points of shape (surfaces, controls, 3)."""

        def applied(matrix: Floats) -> Floats:
            """Components first, then surfaces and places."""
            return np.ascontiguousarray(np.moveaxis(images(matrix, controls), -1, 0))

        normals = _cross(applied(self.rates[0]), applied(self.rates[1]))
        off = np.abs(np.sum(applied(self.chords) * normals, axis=0)) / np.sqrt(np.sum(normals**2, axis=0))
        points = applied(self.nodes)
        a, b, c = (points[:, :, self.triangles[:, k]] for k in range(3))
        twice = _cross(b - a, c - a)
        return Measured(off.max(axis=1, initial=0.0), np.sum(a * twice, axis=(0, 2)) / 6, twice.sum(axis=2).T / 2)


def _cross(a: Floats, b: Floats) -> Floats:
    """Vector products, components first: several times quicker than ``numpy.cross``."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])

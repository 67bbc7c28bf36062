"""Fluxes and areas of what is left where a wall and a part cross, by Green's theorem along the borders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.nurbs.basis import basis, gauss_points
from gyroid_cad.nurbs.quadrature import SquareQuadrature
from gyroid_cad.trim.boundary import BoundaryFace
from gyroid_cad.trim.crossing import Crossing, CutLoops
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.sections import section_knots
from gyroid_cad.wall.offset import Wall

__all__ = ["Measures", "boundary_measures", "joined", "lattice_measures", "whole_measures"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_PER_STRETCH, _RIM_PIECES, _PART_PIECES = 3, 8, 16


@dataclass(frozen=True, slots=True, eq=False)
class Measures:
    """Of pieces of faces, where they are oriented outwards.

    Attributes
    ----------
    flux : ndarray, shape (pieces,)
        Of (p - middle) / 3 through each, in mm3: of a closed surface the volume in it.
    area : ndarray, shape (pieces,)
        In mm2.
    """

    flux: Floats
    area: Floats


def joined(*measures: Measures) -> Measures:
    """Measures of several sets of pieces, one after the other."""
    return Measures(*(np.concatenate([getattr(some, name) for some in measures]) for name in ("flux", "area")))


def whole_measures(wall: Wall, whole: list[tuple[int, int, bool]], middle: Floats) -> Measures:
    """Measure whole faces of a wall, by patch and side, and whether they are used against their normal."""
    if not whole:
        return Measures(np.zeros(0), np.zeros(0))
    patch, side, backwards = (np.array(some) for some in zip(*whole, strict=True))
    net = wall.patch_net[patch]
    pairs, index = np.unique(np.stack([net, side]), axis=1, return_inverse=True)
    sums = SquareQuadrature(wall.knots).over_square(wall.nets[pairs[0], pairs[1]], wall.weights)[index.ravel()]
    shift = wall.shifts[wall.patch_shift[patch]] - middle
    sign = np.where(backwards, -1.0, 1.0)
    return Measures(sign * (sums[:, 0] + dot(shift, sums[:, 1:4]) / 3), sums[:, 4])


def lattice_measures(cut: Crossing, middle: Floats) -> Measures:
    """Measure the pieces of a wall's faces."""
    wall, faces = cut.faces.wall, cut.faces
    quadrature = SquareQuadrature(wall.knots)
    densities: dict[tuple[int, int], Floats] = {}
    flux, area = [], []
    for piece in sorted(range(len(cut.lattice)), key=lambda k: _net_of(cut, cut.lattice[k])):
        loops = cut.lattice[piece]
        key = _net_of(cut, loops)
        if key not in densities:
            # Pieces come in the order of their nets, so that the samples of one are held at a time.
            densities = {key: quadrature.densities(wall.nets[None, key[0], key[1]], wall.weights)[0]}
        total = quadrature.over(*_square_border(cut, loops), densities[key])
        shift = wall.shifts[wall.patch_shift[faces.patch[loops.face]]] - middle
        sign = -1.0 if cut.backwards[loops.face] else 1.0
        flux.append((piece, sign * (total[0] + shift @ total[1:4] / 3)))
        area.append((piece, total[4]))
    return Measures(_in_order(flux), _in_order(area))


def _net_of(cut: Crossing, loops: CutLoops) -> tuple[int, int]:
    return int(cut.faces.wall.patch_net[cut.faces.patch[loops.face]]), int(cut.faces.side[loops.face])


def _in_order(found: list[tuple[int, float]]) -> Floats:
    return np.array([value for _, value in sorted(found)])


def _square_border(cut: Crossing, piece: CutLoops) -> tuple[Floats, Floats]:
    """Places along a piece's border, and weights times the rate of v; the sides where that or the integral is 0 left."""
    places, rates = [np.zeros((0, 2))], [np.zeros(0)]
    complex, patch = cut.faces.wall.complex, int(cut.faces.patch[piece.face])
    for number, forward in (use for loop in piece.loops for use in loop):
        edge = cut.edges[number]
        if edge.kind == "section":
            place, rate, weights = _along(cut.sections[edge.number].in_square, edge.first, edge.last)
            rate = rate[:, 1]
        else:
            side = complex.patch_edges[patch].tolist().index(edge.number % complex.edge_count)
            if side != 1:
                continue
            t, weights = gauss_points(np.linspace(edge.first, edge.last, _RIM_PIECES + 1), _PER_STRETCH)
            runs_on = bool(complex.edge_forward[patch, side])
            place = np.stack(square_points(side, t if runs_on else -t), axis=-1)
            rate = np.full(len(t), 1.0 if runs_on else -1.0)
        places.append(place)
        rates.append(weights * rate * (1 if forward else -1))
    return np.concatenate(places), np.concatenate(rates)


def boundary_measures(cut: Crossing, pieces: list[CutLoops], middle: Floats) -> Measures:
    """Measure pieces of the part's faces."""
    found = [_part_piece(cut, piece, middle) for piece in pieces]
    return Measures(np.array([flux for flux, _ in found]), np.array([area for _, area in found]))


def _part_piece(cut: Crossing, piece: CutLoops, middle: Floats) -> tuple[float, float]:
    face = cut.boundary.faces[piece.face]
    places, rates = [np.zeros((0, 2))], [np.zeros(0)]
    for number, forward in (use for loop in piece.loops for use in loop):
        edge = cut.edges[number]
        if edge.kind == "section":
            place, rate, weights = _along(cut.sections[edge.number].on_part, edge.first, edge.last)
        else:
            coedge = next(c for c in face.coedges if c.edge == edge.number and c.forward == forward)
            t, weights = gauss_points(np.linspace(edge.first, edge.last, _PART_PIECES + 1), _PER_STRETCH)
            place, rate, *_ = coedge.curve(t)
        places.append(place)
        rates.append(weights * rate[:, 0] * (1 if forward else -1))
    flux, area = _integrals(face, np.concatenate(places), middle)
    # The area is on the left of the border: of an antiderivative along t, less its integral along s.
    along = np.concatenate(rates)
    return -face.sign * float(along @ flux), -float(along @ area)


def _integrals(face: BoundaryFace, places: Floats, middle: Floats) -> tuple[Floats, Floats]:
    """Integrals of the densities of flux and area along t, from the face's least t to each place."""
    pieces, count = face.surface.gauss
    nodes, weights = gauss_points(np.linspace(0, 1, pieces + 1), count)
    low = face.range[0][1]
    reach = places[:, 1] - low
    t = low + reach[:, None] * nodes
    asked = np.stack([np.repeat(places[:, 0], len(nodes)), t.ravel()], axis=-1)
    vectors, points = face.surface.area_vectors(asked), face.surface.points(asked)
    flux = dot(points - middle, vectors).reshape(t.shape) / 3
    return reach * (flux @ weights), reach * (np.linalg.norm(vectors, axis=1).reshape(t.shape) @ weights)


def _along(control: Floats, first: float, last: float) -> tuple[Floats, Floats, Floats]:
    """Places and rates of a section curve at Gauss points between its stations, and their weights."""
    knots = section_knots(len(control))
    t, weights = gauss_points(np.linspace(first, last, len(control)), _PER_STRETCH)
    return basis(knots, 3, t) @ control, basis(knots, 3, t, 1) @ control, weights

"""Fluxes and areas of what is left where a wall and a part cross, by Green's theorem along the borders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, grouped
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.nurbs.quadrature import SquareQuadrature, shifted_integrals
from gyroid_cad.trim.boundary import BoundaryFace
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.free_surfaces import FreeForm, Swept
from gyroid_cad.trim.lattice_faces import LatticeFaces
from gyroid_cad.trim.pieces import Crossing, CutEdge, CutLoops
from gyroid_cad.trim.section_fit import SectionCurve
from gyroid_cad.trim.section_splines import on_section
from gyroid_cad.trim.surfaces import PartSurface, Quadric

__all__ = ["PieceMeasures", "boundary_measures", "joined", "lattice_measures", "whole_measures"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_PER_STRETCH, _PER_RIM_SPAN, _PART_PIECES = 3, 5, 64
# Of a face of the part that is no plane, along each parameter.
_SPANS, _MOST_SPANS = 12, 40


@dataclass(frozen=True, slots=True, eq=False)
class PieceMeasures:
    """Of pieces of faces, where they are oriented outwards.

    Attributes
    ----------
    flux : ndarray, shape (pieces,)
        Of (p - middle) / 3 through each, in mm3: of a closed surface the volume in it.
    area : ndarray, shape (pieces,)
        In mm2.
    moment : ndarray, shape (pieces, 3)
        Flux of (p - middle)^2 / 2 along each axis, in mm4: of a closed surface the first moments of the volume in it.
    """

    flux: Floats
    area: Floats
    moment: Floats


def joined(*measures: PieceMeasures) -> PieceMeasures:
    """PieceMeasures of several sets of pieces, one after the other."""
    names = ("flux", "area", "moment")
    return PieceMeasures(*(np.concatenate([getattr(some, name) for some in measures]) for name in names))


def whole_measures(faces: LatticeFaces, backwards: Booleans, middle: Floats) -> PieceMeasures:
    """Measure whole faces of a wall; those used against their normal are told by a mask."""
    if not len(faces):
        return PieceMeasures(np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    wall = faces.wall
    pairs, index = np.unique(np.stack([wall.patch_net[faces.patch], faces.side]), axis=1, return_inverse=True)
    sums = SquareQuadrature(wall.knots).over_square(wall.nets_of(*pairs), wall.weights, moments=True)[index.ravel()]
    shift = wall.shifts[wall.patch_shift[faces.patch]] - middle
    return _placed(sums, shift, backwards)


def lattice_measures(cut: Crossing, middle: Floats) -> PieceMeasures:
    """Measure the pieces of a wall's faces."""
    wall, faces = cut.faces.wall, cut.faces
    face = np.array([piece.face for piece in cut.lattice], dtype=np.int64)
    if not len(face):
        return PieceMeasures(np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    places, rates, piece = _square_borders(cut)
    nets, of_piece = np.unique(
        np.stack([wall.patch_net[faces.patch[face]], faces.side[face]], axis=1), axis=0, return_inverse=True
    )
    quadrature = SquareQuadrature(wall.knots)
    sums = np.zeros((len(face), 11))
    # Places come in the order of their nets, so that the samples of one are held at a time.
    for net, some in grouped(of_piece.ravel()[piece]):
        density = quadrature.densities(wall.nets_of(*nets[net, :, np.newaxis]), wall.weights, moments=True)[0]
        np.add.at(sums, piece[some], quadrature.shares(places[some], rates[some], density))
    shift = wall.shifts[wall.patch_shift[faces.patch[face]]] - middle
    return _placed(sums, shift, cut.backwards[face])


def _placed(sums: Floats, shift: Floats, backwards: Booleans) -> PieceMeasures:
    """Measures of pieces of the wall's faces, from their integrals where the distinct patches are."""
    sign = np.where(backwards, -1.0, 1.0)
    flux, moment = shifted_integrals(sums, shift)
    return PieceMeasures(sign * flux, sums[:, 4], sign[:, np.newaxis] * moment)


Stretch = tuple[Floats, Floats, Floats, Floats]


def _square_borders(cut: Crossing) -> tuple[Floats, Floats, Integers]:
    """Places along the borders of all pieces in the square, weights times the rates of v there, and the pieces."""
    uses = [
        (piece, edge, forward, len(loop), position)
        for piece, loops in enumerate(cut.lattice)
        for loop in loops.loops
        for position, (edge, forward) in enumerate(loop)
    ]
    piece, edge, forward, length, position = np.array(uses, dtype=np.int64).T
    index = np.arange(len(piece))
    following = np.where(position + 1 < length, index + 1, index - position)
    edges = [cut.edges[number] for number in edge.tolist()]
    section = np.array([one.kind == "section" for one in edges])
    turn = np.where(forward, 1.0, -1.0)

    side, limits = _on_sides(cut, np.array([cut.lattice[k].face for k in piece.tolist()]), edges)
    ends = np.stack(square_points(side[:, None], limits), axis=-1)
    rows = np.flatnonzero(section)
    curves = [cut.sections[edges[k].number].in_square for k in rows.tolist()]
    ends[rows] = np.array([control[[0, -1]] for control in curves]).reshape(-1, 2, 2)
    ends = np.where((turn > 0)[:, None, None], ends, ends[:, ::-1])
    # Where two stretches meet, what is between their ends is part of the border too: not all curves quite meet.
    starts, stops = ends[following, 0], ends[:, 1]
    places, rates, pieces = [(stops + starts) / 2], [(starts - stops)[:, 1]], [piece]

    # Of the integral from u = -1 the sides 0, 2 and 3 have nothing: either it is 0 there, or v does not change.
    rim = np.flatnonzero(~section & (side == 1))
    v, weights = _between_knots(cut.faces.wall.knots, limits[rim])
    places.append(np.stack([np.ones_like(v), v], axis=-1).reshape(-1, 2))
    rates.append((turn[rim, None] * weights).ravel())
    pieces.append(np.repeat(piece[rim], v.shape[1]))
    for count, some in grouped(np.array([len(control) for control in curves], dtype=np.int64)):
        stacked = np.stack([curves[k] for k in some.tolist()], axis=1).reshape(count, -1)
        t, weights = _gauss_between(count)
        at, rate = (on_section(stacked, t, order).reshape(len(t), -1, 2) for order in (0, 1))
        places.append(at.reshape(-1, 2))
        rates.append((turn[rows[some]] * weights[:, None] * rate[..., 1]).ravel())
        pieces.append(np.tile(piece[rows[some]], len(t)))
    return np.concatenate(places), np.concatenate(rates), np.concatenate(pieces)


def _between_knots(knots: Floats, limits: Floats) -> tuple[Floats, Floats]:
    """Gauss points (n, m) from a limit to another of each row (n, 2), and their weights; none reaches across a knot.

    There the second derivatives of what is integrated leap.
    """
    nodes, weights = np.polynomial.legendre.leggauss(_PER_RIM_SPAN)
    stops = np.clip(np.unique(knots), limits.min(axis=1, keepdims=True), limits.max(axis=1, keepdims=True))
    half, middle = np.diff(stops)[..., None] / 2, (stops[:, 1:, None] + stops[:, :-1, None]) / 2
    way = np.sign(limits[:, 1] - limits[:, 0])[:, None, None]
    shape = len(limits), half.shape[1] * len(nodes)
    return (middle + half * nodes).reshape(shape), (way * half * weights).reshape(shape)


def _on_sides(cut: Crossing, face: Integers, edges: list[CutEdge]) -> tuple[Integers, Floats]:
    """Sides of the square that edges lie on where they are rims, and where those end along them, run round it."""
    side = np.argmax(cut.faces.rims[face] == np.array([edge.number for edge in edges])[:, None], axis=1)
    sign = np.where(cut.faces.forward[face, side], 1.0, -1.0)
    return side, sign[:, None] * np.array([(edge.first, edge.last) for edge in edges])


def _border(cut: Crossing, piece: CutLoops, stretch: Callable[[CutEdge, bool], Stretch]) -> tuple[Floats, Floats]:
    """Places along a piece's border, and weights times the rate of the second parameter.

    Where two stretches meet, what is between their ends is part of the border too: an edge of the part need not quite
    lie on its faces, and an integral from the far side would make much of that.
    """
    places, rates = [np.zeros((0, 2))], [np.zeros(0)]
    for loop in piece.loops:
        ends = []
        for number, forward in loop:
            place, rate, weights, both = stretch(cut.edges[number], forward)
            places.append(place)
            rates.append(weights * rate * (1 if forward else -1))
            ends.append(both if forward else both[::-1])
        starts, stops = np.array([both[0] for both in ends]), np.array([both[1] for both in ends])
        following = np.roll(starts, -1, axis=0)
        places.append((stops + following) / 2)
        rates.append((following - stops)[:, 1])
    return np.concatenate(places), np.concatenate(rates)


def boundary_measures(cut: Crossing, pieces: list[CutLoops], middle: Floats) -> PieceMeasures:
    """Measure pieces of the part's faces."""
    totals = np.zeros((len(pieces), 5))
    for face, some in grouped(np.array([piece.face for piece in pieces], dtype=np.int64)):
        samples = _Samples(cut.boundary.faces[face], middle)
        borders = [_part_border(cut, pieces[index]) for index in some.tolist()]
        places, rates = (np.concatenate(parts) for parts in zip(*borders, strict=True))
        np.add.at(totals, np.repeat(some, [len(own) for _, own in borders]), samples.shares(places, rates))
    sign = np.array([cut.boundary.faces[piece.face].sign for piece in pieces], dtype=np.float64)
    return PieceMeasures(sign * totals[:, 0], totals[:, 1], sign[:, np.newaxis] * totals[:, 2:])


class _Samples:
    """Densities of flux, area and moments of a face of the part, sampled on a square in place of its parameters."""

    def __init__(self, face: BoundaryFace, middle: Floats) -> None:
        self.low, high = face.range
        self.scale = (high - self.low) / 2
        self.quadrature = _quadrature(self._knots(face.surface).tobytes())
        nodes = self.quadrature.places
        grid = np.stack(np.meshgrid(nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 2)
        places = self.low + self.scale * (grid + 1)
        vectors, points = face.surface.area_vectors(places), face.surface.points(places)
        flux, area = dot(points - middle, vectors) / 3, np.linalg.norm(vectors, axis=1)
        density = np.column_stack([flux, area, (points - middle) ** 2 * vectors / 2])
        self.density = density.reshape(len(nodes), len(nodes), 5) * np.prod(self.scale)

    def _knots(self, surface: PartSurface) -> Floats:
        """Knots on [-1, 1] along both parameters, such that the densities are smooth between them."""
        if isinstance(surface, Quadric):
            return np.linspace(-1, 1, 2 if surface.kind == "plane" else _SPANS + 1)
        free = surface.free if isinstance(surface, Swept) else surface
        assert isinstance(free, FreeForm)
        own = np.concatenate(
            [(breaks - low) / scale - 1 for breaks, low, scale in zip(free.breaks, self.low, self.scale, strict=True)]
        )
        # Knots of either parameter serve both; nearer than this they are one, and too many are left out.
        knots = np.round(np.concatenate([own, np.linspace(-1, 1, _SPANS // 2 + 1)]), 9)
        inner = np.unique(knots[(knots > -1 + 1e-4) & (knots < 1 - 1e-4)])
        return np.concatenate([[-1.0], inner if len(inner) < _MOST_SPANS else np.linspace(-1, 1, 25)[1:-1], [1.0]])

    def shares(self, places: Floats, rates: Floats) -> Floats:
        square = np.clip((places - self.low) / self.scale - 1, -1, 1)
        return self.quadrature.shares(square, rates / self.scale[1], self.density)


@lru_cache(maxsize=8)
def _quadrature(knots: bytes) -> SquareQuadrature:
    """Most faces have the same knots: those of planes, or of quadrics."""
    return SquareQuadrature(np.frombuffer(knots))


def _part_border(cut: Crossing, piece: CutLoops) -> tuple[Floats, Floats]:
    """Places along a piece's border on its face of the part, and weights times the rate of t."""
    face = cut.boundary.faces[piece.face]

    def stretch(edge: CutEdge, forward: bool) -> Stretch:
        if edge.kind == "section":
            return _along(cut.sections[edge.number], SectionCurve.part)
        coedge = next(c for c in face.coedges if c.edge == edge.number and c.forward == forward)
        t, weights = gauss_points(np.linspace(edge.first, edge.last, _PART_PIECES + 1), _PER_STRETCH)
        places, rates, *_ = coedge.curve(np.concatenate([t, [edge.first, edge.last]]))
        return places[:-2], rates[:-2, 1], weights, places[-2:]

    return _border(cut, piece, stretch)


def _along(section: SectionCurve, curve: Callable[..., Floats]) -> Stretch:
    """Places and rates of a section curve at Gauss points between its stations, their weights, and its ends."""
    t, weights = _gauss_between(len(section.in_space))
    return curve(section, t), curve(section, t, 1)[:, 1], weights, curve(section, np.array([0.0, 1.0]))


@lru_cache
def _gauss_between(stations: int) -> tuple[Floats, Floats]:
    return gauss_points(np.linspace(0, 1, stations), _PER_STRETCH)

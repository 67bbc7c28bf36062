"""Faces of the wall cut to a box: what is left of each, as loops of arcs in the parameter square.

The square's sides and the section curves are parted where they meet. An arc is kept if its middle lies in the box; each
kept arc runs with what is wanted on its left, so every place has one arc that ends and one that begins, and the arcs
link up to loops by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.nurbs.quadrature import SquareQuadrature
from gyroid_cad.nurbs.roots import roots
from gyroid_cad.trim.edge_crossings import PLANES, EdgeCrossings, FacesToCut, edge_crossings, square_points
from gyroid_cad.trim.loops import linked, nested
from gyroid_cad.trim.sections import Sections, plane_sections

__all__ = ["Arc", "CutFace", "FacePiece", "Node", "cut_faces"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

CORNER, RIM, BOX = "corner", "rim", "box"
# ("corner", k); ("rim", side, how many before it); ("box", index of the node, 0)
Node = tuple[str, int, int]

_CHUNK = 64
# Quadrature points a stretch between two stations of a section curve.
_PER_STRETCH = 3
_RIM_PIECES = 8
# Between places in the square found by two curves: their own closeness, and far from that of two crossings.
_SAME_PLACE = 1e-4
_OUTLINE = np.linspace(0, 1, 7)


@dataclass(frozen=True, slots=True)
class Arc:
    """A stretch of the square's side, or of a section curve.

    Attributes
    ----------
    side : int
        Of the square; -1 if the arc is one of a section curve.
    curve : int
        Of the face's section curves; -1 if the arc is one of a side.
    stretch, stretches : int
        Which stretch of the side or curve, of how many.
    first, last : float
        Its parameters there.
    start, end : Node
    """

    side: int
    curve: int
    stretch: int
    stretches: int
    first: float
    last: float
    start: Node
    end: Node


@dataclass(frozen=True, slots=True, eq=False)
class FacePiece:
    """One connected remainder of a face.

    Attributes
    ----------
    loops : list of list of Arc
        The outer one first, what is left of the face on their left.
    integrals : ndarray, shape (11,)
        As of :func:`~gyroid_cad.nurbs.surface.face_integrals`, with moments.
    """

    loops: list[list[Arc]]
    integrals: Floats


@dataclass(frozen=True, slots=True, eq=False)
class CutFace:
    """A face trimmed to a box.

    Attributes
    ----------
    pieces : list of FacePiece
    sections : Sections
        Holds the section curves of this face and of others.
    curves : list of int
        This face's, of all the section curves; an arc's ``curve`` is an index into this list.
    crossings : list of int
        How many times each side of the square crosses a plane.
    points : dict
        Of the nodes that are no corners, in mm along the box's axes.
    edges : dict
        Which two planes meet at a node on an edge of the box.
    outlines : dict
        Points along the arcs of section curves, in mm; shape (k, 3).
    """

    pieces: list[FacePiece]
    sections: Sections
    curves: list[int]
    crossings: list[int]
    points: dict[Node, Floats]
    edges: dict[Node, tuple[int, int]]
    outlines: dict[Arc, Floats]

    def plane(self, arc: Arc) -> int:
        """The plane that an arc of a section curve lies in."""
        return int(self.sections.plane[self.curves[arc.curve]])

    def on_edge(self, node: Node, plane: int) -> bool:
        """Tell whether a node lies on an edge of the box that is one of a plane's."""
        return plane in self.edges.get(node, ())

    def bulge(self, arc: Arc, x: int, y: int) -> float:
        """Area between an arc of a section curve and its chord, seen along two axes, in mm2; positive to its right."""
        curve = self.curves[arc.curve]
        t, weights = _on_pieces(arc, len(self.sections.points[curve]))
        place, rate = (self.sections.in_space(curve, t, k)[:, [x, y]] for k in (0, 1))
        ends = self.sections.in_space(curve, np.array([arc.first, arc.last]))[:, [x, y]]
        place = place - ends[0]
        return float(weights @ (place[:, 0] * rate[:, 1] - place[:, 1] * rate[:, 0])) / 2


def cut_faces(faces: FacesToCut, size: float) -> list[CutFace]:
    """Cut faces to a box.

    Parameters
    ----------
    faces : FacesToCut
    size : float
        Of a cell, in mm.

    Returns
    -------
    list of CutFace
        One a face; without pieces where the face lies outside.

    Raises
    ------
    KernelError
        If a face touches a plane of the box, so that it is in doubt what to keep.
    """
    cut = []
    for first in range(0, len(faces), _CHUNK):
        chunk = faces.chunk(first, _CHUNK)
        crossings = edge_crossings(chunk)
        cut += _Cutting(chunk, crossings, plane_sections(chunk, crossings, size)).run()
    return cut


class _Cutting:
    """Some faces, where their sides cross the planes, and their section curves."""

    def __init__(self, faces: FacesToCut, crossings: EdgeCrossings, sections: Sections) -> None:
        self.faces, self.crossings, self.sections = faces, crossings, sections
        self.curves: list[list[int]] = [[] for _ in range(len(faces))]
        for curve, face in enumerate(sections.face.tolist()):
            self.curves[face].append(curve)
        self.crossings_of: list[list[int]] = [[] for _ in range(len(faces))]
        for crossing, face in enumerate(crossings.face.tolist()):
            self.crossings_of[face].append(crossing)

    def run(self) -> list[CutFace]:
        quadrature = SquareQuadrature(self.faces.knots)
        densities = quadrature.densities(self.faces.nets, self.faces.weights, moments=True)
        found = [self._edge_points(curves) for curves in self.curves]
        arcs = [self._arcs(face, on_curves) for face, (_, _, on_curves) in enumerate(found)]
        cut = []
        for face, (curves, kept) in enumerate(zip(self.curves, self._in_box(arcs), strict=True)):
            points, edges, _ = found[face]
            pieces = [
                self._measured(curves, loops, quadrature, densities[face]) for loops in self._pieces(curves, kept)
            ]
            crossings = np.bincount(self.crossings.side[self.crossings_of[face]], minlength=4).tolist()
            for arc in kept:
                if arc.curve >= 0:
                    # Ends that are none on an edge of the box are the curve's own.
                    for node, end in ((arc.start, 0), (arc.end, -1)):
                        points.setdefault(node, self.sections.points[curves[arc.curve]][end])
            outlines = {arc: self._in_space(curves, arc) for arc in kept if arc.curve >= 0}
            cut.append(CutFace(pieces, self.sections, curves, crossings, points, edges, outlines))
        return cut

    def _edge_points(
        self, curves: list[int]
    ) -> tuple[dict[Node, Floats], dict[Node, tuple[int, int]], list[list[tuple[float, int]]]]:
        """Points where section curves of one face cross each other, on an edge of the box.

        Their points; the planes that meet there; and for each curve the parameters and numbers of those on it.
        """
        points: dict[Node, Floats] = {}
        edges: dict[Node, tuple[int, int]] = {}
        places: list[Floats] = []
        on_curves: list[list[tuple[float, int]]] = [[] for _ in curves]
        for index, curve in enumerate(curves):
            plane = int(self.sections.plane[curve])
            for other, t in self._crossings_of(curve):
                pair = (min(plane, other), max(plane, other))
                place = self.sections.in_square(curve, np.array([t]))[0]
                number = self._number_near(place, places, [edges[BOX, k, 0] == pair for k in range(len(places))])
                if number == len(places):
                    places.append(place)
                    point = self.sections.in_space(curve, np.array([t]))[0]
                    for one in pair:
                        point[PLANES[one][0]] = self._level(curve, one)
                    points[BOX, number, 0], edges[BOX, number, 0] = point, pair
                on_curves[index].append((t, number))
        return points, edges, [sorted(crossings) for crossings in on_curves]

    @staticmethod
    def _number_near(place: Floats, places: list[Floats], alike: list[bool]) -> int:
        """Number of a point that was found before from the other curve through it; or a new number."""
        for number, (other, same) in enumerate(zip(places, alike, strict=True)):
            if same and np.linalg.norm(other - place) < _SAME_PLACE:
                return number
        return len(places)

    def _level(self, curve: int, plane: int) -> float:
        return float(self.faces.levels[self.sections.face[curve], plane])

    def _crossings_of(self, curve: int) -> list[tuple[int, float]]:
        """Other planes that a section curve crosses, and its parameters there."""
        levels = self.faces.levels[self.sections.face[curve]]
        own = PLANES[self.sections.plane[curve]][0]
        others = [k for k, (axis, _) in enumerate(PLANES) if axis != own and not np.isnan(levels[k])]
        if not others:
            return []
        axes, at_levels = [PLANES[k][0] for k in others], levels[others]
        count = 4 * len(self.sections.points[curve])
        t = np.linspace(-1 / count, 1 + 1 / count, count + 3)

        def along_curve(which: Integers, t: Floats) -> tuple[Floats, Floats]:
            rows = np.arange(len(t)), np.array(axes)[which]
            return self.sections.in_space(curve, t)[rows] - at_levels[which], self.sections.in_space(curve, t, 1)[rows]

        which, places = roots(t, (self.sections.in_space(curve, t)[:, axes] - at_levels).T, along_curve)
        return [(others[k], place) for k, place in zip(which.tolist(), places.tolist(), strict=True)]

    def _arcs(self, face: int, on_curves: list[list[tuple[float, int]]]) -> list[Arc]:
        """All stretches of the square's sides and of the section curves, between the places where they meet."""
        arcs = []
        node_of: dict[int, Node] = {}
        for side in range(4):
            found = [k for k in self.crossings_of[face] if self.crossings.side[k] == side]
            node_of |= {k: (RIM, side, before) for before, k in enumerate(found)}
            stops = [-1.0, *self.crossings.along[found].tolist(), 1.0]
            nodes: list[Node] = [
                (CORNER, side, 0),
                *(node_of[k] for k in found),
                (CORNER, (side + 1) % 4, 0),
            ]
            arcs += _stretches(side, -1, stops, nodes)
        for index, curve in enumerate(self.curves[face]):
            stops = [0.0, *(t for t, _ in on_curves[index]), 1.0]
            ends = node_of[int(self.sections.start[curve])], node_of[int(self.sections.end[curve])]
            nodes = [ends[0], *((BOX, k, 0) for _, k in on_curves[index]), ends[1]]
            arcs += _stretches(-1, index, stops, nodes)
        return arcs

    def _in_box(self, arcs: list[list[Arc]]) -> list[list[Arc]]:
        """Arcs of each face whose middle lies in the box, all in one look."""
        flat = [arc for some in arcs for arc in some]
        face = np.repeat(np.arange(len(arcs)), [len(some) for some in arcs])
        middle = np.array([(arc.first + arc.last) / 2 for arc in flat])
        place = np.stack(square_points(np.maximum([arc.side for arc in flat], 0), middle), axis=-1)
        plane = np.full(len(flat), -1)
        for index in [k for k, arc in enumerate(flat) if arc.curve >= 0]:
            curve = self.curves[face[index]][flat[index].curve]
            place[index] = self.sections.in_square(curve, middle[[index]])[0]
            plane[index] = self.sections.plane[curve]
        heights = self.faces.heights(face, *place.T[..., np.newaxis])[:, 0]
        on_plane = np.flatnonzero(plane >= 0)
        heights[on_plane, plane[on_plane]] = np.inf
        keep = iter(np.all(heights > 0, axis=1).tolist())
        return [[arc for arc in some if next(keep)] for some in arcs]

    def _places(self, curves: list[int], arc: Arc, t: Floats) -> Floats:
        if arc.curve >= 0:
            return self.sections.in_square(curves[arc.curve], t)
        return np.stack(square_points(arc.side, t), axis=-1)

    def _in_space(self, curves: list[int], arc: Arc) -> Floats:
        return self.sections.in_space(curves[arc.curve], arc.first + (arc.last - arc.first) * _OUTLINE)

    def _pieces(self, curves: list[int], kept: list[Arc]) -> list[list[list[Arc]]]:
        """Loops of arcs, holes with the loop round them."""
        loops = linked(kept, "a face of the lattice")
        outlines = [self._outline(curves, loop) for loop in loops]
        return [[loops[index] for index in group] for group in nested(outlines)]

    def _outline(self, curves: list[int], loop: list[Arc]) -> Floats:
        fractions = np.linspace(0, 1, 9)[:-1]
        return np.concatenate(
            [self._places(curves, arc, arc.first + (arc.last - arc.first) * fractions) for arc in loop]
        )

    def _measured(
        self, curves: list[int], loops: list[list[Arc]], quadrature: SquareQuadrature, density: Floats
    ) -> FacePiece:
        places, rates = [np.zeros((0, 2))], [np.zeros(0)]
        for arc in (arc for loop in loops for arc in loop):
            # By Green's theorem, with an antiderivative along u that is 0 at u = -1: the other sides add nothing.
            if arc.side in (0, 2, 3):
                continue
            count = _RIM_PIECES if arc.curve < 0 else len(self.sections.points[curves[arc.curve]])
            t, weights = _on_pieces(arc, count)
            places.append(self._places(curves, arc, t))
            rate = 1.0 if arc.curve < 0 else self.sections.in_square(curves[arc.curve], t, 1)[:, 1]
            rates.append(weights * rate)
        total = quadrature.over(np.concatenate(places), np.concatenate(rates), density)
        return FacePiece(loops, total)


def _stretches(side: int, curve: int, stops: list[float], nodes: list[Node]) -> list[Arc]:
    count = len(stops) - 1
    return [Arc(side, curve, k, count, stops[k], stops[k + 1], nodes[k], nodes[k + 1]) for k in range(count)]


def _on_pieces(arc: Arc, pieces: int) -> tuple[Floats, Floats]:
    """Gauss points and weights on equal pieces of an arc."""
    return gauss_points(np.linspace(arc.first, arc.last, pieces + 1), _PER_STRETCH)

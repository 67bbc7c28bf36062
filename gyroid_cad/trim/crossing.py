"""A wall cut by a part: every vertex, edge and face of what is left of both, by number.

Nodes are found on edges alone, curves are followed between them, and everything links up by number. Of the wall's faces
what lies in the part is kept; of the part's, what lies in the region that the wall's faces bound, and the rest where it
is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.basis import basis
from gyroid_cad.trim.boundary import Boundary, BoundaryFace
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.lattice_faces import LatticeFaces, Pairs, pairs_of
from gyroid_cad.trim.loops import linked, nested
from gyroid_cad.trim.nodes import part_nodes, rim_nodes
from gyroid_cad.trim.paths import Ends, Paths, closed_paths, open_paths
from gyroid_cad.trim.section_fit import SectionCurve, fitted_sections
from gyroid_cad.trim.sections import section_knots
from gyroid_cad.wall.offset import Wall

__all__ = ["Crossing", "CutEdge", "CutLoops", "Uses", "cross"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_INWARDS = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
_CORNERS = ((0, 0), (-1, 0), (-1, -1), (0, -1))
# Points along an edge of an outline, by which holes are told from what is round them.
_OUTLINE = 9
_PULLS = 6

Uses = list[tuple[int, bool]]


@dataclass(frozen=True, slots=True)
class CutEdge:
    """An edge of what is left.

    Attributes
    ----------
    start, end : int
        Vertices.
    first, last : float
        Parameters of its curve there.
    kind : {"rim", "part", "section"}
    number : int
        Of the rim (those of side 1 after those of side 0), of the part's edge, or of the section curve.
    """

    start: int
    end: int
    first: float
    last: float
    kind: str
    number: int


@dataclass(frozen=True, slots=True, eq=False)
class CutLoops:
    """A piece of a face, by its loops of edges, each with whether it is used the way it runs.

    Attributes
    ----------
    face : int
        Of the wall's faces, or of the part's.
    loops : list
        The outer one first; the piece lies on their left where the normal of the parameters points towards one.
    whole : bool
        Whether it is all of the face.
    """

    face: int
    loops: list[Uses]
    whole: bool


@dataclass(eq=False)
class Crossing:
    """What is left of a wall's faces in a part, and of the part's boundary in and beside the region they bound.

    Attributes
    ----------
    faces : LatticeFaces
    boundary : Boundary
    pairs : Pairs
    backwards : ndarray of bool, shape (faces,)
        Of the wall's faces, whether the region lies on the side that the normal points to.
    points : list of ndarray, shape (3,)
        Vertices; the first are the part's own.
    fans : dict
        Vertices at corners of the wall's faces, by their fans; those of side 1 after those of side 0.
    edges : list of CutEdge
    sections : list of SectionCurve
    lattice : list of CutLoops
    inner, outer : list of CutLoops
        Of the part's faces in the region, and beside it.
    """

    faces: LatticeFaces
    boundary: Boundary
    pairs: Pairs
    backwards: Booleans
    points: list[Floats] = field(default_factory=list)
    fans: dict[int, int] = field(default_factory=dict)
    edges: list[CutEdge] = field(default_factory=list)
    sections: list[SectionCurve] = field(default_factory=list)
    lattice: list[CutLoops] = field(default_factory=list)
    inner: list[CutLoops] = field(default_factory=list)
    outer: list[CutLoops] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class _Link:
    start: Hashable
    end: Hashable
    edge: int
    forward: bool


def cross(
    wall: Wall,
    patches: Integers,
    sides: Iterable[tuple[int, bool]],
    boundary: Boundary,
    cell_size: float,
    in_part: Callable[[Floats], Booleans],
    in_region: Callable[[Floats], Booleans] | None,
    outer: bool = False,
) -> Crossing:
    """Cut faces of a wall and a part's boundary where they cross.

    Parameters
    ----------
    wall : Wall
    patches : ndarray of int, shape (patches,)
        All that the boundary may cross.
    sides : iterable of (int, bool)
        Which faces of a patch bound the region, and whether against their normal.
    boundary : Boundary
    cell_size : float
        In mm.
    in_part, in_region : callable
        Which of some points (n, 3) lie in the part, asked for what no curve tells of; and in the region, None if no
        piece of the part's boundary is wanted.
    outer : bool
        Whether pieces of the part's boundary beside the region are wanted too.

    Raises
    ------
    KernelError
        If the two only touch somewhere, so that it is in doubt what to keep.
    """
    sides = list(sides)
    faces = LatticeFaces(
        wall, np.tile(patches, len(sides)), np.repeat([side for side, _ in sides], len(patches)).astype(np.int64)
    )
    backwards = np.repeat([back for _, back in sides], len(patches)).astype(bool)
    made = Crossing(faces, boundary, pairs_of(faces, boundary), backwards)
    work = _Work(made, wall, cell_size)
    work.cut_lattice(in_part)
    if in_region is not None:
        work.cut_boundary(in_region, outer)
    return made


class _Work:
    def __init__(self, made: Crossing, wall: Wall, cell_size: float) -> None:
        self.made, self.wall = made, wall
        complex, faces = wall.complex, made.faces
        self.rims = faces.side[:, None] * complex.edge_count + complex.patch_edges[faces.patch]
        self.fans = faces.side[:, None] * complex.fan_count + complex.patch_fans[faces.patch]
        self.forward = complex.edge_forward[faces.patch]
        self.rim_nodes = rim_nodes(made.pairs, self.rims, self.forward)
        self.part_nodes = part_nodes(faces, made.boundary)
        made.points += list(made.boundary.vertices)
        self.first_rim_node = self._added(self.rim_nodes.points)
        self.first_part_node = self._added(self.part_nodes.points)
        self.edge_numbers: dict[tuple[str, int, int], int] = {}
        self.nodes_of_rim = _by(self.rim_nodes.rim)
        self.nodes_of_edge = _by(self.part_nodes.edge)
        self.coedge_of: dict[tuple[int, int], int] = {}
        self._find_sections(cell_size)

    def _added(self, points: Floats) -> int:
        first = len(self.made.points)
        self.made.points += list(points)
        return first

    # Sections -------------------------------------------------------------------------------------------------------

    def _find_sections(self, cell_size: float) -> None:
        pairs = self.made.pairs
        ends = self._ends()
        opened = open_paths(pairs, ends)
        closed = _halved(closed_paths(pairs, opened), self.made)
        self.made.sections += fitted_sections(pairs, opened, cell_size) + fitted_sections(pairs, closed, cell_size)
        self.sections_of_face: dict[int, list[int]] = {}
        self.sections_of_part: dict[int, list[int]] = {}
        for number, section in enumerate(self.made.sections):
            self.sections_of_face.setdefault(int(pairs.face[section.pair]), []).append(number)
            self.sections_of_part.setdefault(int(pairs.part[section.pair]), []).append(number)
            self._edge("section", number, 0, section.start, section.end, 0.0, 1.0)

    def _ends(self) -> Ends:
        pairs = self.made.pairs
        key = {pair: k for k, pair in enumerate(zip(pairs.face.tolist(), pairs.part.tolist(), strict=True))}
        rows: list[tuple[int, int, float, float, float, float]] = []
        entering: list[int] = []
        sides = _by(self.rims.ravel())
        for node, (rim, part) in enumerate(zip(self.rim_nodes.rim.tolist(), self.rim_nodes.part.tolist(), strict=True)):
            for flat in sides[rim]:
                face, side = divmod(flat, 4)
                along = self.rim_nodes.along[node] * (1 if self.forward[face, side] else -1)
                u, v = square_points(side, np.array(along))
                pair = key.get((face, part))
                if pair is None:
                    raise KernelError("a rim of the lattice crosses a face of the part that its patch does not meet")
                rows.append((pair, self.first_rim_node + node, float(u), float(v), *self.rim_nodes.places[node]))
                entering.append(-1 - side)
        for node, (edge, face) in enumerate(zip(self.part_nodes.edge.tolist(), self.part_nodes.face.tolist(), strict=True)):
            for part, index in self.made.boundary.users[edge]:
                coedge = self.made.boundary.faces[part].coedges[index]
                near = coedge.curve(self.part_nodes.along[[node]])[0][0]
                pair = key.get((face, part))
                if pair is None:
                    raise KernelError("an edge of the part crosses a patch that its face does not meet")
                up = self.part_nodes.upwards[node] == coedge.forward
                into = up != (self.made.boundary.faces[part].sign > 0)
                rows.append((pair, self.first_part_node + node, *self.part_nodes.places[node], *near))
                entering.append(int(into))
                self.coedge_of[self.first_part_node + node, 2 * part + int(into)] = index
        table = np.array(rows).reshape(-1, 6)
        pair, node = table[:, 0].astype(np.int64), table[:, 1].astype(np.int64)
        return self._settled(pair, node, table[:, 2:4], table[:, 4:], np.array(entering, dtype=np.int64))

    def _settled(self, pair: Integers, node: Integers, places: Floats, near: Floats, entering: Integers) -> Ends:
        """The ends, those on edges of the part pulled onto the curve: an edge need not quite lie on its faces."""
        pairs = self.made.pairs
        known = entering >= 0
        comes_in = entering == 1
        for step in range(_PULLS):
            height, slopes, where, _ = pairs.heights(pair, places[:, :1], places[:, 1:], near[:, None])
            near, slope = where[:, 0], slopes[:, 0]
            if step == 0:
                turned = np.stack([slope[:, 1], -slope[:, 0]], axis=-1)
                side = np.where(known, 0, -1 - entering)
                comes_in[~known] = np.sum(turned * _INWARDS[side], axis=1)[~known] > 0
            back = -slope * (height[:, 0] / np.maximum(np.sum(slope**2, axis=1), np.finfo(float).tiny))[:, None]
            places = np.where(known[:, None], places + back, places)
        return Ends(pair, node, places, near, comes_in)

    # The lattice ----------------------------------------------------------------------------------------------------

    def cut_lattice(self, in_part: Callable[[Floats], Booleans]) -> None:
        """What is left of the wall's faces in the part."""
        fans, inside = self._fans_inside(in_part)
        for face in range(len(self.made.faces)):
            links: list[_Link] = []
            cut = face in self.sections_of_face
            for side in range(4):
                rim, runs_on = int(self.rims[face, side]), bool(self.forward[face, side])
                corners = int(self.fans[face, side]), int(self.fans[face, (side + 1) % 4])
                first, last = corners if runs_on else corners[::-1]
                stretches = self._rim_stretches(face, side, rim, first, last, bool(inside[np.searchsorted(fans, first)]))
                cut |= rim in self.nodes_of_rim
                links += [self._used(number, runs_on) for number in stretches]
            links += [self._used(number_of, True) for number_of in self._section_edges(self.sections_of_face.get(face, []))]
            if not links:
                continue
            loops = linked(links, "a face of the lattice")
            outlines = [np.concatenate([self._in_square(face, link) for link in loop]) for loop in loops]
            for group in nested(outlines) if cut else [list(range(len(loops)))]:
                uses = [[(link.edge, link.forward) for link in loops[index]] for index in group]
                self.made.lattice.append(CutLoops(face, uses, not cut))

    def _fans_inside(self, in_part: Callable[[Floats], Booleans]) -> tuple[Integers, Booleans]:
        """Fans of the faces, and whether each lies in the part."""
        fans, index = np.unique(self.fans.ravel(), return_inverse=True)
        index = index.reshape(-1, 4)
        start = np.where(self.forward, index, np.roll(index, -1, axis=1)).ravel()
        end = np.where(self.forward, np.roll(index, -1, axis=1), index).ravel()
        rims = self.rims.ravel()
        crossed = np.isin(rims, self.rim_nodes.rim)
        told = np.zeros((2, len(fans)), dtype=bool)
        for rim, first, last in zip(rims[crossed].tolist(), start[crossed].tolist(), end[crossed].tolist(), strict=True):
            nodes = self.nodes_of_rim[rim]
            told[int(not self.rim_nodes.inwards[nodes[0]]), first] = True
            told[int(self.rim_nodes.inwards[nodes[-1]]), last] = True
        corner = np.empty(len(fans), dtype=np.int64)
        corner[index.ravel()] = np.arange(index.size)
        face, which = np.divmod(corner, 4)
        nets = self.made.faces.nets
        self.corner_points = np.array([nets[f][_CORNERS[k]] for f, k in zip(face.tolist(), which.tolist(), strict=True)])
        self.corner_fans = fans
        inside = _decided(len(fans), start[~crossed], end[~crossed], told, lambda some: in_part(self.corner_points[some]))
        return fans, inside

    def _rim_stretches(self, face: int, side: int, rim: int, first: int, last: int, inside: bool) -> list[int]:
        """Edges of a rim that lie in the part."""
        nodes = self.nodes_of_rim.get(rim, [])
        stops = [-1.0, *self.rim_nodes.along[nodes].tolist(), 1.0]
        vertices = [None, *(self.first_rim_node + node for node in nodes), None]
        kept = []
        for k in range(len(stops) - 1):
            if inside:
                start, end = vertices[k], vertices[k + 1]
                start = self._fan(first) if start is None else start
                end = self._fan(last) if end is None else end
                kept.append(self._edge("rim", rim, k, start, end, stops[k], stops[k + 1]))
            if k < len(nodes):
                if bool(self.rim_nodes.inwards[nodes[k]]) == inside:
                    raise KernelError("a rim of the lattice comes into the part twice, and does not leave it between")
                inside = not inside
        return kept

    def _fan(self, fan: int) -> int:
        if fan not in self.made.fans:
            self.made.fans[fan] = len(self.made.points)
            self.made.points.append(self.corner_points[np.searchsorted(self.corner_fans, fan)])
        return self.made.fans[fan]

    def _in_square(self, face: int, link: _Link) -> Floats:
        edge = self.made.edges[link.edge]
        t = np.linspace(edge.first, edge.last, _OUTLINE)
        t = (t if link.forward else t[::-1])[:-1]
        if edge.kind == "section":
            return _on(self.made.sections[edge.number].in_square, t)
        side = int(np.flatnonzero(self.rims[face] == edge.number)[0])
        if not self.forward[face, side]:
            t = -t
        return np.stack(square_points(side, t), axis=-1)

    # The part -------------------------------------------------------------------------------------------------------

    def cut_boundary(self, in_region: Callable[[Floats], Booleans], outer: bool) -> None:
        """What is left of the part's faces in the region, and beside it."""
        starts_inside = self._edges_inside(in_region)
        stretches = [self._part_stretches(edge, inside) for edge, inside in enumerate(starts_inside.tolist())]
        for number, face in enumerate(self.made.boundary.faces):
            self._cut_face(number, face, stretches, True, self.made.inner)
            if outer:
                self._cut_face(number, face, stretches, False, self.made.outer)

    def _leaves(self, node: int) -> bool:
        """Whether an edge of the part leaves the region at a node."""
        return bool(self.part_nodes.upwards[node] != self.made.backwards[self.part_nodes.face[node]])

    def _edges_inside(self, in_region: Callable[[Floats], Booleans]) -> Booleans:
        """Whether each edge of the part lies in the region where it starts."""
        edges = self.made.boundary.edges
        told = np.zeros((2, len(self.made.boundary.vertices)), dtype=bool)
        for number, nodes in self.nodes_of_edge.items():
            told[int(self._leaves(nodes[0])), edges[number].start] = True
            told[int(not self._leaves(nodes[-1])), edges[number].end] = True
        plain = [number for number in range(len(edges)) if number not in self.nodes_of_edge]
        start, end = (np.array([getattr(edges[k], name) for k in plain], dtype=np.int64) for name in ("start", "end"))
        inside = _decided(
            told.shape[1], start, end, told, lambda some: in_region(self.made.boundary.vertices[some])
        )
        return inside[[edge.start for edge in edges]]

    def _part_stretches(self, edge: int, inside: bool) -> list[tuple[int, bool, Hashable, Hashable]]:
        """Edges along one of the part's, whether each lies in the region, and the nodes at its ends, None at corners."""
        own = self.made.boundary.edges[edge]
        nodes = self.nodes_of_edge.get(edge, [])
        stops = [own.first, *self.part_nodes.along[nodes].tolist(), own.last]
        vertices = [own.start, *(self.first_part_node + node for node in nodes), own.end]
        found = []
        for k in range(len(stops) - 1):
            number = self._edge("part", edge, k, vertices[k], vertices[k + 1], stops[k], stops[k + 1])
            found.append((number, inside, vertices[k] if k else None, vertices[k + 1] if k < len(nodes) else None))
            if k < len(nodes):
                if self._leaves(nodes[k]) != inside:
                    raise KernelError("an edge of the part comes into the lattice twice, and does not leave it between")
                inside = not inside
        return found

    def _cut_face(
        self,
        number: int,
        face: BoundaryFace,
        stretches: list[list[tuple[int, bool, Hashable, Hashable]]],
        wanted: bool,
        into: list[CutLoops],
    ) -> None:
        links: list[_Link] = []
        whole, index = number not in self.sections_of_part, 0
        for k, loop in enumerate(face.loops):
            for position, coedge in enumerate(loop):
                corners = (k, position), (k, (position + 1) % len(loop))
                for edge, inside, start, end in stretches[coedge.edge]:
                    whole &= inside == wanted and start is None and end is None
                    if inside == wanted:
                        first: Hashable = ("node", start, index) if start is not None else None
                        last: Hashable = ("node", end, index) if end is not None else None
                        if not coedge.forward:
                            first, last = last, first
                        links.append(_Link(first or corners[0], last or corners[1], edge, coedge.forward))
                index += 1
        for edge in self._section_edges(self.sections_of_part.get(number, [])):
            section = self.made.sections[self.made.edges[edge].number]
            forward = (bool(self.made.backwards[self.made.pairs.face[section.pair]]) == (face.sign > 0)) == wanted
            ends = self._on_face(number, section.start, True), self._on_face(number, section.end, False)
            links.append(_Link(*(ends if forward else ends[::-1]), edge, forward))
        if not links:
            return
        loops = linked(links, "a face of the part")
        groups = [list(range(len(loops)))]
        if not whole:
            groups = nested([np.concatenate([self._on_part(face, link) for link in loop]) for loop in loops])
        for group in groups:
            uses = [[(link.edge, link.forward) for link in loops[index]] for index in group]
            into.append(CutLoops(number, uses, whole))

    def _on_face(self, part: int, vertex: int, starts: bool) -> Hashable:
        """A node of a section on a face of the part: of a coedge, if it lies on one."""
        index = self.coedge_of.get((vertex, 2 * part + int(starts)))
        return ("node", vertex, index) if index is not None else ("inner", vertex)

    def _on_part(self, face: BoundaryFace, link: _Link) -> Floats:
        edge = self.made.edges[link.edge]
        t = np.linspace(edge.first, edge.last, _OUTLINE)
        t = (t if link.forward else t[::-1])[:-1]
        if edge.kind == "section":
            return _on(self.made.sections[edge.number].on_part, t)
        coedge = next(c for c in face.coedges if c.edge == edge.number and c.forward == link.forward)
        return coedge.curve(t)[0]

    # Edges ----------------------------------------------------------------------------------------------------------

    def _section_edges(self, sections: list[int]) -> list[int]:
        return [self.edge_numbers["section", number, 0] for number in sections]

    def _used(self, number: int, forward: bool) -> _Link:
        edge = self.made.edges[number]
        ends = (edge.start, edge.end) if forward else (edge.end, edge.start)
        return _Link(*ends, number, forward)

    def _edge(self, kind: str, number: int, stretch: int, start: int, end: int, first: float, last: float) -> int:
        key = (kind, number, stretch)
        if key not in self.edge_numbers:
            self.edge_numbers[key] = len(self.made.edges)
            self.made.edges.append(CutEdge(start, end, first, last, kind, number))
        return self.edge_numbers[key]


def _halved(closed: Paths, made: Crossing) -> Paths:
    """Closed curves in two halves, between two vertices of their own."""
    pairs, starts, ends, places, near = [], [], [], [], []
    for pair, square, part in zip(closed.pair.tolist(), closed.places, closed.near, strict=True):
        middle = len(square) // 2
        first = len(made.points)
        points = made.pairs.heights(np.array([pair, pair]), square[[0, middle], :1], square[[0, middle], 1:])[3][:, 0]
        made.points += list(points)
        pairs += [pair, pair]
        starts += [first, first + 1]
        ends += [first + 1, first]
        places += [square[: middle + 1], square[middle:]]
        near += [part[: middle + 1], part[middle:]]
    return Paths(*(np.array(some, dtype=np.int64) for some in (pairs, starts, ends)), places, near)


def _decided(
    count: int, start: Integers, end: Integers, told: Booleans, ask: Callable[[Integers], Booleans]
) -> Booleans:
    """Whether each of some corners is inside: those joined by an edge that nothing crosses are alike.

    Parameters
    ----------
    count : int
    start, end : ndarray of int
        Of such edges.
    told : ndarray of bool, shape (2, count)
        Whether a crossing tells that a corner is outside, or inside.
    ask : callable
        For corners of which no crossing tells.
    """
    group = connected(count, start, end)
    groups = int(group.max(initial=-1)) + 1
    said = np.stack([np.bincount(group, told[k], groups) > 0 for k in (0, 1)])
    if np.any(said.all(axis=0)):
        raise KernelError("the crossings of lattice and part do not agree on what is inside")
    inside = said[1]
    unknown = np.flatnonzero(~said.any(axis=0))
    if len(unknown):
        first = np.full(groups, -1)
        first[group[::-1]] = np.arange(count)[::-1]
        inside[unknown] = ask(first[unknown])
    return np.asarray(inside[group])


def _by(numbers: Integers) -> dict[int, list[int]]:
    """Positions of each number, in order."""
    found: dict[int, list[int]] = {}
    for position, number in enumerate(numbers.tolist()):
        found.setdefault(number, []).append(position)
    return found


def _on(control: Floats, t: Floats) -> Floats:
    return np.asarray(basis(section_knots(len(control)), 3, t) @ control)

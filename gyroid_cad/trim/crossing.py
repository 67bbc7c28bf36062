"""A wall cut by a part: every vertex, edge and face of what is left of both, by number.

Nodes are found on edges alone, curves are followed between them, and everything links up by number. Of the wall's faces
what lies in the part is kept; of the part's, what lies in the region that the wall's faces bound, and the rest where it
is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import by_number
from gyroid_cad.common.processes import results_of
from gyroid_cad.errors import KernelError
from gyroid_cad.trim.boundary import Boundary, BoundaryFace
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.ends import ends_of, halved
from gyroid_cad.trim.lattice_faces import LatticeFaces, Pairs, pairs_of
from gyroid_cad.trim.loops import decided, linked, nested
from gyroid_cad.trim.nodes import part_nodes, rim_nodes, twin_nodes
from gyroid_cad.trim.paths import Ends, closed_paths, open_paths
from gyroid_cad.trim.pieces import Crossing, CutEdge, CutLoops
from gyroid_cad.trim.section_fit import SectionCurve, fitted_sections

__all__ = ["cross_part"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In a control net.
_CORNERS = ((0, 0), (-1, 0), (-1, -1), (0, -1))
# Points along an edge of an outline, by which holes are told from what is round them.
_OUTLINE = 9
# So many pairs of faces are worth a process of their own, and into so many parts they are parted at most.
_PAIRS, _MOST_PARTS = 250, 8


@dataclass(frozen=True, slots=True)
class _Link:
    start: Hashable
    end: Hashable
    edge: int
    forward: bool


def cross_part(
    faces: LatticeFaces,
    backwards: Booleans,
    boundary: Boundary,
    cell_size: float,
    in_part: Callable[[Floats], Booleans],
    in_region: Callable[[Floats], Booleans] | None,
    outer: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> Crossing:
    """Cut faces of a wall and a part's boundary where they cross.

    Parameters
    ----------
    faces : LatticeFaces
        All that bound the region and that the boundary may cross.
    backwards : ndarray of bool, shape (faces,)
        Whether the region lies on the side that the normal of a face points to.
    boundary : Boundary
    cell_size : float
        In mm.
    in_part, in_region : callable
        Which of some points (n, 3) lie in the part, asked for what no curve tells of; and in the region, None if no
        piece of the part's boundary is wanted.
    outer : bool
        Whether pieces of the part's boundary beside the region are wanted too.
    progress : callable, optional
        Called with (steps done, steps in all).

    Raises
    ------
    KernelError
        If the two only touch somewhere, so that it is in doubt what to keep.
    """
    made = Crossing(faces, boundary, pairs_of(faces, boundary), backwards)
    # Steps that are told of: nodes of rims and of edges, and curves of so many parts of the pairs.
    parts = int(np.clip(len(made.pairs.face) // _PAIRS, 1, _MOST_PARTS))
    steps = iter(range(1, parts + 3))
    work = _Work(made, cell_size, parts, lambda: progress and progress(next(steps), parts + 2))
    work.cut_lattice(in_part)
    if in_region is not None:
        work.cut_boundary(in_region, outer)
    return made


def _curves(
    pairs: Pairs, ends: Ends, cell_size: float, first: int, count: int, step_done: Callable[[], object]
) -> tuple[list[SectionCurve], list[Floats]]:
    """Curves of all pairs, and points of the nodes they have of their own, numbered from a first one.

    No curve leaves its pair, so that pairs are parted among processes; into as many parts wherever it is done, that the
    result may be the same.
    """
    bounds = [len(pairs.face) * part // count for part in range(count + 1)]

    def found_in(part: int) -> tuple[list[SectionCurve], list[Floats]]:
        low, high = bounds[part], bounds[part + 1]
        some = np.flatnonzero((ends.pair >= low) & (ends.pair < high))
        own = Pairs(pairs.faces, pairs.boundary, pairs.face[low:high], pairs.part[low:high])
        own_ends = Ends(ends.pair[some] - low, ends.node[some], ends.places[some], ends.near[some], ends.entering[some])
        return _curves_here(own, own_ends, cell_size, first)

    sections: list[SectionCurve] = []
    points: list[Floats] = []
    parts = results_of(found_in, count, "followed curves", done=lambda _: step_done())
    for part, (found, added) in enumerate(parts):
        for section in found:
            start, end = (node + len(points) if node >= first else node for node in (section.start, section.end))
            sections.append(replace(section, pair=section.pair + bounds[part], start=start, end=end))
        points += added
    return sections, points


def _curves_here(pairs: Pairs, ends: Ends, cell_size: float, first: int) -> tuple[list[SectionCurve], list[Floats]]:
    opened = open_paths(pairs, ends)
    closed, points = halved(closed_paths(pairs, opened), pairs, first)
    sections: list[SectionCurve] = []
    for paths in (opened, closed):
        found, added = fitted_sections(pairs, paths, cell_size, first + len(points))
        sections += found
        points += added
    return sections, points


class _Work:
    """Nodes and curves found, and the vertices and edges made of them."""

    def __init__(self, made: Crossing, cell_size: float, parts: int, step_done: Callable[[], object]) -> None:
        self.made = made
        faces, pairs = made.faces, made.pairs
        self.rims, self.fans, self.forward = faces.rims, faces.fans, faces.forward
        self.rim_nodes = rim_nodes(pairs)
        step_done()
        self.part_nodes = part_nodes(faces, made.boundary)
        step_done()
        self.nodes_of_rim, self.nodes_of_edge = by_number(self.rim_nodes.rim), by_number(self.part_nodes.edge)
        ends, self.coedges = ends_of(pairs, self.rims, self.forward, self.rim_nodes, self.part_nodes)
        count = len(self.rim_nodes.rim) + len(self.part_nodes.edge)
        made.sections, points = _curves(pairs, ends, cell_size, count, parts, step_done)
        # Vertices: the part's own, then the nodes in the order of their numbers; corners of the wall as they are met.
        self.first = len(made.boundary.vertices)
        made.points += [*made.boundary.vertices, *self.rim_nodes.points, *self.part_nodes.points, *points]
        twins = twin_nodes(faces, self.rim_nodes)
        made.twins.update({self.first + node: self.first + other for node, other in twins.items()})
        self.edge_numbers: dict[tuple[str, int, int], int] = {}
        self.sections_of_face: dict[int, list[int]] = {}
        self.sections_of_part: dict[int, list[int]] = {}
        for number, section in enumerate(made.sections):
            edge = self._edge("section", number, 0, self.first + section.start, self.first + section.end, 0.0, 1.0)
            self.sections_of_face.setdefault(int(pairs.face[section.pair]), []).append(edge)
            self.sections_of_part.setdefault(int(pairs.part[section.pair]), []).append(edge)

    # The lattice ----------------------------------------------------------------------------------------------------

    def cut_lattice(self, in_part: Callable[[Floats], Booleans]) -> None:
        """Find the pieces of the wall's faces that lie in the part."""
        fans, inside = self._fans_inside(in_part)
        for face in range(len(self.made.faces)):
            links: list[_Link] = []
            cut = face in self.sections_of_face
            for side in range(4):
                rim, runs_on = int(self.rims[face, side]), bool(self.forward[face, side])
                corners = int(self.fans[face, side]), int(self.fans[face, (side + 1) % 4])
                first, last = corners if runs_on else corners[::-1]
                begins_inside = bool(inside[np.searchsorted(fans, first)])
                stretches = self._rim_stretches(rim, first, last, begins_inside)
                cut |= rim in self.nodes_of_rim
                links += [self._used(number, runs_on) for number in stretches]
            links += [self._used(edge, True) for edge in self.sections_of_face.get(face, [])]
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
        for rim, first, last in zip(
            rims[crossed].tolist(), start[crossed].tolist(), end[crossed].tolist(), strict=True
        ):
            nodes = self.nodes_of_rim[rim]
            told[int(not self.rim_nodes.inwards[nodes[0]]), first] = True
            told[int(self.rim_nodes.inwards[nodes[-1]]), last] = True
        corner = np.empty(len(fans), dtype=np.int64)
        corner[index.ravel()] = np.arange(index.size)
        face, which = np.divmod(corner, 4)
        nets = self.made.faces.nets
        self.corner_points = np.array(
            [nets[f][_CORNERS[k]] for f, k in zip(face.tolist(), which.tolist(), strict=True)]
        )
        self.corner_fans = fans
        inside = decided(
            len(fans), start[~crossed], end[~crossed], told, lambda some: in_part(self.corner_points[some])
        )
        return fans, inside

    def _rim_stretches(self, rim: int, first: int, last: int, inside: bool) -> list[int]:
        """Edges of a rim that lie in the part."""
        nodes = self.nodes_of_rim.get(rim, [])
        stops = [-1.0, *self.rim_nodes.along[nodes].tolist(), 1.0]
        vertices = [None, *(self.first + node for node in nodes), None]
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
        if edge.kind == "section":
            t = np.linspace(edge.first, edge.last, _OUTLINE)
            return self.made.sections[edge.number].square((t if link.forward else t[::-1])[:-1])
        # Sides of the square are straight.
        side = self.rims[face].tolist().index(edge.number)
        start = edge.first if link.forward else edge.last
        return np.array([square_points(side, np.array(start if self.forward[face, side] else -start))])

    # The part -------------------------------------------------------------------------------------------------------

    def cut_boundary(self, in_region: Callable[[Floats], Booleans], outer: bool) -> None:
        """Find the pieces of the part's faces in the region, and beside it."""
        starts_inside = self._edges_inside(in_region)
        stretches = [self._part_stretches(edge, inside) for edge, inside in enumerate(starts_inside.tolist())]
        for number, face in enumerate(self.made.boundary.faces):
            self._cut_face(number, face, stretches, True, self.made.inner)
            if outer:
                self._cut_face(number, face, stretches, False, self.made.outer)

    def _leaves(self, node: int) -> bool:
        """Tell whether an edge of the part leaves the region at a node."""
        return bool(self.part_nodes.upwards[node] != self.made.backwards[self.part_nodes.face[node]])

    def _edges_inside(self, in_region: Callable[[Floats], Booleans]) -> Booleans:
        """Mask of the part's edges that lie in the region where they start."""
        edges = self.made.boundary.edges
        told = np.zeros((2, len(self.made.boundary.vertices)), dtype=bool)
        for number, nodes in self.nodes_of_edge.items():
            told[int(self._leaves(nodes[0])), edges[number].start] = True
            told[int(not self._leaves(nodes[-1])), edges[number].end] = True
        plain = [number for number in range(len(edges)) if number not in self.nodes_of_edge]
        start, end = (np.array([getattr(edges[k], name) for k in plain], dtype=np.int64) for name in ("start", "end"))
        inside = decided(told.shape[1], start, end, told, lambda some: in_region(self.made.boundary.vertices[some]))
        return inside[[edge.start for edge in edges]]

    def _part_stretches(self, edge: int, inside: bool) -> list[tuple[int, bool, Hashable, Hashable]]:
        """Edges along one of the part's, whether each lies in the region, and nodes at its ends, None at corners."""
        own = self.made.boundary.edges[edge]
        nodes = self.nodes_of_edge.get(edge, [])
        stops = [own.first, *self.part_nodes.along[nodes].tolist(), own.last]
        first = self.first + len(self.rim_nodes.rim)
        vertices = [own.start, *(first + node for node in nodes), own.end]
        found: list[tuple[int, bool, Hashable, Hashable]] = []
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
        for edge in self.sections_of_part.get(number, []):
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

    def _on_face(self, part: int, node: int, begins: bool) -> Hashable:
        """A node of a section on a face of the part: of a coedge, if it lies on one."""
        index = self.coedges.get((node, part, begins))
        return ("node", self.first + node, index) if index is not None else ("inner", node)

    def _on_part(self, face: BoundaryFace, link: _Link) -> Floats:
        edge = self.made.edges[link.edge]
        t = np.linspace(edge.first, edge.last, _OUTLINE)
        t = (t if link.forward else t[::-1])[:-1]
        if edge.kind == "section":
            return self.made.sections[edge.number].part(t)
        coedge = next(c for c in face.coedges if c.edge == edge.number and c.forward == link.forward)
        return coedge.curve(t)[0]

    # Edges ----------------------------------------------------------------------------------------------------------

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

"""A wall cut to a box: every vertex, edge and face of what is left, by integer id.

Faces that differ by a translation and lie alike to the box's sides are cut once, however many there are. The pieces
share edges by the lattice's own ids; on the box's sides the section curves link up to caps.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError
from gyroid_cad.nurbs.quadrature import SquareQuadrature, shifted_integrals
from gyroid_cad.trim.caps import Cap, CapArc, caps_of
from gyroid_cad.trim.edge_crossings import PLANES, FacesToCut
from gyroid_cad.trim.sections import Sections
from gyroid_cad.trim.trimmed_faces import CORNER, RIM, Arc, CutFace, Node, cut_faces
from gyroid_cad.wall.offset import Wall

__all__ = ["Box", "BoxEdge", "BoxFace", "TrimmedWall", "cut_to_box"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Levels that agree to so many cell sizes are one: rounding in the patches' translations leaves 1e-15.
_SAME_LEVEL = 1e-9
# Of the sum of area vectors, in parts of the area; how closely the section curves are fitted leaves a tenth of it.
_LARGEST_GAP = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box in space.

    Attributes
    ----------
    axes : ndarray, shape (3, 3)
        Its directions, unit vectors in the columns, right-handed.
    low, high : ndarray, shape (3,)
        Along them, in mm.
    """

    axes: Floats
    low: Floats
    high: Floats

    @property
    def volume(self) -> float:
        return float(np.prod(self.high - self.low))

    @property
    def levels(self) -> Floats:
        """Levels of :data:`~gyroid_cad.trim.edge_crossings.PLANES`, each along its axis; shape (6,)."""
        return np.array([(self.low if sign > 0 else self.high)[axis] for axis, sign in PLANES])


@dataclass(frozen=True, slots=True)
class BoxEdge:
    """An edge between two vertices, and where its curve is to be had.

    Attributes
    ----------
    start, end : int
        Vertices.
    first, last : float
        Parameters of the curve there; of no use for a straight edge.
    patch, side : int
        Whose curve it is; -1 for a straight edge of the box.
    patch_edge : int
        Which border curve of the patch; -1 if it is a section curve.
    sections : Sections, optional
    curve : int
        Of the sections.
    """

    start: int
    end: int
    first: float
    last: float
    patch: int = -1
    side: int = -1
    patch_edge: int = -1
    sections: Sections | None = None
    curve: int = -1


@dataclass(frozen=True, slots=True)
class BoxFace:
    """A piece of one of the wall's faces.

    Attributes
    ----------
    patch, side : int
    loops : list of list of (int, bool)
        Edges, and whether they are used the way they run; what is left of the face is on the left, seen from where the
        patch's own normal points.
    patch_edges : list of list of int
        Which border of the patch each of them belongs to; -1 for section curves.
    backwards : bool
        Whether the solid lies on the side that the normal points to.
    """

    patch: int
    side: int
    loops: list[list[tuple[int, bool]]]
    patch_edges: list[list[int]]
    backwards: bool


@dataclass(frozen=True, slots=True, eq=False)
class TrimmedWall:
    """A wall, or a network beside it, trimmed to a box.

    Attributes
    ----------
    wall : Wall
    box : Box
    points : list of ndarray, shape (3,)
        Of the vertices, in mm, in the wall's own space.
    edges : list of BoxEdge
    faces : list of BoxFace
    caps : list of Cap
        On the box's sides.
    component : ndarray of int, shape (faces + caps,)
        Which connected piece of the boundary each belongs to.
    volumes, areas : ndarray, shape (components,)
        In mm3 and mm2, by Green's theorem over the pieces.
    centroids : ndarray, shape (components, 3)
        In mm, in the wall's own space, likewise; of no use if it is not closed.
    distinct : int
        Faces that had to be cut, all alike counted once.
    capped : bool
        Whether it is closed.
    """

    wall: Wall
    box: Box
    points: list[Floats]
    edges: list[BoxEdge]
    faces: list[BoxFace]
    caps: list[Cap]
    component: Integers
    volumes: Floats
    areas: Floats
    centroids: Floats
    distinct: int
    capped: bool


def cut_to_box(
    wall: Wall, box: Box, sides: list[tuple[int, bool]], cell_size: float, filled: bool, capped: bool = True
) -> TrimmedWall:
    """Cut a wall's faces to a box and close what is left with caps.

    Parameters
    ----------
    wall : Wall
        Covers the box.
    box : Box
    sides : list of (int, bool)
        Which faces bound what is wanted, and whether against their normal.
    cell_size : float
        In mm.
    filled : bool
        Whether the box's corners belong to what is wanted, should no face meet any of its edges.
    capped : bool
        Whether to close what is left; else it stays a surface with a border.

    Raises
    ------
    KernelError
        If faces touch the box, or what is left does not close.
    """
    assembly = _Assembly(wall, box, cell_size)
    for side, backwards in sides:
        assembly.add_faces(side, backwards)
    return assembly.finished(filled, capped)


@dataclass(eq=False)
class _Assembly:
    wall: Wall
    box: Box
    cell_size: float
    points: list[Floats] = field(default_factory=list)
    edges: list[BoxEdge] = field(default_factory=list)
    faces: list[BoxFace] = field(default_factory=list)
    arcs: list[list[CapArc]] = field(default_factory=lambda: [[] for _ in PLANES])
    fluxes: list[float] = field(default_factory=list)
    areas: list[float] = field(default_factory=list)
    vectors: list[Floats] = field(default_factory=list)
    moments: list[Floats] = field(default_factory=list)
    distinct: int = 0

    def __post_init__(self) -> None:
        self.vertex_ids: dict[tuple[int, ...], int] = {}
        self.edge_ids: dict[tuple[int, ...], int] = {}
        self.nets = self.wall.nets @ self.box.axes
        self.shifts = (self.wall.shifts @ self.box.axes)[self.wall.patch_shift]
        complex = self.wall.complex
        # Fluxes are taken about it: what is missing where a curve is not quite the faces' own counts for little there,
        # and no more far from the origin.
        self.middle = (self.box.low + self.box.high) / 2
        self.patch_edges, self.patch_fans = complex.patch_edges.tolist(), complex.patch_fans.tolist()
        self.forward = complex.edge_forward.tolist()

    def add_faces(self, side: int, backwards: bool) -> None:
        """Cut the faces on one side of the wall, and take in what is left of them."""
        outside, levels = self._positions(side)
        near = ~np.isnan(levels).all(axis=1)
        self._add_whole(np.flatnonzero(~outside & ~near), side, backwards)
        patches = np.flatnonzero(~outside & near)
        template, nets, distinct = _alike(self.wall.patch_net[patches], levels[patches], _SAME_LEVEL * self.cell_size)
        self.distinct += len(nets)
        cut = cut_faces(FacesToCut(self.nets[nets, side], self.wall.weights, self.wall.knots, distinct), self.cell_size)
        for patch, index in zip(patches.tolist(), template.tolist(), strict=True):
            self._add_cut(patch, side, cut[index], backwards)

    def finished(self, filled: bool, capped: bool) -> TrimmedWall:
        """With the caps, if they are wanted."""
        caps = caps_of(self.arcs, self.box.low, self.box.high, self._straight, filled) if capped else []
        uses = [[edge for loop in face.loops for edge, _ in loop] for face in self.faces]
        uses += [[edge for loop in cap.loops for edge, _ in loop] for cap in caps]
        component = _components(uses, len(self.edges), capped)
        levels = self.box.levels - self.middle[[axis for axis, _ in PLANES]]
        fluxes = self.fluxes + [-PLANES[cap.plane][1] * levels[cap.plane] * cap.area / 3 for cap in caps]
        areas = self.areas + [cap.area for cap in caps]
        if capped:
            self._require_no_gap(caps, sum(areas))
        moments = self.moments + [cap.moments(levels[cap.plane]) for cap in caps]
        totals = np.zeros((int(component.max(initial=-1)) + 1, 5))
        np.add.at(totals, component, np.column_stack([fluxes, areas, np.reshape(moments, (-1, 3))]))
        centroids = self.middle + totals[:, 2:] / (totals[:, :1] if capped else 1.0)
        points = [point @ self.box.axes.T for point in self.points]
        return TrimmedWall(
            self.wall,
            self.box,
            points,
            self.edges,
            self.faces,
            caps,
            component,
            totals[:, 0],
            totals[:, 1],
            centroids @ self.box.axes.T,
            self.distinct,
            capped,
        )

    def _require_no_gap(self, caps: list[Cap], area: float) -> None:
        """The area vectors of a closed surface add up to nothing."""
        total = np.sum(self.vectors, axis=0) if self.vectors else np.zeros(3)
        for cap in caps:
            axis, sign = PLANES[cap.plane]
            total[axis] -= sign * cap.area
        if not np.linalg.norm(total) <= _LARGEST_GAP * area:
            raise KernelError("what the box leaves of the lattice does not close: its area vectors do not add up to 0")

    def _positions(self, side: int) -> tuple[Booleans, Floats]:
        """Patches whose faces lie outside; and, from each patch's own place, levels of the planes that are near."""
        low, high = (
            reach(self.nets[:, side], axis=(1, 2))[self.wall.patch_net] + self.shifts for reach in (np.min, np.max)
        )
        outside = np.any((high <= self.box.low) | (low >= self.box.high), axis=1)
        levels = np.full((len(low), len(PLANES)), np.nan)
        for plane, (axis, _) in enumerate(PLANES):
            level = self.box.levels[plane]
            near = (low[:, axis] < level) & (high[:, axis] > level)
            levels[near, plane] = level - self.shifts[near, axis]
        return outside, levels

    def _add_whole(self, patches: Integers, side: int, backwards: bool) -> None:
        quadrature = SquareQuadrature(self.wall.knots)
        used, which = np.unique(self.wall.patch_net[patches], return_inverse=True)
        sums = quadrature.over_square(self.nets[used, side], self.wall.weights, moments=True)[which]
        sign = -1.0 if backwards else 1.0
        fluxes, moments = shifted_integrals(sums, self.shifts[patches] - self.middle)
        self.fluxes += (sign * fluxes).tolist()
        self.moments += list(sign * moments)
        self.areas += sums[:, 4].tolist()
        self.vectors += list(sign * sums[:, 1:4])
        patch_edges = [list(range(4))]
        for patch in patches.tolist():
            loop = [self._rim_edge(patch, side, k, 0, 1, -1.0, 1.0, None) for k in range(4)]
            self.faces.append(BoxFace(patch, side, [loop], patch_edges, backwards))

    def _add_cut(self, patch: int, side: int, cut: CutFace, backwards: bool) -> None:
        offset = self.shifts[patch] - self.middle
        sign = -1.0 if backwards else 1.0
        for piece in cut.pieces:
            loops = [[self._edge(patch, side, cut, arc, backwards) for arc in loop] for loop in piece.loops]
            patch_edges = [[arc.side for arc in loop] for loop in piece.loops]
            self.faces.append(BoxFace(patch, side, loops, patch_edges, backwards))
            flux, moments = shifted_integrals(piece.integrals, offset)
            self.fluxes.append(sign * float(flux))
            self.moments.append(sign * moments)
            self.areas.append(float(piece.integrals[4]))
            self.vectors.append(sign * piece.integrals[1:4])

    def _edge(self, patch: int, side: int, cut: CutFace, arc: Arc, backwards: bool) -> tuple[int, bool]:
        if arc.curve < 0:
            return self._rim_edge(patch, side, arc.side, arc.stretch, arc.stretches, arc.first, arc.last, cut)
        start, end = (self._vertex(patch, side, cut, node) for node in (arc.start, arc.end))
        curve = cut.curves[arc.curve]
        number = len(self.edges)
        self.edges.append(BoxEdge(start, end, arc.first, arc.last, patch, side, -1, cut.sections, curve))
        self.arcs[cut.plane(arc)].append(CapArc(number, backwards, start, end, cut, arc, self.shifts[patch]))
        return number, True

    def _rim_edge(
        self,
        patch: int,
        side: int,
        k: int,
        stretch: int,
        stretches: int,
        first: float,
        last: float,
        cut: CutFace | None,
    ) -> tuple[int, bool]:
        """A stretch of the border between two patches, from whichever of the two comes first."""
        forward = self.forward[patch][k]
        key = (side, self.patch_edges[patch][k], stretch if forward else stretches - 1 - stretch)
        if key not in self.edge_ids:
            ends: list[Node] = [
                (RIM, k, stretch - 1) if stretch else (CORNER, k, 0),
                (RIM, k, stretch) if stretch + 1 < stretches else (CORNER, (k + 1) % 4, 0),
            ]
            start, end = (self._vertex(patch, side, cut, node, stretches) for node in ends)
            if not forward:
                start, end, first, last = end, start, -last, -first
            self.edge_ids[key] = len(self.edges)
            self.edges.append(BoxEdge(start, end, first, last, patch, side, k))
        return self.edge_ids[key], forward

    def _vertex(self, patch: int, side: int, cut: CutFace | None, node: Node, stretches: int = 0) -> int:
        kind, index, before = node
        if kind == CORNER:
            key: tuple[int, ...] = (0, side, self.patch_fans[patch][index])
            point = self.nets[self.wall.patch_net[patch], side][((0, 0), (-1, 0), (-1, -1), (0, -1))[index]]
        else:
            assert cut is not None
            point = cut.points[node]
            if kind == RIM:
                edge, forward = self.patch_edges[patch][index], self.forward[patch][index]
                count = cut.crossings[index]
                key = (1, side, edge, before if forward else count - 1 - before)
            else:
                key = (2, side, patch, index)
        return self._numbered(key, point + self.shifts[patch])

    def _numbered(self, key: tuple[int, ...], point: Floats) -> int:
        if key not in self.vertex_ids:
            self.vertex_ids[key] = len(self.points)
            self.points.append(point)
        return self.vertex_ids[key]

    def _straight(self, ends: tuple[int | tuple[int, int, int], int | tuple[int, int, int]]) -> int:
        """A straight edge between vertices, or corners of the box, given as 0 or 1 along each axis."""
        numbers = []
        for end in ends:
            if isinstance(end, tuple):
                corner = np.where(np.array(end) > 0, self.box.high, self.box.low)
                numbers.append(self._numbered((3, *end), corner))
            else:
                numbers.append(end)
        # Sides of the wall are 0 and 1: no rim has such a key.
        key = (2, *numbers)
        if key not in self.edge_ids:
            self.edge_ids[key] = len(self.edges)
            self.edges.append(BoxEdge(numbers[0], numbers[1], 0.0, 1.0))
        return self.edge_ids[key]


def _alike(nets: Integers, levels: Floats, grain: float) -> tuple[Integers, Integers, Floats]:
    """Group faces that are cut alike: the kind of each; and the net and the levels of each kind."""
    if not len(nets):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros((0, len(PLANES)))
    grains = np.where(np.isnan(levels), np.iinfo(np.int64).min / 2, np.rint(levels / grain))
    keys = np.column_stack([nets, grains])
    _, first, kind = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return kind.ravel(), nets[first], levels[first]


def _components(uses: list[list[int]], edge_count: int, closed: bool) -> Integers:
    """Faces that are connected by edges, each of which must be used twice, or once where there may be a border."""
    if not uses:
        return np.zeros(0, dtype=np.int64)
    face = np.repeat(np.arange(len(uses)), [len(edges) for edges in uses])
    edge = np.concatenate([np.array(edges, dtype=np.int64) for edges in uses])
    used = np.bincount(edge, minlength=edge_count)
    if np.any(used > 2) or np.any(used < (2 if closed else 1)):
        raise KernelError("what the box leaves of the lattice does not close: an edge is not shared by two faces")
    order = np.argsort(edge, kind="stable")
    pairs = face[order][np.repeat(used, used) == 2].reshape(-1, 2)
    return connected(len(uses), pairs[:, 0], pairs[:, 1])

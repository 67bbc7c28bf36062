"""Merge of the regions' pieces: what they share made one, the part's boundary split to match."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate, combinations

import numpy as np
from numpy.typing import NDArray
from OCP.BinTools import BinTools
from OCP.BOPAlgo import BOPAlgo_Builder
from OCP.BOPTools import BOPTools_AlgoTools2D
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Plane
from OCP.gp import gp_Pnt
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import (
    TopAbs_FORWARD,
    TopAbs_Orientation,
    TopAbs_REVERSED,
)
from OCP.TopExp import TopExp
from OCP.TopoDS import (
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Iterator,
    TopoDS_Shape,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from gyroid_cad.kernel.check import compound_of
from gyroid_cad.kernel.compat import as_edge, as_face, as_vertex
from gyroid_cad.kernel.region_split import NEW, Edge, Found, RegionPiece, Task, all_of, place_of
from gyroid_cad.kernel.split import Pieces, changes, general_fuse, modified, running_like

__all__ = ["Joining"]

Floats = NDArray[np.float64]


class Joining:
    """Pieces of all regions put together, and the part's boundary split to match."""

    def __init__(self, task: Task, found: Sequence[Found]) -> None:
        self.task = task
        self.found = found
        self.builder = BRep_Builder()
        self.context = IntTools_Context()
        counts = [len(region.points) for region in found]
        self.first = [task.vertex_count + before for before in accumulate(counts, initial=0)]
        self.points = np.array([point for region in found for point in region.points]).reshape(-1, 4)
        self.same = self._same_vertices()
        self.vertices = self._make_vertices()
        self.lattice_edges: dict[tuple[int, int, int], TopoDS_Edge] = {}

    def pieces(self) -> Pieces:
        """The result."""
        edges = [self._edges_on_boundary(number) for number in range(len(self.found))]
        fuse = None
        if any(edges):
            sections = compound_of(edge for region in edges for edge in region.values())
            fuse = general_fuse(self.task.part.shape, sections)
            self._take_over_vertices(fuse)
        inside = [
            self._face(number, piece, edges[number], fuse)
            for number, region in enumerate(self.found)
            for piece in region.pieces
        ]
        boundary = [
            (as_face(piece), number)
            for number, face in enumerate(self.task.boundary)
            for piece in (modified(fuse, face) if fuse else [face])
        ]
        return Pieces(
            tuple(inside),
            tuple(piece for piece, _ in boundary),
            tuple(number for _, number in boundary),
            changes(fuse, self.task.part.shape) if fuse else (),
        )

    def _number(self, region: int, vertex: int) -> int:
        """The number, over all regions, of what stands for a region's vertex."""
        own = vertex - self.task.vertex_count
        return self.same[vertex if own < 0 else self.first[region] + own]

    def _same_vertices(self) -> list[int]:
        """For each vertex of the lattice and each new one, the first of those that are one with it.

        New ones of different regions are one if they lie at the same place on the same edge of the lattice.
        """
        lattice = self.task.vertex_count
        same = list(range(self.first[-1]))
        on_edges: dict[int, dict[int, int]] = {}
        for number, region in enumerate(self.found):
            for new, vertex in enumerate(region.moved, self.first[number]):
                if vertex != NEW:
                    _unite(same, vertex, new)
            for edge in region.edges:
                if edge.origin != NEW:
                    ends = [self.first[number] + end - lattice for end in edge.ends if end >= lattice]
                    on_edges.setdefault(edge.origin, {}).update(dict.fromkeys(ends, number))
        for regions in on_edges.values():
            for one, other in combinations(regions, 2):
                if regions[one] != regions[other] and self._near(one - lattice, other - lattice):
                    _unite(same, one, other)
        return [_root(same, number) for number in range(len(same))]

    def _near(self, one: int, other: int) -> bool:
        reach = float(self.points[one, 3] + self.points[other, 3])
        return _distance(self.points[one], self.points[other]) <= reach

    def _make_vertices(self) -> dict[int, TopoDS_Vertex]:
        """By number: the lattice's own, where no region has another one for it."""
        lattice = self.task.vertex_count
        found = [as_vertex(vertex) for vertex in all_of(self.task.vertices)]
        old = np.array([[*place_of(vertex), BRep_Tool.Tolerance_s(vertex)] for vertex in found]).reshape(-1, 4)
        balls = np.concatenate([old, self.points])
        members: dict[int, list[int]] = {}
        for number, first in enumerate(self.same):
            members.setdefault(first, []).append(number)
        return {
            first: found[first] if some == [first] and first < lattice else self._round(balls[some])
            for first, some in members.items()
        }

    def _round(self, balls: Floats) -> TopoDS_Vertex:
        """A vertex at the last of some places, whose tolerance takes in the balls round them all."""
        vertex = TopoDS_Vertex()
        tolerance = max(_distance(balls[-1], ball) + ball[3] for ball in balls)
        self.builder.MakeVertex(vertex, gp_Pnt(*balls[-1, :3].tolist()), float(tolerance))
        return vertex

    def _edges_on_boundary(self, number: int) -> dict[int, TopoDS_Edge]:
        """A region's edges that lie on the part's boundary, by their numbers."""
        region = self.found[number]
        sections, supporting_faces, sides = self._read(region)
        users: dict[int, set[int]] = {}
        for piece in region.pieces:
            for index in piece.edges():
                users.setdefault(index, set()).add(piece.face)
        made = {}
        for index, edge in enumerate(region.edges):
            if edge.origin == NEW:
                lying_on = [(self.task.faces[face], supporting_faces[face]) for face in users[index]]
                lying_on += [(self.task.boundary[face], sides[face]) for face in edge.beside]
                made[index] = self._section(next(sections), self._ends(number, edge), lying_on)
            elif edge.beside:
                made[index] = self._lattice_edge(number, edge)
        return made

    def _read(self, region: Found) -> tuple[Iterator[TopoDS_Edge], dict[int, TopoDS_Face], dict[int, TopoDS_Face]]:
        """A region's sections, and the faces that they lie on as they came with them, by number."""
        shape = TopoDS_Shape()
        BinTools.Read_s(shape, io.BytesIO(region.shapes))
        shapes = list(_members(shape))
        count = sum(edge.origin == NEW for edge in region.edges)
        faces = [as_face(face) for face in shapes[count:]]
        lattice, part = region.supporting_faces
        return (
            (as_edge(edge) for edge in shapes[:count]),
            dict(zip(lattice, faces, strict=False)),
            dict(zip(part, faces[len(lattice) :], strict=True)),
        )

    def _section(
        self,
        found: TopoDS_Edge,
        ends: tuple[TopoDS_Vertex, TopoDS_Vertex],
        lying_on: Iterable[tuple[TopoDS_Face, TopoDS_Face]],
    ) -> TopoDS_Edge:
        """A section made anew between vertices, on faces of which each is given with what it was found on."""
        edge = TopoDS_Edge()
        tolerance = BRep_Tool.Tolerance_s(found)
        self.builder.MakeEdge(edge, BRep_Tool.Curve_s(found, 0.0, 0.0), tolerance)
        for face, ground in lying_on:
            curve = BRep_Tool.CurveOnSurface_s(found, ground, 0.0, 0.0)
            if curve is not None and BRepAdaptor_Surface(face, False).GetType() != GeomAbs_Plane:
                self.builder.UpdateEdge(edge, curve, face, tolerance)
        self._bound(edge, ends, BRep_Tool.Range_s(found))
        self.builder.SameRange(edge, BRep_Tool.SameRange_s(found))
        self.builder.SameParameter(edge, BRep_Tool.SameParameter_s(found))
        return edge

    def _lattice_edge(self, number: int, edge: Edge) -> TopoDS_Edge:
        """An edge of the lattice, or a piece of one: the same for all regions."""
        ends = self._ends(number, edge)
        key = (edge.origin, self._number(number, edge.ends[0]), self._number(number, edge.ends[1]))
        if key not in self.lattice_edges:
            old = as_edge(self.task.edges.FindKey(edge.origin + 1).Oriented(TopAbs_FORWARD))
            if not (ends[0].IsSame(TopExp.FirstVertex_s(old)) and ends[1].IsSame(TopExp.LastVertex_s(old))):
                old = as_edge(old.EmptyCopied())
                self._bound(old, ends, edge.limits)
            self.lattice_edges[key] = old
        return self.lattice_edges[key]

    def _ends(self, number: int, edge: Edge) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        start, end = (self.vertices[self._number(number, vertex)] for vertex in edge.ends)
        return start, end

    def _bound(self, edge: TopoDS_Edge, ends: tuple[TopoDS_Vertex, TopoDS_Vertex], limits: tuple[float, float]) -> None:
        self.builder.Add(edge, ends[0].Oriented(TopAbs_FORWARD))
        self.builder.Add(edge, ends[1].Oriented(TopAbs_REVERSED))
        self.builder.Range(edge, *limits)

    def _take_over_vertices(self, fuse: BOPAlgo_Builder) -> None:
        """Take over the vertices as they are with the part's boundary split."""
        for number, vertex in self.vertices.items():
            for image in modified(fuse, vertex):
                self.vertices[number] = as_vertex(image)

    def _face(
        self, number: int, piece: RegionPiece, on_boundary: dict[int, TopoDS_Edge], fuse: BOPAlgo_Builder | None
    ) -> TopoDS_Face:
        """A piece of a face of the lattice, or the face itself if nothing of it has changed."""
        old = self.task.faces[piece.face]
        wires = [
            [use for index, way in wire for use in self._uses(number, index, way, on_boundary, fuse)]
            for wire in piece.wires
        ]
        if piece.whole and all(self.task.edges.Contains(edge) for wire in wires for edge in wire):
            return old
        face = as_face(old.Oriented(TopAbs_FORWARD).EmptyCopied())
        for edges in wires:
            wire = TopoDS_Wire()
            self.builder.MakeWire(wire)
            for edge in edges:
                if not BOPTools_AlgoTools2D.HasCurveOnSurface_s(edge, face):
                    BOPTools_AlgoTools2D.BuildPCurveForEdgeOnFace_s(edge, face, self.context)
                self.builder.Add(wire, edge)
            wire.Closed(BRep_Tool.IsClosed_s(wire))
            self.builder.Add(face, wire)
        return as_face(face.Oriented(piece.orientation))

    def _uses(
        self,
        number: int,
        index: int,
        way: TopAbs_Orientation,
        on_boundary: dict[int, TopoDS_Edge],
        fuse: BOPAlgo_Builder | None,
    ) -> list[TopoDS_Edge]:
        """Edges that an edge of a piece has become, in the order and the way that the piece runs through it."""
        if fuse is None or index not in on_boundary:
            return [as_edge(self._lattice_edge(number, self.found[number].edges[index]).Oriented(way))]
        whole = on_boundary[index]
        runs = [running_like(whole, image, self.context) for image in modified(fuse, whole)]
        if way == TopAbs_FORWARD:
            return [as_edge(run) for run in runs]
        return [as_edge(run.Reversed()) for run in reversed(runs)]


def _unite(same: list[int], one: int, other: int) -> None:
    """Let the first of those that are one with either stand for all."""
    low, high = sorted((_root(same, one), _root(same, other)))
    same[high] = low


def _root(same: list[int], number: int) -> int:
    while same[number] != number:
        number = same[number]
    return number


def _distance(one: Floats, other: Floats) -> float:
    return float(np.linalg.norm(one[:3] - other[:3]))


def _members(compound: TopoDS_Shape) -> Iterator[TopoDS_Shape]:
    iterator = TopoDS_Iterator(compound)
    while iterator.More():
        yield iterator.Value()
        iterator.Next()

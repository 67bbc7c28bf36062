"""Split of a region's lattice faces by a part, described so that it can be sent to another process.

Edges and vertices of the lattice go by their numbers: the other process has them. Only sections are sent as shapes.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_Orientation,
    TopAbs_ShapeEnum,
    TopAbs_VERTEX,
    TopAbs_WIRE,
)
from OCP.TopExp import TopExp
from OCP.TopoDS import (
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Vertex,
)

from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.shells import lies_in
from gyroid_cad.kernel.split import general_fuse, modified

__all__ = ["NEW", "Edge", "Found", "RegionPiece", "RegionSplit", "Task", "Values", "all_of", "map_of", "place_of"]

Floats = NDArray[np.float64]
Value = TypeVar("Value")

# Few enough that the processes finish at about the same time; each region costs a little of its own.
FACES_OF_REGION = 100
# In mm, between boxes.
_APART = 1e-3
# The number of an edge or a vertex that is no part of the lattice.
NEW = -1


class Task:
    """Work to be split, with numbers for faces, edges and vertices on which all processes agree."""

    def __init__(self, part: Part, faces: Sequence[TopoDS_Shape]) -> None:
        self.part = part
        self.faces = [as_face(face) for face in faces]
        self.boundary = [as_face(face) for face in parts_of(part.shape, TopAbs_FACE)]
        self.edges = map_of(self.faces, TopAbs_EDGE)
        self.vertices = map_of(self.faces, TopAbs_VERTEX)
        self.vertex_count = int(self.vertices.Extent())
        corners = np.array([corners_of(box_round([face])) for face in self.faces])
        self.regions = _regions(corners.mean(axis=1), np.arange(len(faces)))


def _regions(centres: Floats, numbers: NDArray[np.intp]) -> list[list[int]]:
    """Places by their numbers in groups near each other, of about the same size."""
    if len(numbers) <= FACES_OF_REGION:
        return [sorted(numbers.tolist())]
    axis = int(np.argmax(np.ptp(centres[numbers], axis=0)))
    ordered = numbers[np.argsort(centres[numbers, axis], kind="stable")]
    half = len(ordered) // 2
    return _regions(centres, ordered[:half]) + _regions(centres, ordered[half:])


@dataclass(frozen=True, slots=True)
class Edge:
    """An edge of a piece.

    Attributes
    ----------
    origin : int
        The number of the lattice's edge it is, or is a piece of; ``NEW`` if it is a section.
    ends : (int, int)
        Vertices: as they are numbered in the lattice, or after all of those, the region's new ones.
    limits : (float, float)
        Its ends' parameters.
    beside : tuple of int
        Faces of the part it lies on.
    """

    origin: int
    ends: tuple[int, int]
    limits: tuple[float, float]
    beside: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class RegionPiece:
    """A piece of a face, by the face's number, with each wire's edges by their numbers, and how they run."""

    face: int
    orientation: TopAbs_Orientation
    whole: bool
    wires: tuple[tuple[tuple[int, TopAbs_Orientation], ...], ...]

    def edges(self) -> Iterator[int]:
        return (edge for wire in self.wires for edge, _ in wire)


@dataclass(frozen=True, slots=True)
class Found:
    """Pieces of a region's faces that are left in the part.

    Attributes
    ----------
    points : list of (x, y, z, tolerance)
        New vertices.
    moved : list of int
        For each of them, the number of the lattice's vertex it stands for, or ``NEW``.
    edges : list of Edge
    pieces : list of RegionPiece
    supporting_faces : (list of int, list of int)
        Faces of the lattice, and of the part, on which the sections lie.
    shapes : bytes
        A compound of the sections, in the order of the edges; then of those faces, without edges.
    """

    points: list[tuple[float, float, float, float]]
    moved: list[int]
    edges: list[Edge]
    pieces: list[RegionPiece]
    supporting_faces: tuple[list[int], list[int]]
    shapes: bytes


class Values(Generic[Value]):
    """Values by shapes, whichever way these run."""

    def __init__(self) -> None:
        self._shapes = NumberedShapes()
        self._values: list[Value] = []

    def setdefault(self, shape: TopoDS_Shape, value: Value) -> Value:
        number = int(self._shapes.Add(shape))
        if number > len(self._values):
            self._values.append(value)
        return self._values[number - 1]

    def get(self, shape: TopoDS_Shape, default: Value) -> Value:
        number = int(self._shapes.FindIndex(shape))
        return self._values[number - 1] if number else default


class RegionSplit:
    """A region's faces split against the part, and what is left of them described."""

    def __init__(self, task: Task, region: Sequence[int]) -> None:
        self.task = task
        self.region = region
        faces = [task.faces[number] for number in region]
        self.fuse = general_fuse(compound_of(self._boundary_near(faces)), compound_of(faces))
        self.beside = self._faces_beside()
        self.edge_origins = self._origins(map_of(faces, TopAbs_EDGE), task.edges)
        self.vertex_origins = self._origins(map_of(faces, TopAbs_VERTEX), task.vertices)
        self.edge_numbers: Values[int] = Values()
        self.vertex_numbers: Values[int] = Values()
        self.points: list[tuple[float, float, float, float]] = []
        self.moved: list[int] = []
        self.edges: list[Edge] = []
        self.sections: list[TopoDS_Shape] = []

    def found(self) -> Found:
        context = IntTools_Context()
        classifiers = [BRepClass3d_SolidClassifier(solid) for solid in self.task.part.solids]
        pieces = [
            self._piece(number, as_face(piece))
            for number in self.region
            for piece in modified(self.fuse, self.task.faces[number])
            if any(lies_in(piece, classifier, context) for classifier in classifiers)
        ]
        sections = {number for number, edge in enumerate(self.edges) if edge.origin == NEW}
        supporting_faces = (
            sorted({piece.face for piece in pieces if not sections.isdisjoint(piece.edges())}),
            sorted({face for number in sections for face in self.edges[number].beside}),
        )
        faces = [self.task.faces[face] for face in supporting_faces[0]] + [
            self.task.boundary[face] for face in supporting_faces[1]
        ]
        stream = io.BytesIO()
        BinTools.Write_s(compound_of([*self.sections, *(face.EmptyCopied() for face in faces)]), stream)
        return Found(self.points, self.moved, self.edges, pieces, supporting_faces, stream.getvalue())

    def _boundary_near(self, faces: Iterable[TopoDS_Face]) -> list[TopoDS_Face]:
        """Faces of the part that some of a region's may meet; all of them, if none."""
        box = box_round(faces)
        box.Enlarge(_APART)
        return [face for face in self.task.boundary if not box.IsOut(box_round([face]))] or self.task.boundary

    def _faces_beside(self) -> Values[list[int]]:
        """The part's faces at every edge of their pieces."""
        beside: Values[list[int]] = Values()
        for number, face in enumerate(self.task.boundary):
            for piece in modified(self.fuse, face):
                for edge in parts_of(piece, TopAbs_EDGE):
                    numbers = beside.setdefault(edge, [])
                    if number not in numbers:
                        numbers.append(number)
        return beside

    def _origins(self, shapes: NumberedShapes, numbers: NumberedShapes) -> Values[int]:
        """The numbers of the lattice's edges or vertices by what they have become."""
        origins: Values[int] = Values()
        for shape in all_of(shapes):
            for image in modified(self.fuse, shape):
                origins.setdefault(image, numbers.FindIndex(shape) - 1)
        return origins

    def _piece(self, number: int, piece: TopoDS_Face) -> RegionPiece:
        whole = bool(piece.IsSame(self.task.faces[number]))
        wires = tuple(
            tuple((self._edge(as_edge(edge), number), edge.Orientation()) for edge in parts_of(wire, TopAbs_EDGE))
            for wire in parts_of(piece.Oriented(TopAbs_FORWARD), TopAbs_WIRE)
        )
        return RegionPiece(number, piece.Orientation(), whole, wires)

    def _edge(self, edge: TopoDS_Edge, face: int) -> int:
        """The number of an edge of a piece of a face."""
        number = self.edge_numbers.setdefault(edge, len(self.edges))
        if number == len(self.edges):
            forward = as_edge(edge.Oriented(TopAbs_FORWARD))
            ends = self._vertex(TopExp.FirstVertex_s(forward)), self._vertex(TopExp.LastVertex_s(forward))
            origin = self.edge_origins.get(edge, NEW)
            if origin == NEW:
                self.sections.append(forward)
            self.edges.append(Edge(origin, ends, BRep_Tool.Range_s(forward), tuple(self.beside.get(edge, []))))
        return number

    def _vertex(self, vertex: TopoDS_Vertex) -> int:
        if number := int(self.task.vertices.FindIndex(vertex)):
            return number - 1
        new = self.vertex_numbers.setdefault(vertex, len(self.points))
        if new == len(self.points):
            self.points.append((*place_of(vertex), BRep_Tool.Tolerance_s(vertex)))
            self.moved.append(self.vertex_origins.get(vertex, NEW))
        return self.task.vertex_count + new


def place_of(vertex: TopoDS_Vertex) -> tuple[float, float, float]:
    place = BRep_Tool.Pnt_s(vertex)
    return place.X(), place.Y(), place.Z()


def map_of(shapes: Iterable[TopoDS_Shape], kind: TopAbs_ShapeEnum) -> NumberedShapes:
    numbers = NumberedShapes()
    for shape in shapes:
        TopExp.MapShapes_s(shape, kind, numbers)
    return numbers


def all_of(numbers: NumberedShapes) -> Iterator[TopoDS_Shape]:
    return (numbers.FindKey(number) for number in range(1, numbers.Extent() + 1))

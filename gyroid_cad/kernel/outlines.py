"""Faces of the kernel as polygons in the planes of their parameters, whose corners along edges are shared by number."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_C1, GeomAbs_Line
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.arrays import dot, numbered_groups, unit
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.borders import FaceBorders, FaceSurfaces
from gyroid_cad.kernel.check import faces_of
from gyroid_cad.kernel.compat import NumberedShapes, RealArray, as_edge, as_vertex
from gyroid_cad.mesh.triangles.outlined import Outlines
from gyroid_cad.mesh.triangles.trimmed import FaceTriangles, triangulated_faces

__all__ = ["SharedFaces", "face_triangles", "shared_triangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Between the places measured a triangle may be further off: of a quadratic surface by at most 3 %.
_MARGIN = 1.05
# Chords along a smooth piece of an edge from which it is told how many it takes, each with a place in its middle.
_CHORDS = 8
_MOST_CHORDS = 4096
# Of an edge shrunk to a point in the plane of the parameters.
_AT_POLE = 32
# Borders that cross in the plane of the parameters are looked at again with twice the chords, so many times.
_FINER = 4


def face_triangles(
    faces: Sequence[TopoDS_Face],
    deviation: float,
    angle: float,
    known: tuple[FaceSurfaces, FaceBorders] | None = None,
) -> FaceTriangles:
    """Triangles of faces, with the places along an edge shared by all that it bounds; turned as the faces are.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
    deviation : float
        Largest distance of a triangle from its face, in mm.
    angle : float
        Largest angle between neighbouring triangles within a face, and chords along an edge, in radians.
    known : tuple of FaceSurfaces and FaceBorders, optional
        Of these faces, if they were read before.

    Raises
    ------
    KernelError
        If a face has no border, or one that does not close in the plane of its parameters.
    """
    limit = deviation / _MARGIN
    surfaces, borders = known or (FaceSurfaces(faces), FaceBorders(faces))
    edges = _Edges(borders.edges, borders.vertices, limit, angle)
    for _ in range(_FINER):
        made = triangulated_faces(_outlines(borders, edges, surfaces), surfaces, edges.points, limit, angle)
        if not made.crossed.any():
            break
        edges.halve(borders.edges_of(made.crossed))
    backwards = np.array([face.Orientation() == TopAbs_REVERSED for face in faces])[made.faces]
    triangles = np.where(backwards[:, np.newaxis], made.triangles[:, ::-1], made.triangles)
    places = np.where(backwards[:, np.newaxis, np.newaxis], made.places[:, ::-1], made.places)
    return FaceTriangles(made.vertices, triangles, made.faces, made.crossed, places)


@dataclass(frozen=True, slots=True, eq=False)
class SharedFaces:
    """Faces of several shapes, each once, with their triangles.

    Attributes
    ----------
    surfaces : FaceSurfaces
    triangles : FaceTriangles
        Seen from outside of the first shape that has the face; corners lie on the faces.
    users : ndarray of int, shape (faces, 2)
        Which shapes have each face, from 1; 0 where there is no second one.
    first : ndarray of int, shape (faces, 2)
        The first of them, from 0, and the number of the face in it.
    """

    surfaces: FaceSurfaces
    triangles: FaceTriangles
    users: Integers
    first: Integers


def shared_triangles(shapes: Sequence[TopoDS_Shape], deviation: float, angle: float) -> SharedFaces:
    """Triangles of all faces of shapes that may share some, as of :func:`face_triangles`."""
    numbers, faces = NumberedShapes(), list[TopoDS_Face]()
    users, first = list[list[int]](), list[tuple[int, int]]()
    for shape_number, shape in enumerate(shapes):
        for face_number, face in enumerate(faces_of(shape)):
            number = int(numbers.Add(face)) - 1
            if number == len(faces):
                faces.append(face)
                users.append([shape_number + 1, 0])
                first.append((shape_number, face_number))
            else:
                users[number][1] = shape_number + 1
    surfaces = FaceSurfaces(faces)
    made = face_triangles(faces, deviation, angle, (surfaces, FaceBorders(faces)))
    # Those inside faces had been moved a little, for the sake of the volume.
    points = made.vertices.copy()
    points[made.triangles.ravel()] = surfaces.evaluated(np.repeat(made.faces, 3), made.places.reshape(-1, 2))[0]
    return SharedFaces(surfaces, replace(made, vertices=points), np.array(users), np.array(first))


def _outlines(borders: FaceBorders, edges: _Edges, surfaces: FaceSurfaces) -> Outlines:
    """Borders of all faces, with the places that the edges have now."""
    order, squares = np.arange(len(borders.edge)), np.zeros((len(surfaces.domains), 4), dtype=np.int64)
    whole = borders.whole_patches(surfaces.domains)
    whole = whole[edges.even[borders.edge[whole]].all(axis=1)]
    order[np.sort(whole, axis=1)] = whole
    squares[borders.owner[whole[:, 0]]] = edges.steps[borders.edge[whole]]
    steps = edges.steps[borders.edge[order]]
    use, index = numbered_groups(steps)
    at = edges.first[borders.edge[order]][use] + np.where(borders.along[order][use], index, steps[use] - index)
    vertices = edges.numbers[at]
    loops = np.concatenate([[0], np.cumsum(steps)])[borders.loops]
    places = borders.places(order[use], edges.parts[at], edges.points[vertices], surfaces)
    return Outlines(places, vertices, loops, borders.face, squares)


class _Edges:
    """Edges as chords: smooth pieces, how many chords each has, and the places between these."""

    def __init__(self, edges: NumberedShapes, vertices: NumberedShapes, limit: float, angle: float) -> None:
        count, corners = int(edges.Extent()), int(vertices.Extent())
        shapes = [as_edge(edges.FindKey(k).Oriented(TopAbs_FORWARD)) for k in range(1, count + 1)]
        self._ends = np.array(
            [
                [vertices.FindIndex(which(edge)) - 1 for which in (TopExp.FirstVertex_s, TopExp.LastVertex_s)]
                for edge in shapes
            ],
            dtype=np.int64,
        ).reshape(-1, 2)
        if (self._ends < 0).any():
            raise KernelError("an edge that ends nowhere has no triangles")
        self._corners = np.array(
            [BRep_Tool.Pnt_s(as_vertex(vertices.FindKey(k))).Coord() for k in range(1, corners + 1)]
        ).reshape(-1, 3)
        self._curves: list[Any] = [
            None if BRep_Tool.Degenerated_s(edge) else BRepAdaptor_Curve(edge) for edge in shapes
        ]
        breaks = [_breaks(curve) for curve in self._curves]
        pieces = np.array([len(own) - 1 for own in breaks], dtype=np.int64)
        self._piece_edge = np.repeat(np.arange(count), pieces)
        self._starts = np.concatenate([np.empty(0), *(own[:-1] for own in breaks)])
        self._sizes = np.concatenate([np.empty(0), *(np.diff(own) for own in breaks)])
        self._last = np.array([own[-1] for own in breaks])
        self._shrunk = np.array([curve is None for curve in self._curves], dtype=bool)
        self.even = (pieces == 1) & ~self._shrunk
        self._counts = self._enough(limit, angle)
        self._lay()

    def _enough(self, limit: float, angle: float) -> Integers:
        """Chords of each piece of each edge: one of a line, of others as many as it takes."""
        straight = np.array([curve is not None and curve.GetType() == GeomAbs_Line for curve in self._curves])
        bent = np.flatnonzero(~(straight | self._shrunk)[self._piece_edge])
        fractions = np.linspace(0, 1, 2 * _CHORDS + 1)
        along = (self._starts[bent, np.newaxis] + fractions * self._sizes[bent, np.newaxis]).tolist()
        curves = (self._curves[edge] for edge in self._piece_edge[bent].tolist())
        samples = np.array(
            [[curve.Value(t).Coord() for t in own] for curve, own in zip(curves, along, strict=True)]
        ).reshape(-1, 2 * _CHORDS + 1, 3)
        chords = samples[:, 2::2] - samples[:, :-2:2]
        away = samples[:, 1::2] - samples[:, :-2:2]
        length = np.maximum(np.linalg.norm(chords, axis=-1), np.finfo(float).tiny)
        off = np.linalg.norm(np.cross(away, chords), axis=-1) / length
        sides = unit(np.diff(samples, axis=1))
        turned = np.arccos(np.clip(dot(sides[:, 1:], sides[:, :-1]), -1, 1)).max(axis=1, initial=0.0)
        wanted = np.maximum(_CHORDS * np.sqrt(off.max(axis=1, initial=0.0) / limit), 2 * _CHORDS * turned / angle)
        counts = np.ones(len(self._starts), dtype=np.int64)
        counts[bent] = np.ceil(wanted.clip(1, _MOST_CHORDS) - 1e-9)
        _, which, uses = np.unique(np.sort(self._ends, axis=1), axis=0, return_inverse=True, return_counts=True)
        # Else two edges between the same vertices may be one chord, and a closed one nothing.
        fewest = np.where((uses[which.ravel()] > 1) & ~straight, 2, 1)
        fewest[self._ends[:, 0] == self._ends[:, 1]] = 4
        fewest[self._shrunk] = _AT_POLE
        return np.maximum(counts, fewest[self._piece_edge])

    def halve(self, edges: Integers) -> None:
        """Give edges twice the chords."""
        self._counts[np.isin(self._piece_edge, edges) & ~self._shrunk[self._piece_edge]] *= 2
        self._lay()

    def _lay(self) -> None:
        """Places between chords, numbered after the vertices.

        Of each edge, from its first number on, places in parts of its range of parameters, and the points there.
        """
        self.steps = np.bincount(self._piece_edge, self._counts, len(self._curves)).astype(np.int64)
        self.first = np.concatenate([[0], np.cumsum(self.steps + 1)])
        piece, index = numbered_groups(self._counts)
        along = np.empty(self.first[-1])
        along[np.arange(len(piece)) + self._piece_edge[piece]] = (
            self._starts[piece] + index * (self._sizes / self._counts)[piece]
        )
        along[self.first[1:] - 1] = self._last
        edge, index = numbered_groups(self.steps + 1)
        low = along[self.first[:-1]]
        self.parts = (along - low[edge]) / (self._last - low)[edge]
        between = np.flatnonzero((index > 0) & (index < self.steps[edge]) & ~self._shrunk[edge])
        self.numbers = np.where(index == self.steps[edge], self._ends[edge, 1], self._ends[edge, 0])
        self.numbers[between] = len(self._corners) + np.arange(len(between))
        curves = (self._curves[own] for own in edge[between].tolist())
        points = [curve.Value(t).Coord() for curve, t in zip(curves, along[between].tolist(), strict=True)]
        self.points = np.concatenate([self._corners, np.array(points).reshape(-1, 3)])


def _breaks(curve: Any) -> Floats:
    """Parameters where an edge begins, bends sharply, and ends."""
    if curve is None:
        return np.array([0.0, 1.0])
    count = curve.NbIntervals(GeomAbs_C1)
    if count == 1:
        return np.array([curve.FirstParameter(), curve.LastParameter()])
    found = RealArray(1, count + 1)
    curve.Intervals(found, GeomAbs_C1)
    return np.array([found.Value(k) for k in range(1, count + 2)])

"""Depth of points below a solid's faces, by which the core that a skin leaves is confirmed."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.IntTools import IntTools_Context
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_OUT, TopAbs_State
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.kernel.check import compound_of, is_valid, measure, parts_of, topology
from gyroid_cad.kernel.compat import as_edge, as_face
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.part import triangles_by_face, triangles_of
from gyroid_cad.kernel.shells import inner_point
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.files import numbered_corners
from gyroid_cad.mesh.triangles.measures import unmatched_edges

__all__ = ["Depths", "FaceDistances", "Inside", "NamedFaces", "NearDistances", "points_on"]

Floats = NDArray[np.float64]

_CLASSIFYING_TOLERANCE = 1e-7
_POINTS_INSIDE, _POINTS_ON_FACE, _BATCHES = 200, 16, 32
# Of the thickness of a skin: how thin it may be anywhere, and how thick where its inner faces meet at sharp edges.
_THINNEST, _THICKEST = 0.99, 2.02
# Of the thickness of a skin: points so near an opening lie on it.
_ON_OPENING = 1e-4
# The search for the deepest place: how many places are followed, how many tries each, how often, and how far at first.
_FOLLOWED, _TRIES, _ROUNDS, _REACH = 6, 24, 5, 0.4
# What is so much deeper than asked for need not be known better.
_ENOUGH = 1.2
# By so many places a face is told to lie on another, so near to it, in mm: what was mended lies no closer.
_POINTS_TO_NAME, _ON_NAMED = 3, 1e-4
# Of triangles that distances are measured from, in parts of a level, and in parts of the faces' extent; how far off
# a distance from them may be, in deflections.
_DEFLECTION, _COARSE, _FINE, _BAND = 1e-2, 1e-3, 1e-4, 2.0


class FaceDistances:
    """Distances of points from faces.

    Parameters
    ----------
    faces : iterable of TopoDS_Shape
    """

    def __init__(self, faces: Iterable[TopoDS_Shape]) -> None:
        self.faces = list(faces)
        corners = [corners_of(box_round([face])) for face in self.faces]
        self._low, self._high = np.array(corners).reshape(-1, 2, 3).transpose(1, 0, 2)

    def __bool__(self) -> bool:
        return bool(self.faces)

    def distance(self, point: Floats) -> float:
        """Distance of a point, shape (3,), from the nearest face, in mm; infinite if there are none."""
        away = np.maximum(np.maximum(self._low - point, point - self._high), 0)
        at_least = np.linalg.norm(away, axis=1)
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
        nearest = np.inf
        for index in np.argsort(at_least).tolist():
            if at_least[index] >= nearest:
                break
            nearest = min(nearest, _extremum(vertex, self.faces[index]))
        return float(nearest)

    def distances(self, points: Floats) -> Floats:
        """Distances of points, shape (n, 3), from the nearest face, in mm; shape (n,)."""
        return np.array([self.distance(point) for point in points])


class NamedFaces:
    """Names of faces by the places that lie on them.

    Parameters
    ----------
    named : sequence of (TopoDS_Face, str)
    """

    def __init__(self, named: Sequence[tuple[TopoDS_Face, str]]) -> None:
        self._names = [name for _, name in named]
        self._boxes = [box_round([face]) for face, _ in named]
        for box in self._boxes:
            box.Enlarge(_ON_NAMED)
        self._faces = [FaceDistances([face]) for face, _ in named]

    def __bool__(self) -> bool:
        return bool(self._names)

    def name_of(self, face: TopoDS_Face) -> str | None:
        """Name of the face that another lies on; None where that has none."""
        points = points_on(face, _POINTS_TO_NAME)
        for name, box, distances in zip(self._names, self._boxes, self._faces, strict=True):
            if any(box.IsOut(gp_Pnt(*point)) for point in points.tolist()):
                continue
            if all(distances.distance(point) < _ON_NAMED for point in points):
                return name
        return None


class NearDistances:
    """Distances of points from faces: exact where they are about a level, elsewhere from triangles.

    Parameters
    ----------
    faces : iterable of TopoDS_Shape
    level : float
        In mm.
    """

    def __init__(self, faces: Iterable[TopoDS_Shape], level: float) -> None:
        some = list(faces)
        extent = float(np.ptp(corners_of(box_round(some)), axis=0).max())
        deflection = max(min(_DEFLECTION * level, _COARSE * extent), _FINE * extent)
        self._level, self._band = level, _BAND * deflection
        corners = triangles_by_face(compound_of(some), deflection)
        vertices, triangles, _ = numbered_corners(np.concatenate(corners))
        self._triangles = SignedDistances(vertices, triangles)
        self._faces = [_NearFace(as_face(face), own) for face, own in zip(some, corners, strict=True)]

    def __call__(self, points: Floats, level: float | None = None) -> Floats:
        """Distances of points, shape (n, 3), in mm, exact about another level if one is given; shape (n,)."""
        found = self._triangles.away(points)
        near = np.flatnonzero(np.abs(found - (self._level if level is None else level)) < self._band)
        exact = np.full(len(near), np.inf)
        for face in self._faces:
            # No other face can be nearer than the one that is by its triangles, but for what these are off.
            rough = face.rough(points[near], found[near] + 2 * self._band)
            for index in np.flatnonzero(rough < found[near] + 2 * self._band).tolist():
                exact[index] = min(exact[index], face.distance(points[near[index]], float(rough[index]), self._band))
        found[near] = np.where(np.isfinite(exact), exact, found[near])
        return found


class _NearFace:
    """A face that may be the nearest one."""

    def __init__(self, face: TopoDS_Face, corners: Floats) -> None:
        self._face, self._box = face, corners_of(box_round([face]))
        self._triangles = _distances_from(corners)
        self._surface, self._context = ShapeAnalysis_Surface(BRep_Tool.Surface_s(face)), IntTools_Context()
        edges = (as_edge(edge) for edge in parts_of(face, TopAbs_EDGE))
        self._edges = [edge for edge in edges if not BRep_Tool.Degenerated_s(edge)]

    def rough(self, points: Floats, reach: Floats) -> Floats:
        """Distances from its triangles of points no further than a reach from its box, else infinite; shape (n,).

        A face without triangles is as far off as its box.
        """
        away = np.linalg.norm(np.maximum(np.maximum(self._box[0] - points, points - self._box[1]), 0), axis=1)
        found, close = np.full(len(points), np.inf), away <= reach
        found[close] = away[close] if self._triangles is None else self._triangles.away(points[close])
        return found

    def distance(self, point: Floats, about: float, band: float) -> float:
        """Exact distance of a point, shape (3,), that is about as far off: by the nearest place, on an edge if need be.

        What the kernel's search over all of the face finds takes it ten times as long.
        """
        place = gp_Pnt(*point.tolist())
        foot = self._surface.ValueOfUV(place, _CLASSIFYING_TOLERANCE)
        if abs(self._surface.Gap() - about) <= band and self._context.IsPointInFace(self._face, foot):
            return float(self._surface.Gap())
        vertex = BRepBuilderAPI_MakeVertex(place).Vertex()
        nearest = min((_extremum(vertex, edge) for edge in self._edges), default=np.inf)
        return nearest if abs(nearest - about) <= band else _extremum(vertex, self._face)


def _extremum(vertex: TopoDS_Shape, shape: TopoDS_Shape) -> float:
    found = BRepExtrema_DistShapeShape(vertex, shape)
    return float(found.Value()) if found.IsDone() else np.inf


def _distances_from(corners: Floats) -> SignedDistances | None:
    vertices, triangles, _ = numbered_corners(corners)
    return SignedDistances(vertices, triangles) if len(triangles) else None


class Depths:
    """Depth of points in a solid below those of its faces that are no openings.

    Parameters
    ----------
    solid : TopoDS_Solid
    openings : sequence of TopoDS_Face
        Of its faces.
    """

    def __init__(self, solid: TopoDS_Solid, openings: Sequence[TopoDS_Face]) -> None:
        self._openings = list(openings)
        faces = parts_of(solid, TopAbs_FACE)
        self.kept = FaceDistances(face for face in faces if not any(face.IsSame(opening) for opening in openings))
        self.opened = FaceDistances(openings)
        self._random = np.random.default_rng(0)
        self._solid = Inside(solid)
        self._near: dict[float, NearDistances] = {}

    def _depths(self, points: Floats, skin: float, times: float = 1.0) -> Floats:
        """Depths of points, exact about so many times a skin, in mm; shape (n,)."""
        if skin not in self._near:
            self._near[skin] = NearDistances(self.kept.faces, skin)
        return self._near[skin](points, times * skin)

    def deepest(self, enough: float) -> tuple[float, Floats]:
        """About how deep the deepest place lies, in mm, and which it is, shape (3,); or one well deeper than enough."""
        points = self._inside
        depths = self._depths(points, enough)
        for reach in _REACH * 0.5 ** np.arange(_ROUNDS):
            if len(depths) == 0 or depths.max() > _ENOUGH * enough:
                break
            best = np.argsort(depths)[-_FOLLOWED:]
            steps = self._random.normal(size=(_TRIES, len(best), 3)) * (reach * depths[best])[:, np.newaxis]
            tried = (points[best] + steps).reshape(-1, 3)
            tried = tried[self._solid.contains(tried)]
            points = np.concatenate([points[best], tried])
            depths = np.concatenate([depths[best], self._depths(tried, enough)])
        if not len(depths):
            return 0.0, (self._solid.low + self._solid.high) / 2
        return float(depths.max()), points[int(np.argmax(depths))]

    def confirm(self, core: Sequence[TopoDS_Solid], skin: float) -> bool:
        """Confirm that solids are closed, valid, and what a skin leaves of this one, as far as points tell."""
        if not core or any(measure(one)[0] <= 0 or not is_valid(one) or not topology(one).closed for one in core):
            return False
        least, most = _THINNEST * skin, _THICKEST * skin
        outside = self._depths(self._inside, skin, _THINNEST) < least
        inside = self._depths(self._inside, skin, _THICKEST) > most
        in_core = np.any([Inside(one).contains(self._inside) for one in core], axis=0)
        if np.any(in_core[outside]) or not np.all(in_core[inside]):
            return False
        states = [BRepClass3d_SolidClassifier(one) for one in core]
        for face in self._openings:
            points = points_on(face, _POINTS_ON_FACE)
            for point in points[self.kept.distances(points) > most]:
                if all(_state(classifier, point) == TopAbs_OUT for classifier in states):
                    return False
        faces = (face for one in core for face in parts_of(one, TopAbs_FACE))
        return all(self._as_deep(as_face(face), skin) for face in faces)

    def _as_deep(self, face: TopoDS_Face, skin: float) -> bool:
        points = points_on(face, _POINTS_ON_FACE)
        if np.any(self._depths(points, skin) < _THINNEST * skin):
            return False
        below = points[[self.opened.distance(point) > _ON_OPENING * skin for point in points]]
        return bool(
            np.all(self._depths(below, skin, _THICKEST) <= _THICKEST * skin) and np.all(self._solid.contains(below))
        )

    @cached_property
    def _inside(self) -> Floats:
        """Points all over the solid, shape (n, 3)."""
        found: list[Floats] = []
        for _ in range(_BATCHES):
            points = self._random.uniform(self._solid.low, self._solid.high, (_POINTS_INSIDE, 3))
            found.append(points[self._solid.contains(points)])
            if sum(map(len, found)) >= _POINTS_INSIDE:
                break
        return np.concatenate(found)[:_POINTS_INSIDE]


class Inside:
    """Inside of a solid: triangles tell which points lie in it, and the kernel of those that are near its boundary.

    Parameters
    ----------
    solid : TopoDS_Solid
    """

    def __init__(self, solid: TopoDS_Solid) -> None:
        self.low, self.high = corners_of(box_round([solid]))
        self._classifier = BRepClass3d_SolidClassifier(solid)
        deflection = _COARSE * float((self.high - self.low).max())
        vertices, triangles, _ = numbered_corners(triangles_of(solid, deflection))
        self._band = _BAND * deflection if not unmatched_edges(triangles) else np.inf
        self._distances = SignedDistances(vertices, triangles)

    def contains(self, points: Floats) -> NDArray[np.bool_]:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        inside = self._distances.inside(points)
        for index in np.flatnonzero(self._distances.near(points, self._band)).tolist():
            # It takes some places for ones on the boundary that are not: these the triangles tell.
            if (state := _state(self._classifier, points[index])) in (TopAbs_IN, TopAbs_OUT):
                inside[index] = state == TopAbs_IN
        return inside


def points_on(face: TopoDS_Face, count: int) -> Floats:
    """Points on a face: about as many as asked for of its inside, one at least; shape (n, 3)."""
    surface, context = BRepAdaptor_Surface(face), IntTools_Context()
    first_u, last_u, first_v, last_v = BRepTools.UVBounds_s(face)
    random = np.random.default_rng(0)
    places = random.uniform((first_u, first_v), (last_u, last_v), (2 * count, 2)).tolist()
    points = [surface.Value(u, v) for u, v in places if context.IsPointInFace(face, gp_Pnt2d(u, v))][:count]
    return np.array([(point.X(), point.Y(), point.Z()) for point in [inner_point(face, context), *points]])


def _state(classifier: BRepClass3d_SolidClassifier, point: Floats) -> TopAbs_State:
    classifier.Perform(gp_Pnt(*point.tolist()), _CLASSIFYING_TOLERANCE)
    return classifier.State()

"""A part from CAD: read, found sound, measured, and told apart from the space round it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE, TopAbs_IN, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.common.checks import three_numbers
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import measure, parts_of
from gyroid_cad.kernel.compat import as_face, as_solid
from gyroid_cad.kernel.extent import bounding_box, box_of, free_form_faces
from gyroid_cad.kernel.repair import fault_of
from gyroid_cad.kernel.seams import without_seams
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.files import numbered_corners
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.mesh.triangles.spread import spread_points
from gyroid_cad.trim.box import Box

__all__ = [
    "AS_FAR",
    "ON_FACE",
    "OPENINGS",
    "Part",
    "face_numbers",
    "points_within",
    "require_part",
    "selected_faces",
    "selected_way",
    "sound_part",
    "triangles_by_face",
    "triangles_of",
]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]

# Of the triangles that distances are measured from, in parts of the largest extent.
_DEFLECTION = 1e-3
_ANGULAR_DEFLECTION = 0.5
# The same of triangles that tell inside from outside: one after the other, until they are closed. The mesher goes
# beyond its deflection here and there: within so many times it the kernel is asked.
_INSIDE_DEFLECTIONS, _BAND = np.array([1e-4, 4e-5]), 2.0
_CLASSIFYING_TOLERANCE = 1e-7
# Where the thickness is looked at: at so many places at most, so many along the largest extent, by balls of which each
# has so much of the last; and how near the next face they may come, in parts of their radius.
_THICKNESS_PLACES, _THICKNESS_STEPS, _SMALLER, _AS_DEEP = 1500, 60, 0.9, 0.98
# With which a part is measured, once.
_CLOSENESS = 1e-8
# Of a part that takes up little of its box fewer points are found than are asked for.
_MOST_BATCHES = 8


# Without slots, so that its mesh is kept once it is made.
@dataclass(frozen=True, eq=False)
class Part:
    """Closed, valid solids.

    Attributes
    ----------
    shape : TopoDS_Shape
    solids : tuple of TopoDS_Solid
    low, high : ndarray, shape (3,)
        Corners of the bounding box, in mm.
    volume : float
        In mm3.
    box : Box, optional
        If the part is one solid and that is a box.
    area : float
        Of the boundary, in mm2.
    named_faces : tuple of (TopoDS_Face, str)
        Faces with the names that the part's file gives them, of the shape as it was read.
    """

    shape: TopoDS_Shape
    solids: tuple[TopoDS_Solid, ...]
    low: Floats
    high: Floats
    volume: float
    box: Box | None = None
    area: float = 0.0
    named_faces: tuple[tuple[TopoDS_Face, str], ...] = ()

    @cached_property
    def face_count(self) -> int:
        """Number of its faces."""
        return sum(1 for _ in parts_of(self.shape, TopAbs_FACE))

    @cached_property
    def free_form_area(self) -> float:
        """Of its area, in mm2, what is on surfaces that have no closed form."""
        return sum(measure(face)[1] for face in free_form_faces(self.shape))

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,).

        A mesh of the part tells, but of points so near to it that it may be on the wrong side of the surface: of these
        alone the kernel is asked (``BRepClass3d_SolidClassifier``), which takes up to 40 ms for each.
        """
        signed, band = self._signed_distances
        if signed is None:
            return self._classified(points)
        inside, near = signed.inside(points), np.flatnonzero(signed.near(points, band))
        inside[near] = self._classified(points[near])
        return inside

    def _classified(self, points: Floats) -> Booleans:
        inside = np.zeros(len(points), dtype=bool)
        for solid in self.solids:
            classifier = BRepClass3d_SolidClassifier(solid)
            for index in np.flatnonzero(~inside).tolist():
                classifier.Perform(gp_Pnt(*points[index].tolist()), _CLASSIFYING_TOLERANCE)
                inside[index] = classifier.State() == TopAbs_IN
        return inside

    @cached_property
    def _signed_distances(self) -> tuple[SignedDistances | None, float]:
        """Distances from a closed mesh, if there is one, and how near to it the surface may run, in mm."""
        for deflection in _INSIDE_DEFLECTIONS * float(np.max(self.high - self.low)):
            corners = np.concatenate(triangles_by_face(self.shape, float(deflection), threads=True))
            vertices, triangles, _ = numbered_corners(corners)
            if not unmatched_edges(triangles):
                return SignedDistances(vertices, triangles), _BAND * float(deflection)
        return None, 0.0

    def points_inside(self, count: int) -> Floats:
        """Points spread at random over the inside, the same ones each time; shape (n, 3), as many as are wanted."""
        return points_within(self.low, self.high, self.contains, count)

    def thickest(self, enough: float) -> float:
        """About how thick the part is where it is thickest, in mm: the largest ball that fits into it.

        Parameters
        ----------
        enough : float
            A part that is thicker than this somewhere need not be known better.
        """
        smallest = float(np.min(self.high - self.low))
        if self.box is not None or smallest <= enough:
            return smallest
        if max(self._balls) > enough:
            return max(self._balls)
        points, normals, _ = self.surface_samples(float(np.max(self.high - self.low)) / _THICKNESS_STEPS)
        chosen = np.random.default_rng(0).permutation(len(points))[:_THICKNESS_PLACES]
        points, normals = points[chosen], normals[chosen]
        signed, band = self._signed_distances
        if signed is None:
            return smallest
        radius = enough / 2 / _AS_DEEP
        while not np.any(signed(points - radius * normals) <= band - _AS_DEEP * radius):
            radius *= _SMALLER
        self._balls.append(2 * radius)
        return 2 * radius

    @cached_property
    def _balls(self) -> list[float]:
        """Diameters of balls that are known to fit, in mm."""
        return [0.0]

    def surface_samples(self, spacing: float) -> tuple[Floats, Floats, float]:
        """Points on the boundary, and how far at most any place on it is from the nearest of them, in mm.

        Parameters
        ----------
        spacing : float
            Between the points, in mm.

        Returns
        -------
        points : ndarray, shape (n, 3)
        normals : ndarray, shape (n, 3)
            Of triangles that they lie on, out of the part.
        error : float
        """
        deflection = min(_DEFLECTION * float(np.max(self.high - self.low)), spacing / 4)
        corners = triangles_by_face(self.shape, deflection, threads=True)
        face = np.repeat(np.arange(len(corners)), [len(some) for some in corners])
        return *spread_points(np.concatenate(corners), spacing, face), spacing + deflection


def triangles_of(shape: TopoDS_Shape, deflection: float) -> Floats:
    """Corners of triangles no further from a shape's faces than a deflection in mm; shape (triangles, 3, 3)."""
    return np.concatenate([np.empty((0, 3, 3)), *triangles_by_face(shape, deflection)])


def triangles_by_face(shape: TopoDS_Shape, deflection: float, threads: bool = False) -> list[Floats]:
    """Corners of triangles as of :func:`triangles_of`, anticlockwise from outside, those of each face by themselves.

    Parameters
    ----------
    shape : TopoDS_Shape
    deflection : float
        In mm.
    threads : bool
        Whether the mesher may start some: then no process may be forked from this one meanwhile.
    """
    copy = BRepBuilderAPI_Copy(shape, False, False).Shape()
    BRepMesh_IncrementalMesh(copy, deflection, False, _ANGULAR_DEFLECTION, threads)
    return [_corners_of(as_face(face)) for face in parts_of(copy, TopAbs_FACE)]


def points_within(low: Floats, high: Floats, contains: Callable[[Floats], Booleans], count: int) -> Floats:
    """Points spread at random over what a box holds of something, as :meth:`Part.points_inside` gives them."""
    random, found = np.random.default_rng(0), np.empty((0, 3))
    for _ in range(_MOST_BATCHES):
        points = random.uniform(low, high, (count, 3))
        found = np.concatenate([found, points[contains(points)]])
        if len(found) >= count:
            break
    return found[:count]


def require_part(shape: TopoDS_Shape, parameter: str = "part") -> Part:
    """The solids of a shape, which have no space in common, if they are closed, valid and the right way out.

    Raises
    ------
    ParameterError
        Saying what is wrong with it.
    """
    if shape is None or shape.IsNull():
        raise ParameterError(parameter, shape, "a shape that holds a solid, not an empty one")
    solids = tuple(as_solid(solid) for solid in parts_of(shape, TopAbs_SOLID))
    kind = shape.ShapeType().name.removeprefix("TopAbs_").lower()
    if not solids:
        raise ParameterError(parameter, kind, "a closed solid: there is none in it")
    for index, solid in enumerate(solids, 1):
        if fault := fault_of(solid, "its solid" if len(solids) == 1 else f"solid {index} of {len(solids)}"):
            raise ParameterError(parameter, kind, fault)
    return sound_part(shape)


def sound_part(shape: TopoDS_Shape) -> Part:
    """A part of solids that are known to be sound, and to have no space in common."""
    low, high = bounding_box(shape)
    volume, area = measure(shape, _CLOSENESS)
    divided = without_seams(shape)
    solids = tuple(as_solid(solid) for solid in parts_of(divided, TopAbs_SOLID))
    return Part(divided, solids, low, high, volume, box_of(solids), area)


def _corners_of(face: TopoDS_Face) -> Floats:
    """Corners of the triangles of a meshed face, anticlockwise from outside; none where the mesher left it out."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    if mesh is None:
        return np.empty((0, 3, 3))
    move = location.Transformation()
    points = (mesh.Node(index).Transformed(move) for index in range(1, mesh.NbNodes() + 1))
    nodes = np.array([(point.X(), point.Y(), point.Z()) for point in points])
    corners = np.array([mesh.Triangle(index).Get() for index in range(1, mesh.NbTriangles() + 1)]) - 1
    return np.asarray(nodes[corners[:, ::-1] if face.Orientation() == TopAbs_REVERSED else corners])


OPENINGS = 'faces of the part, selectors such as ">Z" or "<X", or points (x, y, z) on them'
# In parts of the part's largest extent.
AS_FAR, ON_FACE = 1e-6, 1e-3


def selected_faces(part: Part, openings: Sequence[Any]) -> list[TopoDS_Face]:
    """Faces given as themselves, by a selector, or by a point on them.

    Parameters
    ----------
    part : Part
    openings : sequence
        Faces of the kernel or of a host; strings such as ">Z" for the faces whose centre of area is furthest that way;
        points (x, y, z) in mm, each for the nearest face.

    Raises
    ------
    ParameterError
    """
    if isinstance(openings, str) or not isinstance(openings, Iterable):
        raise ParameterError("openings", openings, f"a sequence of {OPENINGS}")
    return [face for given in openings for face in _selected(part, given)]


def face_numbers(shape: TopoDS_Shape, openings: Sequence[Any]) -> list[int]:
    """Numbers of chosen faces, as :func:`gyroid_cad.kernel.stl.solid_triangles` counts them.

    Parameters
    ----------
    shape : TopoDS_Shape
    openings : sequence
        As of :func:`selected_faces`.

    Raises
    ------
    ParameterError
    """
    low, high = bounding_box(shape)
    chosen = selected_faces(Part(shape, (), low, high, 0.0), openings)
    faces = [face for solid in parts_of(shape, TopAbs_SOLID) for face in parts_of(solid, TopAbs_FACE)]
    numbers = [number for number, face in enumerate(faces) if any(face.IsSame(other) for other in chosen)]
    if chosen and not numbers:
        raise ParameterError("openings", openings, "faces of the part that is filled")
    return numbers


def _selected(part: Part, given: Any) -> list[TopoDS_Face]:
    faces = [as_face(face) for face in parts_of(part.shape, TopAbs_FACE)]
    if isinstance(given, str):
        return _furthest(part, faces, given)
    shape = getattr(given, "wrapped", given)
    if isinstance(shape, TopoDS_Shape):
        found = [] if shape.IsNull() else [as_face(face) for face in parts_of(shape, TopAbs_FACE)]
        if not found:
            raise ParameterError("openings", given, OPENINGS)
        return found
    try:
        point = three_numbers("openings", given)
    except ParameterError:
        raise ParameterError("openings", given, OPENINGS) from None
    return [_nearest(part, faces, point)]


def _furthest(part: Part, faces: list[TopoDS_Face], selector: str) -> list[TopoDS_Face]:
    sign, axis = selected_way(selector)
    reach = sign * np.array([_centre(face)[axis] for face in faces])
    limit = reach.max() - AS_FAR * float(np.max(part.high - part.low))
    return [faces[index] for index in np.flatnonzero(reach >= limit).tolist()]


def selected_way(selector: str) -> tuple[float, int]:
    """Sign and axis of a selector; raises ParameterError.

    >>> selected_way(">Z"), selected_way("<X")
    ((1.0, 2), (-1.0, 0))
    """
    text = selector.strip().upper()
    if len(text) != 2 or text[0] not in "<>" or text[1] not in "XYZ":
        raise ParameterError("openings", selector, OPENINGS)
    return 1.0 if text[0] == ">" else -1.0, "XYZ".index(text[1])


def _centre(face: TopoDS_Face) -> tuple[float, float, float]:
    area = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, area)
    centre = area.CentreOfMass()
    return centre.X(), centre.Y(), centre.Z()


def _away(distance: float) -> str:
    return f"the nearest is {distance:.4g} mm away" if np.isfinite(distance) else "none is anywhere near"


def _nearest(part: Part, faces: list[TopoDS_Face], point: Floats) -> TopoDS_Face:
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    searches = (BRepExtrema_DistShapeShape(vertex, face) for face in faces)
    # Of a point much too far off the kernel finds no distance.
    distances = [found.Value() if found.IsDone() else np.inf for found in searches]
    nearest = int(np.argmin(distances))
    if distances[nearest] > ON_FACE * float(np.max(part.high - part.low)):
        shown = tuple(point.tolist())
        raise ParameterError("openings", shown, f"a point on a face; {_away(distances[nearest])}")
    return faces[nearest]

"""A shape looked at along its edges: places in space and on the faces beside them, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_Line
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.arrays import unit
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.borders import FaceBorders, FaceSurfaces
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face

__all__ = ["SampledShape"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places along an edge, its ends among them: an odd number, for lengths are by Simpson's rule.
_PLACES = 17
_SIMPSON = np.array([1.0, *[4.0, 2.0] * (_PLACES // 2 - 1), 4.0, 1.0]) / (3 * (_PLACES - 1))
# A surface has no normal where its area vector is so small a part of the largest one seen on the face.
_NO_NORMAL = 1e-9


class SampledShape:
    """Faces of a shape, the edges round them, and places along each edge, its ends among them.

    Parameters
    ----------
    shape : TopoDS_Shape

    Attributes
    ----------
    shape : TopoDS_Shape
    faces : list of TopoDS_Face
        With those only whose borders close.
    open_borders : list of TopoDS_Face
        The others.
    edges : list of TopoDS_Edge
        Forward, as ``borders`` counts them.
    curves : list of BRepAdaptor_Curve or None
        None of edges shrunk to a point.
    surfaces : FaceSurfaces
    borders : FaceBorders
    parts : ndarray, shape (places,)
        Of an edge's range of parameters.
    points, rates : ndarray, shape (edges, places, 3)
        Along every edge, and their derivatives by the part of its range; NaN of edges shrunk to a point.
    """

    def __init__(self, shape: TopoDS_Shape) -> None:
        self.shape = shape
        every = [as_face(face) for face in parts_of(shape, TopAbs_FACE)]
        self.faces, self.open_borders = every, list[TopoDS_Face]()
        try:
            self.borders = FaceBorders(every)
        except KernelError:
            self.faces, self.open_borders = _closing(every)
            self.borders = FaceBorders(self.faces)
        self.surfaces = FaceSurfaces(self.faces)
        numbered = self.borders.edges
        self.edges = [as_edge(numbered.FindKey(k).Oriented(TopAbs_FORWARD)) for k in range(1, numbered.Extent() + 1)]
        self.curves = [None if BRep_Tool.Degenerated_s(edge) else BRepAdaptor_Curve(edge) for edge in self.edges]
        self.parts = np.linspace(0, 1, _PLACES)
        self.points, self.rates = np.full((2, len(self.edges), _PLACES, 3), np.nan)
        for number, curve in enumerate(self.curves):
            if curve is not None:
                self.points[number], self.rates[number] = _along(curve, self.parts)

    def along(self, edge: int, parts: Floats) -> tuple[Floats, Floats]:
        """Points, shape (n, 3), of an edge that is not shrunk to a point, and derivatives by the part of its range."""
        return _along(self.curves[edge], parts)

    @cached_property
    def bodies(self) -> Integers:
        """Solid of each face, counted from 0; -1 of a face of none."""
        numbers, solids = NumberedShapes(), np.full(len(self.faces), -1)
        for face in self.faces:
            numbers.Add(face)
        index = {numbers.FindIndex(face): number for number, face in enumerate(self.faces)}
        for number, solid in enumerate(parts_of(self.shape, TopAbs_SOLID)):
            for face in parts_of(solid, TopAbs_FACE):
                if (known := index.get(numbers.FindIndex(face))) is not None:
                    solids[known] = number
        return solids

    @cached_property
    def real(self) -> Booleans:
        """Mask of the edges that are not shrunk to a point."""
        return np.array([curve is not None for curve in self.curves], dtype=bool)

    @cached_property
    def lengths(self) -> Floats:
        """Lengths of the edges, in mm; NaN of those shrunk to a point."""
        return np.asarray(np.linalg.norm(self.rates, axis=-1) @ _SIMPSON)

    @cached_property
    def end_vertices(self) -> Integers:
        """Vertices where each edge begins and ends, from 1 on as ``borders`` counts them; shape (edges, 2)."""
        find, ends = self.borders.vertices.FindIndex, (TopExp.FirstVertex_s, TopExp.LastVertex_s)
        return np.array([[find(end(edge)) for end in ends] for edge in self.edges], dtype=np.int64).reshape(-1, 2)

    @cached_property
    def uses(self) -> Integers:
        """Uses of edges by faces that are not shrunk to a point, as ``borders`` counts them."""
        return np.flatnonzero(self.real[self.borders.edge])

    @cached_property
    def on_faces(self) -> tuple[Floats, Floats, Floats]:
        """Parameters, points and unit normals on the faces, out of the solid, along each of the ``uses``.

        Shapes (uses, places, 2) and twice (uses, places, 3); a normal is zero where the surface has none.
        """
        count = len(self.uses)
        points = self.points[self.borders.edge[self.uses]].reshape(-1, 3)
        use, part = np.repeat(self.uses, _PLACES), np.tile(self.parts, count)
        places = self.borders.places(use, part, points, self.surfaces)
        face = self.borders.owner[use]
        found, normals = self.surfaces.evaluated(face, places)
        sizes = np.linalg.norm(normals, axis=1)
        largest = np.zeros(len(self.faces))
        np.maximum.at(largest, face, sizes)
        turned = np.array([one.Orientation() == TopAbs_REVERSED for one in self.faces], dtype=bool)
        signs = np.where(turned, -1.0, 1.0)[face] * (sizes > _NO_NORMAL * largest[face])
        outwards = unit(normals) * signs[:, np.newaxis]
        return places.reshape(count, _PLACES, 2), found.reshape(count, _PLACES, 3), outwards.reshape(count, _PLACES, 3)


def _closing(faces: Sequence[TopoDS_Face]) -> tuple[list[TopoDS_Face], list[TopoDS_Face]]:
    """Faces whose borders close, and the others."""
    try:
        FaceBorders(faces)
    except KernelError:
        if len(faces) == 1:
            return [], list(faces)
        # Few are open: they are found by halving.
        halves = [_closing(faces[: len(faces) // 2]), _closing(faces[len(faces) // 2 :])]
        return halves[0][0] + halves[1][0], halves[0][1] + halves[1][1]
    return list(faces), []


def _along(curve: Any, parts: Floats) -> tuple[Floats, Floats]:
    """Points of an edge at parts of its range of parameters, and their derivatives by these."""
    first, last = curve.FirstParameter(), curve.LastParameter()
    if curve.GetType() == GeomAbs_Line:
        start, end = (np.array(curve.Value(t).Coord()) for t in (first, last))
        return start + parts[:, np.newaxis] * (end - start), np.broadcast_to(end - start, (len(parts), 3))
    point, rate, found = gp_Pnt(), gp_Vec(), np.empty((2, len(parts), 3))
    for index, t in enumerate((first + parts * (last - first)).tolist()):
        curve.D1(t, point, rate)
        found[0, index], found[1, index] = point.Coord(), rate.Coord()
    return found[0], found[1] * (last - first)

"""Boxes round shapes, quick ones for searching and the tightest, the one that a solid is; and what faces are on."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.GeomAbs import (
    GeomAbs_BSplineSurface,
    GeomAbs_Cone,
    GeomAbs_Cylinder,
    GeomAbs_Plane,
    GeomAbs_Sphere,
    GeomAbs_Torus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_face, as_vertex
from gyroid_cad.trim.box import Box

__all__ = ["bounding_box", "box_of", "box_round", "corners_of", "free_form_faces", "solid_of_box"]

_BOX_FACES, _BOX_CORNERS = 6, 8
# How far from square a box may be, in radians and in parts of its largest extent.
_SQUARE = 1e-9
# Of a torus whose parameter runs through zero the kernel's quick box leaves out half, of what is extruded some 1e-3 mm.
_BOXED_WELL = {GeomAbs_Plane, GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_BSplineSurface}
_IN_CLOSED_FORM = {GeomAbs_Plane, GeomAbs_Cylinder, GeomAbs_Cone, GeomAbs_Sphere, GeomAbs_Torus}


def box_round(shapes: Iterable[TopoDS_Shape]) -> Bnd_Box:
    """Box round all of the shapes, a little larger than need be."""
    box = Bnd_Box()
    for shape in shapes:
        BRepBndLib.Add_s(shape, box)
        for face in map(as_face, parts_of(shape, TopAbs_FACE)):
            if BRepAdaptor_Surface(face, False).GetType() not in _BOXED_WELL:
                BRepBndLib.AddOptimal_s(face, box, False, False)
    return box


def corners_of(box: Bnd_Box) -> NDArray[np.float64]:
    """Lowest and highest corner of a box that isn't empty, in mm; shape (2, 3)."""
    # Bnd_Box.Get has no Python form in OCP 8.
    corners = (box.CornerMin(), box.CornerMax())
    return np.array([(corner.X(), corner.Y(), corner.Z()) for corner in corners])


def bounding_box(shape: TopoDS_Shape) -> NDArray[np.float64]:
    """Lowest and highest corner of the tightest box round a shape, in mm; shape (2, 3), zero where it is empty."""
    box = Bnd_Box()
    BRepBndLib.AddOptimal_s(shape, box, False, False)
    return np.zeros((2, 3)) if box.IsVoid() else corners_of(box)


def solid_of_box(box: Box) -> TopoDS_Shape:
    """A box as a solid, of which :func:`box_of` finds it again."""
    corner, x, z = box.axes @ box.low, box.axes[:, 0], box.axes[:, 2]
    place = gp_Ax2(gp_Pnt(*corner.tolist()), gp_Dir(*z.tolist()), gp_Dir(*x.tolist()))
    return BRepPrimAPI_MakeBox(place, *(box.high - box.low).tolist()).Solid()


def box_of(solids: Sequence[TopoDS_Solid]) -> Box | None:
    """The box that the solids are, if they are one box: six planes, and eight corners where a box has them."""
    if len(solids) != 1:
        return None
    faces = [as_face(face) for face in parts_of(solids[0], TopAbs_FACE)]
    if len(faces) != _BOX_FACES or any(BRepAdaptor_Surface(face).GetType() != GeomAbs_Plane for face in faces):
        return None
    corners = NumberedShapes()
    TopExp.MapShapes_s(solids[0], TopAbs_VERTEX, corners)
    places = (BRep_Tool.Pnt_s(as_vertex(corners.FindKey(k))) for k in range(1, corners.Extent() + 1))
    points = np.array([(place.X(), place.Y(), place.Z()) for place in places])
    normals = [BRepAdaptor_Surface(face).Plane().Axis().Direction() for face in faces]
    directions = np.array([(normal.X(), normal.Y(), normal.Z()) for normal in normals])
    first = directions[0]
    across = [direction for direction in directions if abs(direction @ first) < _SQUARE]
    if len(points) != _BOX_CORNERS or not across:
        return None
    axes = np.stack([first, across[0], np.cross(first, across[0])], axis=1)
    along = points @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    size = float(np.max(high - low))
    ends = np.minimum(np.abs(along - low), np.abs(along - high))
    upper = {tuple(row) for row in (along > (low + high) / 2).tolist()}
    return Box(axes, low, high) if ends.max() < _SQUARE * size and len(upper) == _BOX_CORNERS else None


def free_form_faces(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    """Faces on surfaces that have no closed form: splines, and what is swept or offset."""
    faces = map(as_face, parts_of(shape, TopAbs_FACE))
    return [face for face in faces if BRepAdaptor_Surface(face, False).GetType() not in _IN_CLOSED_FORM]

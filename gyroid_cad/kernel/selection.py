"""Faces of a part, as users point at them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.checks import three_numbers
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.part import Part

__all__ = ["selected_faces"]

Floats = NDArray[np.float64]

_ACCEPTED = 'faces of the part, selectors such as ">Z" or "<X", or points (x, y, z) on them'
# In parts of the part's largest extent.
_AS_FAR, _ON_FACE = 1e-6, 1e-3


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
        raise ParameterError("openings", openings, f"a sequence of {_ACCEPTED}")
    return [face for given in openings for face in _selected(part, given)]


def _selected(part: Part, given: Any) -> list[TopoDS_Face]:
    faces = [as_face(face) for face in parts_of(part.shape, TopAbs_FACE)]
    if isinstance(given, str):
        return _furthest(part, faces, given)
    shape = getattr(given, "wrapped", given)
    if isinstance(shape, TopoDS_Shape):
        found = [] if shape.IsNull() else [as_face(face) for face in parts_of(shape, TopAbs_FACE)]
        if not found:
            raise ParameterError("openings", given, _ACCEPTED)
        return found
    try:
        point = three_numbers("openings", given)
    except ParameterError:
        raise ParameterError("openings", given, _ACCEPTED) from None
    return [_nearest(part, faces, point)]


def _furthest(part: Part, faces: list[TopoDS_Face], selector: str) -> list[TopoDS_Face]:
    text = selector.strip().upper()
    if len(text) != 2 or text[0] not in "<>" or text[1] not in "XYZ":
        raise ParameterError("openings", selector, _ACCEPTED)
    sign = 1.0 if text[0] == ">" else -1.0
    reach = sign * np.array([_centre(face)["XYZ".index(text[1])] for face in faces])
    limit = reach.max() - _AS_FAR * float(np.max(part.high - part.low))
    return [faces[index] for index in np.flatnonzero(reach >= limit).tolist()]


def _centre(face: TopoDS_Face) -> tuple[float, float, float]:
    area = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, area)
    centre = area.CentreOfMass()
    return centre.X(), centre.Y(), centre.Z()


def _nearest(part: Part, faces: list[TopoDS_Face], point: Floats) -> TopoDS_Face:
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    distances = [BRepExtrema_DistShapeShape(vertex, face).Value() for face in faces]
    nearest = int(np.argmin(distances))
    if distances[nearest] > _ON_FACE * float(np.max(part.high - part.low)):
        shown = tuple(point.tolist())
        raise ParameterError("openings", shown, f"a point on a face; the nearest is {distances[nearest]:.4g} mm away")
    return faces[nearest]

"""Shapes without seams: spheres, cylinders and the like in halves, parted along lines of their own parameters."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_BSplineCurve, Geom_Curve, Geom_TrimmedCurve
from OCP.Geom2d import Geom2d_Line
from OCP.ShapeFix import ShapeFix_Shape, ShapeFix_ShapeTolerance
from OCP.ShapeUpgrade import ShapeUpgrade_ShapeDivideClosed
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from gyroid_cad.kernel.check import is_valid
from gyroid_cad.kernel.compat import NumberedShapes, ShapesOfShape, as_edge, as_face

__all__ = ["without_seams"]

# A curve of the kernel, and where it stands.
PlacedCurve = tuple[Geom_Curve, TopLoc_Location]

# In mm: how exact a surface's own line is, and the tolerance that an edge along one is given.
_EXACT, _TOLERANCE = 1e-9, 1e-7
# Where along an edge that is looked at.
_LOOKED_AT = 9


def without_seams(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Part spheres, cylinders and the like into two halves (``ShapeUpgrade_ShapeDivideClosed``).

    A face that closes on itself and is then cut loses its sense in STEP files: the kernel's reader gives another face.

    Parameters
    ----------
    shape : TopoDS_Shape

    Returns
    -------
    TopoDS_Shape
        The shape itself if it has no seams, or cannot be parted and stay valid.
    """
    divide = ShapeUpgrade_ShapeDivideClosed(shape)
    divide.Perform()
    divided = divide.Result()
    if divided is None or divided.IsNull() or divided.IsSame(shape):
        return shape
    if not is_valid(divided):
        # New edges may be left with curves that do not run alike.
        fix = ShapeFix_Shape(divided)
        fix.Perform()
        divided = fix.Shape()
    _make_exact(divided, shape)
    return divided if is_valid(divided) else shape


def _make_exact(divided: TopoDS_Shape, original: TopoDS_Shape) -> None:
    """Give edges that halves have in common the line of their surface; they are made as splines 1e-5 mm beside it."""
    own, builder, tolerances = NumberedShapes(), BRep_Builder(), ShapeFix_ShapeTolerance()
    TopExp.MapShapes_s(original, TopAbs_EDGE, own)
    users = ShapesOfShape()
    TopExp.MapShapesAndAncestors_s(divided, TopAbs_EDGE, TopAbs_FACE, users)
    for number in range(1, users.Extent() + 1):
        edge = as_edge(users.FindKey(number).Oriented(TopAbs_FORWARD))
        if own.Contains(edge) or BRep_Tool.Degenerated_s(edge) or not _is_spline(edge):
            continue
        lines = [_surface_line(edge, as_face(face)) for face in users.FindFromIndex(number)]
        if len(lines) == 2 and lines[0] is not None and lines[1] is not None and _agree(edge, lines[0], lines[1]):
            builder.UpdateEdge(edge, *lines[0], _TOLERANCE)
            tolerances.SetTolerance(edge, _TOLERANCE, TopAbs_EDGE)


def _is_spline(edge: TopoDS_Edge) -> bool:
    return isinstance(BRep_Tool.Curve_s(edge, TopLoc_Location(), 0.0, 0.0), Geom_BSplineCurve)


def _surface_line(edge: TopoDS_Edge, face: TopoDS_Face) -> PlacedCurve | None:
    """The line of one parameter of a surface that an edge runs along with the other as its own; None for others."""
    location = TopLoc_Location()
    on_face, surface = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0), BRep_Tool.Surface_s(face, location)
    if not isinstance(on_face, Geom2d_Line):
        return None
    way, start = on_face.Direction(), on_face.Location()
    if way.Y() == 1.0 and start.Y() == 0.0:
        line = surface.UIso(start.X())
    elif way.X() == 1.0 and start.X() == 0.0:
        line = surface.VIso(start.Y())
    else:
        return None
    return line.BasisCurve() if isinstance(line, Geom_TrimmedCurve) else line, location


def _agree(edge: TopoDS_Edge, one: PlacedCurve, other: PlacedCurve) -> bool:
    """Tell whether two curves are one over the range of an edge, and the edge's own within its tolerance."""
    curve, tolerance = BRepAdaptor_Curve(edge), BRep_Tool.Tolerance_s(edge)
    for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), _LOOKED_AT).tolist():
        first, second = (line.Value(t).Transformed(location.Transformation()) for line, location in (one, other))
        if first.Distance(second) > _EXACT or first.Distance(curve.Value(t)) > tolerance:
            return False
    return True

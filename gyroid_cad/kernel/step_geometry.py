"""Curves and surfaces of the kernel, read into what STEP has for them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_BSplineCurve,
    Geom_BSplineSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Geometry,
    Geom_Hyperbola,
    Geom_Line,
    Geom_Parabola,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Curve, Geom2d_Line, Geom2d_TrimmedCurve
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Dir, gp_Pnt
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from gyroid_cad.step.geometry import (
    AxisPlacement,
    Geometry,
    Knots,
    Line,
    ParameterLine,
    Placed,
    Spline,
    SweptSurface,
    Triple,
)
from gyroid_cad.step.text import counting

__all__ = [
    "Geometries",
    "UnknownGeometryError",
    "axis_placement",
    "parameter_curve",
    "read_geometry",
]

Floats = NDArray[np.float64]

# Of these the entity has the kernel's own parameters. A plane is left out: what lies in it is its own projection.
_SAME_PARAMETERS = ("CYLINDRICAL_SURFACE", "SPHERICAL_SURFACE", "TOROIDAL_SURFACE")


class UnknownGeometryError(Exception):
    """Something that only the kernel's own writer can put into words: an offset surface, say, or a face of no solid."""


class Geometries:
    """Curves and surfaces as they are found, each once.

    Attributes
    ----------
    found : list of Spline, Placed, Line or SweptSurface
    """

    def __init__(self) -> None:
        self.found: list[Geometry] = []
        # Kept alive, so that ids stay their own.
        self._read: dict[int, tuple[Geom_Geometry, Geometry]] = {}
        self._numbers: dict[tuple[int, bytes], int] = {}

    def number(self, geometry: Geom_Geometry | None, location: TopLoc_Location) -> int:
        """Index in ``found`` of a curve or surface that a location moves.

        Raises
        ------
        UnknownGeometryError
        """
        matrix = _matrix(location)
        key = id(geometry), b"" if matrix is None else matrix.tobytes()
        if key not in self._numbers:
            self._numbers[key] = len(self.found)
            self.found.append(self._moved(geometry, location, matrix))
        return self._numbers[key]

    def _moved(self, geometry: Geom_Geometry | None, location: TopLoc_Location, matrix: Floats | None) -> Geometry:
        if id(geometry) not in self._read:
            self._read[id(geometry)] = geometry, read_geometry(geometry)
        read = self._read[id(geometry)][1]
        if matrix is None or geometry is None:
            return read
        if isinstance(read, Spline):
            # Of a lattice many are translates of few.
            return replace(read, poles=read.poles @ matrix[:, :3].T + matrix[:, 3])
        return read_geometry(geometry.Transformed(location.Transformation()))


def read_geometry(geometry: Geom_Geometry | None) -> Geometry:
    """Read a curve or surface of the kernel.

    Raises
    ------
    UnknownGeometryError
    """
    reader = _READERS.get(type(geometry))
    if reader is None:
        raise UnknownGeometryError(type(geometry).__name__)
    return reader(geometry)


def axis_placement(location: TopLoc_Location) -> AxisPlacement:
    """Return the places to which a location takes the origin and the axes z and x.

    Raises
    ------
    UnknownGeometryError
        If it mirrors.
    """
    matrix = _matrix(location)
    if matrix is None:
        matrix = np.eye(3, 4)
    if np.linalg.det(matrix[:, :3]) < 0:
        raise UnknownGeometryError("a mirrored copy")
    x, _, z, origin = matrix.T.tolist()
    return tuple(origin), tuple(z), tuple(x)


def _matrix(location: TopLoc_Location) -> Floats | None:
    """Rows of a location's rotation and, in the last column, translation in mm; none where it moves nothing."""
    if location.IsIdentity():
        return None
    transformation = location.Transformation()
    return np.array([[transformation.Value(row, column) for column in (1, 2, 3, 4)] for row in (1, 2, 3)])


def _spline_curve(curve: Geom_BSplineCurve) -> Spline:
    closed = curve.IsClosed()
    if curve.IsPeriodic():
        # No reader need know periodic knots.
        curve = curve.Copy()
        curve.SetNotPeriodic()
    count, poles = curve.NbPoles(), curve.Poles()
    points = [(p.X(), p.Y(), p.Z()) for p in (poles.Value(i) for i in range(1, count + 1))]
    weights = [curve.Weight(i) for i in range(1, count + 1)] if curve.IsRational() else None
    return Spline(
        (curve.Degree(),),
        np.array(points),
        None if weights is None else np.array(weights),
        (_knots(curve.Knots(), curve.Multiplicities()),),
        (closed,),
    )


def _spline_surface(surface: Geom_BSplineSurface) -> Spline:
    closed = (surface.IsUClosed(), surface.IsVClosed())
    if surface.IsUPeriodic() or surface.IsVPeriodic():
        surface = surface.Copy()
        if surface.IsUPeriodic():
            surface.SetUNotPeriodic()
        if surface.IsVPeriodic():
            surface.SetVNotPeriodic()
    rows, columns, poles = range(1, surface.NbUPoles() + 1), range(1, surface.NbVPoles() + 1), surface.Poles()
    points = [[(p.X(), p.Y(), p.Z()) for p in (poles.Value(i, j) for j in columns)] for i in rows]
    rational = surface.IsURational() or surface.IsVRational()
    return Spline(
        (surface.UDegree(), surface.VDegree()),
        np.array(points),
        np.array([[surface.Weight(i, j) for j in columns] for i in rows]) if rational else None,
        (
            _knots(surface.UKnots(), surface.UMultiplicities()),
            _knots(surface.VKnots(), surface.VMultiplicities()),
        ),
        closed,
    )


def _knots(values: Any, multiplicities: Any) -> Knots:
    numbers = range(values.Lower(), values.Upper() + 1)
    return tuple(values.Value(i) for i in numbers), tuple(multiplicities.Value(i) for i in numbers)


def _placed(kind: str, sizes: Callable[[Any], tuple[float, ...]]) -> Callable[[Any], Placed]:
    """Reader of what has a frame, and sizes."""

    def read(geometry: Any) -> Placed:
        frame = geometry.Position()
        # A conic's frame is always right-handed, and has no word for it.
        left_handed = hasattr(frame, "Direct") and not frame.Direct()
        origin, axis, along = (_triple(part) for part in (frame.Location(), frame.Direction(), frame.XDirection()))
        return Placed(kind, origin, axis, along, sizes(geometry), left_handed)

    return read


def _cone(surface: Geom_ConicalSurface) -> Placed:
    cone = _placed("CONICAL_SURFACE", lambda c: (c.RefRadius(), c.SemiAngle()))(surface)
    radius, angle = cone.sizes
    if angle > 0:
        return cone
    # The entity opens along its axis.
    x, y, z = cone.axis
    return replace(cone, axis=(-x, -y, -z), sizes=(radius, -angle))


def _torus(surface: Geom_ToroidalSurface) -> Placed:
    if surface.MinorRadius() >= surface.MajorRadius():
        raise UnknownGeometryError("a torus that meets itself")
    return _placed("TOROIDAL_SURFACE", lambda t: (t.MajorRadius(), t.MinorRadius()))(surface)


def _line(line: Geom_Line) -> Line:
    axis = line.Position()
    return Line(_triple(axis.Location()), _triple(axis.Direction()))


def _extrusion(surface: Geom_SurfaceOfLinearExtrusion) -> SweptSurface:
    return SweptSurface(_swept_curve(surface), _triple(surface.Direction()))


def _revolution(surface: Geom_SurfaceOfRevolution) -> SweptSurface:
    axis = surface.Axis()
    return SweptSurface(_swept_curve(surface), _triple(axis.Direction()), _triple(axis.Location()))


def _swept_curve(surface: Any) -> Any:
    return read_geometry(surface.BasisCurve())


def _basis(geometry: Any) -> Geometry:
    """Read what a trimmed curve or surface was trimmed from: edges and vertices bound it anyway."""
    part = geometry.BasisCurve() if isinstance(geometry, Geom_TrimmedCurve) else geometry.BasisSurface()
    return read_geometry(part)


def _triple(part: gp_Pnt | gp_Dir) -> Triple:
    return part.X(), part.Y(), part.Z()


def parameter_curve(
    edge: TopoDS_Edge, face: TopoDS_Face, surface: Geometry, curve: Geometry
) -> Spline | ParameterLine | None:
    """Read an edge's curve in a face's parameters, with the parameter that its curve in space has in the file.

    Parameters
    ----------
    edge : TopoDS_Edge
        Oriented as the face uses it: a seam has two such curves.
    face : TopoDS_Face
    surface, curve : Spline, Placed, Line or SweptSurface
        What is written of the face and of the edge.

    Returns
    -------
    Spline or ParameterLine or None
        None where readers are left to project: on planes, on cones and swept surfaces, whose parameters are others in
        the file, and where the curve is neither a straight line nor a spline.
    """
    same = isinstance(surface, Spline) or (
        isinstance(surface, Placed) and surface.kind in _SAME_PARAMETERS and not surface.left_handed
    )
    found = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) if same else None
    while isinstance(found, Geom2d_TrimmedCurve):
        found = found.BasisCurve()
    # Splines in space count their knots from 0, where these are evenly spaced.
    start, step = counting(curve.knots[0][0]) if isinstance(curve, Spline) else (0.0, 1.0)
    return _counted(found, start, step)


def _counted(found: Geom2d_Curve | None, start: float, step: float) -> Spline | ParameterLine | None:
    if isinstance(found, Geom2d_Line):
        place, way = found.Location(), found.Direction()
        u, v, du, dv = place.X(), place.Y(), way.X(), way.Y()
        return ParameterLine((u + start * du, v + start * dv), (du, dv), step)
    if isinstance(found, Geom2d_BSplineCurve) and not found.IsPeriodic():
        spline = _parameter_spline(found)
        ((values, counts),) = spline.knots
        return replace(spline, knots=((tuple(((np.array(values) - start) / step).tolist()), counts),))
    return None


def _parameter_spline(curve: Geom2d_BSplineCurve) -> Spline:
    count = curve.NbPoles()
    poles = [(pole.X(), pole.Y()) for pole in (curve.Pole(i) for i in range(1, count + 1))]
    weights = np.array([curve.Weight(i) for i in range(1, count + 1)]) if curve.IsRational() else None
    knots = _knots(curve.Knots(), curve.Multiplicities())
    return Spline((curve.Degree(),), np.array(poles), weights, (knots,), (False,))


_READERS: dict[type, Callable[[Any], Geometry]] = {
    Geom_BSplineCurve: _spline_curve,
    Geom_BSplineSurface: _spline_surface,
    Geom_BezierCurve: lambda curve: _spline_curve(GeomConvert.CurveToBSplineCurve_s(curve)),
    Geom_BezierSurface: lambda surface: _spline_surface(GeomConvert.SurfaceToBSplineSurface_s(surface)),
    Geom_Line: _line,
    Geom_Circle: _placed("CIRCLE", lambda c: (c.Radius(),)),
    Geom_Ellipse: _placed("ELLIPSE", lambda c: (c.MajorRadius(), c.MinorRadius())),
    Geom_Hyperbola: _placed("HYPERBOLA", lambda c: (c.MajorRadius(), c.MinorRadius())),
    Geom_Parabola: _placed("PARABOLA", lambda c: (c.Focal(),)),
    Geom_Plane: _placed("PLANE", lambda _: ()),
    Geom_CylindricalSurface: _placed("CYLINDRICAL_SURFACE", lambda s: (s.Radius(),)),
    Geom_SphericalSurface: _placed("SPHERICAL_SURFACE", lambda s: (s.Radius(),)),
    Geom_ConicalSurface: _cone,
    Geom_ToroidalSurface: _torus,
    Geom_SurfaceOfLinearExtrusion: _extrusion,
    Geom_SurfaceOfRevolution: _revolution,
    Geom_TrimmedCurve: _basis,
    Geom_RectangularTrimmedSurface: _basis,
}

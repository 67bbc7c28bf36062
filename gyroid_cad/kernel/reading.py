"""A CAD shape as it is: measured, checked, and turned into triangles to be looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineSurface
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.kernel.apart import read_shape
from gyroid_cad.kernel.check import is_valid, measure, parts_of, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.stl import diagonal, meshed_by_face
from gyroid_cad.step.counts import Topology

__all__ = ["Described", "described", "lattice_sides", "read_shape", "shown_triangles"]

Floats = NDArray[np.float64]

# Of triangles to look at, in parts of the diagonal; and between them, in degrees.
_SHOWN_DEVIATION = 5e-4
_SHOWN_ANGLE = 20.0
# Of triangles of however small a shape, in mm.
_FINEST = 1e-6
# Of what is read from files that were written with so many digits.
_PARAMETER_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class Described:
    """Measures of a shape, as the kernel finds them.

    Attributes
    ----------
    topology : Topology
    valid : bool
        By the kernel's own check.
    low, high : tuple of float
        Corners of the bounding box, in mm.
    volume, area : float
        In mm3 and mm2, as the kernel integrates them; the volume is of no meaning where the shape is not closed.
    """

    topology: Topology
    valid: bool
    low: tuple[float, ...]
    high: tuple[float, ...]
    volume: float
    area: float


def described(shape: TopoDS_Shape) -> Described:
    """Measure and check a shape, whatever it is."""
    low, high = bounding_box(shape).tolist()
    volume, area = measure(shape)
    return Described(topology(shape), is_valid(shape), tuple(low), tuple(high), volume, area)


def shown_triangles(
    shape: TopoDS_Shape, extent: float | None = None
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles to look at: vertices, their numbers, and faces, as of :func:`gyroid_cad.kernel.stl.meshed_by_face`.

    Parameters
    ----------
    shape : TopoDS_Shape
    extent : float, optional
        Of all that is looked at, in mm; the shape's diagonal if left out.
    """
    deviation = _SHOWN_DEVIATION * (extent or diagonal(shape))
    return meshed_by_face(shape, "the picture", max(deviation, _FINEST), _SHOWN_ANGLE)


def lattice_sides(shape: TopoDS_Shape) -> list[int | None]:
    """The side of the wall that each face is a part of, as ``TopExp_Explorer`` counts faces: 0 or 1.

    None of those that are no part of a lattice's faces. These are told by their surfaces, cubic B-splines on the square
    from -1 to 1 both ways, which run along the wall's normals: on side 0 the face is turned against its surface.
    """
    return [_lattice_side(as_face(face)) for face in parts_of(shape, TopAbs_FACE)]


def _lattice_side(face: TopoDS_Face) -> int | None:
    surface = BRep_Tool.Surface_s(face, TopLoc_Location())
    if not isinstance(surface, Geom_BSplineSurface):
        return None
    cubic = (surface.UDegree(), surface.VDegree()) == (3, 3)
    if not cubic or not np.allclose(surface.Bounds(), (-1, 1, -1, 1), rtol=0, atol=_PARAMETER_TOLERANCE):
        return None
    return 0 if face.Orientation() == TopAbs_REVERSED else 1

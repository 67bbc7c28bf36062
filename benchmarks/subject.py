"""The lattice every benchmark builds (10 mm cells, a 0.8 mm wall, the 10 x 10 fit), and the kernel calls beside it."""

from __future__ import annotations

from collections.abc import Iterable

from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.kernel.solid import build_solid
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import Wall, build_wall

__all__ = ["CELL_SIZE", "THICKNESS", "block", "block_solid", "kernel_volume", "sewn", "translation"]

# In mm.
CELL_SIZE, THICKNESS = 10.0, 0.8
# Of sewing, in mm: well above the tolerance of the faces, well below any edge.
_SEWING_TOLERANCE = 1e-6


def block(cells: int) -> Wall:
    """The wall of a cube of ``cells`` cells a side."""
    return build_wall(build_complex((cells,) * 3), fit_patch(), CELL_SIZE, THICKNESS)


def block_solid(cells: int) -> TopoDS_Shape:
    """From the fitted patch to the closed solid of a cube of ``cells`` cells a side."""
    return build_solid(block(cells))


def kernel_volume(shape: TopoDS_Shape) -> float:
    """Volume in mm3 as ``BRepGProp`` has it with its default call."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def sewn(parts: Iterable[TopoDS_Shape]) -> TopoDS_Shape:
    """What the kernel's sewing makes of separate faces or shells."""
    sewing = BRepBuilderAPI_Sewing(_SEWING_TOLERANCE)
    for part in parts:
        sewing.Add(part)
    sewing.Perform()
    return sewing.SewedShape()


def translation(shift: Iterable[float]) -> TopLoc_Location:
    """A location that shifts by so many mm along x, y, z."""
    transformation = gp_Trsf()
    transformation.SetTranslation(gp_Vec(*shift))
    return TopLoc_Location(transformation)

"""Boxes round shapes: a quick one for searching, and the tightest one."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.TopoDS import TopoDS_Shape

__all__ = ["bounding_box", "box_round", "corners_of"]


def box_round(shapes: Iterable[TopoDS_Shape]) -> Bnd_Box:
    """Box round all of the shapes, a little larger than need be."""
    box = Bnd_Box()
    for shape in shapes:
        BRepBndLib.Add_s(shape, box)
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

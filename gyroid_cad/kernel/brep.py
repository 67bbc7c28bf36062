"""The kernel's own BREP format, exact and complete, through ``BRepTools``."""

from __future__ import annotations

import os

from OCP.BRepTools import BRepTools
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import ExportError
from gyroid_cad.files import replacing

__all__ = ["write_brep"]


def write_brep(shape: TopoDS_Shape, path: str | os.PathLike[str]) -> None:
    """Write a shape, in millimetres.

    Raises
    ------
    ExportError
    """
    with replacing(path) as temporary:
        if not BRepTools.Write_s(shape, str(temporary)):
            raise ExportError(f"{path} was not written: the kernel's BREP writer failed")

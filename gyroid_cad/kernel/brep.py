"""The kernel's own BREP format, exact and complete, through ``BRepTools``."""

from __future__ import annotations

import os

from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.files import replacing
from gyroid_cad.errors import ExportError

__all__ = ["read_brep", "write_brep"]

# Near the beginning of every BREP file.
_MARK, _HEADER_BYTES = b"CASCADE Topology", 200


def write_brep(shape: TopoDS_Shape, path: str | os.PathLike[str]) -> None:
    """Write a shape, in millimetres.

    Raises
    ------
    ExportError
    """
    with replacing(path) as temporary:
        if not BRepTools.Write_s(shape, str(temporary)):
            raise ExportError(f"{path} was not written: the kernel's BREP writer failed")


def read_brep(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read the shape of a BREP file.

    Raises
    ------
    ExportError
        If the file is missing or not BREP.
    """
    shape = TopoDS_Shape()
    try:
        with open(path, "rb") as file:
            known = _MARK in file.read(_HEADER_BYTES)
    except OSError as problem:
        raise ExportError(f"{path} could not be read as BREP: {problem.strerror or problem}") from problem
    # Of other files the kernel complains on the terminal.
    if not known or not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
        raise ExportError(f"{path} could not be read as BREP")
    return shape

"""A CAD file as it is: read without conditions, measured, checked, and turned into triangles to be looked at."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import Topology, is_valid, topology
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step
from gyroid_cad.kernel.stl import meshed

__all__ = ["Described", "described", "read_shape", "shown_triangles"]

Floats = NDArray[np.float64]

# Of triangles to look at, in parts of the largest extent; and between them, in degrees.
_SHOWN_DEVIATION = 1e-3
_SHOWN_ANGLE = 20.0
# What the first lines of a BREP file say, and how many bytes these take at most.
_BREP_MARK, _BREP_HEADER = b"CASCADE Topology V", 400


@dataclass(frozen=True, slots=True)
class Described:
    """What the kernel finds a shape to be.

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


def read_shape(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read a STEP or BREP file, by its ending, in millimetres.

    Raises
    ------
    ExportError
        If it cannot be read, or holds no shape.
    """
    if Path(path).suffix.lower() != ".brep":
        return read_step(path)
    shape = TopoDS_Shape()
    # Of text that is something else the kernel complains on standard output.
    try:
        with Path(path).open("rb") as file:
            known = _BREP_MARK in file.read(_BREP_HEADER)
    except OSError as problem:
        raise ExportError(f"{path} could not be read: {problem.strerror}") from None
    if not known or not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
        raise ExportError(f"{path} could not be read as BREP")
    return shape


def described(shape: TopoDS_Shape) -> Described:
    """Measure and check a shape, whatever it is."""
    low, high = bounding_box(shape).tolist()
    volume, area = measure(shape)
    return Described(topology(shape), is_valid(shape), tuple(low), tuple(high), volume, area)


def shown_triangles(shape: TopoDS_Shape, extent: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Triangles to look at: vertices and their numbers, as of :func:`gyroid_cad.kernel.stl.meshed`.

    Parameters
    ----------
    shape : TopoDS_Shape
    extent : float
        The largest, in mm.
    """
    return meshed(shape, "the picture", max(_SHOWN_DEVIATION * extent, 1e-6), _SHOWN_ANGLE)

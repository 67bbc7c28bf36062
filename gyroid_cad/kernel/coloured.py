"""Shapes of a STEP file with the colours they are to be shown in, through the kernel's document (XCAF)."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_AsciiString
from OCP.TDF import TDF_Label, TDF_Tool
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_ColorTool, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.apart import Contents, read_apart, require_cad_file
from gyroid_cad.kernel.assembly import new_document
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import LabelSequence, NumberedShapes
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.step import no_messages

__all__ = ["ColouredPart", "OwnColour", "coloured_contents", "coloured_parts", "diagonal_of"]

# Red, green and blue, 0 to 1, as a screen has them (sRGB); none where the file says nothing.
OwnColour = tuple[float, float, float] | None

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class ColouredPart:
    """A part of a STEP file, and where it is found.

    Attributes
    ----------
    shape : TopoDS_Shape
    colours : tuple of OwnColour
        Of its faces, as ``TopExp_Explorer`` counts them.
    places : ndarray, shape (k, 3, 4)
        Of each occurrence: rotation, and translation in mm in the last column.
    """

    shape: TopoDS_Shape
    colours: tuple[OwnColour, ...]
    places: Floats


def coloured_parts(path: str | os.PathLike[str]) -> list[ColouredPart]:
    """Parts of a STEP file, each once for every colour it occurs in.

    Parameters
    ----------
    path : path-like

    Raises
    ------
    ExportError
        If the file is missing, not STEP, or holds no shape.
    """
    require_cad_file(path)
    shapes, described = read_apart(path, coloured_contents)
    return [ColouredPart(shape, *rest) for shape, rest in zip(shapes, described, strict=True)]


def coloured_contents(path: str) -> Contents:
    """Read parts of a STEP file, with their colours and places, in this process."""
    document, reader = new_document(), STEPCAFControl_Reader()
    with no_messages():
        if reader.ReadFile(path) != IFSelect_RetDone or not reader.Transfer(document):
            raise ExportError(f"{path} could not be read as STEP")
    free = LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(free)
    found = _Occurrences(document)
    for label in _labels(free):
        found.add(label, TopLoc_Location(), None)
    if not found.places:
        raise ExportError(f"{path} holds no shape")
    parts = found.parts()
    return [part.shape for part in parts], [(part.colours, part.places) for part in parts]


def diagonal_of(parts: Sequence[ColouredPart]) -> float:
    """Diagonal of a box round all parts in all their places, in mm; a little larger than need be."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for part in parts:
        corners = np.array(list(product(*corners_of(box_round([part.shape])).T)))
        places = corners @ part.places[..., :3].swapaxes(-1, -2) + part.places[:, np.newaxis, :, 3]
        low, high = np.minimum(low, places.min(axis=(0, 1))), np.maximum(high, places.max(axis=(0, 1)))
    return float(np.linalg.norm(high - low))


class _Occurrences:
    """Places of parts, by the entries of their labels and the colours that their occurrences put over them."""

    def __init__(self, document: TDocStd_Document) -> None:
        self._colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self._labels: dict[str, TDF_Label] = {}
        self.places: dict[tuple[str, OwnColour], list[Floats]] = {}

    def add(self, label: TDF_Label, location: TopLoc_Location, over: OwnColour) -> None:
        """Add what a label holds, moved; a colour of the occurrence goes before that of the part."""
        if XCAFDoc_ShapeTool.IsReference_s(label):
            part = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(label, part)
            own = XCAFDoc_ShapeTool.GetLocation_s(label)
            self.add(part, location.Multiplied(own), over or self._colour(label))
        elif XCAFDoc_ShapeTool.IsAssembly_s(label):
            components = LabelSequence()
            XCAFDoc_ShapeTool.GetComponents_s(label, components)
            for component in _labels(components):
                self.add(component, location, over)
        else:
            entry = TCollection_AsciiString()
            TDF_Tool.Entry_s(label, entry)
            self._labels[entry.ToCString()] = label
            self.places.setdefault((entry.ToCString(), over), []).append(_matrix(location))

    def parts(self) -> list[ColouredPart]:
        """Every part in the places found."""
        return [
            ColouredPart(
                shape := XCAFDoc_ShapeTool.GetShape_s(self._labels[entry]),
                tuple(over or colour for colour in self._face_colours(self._labels[entry], shape)),
                np.array(places),
            )
            for (entry, over), places in self.places.items()
        ]

    def _face_colours(self, label: TDF_Label, shape: TopoDS_Shape) -> Iterator[OwnColour]:
        subshapes, numbered = LabelSequence(), NumberedShapes()
        XCAFDoc_ShapeTool.GetSubShapes_s(label, subshapes)
        own = {numbered.Add(XCAFDoc_ShapeTool.GetShape_s(one)): self._colour(one) for one in _labels(subshapes)}
        whole = self._colour(label)
        # A shape that the map does not hold has number 0.
        return (own.get(numbered.FindIndex(face)) or whole for face in parts_of(shape, TopAbs_FACE))

    def _colour(self, label: TDF_Label) -> OwnColour:
        colour = Quantity_Color()
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
            if XCAFDoc_ColorTool.GetColor_s(label, kind, colour):
                linear = (colour.Red(), colour.Green(), colour.Blue())
                red, green, blue = map(Quantity_Color.Convert_LinearRGB_To_sRGB_s, linear)
                return red, green, blue
        return None


def _matrix(location: TopLoc_Location) -> Floats:
    placement = location.Transformation()
    return np.array([[placement.Value(row, column) for column in range(1, 5)] for row in range(1, 4)])


def _labels(sequence: LabelSequence) -> Iterator[TDF_Label]:
    return (sequence.Value(number) for number in range(1, sequence.Length() + 1))

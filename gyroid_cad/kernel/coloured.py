"""Shapes of a STEP file with the colours they are to be shown in, through the kernel's document (XCAF)."""

from __future__ import annotations

import os
from collections.abc import Iterator

from OCP.BRep import BRep_Builder
from OCP.IFSelect import IFSelect_RetDone
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Shape
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_ColorTool, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.assembly import new_document
from gyroid_cad.kernel.compat import LabelSequence, NumberedShapes
from gyroid_cad.kernel.step import no_messages

__all__ = ["Colour", "coloured_shapes"]

# Red, green and blue, 0 to 1, as a screen has them (sRGB); none where the file says nothing.
Colour = tuple[float, float, float] | None
Coloured = tuple[TopoDS_Shape, Colour]


def coloured_shapes(path: str | os.PathLike[str]) -> list[Coloured]:
    """All shapes of a STEP file in their places, each of one colour: a part of several is taken apart by its faces.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    list of (TopoDS_Shape, Colour)
        Occurrences of a part share its geometry and, once one of them is meshed, its triangles.

    Raises
    ------
    ExportError
        If the file is missing, not STEP, or holds no shape.
    """
    document, reader = new_document(), STEPCAFControl_Reader()
    with no_messages():
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
            raise ExportError(f"{path} could not be read as STEP")
    free = LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(free)
    found = _Parts(document)
    shapes = [one for label in _labels(free) for one in found.placed(label, TopLoc_Location(), None)]
    if not shapes:
        raise ExportError(f"{path} holds no shape")
    return shapes


class _Parts:
    """Parts taken apart so far, by the entry of their label, each once however often it occurs."""

    def __init__(self, document: TDocStd_Document) -> None:
        self._colours = XCAFDoc_DocumentTool.ColorTool_s(document.Main())
        self._parts: dict[int, list[Coloured]] = {}

    def placed(self, label: TDF_Label, location: TopLoc_Location, over: Colour) -> Iterator[Coloured]:
        """Shapes of a label, moved; a colour of the occurrence goes before that of the part."""
        if XCAFDoc_ShapeTool.IsReference_s(label):
            part = TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(label, part)
            own = XCAFDoc_ShapeTool.GetLocation_s(label)
            yield from self.placed(part, location.Multiplied(own), over or self._colour(label))
        elif XCAFDoc_ShapeTool.IsAssembly_s(label):
            components = LabelSequence()
            XCAFDoc_ShapeTool.GetComponents_s(label, components)
            for component in _labels(components):
                yield from self.placed(component, location, over)
        elif over is not None:
            yield XCAFDoc_ShapeTool.GetShape_s(label).Moved(location), over
        else:
            for shape, colour in self._taken_apart(label):
                yield shape.Moved(location), colour

    def _taken_apart(self, label: TDF_Label) -> list[Coloured]:
        shape, whole = XCAFDoc_ShapeTool.GetShape_s(label), self._colour(label)
        key = shape.TShape().__hash__()
        if key not in self._parts:
            coloured = self._coloured_faces(label)
            self._parts[key] = _by_colour(shape, whole, coloured) if coloured else [(shape, whole)]
        return self._parts[key]

    def _coloured_faces(self, label: TDF_Label) -> list[Coloured]:
        subshapes = LabelSequence()
        XCAFDoc_ShapeTool.GetSubShapes_s(label, subshapes)
        every = [(XCAFDoc_ShapeTool.GetShape_s(one), self._colour(one)) for one in _labels(subshapes)]
        return [(shape, colour) for shape, colour in every if colour and shape.ShapeType() == TopAbs_FACE]

    def _colour(self, label: TDF_Label) -> Colour:
        colour = Quantity_Color()
        for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
            if XCAFDoc_ColorTool.GetColor_s(label, kind, colour):
                linear = (colour.Red(), colour.Green(), colour.Blue())
                red, green, blue = map(Quantity_Color.Convert_LinearRGB_To_sRGB_s, linear)
                return red, green, blue
        return None


def _by_colour(shape: TopoDS_Shape, whole: Colour, coloured: list[Coloured]) -> list[Coloured]:
    """The faces of a shape, those of one colour together."""
    faces = NumberedShapes()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    colours = dict.fromkeys(range(1, faces.Extent() + 1), whole)
    colours |= {faces.FindIndex(face): colour for face, colour in coloured if faces.Contains(face)}
    builder = BRep_Builder()
    compounds: dict[Colour, TopoDS_Compound] = {}
    for number, colour in colours.items():
        if colour not in compounds:
            compounds[colour] = TopoDS_Compound()
            builder.MakeCompound(compounds[colour])
        builder.Add(compounds[colour], faces.FindKey(number))
    return [(compound, colour) for colour, compound in compounds.items()]


def _labels(sequence: LabelSequence) -> Iterator[TDF_Label]:
    return (sequence.Value(number) for number in range(1, sequence.Length() + 1))

"""Assemblies of STEP files: written with names and colours, and read through the kernel's document (XCAF)."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.StepRepr import StepRepr_RepresentationItem
from OCP.StepShape import StepShape_AdvancedFace
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from gyroid_cad.common.arrays import Point
from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import LabelSequence
from gyroid_cad.kernel.step import reading_step, write_parts
from gyroid_cad.kernel.step_solids import read_step_bodies
from gyroid_cad.step.header import StepHeader, product_name
from gyroid_cad.step.products import Occurrence, StepPart
from gyroid_cad.wall.areas import ShapeSize, joint_size

__all__ = [
    "GREEN",
    "RED",
    "YELLOW",
    "NamedFace",
    "NamedPart",
    "new_document",
    "read_bodies",
    "read_bodies_and_faces",
    "write_assembly",
]

# Of those that STEP knows by name (draughting_pre_defined_colour), so that no reader rounds them.
YELLOW, RED, GREEN = "yellow", "red", "green"

# What the kernel's writer calls a product that has no name; its occurrences it then numbers.
_NAMELESS = "Open CASCADE STEP translator"
# A face with a name; and what some programs write where there is none (a string, where it is no reference).
_NAMED_FACE, _UNNAMED = re.compile(rb"ADVANCED_FACE\s*\(\s*'\s*[^'\s]"), "NONE"
# At 40 ns each.
_MOST_LOOKED_AT = 200_000_000
# Of the document's unit of length, in metres: lengths are in mm.
_MILLIMETRE = 1e-3
_BINARY_DOCUMENT = "BinXCAF"
# Of a copy that is only shifted: z and x.
_AXES = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0))

Place = tuple[str, tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class NamedFace:
    """A face of a part, with its name and colour."""

    face: TopoDS_Face
    name: str
    colour: str


@dataclass(frozen=True, slots=True)
class NamedPart:
    """A part that an assembly has many of.

    Attributes
    ----------
    shape : TopoDS_Shape
    name : str
    colour : str
        Of the whole.
    faces : list of NamedFace
        All of them, as the kernel counts them.
    size : ShapeSize
    """

    shape: TopoDS_Shape
    name: str
    colour: str
    faces: list[NamedFace]
    size: ShapeSize


def write_assembly(
    part: NamedPart,
    places: Iterable[Place],
    path: str | os.PathLike[str],
    header: StepHeader,
    name: str | None = None,
) -> None:
    """Write a part once, and where it is to be found, in millimetres.

    Parameters
    ----------
    part : NamedPart
    places : iterable of (str, tuple of float)
        Name and translation in mm of each of its occurrences.
    path : path-like
        Written under a temporary name and moved into place.
    header : StepHeader
    name : str, optional
        Of the assembly; the file's stem if left out.

    Raises
    ------
    ExportError
    """
    product = product_name(path, name)
    names, colours = [named.name for named in part.faces], [named.colour for named in part.faces]
    written = StepPart(
        part.name,
        read_step_bodies(part.shape, header.pcurves),
        part.colour,
        face_names=names,
        face_colours=colours,
        size=part.size,
    )
    occurrences = [Occurrence(0, called, (place, *_AXES)) for called, place in places]
    whole = joint_size([_shifted(part.size, one.frame[0]) for one in occurrences])
    write_parts(part.shape, path, header, product, [written], occurrences, whole)


def _shifted(size: ShapeSize, shift: Point) -> ShapeSize:
    if size.centroid is None:
        return size
    (x, y, z), (dx, dy, dz) = size.centroid, shift
    return replace(size, centroid=(x + dx, y + dy, z + dz))


def new_document() -> TDocStd_Document:
    """An empty document of the kernel's, with lengths in mm."""
    document = TDocStd_Document(TCollection_ExtendedString(_BINARY_DOCUMENT))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    XCAFDoc_DocumentTool.SetLengthUnit_s(document, _MILLIMETRE)
    return document


def read_bodies(path: str | os.PathLike[str]) -> tuple[list[TopoDS_Shape], list[list[str]]]:
    """Read the bodies of a STEP file and their names, as :func:`read_bodies_and_faces` does."""
    return read_bodies_and_faces(path)[:2]


def read_bodies_and_faces(
    path: str | os.PathLike[str],
) -> tuple[list[TopoDS_Shape], list[list[str]], list[list[str]]]:
    """Read the bodies of a STEP file, each where its assembly has it, in millimetres.

    Returns
    -------
    shapes : list of TopoDS_Shape
        The solids; of a product that has none, its faces.
    names : list of list of str
        Of each: that of the occurrence in its assembly, of its product, and its own if the product has several.
    face_names : list of list of str
        Of the faces of each, as the kernel counts them, "" of those that have none; nothing if no face has one.

    Raises
    ------
    ExportError
        If the file is missing, not STEP, or holds no shape.
    """
    with reading_step():
        reader, document = STEPCAFControl_Reader(), new_document()
        if reader.ReadFile(str(path)) != IFSelect_RetDone or not reader.Transfer(document):
            raise ExportError(f"{path} could not be read as STEP")
    roots = LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(roots)
    own_names, faces = reader.ChangeReader().WS().TransferReader(), _NamedFaces(path, reader)
    shapes, names, face_names = [], [], []
    for label, place, called in _leaves(roots, TopLoc_Location()):
        shape = XCAFDoc_ShapeTool.GetShape_s(label)
        solids = list(parts_of(shape, TopAbs_SOLID))
        for solid in solids or [shape]:
            entity = own_names.EntityFromShapeResult(solid, 1) if len(solids) > 1 else None
            own = entity.Name().ToCString() if isinstance(entity, StepRepr_RepresentationItem) else ""
            shapes.append(solid.Moved(place))
            names.append([name for name in dict.fromkeys([*called, own]) if name])
            face_names.append(faces.of(solid))
    if not shapes:
        raise ExportError(f"{path} holds no shape")
    return shapes, names, face_names


class _NamedFaces:
    """Faces to which a STEP file gives names, as its reader made them.

    Parameters
    ----------
    path : path-like
    reader : STEPCAFControl_Reader
        Of which all has been transferred.
    """

    def __init__(self, path: str | os.PathLike[str], reader: STEPCAFControl_Reader) -> None:
        session = reader.ChangeReader().WS()
        self._transferred, self._entities = session.TransferReader(), int(session.Model().NbEntities())
        # Of most files no face needs to be looked at.
        self._some = bool(_NAMED_FACE.search(Path(path).read_bytes()))

    def of(self, shape: TopoDS_Shape) -> list[str]:
        """Names of the faces of a shape that was read, as the kernel counts them; nothing where none has one."""
        faces = list(parts_of(shape, TopAbs_FACE)) if self._some else []
        # For each face the kernel goes through all entities.
        if len(faces) * self._entities > _MOST_LOOKED_AT:
            return []
        found = (self._transferred.EntityFromShapeResult(face, 1) for face in faces)
        names = [one.Name().ToCString().strip() if isinstance(one, StepShape_AdvancedFace) else "" for one in found]
        return ["" if name == _UNNAMED else name for name in names]


def _leaves(labels: LabelSequence, place: TopLoc_Location) -> Iterator[tuple[TDF_Label, TopLoc_Location, list[str]]]:
    """The products of assemblies that are none themselves, each with its place, and the occurrence's name and its."""
    for number in range(1, labels.Length() + 1):
        label, at, product, parts = labels.Value(number), place, labels.Value(number), LabelSequence()
        if XCAFDoc_ShapeTool.IsReference_s(label):
            at, product = place.Multiplied(XCAFDoc_ShapeTool.GetLocation_s(label)), TDF_Label()
            XCAFDoc_ShapeTool.GetReferredShape_s(label, product)
        if XCAFDoc_ShapeTool.GetComponents_s(product, parts):
            yield from _leaves(parts, at)
        else:
            names = [_named(label), _named(product)]
            yield product, at, [] if names[1].startswith(_NAMELESS) else names


def _named(label: TDF_Label) -> str:
    name = TDataStd_Name()
    return str(name.Get().ToExtString()) if label.FindAttribute(TDataStd_Name.GetID_s(), name) else ""

"""STEP files (ISO 10303-21): written, counted in their own text, and read by the kernel."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from types import MappingProxyType

from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.StepBasic import StepBasic_Product
from OCP.STEPCAFControl import STEPCAFControl_Writer
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.TCollection import TCollection_HAsciiString
from OCP.TopAbs import TopAbs_FACE, TopAbs_FORWARD, TopAbs_ShapeEnum, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.formats import require_schema
from gyroid_cad.common.packed import replacing_step
from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import parts_of, topology
from gyroid_cad.kernel.compat import NumberedShapes
from gyroid_cad.kernel.step_geometry import UnknownGeometryError
from gyroid_cad.kernel.step_solids import products_of
from gyroid_cad.step.counts import Topology, require_counts
from gyroid_cad.step.header import DESCRIPTION, PROGRAM, StepHeader, product_name, time_stamp
from gyroid_cad.step.products import UNLABELLED, BodyLabels, Occurrence, StepPart, write_products
from gyroid_cad.step.text import escaped
from gyroid_cad.wall.areas import ShapeSize, joint_size

__all__ = [
    "no_messages",
    "read_step",
    "reading_step",
    "write_parts",
    "write_step",
]


def _require_whole(path: str | os.PathLike[str], written: Path, shape: TopoDS_Shape) -> None:
    wanted = topology(shape)
    solids, faces = (_counted_once(shape, kind) for kind in (TopAbs_SOLID, TopAbs_FACE))
    require_counts(path, written, wanted, Topology(solids, faces, wanted.open_edges))


def _counted_once(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> int:
    """Count the parts of a kind, those that differ by their places only as one."""
    parts = NumberedShapes()
    for part in parts_of(shape, kind):
        parts.Add(part.Located(TopLoc_Location()).Oriented(TopAbs_FORWARD))
    return int(parts.Extent())


# A host that wrote a file in inches leaves the kernel taking all lengths of shapes for inches.
_OF_LENGTHS: Mapping[str, str | int] = MappingProxyType({"xstep.cascade.unit": "MM"})
_PLAIN = StepHeader()


def write_step(
    shape: TopoDS_Shape,
    path: str | os.PathLike[str],
    header: StepHeader = _PLAIN,
    name: str | None = None,
    sizes: Sequence[ShapeSize] = (),
    labels: BodyLabels = UNLABELLED,
) -> None:
    """Write a shape in millimetres.

    Solids or shells of known geometry are written from arrays, with what faces and edges have in common once, and
    without curves in the parameter plane unless the header asks for them: an edge of ours lies on both its surfaces to
    within its tolerance, so that readers find those curves again, and files are over a quarter smaller. Of anything
    else, such as an offset surface, a loose face or a mirrored copy, the kernel's own writer makes the file, with these
    curves.

    Parameters
    ----------
    shape : TopoDS_Shape
    path : path-like
        Written under a temporary name and moved into place.
    header : StepHeader
    name : str, optional
        Of the product; the file's stem if left out.
    sizes : sequence of ShapeSize
        For receivers to compare what they find with, one a body as the kernel counts them, or none; where the kernel's
        writer is asked, they are left out.
    labels : BodyLabels
        Likewise.

    Raises
    ------
    ExportError
    """
    product = product_name(path, name)
    try:
        parts, places = products_of(shape, product, labels, sizes, header.pcurves, header.products)
    except UnknownGeometryError:
        _write_by_kernel(shape, path, header, escaped(product))
    else:
        write_parts(shape, path, header, product, parts, places, joint_size(sizes) if sizes else None)


def write_parts(
    shape: TopoDS_Shape,
    path: str | os.PathLike[str],
    header: StepHeader,
    product: str,
    parts: Sequence[StepPart],
    places: Sequence[Occurrence] = (),
    size: ShapeSize | None = None,
) -> None:
    """Write parts that were read from a shape, and look whether the file holds it all.

    Parameters
    ----------
    shape : TopoDS_Shape
    path : path-like
        Written under a temporary name and moved into place.
    header : StepHeader
    product : str
        Name of the whole.
    parts : sequence of StepPart
    places : sequence of Occurrence
        None, if there is one part.
    size : ShapeSize, optional
        Of all of it.

    Raises
    ------
    ExportError
    """
    with replacing_step(path) as temporary:
        write_products(temporary, product, parts, places, header, size)
        _require_whole(path, temporary, shape)


def _write_by_kernel(shape: TopoDS_Shape, path: str | os.PathLike[str], header: StepHeader, product: str) -> None:
    """Write with the kernel's own writer, whose settings are global to the process, and count as it makes its model."""
    settings: dict[str, str | int] = {
        "write.step.schema": require_schema(header.schema),
        "write.step.unit": "MM",
        **_OF_LENGTHS,
        "write.step.product.name": product,
        "write.surfacecurve.mode": 1,
    }
    with replacing_step(path) as temporary:
        with no_messages(), _kernel_settings(settings):
            writer = STEPControl_Writer()
            if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
                raise ExportError(f"{path} was not written: the kernel could not translate the shape to STEP")
            _fill_header(writer, product, header)
            _name_product(writer, product)
            if writer.Write(str(temporary)) != IFSelect_RetDone:
                raise ExportError(f"{path} was not written: the kernel's STEP writer failed")
        _require_whole(path, temporary, shape)


def read_step(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read the shape of a STEP file, in millimetres.

    Raises
    ------
    ExportError
        If the file is missing, not STEP, or holds no shape.
    """
    with reading_step():
        reader = STEPControl_Reader()
        if reader.ReadFile(str(path)) != IFSelect_RetDone:
            raise ExportError(f"{path} could not be read as STEP")
        reader.TransferRoots()
        shape = reader.OneShape()
    if shape.IsNull():
        raise ExportError(f"{path} holds no shape")
    return shape


@contextmanager
def reading_step() -> Iterator[None]:
    """Have the kernel read lengths in millimetres, and say nothing."""
    # The first reader of a process registers the settings.
    STEPControl_Reader()
    with no_messages(), _kernel_settings(_OF_LENGTHS):
        yield


def _fill_header(writer: STEPControl_Writer, product: str, given: StepHeader) -> None:
    """Say what the file is, by whom, and of when."""
    header = APIHeaderSection_MakeHeader(writer.Model())
    text = TCollection_HAsciiString
    header.SetName(text(product))
    header.SetAuthorValue(1, text(escaped(given.author)))
    header.SetOrganizationValue(1, text(escaped(given.organisation)))
    header.SetDescriptionValue(1, text(DESCRIPTION))
    header.SetOriginatingSystem(text(PROGRAM))
    header.SetAuthorisation(text(""))
    header.SetTimeStamp(text(time_stamp()))


def _name_product(writer: STEPControl_Writer, product: str) -> None:
    """Take the running number off the product's name, which would make every file of a process another."""
    model = writer.Model()
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepBasic_Product):
            entity.SetId(TCollection_HAsciiString(product))
            entity.SetName(TCollection_HAsciiString(product))
            return


@contextmanager
def _kernel_settings(settings: Mapping[str, str | int]) -> Iterator[None]:
    """Set ``Interface_Static`` values, which are global to the process, and put the old ones back."""
    # The first writer of a process registers the settings; the schema counts when a model is made.
    STEPCAFControl_Writer()
    before: dict[str, str | int] = {}
    try:
        for key, value in settings.items():
            if isinstance(value, int):
                before[key] = Interface_Static.IVal_s(key)
                Interface_Static.SetIVal_s(key, value)
            else:
                before[key] = Interface_Static.CVal_s(key)
                Interface_Static.SetCVal_s(key, value)
        yield
    finally:
        for key, value in before.items():
            if isinstance(value, int):
                Interface_Static.SetIVal_s(key, value)
            else:
                Interface_Static.SetCVal_s(key, value)


@contextmanager
def no_messages() -> Iterator[None]:
    """Take the kernel's turn, and keep all that it says to itself: what is wrong with a file is ours to tell.

    It speaks on standard output, where JSON may be expected. Its messengers and settings are the process's own: of the
    threads that want to read or write one does at a time.
    """
    messenger = Message.DefaultMessenger_s()
    with _turn:
        printers = list(messenger.Printers())
        try:
            for printer in printers:
                messenger.RemovePrinter(printer)
            yield
        finally:
            for printer in printers:
                messenger.AddPrinter(printer)


_turn = RLock()
if hasattr(os, "register_at_fork"):
    # A process that is forked while another thread writes would wait for its turn for ever.
    os.register_at_fork(before=_turn.acquire, after_in_parent=_turn.release, after_in_child=_turn.release)

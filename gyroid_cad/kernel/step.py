"""STEP files (ISO 10303-21) through ``STEPControl_Writer`` and ``STEPControl_Reader``."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from threading import RLock
from types import MappingProxyType
from typing import TextIO

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

from gyroid_cad.common.choices import Schema
from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import require_schema
from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import Topology, parts_of, topology
from gyroid_cad.kernel.compat import NumberedShapes
from gyroid_cad.kernel.step_geometry import UnknownGeometryError
from gyroid_cad.kernel.step_products import Occurrence, StepPart, products_of, time_stamp, write_products
from gyroid_cad.version import __version__

__all__ = [
    "compact_step",
    "fill_header",
    "no_messages",
    "product_name",
    "read_step",
    "reading_step",
    "step_of_kernel",
    "topology_in_step",
    "write_step",
]

# 5e-11 of a coordinate, under 1e-8 mm for parts below 200 mm: a tenth of the kernel's tolerance.
_SIGNIFICANT_DIGITS = 10
# Coordinates are rounding noise about 0 below this, in mm.
_NOISE_DECIMALS = 12

_POINT = re.compile(r"#(\d+) = CARTESIAN_POINT\('',\(([^()]*)\)\s*\);")
_REFERENCE = re.compile(r"#(\d+)")
_SPLINE = "B_SPLINE_"
_KIND = re.compile(r"#\d+\s*=\s*(\w+)\s*\(")
_USE = re.compile(r"#\d+\s*=\s*ORIENTED_EDGE\s*\('[^']*',\s*\*,\s*\*,\s*#(\d+)")
_COUNTED = ("MANIFOLD_SOLID_BREP", "BREP_WITH_VOIDS", "ADVANCED_FACE", "FACE_SURFACE")


def compact_step(source: Path, target: Path) -> None:
    """Rewrite a STEP file of the kernel's writer.

    Parameters
    ----------
    source : Path
        As ``STEPControl_Writer`` left it.
    target : Path
        Another file.
    """
    points = _Points(source)
    with source.open(encoding="utf-8") as lines, target.open("w", encoding="utf-8", newline="\n") as out:
        out.writelines(_rewritten(entity, points) for entity in _entities(lines))


def topology_in_step(path: str | os.PathLike[str]) -> Topology:
    """Count the solids, faces and edges that are not used twice in the text of a STEP file, whoever wrote it.

    No kernel is asked, so that what its writer left out is seen. A face is an ``ADVANCED_FACE`` (ISO 10303-511),
    and an edge is used by each ``ORIENTED_EDGE`` that names it.
    """
    counts = dict.fromkeys(_COUNTED, 0)
    uses: dict[str, int] = {}
    with open(path, encoding="utf-8", errors="replace") as lines:
        for entity in _entities(lines):
            if use := _USE.match(entity):
                uses[use[1]] = uses.get(use[1], 0) + 1
            elif (kind := _KIND.match(entity)) and kind[1] in counts:
                counts[kind[1]] += 1
    return Topology(
        solids=counts["MANIFOLD_SOLID_BREP"] + counts["BREP_WITH_VOIDS"],
        faces=counts["ADVANCED_FACE"] + counts["FACE_SURFACE"],
        open_edges=sum(count != 2 for count in uses.values()),
    )


def _require_whole(path: str | os.PathLike[str], written: Path, shape: TopoDS_Shape) -> None:
    """Refuse a file that does not hold all of a shape, or not as closed."""
    wanted, found = topology(shape), topology_in_step(written)
    # Copies of one solid are written once, with the places where they stand.
    solids, faces = (_counted_once(shape, kind) for kind in (TopAbs_SOLID, TopAbs_FACE))
    whole = solids <= found.solids <= wanted.solids and faces <= found.faces <= wanted.faces
    if not whole or found.open_edges > wanted.open_edges:
        raise ExportError(
            f"{path} was not written: the kernel's STEP writer gave {found.solids} of {wanted.solids} solids, "
            f"{found.faces} of {wanted.faces} faces and {found.open_edges} open edges; BREP holds the shape as it is"
        )


def _counted_once(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> int:
    """Count the parts of a kind, those that differ by their places only as one."""
    parts = NumberedShapes()
    for part in parts_of(shape, kind):
        parts.Add(part.Located(TopLoc_Location()).Oriented(TopAbs_FORWARD))
    return int(parts.Extent())


def _entities(lines: TextIO) -> Iterator[str]:
    """Whole entities, each with its folded lines."""
    pending = ""
    for line in lines:
        pending += line
        if line.endswith(";\n"):
            yield pending
            pending = ""
    yield pending


class _Points:
    """Points of a file, rounded.

    Attributes
    ----------
    texts : dict
        The coordinates of each point, by its id.
    shared : dict
        For each pole that repeats an earlier point, the earlier one's id.
    """

    def __init__(self, source: Path) -> None:
        self.texts: dict[str, str] = {}
        first: dict[str, str] = {}
        shared: dict[str, str] = {}
        used_elsewhere: set[str] = set()
        with source.open(encoding="utf-8") as lines:
            for entity in _entities(lines):
                if point := _POINT.match(entity):
                    number, rounded = point[1], _rounded(point[2])
                    original = first.setdefault(rounded, number)
                    if original == number:
                        self.texts[number] = rounded
                    else:
                        # One string for all that are alike.
                        self.texts[number] = self.texts[original]
                        shared[number] = original
                elif _SPLINE not in entity:
                    used_elsewhere.update(_REFERENCE.findall(entity))
        self.shared = {number: original for number, original in shared.items() if number not in used_elsewhere}


def _rewritten(entity: str, points: _Points) -> str:
    if point := _POINT.match(entity):
        number = point[1]
        return "" if number in points.shared else f"#{number}=CARTESIAN_POINT('',({points.texts[number]}));\n"
    if entity.startswith("#") and _SPLINE in entity:
        unfolded = "".join(part.strip() for part in entity.splitlines()).replace(" = ", "=", 1)
        return _REFERENCE.sub(lambda match: "#" + points.shared.get(match[1], match[1]), unfolded) + "\n"
    return entity


def _rounded(coordinates: str) -> str:
    return ",".join(map(_real, coordinates.split(",")))


def _real(text: str) -> str:
    """A number as ISO 10303-21 wants it: always with a point, an exponent in capitals."""
    number = f"{round(float(text), _NOISE_DECIMALS) + 0.0:.{_SIGNIFICANT_DIGITS}G}"
    if "." in number:
        return number
    mantissa, mark, exponent = number.partition("E")
    return f"{mantissa}.{mark}{exponent}"


# A host that wrote a file in inches leaves the kernel taking all lengths of shapes for inches.
_OF_LENGTHS: Mapping[str, str | int] = MappingProxyType({"xstep.cascade.unit": "MM"})


def write_step(
    shape: TopoDS_Shape,
    path: str | os.PathLike[str],
    schema: Schema = "ap214",
    name: str | None = None,
    parameter_curves: bool = False,
) -> None:
    """Write a shape in millimetres.

    Points that faces and edges have in common are written once.

    Parameters
    ----------
    shape : TopoDS_Shape
    path : path-like
        Written under a temporary name and moved into place.
    schema : {"ap214", "ap242"}
    name : str, optional
        Of the product; the file's stem if left out.
    parameter_curves : bool
        Whether to write curves in the parameter plane. Every edge of a lattice is a border line of its surface, which
        readers find again at once; where faces are cut they are needed.

    Raises
    ------
    ParameterError, ExportError
    """
    product = product_name(path, name)
    require_schema(schema)
    if not parameter_curves:
        try:
            write_parts(shape, path, schema, product, *products_of(shape, product))
            return
        except UnknownGeometryError:
            pass
    with step_of_kernel(shape, path, schema, product, parameter_curves) as raw:
        writer = STEPControl_Writer()
        if writer.Transfer(shape, STEPControl_AsIs) != IFSelect_RetDone:
            raise ExportError(f"{path} was not written: the kernel could not translate the shape to STEP")
        fill_header(writer, product)
        _name_product(writer, product)
        if writer.Write(str(raw)) != IFSelect_RetDone:
            raise ExportError(f"{path} was not written: the kernel's STEP writer failed")


def write_parts(
    shape: TopoDS_Shape,
    path: str | os.PathLike[str],
    schema: Schema,
    product: str,
    parts: Sequence[StepPart],
    places: Sequence[Occurrence] = (),
) -> None:
    """Write parts that were read from a shape, and look whether the file holds it all.

    Raises
    ------
    ExportError
    """
    with replacing(path) as temporary:
        write_products(temporary, product, parts, places, schema)
        _require_whole(path, temporary, shape)


@contextmanager
def step_of_kernel(
    shape: TopoDS_Shape, path: str | os.PathLike[str], schema: Schema, product: str, parameter_curves: bool = False
) -> Iterator[Path]:
    """Give a name for what the kernel's writer writes; what is there is made compact, looked at and moved into place.

    The kernel's settings are global to the process, and count when a writer makes its model: they hold inside.

    Parameters
    ----------
    shape : TopoDS_Shape
        That the file is to hold, once.
    path : path-like
    schema : {"ap214", "ap242"}
    product : str
        Name of a product that is given none.
    parameter_curves : bool
        As of :func:`write_step`.

    Raises
    ------
    ParameterError, ExportError
    """
    settings: dict[str, str | int] = {
        "write.step.schema": require_schema(schema),
        "write.step.unit": "MM",
        **_OF_LENGTHS,
        "write.step.product.name": product,
        "write.surfacecurve.mode": int(parameter_curves),
        # Of an assembly: the names of the faces of its parts.
        "write.stepcaf.subshapes.name": 1,
    }
    with replacing(path) as temporary, no_messages(), _kernel_settings(settings):
        raw = temporary.with_name(f"{temporary.name}.raw")
        try:
            yield raw
            compact_step(raw, temporary)
            _require_whole(path, temporary, shape)
        finally:
            raw.unlink(missing_ok=True)


def product_name(path: str | os.PathLike[str], name: str | None = None) -> str:
    """The name, or the file's stem, in characters that ISO 10303-21 takes as they are: the kernel escapes none."""
    wanted = Path(path).stem if name is None else name
    return "".join(letter if letter.isascii() and letter.isprintable() else "_" for letter in wanted)


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


def fill_header(writer: STEPControl_Writer, product: str) -> None:
    """Say what the file is, by whom and, if ``SOURCE_DATE_EPOCH`` is set, of that moment."""
    header = APIHeaderSection_MakeHeader(writer.Model())
    text = TCollection_HAsciiString
    header.SetName(text(product))
    header.SetAuthorValue(1, text(""))
    header.SetOrganizationValue(1, text(""))
    header.SetDescriptionValue(1, text("gyroid lattice"))
    header.SetOriginatingSystem(text(f"gyroid_cad {__version__}"))
    header.SetAuthorisation(text(""))
    epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
    if epoch.isdigit():
        # The convention for reproducible builds: the file's date is the one given, in UTC.
        header.SetTimeStamp(text(datetime.fromtimestamp(int(epoch), UTC).strftime("%Y-%m-%dT%H:%M:%S")))


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

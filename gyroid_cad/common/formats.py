"""Formats of files: one table of their names, endings and contents; and the settings they are written with.

Whoever reads or writes a file asks this table what its ending means. It names formats only: the code that writes each
is loaded when it is needed, and stands with what it writes.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from pathlib import Path
from types import MappingProxyType

from gyroid_cad.common.choices import BODY_NAMES, KINDS, SCHEMAS, BodyName, Kind, Schema
from gyroid_cad.common.files import require_distinct, require_writable
from gyroid_cad.common.memory import require_memory
from gyroid_cad.errors import ParameterError

__all__ = [
    "ABAQUS",
    "ANSYS",
    "BREP",
    "DEFAULT_ANGLE",
    "FILE_BYTES_PER_CELL",
    "FORMATS",
    "GISMO",
    "GMSH",
    "GZIPPED",
    "HTML",
    "JSON",
    "MESH_FORMATS",
    "MFEM",
    "MFEM_FIELD",
    "NASTRAN",
    "NPZ",
    "OBJ",
    "PART_FORMATS",
    "PLY",
    "PNG",
    "STEP",
    "STL",
    "THREE_MF",
    "TOML",
    "TRIANGLE_FORMATS",
    "VOLUME_FORMATS",
    "VTU",
    "ZIPPED",
    "Format",
    "format_of",
    "listed_endings",
    "listed_formats",
    "require_assembly_formats",
    "require_format",
    "require_formats",
    "require_meshing",
    "require_output",
    "require_regions",
    "require_schema",
    "require_settings",
    "stem_of",
]

# Whose faces have names, and are shared.
_BODIES = KINDS[-2]


@dataclass(frozen=True, slots=True)
class Format:
    """A format of files.

    Attributes
    ----------
    name : str
    endings : tuple of str
        Of file names, lower case.
    holds : str
        "solid", "triangles", "mesh", "volumes", "field", "page", "picture" or "lattice".
    """

    name: str
    endings: tuple[str, ...]
    holds: str


# Packed: in an archive of ZIP, and by gzip.
ZIPPED, GZIPPED = ".stpz", (".step.gz", ".stp.gz")
STEP = Format("STEP", (".step", ".stp", ZIPPED, *GZIPPED), "solid")
BREP = Format("BREP", (".brep",), "solid")
STL = Format("STL", (".stl",), "triangles")
THREE_MF = Format("3MF", (".3mf",), "triangles")
OBJ = Format("OBJ", (".obj",), "triangles")
PLY = Format("PLY", (".ply",), "triangles")
VTU = Format("VTU", (".vtu",), "mesh")
GMSH = Format("Gmsh", (".msh",), "mesh")
ABAQUS = Format("Abaqus, CalculiX", (".inp",), "mesh")
ANSYS = Format("ANSYS", (".cdb",), "mesh")
NASTRAN = Format("NASTRAN", (".bdf", ".nas"), "mesh")
MFEM = Format("MFEM NURBS mesh v1.0", (".mesh",), "volumes")
GISMO = Format("G+Smo multipatch", (".xml",), "volumes")
JSON = Format("JSON", (".json",), "volumes")
NPZ = Format("NPZ", (".npz",), "volumes")
MFEM_FIELD = Format("MFEM GridFunction", (".gf",), "field")
HTML = Format("HTML", (".html", ".htm"), "page")
PNG = Format("PNG", (".png",), "picture")
TOML = Format("TOML", (".toml",), "lattice")

FORMATS = (
    STEP,
    BREP,
    *(STL, THREE_MF, OBJ, PLY),
    *(VTU, GMSH, ABAQUS, ANSYS, NASTRAN),
    *(MFEM, GISMO, JSON, NPZ, MFEM_FIELD),
    *(HTML, PNG, TOML),
)
TRIANGLE_FORMATS, MESH_FORMATS, VOLUME_FORMATS = (
    tuple(form for form in FORMATS if form.holds == contents) for contents in ("triangles", "mesh", "volumes")
)
# What a lattice is built into, or a part filled.
PART_FORMATS = tuple(form for form in FORMATS if form.holds in ("solid", "triangles"))
_OF_ENDING = MappingProxyType({ending: form for form in FORMATS for ending in form.endings})

# By the names of the kernel's STEP writer.
# Peak memory of writing a cell, as benchmarks/memory.py measures it, rounded up.
FILE_BYTES_PER_CELL = 6_000_000
_KERNEL_SCHEMAS: Mapping[Schema, str] = MappingProxyType({"ap214": "AP214IS", "ap242": "AP242DIS"})
# Degrees between neighbouring facets.
DEFAULT_ANGLE = 15.0
# In degrees and mm: finer triangles are as many as no memory holds.
SMALLEST_ANGLE, SMALLEST_DEVIATION = 0.1, 1e-6


def format_of(path: str | os.PathLike[str]) -> Format | None:
    """Return the format that a file's name stands for, if any does.

    Examples
    --------
    >>> format_of("Bracket.STP").name
    'STEP'
    >>> format_of("bracket.step.gz").name
    'STEP'
    >>> format_of("bracket.dwg")
    """
    return _OF_ENDING.get(_ending_of(path))


def stem_of(path: str | os.PathLike[str]) -> str:
    """Return a file's name without the ending that says its format, or without its last one.

    Examples
    --------
    >>> stem_of("folder/bracket.step.gz"), stem_of("bracket.v2.stp")
    ('bracket', 'bracket.v2')
    """
    name = Path(path).name
    return name.removesuffix(name[len(name) - len(_ending_of(path)) :]) or name


def _ending_of(path: str | os.PathLike[str]) -> str:
    """The ending of a file's name, in lower case: two where both say together what it is."""
    suffixes = Path(path).suffixes
    both = "".join(suffixes[-2:]).lower()
    return both if both in _OF_ENDING else Path(path).suffix.lower()


def listed_endings(formats: Sequence[Format]) -> str:
    """Return the endings of formats as a message lists them.

    Examples
    --------
    >>> listed_endings(TRIANGLE_FORMATS)
    '.stl, .3mf, .obj or .ply'
    >>> listed_endings(PART_FORMATS)
    '.step, .stp, .stpz, .step.gz, .stp.gz, .brep, .stl, .3mf, .obj or .ply'
    """
    *others, last = [ending for form in formats for ending in form.endings]
    return f"{', '.join(others)} or {last}" if others else last


def listed_formats(formats: Sequence[Format]) -> str:
    """Return formats with their endings, as the help of an option lists them.

    Examples
    --------
    >>> listed_formats([BREP, NASTRAN])
    'BREP (.brep), NASTRAN (.bdf, .nas)'
    """
    return ", ".join(f"{form.name} ({', '.join(form.endings)})" for form in formats)


def require_format(
    option: str, path: str | os.PathLike[str], formats: Sequence[Format], accepted: str = "a file name ending in "
) -> Format:
    """Return the format of a file's name, which must be one of some formats.

    Parameters
    ----------
    option : str
        By which the file was named, for errors.
    path : path-like
    formats : sequence of Format
    accepted : str
        What would be accepted, for errors; the endings follow.

    Raises
    ------
    ParameterError
    """
    found = format_of(path)
    if found is None or found not in formats:
        raise ParameterError(option, str(path), accepted + listed_endings(formats))
    return found


def require_formats(paths: Sequence[str | os.PathLike[str]], formats: Sequence[Format] = PART_FORMATS) -> list[Path]:
    """Check the endings and folders of files to be written, before anything is built.

    Parameters
    ----------
    paths : sequence of path-like
    formats : sequence of Format
        Those that can be written.

    Raises
    ------
    ParameterError
    """
    return require_distinct(paths, lambda path: require_output(path, formats))


def require_output(path: str | os.PathLike[str], formats: Sequence[Format], option: str = "output") -> Path:
    """Check the ending and the folder of one file to be written.

    Raises
    ------
    ParameterError
    """
    require_format(option, path, formats)
    return require_writable(path)


def require_schema(schema: Schema) -> str:
    """The kernel's name of a schema.

    Raises
    ------
    ParameterError
    """
    if schema not in SCHEMAS:
        raise ParameterError("schema", schema, " or ".join(SCHEMAS))
    return _KERNEL_SCHEMAS[schema]


def require_meshing(deviation: float, angle: float = DEFAULT_ANGLE) -> None:
    """Check the two limits of triangles.

    Raises
    ------
    ParameterError
    """
    if not (isinstance(deviation, Real) and isfinite(deviation) and deviation > 0):
        raise ParameterError("deviation", deviation, "a length above 0 mm")
    if deviation < SMALLEST_DEVIATION:
        raise ParameterError("deviation", deviation, f"at least {SMALLEST_DEVIATION:g} mm")
    if not (isinstance(angle, Real) and isfinite(angle) and SMALLEST_ANGLE <= angle < 90):
        raise ParameterError("angle", angle, f"{SMALLEST_ANGLE:g} or more and below 90 degrees")


def require_settings(cells: tuple[int, int, int], deviation: float | None, angle: float, solid: bool = True) -> None:
    """Check the settings of files to be written, and that memory will do, before anything is built.

    Parameters
    ----------
    cells : tuple of int
    deviation : float, optional
    angle : float
    solid : bool
        Whether there is a solid to be written; triangles of a wall are streamed.

    Raises
    ------
    ParameterError
    """
    require_meshing(1.0 if deviation is None else deviation, angle)
    if solid:
        require_memory(cells, FILE_BYTES_PER_CELL)


def require_assembly_formats(targets: Sequence[Path]) -> None:
    """Check that files can hold an assembly: STEP only.

    Raises
    ------
    ParameterError
    """
    for path in targets:
        require_format("output", path, [STEP], "an assembly: a file name ending in ")


def require_regions(kind: Kind, targets: Sequence[str | os.PathLike[str]], regions: BodyName | None) -> None:
    """Check that triangles are of no bodies that share faces, unless STL is to have these in regions by their names.

    Raises
    ------
    ParameterError
    """
    of_triangles = [path for path in targets if format_of(path) in TRIANGLE_FORMATS]
    if regions is None:
        if kind == _BODIES and of_triangles:
            accepted = "STEP or BREP, which tell bodies that share faces apart, or .stl in regions"
            raise ParameterError("output", str(of_triangles[0]), accepted)
        return
    if kind != _BODIES:
        raise ParameterError("regions", regions, f"none but of the kind {_BODIES}, whose faces have names")
    if regions not in BODY_NAMES:
        raise ParameterError("regions", regions, " or ".join(BODY_NAMES))
    for path in of_triangles:
        require_format("output", path, [STL], "a file that can hold regions, ending in ")
    if not of_triangles:
        raise ParameterError("regions", regions, "a file ending in .stl to write them into")

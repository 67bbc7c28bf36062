"""Triangles read from STL, 3MF, OBJ and PLY files, in millimetres."""

from __future__ import annotations

import os
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile, ZipFile

import lib3mf
import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.formats import OBJ, STL, THREE_MF, TRIANGLE_FORMATS, Format, require_format
from gyroid_cad.common.inputs import unreadable, utf8_named
from gyroid_cad.errors import ParameterError

__all__ = ["STL_RECORD", "binary_stl_corners", "keep_facets", "numbered_corners", "read_triangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Real = TypeVar("Real", np.float32, np.float64)

STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
STL_HEADER_BYTES = 84
# Of 3MF, in bytes: 1 GB of it holds about fifteen million triangles, and text of numbers packs ten times or so.
_MOST_UNPACKED, _MOST_PER_BYTE, _LEAST_ALLOWED = 1_000_000_000, 100, 10_000_000
# As meshio names them.
_POLYGONS = ("triangle", "quad", "polygon")
_EXPECTED = "a file of triangles, binary or text STL, 3MF, OBJ or PLY"


def read_triangles(path: str | os.PathLike[str], form: Format | None = None) -> tuple[Floats, Integers]:
    """The triangles of an STL, 3MF, OBJ or PLY file.

    STL, OBJ and PLY have no unit: their numbers are taken for millimetres, as printers' programs do. 3MF says its own,
    and where the parts on its build platform stand. Corners are one where their numbers are the same to the last bit;
    triangles without area, which bound nothing, are left out.

    Parameters
    ----------
    path : path-like
    form : Format, optional
        Whatever the file's name ends in.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)

    Raises
    ------
    ParameterError
        If the file cannot be read, or holds no triangles.
    """
    target = Path(path)
    form = form or require_format("file", path, TRIANGLE_FORMATS, f"{_EXPECTED}: a name ending in ")
    if reason := unreadable(path):
        raise ParameterError("file", str(path), f"{_EXPECTED} that can be read: {reason}")
    if form is THREE_MF:
        vertices, triangles = _read_3mf(target)
    elif form is STL:
        vertices, triangles, _ = numbered_corners(_stl_corners(target))
    else:
        vertices, triangles = _read_with_meshio(target, "obj" if form is OBJ else "ply")
    if not len(triangles) or not np.isfinite(vertices).all():
        raise ParameterError("file", str(path), f"{_EXPECTED}, with triangles of finite size in it")
    return vertices, triangles


def _stl_corners(path: Path) -> Floats:
    """Three corners of every triangle; shape (triangles, 3, 3)."""
    size = path.stat().st_size
    if size >= STL_HEADER_BYTES:
        count = int(np.fromfile(path, "<u4", 1, offset=STL_HEADER_BYTES - 4)[0])
        # Some programs begin binary files with "solid" too: the size tells them from text for certain.
        if size == STL_HEADER_BYTES + count * STL_RECORD.itemsize:
            return binary_stl_corners(path).astype(float)
    try:
        with path.open("rb") as file:
            # What holds no text is not read as a whole, however large it is.
            if not file.read(STL_HEADER_BYTES).lstrip().lower().startswith(b"solid"):
                raise ValueError
        lines = path.read_text(encoding="ascii").split("\n")
        corners = [line.split()[1:] for line in lines if line.lstrip().startswith("vertex")]
        return np.array(corners, dtype=float).reshape(-1, 3, 3)
    except (UnicodeDecodeError, ValueError):
        raise ParameterError("file", str(path), _EXPECTED) from None


def binary_stl_corners(path: Path) -> NDArray[np.float32]:
    """Read the corners of all triangles of a binary STL file; shape (triangles, 3, 3)."""
    return np.asarray(np.fromfile(path, STL_RECORD, offset=STL_HEADER_BYTES)["corners"])


def keep_facets(path: Path, kept: Booleans) -> None:
    """Rewrite a binary STL file without the triangles that a mask, shape (triangles,), leaves out."""
    if not kept.all():
        header = path.read_bytes()[: STL_HEADER_BYTES - 4]
        records = np.fromfile(path, STL_RECORD, offset=STL_HEADER_BYTES)[kept]
        path.write_bytes(header + len(records).to_bytes(4, "little") + records.tobytes())


def numbered_corners(corners: NDArray[Real]) -> tuple[NDArray[Real], Integers, Booleans]:
    """Number the corners of triangles: one where their coordinates are the same to the last bit.

    Parameters
    ----------
    corners : ndarray, shape (triangles, 3, 3)

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
    triangles : ndarray of int, shape (kept, 3)
        Without slivers two of whose corners are one: what bounds nothing.
    kept : ndarray of bool, shape (triangles,)
    """
    # Minus zero is zero.
    flat = np.ascontiguousarray(corners.reshape(-1, 3) + corners.dtype.type(0))
    first, numbers = _distinct(flat)
    triangles = numbers.reshape(-1, 3)
    kept = np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)
    return flat[first], triangles[kept], kept


# Odd numbers of 64 bits without a pattern, by which the bits of coordinates are mixed.
_MIXERS = np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)


def _distinct(flat: NDArray[Real]) -> tuple[Integers, Integers]:
    """Places where each distinct point is found first, and the number of every point among these.

    Points are sorted by a mixture of their bits, a single number, which takes a fifth of the time; should two points
    have one by chance, by all of their bits.
    """
    bits = flat.view(np.uint32 if flat.itemsize == 4 else np.uint64).astype(np.uint64)
    mixed = np.zeros(len(flat), dtype=np.uint64)
    for axis in range(3):
        mixed ^= bits[:, axis]
        mixed *= _MIXERS[axis]
        mixed ^= mixed >> np.uint64(29)
    _, first, numbers = np.unique(mixed, return_index=True, return_inverse=True)
    if not np.array_equal(flat[first][numbers], flat):
        keys = flat.view(np.dtype((np.void, flat.itemsize * 3))).ravel()
        _, first, numbers = np.unique(keys, return_index=True, return_inverse=True)
    return first, numbers.ravel().astype(np.int64)


def _read_with_meshio(path: Path, form: str) -> tuple[Floats, Integers]:
    """Triangles of OBJ and PLY, larger polygons fanned out."""
    # It loads a reader of every format it knows, which other files need not wait for.
    import meshio

    try:
        if form == "ply":
            # Of the format's names of types the library lacks one, which stands in the header alone.
            header, end, data = path.read_bytes().partition(b"end_header")
            mesh = meshio.ply.read(BytesIO(header.replace(b" ushort ", b" uint16 ") + end + data))
        else:
            mesh = meshio.read(path, form)
    # The library's readers fail as text and numbers do, on files that are not what they seem.
    except (meshio.ReadError, ValueError, IndexError, KeyError, TypeError, AssertionError, SystemExit) as problem:
        raise ParameterError("file", str(path), f"{_EXPECTED}: meshio says {problem}") from None
    polygons = [np.asarray(some.data, dtype=np.int64) for some in mesh.cells if some.type in _POLYGONS]
    fans = [some[:, [0, k, k + 1]] for some in polygons for k in range(1, some.shape[1] - 1)]
    numbers = np.concatenate([np.zeros((0, 3), dtype=np.int64), *fans])
    if len(numbers) and not 0 <= numbers.min() <= numbers.max() < len(mesh.points):
        raise ParameterError("file", str(path), f"{_EXPECTED}, whose triangles name corners that are there")
    return numbered_corners(np.asarray(mesh.points, dtype=float)[:, :3][numbers])[:2]


def _read_3mf(path: Path) -> tuple[Floats, Integers]:
    """Meshes of all parts that are to be built, each where it stands on the platform."""

    _require_bounded_archive(path)
    wrapper = lib3mf.get_wrapper()
    try:
        model = wrapper.CreateModel()
        with utf8_named(path) as name:
            model.QueryReader("3mf").ReadFromFile(name)
        # Parts made of others come out as one mesh, placed.
        flat = model.MergeToModel()
        unit = _millimetres(model.GetUnit())
        objects, vertices, triangles, count = flat.GetMeshObjects(), [], [], 0
        while objects.MoveNext():
            mesh = objects.GetCurrentMeshObject()
            vertices.append(_array(mesh.GetVertices(), "<f4").astype(np.float64) * unit)
            triangles.append(_array(mesh.GetTriangleIndices(), "<u4").astype(np.int64) + count)
            count += len(vertices[-1])
    except lib3mf.ELib3MFException as problem:
        raise ParameterError("file", str(path), f"{_EXPECTED}: lib3mf says {problem}") from None
    return np.concatenate([np.zeros((0, 3)), *vertices]), np.concatenate([np.zeros((0, 3), dtype=np.int64), *triangles])


def _require_bounded_archive(path: Path) -> None:
    """Refuse a 3MF file that unpacks to more than any part takes, or to what it does not say."""
    try:
        with ZipFile(path) as archive:
            unpacked = sum(entry.file_size for entry in archive.infolist())
            if unpacked > min(_MOST_UNPACKED, _LEAST_ALLOWED + _MOST_PER_BYTE * path.stat().st_size):
                raise ParameterError(
                    "file",
                    str(path),
                    f"3MF that unpacks to at most {_MOST_UNPACKED / 1e6:g} MB and {_MOST_PER_BYTE} times its own size; "
                    f"it says {unpacked / 1e6:.4g} MB",
                )
            # No more is unpacked of an entry than it says: if that is not all of it, its checksum fails.
            damaged = archive.testzip()
    except (BadZipFile, RuntimeError, EOFError, OSError, zlib.error) as problem:
        raise ParameterError("file", str(path), f"{_EXPECTED}: it is no sound zip archive: {problem}") from None
    if damaged is not None:
        raise ParameterError("file", str(path), f"{_EXPECTED}: {damaged} in it is damaged")


def _array(structures: Any, kind: str) -> NDArray[Any]:
    """The library's vertices or triangles, three numbers each, as an array."""
    return np.frombuffer(bytearray(b"".join(map(bytes, structures))), kind).reshape(-1, 3)


def _millimetres(unit: Any) -> float:

    sizes = {
        lib3mf.ModelUnit.MicroMeter: 1e-3,
        lib3mf.ModelUnit.MilliMeter: 1.0,
        lib3mf.ModelUnit.CentiMeter: 10.0,
        lib3mf.ModelUnit.Inch: 25.4,
        lib3mf.ModelUnit.Foot: 304.8,
        lib3mf.ModelUnit.Meter: 1000.0,
    }
    return sizes[lib3mf.ModelUnit(unit)]

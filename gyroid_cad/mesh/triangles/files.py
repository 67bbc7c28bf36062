"""Triangles read from STL, 3MF, OBJ and PLY files, in millimetres."""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile, ZipFile

import lib3mf
import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.formats import OBJ, STL, THREE_MF, TRIANGLE_FORMATS, Format, require_format
from gyroid_cad.common.inputs import unreadable, utf8_named
from gyroid_cad.errors import ParameterError

__all__ = [
    "STL_RECORD",
    "TriangleFile",
    "binary_stl_corners",
    "keep_facets",
    "numbered_corners",
    "read_triangle_file",
    "read_triangles",
    "renumbered",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Real = TypeVar("Real", np.float32, np.float64)

STL_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
STL_HEADER_BYTES = 84
# Of 3MF, in bytes: 1 GB of it holds about fifteen million triangles, and text of numbers packs ten times or so.
_MOST_UNPACKED, _MOST_PER_BYTE, _LEAST_ALLOWED = 1_000_000_000, 100, 10_000_000
_EXPECTED = "a file of triangles, binary or text STL, 3MF, OBJ or PLY"


@dataclass(frozen=True, slots=True, eq=False)
class TriangleFile:
    """Contents of a file of triangles.

    Attributes
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    without_area : ndarray, shape (left out, 3)
        A corner of each triangle that was left out, for two of its corners are one.
    unit : str
        That the file says its numbers are in; "none" where it cannot say.
    """

    vertices: Floats
    triangles: Integers
    without_area: Floats
    unit: str


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
    read = read_triangle_file(path, form)
    return read.vertices, read.triangles


def read_triangle_file(path: str | os.PathLike[str], form: Format | None = None) -> TriangleFile:
    """Read all that an STL, 3MF, OBJ or PLY file says, as :func:`read_triangles` the triangles.

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
        read = _read_3mf(target)
    elif form is STL:
        read = _numbered(_stl_corners(target))
    else:
        read = _read_obj(target) if form is OBJ else _read_ply(target)
    if not len(read.triangles) or not np.isfinite(read.vertices).all():
        raise ParameterError("file", str(path), f"{_EXPECTED}, with triangles of finite size in it")
    return read


def _numbered(corners: Floats) -> TriangleFile:
    vertices, triangles, kept = numbered_corners(corners)
    return TriangleFile(vertices, triangles, corners[~kept, 0], "none")


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
    places = corners.reshape(-1, 3)
    return renumbered(places, np.arange(len(places)).reshape(-1, 3))


def renumbered(vertices: NDArray[Real], triangles: Integers) -> tuple[NDArray[Real], Integers, Booleans]:
    """Triangles whose vertices of the same coordinates are made one, as :func:`numbered_corners` gives them."""
    # Minus zero is zero.
    flat = np.ascontiguousarray(vertices + vertices.dtype.type(0))
    first, numbers = _distinct(flat)
    found = numbers[triangles]
    kept = np.all(found != np.roll(found, 1, axis=1), axis=1)
    return flat[first], found[kept], kept


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


def _read_obj(path: Path) -> TriangleFile:
    """Triangles of OBJ, larger polygons fanned out; corners counted from 1, or backwards from the last one, below 0."""
    corners: list[list[float]] = []
    faces: list[list[int]] = []
    number = 0
    try:
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            number += 1
            kind, *words = line.split() or [""]
            if kind == "v":
                x, y, z = map(float, words[:3])
                corners.append([x, y, z])
            elif kind == "f":
                indices = [int(word.partition("/")[0]) for word in words]
                indices = [index - 1 if index > 0 else len(corners) + index for index in indices]
                faces += [[indices[0], *pair] for pair in pairwise(indices[1:])]
    except ValueError:
        raise ParameterError("file", str(path), f"{_EXPECTED}: line {number} is none of OBJ") from None
    points, found = np.array(corners, dtype=float).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)
    return _with_corners(path, points, found)


def _with_corners(path: Path, points: Floats, triangles: Integers) -> TriangleFile:
    """Corners numbered by their coordinates, as in STL: programs write one for each triangle, or for each normal."""
    if len(triangles) and not 0 <= triangles.min() <= triangles.max() < len(points):
        raise ParameterError("file", str(path), f"{_EXPECTED}, whose triangles name corners that are there")
    return _numbered(points[triangles])


# Names of types in PLY, old and new.
_PLY_TYPES = {
    name: kind
    for kind, names in {
        "i1": "char int8",
        "u1": "uchar uint8",
        "i2": "short int16",
        "u2": "ushort uint16",
        "i4": "int int32",
        "u4": "uint uint32",
        "f4": "float float32",
        "f8": "double float64",
    }.items()
    for name in names.split()
}


def _read_ply(path: Path) -> TriangleFile:
    """Triangles of PLY, text or binary, of faces that all have as many corners as the first, fanned out."""
    try:
        table = _ply_table(path.read_bytes())
        points = np.stack([np.asarray(table["vertex"][axis], dtype=float) for axis in "xyz"], axis=1)
        faces = np.asarray(table["face"]["corners"], dtype=np.int64)
        if np.any(np.asarray(table["face"]["corners count"]) != faces.shape[1]):
            raise ValueError("its faces have different numbers of corners")
    except (KeyError, IndexError, ValueError) as problem:
        raise ParameterError("file", str(path), f"{_EXPECTED}: not understood: {problem}") from None
    fans = [faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)]
    return _with_corners(path, points, np.concatenate([np.zeros((0, 3), dtype=np.int64), *fans]))


def _ply_table(contents: bytes) -> dict[str, Any]:
    """The elements of a PLY file, each with its fields by name."""
    head, _, data = contents.partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    order = {"binary_little_endian": "<", "binary_big_endian": ">", "ascii": ""}[lines[1][1]]
    body, at = data[data.index(b"\n") + 1 :], 0
    words = [] if order else body.split()
    elements = [line for line in lines if line[:1] in (["element"], ["property"])]
    starts = [index for index, line in enumerate(elements) if line[0] == "element"]
    table: dict[str, Any] = {}
    for first, last in pairwise([*starts, len(elements)]):
        name, count = elements[first][1], int(elements[first][2])
        fields, size = _ply_fields(elements[first + 1 : last], order, body[at:], words[at:])
        if order:
            found = np.frombuffer(body, np.dtype(fields), count, at)
            table[name], size = found, found.itemsize
        else:
            rows = np.array(words[at : at + count * size], dtype=float).reshape(count, size)
            ends = np.cumsum([0, *(field[2][0] if len(field) > 2 else 1 for field in fields)])
            table[name] = {
                field[0]: rows[:, low:high] if len(field) > 2 else rows[:, low]
                for field, (low, high) in zip(fields, pairwise(ends.tolist()), strict=True)
            }
        at += count * size
    return table


def _ply_fields(
    properties: Sequence[Sequence[str]], order: str, body: bytes, words: Sequence[bytes]
) -> tuple[list[tuple[Any, ...]], int]:
    """Fields of one element of PLY, lists as long as in its first record, and how many numbers they are together."""
    fields: list[tuple[Any, ...]] = []
    count = 0
    for line in properties:
        if line[1] != "list":
            fields.append((line[2], order + _PLY_TYPES[line[1]]))
            count += 1
            continue
        name = "corners" if line[4] in ("vertex_indices", "vertex_index") else line[4]
        kind = np.dtype((order or "<") + _PLY_TYPES[line[2]])
        before = np.dtype(fields).itemsize
        length = int(np.frombuffer(body, kind, 1, before)[0]) if order else int(words[count])
        fields += [(f"{name} count", kind), (name, order + _PLY_TYPES[line[3]], (length,))]
        count += 1 + length
    return fields, count


_MILLIMETRES = {
    lib3mf.ModelUnit.MicroMeter: 1e-3,
    lib3mf.ModelUnit.MilliMeter: 1.0,
    lib3mf.ModelUnit.CentiMeter: 10.0,
    lib3mf.ModelUnit.Inch: 25.4,
    lib3mf.ModelUnit.Foot: 304.8,
    lib3mf.ModelUnit.Meter: 1000.0,
}


def _read_3mf(path: Path) -> TriangleFile:
    """Meshes of all parts that are to be built, each where it stands on the platform."""

    _require_bounded_archive(path)
    wrapper = lib3mf.get_wrapper()
    try:
        model = wrapper.CreateModel()
        with utf8_named(path) as name:
            model.QueryReader("3mf").ReadFromFile(name)
        # Parts made of others come out as one mesh, placed.
        flat = model.MergeToModel()
        unit = lib3mf.ModelUnit(model.GetUnit())
        objects, vertices, triangles, count = flat.GetMeshObjects(), [], [], 0
        while objects.MoveNext():
            mesh = objects.GetCurrentMeshObject()
            vertices.append(_array(mesh.GetVertices(), "<f4").astype(np.float64) * _MILLIMETRES[unit])
            triangles.append(_array(mesh.GetTriangleIndices(), "<u4").astype(np.int64) + count)
            count += len(vertices[-1])
    except lib3mf.ELib3MFException as problem:
        raise ParameterError("file", str(path), f"{_EXPECTED}: lib3mf says {problem}") from None
    return TriangleFile(
        np.concatenate([np.zeros((0, 3)), *vertices]),
        np.concatenate([np.zeros((0, 3), dtype=np.int64), *triangles]),
        np.zeros((0, 3)),
        str(unit.name).lower().replace("meter", "metre"),
    )


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

"""Triangles as files that hold one mesh: STL, in regions too, 3MF, OBJ and PLY, each read back before it is named."""

from __future__ import annotations

import ctypes
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any
from uuid import NAMESPACE_OID, uuid5

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import unit
from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import OBJ, PLY, STL, THREE_MF, TRIANGLE_FORMATS, Format, require_format
from gyroid_cad.errors import ExportError
from gyroid_cad.mesh.triangles.files import STL_RECORD, binary_stl_corners, read_triangles, renumbered
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.mesh.triangles.stl import STL_HEADER

__all__ = ["read_regions", "region_name", "write_3mf", "write_regions", "write_triangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of coordinates: corners that differ in double precision differ in the file too.
_DIGITS = 12
# Of coordinates, so that single precision survives being written in decimals.
_DECIMALS = 9


def write_triangles(
    vertices: NDArray[np.floating], triangles: NDArray[np.integer], path: str | os.PathLike[str]
) -> None:
    """Write one mesh in millimetres as STL, 3MF, OBJ or PLY, as the path's ending says.

    The file is read back, its corners numbered by their coordinates as any reader does: only if every edge is then
    shared by two triangles, once each way, does it take its name.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.
    path : path-like

    Raises
    ------
    ExportError
    """
    form = require_format("output", path, TRIANGLE_FORMATS)
    if form is THREE_MF:
        # Its own library refuses what is not closed.
        write_3mf(np.asarray(vertices, dtype=np.float32), np.asarray(triangles, dtype=np.int32), path)
        return
    writer = {STL: _write_stl, OBJ: _write_obj, PLY: _write_ply}[form]
    with replacing(path) as temporary:
        writer(np.asarray(vertices), np.asarray(triangles), temporary)
        numbers = _read_back(temporary, form, vertices, triangles)
        if open_edges := unmatched_edges(numbers):
            raise ExportError(
                f"{path} was not written: read back it has {open_edges} edges that two triangles do not share"
            )


def _read_back(path: Path, form: Format, vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> Integers:
    """Triangles of a file by the numbers of their corners, one where their coordinates are the same."""
    singles, numbers = np.asarray(vertices, dtype=np.float32), np.asarray(triangles, dtype=np.int64)
    if form is STL and np.array_equal(binary_stl_corners(path), singles[numbers]):
        # So there is no need to find again which of the corners are one vertex.
        return renumbered(singles, numbers)[1]
    return read_triangles(path, form)[1]


def _write_stl(vertices: NDArray[np.floating], triangles: NDArray[np.integer], path: Path) -> None:
    corners = np.asarray(vertices, dtype=np.float32)[triangles]
    a, b, c = np.moveaxis(corners, 1, 0)
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float32).tiny)
    records = np.zeros(len(triangles), STL_RECORD)
    records["normal"], records["corners"] = normals, corners
    with path.open("wb") as file:
        file.write(STL_HEADER + np.uint32(len(triangles)).astype("<u4").tobytes())
        file.write(records.data)


def _write_obj(vertices: NDArray[np.floating], triangles: NDArray[np.integer], path: Path) -> None:
    """Text, corners counted from 1 (Wavefront, Object Files, Advanced Visualizer manual, appendix B1)."""
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("# gyroid_cad, millimetres\n")
        # As many digits as give each number back.
        file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in vertices.tolist())
        file.writelines(f"f {a} {b} {c}\n" for a, b, c in (triangles + 1).tolist())


def _write_ply(vertices: NDArray[np.floating], triangles: NDArray[np.integer], path: Path) -> None:
    """Binary PLY, corners in double precision (G. Turk, The PLY Polygon File Format, 1994)."""
    faces = np.zeros(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment gyroid_cad, millimetres",
        f"element vertex {len(vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        f"element face {len(triangles)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    with path.open("wb") as file:
        file.write("\n".join(header).encode("ascii"))
        file.write(np.ascontiguousarray(vertices, dtype="<f8").data)
        file.write(faces.data)


def write_3mf(vertices: NDArray[np.float32], triangles: NDArray[np.int32], path: str | os.PathLike[str]) -> None:
    """Write one mesh as 3MF (core specification 1.3), in millimetres.

    The whole mesh, the library's copy of it and its text are in memory at once, about 350 bytes a triangle: for
    lattices of many millions of triangles STL, which is streamed, is the better file.

    Parameters
    ----------
    vertices : ndarray of float32, shape (vertices, 3)
        In mm.
    triangles : ndarray of int32, shape (triangles, 3)
        Numbers of vertices, counterclockwise seen from outside.
    path : path-like

    Raises
    ------
    ExportError
        If the library finds the mesh not closed or not oriented, or the file could not be written.
    """
    import lib3mf

    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    mesh = model.AddMeshObject()
    mesh.SetName("gyroid_cad")
    places = np.array(vertices, dtype="<f4", order="C")
    numbers = np.array(triangles, dtype="<u4", order="C")
    corners = (lib3mf.Position * len(vertices)).from_buffer(places)
    facets = (lib3mf.Triangle * len(triangles)).from_buffer(numbers)
    try:
        mesh.SetGeometry(corners, facets)
        if not mesh.IsManifoldAndOriented():
            raise ExportError(f"{path} was not written: its triangles are not closed and oriented")
        item = model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
        # The library draws lots for them; so the same mesh makes the same file.
        content = sha256(places.tobytes())
        content.update(numbers.tobytes())
        for name, set_identity in (("object", mesh.SetUUID), ("item", item.SetUUID), ("build", model.SetBuildUUID)):
            set_identity(str(uuid5(NAMESPACE_OID, f"{name} {content.hexdigest()}")))
        writer = model.QueryWriter("3mf")
        writer.SetDecimalPrecision(_DECIMALS)
        package = _written(writer)
    except lib3mf.ELib3MFException as problem:
        raise ExportError(f"{path} was not written: lib3mf says {problem}") from problem
    with replacing(path) as temporary:
        temporary.write_bytes(package)


def _written(writer: Any) -> memoryview:
    """Bytes that a writer of lib3mf writes: into memory, for to a file on a full disk it ends the whole process."""
    import lib3mf

    package = BytesIO()
    problems: list[BaseException] = []

    @contextmanager
    def told_later() -> Iterator[None]:
        # Nothing passes through the library: an interrupt, or memory that gives out, would be lost in it.
        try:
            yield
        except BaseException as problem:
            problems.append(problem)

    def write(address: int, count: int, _: object) -> None:
        with told_later():
            package.write(ctypes.string_at(address, count))

    def seek(position: int, _: object) -> None:
        with told_later():
            package.seek(position)

    writer.WriteToCallback(lib3mf.WriteCallback(write), lib3mf.SeekCallback(seek), None)
    if problems:
        raise problems[0]
    return package.getbuffer()


def region_name(face: str) -> str:
    """Name of a face as one word of letters, digits and underscores, which every reader takes.

    >>> region_name("wall/a"), region_name("a:1"), region_name("fluid-a/face 3")
    ('wall_a', 'a_1', 'fluid_a_face_3')
    """
    return re.sub(r"\W+", "_", face, flags=re.ASCII).strip("_") or "faces"


def write_regions(vertices: Floats, triangles: Integers, names: Sequence[str], path: str | os.PathLike[str]) -> None:
    """Write triangles in millimetres as STL of text, those of each region as a solid of its own.

    The file is read back before it takes its name.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    names : sequence of str
        Region of each triangle.
    path : path-like

    Raises
    ------
    ExportError
    """
    regions, which = np.unique(np.array(names), return_inverse=True)
    corners = np.asarray(vertices, dtype=float)[triangles]
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    with replacing(path) as temporary:
        with temporary.open("w", encoding="ascii", newline="\n") as out:
            for number, name in enumerate(regions.tolist()):
                own = which == number
                out.write(f"solid {name}\n")
                out.writelines(_facets(normals[own], corners[own]))
                out.write(f"endsolid {name}\n")
        counted = {name: len(found) for name, found in read_regions(temporary).items()}
        if counted != dict(zip(regions.tolist(), np.bincount(which).tolist(), strict=True)):
            raise ExportError(f"{path} was not written: read back it has other regions than were written")


def _facets(normals: Floats, corners: Floats) -> Iterable[str]:
    for normal, places in zip(normals.tolist(), corners.tolist(), strict=True):
        lines = "".join(f"vertex {_numbers(place)}\n" for place in places)
        yield f"facet normal {_numbers(normal)}\nouter loop\n{lines}endloop\nendfacet\n"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.{_DIGITS}g}" for value in values)


def read_regions(path: str | os.PathLike[str]) -> dict[str, Floats]:
    """Corners of the triangles of each region of an STL file of text, by its name.

    Returns
    -------
    dict of ndarray, shape (triangles, 3, 3)
        In mm.
    """
    found: dict[str, list[list[float]]] = {}
    own: list[list[float]] = []
    for line in Path(path).read_text(encoding="ascii").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "solid":
            own = found.setdefault(rest.strip(), [])
        elif word == "vertex":
            own.append([float(number) for number in rest.split()])
    return {name: np.array(places).reshape(-1, 3, 3) for name, places in found.items()}

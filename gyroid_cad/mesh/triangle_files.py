"""Triangles read from STL and 3MF files, and what can be told of them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.arrays import freeze_arrays
from gyroid_cad.complex import connected
from gyroid_cad.errors import ExportError

__all__ = ["ReadTriangles", "TriangleMeasures", "read_triangles", "triangle_measures"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_HEADER_BYTES = 84
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
# Of the units that 3MF knows.
_MILLIMETRES = {
    "MicroMeter": 1e-3,
    "MilliMeter": 1.0,
    "CentiMeter": 10.0,
    "Inch": 25.4,
    "Foot": 304.8,
    "Meter": 1000.0,
}


@dataclass(frozen=True, slots=True, eq=False)
class ReadTriangles:
    """Triangles of a file.

    Attributes
    ----------
    vertices : ndarray, shape (n, 3)
        In mm; of STL, which numbers none, places that are the same to the last bit are one.
    triangles : ndarray of int, shape (m, 3)
    objects : int
        Meshes in the file, as placed for building.
    """

    vertices: Floats
    triangles: Integers
    objects: int

    def __post_init__(self) -> None:
        freeze_arrays(self)


@dataclass(frozen=True, slots=True)
class TriangleMeasures:
    """What triangles amount to.

    Attributes
    ----------
    triangles, vertices : int
    closed : bool
        Whether every edge is used by as many triangles one way as the other: then there is an inside.
    manifold : bool
        Whether it is used exactly once each way.
    open_edges : int
        Edges used more often one way than the other.
    pieces : int
        That hang together by vertices.
    low, high : tuple of float
        Corners of the bounding box, in mm.
    volume, area : float
        In mm3 and mm2; the volume is of no meaning where the triangles are not closed.
    """

    triangles: int
    vertices: int
    closed: bool
    manifold: bool
    open_edges: int
    pieces: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    volume: float
    area: float


def read_triangles(path: str | os.PathLike[str]) -> ReadTriangles:
    """Read an STL file, binary or text, or a 3MF file, by its ending.

    Raises
    ------
    ExportError
        If it cannot be read, or holds no triangles.
    """
    kind = "3MF" if Path(path).suffix.lower() == ".3mf" else "STL"
    try:
        read = _read_3mf(path) if kind == "3MF" else _read_stl(Path(path))
    except OSError as problem:
        raise ExportError(f"{path} could not be read: {problem.strerror or problem}") from None
    except ValueError as problem:
        raise ExportError(f"{path} could not be read as {kind}: {problem}") from None
    if not len(read.triangles):
        raise ExportError(f"{path} holds no triangles")
    if not np.isfinite(read.vertices).all():
        raise ExportError(f"{path} could not be read as {kind}: a coordinate is no finite number")
    return read


def _read_stl(path: Path) -> ReadTriangles:
    """By its length a file is binary, whatever its header says: 84 bytes, and 50 for each triangle."""
    size = path.stat().st_size
    with path.open("rb") as file:
        header = file.read(_HEADER_BYTES)
    count = int.from_bytes(header[80:84], "little")
    if len(header) == _HEADER_BYTES and size == _HEADER_BYTES + _RECORD.itemsize * count:
        corners = np.fromfile(path, _RECORD, offset=_HEADER_BYTES)["corners"].astype(np.float64)
    elif header.lstrip()[:5].lower() == b"solid":
        text = path.read_text(encoding="utf-8", errors="replace")
        words = [line.split()[1:] for line in text.splitlines() if line.split()[:1] == ["vertex"]]
        corners = np.array(words, dtype=float).reshape(-1, 3, 3)
    else:
        raise ValueError("neither text that begins with 'solid' nor as many bytes as its triangles take")
    # Minus nought is nought.
    vertices, numbers = np.unique(corners.reshape(-1, 3) + 0.0, axis=0, return_inverse=True)
    return ReadTriangles(vertices, numbers.reshape(-1, 3).astype(np.int64), 1)


def _read_3mf(path: str | os.PathLike[str]) -> ReadTriangles:
    """Every mesh that is to be built, where it is to be built, in millimetres."""
    import lib3mf

    # The library says no more of a missing file than a number.
    Path(path).open("rb").close()
    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    try:
        model.QueryReader("3mf").ReadFromFile(str(path))
        scale = _MILLIMETRES[lib3mf.ModelUnit(model.GetUnit()).name]
        items = model.GetBuildItems().Count()
        # Build items are placed copies of objects; merged, they are meshes where they stand.
        meshes = model.MergeToModel().GetMeshObjects()
        vertices, triangles, first = [np.empty((0, 3))], [np.empty((0, 3), dtype=np.int64)], 0
        while meshes.MoveNext():
            mesh = meshes.GetCurrentMeshObject()
            vertices.append(_array(mesh.GetVertices(), "<f4").astype(np.float64) * scale)
            triangles.append(_array(mesh.GetTriangleIndices(), "<u4").astype(np.int64) + first)
            first += len(vertices[-1])
    except lib3mf.ELib3MFException as problem:
        raise ValueError(f"lib3mf says {problem}") from None
    return ReadTriangles(np.concatenate(vertices), np.concatenate(triangles), items)


def _array(structures: Any, kind: str) -> NDArray[Any]:
    """The library's vertices or triangles, three numbers each, as an array."""
    return np.frombuffer(bytearray(b"".join(map(bytes, structures))), kind).reshape(-1, 3)


def triangle_measures(read: ReadTriangles) -> TriangleMeasures:
    """What triangles are: their size, whether they close, and what they enclose.

    Parameters
    ----------
    read : ReadTriangles
    """
    vertices, triangles = read.vertices, read.triangles
    # Near the triangles, so that volumes far from the origin lose no digits.
    middle = vertices.mean(axis=0)
    a, b, c = (vertices[triangles[:, k]] - middle for k in range(3))
    twice = np.cross(b - a, c - a)
    ends = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    forward = ends[:, 0] < ends[:, 1]
    edges, which = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    one_way = np.bincount(which.ravel()[forward], minlength=len(edges))
    other_way = np.bincount(which.ravel()[~forward], minlength=len(edges))
    used = np.unique(triangles)
    label = connected(len(vertices), edges[:, 0], edges[:, 1])[used]
    low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
    return TriangleMeasures(
        triangles=len(triangles),
        vertices=len(used),
        closed=bool(np.all(one_way == other_way)),
        manifold=bool(np.all((one_way == 1) & (other_way == 1))),
        open_edges=int(np.sum(one_way != other_way)),
        pieces=len(np.unique(label)),
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        volume=float(np.sum(a * twice) / 6),
        area=float(np.sum(np.linalg.norm(twice, axis=1)) / 2),
    )

"""Triangles as binary STL, written as they are made, so that memory does not grow with the file.

The format (3D Systems, 1989): 80 bytes of header, the number of triangles, then 50 bytes for each: normal and three
corners as single-precision numbers, and two bytes of attributes, all little-endian.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.files import replacing
from gyroid_cad.mesh.corners import Corners, FaceGroup, face_groups, side_groups
from gyroid_cad.mesh.triangulation import Triangulation
from gyroid_cad.stages import Progress, tell

__all__ = ["write_stl"]

Singles = NDArray[np.float32]
Integers = NDArray[np.int64]

_RECORD = np.dtype([("normal", "V12"), ("corners", "V36"), ("attributes", "<u2")])
_CORNER = np.dtype("V12")
_HEADER = b"gyroid_cad, millimetres".ljust(80)
# The count of triangles has 32 bits.
MOST_TRIANGLES = 2**32 - 1
# So few that records and corners stay in the processor's cache.
_TRIANGLES_AT_ONCE = 20_000


def write_stl(
    triangulation: Triangulation,
    path: str | os.PathLike[str],
    progress: Progress | None = None,
    stage: str = "write",
) -> None:
    """Write triangles as binary STL, in millimetres.

    Triangles that share an edge have the same coordinates to the last bit.

    Parameters
    ----------
    triangulation : Triangulation
    path : path-like
    progress : callable, optional
        Called with (stage, triangles written, all of them).
    stage : str

    Raises
    ------
    ParameterError
        If there are more triangles than the format can count.
    ExportError
    """
    total = triangulation.triangle_count
    if total > MOST_TRIANGLES:
        raise ParameterError("output", str(path), f"at most {MOST_TRIANGLES:,} triangles in STL; these are {total:,}")
    tell(progress, stage, 0, total)
    with replacing(path) as temporary, temporary.open("wb") as file, ThreadPoolExecutor(1) as writer:
        file.write(_HEADER + np.uint32(total).astype("<u4").tobytes())
        written, pending = 0, None
        for records in _records(triangulation):
            # The disk takes one portion while the next is made.
            if pending is not None:
                pending.result()
            pending = writer.submit(file.write, records.data)
            written += len(records)
            tell(progress, stage, written, total)
        if pending is not None:
            pending.result()


def _records(triangulation: Triangulation) -> Iterator[NDArray[np.void]]:
    """Records of all triangles in portions; each may be overwritten by the next but one."""
    corners = Corners(triangulation)
    for group in face_groups(triangulation):
        yield from _of_faces(corners, group)
    for template, edges in side_groups(triangulation):
        steps = len(template.places) // (triangulation.across + 1) - 1
        for some in _portions(edges, len(template.triangles)):
            placed = corners.of_side_walls(some, steps)
            records = np.zeros(len(some) * len(template.triangles), _RECORD)
            gathered = _gathered(placed, template.triangles)
            records["normal"] = _normals(gathered).view(_CORNER)[:, 0]
            records["corners"] = gathered.reshape(-1, 9).view("V36")[:, 0]
            yield records


def _of_faces(corners: Corners, group: FaceGroup) -> Iterator[NDArray[np.void]]:
    triangles, placed = group.triangles, corners.of_faces(group)
    # Two in turn: one is filled while the other is written.
    buffers: list[NDArray[np.void]] = []
    space = None
    for number, some in enumerate(_portions(group.patches, len(triangles))):
        space = _gathered(placed(some), triangles, space)
        gathered = space[: len(some) * len(triangles)]
        if number < 2:
            buffers.append(np.zeros(len(gathered), _RECORD))
            if group.alike:
                # Translations leave normals as they are: worked out once, they stay in place.
                once = _normals(gathered[: len(triangles)]).view(_CORNER)[:, 0]
                buffers[number]["normal"].reshape(len(some), -1)[:] = once
        records = buffers[number % 2][: len(gathered)]
        if not group.alike:
            records["normal"] = _normals(gathered).view(_CORNER)[:, 0]
        records["corners"] = gathered.reshape(-1, 9).view("V36")[:, 0]
        yield records


def _gathered(corners: Singles, triangles: Integers, space: Singles | None = None) -> Singles:
    """The three corners of each triangle of each surface, in the first of a space if one is given.

    Returns
    -------
    ndarray of float32, shape (surfaces triangles or more, 3, 3)
    """
    places = corners.reshape(len(corners), -1).view(_CORNER)
    if space is None:
        space = np.empty((places.shape[0] * len(triangles), 3, 3), dtype=np.float32)
    out = space.reshape(-1, 9)[: len(places) * len(triangles)].view(_CORNER).reshape(len(places), -1)
    # Numbers are sound: told so, numpy writes straight into the space.
    places.take(triangles.ravel(), axis=1, out=out, mode="clip")
    return space


def _normals(gathered: Singles) -> Singles:
    """Unit normals of triangles, by the right-hand rule; shape (triangles, 3)."""
    a, b, c = np.ascontiguousarray(gathered.transpose(1, 2, 0))
    b, c = b - a, c - a
    normals = np.stack([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    length = np.sqrt(np.sum(normals**2, axis=0))
    normals /= np.maximum(length, np.finfo(np.float32).tiny)
    return np.ascontiguousarray(normals.T)


def _portions(members: Integers, triangles_each: int) -> Iterator[Integers]:
    size = max(1, _TRIANGLES_AT_ONCE // triangles_each)
    return (members[first : first + size] for first in range(0, len(members), size))

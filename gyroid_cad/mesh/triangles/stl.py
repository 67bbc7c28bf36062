"""Triangles as binary STL, written as they are made, so that memory does not grow with the file.

The format (3D Systems, 1989): 80 bytes of header, the number of triangles, then 50 bytes for each: normal and three
corners as single-precision numbers, and two bytes of attributes, all little-endian.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.files import replacing
from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.triangles.corners import Corners, FaceGroup, face_groups, side_groups
from gyroid_cad.mesh.triangles.triangulation import Triangulation

__all__ = ["STL_HEADER", "is_coarse", "require_near_origin", "write_stl"]

Singles = NDArray[np.float32]
# Four single-precision numbers each, handed about as one.
Sixteens = NDArray[np.complex128]
Integers = NDArray[np.int64]

_TWELVE_BYTES, _SIXTEEN_BYTES = np.dtype("V12"), np.dtype(np.complex128)
_RECORD = np.dtype([("normal", _TWELVE_BYTES), ("corners", "V36"), ("attributes", "<u2")])
# The same records, for corners of sixteen bytes: what is one too many is overwritten by the next corner.
_OVERLAPPING = np.dtype(
    {
        "names": ["first", "second", "third"],
        "formats": [_SIXTEEN_BYTES, _SIXTEEN_BYTES, _TWELVE_BYTES],
        "offsets": [12, 24, 36],
        "itemsize": _RECORD.itemsize,
    }
)
_FIRST_TWELVE = np.dtype({"names": ["corner"], "formats": [_TWELVE_BYTES], "offsets": [0], "itemsize": 16})
STL_HEADER = b"gyroid_cad, millimetres".ljust(80)
# The count of triangles has 32 bits.
MOST_TRIANGLES = 2**32 - 1
# Numbers of single precision may be so far apart where a part stands, in deviations of its triangles; and a deviation
# counts for no more than this part of the part's size.
_ROUNDED, _COARSE = 0.25, 1e-3
# So few that records and corners stay in the processor's cache.
_TRIANGLES_AT_ONCE = 20_000
_FLUSHED_BYTES = 16_000_000


def write_stl(
    triangulation: Triangulation,
    path: str | os.PathLike[str],
    progress: Progress | None = None,
    stage: str = "write",
) -> None:
    """Write triangles as binary STL, in millimetres.

    Triangles that share an edge have the same coordinates to the last bit. Single precision rounds them to about 1e-7
    of the lattice's size, which the deviation does not count.

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
    report_progress(progress, stage, 0, total)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(STL_HEADER + np.uint32(total).astype("<u4").tobytes())
        written = flushed = 0
        for records in _records(triangulation):
            file.write(records.data)
            written += len(records)
            if (written - flushed) * _RECORD.itemsize > _FLUSHED_BYTES:
                _start_writing(file.fileno())
                flushed = written
            report_progress(progress, stage, written, total)


def _start_writing(file: int) -> None:
    """Let the disk begin with what was written, so that synchronising at the end takes less; where that is possible."""
    if hasattr(os, "posix_fadvise"):
        os.posix_fadvise(file, 0, 0, os.POSIX_FADV_DONTNEED)


def require_near_origin(
    path: str | os.PathLike[str], corners: Sequence[ArrayLike] | NDArray[np.floating], deviation: float
) -> None:
    """Refuse triangles so far from the origin that their corners, rounded to single precision, would cross.

    What rounding is due to the size of the part is left to it.

    Parameters
    ----------
    path : path-like
        Of an STL or 3MF file.
    corners : array_like, shape (2, 3)
        Lowest and highest corner of the box round the part, in mm.
    deviation : float
        Of the triangles from the part, in mm.

    Raises
    ------
    ParameterError
    """
    box = np.asarray(corners, dtype=float)
    size, reach = float(np.linalg.norm(box[1] - box[0])), float(np.abs(box).max())
    if not is_coarse(reach, size, deviation):
        return
    most = max(size, _rounding_allowed(size, deviation) / float(np.finfo(np.float32).eps))
    raise ParameterError(
        "output",
        str(path),
        f"STEP or BREP, or a part within about {most:.2g} mm of the origin: numbers of single precision, as STL and "
        f"3MF have them, are {float(np.spacing(np.float32(reach))):.2g} mm apart where this one is, {reach:.3g} mm off",
    )


def is_coarse(reach: float, size: float, deviation: float) -> bool:
    """Tell whether single precision is too coarse for triangles of a part, for where it stands and not for its size.

    Parameters
    ----------
    reach : float
        Largest coordinate, in mm.
    size : float
        Of the part, in mm.
    deviation : float
        Of the triangles from the part, in mm.
    """
    return reach > size and float(np.spacing(np.float32(reach))) > _rounding_allowed(size, deviation)


def _rounding_allowed(size: float, deviation: float) -> float:
    return max(_ROUNDED * min(deviation, _COARSE * size), float(np.spacing(np.float32(size))))


class _Space:
    """Memory for one portion, used again and again: fresh memory would cost as much time as filling it."""

    def __init__(self) -> None:
        self._records = np.zeros(0, _RECORD)
        self._corners = np.empty((3, 0), dtype=_SIXTEEN_BYTES)

    def records(self, count: int) -> NDArray[np.void]:
        """Buffer of so many records, with what was left in them."""
        if len(self._records) < count:
            self._records = np.zeros(count, _RECORD)
        return self._records[:count]

    def gathered(self, corners: Singles, triangles: Integers) -> Sixteens:
        """First, second and third corners of all triangles of all surfaces; shape (3, surfaces triangles)."""
        places = corners.reshape(len(corners), -1).view(_SIXTEEN_BYTES)
        count = len(places) * len(triangles)
        if self._corners.shape[1] < count:
            self._corners = np.empty((3, count), dtype=_SIXTEEN_BYTES)
        space = self._corners[:, :count]
        for k in range(3):
            # Numbers are sound: told so, numpy writes straight into the space.
            places.take(triangles[:, k], axis=1, out=space[k].reshape(len(places), -1), mode="clip")
        return space


def _records(triangulation: Triangulation) -> Iterator[NDArray[np.void]]:
    """Records of all triangles in portions; each is overwritten by the next."""
    corners, space = Corners(triangulation), _Space()
    for group in face_groups(triangulation):
        yield from _of_faces(corners, group, space)
    for template, edges in side_groups(triangulation):
        steps = len(template.places) // (triangulation.across + 1) - 1
        for some in _portions(edges, len(template.triangles)):
            gathered = space.gathered(corners.of_side_walls(some, steps), template.triangles)
            yield _filled(space, gathered, _normals(gathered))


def _of_faces(corners: Corners, group: FaceGroup, space: _Space) -> Iterator[NDArray[np.void]]:
    triangles, placed = np.asfortranarray(group.triangles), corners.of_faces(group)
    for number, some in enumerate(_portions(group.patches, len(triangles))):
        gathered = space.gathered(placed(some), triangles)
        if not group.alike:
            yield _filled(space, gathered, _normals(gathered))
        else:
            # Translations leave normals as they are: worked out once, they stay in the records.
            yield _filled(space, gathered, _normals(gathered[:, : len(triangles)]) if number == 0 else None)


def _filled(space: _Space, gathered: Sixteens, normals: Singles | None) -> NDArray[np.void]:
    """Records of triangles, with normals again and again for every surface, or with those that are there."""
    records = space.records(gathered.shape[1])
    if normals is not None:
        records["normal"].reshape(-1, len(normals))[:] = normals.view(_TWELVE_BYTES)[:, 0]
    overlapping = records.view(_OVERLAPPING)
    overlapping["first"], overlapping["second"] = gathered[0], gathered[1]
    overlapping["third"] = gathered[2].view(_FIRST_TWELVE)["corner"]
    return records


def _normals(gathered: Sixteens) -> Singles:
    """Unit normals of triangles, by the right-hand rule; shape (triangles, 3)."""
    a, b, c = (np.ascontiguousarray(corner.view(np.float32).reshape(-1, 4)[:, :3].T) for corner in gathered)
    b, c = b - a, c - a
    normals = np.stack([b[1] * c[2] - b[2] * c[1], b[2] * c[0] - b[0] * c[2], b[0] * c[1] - b[1] * c[0]])
    length = np.sqrt(np.sum(normals**2, axis=0))
    normals /= np.maximum(length, np.finfo(np.float32).tiny)
    return np.ascontiguousarray(normals.T)


def _portions(members: Integers, triangles_each: int) -> Iterator[Integers]:
    size = max(1, _TRIANGLES_AT_ONCE // triangles_each)
    return (members[first : first + size] for first in range(0, len(members), size))

"""Triangles of a solid as binary STL or as arrays, by the kernel's mesher where ours do not close."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from math import radians
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.StlAPI import StlAPI_Writer
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.formats import DEFAULT_ANGLE, require_meshing
from gyroid_cad.errors import ExportError, KernelError, ParameterError
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_face
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.outlines import face_triangles
from gyroid_cad.kernel.surfaces import translation
from gyroid_cad.mesh.triangles.files import binary_stl_corners, numbered_corners, renumbered
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.mesh.triangles.stl import is_coarse
from gyroid_cad.mesh.triangles.storing import storable_triangles
from gyroid_cad.mesh.triangles.writing import write_triangles

__all__ = [
    "BodyTriangles",
    "closed_triangles",
    "diagonal",
    "meshed",
    "meshed_by_face",
    "solid_triangles",
    "triangles_of_bodies",
    "write_meshed_stl",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
# Vertices, triangles, and the face of each triangle.
Body = tuple[Floats, Integers, Integers]

# Parts of the deviation that the kernel's mesher is asked for, one after the other, until its mesh is closed.
_FINER = (1.0, 0.5, 0.2, 0.05)


def write_meshed_stl(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> None:
    """Write the triangles of a solid as binary STL, in millimetres: those of :func:`closed_triangles`.

    Raises
    ------
    ParameterError, ExportError
    """
    write_triangles(*closed_triangles(shape, path, deviation, angle), path)


def closed_triangles(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[Floats, Integers]:
    """Triangles of a shape that are closed, and stay so when a file knows nothing but coordinates.

    Solids are closed one by one; where they, or a solid and itself, touch, vertices are moved apart by some steps of
    single precision. Nothing that stays open is given.

    Parameters
    ----------
    shape : TopoDS_Shape
        Left without triangles.
    path : path-like
        Named where it can't be written.
    deviation : float
        Largest distance of a facet from the surface, in mm.
    angle : float
        Largest angle between neighbouring facets, in degrees.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)

    Raises
    ------
    ParameterError, ExportError
    """
    near, away = _near_origin(shape, deviation)
    vertices, triangles, _ = _together(_bodies(near, path, deviation, angle))
    try:
        vertices, triangles = storable_triangles(vertices, triangles)
    except ExportError:
        raise _left_open(path, renumbered(vertices.astype(np.float32), triangles)[1], deviation) from None
    return vertices + away, triangles


def _left_open(path: str | os.PathLike[str], triangles: NDArray[np.integer], deviation: float) -> ExportError:
    return ExportError(
        f"{path} was not written: with deviation = {deviation:g} mm {unmatched_edges(triangles)} edges are not shared "
        "by two triangles; another deviation may do, and a part filled by --route triangles is closed whatever it is"
    )


def meshed(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[Floats, Integers]:
    """Triangles of a shape as :func:`closed_triangles` makes them; of one that stays open as they are.

    Raises
    ------
    ParameterError, ExportError
    """
    near, away = _near_origin(shape, deviation)
    vertices, triangles, _ = _together(_bodies(near, path, deviation, angle))
    if not unmatched_edges(triangles):
        with suppress(ExportError):
            vertices, triangles = storable_triangles(vertices, triangles)
    return vertices + away, triangles


def meshed_by_face(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[Floats, Integers, Integers]:
    """Triangles of a shape, and the face that each lies on, as ``TopExp_Explorer`` counts faces.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm; each body has its own.
    triangles : ndarray of int, shape (triangles, 3)
    faces : ndarray of int, shape (triangles,)

    Raises
    ------
    ParameterError, ExportError
    """
    near, away = _near_origin(shape, deviation)
    vertices, triangles, faces = _together(_bodies(near, path, deviation, angle))
    return vertices + away, triangles, faces


def solid_triangles(shape: TopoDS_Shape, deviation: float) -> list[tuple[Floats, Integers, Integers]]:
    """Triangles of each solid of a shape.

    A solid that stays open comes as it is: who takes it may repair or refuse it.

    Parameters
    ----------
    shape : TopoDS_Shape
    deviation : float
        Of the triangles from the faces, in mm.

    Returns
    -------
    list of (vertices, triangles, faces)
        In mm, shape (vertices, 3); numbers of vertices, counterclockwise seen from outside, shape (triangles, 3); and
        the face of each triangle, counted through all solids, shape (triangles,).

    Raises
    ------
    ParameterError
        If there is no solid.
    """
    solids = list(parts_of(shape, TopAbs_SOLID))
    if not solids:
        kind = shape.ShapeType().name.removeprefix("TopAbs_").lower()
        raise ParameterError("part", kind, "a closed solid: there is none in it")
    near, away = _near_origin(compound_of(solids), deviation)
    return [
        (vertices + away, triangles, faces)
        for vertices, triangles, faces in _bodies(near, "part", deviation, DEFAULT_ANGLE)
    ]


@dataclass(frozen=True, slots=True, eq=False)
class BodyTriangles:
    """Triangles of bodies that share faces: of each face once.

    Attributes
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        As the face's first use has them, counterclockwise seen from outside.
    faces : ndarray of int, shape (triangles,)
        That they lie on.
    uses : tuple of (face, turned)
        Of all bodies, as the kernel counts faces.
    """

    vertices: Floats
    triangles: Integers
    faces: Integers
    uses: tuple[tuple[int, bool], ...]

    def first_uses(self) -> list[int]:
        """Numbers of the uses that are each the first of its face."""
        first: dict[int, int] = {}
        for number, (face, _) in enumerate(self.uses):
            first.setdefault(face, number)
        return list(first.values())

    def of(self, uses: Sequence[int]) -> tuple[Integers, Integers]:
        """Triangles of some uses of faces, turned as those have them, and the use of each."""
        order = np.argsort(self.faces, kind="stable")
        bounds = np.searchsorted(self.faces[order], np.arange(1 + max(face for face, _ in self.uses) + 1))
        made, numbers = [np.empty((0, 3), dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for use in uses:
            face, turned = self.uses[use]
            own = self.triangles[order[bounds[face] : bounds[face + 1]]]
            made.append(own[:, ::-1] if turned else own)
            numbers.append(np.full(len(own), use))
        return np.concatenate(made), np.concatenate(numbers)


def triangles_of_bodies(
    bodies: Iterable[TopoDS_Shape], path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> BodyTriangles:
    """Triangles of bodies that share faces and edges, so that they close each of the bodies.

    Parameters
    ----------
    bodies : iterable of TopoDS_Shape
    path : path-like
        Named where it can't be written.
    deviation, angle : float
        As of :func:`closed_triangles`.

    Raises
    ------
    ParameterError, ExportError
    """
    require_meshing(deviation, angle)
    solids = [solid for body in bodies for solid in parts_of(body, TopAbs_SOLID)]
    known, ends = NumberedShapes(), [0]
    faces: list[TopoDS_Face] = []
    uses: list[tuple[int, bool]] = []
    for solid in solids:
        for face in map(as_face, parts_of(solid, TopAbs_FACE)):
            number = int(known.Add(face)) - 1
            if number == len(faces):
                faces.append(face)
            uses.append((number, face.Orientation() != faces[number].Orientation()))
        ends.append(len(uses))
    own = [range(*some) for some in pairwise(ends)]
    for meshed_faces in _ways_to_mesh(faces, path, deviation, angle):
        made = BodyTriangles(*meshed_faces, tuple(uses))
        if not any(unmatched_edges(made.of(some)[0]) for some in own):
            return made
    left_open = next(triangles for some in own if unmatched_edges(triangles := made.of(some)[0]))
    raise _left_open(path, left_open, deviation)


def _ways_to_mesh(
    faces: Sequence[TopoDS_Face], path: str | os.PathLike[str], deviation: float, angle: float
) -> Iterator[Body]:
    """Triangles of faces by our mesher, and by the kernel's, ever finer."""
    with suppress(KernelError):
        made = face_triangles(faces, deviation, radians(angle))
        yield made.vertices, made.triangles, made.faces
    for finer in _FINER:
        yield _by_kernel(compound_of(faces), path, deviation * finer, angle)


def _together(bodies: Sequence[Body]) -> Body:
    """Triangles of several bodies as one list."""
    starts = np.cumsum([0, *(len(vertices) for vertices, _, _ in bodies)])
    return (
        np.concatenate([np.empty((0, 3)), *(vertices for vertices, _, _ in bodies)]),
        np.concatenate(
            [np.empty((0, 3), np.int64), *(own + start for (_, own, _), start in zip(bodies, starts[:-1], strict=True))]
        ),
        np.concatenate([np.empty(0, np.int64), *(faces for _, _, faces in bodies)]),
    )


def _bodies(shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float) -> list[Body]:
    """Triangles of each solid of a shape; of one with faces besides, of all together."""
    require_meshing(deviation, angle)
    count = sum(1 for _ in parts_of(shape, TopAbs_FACE))
    solids = list(parts_of(shape, TopAbs_SOLID))
    counts = [sum(1 for _ in parts_of(solid, TopAbs_FACE)) for solid in solids]
    bodies, before = [], 0
    for body, own in zip(solids, counts, strict=True) if sum(counts) == count else [(shape, count)]:
        vertices, triangles, faces = _body(body, path, deviation, angle)
        bodies.append((vertices, triangles, faces + before))
        before += own
    return bodies


def _body(shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float) -> Body:
    """Triangles of the faces of a shape, by the kernel's mesher where ours are refused or do not close."""
    faces = [as_face(face) for face in parts_of(shape, TopAbs_FACE)]
    with suppress(KernelError):
        made = face_triangles(faces, deviation, radians(angle))
        if not unmatched_edges(made.triangles):
            return made.vertices, made.triangles, made.faces
    for finer in _FINER:
        found = _by_kernel(shape, path, deviation * finer, angle)
        if not unmatched_edges(found[1]):
            break
    return found


def _by_kernel(shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float) -> Body:
    """Triangles of the kernel's mesher (``BRepMesh_IncrementalMesh``).

    They go through an STL file of their own, which takes the kernel far less time than being asked for every node from
    Python. Corners are the same where their coordinates are, to the last bit, as in any STL.
    """
    copy = _meshed_copy(shape, path, deviation, angle)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "triangles.stl"
        writer = StlAPI_Writer()
        writer.ASCIIMode = False
        if not writer.Write(copy, str(file)):
            raise ExportError(f"{path} was not written: the kernel's STL writer failed")
        vertices, triangles, kept = numbered_corners(binary_stl_corners(file))
    # The kernel writes them face by face.
    counts = [_triangle_count(face) for face in parts_of(copy, TopAbs_FACE)]
    faces = np.repeat(np.arange(len(counts)), counts)[kept]
    return vertices.astype(np.float64), triangles, faces


def _near_origin(shape: TopoDS_Shape, deviation: float) -> tuple[TopoDS_Shape, Floats]:
    """A shape, moved to the origin if it stands too far off for single precision, and by how much it was moved."""
    low, high = corners_of(box_round([shape]))
    if not is_coarse(float(np.abs([low, high]).max()), float(np.linalg.norm(high - low)), deviation):
        return shape, np.zeros(3)
    middle = np.asarray(low + high) / 2
    return shape.Moved(translation((-middle).tolist())), middle


def _triangle_count(face: TopoDS_Shape) -> int:
    mesh = BRep_Tool.Triangulation_s(as_face(face), TopLoc_Location())
    return 0 if mesh is None else int(mesh.NbTriangles())


def diagonal(shape: TopoDS_Shape) -> float:
    """Diagonal of the box round a shape, a little longer than need be, in mm."""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    return float(box.CornerMin().Distance(box.CornerMax()))


def _meshed_copy(shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float) -> TopoDS_Shape:
    require_meshing(deviation, angle)
    copy = BRepBuilderAPI_Copy(shape, False, False).Shape()
    mesher = BRepMesh_IncrementalMesh(copy, deviation, False, radians(angle), True)
    if not mesher.IsDone():
        raise ExportError(f"{path} was not written: the kernel's mesher failed")
    return copy

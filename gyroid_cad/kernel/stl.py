"""Triangles of a solid by the kernel's mesher, as binary STL or as arrays."""

from __future__ import annotations

import os
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
from OCP.gp import gp_Trsf, gp_Vec
from OCP.Poly import Poly_Triangulation
from OCP.StlAPI import StlAPI_Writer
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import DEFAULT_ANGLE, require_meshing
from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import ShapesOfShape, as_face, as_vertex
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.solid import TOLERANCE
from gyroid_cad.kernel.surfaces import translation
from gyroid_cad.mesh.triangles.files import binary_stl_corners, keep_facets, numbered_corners
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.mesh.triangles.stl import is_coarse
from gyroid_cad.mesh.triangles.triangulation import parting

__all__ = ["closed_triangles", "diagonal", "meshed", "meshed_by_face", "solid_triangles", "write_meshed_stl"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Parts of the deviation that are tried one after the other, until the mesh is closed.
_FINER = (1.0, 0.5, 0.2, 0.05)


def write_meshed_stl(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> None:
    """Mesh a solid (``BRepMesh_IncrementalMesh``) and write it as binary STL, in millimetres.

    STL knows nothing but coordinates: where the solid touches itself in a line, four triangles would share an
    edge. There the vertices, which are distinct in the solid, are moved apart by a thousandth of the deviation.

    What the mesher leaves open is meshed again, more finely; what stays open is not written.

    Parameters
    ----------
    shape : TopoDS_Shape
        Left without triangles: a copy that shares its geometry is meshed.
    path : path-like
    deviation : float
        Largest distance of a facet from the surface, in mm.
    angle : float
        Largest angle between neighbouring facets, in degrees.

    Raises
    ------
    ParameterError, ExportError
    """
    with replacing(path) as temporary:
        for finer in _FINER:
            _write(_meshed_copy(shape, path, deviation * finer, angle), temporary, path)
            _, triangles, kept = numbered_corners(binary_stl_corners(temporary))
            if not unmatched_edges(triangles):
                break
        else:
            raise _left_open(path, triangles, deviation)
        keep_facets(temporary, kept)


def closed_triangles(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """Triangles of a solid as :func:`meshed` makes them, and more finely where those are open.

    Raises
    ------
    ParameterError, ExportError
    """
    for finer in _FINER:
        vertices, triangles = meshed(shape, path, deviation * finer, angle)
        if not unmatched_edges(triangles):
            return vertices, triangles
    raise _left_open(path, triangles, deviation)


def _left_open(path: str | os.PathLike[str], triangles: NDArray[np.integer], deviation: float) -> ExportError:
    return ExportError(
        f"{path} was not written: with deviation = {deviation:g} mm, and with less, the kernel's mesher leaves "
        f"{unmatched_edges(triangles)} edges that two triangles do not share; another deviation may do"
    )


def meshed(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
    """Triangles of a shape as arrays, for formats other than STL.

    They go through an STL file of their own, which takes the kernel far less time than being asked for every node from
    Python. Corners are the same where their coordinates are, to the last bit, as in any STL. A shape so far off that
    single precision would be too coarse there is brought near the origin for that, and the triangles back.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int32, shape (triangles, 3)

    Raises
    ------
    ParameterError, ExportError
    """
    vertices, triangles, _ = meshed_by_face(shape, path, deviation, angle)
    return vertices, triangles


def meshed_by_face(
    shape: TopoDS_Shape, path: str | os.PathLike[str], deviation: float, angle: float = DEFAULT_ANGLE
) -> tuple[NDArray[np.floating], NDArray[np.int32], NDArray[np.int64]]:
    """Triangles as :func:`meshed` makes them, and the face that each lies on, as ``TopExp_Explorer`` counts faces.

    Returns
    -------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int32, shape (triangles, 3)
    faces : ndarray of int, shape (triangles,)

    Raises
    ------
    ParameterError, ExportError
    """
    away = _brought_near(shape, deviation)
    copy = _meshed_copy(shape if away is None else shape.Moved(translation((-away).tolist())), path, deviation, angle)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "triangles.stl"
        _write(copy, file, path)
        vertices, triangles, kept = numbered_corners(binary_stl_corners(file))
    # The kernel writes them face by face.
    counts = [_triangle_count(face) for face in parts_of(copy, TopAbs_FACE)]
    faces = np.repeat(np.arange(len(counts)), counts)[kept]
    return vertices if away is None else vertices + away, triangles.astype(np.int32), faces


def solid_triangles(shape: TopoDS_Shape, deviation: float) -> list[tuple[Floats, Integers, Integers]]:
    """Triangles of each solid of a shape, meshed more finely where those of the kernel's mesher are open.

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
    found, count = [], 0
    for solid in parts_of(shape, TopAbs_SOLID):
        for finer in _FINER:
            vertices, triangles, faces = meshed_by_face(solid, "part", deviation * finer)
            if not unmatched_edges(triangles):
                break
        found.append((np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64), faces + count))
        count += sum(1 for _ in parts_of(solid, TopAbs_FACE))
    if not found:
        kind = shape.ShapeType().name.removeprefix("TopAbs_").lower()
        raise ParameterError("part", kind, "a closed solid: there is none in it")
    return found


def _brought_near(shape: TopoDS_Shape, deviation: float) -> Floats | None:
    """Middle of a shape that stands too far off for single precision; None of one that does not."""
    low, high = corners_of(box_round([shape]))
    if not is_coarse(float(np.abs([low, high]).max()), float(np.linalg.norm(high - low)), deviation):
        return None
    return np.asarray(low + high) / 2


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
    _part_touching_vertices(copy, deviation)
    return copy


def _write(meshed_shape: TopoDS_Shape, file: Path, path: str | os.PathLike[str]) -> None:
    writer = StlAPI_Writer()
    writer.ASCIIMode = False
    if not writer.Write(meshed_shape, str(file)):
        raise ExportError(f"{path} was not written: the kernel's STL writer failed")


def _part_touching_vertices(shape: TopoDS_Shape, deviation: float) -> None:
    """Move mesh nodes at vertices that coincide but are not the same, each into its own faces."""
    from scipy.spatial import cKDTree

    faces_of_vertex = ShapesOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_VERTEX, TopAbs_FACE, faces_of_vertex)
    points = [BRep_Tool.Pnt_s(as_vertex(faces_of_vertex.FindKey(i))) for i in range(1, faces_of_vertex.Extent() + 1)]
    positions = np.array([(p.X(), p.Y(), p.Z()) for p in points])
    distance = parting(deviation, float(np.abs(positions).max()))
    touching = np.unique(cKDTree(positions).query_pairs(TOLERANCE, output_type="ndarray"))
    for vertex in touching.tolist():
        # A face used by two edges at the vertex is listed twice.
        faces = {face.__hash__(): as_face(face) for face in faces_of_vertex.FindFromIndex(vertex + 1)}
        meshes = [_placed_mesh(face) for face in faces.values()]
        inward = np.mean([nodes.mean(axis=0) - positions[vertex] for _, _, nodes in meshes], axis=0)
        step = gp_Vec(*(inward * (distance / np.linalg.norm(inward))).tolist())
        for mesh, placement, nodes in meshes:
            node = int(np.argmin(np.sum((nodes - positions[vertex]) ** 2, axis=1))) + 1
            moved = mesh.Node(node).Transformed(placement).Translated(step)
            mesh.SetNode(node, moved.Transformed(placement.Inverted()))


def _placed_mesh(face: TopoDS_Face) -> tuple[Poly_Triangulation, gp_Trsf, Floats]:
    """A face's triangulation, where it stands, and its nodes there; shape (nodes, 3)."""
    location = TopLoc_Location()
    mesh = BRep_Tool.Triangulation_s(face, location)
    placement = location.Transformation()
    placed = (mesh.Node(i).Transformed(placement) for i in range(1, mesh.NbNodes() + 1))
    return mesh, placement, np.array([(p.X(), p.Y(), p.Z()) for p in placed])

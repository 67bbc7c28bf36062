"""Shells and solids of faces that share their edges, and the voids in them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BOPTools import BOPTools_AlgoTools3D
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.GeomAbs import GeomAbs_Plane
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_IN, TopAbs_Orientation, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face
from gyroid_cad.kernel.extent import box_round

__all__ = ["Use", "VolumeOf", "connected_shells", "fused_solids", "inner_point", "lies_in", "solids_of", "users_of"]

VolumeOf = Callable[[TopoDS_Shape], float]

_CLASSIFYING_TOLERANCE = 1e-7
# Of the largest volume, below which a shell is small.
_TOLD = 1e-4
_BOTH_WAYS = {TopAbs_FORWARD, TopAbs_REVERSED}


def solids_of(faces: Sequence[TopoDS_Face], volume_of: VolumeOf | None = None) -> list[TopoDS_Solid]:
    """The solids that faces bound which share their edges, outer shells with the voids in them.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
        Oriented out of the solids.
    volume_of : callable, optional
        Volume within a closed shell, in mm3, negative where its faces look inwards, as those round a void do. If left
        out, the kernel is asked what lies at infinity.

    Raises
    ------
    KernelError
        If an edge is not shared by exactly two of the faces, which run through it in opposite ways.
    """
    users = users_of(faces)
    if any({use.orientation for use in uses} != _BOTH_WAYS or len(uses) != 2 for uses in users):
        raise KernelError("the pieces of the part and of the lattice do not close: an edge is not shared by two")
    shells = [_shell([faces[index] for index in group]) for group in _grouped(len(faces), users)]
    return _solids(shells, volume_of)


def fused_solids(solids: Iterable[TopoDS_Shape], volume_of: VolumeOf | None = None) -> list[TopoDS_Solid]:
    """Solids as one, where they share faces: those fall away.

    Raises
    ------
    KernelError
        If what is left does not close.
    """
    faces, numbers, times = [], NumberedShapes(), Counter[int]()
    for solid in solids:
        for face in parts_of(solid, TopAbs_FACE):
            faces.append(as_face(face))
            times[numbers.Add(face)] += 1
    return solids_of([face for face in faces if times[numbers.FindIndex(face)] == 1], volume_of)


def connected_shells(faces: Sequence[TopoDS_Face]) -> list[TopoDS_Shell]:
    """Faces in shells that are connected by edges, closed or not.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
        Oriented alike.
    """
    users = users_of(faces)
    groups = _grouped(len(faces), users)
    opened = {use.face for uses in users for use in uses if len(uses) != 2}
    return [_shell([faces[index] for index in group], opened.isdisjoint(group)) for group in groups]


@dataclass(frozen=True, slots=True)
class Use:
    """An edge, of a face by its index, the way it runs there."""

    edge: TopoDS_Edge
    face: int
    orientation: TopAbs_Orientation


def users_of(faces: Sequence[TopoDS_Face]) -> list[list[Use]]:
    """Uses of every edge that faces have, in the order in which they are met."""
    edges = NumberedShapes()
    users: list[list[Use]] = []
    for index, face in enumerate(faces):
        for edge in parts_of(face, TopAbs_EDGE):
            # At the pole of a sphere: no other face is to be found there.
            if BRep_Tool.Degenerated_s(as_edge(edge)):
                continue
            number = edges.Add(edge)
            if number > len(users):
                users.append([])
            users[number - 1].append(Use(as_edge(edge), index, edge.Orientation()))
    return users


def _grouped(count: int, users: list[list[Use]]) -> list[list[int]]:
    """Faces in groups that are connected by edges."""
    pairs = np.array([(uses[0].face, use.face) for uses in users for use in uses], dtype=np.int64).reshape(-1, 2)
    groups: dict[int, list[int]] = {}
    for face, label in enumerate(connected(count, *pairs.T).tolist()):
        groups.setdefault(label, []).append(face)
    return list(groups.values())


def _shell(faces: Iterable[TopoDS_Face], closed: bool = True) -> TopoDS_Shell:
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(closed)
    return shell


def _solids(shells: Sequence[TopoDS_Shell], volume_of: VolumeOf | None) -> list[TopoDS_Solid]:
    """Outer shells as solids, with the voids that lie in them."""
    builder = BRep_Builder()
    outer: list[TopoDS_Solid] = []
    voids: list[TopoDS_Shell] = []
    volumes = [volume_of(shell) for shell in shells] if volume_of else []
    least = _TOLD * max(volumes, default=0.0)
    for index, shell in enumerate(shells):
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        builder.Add(solid, shell)
        # Faces with coarse edges are measured no closer: of what is small the sign of its volume tells nothing.
        told = bool(volumes) and abs(volumes[index]) >= least
        if volumes[index] < 0 if told else _holds_infinity(solid):
            voids.append(shell)
        else:
            outer.append(solid)
    # Solids before voids are added: of those round a void, which lie in each other's voids, the smallest is its own.
    # The kernel's check asks of every void in which of those before it it lies: large ones answer slowly.
    voids.sort(key=lambda shell: shell.NbChildren())
    for shell, solid in [(shell, _round(shell, outer)) for shell in voids]:
        builder.Add(solid, _begun_off_planes(shell))
    return outer


def _begun_off_planes(shell: TopoDS_Shell) -> TopoDS_Shell:
    """The closed shell, its first face one whose first edge is of no plane face, if there is one.

    ``BRepCheck_Solid`` asks in which voids a point of the first edge of each lies, by a ray to a void's first face.
    Voids that a plane skin seals have faces in one plane: from a point there the ray lies in it, and errs.
    """
    faces, of_planes = [as_face(face) for face in parts_of(shell, TopAbs_FACE)], NumberedShapes()
    for face in faces:
        if BRepAdaptor_Surface(face, False).GetType() == GeomAbs_Plane:
            for edge in parts_of(face, TopAbs_EDGE):
                of_planes.Add(edge)
    first = next((place for place, face in enumerate(faces) if not of_planes.Contains(_first_edge(face))), 0)
    return _shell([*faces[first:], *faces[:first]])


def _first_edge(face: TopoDS_Face) -> TopoDS_Shape:
    return next(edge for edge in parts_of(face, TopAbs_EDGE) if not BRep_Tool.Degenerated_s(as_edge(edge)))


def _holds_infinity(solid: TopoDS_Solid) -> bool:
    classifier = BRepClass3d_SolidClassifier(solid)
    classifier.PerformInfinitePoint(_CLASSIFYING_TOLERANCE)
    return bool(classifier.State() == TopAbs_IN)


def _round(void: TopoDS_Shell, solids: Sequence[TopoDS_Solid]) -> TopoDS_Solid:
    """The smallest of the solids that a void lies in."""
    if len(solids) > 1:
        face, context = next(parts_of(void, TopAbs_FACE)), IntTools_Context()
        solids = [solid for solid in solids if lies_in(face, BRepClass3d_SolidClassifier(solid), context)]
    if not solids:
        raise KernelError("a void of the filled part lies in none of its solids")
    return solids[0] if len(solids) == 1 else min(solids, key=_extent)


def _extent(shape: TopoDS_Shape) -> float:
    return float(box_round([shape]).SquareExtent())


def lies_in(face: TopoDS_Shape, classifier: BRepClass3d_SolidClassifier, context: IntTools_Context) -> bool:
    """Tell whether a face that crosses a solid's boundary nowhere lies in it."""
    classifier.Perform(inner_point(as_face(face), context), _CLASSIFYING_TOLERANCE)
    return bool(classifier.State() == TopAbs_IN)


def inner_point(face: TopoDS_Face, context: IntTools_Context) -> gp_Pnt:
    """A point on a face and not on its edges."""
    place, parameters = gp_Pnt(), gp_Pnt2d()
    BOPTools_AlgoTools3D.PointInFace_s(face, place, parameters, context)
    return place

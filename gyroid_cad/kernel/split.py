"""A part and the faces of a lattice, split where they cross; and the solid that some of the pieces bound.

``BOPAlgo_Builder``, the kernel's general fuse, finds the crossings and shares the edges there. Which pieces bound
what is wanted is decided here: pieces of the lattice's faces that lie in the part, and those pieces of the part's
boundary that lie on the inner side of the faces they meet. Nothing is sewn: faces that were never cut keep their
edges, and join the cut ones by them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BOPAlgo import BOPAlgo_Builder
from OCP.BOPTools import BOPTools_AlgoTools3D
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_IN,
    TopAbs_Orientation,
    TopAbs_REVERSED,
    TopAbs_VERTEX,
)
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid
from OCP.TopTools import TopTools_IndexedMapOfShape

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.part import Part

__all__ = ["Pieces", "bounded_solids", "compound_of", "split"]

Floats = NDArray[np.float64]

_CLASSIFYING_TOLERANCE = 1e-7
_BOTH_WAYS = {TopAbs_FORWARD, TopAbs_REVERSED}


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """What is left of a part and of faces that were split against each other.

    Attributes
    ----------
    inside : tuple of TopoDS_Face
        Pieces of the faces that lie in the part, oriented as the faces were.
    boundary : tuple of TopoDS_Face
        Pieces of the part's boundary, oriented outwards.
    """

    inside: tuple[TopoDS_Face, ...]
    boundary: tuple[TopoDS_Face, ...]


def split(part: Part, faces: Sequence[TopoDS_Shape]) -> Pieces:
    """Split a part's boundary and faces where they cross.

    Parameters
    ----------
    part : Part
    faces : sequence of TopoDS_Shape
        Faces that share their edges.

    Raises
    ------
    KernelError
        If the kernel fails.
    """
    boundary = [TopoDS.Face_s(face) for face in parts_of(part.shape, TopAbs_FACE)]
    if not faces:
        return Pieces((), tuple(boundary))
    fuse = BOPAlgo_Builder()
    fuse.SetNonDestructive(True)
    fuse.AddArgument(part.shape)
    # As one argument: the kernel then takes it for granted that the faces cross nowhere themselves.
    fuse.AddArgument(compound_of(faces))
    fuse.Perform()
    if fuse.HasErrors():
        raise KernelError(f"the kernel could not split the part against {len(faces)} faces of the lattice")
    context = IntTools_Context()
    classifiers = [BRepClass3d_SolidClassifier(solid) for solid in part.solids]
    inside = [
        piece
        for face in faces
        for piece in _images(fuse, face)
        if any(_lies_in(piece, classifier, context) for classifier in classifiers)
    ]
    return Pieces(tuple(inside), tuple(piece for face in boundary for piece in _images(fuse, face)))


def bounded_solids(
    pieces: Pieces, whole: Iterable[TopoDS_Shape], wanted_at: Callable[[Floats], bool]
) -> list[TopoDS_Solid]:
    """The solids bounded by faces of the lattice and by those pieces of the part's boundary on their inner side.

    Parameters
    ----------
    pieces : Pieces
        Lattice faces oriented out of the solid wanted.
    whole : iterable of TopoDS_Shape
        Faces that lie in the part uncut, oriented likewise.
    wanted_at : callable
        Whether a point, shape (3,), on the part's boundary belongs to the solid wanted: asked only of pieces of the
        boundary that hang together with none that the lattice meets.

    Returns
    -------
    list of TopoDS_Solid

    Raises
    ------
    KernelError
        If the faces do not close, or do not agree on what is inside.
    """
    faces = [*pieces.inside, *map(TopoDS.Face_s, whole), *_inner_boundary(pieces, wanted_at)]
    users = _users(faces)
    if any({use.orientation for use in uses} != _BOTH_WAYS or len(uses) != 2 for uses in users):
        raise KernelError("the pieces of the part and of the lattice do not close: an edge is not shared by two")
    shells = [_shell([faces[index] for index in group]) for group in _connected(len(faces), users)]
    return _solids(shells)


def compound_of(shapes: Iterable[TopoDS_Shape]) -> TopoDS_Compound:
    """The shapes in one compound."""
    builder, compound = BRep_Builder(), TopoDS_Compound()
    builder.MakeCompound(compound)
    for shape in shapes:
        builder.Add(compound, shape)
    return compound


@dataclass(frozen=True, slots=True)
class _Use:
    """A face, by its index, that an edge bounds, and how."""

    face: int
    orientation: TopAbs_Orientation


def _inner_boundary(pieces: Pieces, wanted_at: Callable[[Floats], bool]) -> list[TopoDS_Face]:
    """Pieces of the part's boundary on the inner side of the lattice faces they meet.

    Two faces of a solid run through their common edge in opposite ways: so a piece of the boundary is wanted if it
    runs against the lattice face along the edge they share. Across the part's own edges nothing changes.
    """
    count = len(pieces.inside)
    wanted: dict[int, bool] = {}
    beside: dict[int, set[int]] = {}
    for uses in _users([*pieces.inside, *pieces.boundary]):
        cuts = [use for use in uses if use.face < count]
        borders = [use for use in uses if use.face >= count]
        if len(cuts) == 1:
            for use in borders:
                _decide(wanted, use.face, use.orientation != cuts[0].orientation)
        elif not cuts:
            for use in borders:
                beside.setdefault(use.face, set()).update(other.face for other in borders)
    _spread(wanted, list(wanted), beside)
    for index, piece in enumerate(pieces.boundary, count):
        if index not in wanted:
            wanted[index] = wanted_at(_place_on(piece))
            _spread(wanted, [index], beside)
    return [piece for index, piece in enumerate(pieces.boundary, count) if wanted.get(index)]


def _spread(wanted: dict[int, bool], reached: list[int], beside: dict[int, set[int]]) -> None:
    """Carry what was decided of some faces on to those beside them."""
    while reached:
        face = reached.pop()
        for other in beside.get(face, ()):
            if other not in wanted:
                reached.append(other)
            _decide(wanted, other, wanted[face])


def _decide(wanted: dict[int, bool], face: int, inner: bool) -> None:
    if wanted.setdefault(face, inner) != inner:
        raise KernelError("the pieces of the lattice do not agree on which pieces of the part lie inside")


def _users(faces: Sequence[TopoDS_Face]) -> list[list[_Use]]:
    """For every edge, the faces it bounds."""
    edges = TopTools_IndexedMapOfShape()
    users: list[list[_Use]] = []
    for index, face in enumerate(faces):
        for edge in parts_of(face, TopAbs_EDGE):
            # At the pole of a sphere: no other face is to be found there.
            if BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge)):
                continue
            number = edges.Add(edge)
            if number > len(users):
                users.append([])
            users[number - 1].append(_Use(index, edge.Orientation()))
    return users


def _connected(count: int, users: list[list[_Use]]) -> list[list[int]]:
    """Faces in groups that hang together by edges."""
    beside: list[set[int]] = [set() for _ in range(count)]
    for uses in users:
        for use in uses:
            beside[use.face].update(other.face for other in uses)
    groups, seen = [], [False] * count
    for start in range(count):
        if seen[start]:
            continue
        seen[start], group = True, [start]
        for face in group:
            fresh = [other for other in beside[face] if not seen[other]]
            group += fresh
            for other in fresh:
                seen[other] = True
        groups.append(group)
    return groups


def _shell(faces: Iterable[TopoDS_Face]) -> TopoDS_Shell:
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(True)
    return shell


def _solids(shells: Sequence[TopoDS_Shell]) -> list[TopoDS_Solid]:
    """Outer shells as solids, with the voids that lie in them."""
    builder = BRep_Builder()
    outer: list[tuple[TopoDS_Solid, TopoDS_Shell]] = []
    voids: list[tuple[TopoDS_Solid, TopoDS_Shell]] = []
    for shell in shells:
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        builder.Add(solid, shell)
        classifier = BRepClass3d_SolidClassifier(solid)
        classifier.PerformInfinitePoint(_CLASSIFYING_TOLERANCE)
        (voids if classifier.State() == TopAbs_IN else outer).append((solid, shell))
    for _, shell in voids:
        vertex = BRep_Tool.Pnt_s(TopoDS.Vertex_s(next(parts_of(shell, TopAbs_VERTEX))))
        for solid, _ in outer:
            classifier = BRepClass3d_SolidClassifier(solid)
            classifier.Perform(vertex, _CLASSIFYING_TOLERANCE)
            if classifier.State() == TopAbs_IN:
                builder.Add(solid, shell)
                break
        else:
            raise KernelError("a void of the filled part lies in none of its solids")
    return [solid for solid, _ in outer]


def _images(fuse: BOPAlgo_Builder, face: TopoDS_Shape) -> list[TopoDS_Face]:
    if fuse.IsDeleted(face):
        return []
    return [TopoDS.Face_s(image) for image in fuse.Modified(face)] or [TopoDS.Face_s(face)]


def _lies_in(face: TopoDS_Face, classifier: BRepClass3d_SolidClassifier, context: IntTools_Context) -> bool:
    classifier.Perform(_inner_point(face, context), _CLASSIFYING_TOLERANCE)
    return bool(classifier.State() == TopAbs_IN)


def _place_on(face: TopoDS_Face) -> Floats:
    point = _inner_point(face, IntTools_Context())
    return np.array([point.X(), point.Y(), point.Z()])


def _inner_point(face: TopoDS_Face, context: IntTools_Context) -> gp_Pnt:
    place, parameters = gp_Pnt(), gp_Pnt2d()
    BOPTools_AlgoTools3D.PointInFace_s(face, place, parameters, context)
    return place

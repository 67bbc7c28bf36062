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
from OCP.BOPTools import BOPTools_AlgoTools, BOPTools_AlgoTools3D
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
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import NumberedShapes, ShapeList, as_edge, as_face
from gyroid_cad.kernel.extent import box_round
from gyroid_cad.kernel.part import Part

__all__ = [
    "Pieces",
    "bounded_solids",
    "changes",
    "connected_shells",
    "general_fuse",
    "inner_point",
    "inner_sides",
    "lies_in",
    "modified",
    "running_like",
    "solids_of",
    "split",
]

Floats = NDArray[np.float64]
Change = tuple[TopoDS_Shape, tuple[TopoDS_Shape, ...]]

_CLASSIFYING_TOLERANCE = 1e-7
_BOTH_WAYS = {TopAbs_FORWARD, TopAbs_REVERSED}


@dataclass(frozen=True, slots=True, eq=False)
class Pieces:
    """Pieces of a part's boundary and of faces that were split against each other.

    Attributes
    ----------
    inside : tuple of TopoDS_Face
        Pieces of the faces that lie in the part, oriented as the faces were.
    boundary : tuple of TopoDS_Face
        Pieces of the part's boundary, oriented outwards.
    origins : tuple of int
        For each piece of the boundary, which face of the part it is of, as they are found in the part's shape.
    changed : tuple of (TopoDS_Shape, tuple of TopoDS_Shape)
        Edges and vertices of the part that were split or made anew, forward, and what they have become; the pieces of
        an edge run the way it does.
    """

    inside: tuple[TopoDS_Face, ...]
    boundary: tuple[TopoDS_Face, ...]
    origins: tuple[int, ...] = ()
    changed: tuple[Change, ...] = ()


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
    boundary = [as_face(face) for face in parts_of(part.shape, TopAbs_FACE)]
    if not faces:
        return Pieces((), tuple(boundary), tuple(range(len(boundary))))
    fuse = general_fuse(part.shape, compound_of(faces))
    context = IntTools_Context()
    classifiers = [BRepClass3d_SolidClassifier(solid) for solid in part.solids]
    inside = [
        piece
        for face in faces
        for piece in modified(fuse, face)
        if any(lies_in(piece, classifier, context) for classifier in classifiers)
    ]
    pieces = [(piece, index) for index, face in enumerate(boundary) for piece in modified(fuse, face)]
    return Pieces(
        tuple(as_face(piece) for piece in inside),
        tuple(as_face(piece) for piece, _ in pieces),
        tuple(index for _, index in pieces),
        changes(fuse, part.shape),
    )


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
        boundary that are connected with none that the lattice meets.

    Returns
    -------
    list of TopoDS_Solid

    Raises
    ------
    KernelError
        If the faces do not close, or do not agree on what is inside.
    """
    boundary = zip(pieces.boundary, inner_sides(pieces, wanted_at), strict=True)
    return solids_of([*pieces.inside, *map(as_face, whole), *(piece for piece, inner in boundary if inner)])


def solids_of(faces: Sequence[TopoDS_Face]) -> list[TopoDS_Solid]:
    """The solids that faces bound which share their edges, outer shells with the voids in them.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
        Oriented out of the solids.

    Raises
    ------
    KernelError
        If an edge is not shared by exactly two of the faces, which run through it in opposite ways.
    """
    users = _users(faces)
    if any({use.orientation for use in uses} != _BOTH_WAYS or len(uses) != 2 for uses in users):
        raise KernelError("the pieces of the part and of the lattice do not close: an edge is not shared by two")
    shells = [_shell([faces[index] for index in group]) for group in _grouped(len(faces), users)]
    return _solids(shells)


def connected_shells(faces: Sequence[TopoDS_Face]) -> list[TopoDS_Shell]:
    """Faces in shells that are connected by edges, closed or not.

    Parameters
    ----------
    faces : sequence of TopoDS_Face
        Oriented alike.
    """
    users = _users(faces)
    groups = _grouped(len(faces), users)
    opened = {use.face for uses in users for use in uses if len(uses) != 2}
    return [_shell([faces[index] for index in group], opened.isdisjoint(group)) for group in groups]


def inner_sides(pieces: Pieces, wanted_at: Callable[[Floats], bool]) -> list[bool]:
    """Find the pieces of the part's boundary that lie on the inner side of the lattice faces they meet.

    Two faces of a solid run through their common edge in opposite ways: so a piece of the boundary is wanted if it
    runs against the lattice face along the edge they share. Across the part's own edges nothing changes.

    Parameters
    ----------
    pieces : Pieces
    wanted_at : callable
        As of :func:`bounded_solids`.

    Returns
    -------
    list of bool
        One for each piece of the boundary.

    Raises
    ------
    KernelError
        If the faces do not agree on what is inside.
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
            point = inner_point(piece, IntTools_Context())
            wanted[index] = wanted_at(np.array([point.X(), point.Y(), point.Z()]))
            _spread(wanted, [index], beside)
    return [wanted[index] for index in range(count, count + len(pieces.boundary))]


@dataclass(frozen=True, slots=True)
class _Use:
    """A face, by its index, that an edge bounds, and how."""

    face: int
    orientation: TopAbs_Orientation


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
    edges = NumberedShapes()
    users: list[list[_Use]] = []
    for index, face in enumerate(faces):
        for edge in parts_of(face, TopAbs_EDGE):
            # At the pole of a sphere: no other face is to be found there.
            if BRep_Tool.Degenerated_s(as_edge(edge)):
                continue
            number = edges.Add(edge)
            if number > len(users):
                users.append([])
            users[number - 1].append(_Use(index, edge.Orientation()))
    return users


def _grouped(count: int, users: list[list[_Use]]) -> list[list[int]]:
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


def _solids(shells: Sequence[TopoDS_Shell]) -> list[TopoDS_Solid]:
    """Outer shells as solids, with the voids that lie in them."""
    builder, context = BRep_Builder(), IntTools_Context()
    outer: list[tuple[TopoDS_Solid, BRepClass3d_SolidClassifier]] = []
    voids: list[TopoDS_Shell] = []
    for shell in shells:
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        builder.Add(solid, shell)
        classifier = BRepClass3d_SolidClassifier(solid)
        classifier.PerformInfinitePoint(_CLASSIFYING_TOLERANCE)
        if classifier.State() == TopAbs_IN:
            voids.append(shell)
        else:
            outer.append((solid, classifier))
    # Solids before voids are added: of those round a void, which lie in each other's voids, the smallest is its own.
    round_void = [
        [solid for solid, classifier in outer if lies_in(next(parts_of(shell, TopAbs_FACE)), classifier, context)]
        for shell in voids
    ]
    for shell, solids in zip(voids, round_void, strict=True):
        if not solids:
            raise KernelError("a void of the filled part lies in none of its solids")
        builder.Add(solids[0] if len(solids) == 1 else min(solids, key=_extent), shell)
    return [solid for solid, _ in outer]


def _extent(shape: TopoDS_Shape) -> float:
    return float(box_round([shape]).SquareExtent())


def general_fuse(
    *arguments: TopoDS_Shape, fuzzy: float = 0.0, task: str = "split the part against the faces of the lattice"
) -> BOPAlgo_Builder:
    """The kernel's general fuse; within an argument it looks for no crossings.

    Parameters
    ----------
    *arguments : TopoDS_Shape
    fuzzy : float
        In mm, within which places are one.
    task : str
        That the kernel is said to have failed in.

    Raises
    ------
    KernelError
    """
    fuse = BOPAlgo_Builder()
    fuse.SetNonDestructive(True)
    fuse.SetFuzzyValue(fuzzy)
    for argument in arguments:
        fuse.AddArgument(argument)
    fuse.Perform()
    if fuse.HasErrors():
        raise KernelError(f"the kernel could not {task}")
    return fuse


def modified(fuse: BOPAlgo_Builder, shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Shapes that a shape has become in a general fuse: itself, if nothing crossed it."""
    if fuse.IsDeleted(shape):
        return []
    # Taken off one by one: to iterate over a list of the kernel's ends in an exception, a hundred times as slow.
    left = ShapeList(fuse.Modified(shape))
    found = []
    while not left.IsEmpty():
        found.append(left.First())
        left.RemoveFirst()
    return found or [shape]


def changes(fuse: BOPAlgo_Builder, shape: TopoDS_Shape) -> tuple[Change, ...]:
    """Edges and vertices of a shape that a general fuse split or made anew, as of :class:`Pieces`."""
    context = IntTools_Context()
    parts = NumberedShapes()
    for kind in (TopAbs_EDGE, TopAbs_VERTEX):
        for part in parts_of(shape, kind):
            parts.Add(part.Oriented(TopAbs_FORWARD))
    changed = []
    for number in range(1, parts.Extent() + 1):
        pieces = tuple(
            running_like(parts.FindKey(number), piece, context) for piece in fuse.Modified(parts.FindKey(number))
        )
        if pieces:
            changed.append((parts.FindKey(number), pieces))
    return tuple(changed)


def running_like(whole: TopoDS_Shape, piece: TopoDS_Shape, context: IntTools_Context) -> TopoDS_Shape:
    """The piece of an edge the way the edge runs; the kernel hands it out the way it was met first."""
    forward = piece.Oriented(TopAbs_FORWARD)
    if whole.ShapeType() != TopAbs_EDGE:
        return forward
    backwards = BOPTools_AlgoTools.IsSplitToReverse_s(as_edge(forward), as_edge(whole), context, 0)
    return forward.Reversed() if backwards else forward


def lies_in(face: TopoDS_Shape, classifier: BRepClass3d_SolidClassifier, context: IntTools_Context) -> bool:
    """Tell whether a face that crosses a solid's boundary nowhere lies in it."""
    classifier.Perform(inner_point(as_face(face), context), _CLASSIFYING_TOLERANCE)
    return bool(classifier.State() == TopAbs_IN)


def inner_point(face: TopoDS_Face, context: IntTools_Context) -> gp_Pnt:
    """A point on a face and not on its edges."""
    place, parameters = gp_Pnt(), gp_Pnt2d()
    BOPTools_AlgoTools3D.PointInFace_s(face, place, parameters, context)
    return place

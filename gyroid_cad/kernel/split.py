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
from OCP.BOPTools import BOPTools_AlgoTools
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.IntTools import IntTools_Context
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_VERTEX,
)
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import NumberedShapes, ShapeList, as_edge, as_face
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.shells import VolumeOf, inner_point, lies_in, solids_of, users_of

__all__ = [
    "Pieces",
    "bounded_solids",
    "changes",
    "general_fuse",
    "inner_sides",
    "modified",
    "parted_solids",
    "running_like",
    "split",
]

Floats = NDArray[np.float64]
Change = tuple[TopoDS_Shape, tuple[TopoDS_Shape, ...]]


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
    pieces: Pieces,
    whole: Iterable[TopoDS_Shape],
    wanted_at: Callable[[Floats], bool],
    volume_of: VolumeOf | None = None,
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
    volume_of : callable, optional
        As of :func:`~gyroid_cad.kernel.shells.solids_of`.

    Returns
    -------
    list of TopoDS_Solid

    Raises
    ------
    KernelError
        If the faces do not close, or do not agree on what is inside.
    """
    boundary = zip(pieces.boundary, inner_sides(pieces, wanted_at), strict=True)
    inner = (piece for piece, inner in boundary if inner)
    return solids_of([*pieces.inside, *map(as_face, whole), *inner], volume_of)


def parted_solids(
    pieces: Pieces,
    whole: Sequence[TopoDS_Shape],
    wanted_at: Callable[[Floats], bool],
    volume_of: VolumeOf | None = None,
) -> tuple[list[TopoDS_Solid], list[TopoDS_Solid]]:
    """The solids on either side of the faces of the lattice in the part, which share those faces.

    Arguments and errors are those of :func:`bounded_solids`.

    Returns
    -------
    within, beside : list of TopoDS_Solid
        That the faces are oriented out of, and the rest of the part.
    """
    faces = [*pieces.inside, *map(as_face, whole)]
    sides = inner_sides(pieces, wanted_at)
    within, beside = (
        [piece for piece, inner in zip(pieces.boundary, sides, strict=True) if inner == wanted]
        for wanted in (True, False)
    )
    turned = [as_face(face.Reversed()) for face in faces]
    return solids_of([*faces, *within], volume_of), solids_of([*turned, *beside], volume_of)


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
    for uses in users_of([*pieces.inside, *pieces.boundary]):
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

"""The core that a skin leaves: offset pieces, cut against each other, of which those are kept that are deep enough."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools_ReShape
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Face, TopoDS_Solid, TopoDS_Wire

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, parts_of
from gyroid_cad.kernel.compat import as_edge, as_face
from gyroid_cad.kernel.depth import Inside, NearDistances, points_on
from gyroid_cad.kernel.offset_pieces import offset_pieces
from gyroid_cad.kernel.offset_surface import curve_points
from gyroid_cad.kernel.shells import solids_of, users_of
from gyroid_cad.kernel.skin_room import shown_place
from gyroid_cad.kernel.split import Change, changes, general_fuse, modified

__all__ = ["OpenSkinError", "core_of_pieces", "with_changes"]

Floats = NDArray[np.float64]

_POINTS_ON_PIECE, _POINTS_ON_EDGE = 24, 16
# Of the thickness of a skin, by which the depth of what is kept may be less.
_OFF = 1e-3
# Share of the points on a piece that are to be as deep as the skin is thick: those near a crossing say little.
_MOST = 0.5
# Of the thickness of a skin, within which places are one: more where two tubes that meet touch before they cross.
_FUZZY = (0.0, 1e-3)
# Of the thickness of a skin, by which it is thinner or thicker where offsets touch without crossing else.
_NEARLY = (0.0, -5e-4, 5e-4)


class OpenSkinError(KernelError):
    """Failure of a skin's inner side to close.

    Parameters
    ----------
    point : ndarray, shape (3,)
        Where, in mm.
    beside : str
        What is there.
    """

    def __init__(self, point: Floats, beside: str = "") -> None:
        super().__init__(f"the inner side of the skin does not close round {shown_place(point)}{beside}")
        self.point = point


def core_of_pieces(solid: TopoDS_Solid, skin: float, openings: Sequence[TopoDS_Face] = ()) -> list[TopoDS_Solid]:
    """Offset a solid inwards by a skin, corner by corner whatever the corners are.

    Parameters
    ----------
    solid : TopoDS_Solid
    skin : float
        In mm.
    openings : sequence of TopoDS_Face
        Of its faces, to which the core comes, but for a rim as wide as the skin.

    Raises
    ------
    KernelError
        If what is kept does not close: it says where.
    """
    faces = [face for face in parts_of(solid, TopAbs_FACE) if not any(face.IsSame(opening) for opening in openings)]
    depths, inside = NearDistances(faces, skin), Inside(solid) if openings else None
    problem: KernelError | None = None
    for part in _NEARLY:
        try:
            return _core_of_pieces(solid, _Places(depths, (1 + part) * skin, inside), openings)
        except KernelError as failed:
            problem = problem or failed
    assert problem is not None
    raise problem


def _core_of_pieces(solid: TopoDS_Solid, places: _Places, openings: Sequence[TopoDS_Face]) -> list[TopoDS_Solid]:
    kept, opened = offset_pieces(solid, places.skin, openings)
    pieces: list[TopoDS_Face] = []
    deep: list[bool] = []
    for piece in kept:
        enough = places.deep(np.concatenate([points_on(piece, _POINTS_ON_PIECE), _border(piece)]))
        if enough.any():
            pieces.append(piece)
            deep.append(bool(enough.all()))
    # A piece without a neighbour may have one that was not made beside it, but only comes to it.
    lone = {uses[0].face for uses in users_of(pieces) if len(uses) == 1}
    whole = [piece for index, piece in enumerate(pieces) if deep[index] and index not in lone]
    crossing = [piece for index, piece in enumerate(pieces) if not deep[index] or index in lone]
    for fuzzy in _FUZZY[:-1]:
        with suppress(KernelError):
            return _assembled(whole, crossing, opened, places, fuzzy)
    return _assembled(whole, crossing, opened, places, _FUZZY[-1])


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Tells which places may be on a core's boundary: deep enough, and in the solid where it has openings."""

    depths: NearDistances
    skin: float
    inside: Inside | None

    def deep(self, points: Floats, opened: bool = False) -> NDArray[np.bool_]:
        found = np.asarray(self.depths(points) >= (1 - _OFF) * self.skin)
        if self.inside is not None and not opened and found.any():
            found[found] = self.inside.contains(points[found])
        return found

    def keep(self, face: TopoDS_Face, opened: bool) -> bool:
        return bool(np.mean(self.deep(points_on(face, _POINTS_ON_PIECE), opened)) > _MOST)


def _assembled(
    whole: Sequence[TopoDS_Face],
    crossing: Sequence[TopoDS_Face],
    opened: Sequence[TopoDS_Face],
    places: _Places,
    fuzzy: float,
) -> list[TopoDS_Solid]:
    """The solids that pieces bound, once those that cross are cut against each other and the openings."""
    faces = list(whole)
    if crossing or opened:
        together = [*crossing, *opened]
        fuse = general_fuse(
            *together, fuzzy=fuzzy * places.skin, task="cut the offsets of the part's faces against each other"
        )
        kept = [
            as_face(image)
            for some, is_open in ((crossing, False), (opened, True))
            for piece in some
            for image in modified(fuse, piece)
            if places.keep(as_face(image), is_open)
        ]
        faces = [*with_changes(whole, changes(fuse, compound_of(together))), *kept]
    _require_closed(faces)
    return solids_of(faces)


def _border(face: TopoDS_Face) -> Floats:
    """Points on a face's edges, shape (n, 3)."""
    edges = [as_edge(edge) for edge in parts_of(face, TopAbs_EDGE)]
    curves = [BRepAdaptor_Curve(edge) for edge in edges if not BRep_Tool.Degenerated_s(edge)]
    return np.concatenate(
        [
            np.empty((0, 3)),
            *(
                curve_points(curve, np.linspace(curve.FirstParameter(), curve.LastParameter(), _POINTS_ON_EDGE))
                for curve in curves
            ),
        ]
    )


def _require_closed(faces: Sequence[TopoDS_Face]) -> None:
    """Raise if an edge does not bound two faces, once in either direction."""
    for uses in users_of(faces):
        if len(uses) != 2 or uses[0].orientation == uses[1].orientation:
            curve = BRepAdaptor_Curve(uses[0].edge)
            middle = (curve.FirstParameter() + curve.LastParameter()) / 2
            raise OpenSkinError(curve_points(curve, np.array([middle]))[0])


def with_changes(faces: Iterable[TopoDS_Face], changed: Iterable[Change]) -> list[TopoDS_Face]:
    """The faces with the edges and vertices that have been split or made anew in place of the old ones.

    Parameters
    ----------
    faces : iterable of TopoDS_Face
    changed : iterable of (TopoDS_Shape, tuple of TopoDS_Shape)
        As of :class:`gyroid_cad.kernel.split.Pieces`.
    """
    builder, reshape = BRep_Builder(), BRepTools_ReShape()
    for old, new in changed:
        if old.ShapeType() == TopAbs_EDGE:
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for edge in new:
                builder.Add(wire, edge)
            reshape.Replace(old, wire)
        else:
            reshape.Replace(old, new[0])
    return [as_face(reshape.Apply(face)) for face in faces]

"""Ways to offset a solid, the kernel's and one of our own, tried in a process of their own.

The kernel's are quick on simple solids. They crash on some others, and not every time, or do not end: then pieces are
cut against each other. What any way gives is not trusted, but looked at.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType

import numpy as np
from OCP.BinTools import BinTools
from OCP.BOPAlgo import BOPAlgo_Tools
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepClass3d import BRepClass3d
from OCP.BRepOffset import BRepOffset_MakeOffset, BRepOffset_Skin
from OCP.BRepOffsetAPI import BRepOffsetAPI_MakeOffset, BRepOffsetAPI_MakeOffsetShape, BRepOffsetAPI_MakeThickSolid
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.GeomAbs import GeomAbs_Arc, GeomAbs_Intersection, GeomAbs_JoinType, GeomAbs_Plane
from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec
from OCP.ShapeCustom import ShapeCustom
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Compound, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.common.processes import Started, slowed, started
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of, topology
from gyroid_cad.kernel.compat import ShapeList, as_edge, as_face, as_solid
from gyroid_cad.kernel.depth import Depths, FaceDistances
from gyroid_cad.kernel.offset_surface import FaceOffset
from gyroid_cad.kernel.ordered import in_order, sorted_by_place
from gyroid_cad.kernel.sieve import OpenSkinError, core_of_pieces
from gyroid_cad.kernel.skin_room import SkinRoom, shown_place

__all__ = ["CLOSED_WAYS", "OPEN_WAYS", "core_of", "flat_normal", "offsets", "work"]

Way = Callable[[TopoDS_Solid, Sequence[TopoDS_Face], float], TopoDS_Shape]

_TOLERANCE = 1e-5
# The kernel's own ways are quick where they work at all; those that are not crash or do not end.
_SECONDS_AT_MOST, _SECONDS_OF_KERNEL, _LEAST_SECONDS, _SECONDS_BETWEEN_LOOKS = 30.0, 5.0, 0.5, 0.02
# More pairs of free-form offsets that may meet are not cut against each other: a pair takes the kernel about a second.
# Its own ways, which take no pieces, are then given less time each.
_MOST_PAIRS, _SECONDS_OF_MANY = 60, 2.5
# A thickness that is tried where another failed, in parts of the room that the tightest face leaves and of what failed.
_WITHIN_ROOM, _THINNER, _SECONDS_THINNER = 0.9, 0.5, 4.0
_OF_PIECES = _PIECES, _PIECES_TO_OPENINGS = "pieces", "pieces to openings"
# Faces that are bent alike all over, to rounding, do not fold: they vanish.
_SAME_RADIUS = 1e-3
_SOLID, _REASON = "solid.bin", "reason.txt"


def offsets(
    solid: TopoDS_Solid,
    openings: Sequence[TopoDS_Face],
    skin: float,
    ways: Sequence[str],
    reasons: list[str] | None = None,
    seconds: float = np.inf,
) -> Generator[TopoDS_Shape | None]:
    """Solids that each way of offsetting leaves inside a skin; None where one fails, crashes or does not end.

    Parameters
    ----------
    solid : TopoDS_Solid
    openings : sequence of TopoDS_Face
        Faces of the solid that get no skin; ``CLOSED_WAYS`` do not heed them.
    skin : float
        In mm.
    ways : sequence of str
        Of ``OPEN_WAYS`` and ``CLOSED_WAYS``.
    reasons : list of str, optional
        To which is added why a way failed, where it says so.
    seconds : float
        That one way may take at most, if that is less than it usually may.
    """
    numbers = [k for k, face in enumerate(parts_of(solid, TopAbs_FACE)) if any(face.IsSame(one) for one in openings)]
    with TemporaryDirectory() as folder:
        BinTools.Write_s(solid, str(Path(folder, _SOLID)))
        left, slower = list(ways), slowed()
        ends = time.monotonic() + slower * _SECONDS_OF_KERNEL
        while left:
            process = started(work, folder, repr(skin), ",".join(map(str, numbers)), *left)
            try:
                while left:
                    begun, of_kernel = time.monotonic(), left[0] not in _OF_PIECES
                    longest = slower * min(seconds, _SECONDS_AT_MOST)
                    at_most = min(max(_LEAST_SECONDS, ends - begun), longest) if of_kernel else longest
                    found = _awaited(process, Path(folder, left[0]), at_most)
                    # All of the kernel's own ways together may take so long.
                    ends += 0.0 if of_kernel else time.monotonic() - begun
                    if found is None:
                        break
                    left.pop(0)
                    yield _read(found) if found.stat().st_size else None
                if left and left[0] in _OF_PIECES and reasons is not None and process.wait(0) is None:
                    reasons.append(f"its faces' offsets were not cut against each other in {longest:.3g} s")
            finally:
                process.kill()
            if left:
                left.pop(0)
                yield None
        if reasons is not None and Path(folder, _REASON).exists():
            reasons.append(Path(folder, _REASON).read_text(encoding="utf-8"))


def _awaited(process: Started, path: Path, at_most: float) -> Path | None:
    """The path once there is a file; None if the process ends before, or takes too many seconds."""
    end = time.monotonic() + at_most
    while not path.exists():
        ended = process.wait(_SECONDS_BETWEEN_LOOKS) is not None
        if time.monotonic() > end or (ended and not path.exists()):
            return None
    return path


def work(folder: str, skin: str, numbers: str, *ways: str) -> None:
    """Offset the solid in a folder in each of some ways, and leave there what they give."""
    for way in ways:
        given = _read(Path(folder, _SOLID))
        place = _place(given)
        solid = as_solid(given.Moved(place.Inverted()))
        faces = [as_face(face) for face in parts_of(solid, TopAbs_FACE)]
        unfinished = Path(folder, f"{way}, unfinished")
        unfinished.touch()
        try:
            core = _WAYS[way](solid, [faces[int(number)] for number in numbers.split(",") if number], float(skin))
            # Surfaces that are the offset of another do not survive STEP files.
            plain = ShapeCustom.ConvertToBSpline_s(core, False, False, True, False)
            BinTools.Write_s(plain.Moved(place), str(unfinished))
        except Exception as fault:
            failed: Exception = fault
            # The kernel has as many kinds of failure as it has algorithms, and some are no exceptions of its own.
            unfinished.write_bytes(b"")
            if isinstance(failed, OpenSkinError):
                failed = _placed(failed, given, place)
            if isinstance(failed, KernelError):
                Path(folder, _REASON).write_text(str(failed), encoding="utf-8")
        unfinished.rename(Path(folder, way))


def _placed(failed: OpenSkinError, solid: TopoDS_Shape, place: TopLoc_Location) -> OpenSkinError:
    """The failure where the solid really is, with the face it is next to."""
    there = gp_Pnt(*failed.point.tolist()).Transformed(place.Transformation())
    point = np.array([there.X(), there.Y(), there.Z()])
    away = [FaceDistances([face]).distance(point) for face in parts_of(solid, TopAbs_FACE)]
    return OpenSkinError(point, f", next to face {int(np.argmin(away)) + 1}")


def _shrunk(
    solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float, join: GeomAbs_JoinType, together: bool
) -> TopoDS_Shape:
    """Less a skin everywhere; each void is made larger by itself, as the kernel offsets one shell at a time."""
    outer = BRepClass3d.OuterShell_s(solid)
    core = _offset(_solid_of(outer), -skin, join, together)
    for shell in parts_of(solid, TopAbs_SHELL):
        if not shell.IsSame(outer):
            core = BRepAlgoAPI_Cut(core, _offset(_solid_of(shell.Reversed()), skin, GeomAbs_Arc, together)).Shape()
    return core


def _offset(solid: TopoDS_Solid, by: float, join: GeomAbs_JoinType, together: bool) -> TopoDS_Shape:
    place = _place(solid)
    maker = BRepOffsetAPI_MakeOffsetShape()
    maker.PerformByJoin(solid.Moved(place.Inverted()), by, _TOLERANCE, BRepOffset_Skin, together, False, join, False)
    return maker.Shape().Moved(place)


def _place(shape: TopoDS_Shape) -> TopLoc_Location:
    """Move a surface's sphere for good, for the kernel seeks a moved sphere's poles where they were."""
    for face in parts_of(shape, TopAbs_FACE):
        if any(BRep_Tool.Degenerated_s(as_edge(edge)) for edge in parts_of(face, TopAbs_EDGE)):
            place = TopLoc_Location()
            BRep_Tool.Surface_s(as_face(face), place)
            return place
    return shape.Location()


def _of_pieces(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> TopoDS_Shape:
    return compound_of(core_of_pieces(solid, skin))


def _of_pieces_to_openings(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> TopoDS_Shape:
    return compound_of(core_of_pieces(solid, skin, openings))


def _less_thick_skin(
    solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float, join: GeomAbs_JoinType
) -> TopoDS_Shape:
    closing = ShapeList()
    for face in openings:
        closing.Append(face)
    maker = BRepOffsetAPI_MakeThickSolid()
    maker.MakeThickSolidByJoin(solid, closing, -skin, _TOLERANCE, BRepOffset_Skin, True, False, join, False)
    return BRepAlgoAPI_Cut(solid, maker.Shape()).Shape()


def _offset_but_openings(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> TopoDS_Shape:
    maker = BRepOffset_MakeOffset()
    maker.Initialize(solid, -skin, _TOLERANCE, BRepOffset_Skin, True, False, GeomAbs_Intersection, False, False)
    for face in openings:
        maker.SetOffsetOnFace(face, 0.0)
    maker.MakeOffsetShape()
    return maker.Shape()


# Arcs keep the skin as thick at edges that point inwards as elsewhere, so they come first.
OPEN_WAYS: Mapping[str, Way] = MappingProxyType(
    {
        "thick skin, arcs": partial(_less_thick_skin, join=GeomAbs_Arc),
        "thick skin, sharp": partial(_less_thick_skin, join=GeomAbs_Intersection),
        "all faces but openings": _offset_but_openings,
        _PIECES_TO_OPENINGS: _of_pieces_to_openings,
    }
)
CLOSED_WAYS: Mapping[str, Way] = MappingProxyType(
    {
        "arcs": partial(_shrunk, join=GeomAbs_Arc, together=True),
        _PIECES: _of_pieces,
        "arcs, face by face": partial(_shrunk, join=GeomAbs_Arc, together=False),
        "sharp": partial(_shrunk, join=GeomAbs_Intersection, together=True),
    }
)
_WAYS: Mapping[str, Way] = MappingProxyType({**OPEN_WAYS, **CLOSED_WAYS})


def _read(path: Path) -> TopoDS_Shape:
    shape = TopoDS_Shape()
    BinTools.Read_s(shape, str(path))
    return shape


def _solid_of(shell: TopoDS_Shape) -> TopoDS_Solid:
    builder, solid = BRep_Builder(), TopoDS_Solid()
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def core_of(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float, depths: Depths) -> list[TopoDS_Solid]:
    """Offset a solid inwards by a skin on all its faces but the openings.

    Parameters
    ----------
    solid : TopoDS_Solid
    openings : sequence of TopoDS_Face
        Of the solid's faces.
    skin : float
        In mm; less than the solid is deep.
    depths : Depths
        Of this solid with these openings.

    Returns
    -------
    list of TopoDS_Solid
        They share nothing with the solid.

    Raises
    ------
    KernelError
        If none of the kernel's ways to offset gives a core whose points lie as deep as they should.
    """
    reasons: list[str] = []
    room = SkinRoom(solid, openings, skin)
    ways, seconds = _ways_for(solid, openings), np.inf
    if (pairs := room.crossing_pairs()) > _MOST_PAIRS:
        ways, seconds = [way for way in ways if way not in _OF_PIECES], _SECONDS_OF_MANY
        reasons.append(f"{pairs} pairs of its free-form faces are so near that their offsets may cross: too many")
    if core := _confirmed(solid, openings, skin, depths, ways, reasons, seconds):
        # What goes on from here is the same at every run.
        ordered = sorted_by_place(map(in_order, core))
        return ordered if all(is_valid(one) and topology(one).closed for one in ordered) else core
    why = "".join(f": {reason}" for reason in reasons[:1])
    tightest, folding = room.tightest(), _folding(solid, openings, skin)
    thinner = float(f"{min(_WITHIN_ROOM * tightest.radius, _THINNER * skin):.2g}")
    made = pairs <= _MOST_PAIRS and _confirmed(solid, openings, thinner, depths, ways, [], _SECONDS_THINNER)
    limits = f"{folding}{tightest}; {f'{thinner:g} mm was tried and can be made; ' if made else ''}"
    remedy = "a core of your own (core=, --core) does, and without a skin it can still be filled"
    raise KernelError(f"the kernel cannot offset the part by {skin:g} mm{why}; {limits}{remedy}")


def _confirmed(
    solid: TopoDS_Solid,
    openings: Sequence[TopoDS_Face],
    skin: float,
    depths: Depths,
    ways: Sequence[str],
    reasons: list[str],
    seconds: float = np.inf,
) -> list[TopoDS_Solid]:
    """The first core that lies as deep as it should; none if there is no such."""
    with closing(_attempts(solid, openings, skin, ways, reasons, seconds)) as attempts:
        return next((core for core in attempts if depths.confirm(core, skin)), [])


def _folding(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> str:
    """Thickness below which no offset of a face folds, where one does with that which was asked for."""
    faces = [as_face(face) for face in parts_of(solid, TopAbs_FACE)]
    offsets_of = [
        (number, FaceOffset(face, 0.0, skin))
        for number, face in enumerate(faces, 1)
        if not any(face.IsSame(opening) for opening in openings)
    ]
    folding = [(number, *offset.folding()) for number, offset in offsets_of if offset.may_fold(skin)]
    found, most = "", skin
    while narrow := [one for one in folding if one[1] < most < one[2] * (1 - _SAME_RADIUS)]:
        number, most, _, place = min(narrow, key=lambda one: one[1])
        bent = f"a radius to which face {number} is bent at {shown_place(place)}"
        found = f"below {most:.3g} mm no offset folds over, {bent}; "
    return found


def _ways_for(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face]) -> list[str]:
    """Ways to offset a solid, in the order in which they are tried."""
    if not openings:
        return list(CLOSED_WAYS)
    # Of solids with voids the kernel's own ways offset one shell alone.
    voids = sum(1 for _ in parts_of(solid, TopAbs_SHELL)) > 1
    return [_PIECES_TO_OPENINGS, *CLOSED_WAYS] if voids else [*OPEN_WAYS, *CLOSED_WAYS]


def _attempts(
    solid: TopoDS_Solid,
    openings: Sequence[TopoDS_Face],
    skin: float,
    ways: Sequence[str],
    reasons: list[str],
    seconds: float,
) -> Generator[list[TopoDS_Solid]]:
    with closing(offsets(solid, openings, skin, ways, reasons, seconds)) as found:
        for way, core in zip(ways, found, strict=False):
            if core is not None:
                yield _solids_in(_opened(core, openings, skin) if way in CLOSED_WAYS else core)


def _opened(core: TopoDS_Shape, openings: Sequence[TopoDS_Face], skin: float) -> TopoDS_Shape:
    """A core without openings, carried on straight to those openings that are flat.

    For openings that pass into other faces smoothly, where the kernel finds no border between core and skin, and for
    solids with voids.
    """
    for face in openings:
        normal = flat_normal(face)
        if normal is None:
            continue
        outwards = normal * skin
        try:
            floor = BRepAlgoAPI_Common(_moved(_inset(face, skin), outwards.Reversed()), core).Shape()
            core = BRepAlgoAPI_Fuse(core, BRepPrimAPI_MakePrism(floor, outwards).Shape()).Shape()
        except Exception:
            # As many kinds of failure as there are algorithms; an opening that stays closed is found later.
            continue
    return core


def flat_normal(face: TopoDS_Face) -> gp_Vec | None:
    """Normal of a flat face out of its solid, of length 1; None of a bent one."""
    surface = BRepAdaptor_Surface(face)
    if surface.GetType() != GeomAbs_Plane:
        return None
    outwards = gp_Vec(surface.Plane().Axis().Direction())
    if (face.Orientation() == TopAbs_REVERSED) == surface.Plane().Direct():
        outwards.Reverse()
    return outwards


def _inset(face: TopoDS_Face, by: float) -> TopoDS_Shape:
    """A flat face without a strip along its border."""
    rim = BRepOffsetAPI_MakeOffset(face, GeomAbs_Arc)
    rim.Perform(-by)
    faces = TopoDS_Compound()
    BRep_Builder().MakeCompound(faces)
    BOPAlgo_Tools.WiresToFaces_s(rim.Shape(), faces)
    return faces


def _moved(shape: TopoDS_Shape, by: gp_Vec) -> TopoDS_Shape:
    move = gp_Trsf()
    move.SetTranslation(by)
    return BRepBuilderAPI_Transform(shape, move, True).Shape()


def _solids_in(shape: TopoDS_Shape) -> list[TopoDS_Solid]:
    return [] if shape.IsNull() else [as_solid(solid) for solid in parts_of(shape, TopAbs_SOLID)]

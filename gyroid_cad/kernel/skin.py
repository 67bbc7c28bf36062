"""A part as a solid skin round a core, which alone is filled; the skin may be left open at some faces.

Skin and core share the faces between them and the edges round each opening. What of the core's boundary the lattice
leaves void turns round and bounds the skin; what lies in the lattice is no boundary any more. At an opening it is the
other way: there the lattice ends, and a void is open.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.kernel.check import compound_of, faces_of, is_valid, measure, parts_of
from gyroid_cad.kernel.compat import ShapeSet, as_edge, as_face, as_solid
from gyroid_cad.kernel.depth import Depths, FaceDistances, points_on
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.offset import core_of, flat_normal
from gyroid_cad.kernel.part import Part, require_part, selected_faces
from gyroid_cad.kernel.shells import VolumeOf, solids_of
from gyroid_cad.kernel.sieve import with_changes
from gyroid_cad.kernel.skin_room import shown_place
from gyroid_cad.kernel.split import Pieces, changes, general_fuse, inner_sides, modified

__all__ = ["Hollow", "hollow", "hollow_round", "opened_faces", "openings_of"]

Floats = NDArray[np.float64]

# In mm; kernels call two places one if they are nearer than that, files keep fewer digits.
_SAME_PLACE = 1e-5
_POINTS_ON_FACE, _POINTS_ON_EDGE, _POINTS_ON_OPENING = 8, 5, 128
# The kernel measures faces with wavy borders no closer.
_SAME_VOLUME = 1e-3
# Of a core's volume: what sticks out of the part by less is rounding of a file.
_SAME_CORE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class Hollow:
    """A part, parted into a skin and a core.

    Attributes
    ----------
    skin : tuple of TopoDS_Face
        Faces of the skin that it does not share with the core, oriented outwards: the part's own, and at openings the
        rims that are left of them.
    core : Part
    opened : tuple of bool
        Which of the core's faces lie in openings, as they are found in its shape; the others are shared with the skin.
    thickness : float, optional
        Of the skin where it is thinnest, in mm; None round a core that comes to every face of the part.
    """

    skin: tuple[TopoDS_Face, ...]
    core: Part
    opened: tuple[bool, ...]
    thickness: float | None

    def solids(
        self,
        pieces: Pieces,
        whole: Iterable[TopoDS_Shape],
        wanted_at: Callable[[Floats], bool],
        volume_of: VolumeOf | None = None,
    ) -> list[TopoDS_Solid]:
        """The skin, and with it what faces of a lattice bound in the core.

        Parameters
        ----------
        pieces : Pieces
            Of the core, split against lattice faces oriented out of the solid wanted.
        whole : iterable of TopoDS_Shape
            Faces that lie in the core uncut, oriented likewise.
        wanted_at : callable
            Whether a point, shape (3,), on the core's boundary belongs to the solid wanted: asked only of pieces of the
            boundary that are connected with none that the lattice meets.
        volume_of : callable, optional
            As of :func:`~gyroid_cad.kernel.shells.solids_of`.

        Raises
        ------
        KernelError
            If the faces do not close, or do not agree on what is inside.
        """
        boundary = zip(pieces.boundary, pieces.origins, inner_sides(pieces, wanted_at), strict=True)
        ends = [
            piece if inner else as_face(piece.Reversed())
            for piece, origin, inner in boundary
            if inner == self.opened[origin]
        ]
        return solids_of([*self.skin_faces(pieces), *pieces.inside, *map(as_face, whole), *ends], volume_of)

    def skin_solids(self, pieces: Pieces, volume_of: VolumeOf | None = None) -> list[TopoDS_Solid]:
        """The skin alone, which shares pieces of the core's boundary with what is in the core.

        Parameters
        ----------
        pieces : Pieces
            Of the core, as split against a lattice.
        volume_of : callable, optional
            As of :func:`~gyroid_cad.kernel.shells.solids_of`.

        Raises
        ------
        KernelError
            If the faces do not close.
        """
        inner = [
            as_face(piece.Reversed())
            for piece, origin in zip(pieces.boundary, pieces.origins, strict=True)
            if not self.opened[origin]
        ]
        return solids_of([*self.skin_faces(pieces), *inner], volume_of)

    def skin_faces(self, pieces: Pieces) -> Sequence[TopoDS_Face]:
        """Faces of the skin that it does not share with the core, with their edges as the core's have been split."""
        return with_changes(self.skin, pieces.changed) if any(self.opened) else self.skin


def hollow(
    part: Part,
    skin: float,
    openings: Sequence[TopoDS_Shape] = (),
    plugged: Sequence[TopoDS_Face] = (),
    plug: float | None = None,
) -> Hollow:
    """Part a part into a solid skin and the core inside.

    The skin lies on the inner side of all faces but the openings. Regions too thin for a core are skin altogether.

    Parameters
    ----------
    part : Part
    skin : float
        Its thickness, in mm.
    openings : sequence of TopoDS_Shape
        Faces, as of :func:`openings_of`, at which the core comes to the surface, but for a rim as wide as the skin.
    plugged : sequence of TopoDS_Face
        Others of the part's faces, flat ones, below which the skin is thicker.
    plug : float, optional
        Its thickness there, in mm.

    Raises
    ------
    ParameterError
        If the skin leaves no core, or the openings no skin, or an opening is too narrow to be one.
    KernelError
        If the kernel cannot offset the part.
    """
    opened = openings_of(part, openings)
    own = [[face for face in opened if _has(solid, face)] for solid in part.solids]
    depths = [Depths(solid, faces) for solid, faces in zip(part.solids, own, strict=True)]
    _require_skin(depths, openings)
    deepest, places = zip(*(depth.deepest(skin) for depth in depths), strict=True)
    if max(deepest) <= skin:
        limit = "as deep as the part is below its other faces" if opened else "half the part where it is thickest"
        where = shown_place(places[int(np.argmax(deepest))])
        raise ParameterError("skin", skin, f"less than about {max(deepest):.3g} mm, {limit}, round {where}")
    _require_wide(own, depths, skin, openings)
    cores = [
        core
        for solid, faces, depth, deep in zip(part.solids, own, depths, deepest, strict=True)
        if deep > skin
        for core in core_of(solid, faces, skin, depth)
    ]
    if plug is not None and plug > skin:
        cores = _below_plugs(cores, plugged, plug)
    core = require_part(compound_of(cores))
    if opened:
        return _sharing(part, core, opened, skin)
    return Hollow(tuple(faces_of(part.shape)), core, len(faces_of(core.shape)) * (False,), skin)


def _below_plugs(cores: Sequence[TopoDS_Solid], plugged: Sequence[TopoDS_Face], plug: float) -> list[TopoDS_Solid]:
    """Cores less what lies straight below the faces that have plugs."""
    left: TopoDS_Shape = compound_of(cores)
    for face in plugged:
        outwards = flat_normal(face)
        if outwards is None:
            raise ParameterError("plug", plug, "none, for the skin is all that closes channels at a face that is bent")
        slab = BRepPrimAPI_MakePrism(face, outwards * -plug).Shape()
        left = BRepAlgoAPI_Cut(left, slab).Shape()
    solids = [as_solid(solid) for solid in parts_of(left, TopAbs_SOLID)]
    if not solids:
        raise ParameterError("plug", plug, "less: it leaves nothing of the core")
    return solids


def hollow_round(part: Part, core: Part) -> Hollow:
    """Part a part into a given core and the skin round it, which is open wherever the core comes to the boundary.

    Parameters
    ----------
    part, core : Part

    Raises
    ------
    ParameterError
        If the core isn't inside the part, or leaves no skin.
    KernelError
        If the kernel fails.
    """
    fuse = general_fuse(part.shape, core.shape)
    of_part = _set_of(image for solid in part.solids for image in modified(fuse, solid))
    images = [as_solid(image) for solid in core.solids for image in modified(fuse, solid)]
    _require_inside([image for image in images if not of_part.Contains(image)], part, core.volume)
    images = [image for image in images if of_part.Contains(image)]
    faces = [face for image in images for face in faces_of(image)]
    inner = _set_of(faces)
    pieces = [[as_face(piece) for piece in modified(fuse, face)] for face in faces_of(part.shape)]
    own = _set_of(piece for some in pieces for piece in some)
    opened = tuple(own.Contains(face) for face in faces)
    skin = tuple(piece for some in pieces for piece in some if not inner.Contains(piece))
    if all(opened):
        raise ParameterError("core", f"{core.volume:.6g} mm3", "less than the whole part, so that a skin is left")
    kept = [piece for some in pieces if not any(inner.Contains(piece) for piece in some) for piece in some]
    walls = [face for face, is_open in zip(faces, opened, strict=True) if not is_open]
    core = replace(core, shape=compound_of(images), solids=tuple(images), box=None if any(opened) else core.box)
    made = Hollow(skin, core, opened, _distance(walls, kept))
    _require_all_of(part, made)
    return made


def _set_of(shapes: Iterable[TopoDS_Shape]) -> ShapeSet:
    made = ShapeSet()
    for shape in shapes:
        made.Add(shape)
    return made


def _distance(some: Sequence[TopoDS_Face], others: Sequence[TopoDS_Face]) -> float | None:
    """Smallest distance between faces, in mm; None where there are none."""
    if not others:
        return None
    return float(BRepExtrema_DistShapeShape(compound_of(some), compound_of(others)).Value())


def _require_inside(others: Sequence[TopoDS_Solid], part: Part, volume: float) -> None:
    """Raise if pieces of a core that are no pieces of the part are more than rounding."""
    outside = [BRepAlgoAPI_Cut(piece, part.shape).Shape() for piece in others]
    sizes = [measure(piece)[0] for piece in outside]
    if sum(sizes) > _SAME_CORE * volume:
        low, high = bounding_box(outside[int(np.argmax(sizes))])
        place = ", ".join(f"{coordinate:.4g}" for coordinate in ((low + high) / 2).tolist())
        amount = f"{sum(sizes):.4g} of its {volume:.6g} mm3 stick out, most of it round ({place})"
        raise ParameterError("core", f"{volume:.6g} mm3", f"a solid inside the part: {amount}")
    if sum(measure(piece)[0] for piece in others) > _SAME_CORE * volume:
        raise KernelError("the kernel could not part the part into its core and the skin round it")


def openings_of(part: Part, given: Sequence[TopoDS_Shape]) -> list[TopoDS_Face]:
    """The part's faces that are, or lie on, given ones: those of the shape that the part was made from, or of a copy.

    Parameters
    ----------
    part : Part
    given : sequence of TopoDS_Shape
        Faces.

    Raises
    ------
    ParameterError
        If no face of the part lies on one that is given.
    """
    faces = faces_of(part.shape)
    found: set[int] = set()
    for face in given:
        same = {k for k, own in enumerate(faces) if own.IsSame(face)} or _lying_on(face, faces)
        if not same:
            raise ParameterError("openings", _shown(given), "faces of the part")
        found |= same
    return [faces[k] for k in sorted(found)]


def opened_faces(parts: Sequence[tuple[str, Part]], openings: Sequence[Any]) -> list[list[TopoDS_Face]]:
    """The faces of each part that a user's openings are: selectors are asked of all of them together.

    Parameters
    ----------
    parts : sequence of (str, Part)
    openings : sequence
        As of :func:`gyroid_cad.fill`.

    Raises
    ------
    ParameterError
    """
    if len(parts) == 1 or not openings:
        return [selected_faces(part, openings) for _, part in parts]
    faces = selected_faces(require_part(compound_of(part.shape for _, part in parts)), openings)
    return [[face for face in faces if _has_face(part, face)] for _, part in parts]


def _has_face(part: Part, face: TopoDS_Face) -> bool:
    """Tell whether a face is one of the part's, or has some of these lying on it."""
    faces = faces_of(part.shape)
    return any(own.IsSame(face) for own in faces) or bool(_lying_on(face, faces))


def _lying_on(given: TopoDS_Shape, faces: Sequence[TopoDS_Face]) -> set[int]:
    target = FaceDistances([given])
    return {k for k, face in enumerate(faces) if all(target.distance(point) < _SAME_PLACE for point in _places(face))}


def _places(face: TopoDS_Face) -> Iterator[Floats]:
    """Points of a face, inside and on its border, the likeliest to tell it from another first."""
    yield from points_on(face, _POINTS_ON_FACE)
    for edge in parts_of(face, TopAbs_EDGE):
        if BRep_Tool.Degenerated_s(as_edge(edge)):
            continue
        curve = BRepAdaptor_Curve(as_edge(edge))
        for place in np.linspace(curve.FirstParameter(), curve.LastParameter(), _POINTS_ON_EDGE).tolist():
            point = curve.Value(place)
            yield np.array([point.X(), point.Y(), point.Z()])


def _require_skin(depths: Iterable[Depths], given: Sequence[TopoDS_Shape]) -> None:
    if not all(depth.kept for depth in depths):
        raise ParameterError("openings", _shown(given), "some faces of each solid to be left for the skin")


def _require_wide(
    openings: Sequence[Sequence[TopoDS_Face]], depths: Sequence[Depths], skin: float, given: Sequence[TopoDS_Shape]
) -> None:
    """Raise if an opening is so narrow that its rim fills it."""
    for faces, depth in zip(openings, depths, strict=True):
        for face in faces:
            if not np.any(depth.kept.distances(points_on(face, _POINTS_ON_OPENING)) > skin):
                raise ParameterError("openings", _shown(given), f"faces wider than rims of {skin:g} mm all round")


def _shown(given: Sequence[TopoDS_Shape]) -> str:
    return f"{len(given)} face{'s' if len(given) != 1 else ''}"


def _sharing(part: Part, core: Part, openings: Sequence[TopoDS_Face], skin: float) -> Hollow:
    """Skin and core of a part with openings, once the part's faces there are split where the core comes to them."""
    target = FaceDistances(openings)
    faces = faces_of(core.shape)
    ends = [bool(target.distances(points_on(face, _POINTS_ON_FACE)).max() < _SAME_PLACE * skin) for face in faces]
    if not any(ends):
        raise KernelError("the kernel's core does not come to an opening")
    coming = [face for face, is_end in zip(faces, ends, strict=True) if is_end]
    # Nothing but these faces touches the part: solids as a whole need not be looked at, which fails more often.
    fuse = general_fuse(*openings, *coming)
    changed = changes(fuse, compound_of([*openings, *coming]))
    images = _set_of(as_face(image) for face in coming for image in modified(fuse, face))
    rims = [as_face(piece) for opening in openings for piece in modified(fuse, opening)]
    for opening in openings:
        if not any(images.Contains(piece) for piece in modified(fuse, opening)):
            raise KernelError("the kernel's core does not come to an opening")
    kept = [face for face in faces_of(part.shape) if not any(face.IsSame(opening) for opening in openings)]
    own = [*with_changes(kept, changed), *(piece for piece in rims if not images.Contains(piece))]
    inner = [face for face, is_end in zip(faces, ends, strict=True) if not is_end]
    shared = [piece for piece in rims if images.Contains(piece)]
    solids = solids_of([*with_changes(inner, changed), *shared])
    core = replace(core, shape=compound_of(solids), solids=tuple(solids), box=None)
    opened = _set_of(shared)
    made = Hollow(tuple(own), core, tuple(bool(opened.Contains(face)) for face in faces_of(core.shape)), skin)
    _require_all_of(part, made)
    return made


def _require_all_of(part: Part, made: Hollow) -> None:
    """Raise if skin and core are not, together, the part."""
    empty = Pieces((), tuple(faces_of(made.core.shape)), tuple(range(len(made.opened))))
    skin = sum(measure(solid)[0] for solid in made.solids(empty, (), lambda point: False))
    core = measure(made.core.shape)[0]
    if not abs(skin + core - part.volume) < _SAME_VOLUME * part.volume or not is_valid(made.core.shape):
        raise KernelError("the kernel parted the part wrongly into skin and core")


def _has(solid: TopoDS_Solid, face: TopoDS_Face) -> bool:
    return any(own.IsSame(face) for own in parts_of(solid, TopAbs_FACE))

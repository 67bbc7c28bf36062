"""The core of a solid, what is left of it inside a skin: offset by the kernel, and measured before it is believed."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from contextlib import closing

from OCP.BOPAlgo import BOPAlgo_Tools
from OCP.BRep import BRep_Builder
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepOffsetAPI import BRepOffsetAPI_MakeOffset
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism
from OCP.GeomAbs import GeomAbs_Arc, GeomAbs_Plane
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Compound, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import as_solid
from gyroid_cad.kernel.depth import Depths
from gyroid_cad.kernel.offset import CLOSED_WAYS, OPEN_WAYS, offsets

__all__ = ["core_of"]


def core_of(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float, depths: Depths) -> list[TopoDS_Solid]:
    """What is left of a solid less a skin on the inner side of all its faces but the openings.

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
    with closing(_attempts(solid, openings, skin)) as attempts:
        for core in attempts:
            if depths.confirm(core, skin):
                return core
    raise KernelError(f"the kernel cannot offset the part by {skin:g} mm; without a skin it can still be filled")


def _attempts(solid: TopoDS_Solid, openings: Sequence[TopoDS_Face], skin: float) -> Generator[list[TopoDS_Solid]]:
    ways = list(CLOSED_WAYS)
    if openings and sum(1 for _ in parts_of(solid, TopAbs_SHELL)) == 1:
        ways = [*OPEN_WAYS, *ways]
    with closing(offsets(solid, openings, skin, ways)) as found:
        for way, core in zip(ways, found, strict=True):
            if core is not None:
                yield _solids_in(_opened(core, openings, skin) if way in CLOSED_WAYS else core)


def _opened(core: TopoDS_Shape, openings: Sequence[TopoDS_Face], skin: float) -> TopoDS_Shape:
    """A core without openings, carried on straight to those openings that are flat.

    For openings that pass into other faces smoothly, where the kernel finds no border between core and skin, and for
    solids with voids.
    """
    for face in openings:
        surface = BRepAdaptor_Surface(face)
        if surface.GetType() != GeomAbs_Plane:
            continue
        outwards = gp_Vec(surface.Plane().Axis().Direction()) * skin
        if (face.Orientation() == TopAbs_REVERSED) == surface.Plane().Direct():
            outwards.Reverse()
        try:
            floor = BRepAlgoAPI_Common(_moved(_inset(face, skin), outwards.Reversed()), core).Shape()
            core = BRepAlgoAPI_Fuse(core, BRepPrimAPI_MakePrism(floor, outwards).Shape()).Shape()
        except Exception:
            # As many kinds of failure as there are algorithms; an opening that stays closed is found later.
            continue
    return core


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

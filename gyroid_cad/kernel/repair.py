"""Solids as they come: chosen by name, mended where the kernel can, and united where they overlap."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepCheck import BRepCheck_Analyzer, BRepCheck_NoError
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.ShapeFix import ShapeFix_Shape, ShapeFix_Solid
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID, TopAbs_WIRE
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of, topology, volume_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_shell
from gyroid_cad.kernel.extent import box_round, corners_of

__all__ = ["chosen_solids", "fault_of", "require_volume", "separate_solids"]

# Gaps between faces that are sewn up, in parts of the largest extent.
_SEWN = 1e-5
# Of two solids, in parts of the smaller one: less in common may be rounding, where they touch.
_SHARED = 1e-6
# Of the box round a solid: what holds less than this share of it holds nothing.
_NOTHING = 1e-9
# Solids that a message lists.
_MOST_LISTED = 12

Named = tuple[str, TopoDS_Shape]


def separate_solids(
    shapes: Sequence[TopoDS_Shape], names: Sequence[Sequence[str]], chosen: Sequence[str | int] = ()
) -> tuple[list[Named], list[str]]:
    """The sound solids of shapes, with no space in common, and what was done to make them so.

    Parameters
    ----------
    shapes : sequence of TopoDS_Shape
    names : sequence of sequence of str
        Of each shape.
    chosen : sequence of str or int, optional
        Names, or numbers counted from 1, of those that are wanted; all of them if left out.

    Returns
    -------
    solids : list of (str, TopoDS_Shape)
        Each with what to call it.
    remarks : list of str
        On what was mended or united.

    Raises
    ------
    ParameterError
        If there is none of a name, or no solid at all, or one cannot be mended: saying which, and where its fault is.
    """
    remarks: list[str] = []
    sound = [mended for named in chosen_solids(shapes, names, chosen) for mended in _sound(*named, remarks)]
    separate: list[Named] = []
    for own, solids, overlap in _united([solid for _, solid in sound]):
        title = " and ".join(sound[index][0] for index in own)
        separate += [(title, solid) for solid in solids]
        if len(own) > 1:
            for solid in solids:
                _require_sound(solid, title)
            remarks.append(f"{title} have {overlap:.4g} mm3 in common: united")
    return separate, remarks


def chosen_solids(
    shapes: Sequence[TopoDS_Shape], names: Sequence[Sequence[str]], chosen: Sequence[str | int] = ()
) -> list[Named]:
    """The solids of shapes as they are, or those of them that are wanted, each with what to call it.

    Parameters and errors are those of :func:`separate_solids`.
    """
    found = [
        (known, solid)
        for shape, known in zip(shapes, names, strict=True)
        for solid in (list(parts_of(shape, TopAbs_SOLID)) or [shape])
    ]
    # Beside solids, faces and curves are what helped to draw them.
    found = [one for one in found if one[1].ShapeType() == TopAbs_SOLID] or found
    titles = [_title(number, known, len(found)) for number, (known, _) in enumerate(found, 1)]
    wanted = _chosen(chosen, [known for known, _ in found], titles)
    return [(titles[index], found[index][1]) for index in wanted]


def _title(number: int, names: Sequence[str], count: int) -> str:
    if count == 1:
        return "its solid"
    return f"solid {number} of {count}" + (f" ({', '.join(names)})" if names else "")


def _chosen(chosen: Sequence[str | int], names: Sequence[Sequence[str]], titles: Sequence[str]) -> list[int]:
    found: dict[int, None] = {}
    for wanted in chosen:
        own = [index for index, known in enumerate(names) if str(wanted) in known]
        if not own and str(wanted).isdigit() and 0 < int(wanted) <= len(names):
            own = [int(wanted) - 1]
        if not own:
            listed = ", ".join(titles[:_MOST_LISTED]) + (", ..." if len(titles) > _MOST_LISTED else "")
            raise ParameterError("solids", wanted, f"a name or a number of the part's solids: {listed}")
        found.update(dict.fromkeys(own))
    return list(found) if chosen else list(range(len(names)))


def _sound(title: str, shape: TopoDS_Shape, remarks: list[str]) -> list[Named]:
    """A solid as it is, or mended."""
    is_solid = shape.ShapeType() == TopAbs_SOLID
    fault = fault_of(shape, title) if is_solid else "a closed solid: there is none in it"
    if not fault:
        return [(title, shape)]
    solids = _repaired(shape)
    if not solids:
        raise ParameterError("part", shape.ShapeType().name.removeprefix("TopAbs_").lower(), fault)
    remarks.append(f"{fault.partition(': ')[2] if is_solid else 'its faces are no solid'}: repaired")
    return [(title, solid) for solid in solids]


def _require_sound(solid: TopoDS_Shape, title: str) -> None:
    if fault := fault_of(solid, title):
        raise ParameterError("part", "solid", fault)


def fault_of(solid: TopoDS_Shape, which: str) -> str:
    """Fault of a solid and its place, after what is expected of it; nothing of one closed, valid and right side out.

    Parameters
    ----------
    solid : TopoDS_Shape
    which : str
        What to call it.
    """
    if open_edges := topology(solid).open_edges:
        return f"a closed solid: {which} has {open_edges} open edges{_first_open(solid)}"
    if not is_valid(solid):
        return f"a valid solid: the kernel finds fault with {which}{_first_invalid(solid)}"
    if _holds_nothing(solid):
        return f"a solid of positive volume: {which} holds nothing, for its faces lie on one another"
    return "" if volume_of(solid) > 0 else f"a solid of positive volume: {which} is inside out"


def require_volume(solids: Sequence[Named]) -> None:
    """Check that every solid, with what to call it, holds something, if it is sound or not.

    Raises
    ------
    ParameterError
    """
    for title, solid in solids:
        if solid.ShapeType() == TopAbs_SOLID and _holds_nothing(solid):
            _require_sound(solid, title)


def _holds_nothing(solid: TopoDS_Shape) -> bool:
    """Tell whether faces lie on one another, with nothing between them, though the kernel calls the solid valid.

    Such is what it reads of an ellipse turned round its axis: of the half that was turned it wrote the whole.
    """
    volume = GProp_GProps()
    # At fixed points, which are the same on both sides of such faces: they cancel to rounding.
    BRepGProp.VolumeProperties_s(solid, volume)
    box = float(np.prod(np.ptp(corners_of(box_round([solid])), axis=0)))
    return bool(abs(volume.Mass()) <= _NOTHING * box)


def _repaired(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Sound solids that the kernel's tools make of a faulty solid, or of faces; none where they don't manage.

    Tried one after the other: ``ShapeFix_Shape``, and sewing up the faces where they are next to each other.
    """
    for made in (_fixed, _sewn):
        solids = list(parts_of(made(shape), TopAbs_SOLID))
        if solids and not any(fault_of(solid, "") for solid in solids):
            return solids
    return []


def _united(solids: Sequence[TopoDS_Shape]) -> list[tuple[list[int], list[TopoDS_Shape], float]]:
    """Group solids that have space in common, and fuse each group.

    Returns
    -------
    list of (indices, solids, overlap)
        Which solids each group is of, what they are together, and the volume that they have in common, in mm3; 0 of
        one that is alone.
    """
    boxes = [box_round([solid]) for solid in solids]
    pairs, volumes = [], []
    for first, second in combinations(range(len(solids)), 2):
        if boxes[first].IsOut(boxes[second]):
            continue
        common = volume_of(BRepAlgoAPI_Common(solids[first], solids[second]).Shape())
        if common > _SHARED * min(volume_of(solids[first]), volume_of(solids[second])):
            pairs.append((first, second))
            volumes.append(common)
    both = np.array(pairs, dtype=np.int64).reshape(-1, 2)
    group = connected(len(solids), both[:, 0], both[:, 1])
    found = []
    for number in dict.fromkeys(group.tolist()):
        own = np.flatnonzero(group == number).tolist()
        overlap = sum(volume for pair, volume in zip(pairs, volumes, strict=True) if group[pair[0]] == number)
        found.append((own, _fused([solids[index] for index in own]), float(overlap)))
    return found


def _fused(solids: list[TopoDS_Shape]) -> list[TopoDS_Shape]:
    made = solids[0]
    for solid in solids[1:]:
        fuse = BRepAlgoAPI_Fuse(made, solid)
        fuse.SimplifyResult()
        made = fuse.Shape()
    return list(parts_of(made, TopAbs_SOLID))


def _fixed(shape: TopoDS_Shape) -> TopoDS_Shape:
    fix = ShapeFix_Shape(shape)
    fix.Perform()
    return _turned_outwards(fix.Shape())


def _sewn(shape: TopoDS_Shape) -> TopoDS_Shape:
    low, high = corners_of(box_round([shape]))
    sewing = BRepBuilderAPI_Sewing(_SEWN * float(np.max(high - low)))
    for face in parts_of(shape, TopAbs_FACE):
        sewing.Add(face)
    sewing.Perform()
    shells = list(parts_of(sewing.SewedShape(), TopAbs_SHELL))
    return _turned_outwards(compound_of(ShapeFix_Solid().SolidFromShell(as_shell(shell)) for shell in shells))


def _turned_outwards(shape: TopoDS_Shape) -> TopoDS_Shape:
    solids = parts_of(shape, TopAbs_SOLID)
    return compound_of(solid if volume_of(solid) > 0 else solid.Reversed() for solid in solids)


def _first_open(solid: TopoDS_Shape) -> str:
    """Face and place of the first edge that is not used twice."""
    numbers, uses = NumberedShapes(), list[tuple[int, int, TopoDS_Shape]]()
    for number, face in enumerate(parts_of(solid, TopAbs_FACE), 1):
        edges = (edge for edge in parts_of(face, TopAbs_EDGE) if not BRep_Tool.Degenerated_s(as_edge(edge)))
        uses += [(numbers.Add(edge), number, edge) for edge in edges]
    counts = np.bincount([index for index, _, _ in uses])
    for index, number, edge in uses:
        if counts[index] != 2:
            curve = BRepAdaptor_Curve(as_edge(edge))
            middle = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2)
            return f", the first on face {number} at {_shown(middle)}"
    return ""


def _first_invalid(solid: TopoDS_Shape) -> str:
    """Face, place and fault of the first face that the kernel's check does not pass."""
    check = BRepCheck_Analyzer(solid, True)
    for number, face in enumerate(parts_of(solid, TopAbs_FACE), 1):
        if not check.IsValid(face):
            area = GProp_GProps()
            BRepGProp.SurfaceProperties_s(as_face(face), area)
            below = [face, *parts_of(face, TopAbs_WIRE), *parts_of(face, TopAbs_EDGE)]
            faults = [fault for part in below for fault in check.Result(part).Status() if fault != BRepCheck_NoError]
            named = f" ({faults[0].name.removeprefix('BRepCheck_')})" if faults else ""
            return f": face {number} at {_shown(area.CentreOfMass())}{named}"
    return ""


def _shown(point: object) -> str:
    x, y, z = (round(getattr(point, axis)(), 6) + 0.0 for axis in "XYZ")
    return f"({x:.6g}, {y:.6g}, {z:.6g}) mm"

"""Parts of several bodies: each is filled by itself, chosen by its name, mended where it is faulty."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import build123d as bd
import cadquery as cq
import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy

from gyroid_cad.errors import IslandsWarning, ParameterError, PartWarning
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.part import bodies_of
from gyroid_cad.surface.fit import FitSettings

CELL, DENSITY, SIDE = 8.0, 0.2, 4.0
COARSE = FitSettings(4)


def cube(x: float = 0.0, side: float = SIDE) -> cq.Workplane:
    return cq.Workplane().box(side, side, side, centered=False).translate((x, 0, 0))


def filled(part: Any, **given: Any) -> Filled:
    return fill(part, CELL, density=DENSITY, fit=COARSE, **given)


def unsewn(sides: int) -> cq.Solid:
    """A box of so many faces, each of which has edges of its own."""
    faces = [cq.Face(BRepBuilderAPI_Copy(face.wrapped).Shape()) for face in cube().faces().vals()[:sides]]
    builder, solid = cq.occ_impl.shapes.BRep_Builder(), cq.occ_impl.shapes.TopoDS_Solid()
    shell = cq.occ_impl.shapes.TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face.wrapped)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return cq.Solid(solid)


@pytest.mark.parametrize("second", [3 * SIDE, SIDE], ids=["apart", "touching"])
def test_each_body_is_filled_by_itself_and_is_no_island_of_the_other(second: float) -> None:
    # Of either two chips at its corners are dropped, as of a cube alone.
    with pytest.warns(IslandsWarning, match="^not connected to the largest piece: 4 islands"):
        both = filled(cube().add(cube(second)), drop_islands=True).report
    alone = [filled(cube(x)).report for x in (0, second)]
    assert (both.bodies, both.solids, both.islands) == (2, 2, 0)
    for name in ("volume", "area", "part_volume", "faces", "cut_patches", "dropped"):
        assert getattr(both, name) == pytest.approx(sum(getattr(report, name) for report in alone))
    assert both.density == both.volume / both.part_volume


def test_bodies_that_overlap_are_united_and_the_report_says_so() -> None:
    with pytest.warns(PartWarning, match="have 32 mm3 in common: united"):
        made = filled(cube().add(cube(SIDE / 2))).report
    assert made.part_volume == pytest.approx(1.5 * SIDE**3)
    assert (made.bodies, made.solids) == (1, 1)
    assert "solid 1 of 2 and solid 2 of 2 have 32 mm3 in common: united" in str(made)


def assembly_file(folder: Path) -> Path:
    sub = cq.Assembly(name="sub").add(cube(), name="nut").add(cube(20), name="bolt")
    whole = cq.Assembly(name="whole").add(sub, loc=cq.Location((0, 0, 50))).add(cube(40, 6), name="plate")
    whole.export(str(folder / "whole.step"))
    return folder / "whole.step"


@pytest.mark.parametrize(("chosen", "volumes"), [("bolt", [64]), (["plate", "nut"], [216, 64]), (3, [216])])
def test_bodies_of_an_assembly_are_chosen_by_the_names_or_numbers_of_its_file(
    chosen: Any, volumes: list[float], tmp_path: Path
) -> None:
    parts, _ = bodies_of(assembly_file(tmp_path), chosen)
    assert [part.volume for _, part in parts] == pytest.approx(volumes)


def test_a_body_of_an_assembly_stands_where_the_assembly_has_it(tmp_path: Path) -> None:
    ((title, bolt),) = bodies_of(assembly_file(tmp_path), ["bolt"])[0]
    assert title == "solid 2 of 3 (bolt)"
    np.testing.assert_allclose(bolt.low, [20, 0, 50], atol=1e-6)


def test_assemblies_of_hosts_have_names_too() -> None:
    of_cadquery = (
        cq.Assembly(name="pair").add(cube(), name="left").add(cube(9), name="right", loc=cq.Location((1, 0, 0)))
    )
    left, right = bd.Box(3, 3, 3), bd.Pos(20, 0, 0) * bd.Box(2, 2, 2)
    left.label, right.label = "left", "right"
    of_build123d = bd.Compound(label="pair", children=[left, right])
    for pair, low, volume in ((of_cadquery, 10, SIDE**3), (of_build123d, 19, 8)):
        ((_, part),) = bodies_of(pair, ["right"])[0]
        assert (part.low[0], part.volume) == pytest.approx((low, volume), abs=1e-6)


def test_a_name_that_no_body_has_is_refused_with_those_that_there_are() -> None:
    pair = cq.Assembly(name="pair").add(cube(), name="left").add(cube(9), name="right")
    with pytest.raises(ParameterError) as refused:
        filled(pair, solids=["middle"])
    assert str(refused.value) == (
        "solids = 'middle': expected a name or a number of the part's solids: "
        "solid 1 of 2 (pair/left, left), solid 2 of 2 (pair/right, right)"
    )


def test_an_opening_is_one_of_the_body_whose_face_it_is() -> None:
    pair = cube().add(cube(9, 5))
    both = filled(pair, skin=0.5, openings=[">Z"]).report
    closed, opened = filled(cube(), skin=0.5).report, filled(cube(9, 5), skin=0.5, openings=[">Z"]).report
    assert both.volume == pytest.approx(closed.volume + opened.volume)


@pytest.mark.parametrize(
    ("part", "words"),
    [
        (unsewn(6), "its solid has 24 open edges, the first on face 1 at (0, 0, 2) mm: repaired"),
        (cube().val().Shells()[0], "its faces are no solid: repaired"),
        (cq.Solid(cube().val().wrapped.Reversed()), "its solid is inside out: repaired"),
    ],
    ids=["unsewn", "shell", "inside out"],
)
def test_what_the_kernels_tools_can_mend_is_mended_and_said(part: Any, words: str) -> None:
    with pytest.warns(PartWarning) as said:
        made = filled(part).report
    assert made.remarks == (words,)
    assert [str(warning.message) for warning in said if warning.category is PartWarning] == [words]
    assert made.part_volume == pytest.approx(SIDE**3)


def test_what_cannot_be_mended_is_refused_for_a_face_and_a_place() -> None:
    with pytest.raises(ParameterError, match=r"^part = 'solid': expected a closed solid: its solid has 20 open edges"):
        filled(unsewn(5))
    one_missing = cq.Workplane(obj=cq.Compound.makeCompound([cube(20).val(), unsewn(5)]))
    with pytest.raises(ParameterError, match=r"solid 2 of 2 has 20 open edges, the first on face 1 at \(0, 0, 2\) mm"):
        filled(one_missing)


@pytest.mark.parametrize("route", ["brep", "triangles"])
def test_a_solid_whose_faces_lie_on_one_another_holds_nothing_to_fill(route: Any, tmp_path: Path) -> None:
    half = cq.Workplane().ellipseArc(14, 8, -90, 90, rotation_angle=0, startAtCurrent=False).close()
    cq.exporters.export(half.revolve(360, (0, -8, 0), (0, 8, 0)), str(tmp_path / "egg.step"))
    with pytest.raises(ParameterError, match="of positive volume: its solid holds nothing, for its faces lie on one"):
        filled(tmp_path / "egg.step", route=route)

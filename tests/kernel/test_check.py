"""Closed, valid and full: what the package measures on the kernel's shapes, against what is known of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopAbs import TopAbs_FACE
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape, TopoDS_Shell, TopoDS_Solid

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import enclosed_volume, is_valid, measure_about, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.solid import build_solid
from gyroid_cad.step.counts import Topology
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import build_wall

TUBE = USUAL.tube

Cells = tuple[int, int, int]

CELL_SIZE = 10.0
COARSE = FitSettings(5)

lengths = st.floats(0.1, 100)


@lru_cache(maxsize=16)
def solid_of(cells: Cells = (1, 1, 1), relative_thickness: float = 0.08, fit: FitSettings = COARSE) -> TopoDS_Shape:
    return build_solid(build_wall(build_complex(cells), fit_patch(fit), CELL_SIZE, relative_thickness * CELL_SIZE))


def faces(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    found, explorer = [], TopExp_Explorer(shape, TopAbs_FACE)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def solid_round(faces: list[TopoDS_Shape]) -> TopoDS_Shape:
    """Whatever the faces are, call them a shell and the shell a solid."""
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def nurbs_box(corner: tuple[float, float, float], sides: tuple[float, float, float]) -> TopoDS_Shape:
    return BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeBox(gp_Pnt(*corner), *sides).Solid()).Shape()


@pytest.mark.parametrize("relative_thickness", [0.01, 0.08, 0.2, 0.36])
@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1)])
def test_the_enclosed_volume_is_that_of_the_tube_formula_for_each_cell(cells: Cells, relative_thickness: float) -> None:
    volume = enclosed_volume(solid_of(cells, relative_thickness, FitSettings()))
    count = cells[0] * cells[1] * cells[2]
    assert volume == pytest.approx(count * TUBE.density(relative_thickness) * CELL_SIZE**3, rel=2e-6)


@pytest.mark.parametrize(("cells", "fit"), [((1, 1, 1), FitSettings()), ((2, 2, 1), COARSE)])
def test_the_kernels_own_integration_agrees_to_a_part_in_ten_thousand(
    cells: Cells, fit: FitSettings, kernel_volume: Callable[[TopoDS_Shape], float]
) -> None:
    solid = solid_of(cells, fit=fit)
    assert kernel_volume(solid) == pytest.approx(enclosed_volume(solid), rel=1e-4)


@given(st.tuples(lengths, lengths, lengths), st.tuples(lengths, lengths, lengths))
@settings(max_examples=25)
def test_a_box_of_b_splines_encloses_the_product_of_its_sides(
    corner: tuple[float, float, float], sides: tuple[float, float, float]
) -> None:
    expected = sides[0] * sides[1] * sides[2]
    far = max(corner) + max(sides)
    assert enclosed_volume(nurbs_box(corner, sides)) == pytest.approx(expected, rel=1e-9, abs=1e-12 * far**3)


def test_a_solid_turned_inside_out_encloses_a_negative_volume() -> None:
    assert enclosed_volume(solid_of().Reversed()) == -enclosed_volume(solid_of())


@pytest.mark.parametrize("seed", range(4))
def test_the_enclosed_volume_does_not_depend_on_where_the_solid_stands(seed: int) -> None:
    random = np.random.default_rng(seed)
    turn, move = gp_Trsf(), gp_Trsf()
    turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(*random.normal(size=3).tolist())), random.uniform(0.5, 3))
    move.SetTranslation(gp_Vec(*random.uniform(-50, 50, 3).tolist()))
    solid = solid_of((2, 1, 1))
    for motion in (move, turn, move.Multiplied(turn)):
        moved = solid.Moved(TopLoc_Location(motion))
        assert enclosed_volume(moved) == pytest.approx(enclosed_volume(solid), rel=1e-9)


def test_a_mirror_image_encloses_the_same_volume_and_is_closed() -> None:
    mirror = gp_Trsf()
    mirror.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 0)))
    image = BRepBuilderAPI_Transform(solid_of(), mirror, True).Shape()
    assert enclosed_volume(image) == pytest.approx(enclosed_volume(solid_of()), rel=1e-9)
    assert topology(image) == topology(solid_of())


@pytest.mark.parametrize(
    ("shape", "surface"),
    [(BRepPrimAPI_MakeBox(1, 2, 3).Solid(), "Geom_Plane"), (BRepPrimAPI_MakeSphere(1).Solid(), "Geom_Spherical")],
    ids=["box", "sphere"],
)
def test_faces_that_are_no_b_splines_are_refused_by_name(shape: TopoDS_Shape, surface: str) -> None:
    with pytest.raises(KernelError, match=surface):
        enclosed_volume(shape)


def test_a_box_has_one_solid_and_six_faces_and_is_closed() -> None:
    counted = topology(BRepPrimAPI_MakeBox(1, 2, 3).Solid())
    assert counted == Topology(solids=1, faces=6, open_edges=0)
    assert counted.closed


@pytest.mark.parametrize("missing", [1, 2, 5])
def test_each_missing_side_of_a_box_opens_the_edges_it_shared_with_the_rest(missing: int) -> None:
    """Counted from the other side: edges that a lone remaining face bounds, or two missing ones do not share."""
    sides = faces(BRepPrimAPI_MakeBox(1, 2, 3).Solid())
    counted = topology(solid_round(sides[missing:]))
    # The first two sides face each other and share no edge.
    assert counted == Topology(solids=1, faces=6 - missing, open_edges={1: 4, 2: 8, 5: 4}[missing])
    assert not counted.closed


def test_a_lattice_without_one_patchs_face_has_four_open_edges() -> None:
    whole = faces(solid_of())
    counted = topology(solid_round(whole[1:]))
    assert counted == Topology(solids=1, faces=len(whole) - 1, open_edges=4)
    assert not counted.closed


def test_a_face_turned_over_leaves_its_edges_open() -> None:
    """Each of its edges still bounds two faces, but both run it the same way."""
    whole = faces(solid_of())
    turned = solid_round([whole[0].Reversed(), *whole[1:]])
    assert topology(turned).open_edges == 4
    assert not topology(turned).closed
    assert not is_valid(turned)


def test_closed_faces_that_nobody_called_a_solid_are_not_a_closed_solid() -> None:
    builder, shell = BRep_Builder(), TopoDS_Shell()
    builder.MakeShell(shell)
    for face in faces(solid_of()):
        builder.Add(shell, face)
    assert topology(shell).open_edges == 0
    assert topology(shell).solids == 0
    assert not topology(shell).closed


def test_validity_is_the_kernels_own_opinion() -> None:
    whole = faces(solid_of())
    for shape in (solid_of(), solid_round(whole), solid_round(whole[1:])):
        assert is_valid(shape) == BRepCheck_Analyzer(shape, True, True).IsValid()
    assert is_valid(solid_of())


@settings(max_examples=10, deadline=None)
@given(middle=st.tuples(st.floats(-9, 9), st.floats(-9, 9), st.floats(-9, 9)), shift=st.floats(-5, 5))
def test_fluxes_of_faces_about_any_one_place_make_up_the_volume(
    middle: tuple[float, float, float], shift: float
) -> None:
    move = gp_Trsf()
    move.SetTranslation(gp_Vec(shift, 0, 0))
    cylinder = BRepPrimAPI_MakeCylinder(2.0, 3.0).Shape().Moved(TopLoc_Location(move))
    found = np.array([measure_about(as_face(face), np.array(middle)) for face in faces(cylinder)])
    assert found.sum(axis=0) == pytest.approx([12 * np.pi, 20 * np.pi], rel=1e-6)

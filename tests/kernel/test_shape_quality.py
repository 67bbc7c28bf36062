"""Measures of shapes whose worst edge, face, gap or angle is known, and where it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakePolygon,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Sewing,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Geom import Geom_BezierCurve
from OCP.gp import gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad import Lattice
from gyroid_cad.kernel.check import compound_of, measure, parts_of
from gyroid_cad.kernel.compat import PointArray, as_edge, as_vertex
from gyroid_cad.kernel.quality import shape_quality
from gyroid_cad.kernel.step import read_step
from gyroid_cad.kernel.surfaces import kernel_curve, kernel_surface
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface

PARTS = Path(__file__).parents[3] / "shared" / "parts"
BOX = BRepPrimAPI_MakeBox(4.0, 5.0, 6.0).Shape()


def worst(shape: TopoDS_Shape, name: str) -> tuple[float, tuple[float, ...]]:
    found = shape_quality(shape).worst[name]
    return float(found.value), found.place


def prism(*corners: tuple[float, float], height: float = 3.0) -> TopoDS_Shape:
    polygon = BRepBuilderAPI_MakePolygon()
    for x, y in corners:
        polygon.Add(gp_Pnt(x, y, 0))
    polygon.Close()
    face = BRepBuilderAPI_MakeFace(polygon.Wire()).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(0, 0, height)).Shape()


def moved(shape: TopoDS_Shape, *by: float) -> TopoDS_Shape:
    transformation = gp_Trsf()
    transformation.SetTranslation(gp_Vec(*by))
    return shape.Moved(TopLoc_Location(transformation))


def test_a_box_is_closed_and_valid_and_its_shortest_edge_is_its_shortest_side() -> None:
    found = shape_quality(BOX)
    assert (found.solids, found.faces, found.closed, found.valid) == (1, 6, True, True)
    assert found.volume == pytest.approx(120, rel=1e-12)
    assert found.worst["smallest edge"].value == pytest.approx(4)
    assert found.worst["sharpest corner"].value == pytest.approx(90)
    # Of a strip the mean width is its width, of others less: twice 20 over a border of 18.
    assert found.worst["narrowest face"].value == pytest.approx(40 / 18)
    # No two faces of a box are meant to be smooth where they meet, and none is curved.
    assert [found.worst[name].value for name in ("tangency", "radius of curvature", "degree")] == [None] * 3
    counted = ("open edges", "open borders", "invalid faces", "self-intersection")
    assert [found.worst[name].value for name in counted] == [0] * 4


def test_a_chamfer_of_a_hundredth_leaves_edges_as_short_and_a_face_as_narrow_as_it_is() -> None:
    edge = as_edge(next(parts_of(BOX, TopAbs_EDGE)))
    chamfer = BRepFilletAPI_MakeChamfer(BOX)
    chamfer.Add(0.01, edge)
    found = shape_quality(chamfer.Shape()).worst
    assert found["smallest edge"].value == pytest.approx(0.01 * np.sqrt(2), rel=1e-6)
    assert found["narrowest face"].value == pytest.approx(0.01 * np.sqrt(2), rel=1e-2)
    ends = [BRep_Tool.Pnt_s(as_vertex(end)).Coord() for end in parts_of(edge, TopAbs_VERTEX)]
    assert min(np.linalg.norm(np.subtract(found["smallest edge"].place, end)) for end in ends) < 0.01


@pytest.mark.parametrize("degrees", [0.5, 4.0, 30.0])
def test_faces_that_meet_at_a_small_angle_break_tangency_by_it_and_at_a_large_one_meet_sharply(degrees: float) -> None:
    slope = np.radians(degrees)
    shape = prism((-9, 0), (9, 0), (9, 5), (0, 5 + 9 * np.tan(slope / 2)), (-9, 5))
    found = shape_quality(shape).worst["tangency"]
    if degrees > 5:
        assert found.value is None
    else:
        assert found.value == pytest.approx(degrees, rel=1e-6)
        assert found.place[:2] == pytest.approx((0, 5 + 9 * np.tan(slope / 2)))


def test_a_wedge_has_the_corner_of_its_angle_and_says_where() -> None:
    value, place = worst(prism((0, 0), (10, 0), (10, 10 * np.tan(np.radians(1.5)))), "sharpest corner")
    assert value == pytest.approx(1.5)
    assert place[:2] == pytest.approx((0, 0))


@pytest.mark.parametrize(
    ("shape", "radius", "volume"),
    [
        (BRepPrimAPI_MakeSphere(3.0).Shape(), 3, 4 / 3 * np.pi * 27),
        (BRepPrimAPI_MakeTorus(5.0, 1.5).Shape(), 1.5, 2 * np.pi**2 * 5 * 2.25),
        # A frustum from 2 to 1 mm over 2 mm is bent most where it is narrow, along its normal.
        (BRepPrimAPI_MakeCone(2.0, 1.0, 2.0).Shape(), np.sqrt(1.25), 14 / 3 * np.pi),
        (prism((0, 0), (1, 0), (0, 1)), None, 1.5),
    ],
)
def test_the_radius_of_curvature_is_that_of_the_surface(
    shape: TopoDS_Shape, radius: float | None, volume: float
) -> None:
    found = shape_quality(shape)
    assert found.worst["radius of curvature"].value == (None if radius is None else pytest.approx(radius, rel=1e-9))
    assert found.volume == pytest.approx(volume, rel=1e-7)


def curved(degree: int) -> TopoDS_Shape:
    """A prism on a curve of a degree, a flat arch over its chord."""
    poles = PointArray(1, degree + 1)
    for k in range(degree + 1):
        poles.SetValue(k + 1, gp_Pnt(k, 0 if k in (0, degree) else 2, 0))
    arch = BRepBuilderAPI_MakeEdge(Geom_BezierCurve(poles)).Edge()
    chord = BRepBuilderAPI_MakeEdge(gp_Pnt(degree, 0, 0), gp_Pnt(0, 0, 0)).Edge()
    wire = BRepBuilderAPI_MakeWire(arch, chord).Wire()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire).Face(), gp_Vec(0, 0, 3)).Shape()


@pytest.mark.parametrize("degree", [3, 12])
def test_the_degree_is_the_highest_of_any_curve_or_surface(degree: int) -> None:
    assert worst(curved(degree), "degree")[0] == degree


def plank(*inner: float) -> TopoDS_Shape:
    """A flat bilinear face of 10 by 2 mm as a solid's part, with inner knots along its length."""
    knots = np.array([0, 0, *inner, 1, 1], dtype=float)
    x = 10 * np.unique(knots)
    points = np.stack([np.stack([x, np.full_like(x, y), 0 * x], axis=-1) for y in (0.0, 2.0)], axis=1)
    surface = NurbsSurface(points, np.ones(points.shape[:2]), knots, np.array([0.0, 0, 1, 1]))
    return BRepBuilderAPI_MakeFace(kernel_surface(surface), 1e-7).Face()


def test_knots_are_as_far_apart_as_their_lines_are_in_space() -> None:
    assert worst(plank(0.5), "knot distance")[0] == pytest.approx(2)
    value, place = worst(plank(0.5, 0.501), "knot distance")
    assert value == pytest.approx(0.01)
    assert place == pytest.approx((5.005, 1, 0))


def test_a_segment_counts_where_the_edge_takes_it_up_from_knot_to_knot() -> None:
    knots = np.array([0, 0, 0.3, 0.301, 0.9, 1, 1])
    curve = kernel_curve(NurbsCurve(10 * np.outer(np.unique(knots), [1, 0, 0]), np.ones(5), knots))

    def strip(first: float, last: float) -> TopoDS_Shape:
        return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeEdge(curve, first, last).Edge(), gp_Vec(0, 0, 3)).Shape()

    assert worst(strip(0, 1), "smallest segment")[0] == pytest.approx(0.01)
    assert worst(strip(0.299, 1), "smallest segment")[0] == pytest.approx(0.01)
    # From 0.3005 on, and up to 0.3005, no more than a part of it is there.
    assert worst(strip(0.3005, 1), "smallest segment")[0] == pytest.approx(1)
    assert worst(strip(0, 0.3005), "smallest segment")[0] == pytest.approx(3)


def test_a_face_that_was_sewn_over_a_gap_is_as_far_off_its_edges_as_it_was() -> None:
    sewing = BRepBuilderAPI_Sewing(0.1)
    for number, face in enumerate(parts_of(BOX, TopAbs_FACE)):
        sewing.Add(moved(face, *(0.05 * np.eye(3)[number // 2]) * (number % 2)) if number == 5 else face)
    sewing.Perform()
    found = shape_quality(sewing.SewedShape()).worst
    assert found["gap of edge and face"].value == pytest.approx(0.05, rel=1e-2)
    assert found["largest tolerance"].value >= 0.05


def test_an_open_box_has_four_open_edges_and_no_solid() -> None:
    found = shape_quality(compound_of(list(parts_of(BOX, TopAbs_FACE))[:5]))
    assert (found.solids, found.closed, found.worst["open edges"].value) == (0, False, 4)
    assert found.worst["open edges"].place is not None


def test_sides_that_cross_are_counted_and_the_place_lies_on_both() -> None:
    value, (x, y, _) = worst(prism((0, 0), (5, 4), (4, 0), (0, 4.3)), "self-intersection")
    assert value >= 1
    assert (4 * x - 5 * y, 4.3 * x + 4 * y) == pytest.approx((0, 4 * 4.3), abs=1e-6)


def test_bodies_that_overlap_do_not_cross_themselves() -> None:
    assert worst(compound_of([BOX, moved(BOX, 1, 1, 1)]), "self-intersection")[0] == 0


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
@pytest.mark.parametrize("trim", [None, "box"])
def test_a_lattices_volume_is_that_of_its_report(trim: str | None) -> None:
    lattice = Lattice((1, 1, 1), 10, 0.8, trim=trim)
    found = shape_quality(lattice.solid())
    assert found.volume == pytest.approx(lattice.report().volume, rel=1e-9 if trim is None else 1e-6)
    assert found.worst["gap of edge and face"].value < 1e-6
    assert found.worst["self-intersection"].value == 0
    # Dense samples of both faces across all edges, by the normals of their control nets, had 0.05 degrees.
    assert found.worst["tangency"].value < 0.06


def test_a_face_that_runs_through_itself_is_told() -> None:
    # A loop of a cubic, moved along z.
    loop = np.array([(0.0, 0, 0), (3, 3, 0), (-2, 3, 0), (1, 0, 0)])
    points = np.stack([loop, loop + np.array([0, 0, 2])], axis=1)
    surface = NurbsSurface(points, np.ones((4, 2)), np.repeat([0.0, 1.0], 4), np.array([0.0, 0, 1, 1]))
    value, place = worst(BRepBuilderAPI_MakeFace(kernel_surface(surface), 1e-7).Face(), "self-intersection")
    assert value == 1
    assert place[0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("part", ["cone_apex", "io1-ug-214", "tiny_fillets", "ellipse_loft", "inner_void"])
def test_a_part_that_others_drew_is_measured_through(part: str) -> None:
    path = PARTS / f"{part}.step"
    if not path.exists():
        pytest.skip("the parts that others drew are not here")
    shape = read_step(path)
    found = shape_quality(shape)
    assert found.closed
    assert found.valid
    assert found.volume == pytest.approx(measure(shape)[0], rel=1e-4)
    assert found.worst["self-intersection"].value == 0
    if part == "tiny_fillets":
        assert found.worst["radius of curvature"].value == pytest.approx(0.1, rel=1e-6)

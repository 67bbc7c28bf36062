"""Parts from CAD: what is taken for one, and what is known of it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Sewing
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL
from OCP.TopoDS import TopoDS_Shape, TopoDS_Solid
from scipy.spatial import cKDTree

from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import compound_of, is_valid, measure, parts_of
from gyroid_cad.kernel.compat import as_edge, as_face
from gyroid_cad.kernel.part import require_part

Floats = NDArray[np.float64]

RADIUS, SIDE = 4.0, 6.0


def ball(x: float = 0.0) -> TopoDS_Shape:
    return BRepPrimAPI_MakeSphere(gp_Pnt(x, 0, 0), RADIUS).Shape()


def box() -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(SIDE, SIDE, SIDE).Shape()


def open_box() -> TopoDS_Shape:
    sewing = BRepBuilderAPI_Sewing()
    for face in list(parts_of(box(), TopAbs_FACE))[:5]:
        sewing.Add(face)
    sewing.Perform()
    return sewing.SewedShape()


def open_solid() -> TopoDS_Shape:
    builder, solid = BRep_Builder(), TopoDS_Solid()
    builder.MakeSolid(solid)
    builder.Add(solid, open_box())
    return solid


def test_a_part_knows_its_box_and_its_volume() -> None:
    part = require_part(ball())
    np.testing.assert_allclose([part.low, part.high], [3 * [-RADIUS], 3 * [RADIUS]], atol=1e-6)
    assert part.volume == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=1e-6)
    assert measure(ball())[1] == pytest.approx(4 * np.pi * RADIUS**2, rel=1e-6)


def test_a_part_may_be_several_solids() -> None:
    part = require_part(compound_of([ball(), ball(3 * RADIUS)]))
    assert len(part.solids) == 2
    assert part.volume == pytest.approx(2 * require_part(ball()).volume)
    assert part.contains(np.array([[0.0, 0, 0], [3 * RADIUS, 0, 0], [1.5 * RADIUS, 0, 0]])).tolist() == [
        True,
        True,
        False,
    ]


@pytest.mark.parametrize(
    ("shape", "words"),
    [
        (None, "an empty one"),
        (TopoDS_Shape(), "an empty one"),
        (next(parts_of(box(), TopAbs_FACE)), "there is none in it"),
        (next(parts_of(box(), TopAbs_SHELL)), "there is none in it"),
        (open_box(), "there is none in it"),
        (open_solid(), "its solid has 4 open edges"),
        (box().Reversed(), "inside out"),
    ],
)
def test_what_is_no_closed_solid_is_refused_with_what_is_wrong(shape: TopoDS_Shape | None, words: str) -> None:
    with pytest.raises(ParameterError, match=r"^part = ") as caught:
        require_part(shape)  # type: ignore[arg-type]
    assert words in str(caught.value)


def seams(shape: TopoDS_Shape) -> int:
    """Count edges that a face has on both sides of itself."""
    both = ((face, edge) for face in parts_of(shape, TopAbs_FACE) for edge in parts_of(face, TopAbs_EDGE))
    return sum(BRep_Tool.IsClosed_s(as_edge(edge), as_face(face)) for face, edge in both)


def test_a_bored_ball_is_parted_at_its_seams_and_stays_as_it_was_given() -> None:
    # The kernel leaves the new edges invalid there, and the whole was taken as it came: lattices cut faces whose seams
    # no reader of STEP could tell.
    bored = ball()
    for x, y, z in np.eye(3):
        axis = gp_Ax2(gp_Pnt(-9 * x, -9 * y, -9 * z), gp_Dir(x, y, z))
        bored = BRepAlgoAPI_Cut(bored, BRepPrimAPI_MakeCylinder(axis, 0.5, 18).Shape()).Shape()
    before, volume = seams(bored), measure(bored)[0]
    part = require_part(bored)
    assert before > 0
    assert seams(part.shape) == 0
    assert is_valid(part.shape)
    assert measure(part.shape)[0] == pytest.approx(volume, rel=1e-6)
    assert (seams(bored), is_valid(bored)) == (before, True)


def test_points_are_held_by_the_ball_that_their_distance_says() -> None:
    points = np.random.default_rng(1).uniform(-RADIUS, RADIUS, (300, 3))
    assert np.array_equal(require_part(ball()).contains(points), np.linalg.norm(points, axis=1) < RADIUS)


@pytest.mark.parametrize("spacing", [0.3, 2.0])
def test_no_place_on_the_boundary_is_further_from_the_samples_than_is_said(spacing: float) -> None:
    random = np.random.default_rng(2)
    directions = random.normal(size=(2000, 3))
    sphere = RADIUS * directions / np.linalg.norm(directions, axis=1, keepdims=True)
    sides = random.uniform(0, SIDE, (2000, 3))
    sides[np.arange(2000), random.integers(0, 3, 2000)] = SIDE * random.integers(0, 2, 2000)
    turn = random.uniform(0, 2 * np.pi, 2000)
    mantle = np.column_stack([RADIUS * np.cos(turn), RADIUS * np.sin(turn), random.uniform(0, 20, 2000)])
    for shape, places in ((ball(), sphere), (box(), sides), (BRepPrimAPI_MakeCylinder(RADIUS, 20).Shape(), mantle)):
        points, _, error = require_part(shape).surface_samples(spacing)
        assert cKDTree(points).query(places)[0].max() <= error <= 1.3 * spacing
        if shape is not None and places is sphere:
            assert np.linalg.norm(points, axis=1).min() > RADIUS - error


def test_sampling_leaves_no_triangles_on_the_users_part() -> None:
    from OCP.BRep import BRep_Tool
    from OCP.TopLoc import TopLoc_Location

    shape = ball()
    require_part(shape).surface_samples(0.5)
    for face in parts_of(shape, TopAbs_FACE):
        assert BRep_Tool.Triangulation_s(as_face(face), TopLoc_Location()) is None


def test_the_volume_of_a_vase_is_that_of_the_discs_it_is_made_of() -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    profile = cq.Workplane("XZ").lineTo(6, 0).spline([(4, 4), (3, 8), (5, 12), (9, 18), (8, 26)], includeCurrent=True)
    profile = profile.lineTo(0, 26).close()
    (curve,) = (edge for edge in profile.val().Edges() if edge.geomType() == "BSPLINE")
    x, _, z = np.array([place.toTuple() for place in curve.positions(np.linspace(0, 1, 20_001))]).T
    cones = np.pi * np.diff(z) * (x[1:] ** 2 + x[1:] * x[:-1] + x[:-1] ** 2) / 3
    vase = profile.revolve(360, (0, 0, 0), (0, 1, 0)).val().wrapped
    assert require_part(vase).volume == pytest.approx(abs(cones.sum()), rel=1e-6)


def test_the_same_cylinder_on_splines_is_of_free_form_all_over() -> None:
    cylinder = BRepPrimAPI_MakeCylinder(RADIUS, SIDE).Shape()
    part, splines = (require_part(shape) for shape in (cylinder, BRepBuilderAPI_NurbsConvert(cylinder).Shape()))
    assert part.free_form_area == 0
    assert splines.free_form_area == pytest.approx(part.area, rel=1e-3)
    assert (splines.volume, splines.face_count) == (pytest.approx(part.volume, rel=1e-6), part.face_count)

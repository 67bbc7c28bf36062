"""Cores of offset pieces: exact volumes, depths, kinds of faces, what vanishes, random parts, what does not close."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import build123d as bd
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from numpy.typing import NDArray
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_NurbsConvert
from OCP.Convert import Convert_TgtThetaOver2_4
from OCP.Geom import Geom_Circle, Geom_TrimmedCurve
from OCP.GeomAbs import (
    GeomAbs_BSplineSurface,
    GeomAbs_Cylinder,
    GeomAbs_OffsetSurface,
    GeomAbs_Sphere,
    GeomAbs_SurfaceType,
)
from OCP.GeomConvert import GeomConvert
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Face, TopoDS_Solid

import gyroid_cad.kernel.sieve
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.kernel.check import compound_of, is_valid, measure, parts_of, topology
from gyroid_cad.kernel.compat import as_edge, as_face, as_solid, as_vertex
from gyroid_cad.kernel.depth import Depths, FaceDistances, points_on
from gyroid_cad.kernel.offset_surface import curve_points
from gyroid_cad.kernel.part import require_part
from gyroid_cad.kernel.sieve import core_of_pieces
from gyroid_cad.kernel.skin import hollow
from gyroid_cad.kernel.step import read_step, write_step

Floats = NDArray[np.float64]

PARTS = Path(__file__).resolve().parents[3] / "shared" / "parts"


def solid_of(made: bd.Shape) -> TopoDS_Solid:
    (solid,) = require_part(compound_of(one.wrapped for one in made.solids())).solids
    return solid


def notched() -> bd.Part:
    """A cube of 10 with a cube of 4 cut out of a corner: three edges and a corner that point inwards."""
    return bd.Pos(5, 5, 5) * bd.Box(10, 10, 10) - bd.Pos(8, 8, 8) * bd.Box(4, 4, 4)


def finned() -> bd.Part:
    """Two blocks that a rib of 1 joins."""
    return bd.Pos(-8) * bd.Box(6, 6, 6) + bd.Pos(8) * bd.Box(6, 6, 6) + bd.Box(16, 1, 4)


def loft() -> bd.Part:
    sections = [bd.Pos(0, 0, z) * bd.Ellipse(a, b) for z, a, b in ((0, 6, 4), (6, 5, 5), (12, 6, 3))]
    return bd.loft([bd.make_face(section.edges()) for section in sections])


# Of the cube within the notched one: less the notch, grown by 1.
NOTCHED = 512 - (27 + 27 + 9 * np.pi / 4 + np.pi / 6)


@pytest.mark.parametrize(
    ("made", "skin", "volume", "solids"),
    [
        (bd.Box(9, 8, 7), 1.0, 7 * 6 * 5, 1),
        (notched(), 1.0, NOTCHED, 1),
        (bd.fillet(bd.Box(9, 8, 7).edges(), 0.3), 1.0, 7 * 6 * 5, 1),
        (bd.fillet(bd.Box(9, 8, 7).edges(), 2.0), 2.0, 5 * 4 * 3, 1),
        (bd.Box(9, 8, 7) - bd.Sphere(1.0), 1.0, 7 * 6 * 5 - 4 / 3 * np.pi * 8, 1),
        (bd.Torus(10, 4), 1.0, 2 * np.pi**2 * 10 * 9, 1),
        (bd.Box(20, 20, 8) - bd.Cylinder(4, 8), 1.0, (18 * 18 - np.pi * 25) * 6, 1),
    ],
    ids=["box", "notch", "small fillets", "fillets as wide", "void", "torus", "hole"],
)
def test_a_core_of_pieces_has_the_volume_that_geometry_gives(
    made: bd.Shape, skin: float, volume: float, solids: int
) -> None:
    core = core_of_pieces(solid_of(made), skin)
    assert len(core) == solids
    assert all(is_valid(one) and topology(one).closed for one in core)
    assert sum(measure(one)[0] for one in core) == pytest.approx(volume, rel=1e-5)


def capsule() -> bd.Part:
    """A cylinder that passes into half a ball."""
    return bd.Pos(0, 0, -4) * bd.Cylinder(6, 8) + bd.Sphere(6)


def faces_of(solid: TopoDS_Solid, kind: GeomAbs_SurfaceType) -> list[TopoDS_Face]:
    faces = [as_face(face) for face in parts_of(solid, TopAbs_FACE)]
    return [face for face in faces if BRepAdaptor_Surface(face).GetType() == kind]


@pytest.mark.parametrize(
    ("made", "kind", "volume"),
    [
        (bd.Sphere(10) - bd.Cylinder(4, 20), GeomAbs_Cylinder, 4 / 3 * np.pi * 65**1.5),
        (bd.Sphere(10) - bd.Cylinder(4, 20), GeomAbs_Sphere, None),
        (capsule(), GeomAbs_Sphere, None),
        (capsule(), GeomAbs_Cylinder, None),
    ],
    ids=["bore", "ball", "dome", "mantle"],
)
def test_openings_may_be_curved_and_smooth_at_their_borders(
    made: bd.Shape, kind: GeomAbs_SurfaceType, volume: float | None
) -> None:
    solid = solid_of(made)
    openings = faces_of(solid, kind)
    core = core_of_pieces(solid, 1.0, openings)
    assert all(is_valid(one) and topology(one).closed for one in core)
    assert Depths(solid, openings).confirm(core, 1.0)
    if volume is not None:
        assert sum(measure(one)[0] for one in core) == pytest.approx(volume, rel=1e-5)
    made_hollow = hollow(require_part(solid), 1.0, openings)
    assert any(made_hollow.opened)
    assert made_hollow.core.volume == pytest.approx(sum(measure(one)[0] for one in core), rel=1e-4)


def test_a_rib_thinner_than_two_skins_has_no_core() -> None:
    solid = solid_of(finned())
    core = core_of_pieces(solid, 1.0)
    assert len(core) == 2
    assert Depths(solid, []).confirm(core, 1.0)


def kinds(core: list[TopoDS_Solid]) -> set[str]:
    return {BRepAdaptor_Surface(as_face(face)).GetType().name for one in core for face in parts_of(one, TopAbs_FACE)}


def test_offsets_of_planes_cylinders_spheres_and_tori_stay_of_their_kind() -> None:
    plate = bd.fillet(bd.Box(20, 16, 6).edges(), 2) - bd.Cylinder(2.5, 6)
    core = core_of_pieces(solid_of(plate), 1.0)
    assert kinds(core) == {f"GeomAbs_{kind}" for kind in ("Plane", "Cylinder", "Sphere")}
    assert kinds(core_of_pieces(solid_of(bd.Torus(10, 4)), 1.0)) == {"GeomAbs_Torus"}


def test_edges_that_point_inwards_become_cylinders_and_tori_and_corners_balls() -> None:
    assert kinds(core_of_pieces(solid_of(notched()), 1.0)) == {f"GeomAbs_{k}" for k in ("Plane", "Cylinder", "Sphere")}
    stepped = bd.Cylinder(8, 6) + bd.Pos(0, 0, 6) * bd.Cylinder(4, 6)
    core = core_of_pieces(solid_of(stepped), 1.0)
    assert kinds(core) == {f"GeomAbs_{k}" for k in ("Plane", "Cylinder", "Torus")}
    assert Depths(solid_of(stepped), []).confirm(core, 1.0)


def largest_error(solid: TopoDS_Solid, core: list[TopoDS_Solid], skin: float) -> float:
    """Of the depth of a core's faces, in skins."""
    depths = FaceDistances(parts_of(solid, TopAbs_FACE))
    points = [points_on(as_face(face), 4) for one in core for face in parts_of(one, TopAbs_FACE)]
    return float(np.abs(depths.distances(np.concatenate(points)) / skin - 1).max())


def test_offsets_of_splines_are_fitted_and_the_core_comes_whole_out_of_a_step_file(tmp_path: Path) -> None:
    solid = solid_of(loft())
    core = core_of_pieces(solid, 0.8)
    assert largest_error(solid, core, 0.8) < 1e-3
    assert Depths(solid, []).confirm(core, 0.8)
    types = [BRepAdaptor_Surface(as_face(face)).GetType() for one in core for face in parts_of(one, TopAbs_FACE)]
    assert GeomAbs_BSplineSurface in types
    assert GeomAbs_OffsetSurface not in types
    write_step(compound_of(core), tmp_path / "core.step")
    back = read_step(tmp_path / "core.step")
    assert topology(back) == topology(compound_of(core))
    assert measure(back)[0] == pytest.approx(sum(measure(one)[0] for one in core), rel=1e-6)


@pytest.mark.skipif(not PARTS.exists(), reason="the parts are not here")
@pytest.mark.parametrize(("name", "skin"), [("ellipse_loft", 0.48), ("tangent", 0.42), ("tiny_fillets", 0.36)])
def test_parts_that_others_drew_have_cores(name: str, skin: float) -> None:
    (solid,) = require_part(read_step(PARTS / f"{name}.step")).solids
    core = core_of_pieces(solid, skin)
    assert Depths(solid, []).confirm(core, skin)


def test_faces_that_close_on_themselves_and_are_splines_have_cores_too() -> None:
    stepped = bd.Cylinder(8, 6) + bd.Pos(0, 0, 6) * bd.Cylinder(4, 6)
    (exact,) = core_of_pieces(solid_of(stepped), 1.0)
    splines = BRepBuilderAPI_NurbsConvert(stepped.solids()[0].wrapped, True).Shape()
    (core,) = core_of_pieces(as_solid(next(parts_of(splines, TopAbs_SOLID))), 1.0)
    assert is_valid(core)
    assert topology(core).closed
    assert measure(core)[0] == pytest.approx(measure(exact)[0], rel=1e-4)


def test_tubes_that_touch_before_they_cross_are_cut_where_places_are_called_one_more_freely() -> None:
    block = bd.Pos(-0.354, 1.975, -1.587) * bd.Rot(28.723, 85.504, 40.446) * bd.Box(8.233, 6.438, 4.016)
    solid = solid_of(bd.Cylinder(2.779, 6.814) + block)
    core = core_of_pieces(solid, 0.227)
    assert all(is_valid(one) and topology(one).closed for one in core)
    assert Depths(solid, []).confirm(core, 0.227)


def test_where_it_does_not_close_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    def all_but_one(*arguments: object) -> tuple[list[TopoDS_Face], list[TopoDS_Face]]:
        kept, opened = pieces(*arguments)  # type: ignore[arg-type]
        return kept[1:], opened

    pieces = gyroid_cad.kernel.sieve.offset_pieces
    monkeypatch.setattr(gyroid_cad.kernel.sieve, "offset_pieces", all_but_one)
    with pytest.raises(KernelError, match=r"inner side of the skin does not close round \(-?\d"):
        core_of_pieces(solid_of(bd.Box(9, 8, 7)), 1.0)


lengths = st.floats(3.0, 9.0)
bodies = st.one_of(
    st.builds(bd.Box, lengths, lengths, lengths),
    st.builds(bd.Cylinder, st.floats(2.0, 5.0), lengths),
    st.builds(bd.Cone, st.floats(4.0, 6.0), st.floats(2.0, 3.5), lengths),
    st.builds(bd.Sphere, st.floats(2.5, 5.0)),
)
turns = st.tuples(*3 * [st.floats(0.0, 90.0)])
moves = st.tuples(*3 * [st.floats(-2.0, 2.0)])


@given(bodies, bodies, turns, moves, st.booleans(), st.floats(0.1, 0.5))
@settings(max_examples=2, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
def test_a_random_part_has_a_skin_or_is_refused_with_a_reason(
    one: bd.Part, other: bd.Part, turn: Sequence[float], move: Sequence[float], joined: bool, skin: float
) -> None:
    second = bd.Pos(*move) * bd.Rot(*turn) * other
    made = one + second if joined else one - second
    for piece in made.solids():
        part = require_part(piece.wrapped)
        try:
            core = hollow(part, skin).core
        except (KernelError, ParameterError) as refused:
            print(f"refused: {refused}")
            continue
        assert Depths(part.solids[0], []).confirm(core.solids, skin)


def with_coarse_edges(made: bd.Shape) -> TopoDS_Solid:
    """A solid whose circles are splines that run through them at another pace, as some programs write them."""
    solid, builder = BRepBuilderAPI_Copy(solid_of(made)).Shape(), BRep_Builder()
    for edge in map(as_edge, parts_of(solid, TopAbs_EDGE)):
        circle, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
        if isinstance(circle, Geom_Circle):
            piece = Geom_TrimmedCurve(circle, first, last)
            spline = GeomConvert.CurveToBSplineCurve_s(piece, Convert_TgtThetaOver2_4)
            parameters = np.linspace(first, last, 40)
            off = float(
                np.linalg.norm(curve_points(spline, parameters) - curve_points(circle, parameters), axis=1).max()
            )
            builder.UpdateEdge(edge, spline, 1.1 * off)
            for end in parts_of(edge, TopAbs_VERTEX):
                builder.UpdateVertex(as_vertex(end), 1.1 * off)
    assert is_valid(solid)
    return as_solid(solid)


def test_a_part_whose_edges_are_coarser_than_its_faces_has_a_valid_core() -> None:
    bolt = bd.Cylinder(5, 12) + bd.Pos(0, 0, 7) * bd.Cylinder(8, 4)
    exact, coarse = (compound_of(core_of_pieces(solid, 1.0)) for solid in (solid_of(bolt), with_coarse_edges(bolt)))
    assert is_valid(coarse)
    assert measure(coarse)[0] == pytest.approx(measure(exact)[0], rel=1e-3)

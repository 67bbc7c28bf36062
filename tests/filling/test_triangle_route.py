"""Parts filled by triangles alone: what comes out is closed, of the right volume, and read by other programs."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from gyroid_cad import FilledTriangles, Lattice, ParameterError, fill
from gyroid_cad.cli.app import main
from gyroid_cad.errors import KernelError, PartWarning, SealedVoidsWarning
from gyroid_cad.filling.part import Filling
from gyroid_cad.filling.triangle_part import triangle_part
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import compound_of
from gyroid_cad.mesh.triangles.measures import unmatched_edges
from gyroid_cad.surface.families import USUAL

CELL, DEVIATION = 6.0, 0.02


def ball(radius: float = 6.0) -> Any:
    return BRepPrimAPI_MakeSphere(gp_Pnt(1.0, 2.0, 3.0), radius).Shape()


def box(*sides: float) -> Any:
    return BRepPrimAPI_MakeBox(*sides).Shape()


def filled(part: Any, **given: Any) -> FilledTriangles:
    usual = {"cell_size": CELL, "density": 0.3, "route": "triangles", "deviation": DEVIATION}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made: Any = fill(part, **{**usual, **given})
    return made


def read(path: Path) -> Any:
    return trimesh.load(path, force="mesh")


@pytest.mark.parametrize("ending", ["stl", "3mf", "obj", "ply"])
def test_another_program_finds_every_file_closed_and_of_the_volume_reported(ending: str, tmp_path: Path) -> None:
    made = filled(ball())
    made.write(tmp_path / f"ball.{ending}")
    mesh = read(tmp_path / f"ball.{ending}")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(made.report.volume, rel=1e-6)


def test_wall_and_channels_make_up_the_part_and_so_do_both_networks() -> None:
    part = ball()
    volumes = {kind: filled(part, kind=kind, keep_islands=True).report.volume for kind in ("sheet", "channels")}
    whole = filled(part).report.part_volume
    assert sum(volumes.values()) == pytest.approx(whole, rel=1e-6)
    networks = [filled(part, kind=kind, density=0.5, keep_islands=True).report for kind in ("network-a", "network-b")]
    assert sum(report.volume for report in networks) == pytest.approx(whole, rel=2e-3)


@pytest.mark.parametrize("density", [0.35, 0.65])
def test_a_network_has_its_own_density_below_and_above_one_half(density: float) -> None:
    made = filled(box(12.0, 12.0, 12.0), kind="network-a", density=density)
    assert made.report.density == pytest.approx(density, rel=5e-3)


@pytest.mark.parametrize("surface", ["gyroid", "diamond", "primitive"])
def test_whole_periods_of_every_surface_hold_what_the_tube_formula_says(surface: Any) -> None:
    made = filled(box(CELL, CELL, 2 * CELL), surface=surface, keep_islands=True, deviation=0.01)
    assert made.report.density == pytest.approx(0.3, rel=2e-3)


def test_the_volume_converges_with_the_square_of_the_steps_that_is_with_the_deviation() -> None:
    part, thickness = box(CELL, CELL, CELL), 0.6
    exact = USUAL.tube.density(thickness / CELL) * CELL**3
    given = {"density": None, "thickness": thickness, "keep_islands": True}
    errors = [abs(filled(part, deviation=deviation, **given).report.volume / exact - 1) for deviation in (0.1, 0.01)]
    assert errors[1] < 2e-4
    assert errors[1] < 0.5 * errors[0] or errors[0] < 2e-4


def test_both_routes_fill_a_box_alike() -> None:
    part = box(7.0, 6.0, 5.0)
    given = {"cell_size": CELL, "density": "0.2 + 0.02*x", "origin": (1.0, 2.0, 3.0), "rotation": (10.0, 20.0, 30.0)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        exact = fill(part, **given).report  # type: ignore[arg-type]
    made = filled(part, **given).report
    assert made.volume == pytest.approx(exact.volume, rel=2e-3)
    assert made.area == pytest.approx(exact.area, rel=1e-2)
    assert (made.route, exact.route) == ("triangles", "brep")


def test_a_block_of_mapped_cells_fills_a_part_too() -> None:
    lattice = Lattice((2, 2, 2), CELL, density=0.3, scale_field="1 + 0.01*x", origin=(-6.0, -6.0, -6.0))
    made = filled(box(5.0, 5.0, 5.0), cell_size=None, density=None, lattice=lattice)
    assert made.report.solids >= 1
    assert 0.2 < made.report.density < 0.4


def test_triangles_of_a_file_are_a_part_as_their_solid_is(tmp_path: Path) -> None:
    solid = filled(box(6.0, 7.0, 8.0))
    trimesh.creation.box(bounds=[[0, 0, 0], [6, 7, 8]]).export(tmp_path / "part.stl")
    for ending in ("stl", "obj", "ply"):
        read(tmp_path / "part.stl").export(tmp_path / f"part.{ending}")
        made = filled(tmp_path / f"part.{ending}")
        assert made.report.volume == pytest.approx(solid.report.volume, rel=1e-6)


def test_a_part_far_from_the_origin_keeps_its_digits_and_files_of_single_precision_are_refused(tmp_path: Path) -> None:
    far = filled(BRepPrimAPI_MakeBox(gp_Pnt(60000.0, 0.0, 0.0), 6.0, 6.0, 6.0).Shape())
    near = filled(box(6.0, 6.0, 6.0))
    assert far.report.volume == pytest.approx(near.report.volume, rel=1e-6)
    far.write(tmp_path / "far.ply")
    assert read(tmp_path / "far.ply").is_watertight
    with pytest.raises(ParameterError, match="origin"):
        far.write(tmp_path / "far.stl")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"kind": "surface", "density": None}, "kind = 'surface': expected one that bounds a volume"),
        ({"route": "mesh"}, "route = 'mesh': expected brep or triangles"),
        ({"deviation": -1.0}, "deviation = -1.0: expected a length above 0 mm"),
        ({"deviation": 1000.0}, "deviation = 1000.0: expected a length below the cell size"),
        ({"route": "brep"}, "deviation = 0.02: expected none at route brep"),
    ],
)
def test_what_the_route_cannot_do_is_refused_in_one_line(options: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        filled(ball(), **options)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_no_step_file_comes_of_triangles(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"\.stl, \.3mf, \.obj or \.ply"):
        filled(box(4.0, 4.0, 4.0)).write(tmp_path / "part.step")
    assert not list(tmp_path.iterdir())


def test_a_brep_part_is_written_by_name(tmp_path: Path) -> None:
    write_brep(ball(), tmp_path / "ball.brep")
    assert filled(tmp_path / "ball.brep").report.volume == pytest.approx(filled(ball()).report.volume, rel=1e-9)


@pytest.mark.parametrize("openings", [[], [">Z"], [(3.0, 4.0, 8.0)]])
def test_a_skin_of_a_box_is_that_of_a_smaller_box_open_where_it_is_asked_to_be(openings: list[Any]) -> None:
    sides, skin = np.array([6.0, 7.0, 8.0]), 0.8
    made = filled(box(*sides), skin=skin, openings=openings, kind="channels", keep_islands=True)
    low, high = np.full(3, skin), sides - skin
    if openings:
        high[2] = sides[2]
    core = filled(BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Shape(), kind="channels", keep_islands=True)
    assert made.report.volume == pytest.approx(core.report.volume, rel=1e-4)
    solid = filled(box(*sides), skin=skin, openings=openings)
    assert solid.report.volume + made.report.volume == pytest.approx(float(np.prod(sides)), rel=1e-4)
    assert bool(solid.report.voids) == (not openings)


def test_a_skin_round_a_ball_keeps_within_the_deviation() -> None:
    made = filled(ball(6.0), skin=1.0, kind="channels", keep_islands=True)
    core = filled(ball(5.0), kind="channels", keep_islands=True)
    assert made.report.volume == pytest.approx(core.report.volume, rel=5e-3)
    # Its triangles' corners may lie beyond the inner side by the deviations of the ball and of the side.
    reach = np.linalg.norm(made.vertices - [1.0, 2.0, 3.0], axis=1).max()
    assert reach == pytest.approx(5.0, abs=2 * DEVIATION)


def test_the_voids_of_a_skin_are_counted_and_warned_of_and_the_skin_may_be_too_thick() -> None:
    with pytest.warns(SealedVoidsWarning, match="2 voids that no opening reaches"):
        report = fill(ball(), CELL, density=0.3, route="triangles", deviation=0.05, skin=1.0).report
    assert len(report.voids) == 2
    with pytest.raises(ParameterError, match=r"skin = 7.0: expected below about (5\.\d|6)"):
        filled(ball(), skin=7.0)


def test_a_skin_of_triangles_opens_at_the_flat_region_that_is_meant(tmp_path: Path) -> None:
    trimesh.creation.box(bounds=[[0, 0, 0], [6, 7, 8]]).export(tmp_path / "part.stl")
    expected = filled(box(6.0, 7.0, 8.0), skin=0.8, openings=[">Z"]).report.volume
    for opening in (">Z", (3.0, 3.0, 8.0)):
        made = filled(tmp_path / "part.stl", skin=0.8, openings=[opening])
        assert made.report.volume == pytest.approx(expected, rel=1e-5)
    with pytest.raises(ParameterError, match="the nearest is 2 mm away"):
        filled(tmp_path / "part.stl", skin=0.8, openings=[(3.0, 3.0, 10.0)])


def test_a_core_of_the_users_own_leaves_the_skin_that_is_round_it() -> None:
    inner = BRepPrimAPI_MakeBox(gp_Pnt(0.5, 0.7, 0.9), gp_Pnt(5.5, 6.3, 8.0)).Shape()
    made = filled(box(6.0, 7.0, 8.0), core=inner)
    assert made.report.skin == pytest.approx(0.5, abs=1e-6)
    core = filled(inner, kind="channels", keep_islands=True).report.volume
    assert made.report.volume + core == pytest.approx(336.0, rel=1e-4)
    with pytest.raises(ParameterError, match="a solid inside the part; it is 1 mm outside"):
        filled(box(6.0, 7.0, 7.0), core=inner)


def test_bodies_are_filled_each_by_itself_and_those_that_overlap_are_united() -> None:
    apart = compound_of([box(4.0, 4.0, 4.0), BRepPrimAPI_MakeBox(gp_Pnt(9.0, 0.0, 0.0), 4.0, 4.0, 4.0).Shape()])
    made = filled(apart)
    assert (made.report.bodies, made.report.part_volume) == (2, pytest.approx(128.0))
    overlapping = compound_of([box(4.0, 4.0, 4.0), BRepPrimAPI_MakeBox(gp_Pnt(2.0, 1.0, 1.0), 4.0, 4.0, 4.0).Shape()])
    with pytest.warns(PartWarning, match="2 solids have 18 mm3 in common: united"):
        united = fill(overlapping, CELL, density=0.3, route="triangles", deviation=0.05)
    assert united.report.part_volume == pytest.approx(110.0)
    assert united.report.bodies == 1


# As they come from other programs, beside the repository where they are there.
PARTS = Path(__file__).resolve().parents[2].parent / "shared" / "parts"


@pytest.mark.parametrize("name", ["nozzle_band", "touching", "cone_apex"])
@pytest.mark.parametrize("share", [None, 0.03])
def test_parts_of_other_programs_are_filled_and_closed(name: str, share: float | None, tmp_path: Path) -> None:
    if not (PARTS / f"{name}.step").exists():
        pytest.skip("the parts are not there")
    part = triangle_part(PARTS / f"{name}.step", (), 0.5)
    size = float((part.high - part.low).min())
    skin = None if share is None else share * size
    made = filled(PARTS / f"{name}.step", cell_size=size / 3, deviation=size / 100, skin=skin)
    made.write(tmp_path / "part.stl")
    assert read(tmp_path / "part.stl").is_watertight
    if skin is None:
        # What is dropped of it are islands, and the part is not many cells wide.
        assert made.report.density == pytest.approx(0.3, rel=0.1)


SIDES = st.floats(3.0, 7.0)
PLACES = st.floats(-3.0, 3.0)


def primitive(kind: str, side: float, place: tuple[float, float, float]) -> Any:
    at = gp_Pnt(*place)
    if kind == "ball":
        return BRepPrimAPI_MakeSphere(at, side / 1.5).Shape()
    if kind == "box":
        return BRepPrimAPI_MakeBox(at, side, side + 1.0, side - 1.0).Shape()
    return BRepPrimAPI_MakeCylinder(gp_Ax2(at, gp_Dir(1.0, 0.5, 0.2)), side / 2, side).Shape()


@settings(max_examples=3, deadline=None)
@given(
    st.lists(
        st.tuples(st.sampled_from(["ball", "box", "cylinder"]), SIDES, st.tuples(PLACES, PLACES, PLACES)),
        min_size=1,
        max_size=3,
    ),
    st.booleans(),
)
def test_whatever_solids_overlap_wall_and_channels_make_up_what_they_take_up(pieces: list[Any], skinned: bool) -> None:
    part = compound_of([primitive(*piece) for piece in pieces])
    given_skin = {"skin": 0.4} if skinned else {}
    volumes = []
    for kind in ("sheet", "channels"):
        made = filled(part, kind=kind, keep_islands=True, deviation=0.1, **given_skin)
        assert unmatched_edges(made.triangles) == 0
        volumes.append(made.report.volume)
    # Voids too small to be any, and corners moved by a part of the deviation.
    assert sum(volumes) == pytest.approx(made.report.part_volume, rel=2e-3)


def test_where_the_kernel_fails_its_error_names_the_way_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def failing(*_: object) -> None:
        raise KernelError("pieces do not close")

    monkeypatch.setattr(Filling, "run", failing)
    with pytest.raises(KernelError, match='pieces do not close; route="triangles" fills it for STL, 3MF, OBJ and PLY'):
        fill(ball(), CELL, density=0.3)
    write_brep(ball(), tmp_path / "ball.brep")
    arguments = ["fill", str(tmp_path / "ball.brep"), "-o", str(tmp_path / "a.step"), "--cell-size", "6"]
    assert main([*arguments, "--density", "0.3"]) == 1
    assert "pieces do not close; --route triangles fills it for STL" in capsys.readouterr().err


def test_the_route_follows_from_what_is_written_unless_it_is_chosen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_brep(box(4.0, 4.0, 4.0), tmp_path / "box.brep")
    usual = ["fill", str(tmp_path / "box.brep"), "--cell-size", "8", "--density", "0.3", "--json", "--deviation", "0.1"]
    routes = []
    for options in (["a.stl"], ["b.step"], ["c.stl", "--route", "brep"]):
        assert main([*usual, "--control-points", "5", "-o", str(tmp_path / options[0]), *options[1:]]) == 0
        routes.append(json.loads(capsys.readouterr().out)["route"])
    assert routes == ["triangles", "brep", "brep"]

"""The lattice: what it accepts, what it says of itself, what it makes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import FrozenInstanceError, asdict
from fractions import Fraction
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from OCP.gp import gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location

from gyroid_cad import Lattice
from gyroid_cad.errors import FitError, GyroidError, IslandsWarning, ParameterError
from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.step import read_step
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings

TUBE = USUAL.tube

GOOD: dict[str, Any] = {"cells": (1, 1, 1), "cell_size": 10.0, "thickness": 0.8}
COARSE = FitSettings(5)

relative_thicknesses = st.floats(1e-3, 0.376)
densities = st.floats(1e-3, 0.94)
sizes = st.floats(1.0, 1e3)

NUMBER_WORDS = "a finite number"
FIELD_WORDS = "a number, an expression of x, y, z, a Field or a function"
CELL_WORDS = "three whole numbers, each from 1 to 1000000"
WALL_WORDS = "and below 3.7647 mm"
DENSITY_WORDS = f"above 0 and below {TUBE.max_density:.5f}"
BAD_CELLS = [0, -1, 1.5, True, "2", None, nan]


@pytest.mark.parametrize(
    ("parameter", "value", "accepted"),
    [
        *(("cell_size", value, NUMBER_WORDS) for value in (nan, inf, -inf, "10", None, True, 1j, [10])),
        *(("cell_size", value, "0.01 to 100000 mm") for value in (0.0, -10.0, 1e-3, 1e6)),
        *(("thickness", value, NUMBER_WORDS) for value in (nan, inf)),
        *(("thickness", value, FIELD_WORDS) for value in (True, [0.8], 1j)),
        *(("tolerance", value, NUMBER_WORDS) for value in (nan, inf, "1e-4", True)),
        *(("tolerance", value, "above 0 and below 1") for value in (0.0, -1e-4, 1.0)),
        *(("map", value, "cylinder") for value in (30, ["twist"], "cone:radius=3")),
        *(("scale_field", value, FIELD_WORDS) for value in (True, (1, 2))),
        *(
            ("thickness", value, WALL_WORDS)
            for value in (0.0, -0.8, 1e-5, TUBE.thickness_limit * 10, TUBE.max_thickness * 10, 3.765, 10.0)
        ),
        *(("cells", (bad, 1, 1), CELL_WORDS) for bad in BAD_CELLS),
        *(("cells", (1, 1, bad), CELL_WORDS) for bad in BAD_CELLS),
        *(("cells", bad, CELL_WORDS) for bad in ((), (1, 1), (1, 1, 1, 1), 2, None, "111")),
        *(("fit", bad, "a FitSettings") for bad in (10, None, "paper")),
    ],
)
def test_a_bad_value_is_refused_in_one_line_with_its_name_and_what_is_accepted(
    parameter: str, value: object, accepted: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        Lattice(**{**GOOD, parameter: value})
    message = str(caught.value)
    assert message.startswith(f"{parameter} = {value!r}: expected ")
    assert accepted in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("density", "accepted"),
    [
        *((value, NUMBER_WORDS) for value in (nan, inf)),
        *((value, FIELD_WORDS) for value in (False, {0.2})),
        *((value, DENSITY_WORDS) for value in (0.0, -0.2, TUBE.max_density, 0.941, 1.0, 24.5)),
        (1e-9, "at least 3.09e-05"),
    ],
)
def test_a_bad_density_is_refused_in_one_line_with_the_range(density: object, accepted: str) -> None:
    with pytest.raises(ParameterError) as caught:
        Lattice((1, 1, 1), 10.0, density=density)  # type: ignore[arg-type]
    assert str(caught.value).startswith(f"density = {density!r}: expected ")
    assert accepted in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("given_values", [{}, {"thickness": 0.8, "density": 0.2}])
def test_thickness_and_density_exclude_each_other_and_one_is_needed(given_values: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match="exactly one of the two"):
        Lattice((1, 1, 1), 10.0, **given_values)


@pytest.mark.parametrize("count", [3, 41, 0, -10, 2.5, 10.0, True, "10", None])
def test_a_bad_number_of_control_points_is_refused(count: object) -> None:
    with pytest.raises(ParameterError, match=r"^control_points = ") as caught:
        FitSettings(count)  # type: ignore[arg-type]
    assert "4 to 40" in str(caught.value) or "a whole number" in str(caught.value)


def test_numbers_of_other_kinds_are_taken_for_what_they_are() -> None:
    lattice = Lattice(np.array([1, 2, 3]), np.float32(10), Fraction(4, 5))  # type: ignore[arg-type]
    assert lattice == Lattice((1, 2, 3), 10, 0.8)
    assert hash(lattice) == hash(Lattice((1, 2, 3), 10, 0.8))
    assert all(type(count) is int for count in lattice.cells)
    assert type(lattice.cell_size) is type(lattice.thickness) is float


@given(sizes, relative_thicknesses)
def test_density_and_thickness_say_the_same(size: float, relative: float) -> None:
    by_thickness = Lattice((1, 1, 1), size, thickness=relative * size)
    by_density = Lattice((1, 1, 1), size, density=by_thickness.volume_fraction)
    assert by_density.wall_thickness == pytest.approx(by_thickness.wall_thickness, rel=1e-9)
    assert by_density.exact_volume == pytest.approx(by_thickness.exact_volume, rel=1e-12)


@given(sizes, densities)
def test_thickness_of_a_density_has_that_density(size: float, density: float) -> None:
    lattice = Lattice((1, 1, 1), size, density=density)
    again = Lattice((1, 1, 1), size, thickness=lattice.wall_thickness)
    assert again.volume_fraction == pytest.approx(density, rel=1e-9)


@given(st.tuples(*(st.integers(1, 9),) * 3), sizes, relative_thicknesses, st.floats(0.5, 2))
def test_the_exact_volume_goes_with_the_cells_and_the_cube_of_the_size(
    cells: tuple[int, int, int], size: float, relative: float, factor: float
) -> None:
    one, block = (Lattice(count, size, relative * size) for count in ((1, 1, 1), cells))
    larger = Lattice(cells, factor * size, relative * factor * size)
    assert block.exact_volume == pytest.approx(cells[0] * cells[1] * cells[2] * one.exact_volume, rel=1e-12)
    assert larger.exact_volume == pytest.approx(factor**3 * block.exact_volume, rel=1e-9)


def test_anything_below_the_largest_wall_is_accepted() -> None:
    max_thickness = Lattice((1, 1, 1), 10.0, float(np.nextafter(TUBE.max_thickness * 10.0, 0)))
    densest = Lattice((1, 1, 1), 10.0, density=float(np.nextafter(TUBE.max_density, 0)))
    assert max_thickness.volume_fraction == pytest.approx(TUBE.max_density)
    assert densest.wall_thickness == pytest.approx(TUBE.max_thickness * 10.0)
    with pytest.raises(ParameterError):
        Lattice((1, 1, 1), 10.0, TUBE.max_thickness * 10.0)


def test_a_lattice_cannot_be_changed() -> None:
    lattice = Lattice(**GOOD)
    for name in ("cells", "cell_size", "thickness", "density", "fit"):
        with pytest.raises(FrozenInstanceError):
            setattr(lattice, name, None)


def test_equal_lattices_are_one_key_and_one_build() -> None:
    first, second = (Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(5)) for _ in range(2))
    assert len({first, second}) == 1
    assert first.wall() is second.wall()
    assert first.solid().IsPartner(second.solid())


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1), (1, 2, 3)])
def test_the_bounding_box_is_the_kernels_tightest(cells: tuple[int, int, int]) -> None:
    lattice = Lattice(cells, 10.0, 0.8, fit=COARSE)
    np.testing.assert_allclose(lattice.bounding_box(), bounding_box(lattice.solid()), atol=1e-4)


def test_moving_a_solid_moves_no_other_and_not_the_lattice(cell: Lattice) -> None:
    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(1, 2, 3))
    before = cell.bounding_box()
    moved = cell.solid()
    moved.Move(TopLoc_Location(shift))
    assert cell.solid().Location().IsIdentity()
    assert not moved.Location().IsIdentity()
    assert cell.bounding_box() == before


def test_the_report_agrees_with_the_solid_and_with_itself(cell: Lattice) -> None:
    report, complex = cell.report(), cell.wall().complex
    assert (report.solids, report.faces) == (topology(cell.solid()).solids, topology(cell.solid()).faces)
    assert report.faces == 2 * report.patches + report.boundary_edges
    assert (report.patches, report.non_manifold_edges) == (complex.patch_count, complex.non_manifold_edges)
    assert report.valid
    assert report.closed
    assert report.volume == pytest.approx(enclosed_volume(cell.solid()), rel=1e-14)
    assert report.volume_exact == pytest.approx(report.density * cell.cell_size**3)
    assert report.as_dict() == asdict(report)


def test_the_deviation_is_a_length_and_scales_with_the_cell() -> None:
    small, large = (Lattice((1, 1, 1), size, 0.08 * size, fit=COARSE).report() for size in (1.0, 100.0))
    assert large.max_deviation == pytest.approx(100 * small.max_deviation, rel=1e-9)
    assert large.max_normal_angle == pytest.approx(small.max_normal_angle, rel=1e-9)


def test_several_files_are_written_at_once(cell: Lattice, tmp_path: Path) -> None:
    names = ["part.step", "part.brep", "part.stl", "part.3mf"]
    cell.write(*(tmp_path / name for name in names), schema="ap242", deviation=0.1)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(names)
    assert enclosed_volume(read_step(tmp_path / "part.step")) == pytest.approx(cell.wall().volume(), rel=1e-8)


@pytest.mark.parametrize(
    ("names", "settings", "words"),
    [
        (["good.step", "bad.dxf"], {}, "bad.dxf"),
        (["good.step", "missing/bad.step"], {}, "existing folder"),
        (["good.step", "good.step"], {}, "each file once"),
        (["good.step"], {"schema": "ap203"}, "ap214 or ap242"),
        (["good.stl"], {"deviation": 0}, "a length above 0 mm"),
        (["good.stl"], {"deviation": "fine"}, NUMBER_WORDS),
        (["good.stl"], {"deviation": nan}, NUMBER_WORDS),
        (["good.3mf"], {"deviation": -1}, "a length above 0 mm"),
        (["good.stl"], {"angle": 90}, "below 90 degrees"),
        (["good.stl"], {"angle": nan}, "below 90 degrees"),
        (["good.stl"], {"angle": "steep"}, "below 90 degrees"),
    ],
)
def test_what_cannot_be_written_is_refused_before_anything_is_built(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: list[str], settings: dict[str, Any], words: str
) -> None:
    for function in ("builds.solid.build", "builds.meshes.triangles"):
        monkeypatch.setattr(f"gyroid_cad.{function}", lambda *_: pytest.fail("it was built"))
    with pytest.raises(ParameterError) as caught:
        Lattice(**GOOD).write(*(tmp_path / name for name in names), **settings)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_the_solid_is_built_only_where_a_file_needs_it(
    cell: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gyroid_cad.builds.solid.build", lambda *_: pytest.fail("it was built"))
    cell.write(tmp_path / "part.stl", tmp_path / "part.3mf", deviation=0.1)
    assert {path.name for path in tmp_path.iterdir()} == {"part.stl", "part.3mf"}
    assert not cell.needs_solid(["a.stl", "b.3MF"])
    assert cell.needs_solid(["a.stl", "b.step"])
    assert Lattice(**GOOD, trim="box").needs_solid(["a.stl"])


def test_the_triangle_report_agrees_with_the_file_and_with_the_solid(cell: Lattice, tmp_path: Path) -> None:
    cell.write(tmp_path / "part.stl", deviation=0.05)
    report, solid = cell.triangle_report(0.05), cell.report()
    mesh = trimesh.load_mesh(tmp_path / "part.stl")
    assert len(mesh.faces) == report.triangles
    assert mesh.volume == pytest.approx(report.volume, rel=1e-5)
    assert report.volume == pytest.approx(report.volume_wall, rel=1e-5)
    assert 0 < report.volume_offset < report.deviation <= 0.05
    assert report.volume_wall == pytest.approx(solid.volume, rel=1e-9)
    for key in (
        "cells",
        "cell_size",
        "thickness",
        "density",
        "patches",
        "boundary_edges",
        "non_manifold_edges",
        "volume_exact",
    ):
        assert getattr(report, key) == getattr(solid, key)
    assert report.as_dict() == asdict(report)


def test_left_out_the_deviation_is_a_thousandth_of_the_cell_or_a_tenth_of_a_thin_wall() -> None:
    for thickness, usual in ((0.8, 0.01), (0.05, 0.005)):
        lattice = Lattice((1, 1, 1), 10.0, thickness, fit=COARSE)
        assert lattice.triangles() is lattice.triangles(usual)
        assert usual / 2 < lattice.triangle_report().deviation <= usual


def test_triangles_of_the_same_lattice_and_deviation_are_made_once() -> None:
    lattice = Lattice((1, 1, 1), 10.0, 0.8, fit=COARSE)
    assert lattice.triangles(0.1) is Lattice((1, 1, 1), 10.0, 0.8, fit=COARSE).triangles(0.1)
    assert lattice.triangles(0.2) is not lattice.triangles(0.1)


def test_a_trimmed_lattice_has_no_triangles_but_the_kernels() -> None:
    with pytest.raises(ParameterError, match=r"trim = 'box': .* the kernel's"):
        Lattice(**GOOD, trim="box").triangles()


def test_triangles_are_streamed_where_memory_would_not_do_for_the_solid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=402_000_000))
    lattice = Lattice((1, 1, 1), 10.0, 0.801, fit=COARSE)
    lattice.write(tmp_path / "part.stl", deviation=0.1)
    with pytest.raises(ParameterError, match="GB are free"):
        lattice.write(tmp_path / "part.step")
    with pytest.raises(ParameterError, match="GB are free"):
        lattice.write(tmp_path / "part.3mf", deviation=0.001)
    assert [path.name for path in tmp_path.iterdir()] == ["part.stl"]


def test_a_folder_that_may_not_be_written_to_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.access", lambda path, mode: False)
    with pytest.raises(ParameterError, match="does not allow it"):
        Lattice(**GOOD).write(tmp_path / "part.step")


def test_too_many_cells_are_refused_in_gigabytes() -> None:
    enormous = Lattice((100_000, 100_000, 100_000), 10.0, 0.8)
    with pytest.raises(ParameterError, match=r"cells = \(100000, 100000, 100000\): .* GB"):
        enormous.solid()


def test_the_papers_own_fit_is_refused_with_its_gap_and_no_file(tmp_path: Path) -> None:
    lattice = Lattice(**GOOD, fit=FitSettings.paper())
    calls: list[Callable[[], object]] = [lattice.solid, lattice.report, lambda: lattice.write(tmp_path / "part.step")]
    for call in calls:
        with pytest.raises(FitError, match=r"\d\.\d\de-0\d of the cell size apart") as caught:
            call()
        assert isinstance(caught.value, GyroidError)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"cell_size": 10**400}, "cell_size = 1000"),
        ({"cells": (10**400, 1, 1)}, "from 1 to 1000000"),
    ],
)
def test_numbers_beyond_all_bounds_are_refused_like_any_other(change: dict[str, Any], named: str) -> None:
    with pytest.raises(ParameterError, match=named):
        Lattice(**{**GOOD, **change})


def test_a_name_with_a_null_character_and_no_name_at_all_are_refused() -> None:
    with pytest.raises(ParameterError, match="null character"):
        Lattice(**GOOD).write("a\0.step")
    with pytest.raises(ParameterError, match="at least one file name"):
        Lattice(**GOOD).write()


def test_a_lattice_cut_to_its_block_has_exactly_the_block_s_share() -> None:
    made = Lattice((2, 1, 1), 10, density=0.3, trim="box", keep_islands=True).report()
    assert made.valid
    assert made.closed
    assert made.volume == pytest.approx(0.3 * 2000, rel=1e-6)
    assert made.density == pytest.approx(0.3, rel=1e-6)
    assert made.boundary_edges == made.non_manifold_edges == 0


# Beyond these densities the chips at the corners have grown together with the rest, or there are none.
@pytest.mark.parametrize(
    ("surface", "density"), [("gyroid", 0.1), ("gyroid", 0.7), ("diamond", 0.3), ("diamond", 0.7), ("primitive", 0.3)]
)
def test_a_lattice_cut_to_its_block_is_one_solid_without_the_chips_at_two_corners(surface: str, density: float) -> None:
    given = {"cells": (1, 1, 1), "cell_size": 8, "density": density, "surface": surface, "fit": FitSettings(5)}
    with pytest.warns(IslandsWarning, match=r"2 islands, .* dropped \(keep_islands keeps\)"):
        made = Lattice(**given, trim="box").report()
    with pytest.warns(IslandsWarning, match=r"2 islands, .* left"):
        whole = Lattice(**given, trim="box", keep_islands=True).report()
    assert (made.solids, made.islands, made.dropped) == (1, 0, 2)
    assert (whole.solids, whole.islands, whole.dropped) == (3, 2, 0)
    assert made.volume + made.dropped_volume == pytest.approx(whole.volume, rel=1e-12)
    assert made.dropped_volume == pytest.approx(whole.islands_volume)
    # What the fit is off by does not change with what is dropped.
    assert made.volume - made.volume_exact == pytest.approx(whole.volume - whole.volume_exact, abs=1e-9)
    assert made.density == made.volume / 8**3
    assert made.faces < whole.faces


@pytest.mark.parametrize("ending", ["step", "stl", "3mf"])
def test_the_files_of_a_lattice_cut_to_its_block_hold_one_piece(tmp_path: Path, ending: str) -> None:
    lattice, path = Lattice((1, 1, 1), 8, density=0.2, trim="box", fit=FitSettings(6)), tmp_path / f"a.{ending}"
    lattice.write(path, deviation=0.1)
    if ending == "step":
        assert topology(read_step(path)).solids == 1
    else:
        assert triangle_measures(*read_triangles(path)).pieces == 1


def test_islands_are_of_trimmed_lattices_only() -> None:
    with pytest.raises(ParameterError, match="keep_islands = True: expected a lattice that is trimmed"):
        Lattice(**GOOD, keep_islands=True)


def test_a_cut_lattice_fills_its_block_exactly() -> None:
    low, high = Lattice((2, 1, 1), 10, 0.8, trim="box", fit=FitSettings(6)).bounding_box()
    assert (low, high) == ((0, 0, 0), (20, 10, 10))


def test_a_wall_that_touches_the_block_s_sides_is_shifted_a_little() -> None:
    # At a quarter of the cell the faces are tangent to the planes between cells, at the centres of patches.
    lattice = Lattice((1, 1, 1), 10, 2.5, trim="box")
    assert 0 < max(lattice.built().shift) < 0.1
    assert lattice.report().valid


def test_a_cut_lattice_is_written_and_read_back(tmp_path: Path) -> None:
    lattice = Lattice((1, 1, 1), 10, "0.6 + 0.02*x", trim="box", fit=FitSettings(6), tolerance=1e-3)
    lattice.write(tmp_path / "a.step")
    shape = read_step(tmp_path / "a.step")
    assert is_valid(shape)
    assert topology(shape).closed


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"trim": "ball"}, "trim = 'ball': expected box"),
        ({"trim": "box", "map": "twist:angle=10"}, "none where a map"),
        ({"trim": "box", "scale_field": "1 + 0.01*x"}, "none where a map or a scale field"),
    ],
)
def test_what_cannot_be_cut_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        Lattice((1, 1, 1), 10, 0.8, **given)

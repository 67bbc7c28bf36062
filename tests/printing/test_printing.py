"""What a printer makes of a part."""

from __future__ import annotations

import json
import warnings
from dataclasses import replace
from pathlib import Path

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest
import trimesh

from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.printing.print_check import print_check, trapped_voids
from gyroid_cad.printing.printers import printer_named
from gyroid_cad.printing.verdict import PrintCheck
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.pore_limits import pore_limiting_diameter

FORM2 = printer_named("form2")
COARSE = FitSettings(5)
LENGTHS = st.floats(1.0, 400.0)


def of_box(*extents: float) -> PrintCheck:
    box = trimesh.creation.box(extents)
    return print_check((box.vertices, box.faces), FORM2)


def lattice(**given: object) -> Lattice:
    return Lattice(**{"cells": (1, 1, 1), "cell_size": 10.0, "thickness": 0.8, "fit": COARSE, **given})  # type: ignore[arg-type]


@hypothesis.given(LENGTHS, LENGTHS, LENGTHS)
@hypothesis.settings(max_examples=40)
def test_a_box_fits_if_its_sides_in_order_are_within_the_volumes_in_order(x: float, y: float, z: float) -> None:
    check = of_box(x, y, z)
    assert check.fits == (np.sort([x, y, z]) <= np.sort(FORM2.build_volume)).all()
    # In the orientation it names it does fit.
    if check.orientation is not None:
        assert (np.array([x, y, z])[list(check.orientation)] <= np.array(FORM2.build_volume) * (1 + 1e-9)).all()


@hypothesis.given(LENGTHS, LENGTHS, LENGTHS)
@hypothesis.settings(max_examples=15)
def test_at_the_suggested_scale_a_box_just_fits(x: float, y: float, z: float) -> None:
    scale = of_box(x, y, z).scale_to_fit
    sides = np.sort([x, y, z]) * scale / np.sort(FORM2.build_volume)
    assert sides.max() == pytest.approx(1.0)
    assert of_box(*(np.array([x, y, z]) * scale * 0.999)).fits
    assert not of_box(*(np.array([x, y, z]) * scale * 1.001)).fits


def test_a_part_that_fits_as_it_stands_is_not_turned() -> None:
    assert of_box(10, 20, 30).orientation == (0, 1, 2)
    assert of_box(170, 20, 30).orientation == (1, 2, 0)


@pytest.mark.parametrize(
    ("thickness", "wall", "passed"),
    [(0.6, "good", True), (0.5, "supported only", True), (0.4, "supported only", True), (0.39, "too thin", False)],
)
def test_the_smallest_wall_is_held_against_both_limits(thickness: float, wall: str, passed: bool) -> None:
    check = print_check(lattice(thickness=thickness))
    assert (check.min_wall, check.wall, check.passed) == (thickness, wall, passed)


def test_at_the_scale_that_is_told_the_wall_passes() -> None:
    check = print_check(lattice(thickness=0.25))
    assert check.scale_for_supported_wall == pytest.approx(1.6)
    scaled = {scale: print_check(lattice(cell_size=10 * scale, thickness=0.25 * scale)) for scale in (1.6, 2.4, 2.39)}
    assert [scaled[scale].wall for scale in (1.6, 2.4, 2.39)] == ["supported only", "good", "supported only"]
    assert check.suggested_scale == pytest.approx(1.6)


def test_no_scale_is_suggested_where_what_fits_has_too_thin_a_wall() -> None:
    check = print_check(lattice(cells=(16, 1, 1), thickness=0.38))
    assert check.fits
    assert check.scale_for_supported_wall is not None
    assert check.scale_for_supported_wall > 1
    assert print_check(lattice(cells=(20, 1, 1), thickness=0.38)).suggested_scale is None


def test_where_walls_vary_the_thinnest_counts() -> None:
    graded = lattice(cells=(2, 1, 1), thickness="0.3 + 0.02*x", tolerance=1e-2)
    check = print_check(graded)
    assert check.min_wall == graded.fitted().min_thickness
    assert check.wall == "too thin"


@pytest.mark.parametrize("surface", list(SURFACES))
def test_a_lattices_channels_are_held_against_the_drain_hole(surface: str) -> None:
    small, large = (
        print_check(lattice(cell_size=size, surface=surface, thickness=0.1 * size)) for size in (10.0, 20.0)
    )
    expected = pore_limiting_diameter(SURFACES[surface], 10.0, 1.0)
    assert small.opening == pytest.approx(expected)
    assert large.opening == pytest.approx(2 * expected)
    assert (small.drains, large.drains) == (expected >= 3.5, 2 * expected >= 3.5)
    assert (small.trapped_voids, small.pieces) == (0, 1)


def test_a_cut_lattice_is_of_the_blocks_size_and_of_the_same_channels() -> None:
    check = print_check(lattice(trim="box", cell_size=12.0, thickness=1.0))
    assert check.size == pytest.approx((12.0, 12.0, 12.0), abs=1e-3)
    assert check.opening == pytest.approx(pore_limiting_diameter(SURFACES["gyroid"], 12.0, 1.0))
    assert (check.trapped_voids, check.open_edges) == (0, 0)


@pytest.mark.parametrize("closed", [(False, False, False), (True, False, False), (True, True, False)])
def test_labyrinths_of_a_block_with_a_rim_reach_outside(closed: tuple[bool, bool, bool]) -> None:
    assert trapped_voids(build_complex((2, 2, 1), closed=closed)) == 0


def test_a_block_joined_to_itself_all_round_parts_two_voids_from_one_another() -> None:
    # It has no rim: each face of the wall is a shell of its own.
    assert trapped_voids(build_complex((2, 2, 2), closed=(True, True, True))) == 1


def test_a_lattices_own_stl_says_what_the_lattice_says(tmp_path: Path) -> None:
    made, path = lattice(fit=FitSettings(8)), tmp_path / "a.stl"
    made.write(path, deviation=0.02)
    by_file, by_lattice = print_check(path), print_check(made, deviation=0.02)
    assert by_file.size == pytest.approx(by_lattice.size, abs=0.02)
    assert by_file.triangles == by_lattice.triangles
    assert by_file.min_wall == pytest.approx(0.8, abs=0.04)
    assert (by_file.pieces, by_file.trapped_voids, by_file.open_edges) == (1, 0, 0)
    assert by_lattice.opening is not None
    assert by_file.opening is not None
    assert by_file.opening_within is not None
    assert by_file.opening == pytest.approx(by_lattice.opening, abs=by_file.opening_within)
    assert by_file.drains == by_lattice.drains


def test_of_triangles_that_do_not_close_nothing_inside_is_told_and_no_warning_given() -> None:
    facing = np.array([[0.0, 0, 0], [5, 0, 0], [5, 5, 0], [0, 5, 0]]), np.array([[0, 1, 2], [0, 2, 3]])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check = print_check(facing)
    assert (check.opening, check.opening_within, check.min_wall, check.passed) == (None, None, None, False)
    assert check.rows()[3][2] == "unknown"


def test_a_void_within_a_ball_is_trapped_and_a_part_of_two_is_not_one_piece() -> None:
    outer, inner = trimesh.creation.icosphere(2, 10.0), trimesh.creation.icosphere(2, 8.0)
    inner.invert()
    other = trimesh.creation.box([2, 2, 2], trimesh.transformations.translation_matrix([30, 0, 0]))
    mesh = trimesh.util.concatenate([outer, inner, other])
    check = print_check((mesh.vertices, mesh.faces))
    assert (check.trapped_voids, check.pieces, check.passed) == (1, 2, False)
    assert ("trapped voids", "1 regions that do not reach outside", "1: resin cannot leave") in check.rows()


def test_a_part_that_falls_into_pieces_does_not_pass() -> None:
    apart = [trimesh.creation.box([5, 5, 5], trimesh.transformations.translation_matrix([x, 0, 0])) for x in (0, 9)]
    mesh = trimesh.util.concatenate(apart)
    check = print_check((mesh.vertices, mesh.faces))
    assert (check.pieces, check.passed) == (2, False)
    assert ("pieces", "2", "falls apart") in check.rows()
    assert print_check((apart[0].vertices, apart[0].faces)).passed


def test_chips_of_a_trimmed_lattice_fail_only_where_they_are_kept() -> None:
    small = {"cells": (1, 1, 1), "cell_size": 12.0, "thickness": 1.0, "fit": COARSE, "trim": "box"}
    checks = [print_check(Lattice(**small, keep_islands=keep), deviation=0.05) for keep in (False, True)]  # type: ignore[arg-type]
    assert [(check.pieces, check.passed) for check in checks] == [(1, True), (3, False)]


def test_open_triangles_do_not_pass() -> None:
    box = trimesh.creation.box([5, 5, 5])
    check = print_check((box.vertices, box.faces[1:]))
    assert (check.open_edges, check.passed) == (3, False)


def test_the_dictionary_is_plain_and_the_rows_name_units_and_printer_limits() -> None:
    check = of_box(200, 20, 20)
    assert json.loads(json.dumps(check.as_dict()))["scale_to_fit"] == pytest.approx(0.875)
    rows = {subject: (finding, verdict) for subject, finding, verdict in check.rows()}
    assert rows["build volume"] == ("200 x 20 x 20 mm in 145 x 145 x 175 mm", "too large: scale by 0.875")
    assert "STL in mm" in rows["units"][0]
    assert "3MF says mm" in rows["units"][0]


def test_a_printed_scale_is_never_rounded_to_where_it_would_fail() -> None:
    check = replace(of_box(200, 20, 20), scale_to_fit=0.87499, min_wall=0.1, scale_for_supported_wall=4.0003)
    rows = {subject: verdict for subject, _, verdict in check.rows()}
    assert rows["build volume"] == "too large: scale by 0.874"
    assert "from a scale of 4.01" in rows["smallest wall"]


@pytest.mark.parametrize("part", [3, None, b"part.stl"])
def test_what_is_no_part_is_refused(part: object) -> None:
    with pytest.raises(ParameterError, match="a Lattice, a filled part, a file of triangles, or arrays"):
        print_check(part)  # type: ignore[arg-type]

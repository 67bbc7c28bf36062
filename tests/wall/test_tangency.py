"""Neighbouring faces of a wall meet smoothly: the angle between their normals along the edges they share."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad import Lattice
from gyroid_cad.fields.field import as_field
from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import SIDES, Wall, build_wall
from gyroid_cad.wall.refit import graded_wall, measured
from gyroid_cad.wall.tangency import smoothed

Floats = NDArray[np.float64]

L = 10.0
ALONG = np.linspace(-1, 1, 43)
ONES = np.ones_like(ALONG)
BORDERS = ((ALONG, -ONES), (ONES, ALONG), (-ALONG, ONES), (-ONES, -ALONG))
WAVE = "1 + 0.5*sin(x/5)"


def angles(wall: Wall) -> Floats:
    """Degrees between the normals of the two faces at places along each shared edge; shape (edges, sides, places)."""
    complex = wall.complex

    @cache
    def normals(net: int, side: int, k: int) -> Floats:
        return wall.face(net, side).normals(*BORDERS[k])

    found = []
    for edge in np.flatnonzero(~complex.free).tolist():
        both = []
        for patch in complex.edge_patches[edge].tolist():
            k = int(np.flatnonzero(complex.patch_edges[patch] == edge)[0])
            rows = np.stack([normals(int(wall.patch_net[patch]), side, k) for side in SIDES])
            both.append(rows if complex.edge_forward[patch, k] else rows[:, ::-1])
        found.append(np.degrees(2 * np.arcsin(np.linalg.norm(both[0] - both[1], axis=-1) / 2)))
    return np.stack(found)


def graded(text: str, surface: str = "gyroid", control_points: int = 10) -> tuple[Wall, Grading]:
    chosen = SURFACES[surface]
    field = as_field("thickness", text, "")
    grading = Grading(L, field, surface=chosen)
    return graded_wall(build_complex((1, 1, 1), chosen.cell), grading, control_points), grading


@pytest.mark.parametrize("thickness", [0.2, 1.0, WAVE])
@pytest.mark.parametrize(("surface", "limit"), [("gyroid", 0.03), ("diamond", 0.03), ("primitive", 0.05)])
def test_faces_of_a_wall_meet_within_a_few_hundredths_of_a_degree(
    surface: str, limit: float, thickness: float | str
) -> None:
    wall = Lattice((1, 1, 1), L, thickness, surface=surface).wall()
    assert len(wall.weights) == 10
    assert angles(wall).max() <= limit


def test_the_angle_falls_with_nearly_the_third_power_of_the_spans() -> None:
    counts, complex = np.array([10, 14, 20]), build_complex((1, 1, 1))
    worst = [angles(build_wall(complex, fit_patch(FitSettings(n)), L, 1.0)).max() for n in counts.tolist()]
    assert -np.polyfit(np.log(counts - 3), np.log(worst), 1)[0] > 2.5


def test_turned_faces_keep_their_edges_in_common_and_are_no_further_off() -> None:
    wall, grading = graded(WAVE)
    turned = smoothed(wall)
    assert angles(turned).max() < angles(wall).max() / 2
    complex = wall.complex
    for edge in np.flatnonzero(~complex.free).tolist():
        rows = []
        for patch in complex.edge_patches[edge].tolist():
            k = int(np.flatnonzero(complex.patch_edges[patch] == edge)[0])
            row = np.stack([edge_row(turned.nets[patch, side], k) for side in SIDES])
            rows.append(row if complex.edge_forward[patch, k] else row[:, ::-1])
        np.testing.assert_allclose(*rows, rtol=0, atol=1e-12 * L)
    before, after = (measured(some.nets, complex, grading).max_deviation for some in (wall, turned))
    assert after < 1.1 * before


def test_all_edges_of_a_corner_leave_it_in_one_plane() -> None:
    wall = smoothed(graded(WAVE)[0])
    complex = wall.complex
    for fan in range(0, complex.fan_count, 3):
        for side in SIDES:
            around = np.argwhere(complex.patch_fans == fan).tolist()
            leaving = [edge_row(wall.nets[patch, side], k)[:2] for patch, k in around]
            rates = np.stack([row[1] - row[0] for row in leaving])
            smallest = np.linalg.svd(rates, compute_uv=False)[-1] if len(rates) > 2 else 0.0
            assert smallest < 1e-8 * L


def test_an_edge_of_the_field_stays_one() -> None:
    # Patches end on the plane x = L / 2 in many places; there the wall's slope jumps by more than any fit's error.
    wall, _ = graded(f"0.8 + 0.1*abs(x - {L / 2})", "primitive")
    before, after = angles(wall).max(axis=(1, 2)), angles(smoothed(wall)).max(axis=(1, 2))
    kept = before > 1.0
    assert kept.any()
    np.testing.assert_allclose(after[kept], before[kept], rtol=0.05)


def test_what_meets_smoothly_enough_is_left_as_it_is() -> None:
    wall, _ = graded("0.8 + 0.01*x", control_points=20)
    assert angles(wall).max() < 0.015
    assert smoothed(wall).nets.tolist() == wall.nets.tolist()


def test_a_patch_turned_in_space_is_turned_the_same() -> None:
    wall, _ = graded(WAVE)
    quarter = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    there = smoothed(replace(wall, nets=wall.nets @ quarter.T + [3, 2, 1]))
    np.testing.assert_allclose(there.nets, smoothed(wall).nets @ quarter.T + [3, 2, 1], rtol=0, atol=1e-11 * L)

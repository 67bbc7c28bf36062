"""The wall: its volume, its faces, its side walls and where they stand."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.nurbs.basis import basis, gauss_points
from gyroid_cad.nurbs.surface import NurbsSurface
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch, max_offset
from gyroid_cad.surface.symmetry import CELL_QUARTERS, Placements, bounding_cell
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import SIDES, Wall, build_wall

TUBE = USUAL.tube

Floats = NDArray[np.float64]

CELL_SIZE = 8.0
THICKNESS = 0.7
BLOCKS = [(1, 1, 1), (2, 1, 2)]


@lru_cache(maxsize=16)
def wall_of(cells: tuple[int, int, int] = (1, 1, 1), relative_thickness: float = THICKNESS / CELL_SIZE) -> Wall:
    return build_wall(build_complex(cells), fit_patch(), CELL_SIZE, relative_thickness * CELL_SIZE)


def flux(surface: NurbsSurface) -> Floats:
    """Integrals over a surface of du x dv (three) and of the position by it (one), to rounding even if rational."""
    per_span = 20 if surface.rational else 6
    u, weights_u = gauss_points(surface.knots_u, per_span)
    v, weights_v = gauss_points(surface.knots_v, per_span)
    d = surface.derivatives(u[:, np.newaxis], v)
    area = np.cross(d[1, 0], d[0, 1])
    integrands = np.concatenate([area, np.sum(d[0, 0] * area, axis=-1, keepdims=True)], axis=-1)
    return np.asarray(np.einsum("u,uvc,v->c", weights_u, integrands, weights_v))


def enclosed(wall: Wall) -> tuple[Floats, float]:
    """Area vector of the wall's surface, zero if closed, and the volume in it: a third of the position's flux."""
    per_face = [[flux(wall.face(net, side)) for side in SIDES] for net in range(len(wall.nets))]
    total = np.zeros(4)
    for patch, net in enumerate(wall.patch_net):
        free = np.flatnonzero(wall.complex.free[wall.complex.patch_edges[patch]])
        borders = [flux(wall.side_wall(int(net), int(k))) for k in free]
        through = np.sum([per_face[net][1], -per_face[net][0], *borders], axis=0)
        total += through
        total[3] += wall.shifts[wall.patch_shift[patch]] @ through[:3]
    return total[:3], float(total[3]) / 3


def local_edge(wall: Wall, patch: int, edge: int) -> int:
    return int(np.flatnonzero(wall.complex.patch_edges[patch] == edge)[0])


def edge_points(wall: Wall, patch: int, edge: int, side: int, along: Floats) -> Floats:
    """Points of a face's border, run the way the edge runs."""
    k = local_edge(wall, patch, edge)
    curve = wall.face(wall.patch_net[patch], side).edge(k)
    points = curve.evaluate(along if wall.complex.edge_forward[patch, k] else -along)
    return np.asarray(points + wall.shifts[wall.patch_shift[patch]])


def densely(surface: NurbsSurface, count: int) -> Floats:
    """A grid of points of a polynomial surface, ends included; shape (count**2, 3)."""
    functions = basis(surface.knots_u, 3, np.linspace(-1, 1, count))
    grid = np.einsum("ui,ijc,vj->uvc", functions, surface.control_points, functions, optimize=True)
    return np.asarray(grid.reshape(-1, 3))


@pytest.mark.parametrize("relative_thickness", [0.01, 0.05, 0.1, 0.2, 0.3, 0.37])
def test_volume_and_face_areas_of_a_period_are_those_of_the_tube_formula(relative_thickness: float) -> None:
    wall = wall_of((1, 1, 1), relative_thickness)
    assert wall.volume() == pytest.approx(TUBE.density(relative_thickness) * CELL_SIZE**3, rel=4e-7)
    nodes, weights = gauss_points(wall.knots, 6)
    for side in SIDES:
        area = 0.0
        for net in range(len(wall.nets)):
            d = wall.face(net, side).derivatives(nodes[:, np.newaxis], nodes)
            area += weights @ np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1) @ weights
        assert area == pytest.approx(TUBE.face_area(relative_thickness) * CELL_SIZE**2, rel=1e-5)


def test_volume_error_falls_fast_with_the_fit() -> None:
    def error(n: int) -> float:
        wall = build_wall(build_complex((1, 1, 1)), fit_patch(FitSettings(n)), 1.0, 0.1)
        return abs(wall.volume() / TUBE.density(0.1) - 1)

    assert np.log(error(8) / error(14)) / np.log(11 / 5) > 3.3


@pytest.mark.parametrize("cells", BLOCKS)
def test_volume_is_that_enclosed_by_faces_and_free_side_walls(cells: tuple[int, int, int]) -> None:
    area_vector, volume = enclosed(wall_of(cells))
    np.testing.assert_allclose(area_vector, 0, atol=1e-11 * CELL_SIZE**2)
    assert volume == pytest.approx(wall_of(cells).volume(), rel=1e-12)


@pytest.mark.parametrize("net", range(0, 24, 5))
def test_side_walls_close_each_patch_and_point_out_of_it(net: int) -> None:
    wall = wall_of()
    shell = flux(wall.face(net, 1)) - flux(wall.face(net, 0)) + sum(flux(wall.side_wall(net, k)) for k in range(4))
    np.testing.assert_allclose(shell[:3], 0, atol=1e-12 * CELL_SIZE**2)
    middle = np.mean([wall.face(net, side).evaluate(0, 0) for side in SIDES], axis=0)
    for k in range(4):
        side_wall = wall.side_wall(net, k)
        u, v = np.linspace(-1, 1, 9)[:, np.newaxis], np.linspace(-1, 1, 3)
        outwards = np.sum(side_wall.normals(u, v) * (side_wall.evaluate(u, v) - middle), axis=-1)
        assert np.all(outwards > 0)


def test_side_walls_join_the_borders_of_both_faces() -> None:
    wall = wall_of()
    along = np.linspace(-1, 1, 11)
    for k in range(4):
        for side in SIDES:
            border = wall.face(3, side).edge(k).evaluate(along)
            across = 2.0 * side - 1
            np.testing.assert_allclose(wall.side_wall(3, k).evaluate(along, across), border, rtol=0, atol=1e-13)


@pytest.mark.parametrize("cells", [*BLOCKS, (2, 2, 2)])
def test_neighbours_share_the_edges_of_both_faces(cells: tuple[int, int, int]) -> None:
    wall = wall_of(cells)
    along = np.linspace(-1, 1, 7)
    for edge in np.flatnonzero(~wall.complex.free).tolist():
        first, second = wall.complex.edge_patches[edge]
        for side in SIDES:
            here, there = (edge_points(wall, patch, edge, side, along) for patch in (first, second))
            np.testing.assert_allclose(here, there, rtol=0, atol=1e-12 * CELL_SIZE)


@pytest.mark.parametrize("relative_thickness", [0.05, 0.3])
def test_faces_are_the_thickness_apart_at_corners_and_nearly_so_elsewhere(relative_thickness: float) -> None:
    wall = wall_of((1, 1, 1), relative_thickness)
    gaps = wall.nets[:, 1][:, [0, 0, -1, -1], [0, -1, 0, -1]] - wall.nets[:, 0][:, [0, 0, -1, -1], [0, -1, 0, -1]]
    thickness = relative_thickness * CELL_SIZE
    np.testing.assert_allclose(np.linalg.norm(gaps, axis=-1), thickness, rtol=1e-13)
    u, v = np.linspace(-1, 1, 31)[:, np.newaxis], np.linspace(-1, 1, 31)
    for net in range(0, 24, 6):
        through = wall.face(net, 1).evaluate(u, v) - wall.face(net, 0).evaluate(u, v)
        np.testing.assert_allclose(np.linalg.norm(through, axis=-1), thickness, rtol=2e-4)


def test_on_both_faces_du_x_dv_points_along_the_common_normal() -> None:
    wall = wall_of()
    u, v = np.linspace(-1, 1, 9)[:, np.newaxis], np.linspace(-1, 1, 9)
    for net in range(len(wall.nets)):
        faces = [wall.face(net, side) for side in SIDES]
        through = (faces[1].evaluate(u, v) - faces[0].evaluate(u, v)) / THICKNESS
        for face in faces:
            assert np.min(np.sum(face.normals(u, v) * through, axis=-1)) > 0.999


def test_faces_fold_over_just_past_the_largest_offset_of_the_fit_and_not_before() -> None:
    patch = fit_patch()
    u, v = np.linspace(-1, 1, 101)[:, np.newaxis], np.linspace(-1, 1, 101)

    def least_area(offset: float) -> float:
        faces = [patch.offset(side * offset).derivatives(u, v) for side in (-1, 1)]
        return min(float(np.min(np.sum(np.cross(d[1, 0], d[0, 1]) * patch.normals.evaluate(u, v), -1))) for d in faces)

    assert least_area(0.999 * max_offset(patch)) > 0 > least_area(1.001 * max_offset(patch))


def test_a_wall_past_the_fits_own_limit_is_refused_with_the_limit() -> None:
    limit = 2 * max_offset(fit_patch()) * CELL_SIZE / 2
    wall_of((1, 1, 1), 0.9999 * limit / CELL_SIZE)
    with pytest.raises(ParameterError, match=f"thickness = .*below {limit:.6g} mm"):
        wall_of((1, 1, 1), limit / CELL_SIZE)


@settings(max_examples=5, deadline=None)
@given(st.floats(0.1, 100))
def test_volume_goes_with_the_cube_of_the_size(factor: float) -> None:
    scaled = build_wall(build_complex((1, 1, 1)), fit_patch(), factor * CELL_SIZE, factor * THICKNESS)
    assert scaled.volume() == pytest.approx(factor**3 * wall_of().volume(), rel=1e-12)


def test_volume_goes_with_the_number_of_cells() -> None:
    assert wall_of((2, 2, 3)).volume() == pytest.approx(12 * wall_of().volume(), rel=1e-12)


@pytest.mark.parametrize("cells", BLOCKS)
def test_the_bounding_box_holds_the_wall_tightly(cells: tuple[int, int, int]) -> None:
    wall = wall_of(cells)
    low, high = wall.bounding_box()
    clouds = [np.concatenate([densely(wall.face(net, side), 241) for side in SIDES]) for net in range(24)]
    shifts = [wall.shifts[wall.patch_shift[wall.patch_net == net]] for net in range(24)]
    lowest = np.min(
        [cloud.min(axis=0) + shift.min(axis=0) for cloud, shift in zip(clouds, shifts, strict=True)], axis=0
    )
    highest = np.max(
        [cloud.max(axis=0) + shift.max(axis=0) for cloud, shift in zip(clouds, shifts, strict=True)], axis=0
    )
    size = np.max(high - low)
    assert np.all(low <= lowest + 1e-6 * size)
    assert np.all(high >= highest - 1e-6 * size)
    np.testing.assert_allclose(np.concatenate([low, high]), np.concatenate([lowest, highest]), rtol=0, atol=1e-5 * size)


def test_the_bounding_box_is_tight_where_the_extremes_lie_nowhere_special() -> None:
    # In these directions one patch reaches furthest somewhere along its edges, between samples.
    cell = USUAL.cell
    one = Placements(cell.patch, cell.matrices[:1], cell.translations[:1], cell.bounding_cell[:1])
    upright = build_wall(build_complex((1, 1, 1), one), fit_patch(), CELL_SIZE, THICKNESS)
    turn = np.array([[0.77, 0.08, -0.63], [-0.13, 0.59, 0.8], [0.16, -0.82, 0.55]])
    wall = replace(upright, nets=upright.nets @ turn.T)
    cloud = np.concatenate([densely(wall.face(0, side), 801) for side in SIDES])
    extremes = np.array([cloud.min(axis=0), cloud.max(axis=0)])
    np.testing.assert_allclose(wall.bounding_box(), extremes, rtol=0, atol=1e-6 * np.ptp(extremes))


def test_patches_of_other_cells_are_translates_by_whole_cells() -> None:
    wall = wall_of((2, 1, 2))
    assert len(wall.nets) == 24
    np.testing.assert_allclose(wall.shifts[wall.patch_shift], wall.complex.patch_cell * CELL_SIZE, rtol=0, atol=0)
    np.testing.assert_array_equal(wall.patch_net, wall.complex.patch_placement)


def test_moved_placements_move_the_wall() -> None:
    moved = USUAL.cell.transformed(np.eye(3, dtype=np.int64), (1, -2, 3))
    wall = build_wall(build_complex((1, 1, 1), moved), fit_patch(), CELL_SIZE, THICKNESS)
    shift = np.array([1, -2, 3]) * CELL_SIZE / CELL_QUARTERS
    np.testing.assert_allclose(wall.nets, wall_of().nets + shift, rtol=0, atol=1e-14 * CELL_SIZE)
    assert wall.volume() == pytest.approx(wall_of().volume(), rel=1e-12)


def test_the_mid_points_of_the_wall_are_the_placed_corners() -> None:
    wall = wall_of((2, 1, 1))
    nets = wall.nets[wall.patch_net].mean(axis=1)
    corners = nets[:, [0, -1, -1, 0], [0, 0, -1, -1]] + wall.shifts[wall.patch_shift][:, np.newaxis]
    expected = wall.complex.corner_quarters[wall.complex.patch_corners] * CELL_SIZE / CELL_QUARTERS
    np.testing.assert_allclose(corners, expected, rtol=0, atol=1e-14 * CELL_SIZE)


def test_rational_patches_make_a_closed_wall_too() -> None:
    paper = FitSettings.paper()
    patch = fit_patch(FitSettings(10, paper.knots, paper.weights, "smooth"))
    # A quarter of a period: as exact as a whole one, and quicker.
    wall = build_wall(build_complex((1, 1, 1), bounding_cell(USUAL.patch)), patch, 1.0, 0.1)
    area_vector, volume = enclosed(wall)
    np.testing.assert_allclose(area_vector, 0, atol=1e-9)
    assert wall.volume() == pytest.approx(volume, rel=1e-9)
    assert volume == pytest.approx(TUBE.density(0.1) / 4, rel=2e-4)


def test_a_fit_that_shares_no_edges_makes_no_wall() -> None:
    with pytest.raises(FitError, match="apart"):
        build_wall(build_complex((1, 1, 1)), fit_patch(FitSettings.paper()), CELL_SIZE, THICKNESS)

"""Three surfaces from one table: what their data say is so, and what follows from them."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.families import SURFACES, USUAL, MinimalSurface, surface_named
from gyroid_cad.surface.fit import FitSettings, edge_gap, fit_patch
from gyroid_cad.surface.fit_report import fit_report
from gyroid_cad.surface.patch import EDGE_HALF_TURN, ROTOINVERSION, edge_half_turn_shift, exact_edge, smooth
from gyroid_cad.surface.symmetry import CELL_QUARTERS, QUARTER, Neighbour, Patch, orbit, placed_corners
from gyroid_cad.surface.weierstrass import GYROID, Family
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.exact import patch_points_and_normals

Floats = NDArray[np.float64]

EVERY = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
ALONG = np.linspace(-1, 1, 9)


@lru_cache
def edge_of(patch: Patch, k: int) -> tuple[Floats, Floats]:
    """Exact points and normals along an edge of the patch."""
    one = np.ones_like(ALONG)
    return smooth(*[(ALONG, -one), (one, ALONG), (-ALONG, one), (-one, -ALONG)][k], patch.family)


def quadrature() -> tuple[Floats, Floats, Floats]:
    nodes, weights = np.polynomial.legendre.leggauss(24)
    return nodes[:, np.newaxis], nodes[np.newaxis], np.outer(weights, weights)


@EVERY
def test_corners_stand_where_the_table_has_them(surface: MinimalSurface) -> None:
    points = smooth([-1, 1, 1, -1], [-1, -1, 1, 1], surface.family)[0]
    np.testing.assert_allclose(points, surface.patch.corner_array * QUARTER, rtol=0, atol=2e-15)


@EVERY
@pytest.mark.parametrize("k", range(4))
def test_the_neighbour_rule_carries_an_edge_to_itself_and_its_normals_to_the_same_side(
    surface: MinimalSurface, k: int
) -> None:
    (matrix, shift), side = surface.patch.beyond(k)
    points, normals = edge_of(surface.patch, k)
    images = points @ matrix.T + shift * QUARTER
    order = slice(None, None, -1) if surface.patch.neighbour is Neighbour.HALF_TURN_ABOUT_NORMAL else slice(None)
    np.testing.assert_allclose(images[order], points, rtol=0, atol=1e-14)
    np.testing.assert_allclose(side * (normals @ matrix.T)[order], normals, rtol=0, atol=1e-12)


def test_the_diamond_s_edges_are_straight() -> None:
    points = edge_of(SURFACES["diamond"].patch, 3)[0]
    chord = (points[-1] - points[0]) / np.linalg.norm(points[-1] - points[0])
    assert np.linalg.norm(np.cross(points - points[0], chord), axis=1).max() < 1e-14


def test_the_primitive_surface_s_edges_are_plane_and_meet_their_plane_upright() -> None:
    points, normals = edge_of(SURFACES["primitive"].patch, 3)
    across = np.cross(points[-1] - points[0], normals[4])
    across /= np.linalg.norm(across)
    assert np.abs((points - points[0]) @ across).max() < 1e-14
    assert np.abs(normals @ across).max() < 1e-12


def test_the_gyroid_s_edges_are_neither() -> None:
    points = edge_of(SURFACES["gyroid"].patch, 3)[0] - edge_of(SURFACES["gyroid"].patch, 3)[0][0]
    assert np.linalg.svd(points, compute_uv=False)[2] > 1e-3


@EVERY
def test_a_mirror_in_the_table_maps_the_patch_onto_itself(surface: MinimalSurface) -> None:
    if surface.patch.mirror is None:
        pytest.skip("this patch has none")
    axis = np.array(surface.patch.mirror) / np.linalg.norm(surface.patch.mirror)
    u, v = np.meshgrid(ALONG, ALONG, indexing="ij")
    points = smooth(u, v, surface.family)[0]
    mirrored = points - 2 * (points @ axis)[..., np.newaxis] * axis
    nearest = cKDTree(points.reshape(-1, 3)).query(mirrored.reshape(-1, 3))[0]
    assert nearest.max() < 1e-14


def places(surface: MinimalSurface, cell: object) -> set[frozenset[tuple[int, ...]]]:
    return {frozenset(map(tuple, corners % CELL_QUARTERS)) for corners in placed_corners(cell)}  # type: ignore[arg-type]


def test_the_orbit_of_the_gyroid_s_patch_is_the_paper_s_cubic_cell() -> None:
    found = orbit(USUAL.patch, USUAL.first)
    assert len(found) == len(USUAL.cell) == 24
    assert places(USUAL, found) == places(USUAL, USUAL.cell)
    by_place = {frozenset(map(tuple, corners % CELL_QUARTERS)): k for k, corners in enumerate(placed_corners(found))}
    middle_normal = np.array([0, 0, 1])
    for k, corners in enumerate(placed_corners(USUAL.cell)):
        other = by_place[frozenset(map(tuple, corners % CELL_QUARTERS))]
        ours, theirs = ((p.sides[i] * p.matrices[i]) @ middle_normal for p, i in ((USUAL.cell, k), (found, other)))
        np.testing.assert_array_equal(ours, theirs)


@EVERY
@pytest.mark.parametrize("start", range(3))
def test_the_orbit_is_the_same_from_whichever_of_its_patches_it_begins(surface: MinimalSurface, start: int) -> None:
    # Those that stand as the first does, up to the patch's own rotoinversions.
    cell = orbit(surface.patch, surface.first)
    turns = [np.linalg.matrix_power(ROTOINVERSION, k) for k in range(4)]
    alike = [k for k, m in enumerate(cell.matrices) if any(np.array_equal(m, turn) for turn in turns)]
    x, y, z = cell.translations[alike[start % len(alike)]].tolist()
    assert places(surface, orbit(surface.patch, (x, y, z))) == places(surface, cell)


@EVERY
def test_in_the_endless_lattice_every_edge_is_shared_by_two_patches_with_one_side(surface: MinimalSurface) -> None:
    cell = surface.cell
    uses = defaultdict(list)
    for patch, corners in enumerate(placed_corners(cell)):
        matrix, translation = cell.matrices[patch], cell.translations[patch] * QUARTER
        for k in range(4):
            ends = (corners[k], corners[(k + 1) % 4])
            key = frozenset((tuple(a % CELL_QUARTERS), tuple(b - a)) for a, b in (ends, ends[::-1]))
            points, normals = edge_of(surface.patch, k)
            uses[key].append((points @ matrix.T + translation, cell.sides[patch] * normals @ matrix.T))
    assert len(uses) == 2 * len(cell)
    for (points, normals), (others, other_normals) in uses.values():
        order = slice(None) if np.allclose(np.mod(points[0] - others[0] + 1e-9, 2), 1e-9) else slice(None, None, -1)
        apart = points - others[order]
        np.testing.assert_allclose(apart, np.broadcast_to(2 * np.round(apart[0] / 2), apart.shape), atol=1e-13)
        np.testing.assert_allclose(normals, other_normals[order], atol=1e-12)


@EVERY
def test_du_x_dv_points_to_the_common_side_of_every_placement(surface: MinimalSurface) -> None:
    assert np.array_equal(surface.cell.sides, np.rint(np.linalg.det(surface.cell.matrices)))
    closed = build_complex((1, 1, 1), surface.cell, (True, True, True))
    assert not closed.free.any()
    assert closed.fan_count - closed.edge_count + closed.patch_count == surface.tube.euler_characteristic


@EVERY
def test_the_patches_of_a_cell_have_its_area(surface: MinimalSurface) -> None:
    u, v, weights = quadrature()
    step = 1e-5
    du = (smooth(u + step, v, surface.family)[0] - smooth(u - step, v, surface.family)[0]) / (2 * step)
    dv = (smooth(u, v + step, surface.family)[0] - smooth(u, v - step, surface.family)[0]) / (2 * step)
    area = np.sum(weights * np.linalg.norm(np.cross(du, dv), axis=-1))
    assert area * len(surface.cell) / 4 == pytest.approx(surface.tube.area, rel=1e-8)


@EVERY
def test_up_to_the_curvature_limit_walls_meet_no_others(surface: MinimalSurface) -> None:
    # Laid off by nearly half the limit, no point comes nearer to another place of the surface than to its own.
    block = build_complex((3, 3, 3), surface.cell)
    places, normals = patch_points_and_normals(block, 1.0, np.linspace(-1, 1, 25))
    middle = np.flatnonzero(np.all(block.patch_cell == 1, axis=1))
    tree = cKDTree(places.reshape(-1, 3))
    reach = 0.999 * surface.tube.thickness_limit / 2
    for way in (-reach, reach):
        nearest = tree.query((places[middle] + way * normals[middle]).reshape(-1, 3))[0]
        # What lies between samples is nearer by the square of their distance only.
        assert nearest.min() > reach - 1e-3


@EVERY
def test_the_10_x_10_fit_is_within_a_fifty_thousandth_of_the_cell_and_shares_its_edges(surface: MinimalSurface) -> None:
    fitted = fit_patch(FitSettings(), surface.family)
    report = fit_report(fitted)
    assert report.max_distance <= 2e-5
    assert report.corner_error <= 1e-15
    assert edge_gap(fitted) <= 1e-12


@EVERY
def test_the_interior_shift_makes_the_fit_closer(surface: MinimalSurface) -> None:
    plain = Family("plain", surface.family.bonnet_angle, surface.family.scale)
    distances = [fit_report(fit_patch(FitSettings(), family)).max_distance for family in (surface.family, plain)]
    assert distances[0] < distances[1]


@given(angle=st.floats(0, np.pi / 2), along=st.floats(-1, 1))
def test_the_half_turn_about_an_edge_s_middle_normal_maps_it_onto_itself_in_every_associate_surface(
    angle: float, along: float
) -> None:
    family = Family("associate", angle, GYROID.scale)
    there, back = exact_edge(np.array([along, -along]), family)
    np.testing.assert_allclose(EDGE_HALF_TURN @ there + edge_half_turn_shift(family), back, rtol=0, atol=1e-13)


def test_a_rule_that_does_not_fit_its_corners_is_no_surface() -> None:
    wrong = Patch(GYROID, SURFACES["diamond"].patch.corners, Neighbour.HALF_TURN_ABOUT_EDGE)
    with pytest.raises(ValueError, match="without a mirror"):
        orbit(wrong, (1, 1, 1))


def test_an_axis_that_does_not_permute_the_coordinate_axes_is_refused() -> None:
    skew = Patch(GYROID, ((-2, 0, 1), (0, -2, -1), (2, 0, 1), (1, 2, -1)), Neighbour.HALF_TURN_ABOUT_EDGE)
    with pytest.raises(ValueError, match="does not permute the axes"):
        skew.beyond(0)


@pytest.mark.parametrize("name", ["Gyroid", "schwarz", "", 3, None])
def test_a_surface_that_is_not_in_the_table_is_refused_with_those_that_are(name: object) -> None:
    with pytest.raises(ParameterError, match=r"surface = .*: expected gyroid or diamond or primitive"):
        surface_named(name)  # type: ignore[arg-type]

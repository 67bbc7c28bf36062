"""Placements: 24 patches that close up to one surface with two sides."""

from __future__ import annotations

from collections import Counter, defaultdict

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.patch import smooth
from gyroid_cad.surface.symmetry import CELL_QUARTERS, QUARTER, Placements, bounding_cell, placed_corners

Floats = NDArray[np.float64]
EdgeUses = dict[object, list[tuple[int, int]]]

ALONG = np.linspace(-1, 1, 9)
MIRROR_Y = np.diag([1, -1, 1])


def periodic_edges(placements: Placements) -> EdgeUses:
    """(patch, local edge) of each edge of the periodic lattice, told apart by its ends modulo the period."""
    uses: EdgeUses = defaultdict(list)
    for patch, corners in enumerate(placed_corners(placements)):
        for k in range(4):
            ends = (corners[k], corners[(k + 1) % 4])
            key = frozenset((tuple(a % CELL_QUARTERS), tuple(b - a)) for a, b in (ends, ends[::-1]))
            uses[key].append((patch, k))
    return uses


def periodic_patches(placements: Placements) -> set[frozenset[tuple[int, ...]]]:
    return {frozenset(map(tuple, corners % CELL_QUARTERS)) for corners in placed_corners(placements)}


def as_printed() -> Placements:
    """Eq. (19) as the paper prints it: B2 = T_y B + A(1, 0, 1)."""
    cell, first = USUAL.cell, bounding_cell(USUAL.patch)
    second = first.transformed(MIRROR_Y, (4, 4, 8))
    keep = cell.bounding_cell != 1
    return Placements(cell.patch, cell.matrices[keep], cell.translations[keep], cell.bounding_cell[keep]).joined(second)


def placed_edge(placements: Placements, patch: int, k: int) -> tuple[Floats, Floats]:
    """Exact points, in bounding-cell lengths, and normals to the common side along an edge."""
    one = np.ones_like(ALONG)
    u, v = [(ALONG, -one), (one, ALONG), (-ALONG, one), (-one, -ALONG)][k]
    points, normals = smooth(u, v)
    matrix, translation = placements.matrices[patch], placements.translations[patch] * QUARTER
    return points @ matrix.T + translation, placements.sides[patch] * normals @ matrix.T


def test_the_six_placements_of_a_bounding_cell_are_the_powers_of_one_map_of_order_six() -> None:
    cell = bounding_cell(USUAL.patch)
    step = cell.matrices[1] @ cell.matrices[0].T
    shift = cell.translations[1] - step @ cell.translations[0]
    matrix, translation = np.eye(3), np.zeros(3)
    for power in range(1, 7):
        matrix, translation = step @ matrix, step @ translation + shift
        is_identity = np.array_equal(matrix, np.eye(3)) and not translation.any()
        assert is_identity == (power == 6)
        np.testing.assert_array_equal(matrix @ cell.matrices[0], cell.matrices[power % 6])
        np.testing.assert_array_equal(matrix @ cell.translations[0] + translation, cell.translations[power % 6])


def test_six_patches_meet_in_the_middle_of_the_bounding_cell() -> None:
    for corners in placed_corners(bounding_cell(USUAL.patch)):
        assert [2, 2, 2] in corners.tolist()


def test_placements_are_signed_permutations() -> None:
    matrices = USUAL.cell.matrices
    np.testing.assert_array_equal(matrices @ np.swapaxes(matrices, 1, 2), np.broadcast_to(np.eye(3), (24, 3, 3)))


def test_bounding_cells_fill_every_other_place_of_the_cubic_cell() -> None:
    cell = USUAL.cell
    places = []
    for k in range(4):
        uses = Counter(map(tuple, placed_corners(cell)[cell.bounding_cell == k].reshape(-1, 3).tolist()))
        (middle,) = [corner for corner, count in uses.items() if count == 6]
        places.append((np.array(middle) - 2) / 4)
    assert set(np.ravel(places).tolist()) == {0, 1}
    # No two are side by side.
    for k, place in enumerate(places):
        assert all(np.abs(place - other).sum() == 2 for other in places[:k])


def test_the_24_patches_of_a_cell_are_distinct_in_the_periodic_lattice() -> None:
    assert len(USUAL.cell) == 24
    assert len(periodic_patches(USUAL.cell)) == 24


def test_every_edge_of_the_periodic_lattice_belongs_to_two_patches() -> None:
    assert Counter(map(len, periodic_edges(USUAL.cell).values())) == {2: 48}


def test_the_euler_characteristic_of_a_cell_is_minus_8() -> None:
    corners = {tuple(c) for c in placed_corners(USUAL.cell).reshape(-1, 3) % CELL_QUARTERS}
    assert len(corners) - len(periodic_edges(USUAL.cell)) + len(periodic_patches(USUAL.cell)) == -8


def test_six_patches_meet_at_every_corner_of_the_periodic_lattice() -> None:
    uses = Counter(tuple(c) for c in placed_corners(USUAL.cell).reshape(-1, 3) % CELL_QUARTERS)
    assert set(uses.values()) == {6}


def test_placed_edges_coincide_and_their_normals_point_to_the_same_side() -> None:
    placements = USUAL.cell
    period = CELL_QUARTERS * QUARTER
    for (first, k), (second, m) in periodic_edges(placements).values():
        points, normals = placed_edge(placements, first, k)
        others, other_normals = (array[::-1] for array in placed_edge(placements, second, m))
        apart = points - others
        np.testing.assert_allclose(apart, period * np.rint(apart[0] / period) + 0 * apart, rtol=0, atol=1e-13)
        np.testing.assert_allclose(normals, other_normals, rtol=0, atol=1e-12)


def test_half_of_the_placements_carry_the_normal_to_the_other_side() -> None:
    sides = USUAL.cell.sides
    assert set(sides.tolist()) == {-1, 1}
    assert sides.sum() == 0


def test_eq_19_as_printed_is_no_surface() -> None:
    printed = as_printed()
    assert len(printed) == 24
    assert len(periodic_patches(printed)) < 24
    assert set(map(len, periodic_edges(printed).values())) != {2}


@settings(max_examples=25, deadline=None)
@given(st.permutations([0, 1, 2]), st.tuples(*[st.sampled_from([-1, 1])] * 3), st.tuples(*[st.integers(-9, 9)] * 3))
def test_transforming_placements_transforms_their_corners(
    order: list[int], signs: tuple[int, int, int], shift: tuple[int, int, int]
) -> None:
    matrix = np.eye(3, dtype=np.int64)[order] * np.array(signs)
    moved = USUAL.cell.transformed(matrix, shift)
    np.testing.assert_array_equal(placed_corners(moved), placed_corners(USUAL.cell) @ matrix.T + np.array(shift))
    assert set(map(len, periodic_edges(moved).values())) == {2}


def test_placements_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        USUAL.cell.matrices[0] = 0

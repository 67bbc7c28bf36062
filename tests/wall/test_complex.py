"""The cell complex: a two-manifold with border, by integer ids."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.symmetry import CELL_QUARTERS, Placements, bounding_cell, placed_corners
from gyroid_cad.wall.complex import CellComplex, build_complex

SIDE = st.integers(1, 3)
BLOCKS = st.tuples(SIDE, SIDE, SIDE)


def euler_characteristic(lattice: CellComplex) -> int:
    """Of the mid-surface with border, fans being its vertices."""
    return lattice.fan_count - lattice.edge_count + lattice.patch_count


def folded_into_the_unit_box() -> Placements:
    """The patches of a cell moved by whole periods until every centre lies in [0, L)."""
    cell = USUAL.cell
    return Placements(cell.patch, cell.matrices, cell.translations % CELL_QUARTERS, cell.bounding_cell)


def with_the_fourth_bounding_cell_one_period_up() -> Placements:
    cell = USUAL.cell
    lifted = CELL_QUARTERS * np.outer(cell.bounding_cell == 3, [0, 0, 1])
    return Placements(cell.patch, cell.matrices, cell.translations + lifted, cell.bounding_cell)


ARRANGEMENTS = st.sampled_from([USUAL.cell, folded_into_the_unit_box(), with_the_fourth_bounding_cell_one_period_up()])


@settings(max_examples=30, deadline=None)
@given(BLOCKS, ARRANGEMENTS)
def test_ids_are_consistent(cells: tuple[int, int, int], placements: Placements) -> None:
    lattice = build_complex(cells, placements)
    assert lattice.patch_count == 24 * np.prod(cells)
    expected = placed_corners(placements)[lattice.patch_placement] + CELL_QUARTERS * lattice.patch_cell[:, np.newaxis]
    np.testing.assert_array_equal(lattice.corner_quarters[lattice.patch_corners], expected)
    np.testing.assert_array_equal(lattice.fan_corner[lattice.patch_fans], lattice.patch_corners)
    # Edge k of a patch joins its fans k and k + 1, forwards or backwards.
    joined = np.stack([lattice.patch_fans, np.roll(lattice.patch_fans, -1, axis=1)], axis=-1)
    joined = np.where(lattice.edge_forward[..., np.newaxis], joined, joined[..., ::-1])
    np.testing.assert_array_equal(lattice.edge_fans[lattice.patch_edges], joined)
    ends = lattice.fan_corner[lattice.edge_fans]
    assert np.all(ends[:, 0] < ends[:, 1])
    assert len(np.unique(ends, axis=0)) == lattice.edge_count
    assert len(np.unique(lattice.corner_quarters, axis=0)) == len(lattice.corner_quarters)


@settings(max_examples=30, deadline=None)
@given(BLOCKS, ARRANGEMENTS)
def test_every_edge_belongs_to_one_or_two_patches(cells: tuple[int, int, int], placements: Placements) -> None:
    lattice = build_complex(cells, placements)
    uses = np.bincount(lattice.patch_edges.ravel(), minlength=lattice.edge_count)
    assert set(uses.tolist()) <= {1, 2}
    np.testing.assert_array_equal(lattice.free, uses == 1)
    for edge, (first, second) in enumerate(lattice.edge_patches):
        users = np.flatnonzero(np.any(lattice.patch_edges == edge, axis=1)).tolist()
        assert users == ([first] if second == -1 else [first, second])


@settings(max_examples=30, deadline=None)
@given(BLOCKS, ARRANGEMENTS)
def test_fans_close_with_six_patches_or_end_at_two_free_edges(
    cells: tuple[int, int, int], placements: Placements
) -> None:
    lattice = build_complex(cells, placements)
    patches = np.bincount(lattice.patch_fans.ravel(), minlength=lattice.fan_count)
    boundary_edges = np.bincount(lattice.edge_fans[lattice.free].ravel(), minlength=lattice.fan_count)
    assert np.all(patches[~lattice.border_fans] == 6)
    assert np.all(patches[lattice.border_fans] < 6)
    np.testing.assert_array_equal(boundary_edges, np.where(lattice.border_fans, 2, 0))
    # A fan of n patches has n edges if it closes, else n + 1.
    edges = np.bincount(lattice.edge_fans.ravel(), minlength=lattice.fan_count)
    np.testing.assert_array_equal(edges, patches + lattice.border_fans)


@settings(max_examples=30, deadline=None)
@given(BLOCKS, ARRANGEMENTS)
def test_the_walls_surface_is_closed(cells: tuple[int, int, int], placements: Placements) -> None:
    lattice = build_complex(cells, placements)
    free, border = int(lattice.free.sum()), int(lattice.border_fans.sum())
    assert border == free
    # Two faces a patch and one a boundary edge; two edges an edge and one through the wall a border fan.
    faces, edges, vertices = 2 * lattice.patch_count + free, 2 * lattice.edge_count + border, 2 * lattice.fan_count
    assert 4 * faces == 2 * edges
    assert vertices - edges + faces == 2 * euler_characteristic(lattice)
    # A piece with border has at most a disk's Euler characteristic.
    assert euler_characteristic(lattice) <= lattice.component_count


@settings(max_examples=30, deadline=None)
@given(BLOCKS)
def test_patches_that_share_an_edge_run_it_in_opposite_senses(cells: tuple[int, int, int]) -> None:
    # Once the patches an improper placement turns over are run backwards, the surface is oriented.
    lattice = build_complex(cells)
    sense = np.where(lattice.edge_forward, 1, -1)
    total = np.zeros(lattice.edge_count, dtype=int)
    np.add.at(total, lattice.patch_edges, sense)
    assert np.all(total[~lattice.free] == 0)
    assert np.all(np.abs(total[lattice.free]) == 1)


@settings(max_examples=20, deadline=None)
@given(BLOCKS, ARRANGEMENTS)
def test_components_are_the_pieces_that_hang_together_by_edges(
    cells: tuple[int, int, int], placements: Placements
) -> None:
    lattice = build_complex(cells, placements)
    first, second = lattice.edge_patches[~lattice.free].T
    np.testing.assert_array_equal(lattice.patch_component[first], lattice.patch_component[second])
    reached, front = {0}, [0]
    neighbours: dict[int, list[int]] = {}
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    while front:
        fresh = [b for b in neighbours.get(front.pop(), []) if b not in reached]
        reached.update(fresh)
        front.extend(fresh)
    same = np.flatnonzero(lattice.patch_component == lattice.patch_component[0])
    assert reached == set(same.tolist())


def test_each_further_cell_adds_the_euler_characteristic_of_a_period() -> None:
    # Mixed differences cancel what the border adds.
    total = 0
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                total += (-1) ** (i + j + k + 1) * euler_characteristic(build_complex((2 + i, 2 + j, 2 + k)))
    assert total == -8


def test_a_bounding_cell_is_a_disk_of_six_patches_round_one_closed_fan() -> None:
    disk = build_complex((1, 1, 1), bounding_cell(USUAL.patch))
    assert euler_characteristic(disk) == 1
    assert disk.patch_count == 6
    assert int(disk.free.sum()) == 12
    assert disk.fan_corner[~disk.border_fans].tolist() == [
        corner for corner, place in enumerate(disk.corner_quarters.tolist()) if place == [2, 2, 2]
    ]


def test_pinch_lines_are_corners_with_several_fans() -> None:
    lattice = build_complex((2, 2, 2), folded_into_the_unit_box())
    fans = np.bincount(lattice.fan_corner)
    assert fans.min() == 1
    assert lattice.fan_count == len(lattice.corner_quarters) + int(np.sum(fans - 1))
    assert lattice.non_manifold_edges == int(np.sum(fans > 1)) > 0


def test_patches_that_touch_only_in_a_line_are_different_components() -> None:
    lattice = build_complex((1, 1, 1), folded_into_the_unit_box())
    assert lattice.component_count == 2
    # The pieces meet at corners, though at none of them by an edge.
    first, second = (set(lattice.patch_corners[lattice.patch_component == c].ravel().tolist()) for c in (0, 1))
    assert 0 < len(first & second) <= lattice.non_manifold_edges


@pytest.mark.parametrize(("cells", "pinches", "free"), [((2, 2, 1), 15, None), ((4, 3, 2), 49, 450)])
def test_known_pinches_of_another_arrangement(cells: tuple[int, int, int], pinches: int, free: int | None) -> None:
    lattice = build_complex(cells, with_the_fourth_bounding_cell_one_period_up())
    assert lattice.non_manifold_edges == pinches
    assert free is None or int(lattice.free.sum()) == free
    assert lattice.component_count == 1


@settings(max_examples=20, deadline=None)
@given(BLOCKS)
def test_the_papers_arrangement_hangs_together(cells: tuple[int, int, int]) -> None:
    assert build_complex(cells).component_count == 1


def test_placements_that_pass_an_edge_to_three_patches_are_refused() -> None:
    cell = bounding_cell(USUAL.patch)
    first = Placements(cell.patch, cell.matrices[:1], cell.translations[:1], cell.bounding_cell[:1])
    thrice = cell.joined(first)
    with pytest.raises(ValueError, match="more than two patches"):
        build_complex((1, 1, 1), thrice)


Cells = tuple[int, int, int]
Closed = tuple[bool, bool, bool]
CLOSINGS = st.tuples(*3 * [st.booleans()])
ALL_ROUND = (True, True, True)


def wrapped(places: NDArray[np.int64], cells: Cells, closed: Closed) -> NDArray[np.int64]:
    """Places in quarters, those a block apart along closed axes made the same."""
    return np.where(closed, places % (CELL_QUARTERS * np.array(cells)), places)


@settings(max_examples=30, deadline=None)
@given(BLOCKS, CLOSINGS, ARRANGEMENTS)
def test_closing_joins_the_corners_that_lie_a_block_apart_and_no_others(
    cells: Cells, closed: Closed, placements: Placements
) -> None:
    joined, opened = build_complex(cells, placements, closed), build_complex(cells, placements)
    here, there = (lattice.corner_quarters[lattice.patch_corners] for lattice in (joined, opened))
    np.testing.assert_array_equal(here, wrapped(there, cells, closed))
    assert len(np.unique(joined.corner_quarters, axis=0)) == len(joined.corner_quarters)
    np.testing.assert_array_equal(joined.patch_cell, opened.patch_cell)


@settings(max_examples=30, deadline=None)
@given(BLOCKS, CLOSINGS)
def test_closing_joins_the_edges_that_lie_a_block_apart_and_no_others(cells: Cells, closed: Closed) -> None:
    joined, opened = build_complex(cells, closed=closed), build_complex(cells)
    ends = opened.corner_quarters[opened.fan_corner[opened.edge_fans]]
    # Twice an edge's middle names it: no two edges cross.
    period = CELL_QUARTERS * np.array(cells) * 2
    middles = np.where(closed, ends.sum(axis=1) % period, ends.sum(axis=1))
    places = np.unique(middles, axis=0, return_inverse=True)[1].ravel()
    assert joined.edge_count == places.max() + 1
    pairs = np.stack([places[opened.patch_edges].ravel(), joined.patch_edges.ravel()], axis=1)
    assert len(np.unique(pairs, axis=0)) == joined.edge_count


@settings(max_examples=30, deadline=None)
@given(BLOCKS, CLOSINGS)
def test_a_closed_complex_is_a_two_manifold_too(cells: Cells, closed: Closed) -> None:
    lattice = build_complex(cells, closed=closed)
    assert set(np.bincount(lattice.patch_edges.ravel()).tolist()) <= {1, 2}
    np.testing.assert_array_equal(lattice.fan_corner[lattice.patch_fans], lattice.patch_corners)
    patches = np.bincount(lattice.patch_fans.ravel(), minlength=lattice.fan_count)
    boundary_edges = np.bincount(lattice.edge_fans[lattice.free].ravel(), minlength=lattice.fan_count)
    assert np.all(patches[~lattice.border_fans] == 6)
    np.testing.assert_array_equal(boundary_edges, np.where(lattice.border_fans, 2, 0))
    sense = np.zeros(lattice.edge_count, dtype=int)
    np.add.at(sense, lattice.patch_edges, np.where(lattice.edge_forward, 1, -1))
    assert np.all(sense[~lattice.free] == 0)


@settings(max_examples=20, deadline=None)
@given(BLOCKS, st.integers(0, 2))
def test_no_edge_across_the_seam_is_free(cells: Cells, axis: int) -> None:
    # Twice as many cells along the closed axis have twice as much border and twice of all else: no end counts.
    closed: Closed = (axis == 0, axis == 1, axis == 2)
    twice: Cells = (cells[0] * (1 + closed[0]), cells[1] * (1 + closed[1]), cells[2] * (1 + closed[2]))
    one, two = build_complex(cells, closed=closed), build_complex(twice, closed=closed)
    assert two.free.sum() == 2 * one.free.sum()
    assert (two.edge_count, two.fan_count) == (2 * one.edge_count, 2 * one.fan_count)
    assert one.free.sum() < build_complex(cells).free.sum()


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1), (1, 2, 3)])
def test_closed_all_round_the_surface_has_no_border_and_its_periods_euler_characteristic(cells: Cells) -> None:
    lattice, count = build_complex(cells, closed=ALL_ROUND), int(np.prod(cells))
    assert euler_characteristic(lattice) == -8 * count
    assert not lattice.free.any()
    assert np.all(lattice.edge_patches[:, 1] > lattice.edge_patches[:, 0])
    # Twenty-four quadrangles, two to an edge, six to a corner.
    assert (lattice.patch_count, lattice.edge_count, lattice.fan_count) == (24 * count, 48 * count, 16 * count)
    assert lattice.component_count == 1
    assert lattice.non_manifold_edges == 0

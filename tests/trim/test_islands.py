"""Islands of a cut: which are small, which are kept, and where the warning of them points."""

from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given

from gyroid_cad.errors import IslandsWarning, ParameterError, SealedVoidsWarning
from gyroid_cad.trim.islands import (
    SMALL_ISLAND,
    Islands,
    SealedVoid,
    island_rule,
    islands_of,
    kept_pieces,
    speck_below,
    warn_of_voids,
)

volumes = st.lists(st.floats(1e-6, 1e6), min_size=1, max_size=12)
cells = st.floats(1e-3, 1e6)


@given(volumes, cells)
def test_the_largest_piece_is_kept_by_every_rule_and_every_piece_by_one(sizes: list[float], one_cell: float) -> None:
    small, every, one = (kept_pieces(sizes, one_cell, rule) for rule in ("drop small", "keep all", "drop all"))
    assert sizes[one[0]] == sizes[small[0]] == max(sizes)
    assert len(one) == 1
    assert sorted(every) == list(range(len(sizes)))
    assert set(one) <= set(small) <= set(every)


@given(volumes, cells)
def test_what_is_dropped_is_smaller_than_all_that_is_kept_and_small_beside_cell_and_largest(
    sizes: list[float], one_cell: float
) -> None:
    kept = kept_pieces(sizes, one_cell, "drop small")
    for index in set(range(len(sizes))) - set(kept):
        assert sizes[index] < SMALL_ISLAND * one_cell
        assert sizes[index] < SMALL_ISLAND * max(sizes)
        assert sizes[index] <= min(sizes[other] for other in kept)


@given(volumes, cells)
def test_islands_kept_and_dropped_and_the_largest_piece_are_all_there_is(sizes: list[float], one_cell: float) -> None:
    kept = kept_pieces(sizes, one_cell, "drop small")
    islands = islands_of(sizes, kept)
    assert 1 + islands.kept + islands.dropped == len(sizes)
    assert max(sizes) + islands.kept_volume + islands.dropped_volume == pytest.approx(sum(sizes))


def test_of_no_pieces_none_is_kept() -> None:
    assert kept_pieces([], 1.0, "drop small") == []


def test_small_ones_are_dropped_unless_one_of_two_switches_says_otherwise() -> None:
    assert (island_rule(False), island_rule(True), island_rule(False, True)) == ("drop small", "keep all", "drop all")
    with pytest.raises(ParameterError, match="not both"):
        island_rule(True, True)


def test_the_warning_points_at_the_line_outside_this_package_that_caused_it() -> None:
    with pytest.warns(
        IslandsWarning, match="1 island, 2 mm3 in all: dropped .*; 3 islands, 5 mm3 in all: left"
    ) as seen:
        Islands(kept=3, kept_volume=5.0, dropped=1, dropped_volume=2.0).warn("drop_islands drops")
    assert seen[0].filename == __file__


def test_without_islands_there_is_no_warning(recwarn: pytest.WarningsRecorder) -> None:
    Islands().warn()
    assert not recwarn.list


def test_the_warning_of_sealed_voids_counts_them_and_says_where_the_largest_is() -> None:
    with pytest.warns(
        SealedVoidsWarning, match=r"2 voids that no opening reaches, the largest 3 mm3 round \(1, 2, 3\)"
    ) as seen:
        warn_of_voids([SealedVoid(0.5, (0.0, 0.0, 0.0)), SealedVoid(3.0, (1.0, 2.0, 3.0))])
    assert seen[0].filename == __file__


@given(st.floats(1e-3, 1e3))
def test_a_speck_is_small_beside_a_cell_whatever_its_size(cell_size: float) -> None:
    assert 0 < speck_below(cell_size) <= SMALL_ISLAND * cell_size**3 * 1.01

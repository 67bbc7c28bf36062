"""Tables as plain text."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.common.tables import cells_shown, text_table, volume_shown, wall_shown

CELL = st.text(alphabet="abcxyz0189.,", min_size=1)


@given(st.lists(st.tuples(CELL, CELL, CELL), min_size=1))
def test_each_row_is_a_line_and_its_cells_stand_in_columns(rows: list[tuple[str, ...]]) -> None:
    lines = text_table(rows, ("one", "two", "three")).splitlines()
    starts = [lines[0].index(word) for word in ("one", "two", "three")]
    assert len(lines) == len(rows) + 1
    for line, row in zip(lines[1:], rows, strict=True):
        assert line.split() == list(row)
        assert all(line[start:].startswith(cell) for start, cell in zip(starts, row, strict=True))


def test_no_line_ends_in_spaces() -> None:
    assert text_table([("a", "long"), ("b", "x")]) == "a  long\nb  x"


def test_cells_that_a_map_changes_are_not_said_to_be_of_one_size() -> None:
    assert cells_shown((2, 1, 3), 10.0) == "2 x 1 x 3, 10 mm each"
    assert cells_shown((2, 1, 3), 10.0, alike=False) == "2 x 1 x 3, 10 mm before scaling or mapping"


def test_a_wall_that_varies_is_shown_by_its_range() -> None:
    assert wall_shown(0.8, 0.8, 0.8, 0.25) == "0.8 mm, density 0.25000"
    assert wall_shown(0.8, 0.5, 1.25, 0.25) == "0.5 to 1.25, on average 0.8 mm, density 0.25000"


def test_a_volume_is_shown_beside_the_exact_one_where_that_is_known() -> None:
    assert volume_shown(101.0, 100.0) == "101 mm3, +1.0e-02 of the exact one"
    assert volume_shown(101.0, None) == "101 mm3"

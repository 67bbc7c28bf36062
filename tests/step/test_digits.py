"""Numbers as text, many at once: what is written is what is read, to as many digits as are asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.step.digits import decimal_text, integer_text, joined_rows, text_rows
from gyroid_cad.step.text import real

NEWLINE = text_rows(["\n"])


def lines(rows: np.ndarray) -> list[str]:
    return joined_rows(rows, np.broadcast_to(NEWLINE, (len(rows), 1))).decode().splitlines()


@given(st.lists(st.integers(0, 10**18), min_size=1))
def test_integers_are_written_as_python_writes_them(values: list[int]) -> None:
    assert lines(integer_text(np.array(values))) == list(map(str, values))


@pytest.mark.parametrize("decimals", [5, 10, 13])
@given(st.lists(st.floats(-9e4, 9e4), min_size=1))
def test_numbers_come_back_rounded_to_their_decimals(decimals: int, values: list[float]) -> None:
    back = [float(line) for line in lines(decimal_text(np.array(values), decimals))]
    assert np.all(np.abs(np.array(back) - values) <= 0.5 * 10.0**-decimals + 2 * np.spacing(np.abs(values)))


@given(st.lists(st.integers(-(10**8), 10**8), min_size=1))
def test_a_number_with_few_decimals_is_written_as_step_has_it_and_no_longer(values: list[int]) -> None:
    # Those below a thousandth have an exponent in Python's own text.
    some = np.array(values) / 1000
    assert lines(decimal_text(some, 10)) == [real(value) if value else "0." for value in some.tolist()]

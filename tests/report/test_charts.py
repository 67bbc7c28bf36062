"""Charts of the report's page: ticks and histograms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.report.charts import histogram, ticks


@given(low=st.floats(-1e6, 1e6), width=st.floats(1e-3, 1e6), most=st.integers(2, 9))
def test_ticks_are_evenly_spaced_round_numbers_within_their_range(low: float, width: float, most: int) -> None:
    found = ticks(low, low + width, most)
    assert 1 <= len(found) <= most
    slack = 1e-6 * width
    assert len(found) == 1 or (found[0] >= low - slack and found[-1] <= low + width + slack)
    if len(found) > 1:
        step = found[1] - found[0]
        mantissa = step / 10 ** np.floor(np.log10(step) + 1e-6)
        assert min(abs(mantissa - round_number) for round_number in (1, 2, 5)) < 1e-3


def test_bars_are_as_high_as_their_shares_and_names_are_escaped() -> None:
    from xml.etree import ElementTree

    svg = ElementTree.fromstring(histogram([0, 1, 2, 3], [0.5, 0.25, 0.25], "<b> & wall", [("<i>", 1.5)]))
    bars = [float(rect.get("height", "")) for rect in svg.iter("rect")]
    assert bars[0] == pytest.approx(2 * bars[1], rel=1e-3)
    assert bars[1] == bars[2]
    assert svg.get("aria-label") == "Histogram: <b> & wall"

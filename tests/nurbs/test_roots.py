"""Roots of sampled functions, those that hide between samples too."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.nurbs.roots import roots

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SAMPLES = np.linspace(-1.1, 1.1, 23)


def found(*functions: Callable[[Floats], Floats]) -> list[list[float]]:
    """Roots of each function in [-1, 1]."""

    def at(which: Integers, x: Floats) -> tuple[Floats, Floats]:
        def values(x: Floats) -> Floats:
            return np.array([functions[k](one) for k, one in zip(which.tolist(), x, strict=True)])

        return values(x), (values(x + 1e-5) - values(x - 1e-5)) / 2e-5

    which, places = roots(SAMPLES, np.array([function(SAMPLES) for function in functions]), at)
    return [places[which == k].tolist() for k in range(len(functions))]


@given(st.floats(-0.999, 0.999), st.floats(1e-5, 0.3), st.floats(-3, 3))
def test_two_roots_are_found_however_close(middle: float, apart: float, lean: float) -> None:
    ends = [middle - apart / 2, middle + apart / 2]
    # Off every sample, where a root would be told from rounding only.
    if any(np.min(np.abs(SAMPLES - end)) < 1e-6 for end in ends):
        return

    def both_ways(sign: float) -> Callable[[Floats], Floats]:
        return lambda x: sign * (x - ends[0]) * (x - ends[1]) * (4 + lean * x)

    for places in found(both_ways(1), both_ways(-1)):
        assert places == pytest.approx([end for end in ends if abs(end) < 1], abs=1e-8)


@given(st.floats(-1, 1), st.floats(1e-9, 1))
def test_what_turns_back_before_zero_has_no_root(middle: float, above: float) -> None:
    assert found(lambda x: (x - middle) ** 2 + above, lambda x: -((x - middle) ** 2) - above) == [[], []]


def test_newton_thrown_off_by_a_flat_place_comes_back() -> None:
    # Between 0 and 0.1 it all but stops, and Newton's step from there would leave.
    assert found(lambda x: np.tanh(300 * (x - 0.07)))[0] == pytest.approx([0.07], abs=1e-9)


def test_functions_not_near_have_no_roots() -> None:
    assert found(lambda x: np.full_like(x, np.inf), lambda x: x - 0.05) == [[], pytest.approx([0.05])]


def test_no_functions_have_no_roots() -> None:
    which, places = roots(SAMPLES, np.zeros((0, len(SAMPLES))), lambda which, x: (x, x))
    assert len(which) == len(places) == 0

"""Places and values that tests of fields give, and what a refusal looks like."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from hypothesis import strategies as st

from gyroid_cad.errors import ParameterError

POINTS = np.random.default_rng(7).uniform(-20, 20, (4, 5, 3))
PLACE = np.moveaxis(POINTS, -1, 0)
FIRST = "(x, y, z) = (1, 2, 3) mm"
WALK = np.arange(1.0, 10.0).reshape(3, 3)

NUMBERS = st.floats(-100, 100)
LENGTHS = st.floats(0.01, 100)
PLACES = st.tuples(NUMBERS, NUMBERS, NUMBERS)
DIRECTIONS = PLACES.filter(lambda way: max(map(abs, way)) > 1e-3)
NOT_NUMBERS = [nan, inf, -inf, 10**400, True, np.True_, None, "1", 1j, [1.0], np.array(1.0)]
NOT_POINTS = [(0, 0), (0, 0, 0, 0), (0, 0, nan), (0, inf, 0), (0, 1j, 0), "abc", ("0", "1", "2"), None, 5.0, {1, 2, 3}]
NOT_POINTS += [[[0, 0, 0]], (True, False, True), ((0, 1), 2, 3), (0, 0, 10**400), (None, 1, 2)]


def refusal(parameter: str, attempt: Callable[..., Any], *arguments: Any, **named: Any) -> str:
    """The message of a ParameterError for the parameter, a single line."""
    with pytest.raises(ParameterError) as caught:
        attempt(*arguments, **named)
    assert caught.value.parameter == parameter
    message = str(caught.value)
    assert message.startswith(f"{parameter} = ")
    assert "\n" not in message
    return message

"""The store of what was made last."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.common.cache import Cache


@given(requested=st.lists(st.integers(0, 5), max_size=30), most=st.integers(1, 4))
def test_the_things_asked_for_last_are_held_and_no_others(requested: list[int], most: int) -> None:
    store: Cache[int, int] = Cache(most)
    made: list[int] = []
    for key in requested:
        store.get(key, lambda key=key: made.append(key) or key)  # type: ignore[misc,func-returns-value]
    last = list(dict.fromkeys(reversed(requested)))[:most]
    assert len(store) == len(last)
    before = len(made)
    for key in last:
        store.get(key, lambda: pytest.fail("it was held"))
    assert len(made) == before


def test_what_failed_is_not_held() -> None:
    store: Cache[str, float] = Cache()
    with pytest.raises(ZeroDivisionError):
        store.get("a", lambda: 1 / 0)
    assert len(store) == 0
    assert store.get("a", lambda: 2.0) == 2.0

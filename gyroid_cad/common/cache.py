"""The last few things that took long to make, by what they are made of."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

__all__ = ["Cache"]

Key = TypeVar("Key", bound=Hashable)
Value = TypeVar("Value")


class Cache(Generic[Key, Value]):
    """A store that forgets what was asked for longest ago; ``functools.lru_cache`` would take progress for a key.

    Parameters
    ----------
    most : int
        How many it holds.
    """

    def __init__(self, most: int = 2) -> None:
        self._most = most
        self._held: OrderedDict[Key, Value] = OrderedDict()

    def __len__(self) -> int:
        return len(self._held)

    def get(self, key: Key, make: Callable[[], Value]) -> Value:
        """Return the value held for a key, or else make it now."""
        if key not in self._held:
            made = make()
            while len(self._held) >= self._most:
                self._held.popitem(last=False)
            self._held[key] = made
        self._held.move_to_end(key)
        return self._held[key]

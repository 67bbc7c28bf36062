"""The wall: cell complex, grading, offset control nets, their areas and their self-intersection."""

from typing import Any

from gyroid_cad.former import former_name, place_in


def __getattr__(name: str) -> Any:
    # The module of this name had it, before that became a room.
    return former_name(__name__, name, place_in(["gyroid_cad.wall.offset"], name))

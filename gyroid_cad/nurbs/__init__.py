"""B-splines: curves, surfaces and volumes, their evaluation, quadrature and root finding."""

from typing import Any

from gyroid_cad.former import former_name, place_in


def __getattr__(name: str) -> Any:
    # The module of this name had it, before that became a room.
    return former_name(__name__, name, place_in(["gyroid_cad.nurbs.surface"], name))

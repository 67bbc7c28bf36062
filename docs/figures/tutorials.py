"""The picture of the tutorial on heat exchangers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
from drawing import WALL, Sheet, Vector, View, draw

from gyroid_cad import fill

_HOT, _COLD = (0.80, 0.33, 0.25), (0.30, 0.50, 0.75)
# Of the triangles, in mm and radians.
_DEVIATION, _ANGLE = 0.02, 0.2


def fig_heat_exchanger() -> Path:
    """The wall and both fluids of ``docs/tutorials/heat_exchanger.md``."""
    core = cq.Workplane().box(10, 10, 10)
    settings: dict[str, Any] = {"cell_size": 10, "thickness": 0.8, "origin": (2, 0, 0)}
    wall = _sheet(fill(core, **settings).domains["sheet"], WALL)
    domains = fill(core, **settings, kind="channels").domains
    hot, cold = _sheet(domains["channel-a"], _HOT), _sheet(domains["channel-b"], _COLD)
    views = (
        View("wall", (wall,)),
        View("fluid a", (hot,)),
        View("fluid b", (cold,)),
        View("together", (wall, hot, cold)),
    )
    return draw("fig_heat_exchanger", views, (1400, 420))


def _sheet(shape: Any, colour: Vector) -> Sheet:
    points, triangles = cq.Shape.cast(shape).tessellate(_DEVIATION, _ANGLE)
    return Sheet(np.array([point.toTuple() for point in points]), np.array(triangles), colour, 0.0)

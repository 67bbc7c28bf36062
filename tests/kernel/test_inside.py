"""Inside and outside of a part: a mesh tells of most points, the kernel of those that are next to the surface."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

from gyroid_cad.kernel.part import require_part
from gyroid_cad.kernel.step import read_step

RADIUS, POINTS = 5.0, 4096
PARTS = Path(__file__).parents[3] / "shared" / "parts"


def directions(count: int) -> np.ndarray:
    some = np.random.default_rng(4).normal(size=(count, 3))
    return some / np.linalg.norm(some, axis=1, keepdims=True)


@pytest.mark.parametrize("gap", [1e-5, 1e-4, 1e-3, 0.1])
def test_points_beside_a_curved_face_are_told_to_its_last_digits(gap: float) -> None:
    part = require_part(BRepPrimAPI_MakeSphere(RADIUS).Shape())
    on = directions(50)
    assert part.contains((RADIUS - gap) * on).all()
    assert not part.contains((RADIUS + gap) * on).any()


def test_the_side_is_right_beside_edges_corners_and_voids_however_far_off_the_part_stands() -> None:
    away = np.array([10_000.0, -3_000.0, 20.0])
    corner, below = (gp_Pnt(*(away + place).tolist()) for place in ((0, 0, 0), (4, 3, -1)))
    block = BRepPrimAPI_MakeBox(corner, 8.0, 6.0, 4.0).Shape()
    bore = BRepPrimAPI_MakeCylinder(gp_Ax2(below, gp_Dir(0, 0, 1)), 2.0, 3.0).Shape()
    part = require_part(BRepAlgoAPI_Cut(block, bore).Shape())
    own = np.random.default_rng(5).uniform(-0.5, (8.5, 6.5, 4.5), (POINTS, 3))
    in_block = np.all((own > 0) & (own < (8, 6, 4)), axis=1)
    in_bore = (np.hypot(own[:, 0] - 4, own[:, 1] - 3) < 2) & (own[:, 2] < 2)
    assert np.array_equal(part.contains(own + away), in_block & ~in_bore)


@pytest.mark.skipif(not PARTS.is_dir(), reason="the folder of parts is not there")
@pytest.mark.parametrize("name", ["threaded", "nozzle_band"])
def test_the_share_of_points_inside_a_part_that_the_kernel_is_slow_with_is_that_of_its_volume(name: str) -> None:
    part = require_part(read_step(PARTS / f"{name}.step"))
    points = np.random.default_rng(0).uniform(part.low, part.high, (POINTS, 3))
    inside = part.contains(points)
    expected, box = part.volume, float(np.prod(part.high - part.low))
    share = expected / box
    assert inside.mean() == pytest.approx(share, abs=4 * np.sqrt(share * (1 - share) / POINTS))

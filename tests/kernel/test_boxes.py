"""Boxes round faces hold all of them: what lies out of its box is not crossed."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakePrism, BRepPrimAPI_MakeTorus
from OCP.gp import gp_Vec
from OCP.TopAbs import TopAbs_FACE

from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.extent import box_round, corners_of

RING, PIPE = 5.0, 2.0


@pytest.mark.parametrize(("first", "last"), [(-75.0, 75.0), (-90.0, 112.0), (0.0, 150.0), (-180.0, 180.0)])
def test_a_piece_of_a_ring_lies_in_its_box(first: float, last: float) -> None:
    shape = BRepPrimAPI_MakeTorus(RING, PIPE, np.radians(first), np.radians(last), np.radians(70)).Shape()
    low, high = corners_of(box_round([as_face(face) for face in parts_of(shape, TopAbs_FACE)]))
    v, u = (some.ravel() for some in np.meshgrid(np.radians(np.linspace(first, last, 41)), np.radians([0, 20, 40, 70])))
    away = RING + PIPE * np.cos(v)
    points = np.column_stack([away * np.cos(u), away * np.sin(u), PIPE * np.sin(v)])
    assert (points >= low - 1e-9).all()
    assert (points <= high + 1e-9).all()


@pytest.mark.parametrize("seed", range(4))
def test_an_extruded_spline_lies_in_its_box(seed: int) -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    random = np.random.default_rng(seed)
    spline = cq.Edge.makeSpline([cq.Vector(*place) for place in random.uniform(-9, 9, (5, 2))], periodic=True)
    prism = BRepPrimAPI_MakePrism(spline.wrapped, gp_Vec(0, 0, 3)).Shape()
    (low_x, low_y, _), (high_x, high_y, _) = corners_of(box_round([prism]))
    x, y, _ = np.array([place.toTuple() for place in spline.positions(np.linspace(0, 1, 5001))]).T
    assert low_x <= x.min() + 1e-7
    assert low_y <= y.min() + 1e-7
    assert high_x >= x.max() - 1e-7
    assert high_y >= y.max() - 1e-7

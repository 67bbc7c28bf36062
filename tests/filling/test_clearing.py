"""Lattices that stand clear of the parts they fill: no edge too short for who receives the solid."""

from __future__ import annotations

from functools import partial

import cadquery as cq
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE

from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.infill import described_infill
from gyroid_cad.filling.part import Filling, part_of
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.clearance import NearMisses, clear_shift
from gyroid_cad.wall.covering import frame_of
from gyroid_cad.wall.fitted import Closeness

CELL, SHORTEST = 6.0, 0.02


def shortest_edge(shape: object) -> float:
    lengths = []
    for edge in parts_of(shape, TopAbs_EDGE):
        properties = GProp_GProps()
        BRepGProp.LinearProperties_s(edge, properties)
        lengths.append(properties.Mass())
    return min(length for length in lengths if length > 1e-9)


def filling_of(part: cq.Workplane) -> Filling:
    regions, _, _, _, infill_in = described_infill("sheet", CELL, 0.6, None, Closeness(FitSettings(5)), None, USUAL)
    body = part_of(part)
    return Filling(body, None, regions, partial(infill_in, body), CELL, None)


def test_no_edge_is_too_short_where_corners_of_the_lattice_all_but_touch_the_part() -> None:
    plate = cq.Workplane().box(7, 5, 8.0).faces(">Z").workplane().hole(2.6)
    given_origin, free = (fill(plate, CELL, density=0.3, fit=FitSettings(6), origin=at) for at in ((0, 0, 0), None))
    assert shortest_edge(given_origin.solid()) < SHORTEST < shortest_edge(free.solid())
    assert 0 < np.linalg.norm(free.report.shift) <= 0.12 * CELL
    assert "too short" in str(free.report)
    assert given_origin.report.shift == (0, 0, 0)


@pytest.mark.parametrize("part", [cq.Workplane().box(7, 5, 8), cq.Workplane().sphere(4)], ids=["box", "ball"])
def test_near_misses_change_with_a_shift_of_the_lattice_as_their_directions_say(part: cq.Workplane) -> None:
    filling, shift = filling_of(part), np.array([2e-4, -1e-4, 3e-4])
    before, after = (filling.near_misses(frame_of(at, (0, 0, 0)), 0.3) for at in (np.zeros(3), shift))
    foretold = before.moved(shift)
    # Some leave the reach and others come into it: each that is well within has one beside it.
    inner = np.abs(foretold.heights) < 0.29
    away = np.abs(foretold.heights[inner, None] - after.heights) + np.linalg.norm(
        foretold.directions[inner, None] - after.directions, axis=-1
    )
    assert np.count_nonzero(inner) > 20
    assert np.quantile(away.min(axis=1), 0.95) < 2e-3


@settings(max_examples=30, deadline=None)
@given(
    st.lists(st.floats(-0.02, 0.02), min_size=1, max_size=6),
    st.integers(0, 2**31),
)
def test_the_shift_clears_what_can_be_cleared(heights: list[float], seed: int) -> None:
    ways = np.random.default_rng(seed).normal(size=(len(heights), 3))
    misses = NearMisses(np.array(heights), ways / np.linalg.norm(ways, axis=1, keepdims=True), np.ones(len(heights)))
    shift = clear_shift(misses, least=0.02, most=0.2)
    assert np.linalg.norm(shift) <= 0.2
    assert misses.moved(shift).count_below(0.02) == 0

"""Caps on a box's sides: from a full box, from a plane's cut, and from curves that do not agree."""

from __future__ import annotations

from itertools import count

import numpy as np
import pytest
from conftest import Graph
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.trim.caps import Cap, CapArc, End, caps_of, plane_axes
from gyroid_cad.trim.edge_crossings import PLANES
from gyroid_cad.trim.trimmed_faces import cut_faces

Floats = NDArray[np.float64]

LOW, HIGH = np.array([-0.6, -0.5, -0.7]), np.array([0.5, 0.4, 0.8])


class Straights:
    """Numbers for straight edges between two ends; where each is."""

    def __init__(self) -> None:
        self.numbers: dict[tuple[End, End], int] = {}

    def __call__(self, ends: tuple[End, End]) -> int:
        return self.numbers.setdefault(ends, 1000 + len(self.numbers))


def graph_arcs(graph: Graph, a: float, b: float, c: float, bend: float, above: bool = False) -> list[list[CapArc]]:
    """The arcs in which z = a x + b y + c + bend x y cuts the upright sides of the box, from one edge to the next.

    What is wanted lies below the face, or above.
    """
    levels = {plane: float((LOW if sign > 0 else HIGH)[axis]) for plane, (axis, sign) in enumerate(PLANES) if axis < 2}
    (face,) = cut_faces(graph(lambda x, y: a * x + b * y + c + bend * x * y, levels), 1.0)
    arcs: list[list[CapArc]] = [[] for _ in PLANES]
    nodes, numbers = {node: k for k, node in enumerate(face.points)}, count()
    for arc in (arc for piece in face.pieces for loop in piece.loops for arc in loop):
        ends = nodes[arc.start], nodes[arc.end]
        arcs[face.plane(arc)].append(CapArc(next(numbers), above, *ends, face, arc, np.zeros(3)))
    return arcs


def side_area(plane: int) -> float:
    return float(np.prod(np.delete(HIGH - LOW, PLANES[plane][0])))


def areas(caps: list[Cap]) -> list[float]:
    return [sum(cap.area for cap in caps if cap.plane == plane) for plane in range(len(PLANES))]


def test_axes_of_a_side_and_its_outward_normal_are_right_handed() -> None:
    for plane, (axis, sign) in enumerate(PLANES):
        x, y = plane_axes(plane)
        assert np.linalg.det(np.eye(3)[[x, y, axis]]) == pytest.approx(-sign)


@pytest.mark.parametrize("filled", [True, False])
def test_with_no_curves_a_box_is_all_caps_or_none(filled: bool) -> None:
    straights = Straights()
    caps = caps_of([[] for _ in PLANES], LOW, HIGH, straights, filled)
    assert areas(caps) == pytest.approx([side_area(plane) if filled else 0.0 for plane in range(len(PLANES))])
    uses = sorted(use for cap in caps for loop in cap.loops for use in loop)
    assert uses == sorted((edge, way) for edge in straights.numbers.values() for way in (False, True))
    assert len(straights.numbers) == (12 if filled else 0)


slopes = st.floats(-0.3, 0.3)


@settings(max_examples=15)
@given(slopes, slopes, slopes, slopes, st.booleans())
def test_below_a_face_and_above_it_caps_are_what_integration_gives(
    graph: Graph, a: float, b: float, c: float, bend: float, above: bool
) -> None:
    caps = caps_of(graph_arcs(graph, a, b, c, bend, above), LOW, HIGH, Straights(), False)
    middle, extent = (LOW + HIGH) / 2, HIGH - LOW
    expected = []
    for plane, (axis, sign) in enumerate(PLANES):
        if axis == 2:
            expected.append(side_area(plane) if (sign < 0) == above else 0.0)
        else:
            # The height is linear along each upright side: its mean is that in the middle.
            x, y = middle[:2].copy()
            x, y = ((LOW if sign > 0 else HIGH)[0], y) if axis == 0 else (x, (LOW if sign > 0 else HIGH)[1])
            mean = a * x + b * y + c + bend * x * y
            expected.append(float(extent[1 - axis]) * (HIGH[2] - mean if above else mean - LOW[2]))
    assert areas(caps) == pytest.approx(expected, abs=1e-6)


@settings(max_examples=10)
@given(slopes, slopes, slopes)
def test_each_straight_edge_is_used_once_each_way_and_each_curve_once(
    graph: Graph, a: float, b: float, c: float
) -> None:
    straights = Straights()
    arcs = graph_arcs(graph, a, b, c, 0.1)
    caps = caps_of(arcs, LOW, HIGH, straights, False)
    uses = [use for cap in caps for loop in cap.loops for use in loop]
    assert len(set(uses)) == len(uses)
    curves = [arc.edge for on_plane in arcs for arc in on_plane]
    assert sorted(edge for edge, _ in uses) == sorted([*curves, *2 * list(straights.numbers.values())])
    # Four uprights from the floor to the curves' ends, and the floor's four edges.
    assert len(straights.numbers) == 8


def test_curves_that_do_not_agree_are_an_error(graph: Graph) -> None:
    arcs = graph_arcs(graph, 0.1, 0.2, 0.0, 0.1)
    missing = [on_plane if plane else [] for plane, on_plane in enumerate(arcs)]
    with pytest.raises(KernelError):
        caps_of(missing, LOW, HIGH, Straights(), False)
    turned = [
        [CapArc(arc.edge, not arc.forward, arc.start, arc.end, arc.cut, arc.arc, arc.shift) for arc in on_plane]
        if plane == 0
        else on_plane
        for plane, on_plane in enumerate(arcs)
    ]
    with pytest.raises(KernelError, match="do not agree"):
        caps_of(turned, LOW, HIGH, Straights(), False)

"""Links joined to loops, holes and what they are holes in, areas."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.trim.loops import contains, linked, nested, signed_area

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Link:
    start: int
    end: int


def circle(radius: float, x: float = 0.0, turns: int = 1) -> Floats:
    angles = turns * np.linspace(0, 2 * np.pi, 400, endpoint=False)
    return np.column_stack([x + radius * np.cos(angles), radius * np.sin(angles)])


@given(st.permutations(range(12)))
def test_any_permutation_is_its_cycles(images: list[int]) -> None:
    loops = linked([Link(start, end) for start, end in enumerate(images)], "it")
    assert sorted(link.start for loop in loops for link in loop) == list(range(12))
    for loop in loops:
        assert [link.end for link in loop] == [link.start for link in (*loop[1:], loop[0])]


@pytest.mark.parametrize("links", [[(0, 1)], [(0, 1), (1, 0), (0, 2)], [(0, 1), (2, 1), (1, 0)], [(0, 1), (1, 2)]])
def test_links_that_do_not_close_are_an_error(links: list[tuple[int, int]]) -> None:
    with pytest.raises(KernelError, match="leaves of the part does not close"):
        linked([Link(*link) for link in links], "the part")


@given(st.floats(-5, 5), st.floats(0.5, 3))
def test_a_polygon_run_backwards_has_the_opposite_area(x: float, radius: float) -> None:
    area = signed_area(circle(radius, x))
    assert area == pytest.approx(np.pi * radius**2, rel=1e-4)
    assert signed_area(circle(radius, x, -1)) == pytest.approx(-area)


@given(st.floats(-3, 3), st.floats(-3, 3))
def test_a_place_is_held_as_by_the_circle_that_a_polygon_stands_for(x: float, y: float) -> None:
    distance = np.hypot(x - 0.5, y)
    if abs(distance - 1.5) > 1e-3:
        assert contains(circle(1.5, 0.5), np.array([x, y])) == (distance < 1.5)


def test_a_hole_goes_to_the_innermost_loop_round_it() -> None:
    # An island in a hole, with a hole of its own, and one that lies apart.
    outlines = [circle(5), circle(4, turns=-1), circle(3), circle(2, turns=-1), circle(1, 9)]
    assert sorted(nested(outlines)) == [[0, 1], [2, 3], [4]]


def test_a_hole_in_nothing_is_an_error() -> None:
    with pytest.raises(KernelError, match="lies in none"):
        nested([circle(1), circle(0.5, 3, turns=-1)])

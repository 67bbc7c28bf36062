"""Connected components, against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gyroid_cad.common.graph import connected, runs_on

Edges = list[tuple[int, int]]


@st.composite
def graphs(draw: st.DrawFn) -> tuple[int, Edges]:
    count = draw(st.integers(1, 30))
    node = st.integers(0, count - 1)
    return count, draw(st.lists(st.tuples(node, node), max_size=60))


@given(graphs())
def test_components_are_those_of_scipy_numbered_by_their_lowest_nodes(graph: tuple[int, Edges]) -> None:
    count, edges = graph
    first, second = np.array(edges, dtype=np.int64).reshape(-1, 2).T
    labels = connected(count, first, second)
    joined = coo_array((np.ones(len(edges)), (first, second)), shape=(count, count))
    number, expected = connected_components(joined, directed=False)
    assert labels.max() + 1 == number
    assert len(np.unique(np.stack([labels, expected]), axis=1).T) == number
    lowest = [int(np.argmax(labels == label)) for label in range(number)]
    assert lowest == sorted(lowest)


def test_a_long_chain_in_any_order_is_one_component() -> None:
    nodes = np.random.default_rng(0).permutation(100_000)
    assert connected(len(nodes), nodes[1:], nodes[:-1]).max() == 0


@pytest.mark.parametrize(("step", "endless"), [((0, 0, 0), False), ((1, 0, 0), True), ((2, -4, 0), True)])
def test_a_ring_runs_on_unless_its_steps_lead_back(step: tuple[int, int, int], endless: bool) -> None:
    cells = np.array([(1, 1, 0), (-1, -1, 0), step])
    assert runs_on(3, np.array([0, 1, 2]), np.array([1, 2, 0]), cells) is endless


def test_a_chain_through_many_cells_that_never_closes_does_not_run_on() -> None:
    cells = np.tile([1, 0, 0], (9, 1))
    assert not runs_on(10, np.arange(9), np.arange(1, 10), cells)

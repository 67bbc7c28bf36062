"""Pairs of nodes that are one in the endless lattice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyroid_cad import Lattice
from gyroid_cad.maps import Cylinder
from gyroid_cad.mesh.finite_elements.hexahedra import hexahedra
from gyroid_cad.mesh.finite_elements.periodic import periodic_pairs
from gyroid_cad.mesh.nodes import FREE_WALLS
from gyroid_cad.surface.fit import FitSettings

SIZE = 10.0
ORDERS = [(1, False), (2, False), (2, True)]


def lattice(cells: tuple[int, int, int] = (1, 1, 1), **given: object) -> Lattice:
    return Lattice(cells, SIZE, **{"thickness": 0.9, "fit": FitSettings(6), **given})  # type: ignore[arg-type]


@settings(max_examples=15)
@given(
    cells=st.tuples(*3 * [st.integers(1, 3)]),
    subdivisions=st.integers(1, 3),
    layers=st.integers(1, 2),
    order=st.sampled_from(ORDERS),
)
def test_every_node_of_the_free_walls_is_paired_and_no_other(
    cells: tuple[int, int, int], subdivisions: int, layers: int, order: tuple[int, bool]
) -> None:
    made = lattice(cells)
    mesh = made.hexahedra(subdivisions, layers, *order)
    pairs = made.periodic_pairs(mesh)
    paired = np.union1d(pairs.first, pairs.second)
    assert np.array_equal(paired, mesh.node_sets()[FREE_WALLS])
    assert len(np.unique(pairs.second)) == len(pairs)
    assert not len(np.intersect1d(pairs.first, pairs.second))
    apart = mesh.points[pairs.second] - mesh.points[pairs.first]
    np.testing.assert_allclose(apart, pairs.blocks * pairs.period, atol=1e-10)


@pytest.mark.parametrize("order", ORDERS)
def test_joined_by_its_pairs_a_block_has_no_border(order: tuple[int, bool]) -> None:
    made = lattice((2, 1, 1))
    mesh = made.hexahedra(2, 2, *order)
    pairs = made.periodic_pairs(mesh)
    joined = np.arange(len(mesh.points))
    joined[pairs.second] = pairs.first
    corners = joined[mesh.cells[:, mesh.element.faces[:, :4]]].reshape(-1, 4)
    _, uses = np.unique(np.sort(corners, axis=1), axis=0, return_counts=True)
    # Only the wall's own two faces are left.
    assert np.sum(uses == 1) == 2 * 24 * 2 * 2**2
    assert uses.max() == 2


def test_joined_nodes_number_as_the_euler_characteristic_has_it() -> None:
    # The endless mid-surface has Euler characteristic -8 a cell, and a wall is it times an interval.
    made = lattice()
    mesh = made.hexahedra(3, 1)
    pairs = made.periodic_pairs(mesh)
    quads = 24 * 3**2
    assert (len(mesh.points) - len(pairs)) / 2 - 2 * quads + quads == -8


def test_where_the_wall_varies_along_one_axis_only_pairs_across_the_others_are_left() -> None:
    made = lattice(thickness="0.8 + 0.02*z", tolerance=1e-2)
    pairs = made.periodic_pairs(made.hexahedra(2))
    assert len(pairs)
    # A translation along z may join only walls of the same thickness: none is left but those that stay at one height.
    assert set(pairs.blocks[:, 2].tolist()) == {0}
    assert {tuple(row) for row in pairs.blocks.tolist()} >= {(1, 0, 0), (0, 1, 0)}


def test_a_mapped_ring_has_no_pairs_but_those_in_one_place() -> None:
    made = lattice((6, 1, 1), map=Cylinder(radius=12, angle=360), tolerance=1e-2)
    assert not made.periodic_pairs(made.hexahedra(2)).blocks.any()


def test_pairs_are_grouped_by_their_translation() -> None:
    made = lattice()
    pairs = made.periodic_pairs(made.hexahedra(2))
    groups = pairs.by_translation()
    assert sum(len(first) for first, _ in groups.values()) == len(pairs)
    mesh = hexahedra(made.wall(), 2)
    for blocks, (first, second) in groups.items():
        apart = mesh.points[second] - mesh.points[first]
        np.testing.assert_allclose(apart, np.broadcast_to(np.array(blocks) * SIZE, apart.shape), atol=1e-10)


@pytest.mark.parametrize("size", [0.05, 5e3])
def test_pairs_are_found_whatever_the_lattice_s_scale(size: float) -> None:
    made = Lattice((1, 1, 1), size, 0.1 * size, fit=FitSettings(6))
    mesh = made.hexahedra(2)
    pairs = periodic_pairs(mesh, size)
    assert np.array_equal(np.union1d(pairs.first, pairs.second), mesh.node_sets()[FREE_WALLS])

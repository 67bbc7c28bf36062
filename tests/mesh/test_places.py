"""Numbers of the places of a grid on every patch."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.mesh.nodes import patch_nodes, place_count
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.exact import patch_points_and_normals

sides = st.integers(1, 3)


@given(cells=st.tuples(sides, sides, sides), steps=st.integers(1, 5))
def test_every_number_up_to_the_count_is_used(cells: tuple[int, int, int], steps: int) -> None:
    complex = build_complex(cells)
    numbers = patch_nodes(complex, steps)
    assert np.array_equal(np.unique(numbers), np.arange(place_count(complex, steps)))


@pytest.mark.parametrize("steps", [1, 2, 5])
def test_equal_numbers_stand_at_equal_places(steps: int) -> None:
    complex = build_complex((2, 2, 1))
    numbers = patch_nodes(complex, steps).reshape(complex.patch_count, -1)
    points = patch_points_and_normals(complex, 10.0, np.linspace(-1, 1, steps + 1))[0]
    by_number = np.full((place_count(complex, steps), 3), np.nan)
    by_number[numbers] = points
    np.testing.assert_allclose(by_number[numbers], points, atol=1e-12)


def test_places_coincide_only_where_fans_meet_in_one_corner() -> None:
    complex = build_complex((2, 2, 1))
    steps = 4
    points = np.full((place_count(complex, steps), 3), np.nan)
    points[patch_nodes(complex, steps).reshape(complex.patch_count, -1)] = patch_points_and_normals(
        complex, 10.0, np.linspace(-1, 1, steps + 1)
    )[0]
    distinct = np.unique(np.round(points, 6), axis=0)
    assert len(points) - len(distinct) == complex.fan_count - len(complex.corner_quarters) > 0


def test_some_patches_have_the_numbers_they_have_among_all() -> None:
    complex = build_complex((2, 1, 1))
    assert np.array_equal(patch_nodes(complex, 3, slice(5, 20)), patch_nodes(complex, 3)[5:20])


def test_a_closed_ring_shares_places_across_its_seam() -> None:
    opened, closed = build_complex((3, 1, 1)), build_complex((3, 1, 1), closed=(True, False, False))
    assert place_count(closed, 4) < place_count(opened, 4)

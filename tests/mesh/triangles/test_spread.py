"""Points spread over triangles: near every place, and no more than area and length ask for."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from gyroid_cad.mesh.triangles.spread import spread_points


@pytest.mark.parametrize("thin", [1.0, 1e-2, 1e-6, 0.0])
def test_no_place_of_a_triangle_is_further_from_a_point_than_the_spacing(thin: float) -> None:
    random = np.random.default_rng(3)
    corners = random.normal(size=(60, 3, 3)) * [20.0, 20.0 * thin, thin]
    points, normals = spread_points(corners, spacing=1.0)
    shares = random.dirichlet(np.full(3, 0.5), size=(60, 200))
    places = np.einsum("tnk,tkd->tnd", shares, corners).reshape(-1, 3)
    assert cKDTree(points).query(places)[0].max() <= 1
    assert len(points) == len(normals)


def test_a_thousand_thin_triangles_of_a_disc_give_as_many_points_as_its_area_and_their_lengths_ask_for() -> None:
    turn = np.linspace(0, 2 * np.pi, 1001)
    rim = 50 * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn])
    fan = np.stack([np.tile([50.0, 0, 0], (1000, 1)), rim[:-1], rim[1:]], axis=1)
    points, normals = spread_points(fan, spacing=0.5)
    assert len(points) < 4 * np.pi * 50**2 / 0.5**2 + 2 * 1000 * 100 / 0.5
    assert np.allclose(np.abs(normals[normals.any(axis=1)]), [0, 0, 1])

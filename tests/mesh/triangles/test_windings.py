"""Triangles go once round what is inside, and not at all round what is outside, whatever their angles."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial import ConvexHull

from gyroid_cad.mesh.triangles.distances import SignedDistances, Windings

clouds = arrays(np.float64, (9, 3), elements=st.integers(-1000, 1000).map(lambda k: k / 1000), unique=True)


@given(clouds, st.integers(0, 2**31), st.floats(1e-3, 1.0))
def test_of_convex_hulls_half_spaces_tell_the_same(cloud: np.ndarray, seed: int, flat: float) -> None:
    # Flat ones have acute edges, at which the nearest triangle's normal misleads.
    points = cloud * (1.0, 1.0, flat)
    if np.linalg.matrix_rank(points - points[0], tol=1e-6) < 3:
        return
    hull = ConvexHull(points)
    normals, offsets = hull.equations[:, :3], hull.equations[:, 3]
    a, b, c = points[hull.simplices.T]
    outwards = np.sum(np.cross(b - a, c - a) * normals, axis=1) > 0
    triangles = np.where(outwards[:, np.newaxis], hull.simplices, hull.simplices[:, ::-1]).astype(np.int64)
    asked = np.random.default_rng(seed).uniform(-1.5, 1.5, (400, 3)) * (1.0, 1.0, 2 * flat)
    depth = np.max(asked @ normals.T + offsets, axis=1)
    clear = np.abs(depth) > 1e-9
    assert Windings(points, triangles)(asked[clear]).tolist() == (depth[clear] < 0).astype(int).tolist()
    assert ((SignedDistances(points, triangles)(asked[clear]) < 0) == (depth[clear] < 0)).all()


def test_two_bodies_one_in_the_other_are_gone_round_twice() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    both = np.concatenate([corners, 3 * corners - 0.5])
    nested = np.concatenate([sides, sides + 4])
    points = np.array([[0.1, 0.1, 0.1], [-0.2, -0.2, -0.2], [-0.6, 0.0, 0.0], [9.0, 9.0, 9.0]])
    assert Windings(both, nested)(points).tolist() == [2, 1, 0, 0]
    assert Windings(both, np.concatenate([sides[:, ::-1], sides + 4]))(points).tolist() == [0, 1, 0, 0]
    assert Windings(both, nested)(points[:0]).tolist() == []


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.floats(0.01, 3), st.floats(1e-3, 1))
def test_whether_points_are_near_is_told_of_many_as_of_few(seed: int, reach: float, flat: float) -> None:
    random = np.random.default_rng(seed)
    triangles = random.normal(size=(30, 3, 3)) * [4, 1, flat]
    distances = SignedDistances(triangles.reshape(-1, 3), np.arange(90).reshape(-1, 3))
    points = random.normal(size=(12_000, 3)) * 4
    assert np.array_equal(distances.near(points, reach)[:2000], distances.away(points[:2000]) <= reach)

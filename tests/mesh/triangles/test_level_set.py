"""Surfaces between the inside and the outside of a grid: closed, creases and all, whatever the shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyroid_cad.common.arrays import unit
from gyroid_cad.mesh.triangles.booleans import body_of
from gyroid_cad.mesh.triangles.level_set import Grid, level_surface, told_apart


class Balls:
    """Balls together, their surface known exactly."""

    def __init__(self, centres: Any, radius: float) -> None:
        self.centres, self.radius = np.array(centres), radius

    def __call__(self, points: Any) -> Any:
        return (self.radius - np.linalg.norm(points[:, np.newaxis] - self.centres, axis=2)).max(axis=1)

    def normals(self, points: Any) -> Any:
        nearest = np.linalg.norm(points[:, np.newaxis] - self.centres, axis=2).argmin(axis=1)
        return unit(points - self.centres[nearest])

    def project(self, points: Any) -> Any:
        nearest = np.linalg.norm(points[:, np.newaxis] - self.centres, axis=2).argmin(axis=1)
        return self.centres[nearest] + self.radius * self.normals(points)


class Cube(Balls):
    """The cube from -1 to 1."""

    def __init__(self) -> None:
        super().__init__([[0.0, 0.0, 0.0]], 1.0)

    def __call__(self, points: Any) -> Any:
        return (1 - np.abs(points)).min(axis=1)

    def normals(self, points: Any) -> Any:
        axis = np.abs(points).argmax(axis=1)
        return np.eye(3)[axis] * np.sign(points[np.arange(len(points)), axis])[:, np.newaxis]

    def project(self, points: Any) -> Any:
        return points + self.normals(points) * self(points)[:, np.newaxis]


def surface(shape: Balls, step: float) -> tuple[Any, Any]:
    count = int(3 / step) + 3
    grid = Grid((-1.5, -1.51, -1.52), step, (count, count, count))
    inside = told_apart(shape, grid)
    every = grid.points(np.argwhere(np.ones(grid.shape)))
    assert np.array_equal(inside.ravel(), shape(every) > 0)
    return level_surface(inside, grid, shape, shape.normals, shape.project)


@pytest.mark.parametrize("step", [0.21, 0.107])
def test_the_creases_of_a_cube_are_sharp_and_its_volume_is_exact(step: float) -> None:
    body = body_of(*surface(Cube(), step))
    assert body is not None
    assert body.volume == pytest.approx(8.0, rel=1e-12)


def test_a_ball_is_the_nearer_the_finer_the_grid_by_the_square_of_its_steps() -> None:
    ball = Balls([[0.0, 0.0, 0.0]], 1.0)
    errors = []
    for step in (0.1, 0.05):
        vertices, triangles = surface(ball, step)
        assert np.abs(ball(vertices)).max() < 1e-12
        errors.append(np.abs(ball(vertices[triangles].mean(axis=1))).max())
    assert errors[0] / errors[1] > 3


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-1, 1)] * 3), min_size=1, max_size=12), st.floats(0.1, 0.4))
def test_whatever_balls_make_up_a_shape_its_surface_is_a_closed_manifold(centres: Any, radius: float) -> None:
    vertices, triangles = surface(Balls(centres, radius), 0.11)
    if len(triangles):
        body = body_of(vertices, triangles)
        assert body is not None
        assert body.volume > 0

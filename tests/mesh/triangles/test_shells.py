"""Shells of triangles: solids, voids in them, and what is open."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gyroid_cad.mesh.triangles.measures import TriangleMeasures, triangle_measures


def ball(radius: float, centre: float = 0.0, void: bool = False) -> trimesh.Trimesh:
    made = trimesh.creation.icosphere(2, radius)
    made.apply_translation([centre, 0, 0])
    if void:
        made.invert()
    return made


def of(*parts: trimesh.Trimesh) -> TriangleMeasures:
    mesh = trimesh.util.concatenate(parts)
    return triangle_measures(mesh.vertices, mesh.faces)


def test_a_ball_is_one_closed_piece_of_its_own_volume() -> None:
    shells = of(ball(2.0))
    assert (shells.pieces, shells.trapped_voids, shells.inside_out, shells.open_edges) == (1, 0, 0, 0)
    assert shells.volumes[0] == pytest.approx(ball(2.0).volume)
    assert shells.high - shells.low == pytest.approx(4.0)


def test_a_ball_turned_inwards_inside_another_is_a_trapped_void() -> None:
    shells = of(ball(3.0), ball(1.0, void=True))
    assert (shells.pieces, shells.trapped_voids, shells.inside_out) == (1, 1, 0)
    assert shells.volumes.sum() == pytest.approx(ball(3.0).volume - ball(1.0).volume)


def test_a_ball_loose_in_a_void_is_a_piece_and_the_void_is_still_one() -> None:
    shells = of(ball(4.0), ball(3.0, void=True), ball(1.0))
    assert (shells.pieces, shells.trapped_voids, shells.inside_out) == (2, 1, 0)


def test_a_ball_turned_inwards_beside_another_is_inside_out_not_a_void() -> None:
    shells = of(ball(2.0), ball(1.0, centre=9.0, void=True))
    assert (shells.pieces, shells.trapped_voids, shells.inside_out) == (1, 0, 1)


def test_without_one_triangle_three_edges_are_open() -> None:
    made = ball(1.0)
    assert triangle_measures(made.vertices, made.faces[1:]).open_edges == 3
    assert not triangle_measures(made.vertices, made.faces[1:]).closed


def test_one_triangle_turned_over_opens_its_three_edges() -> None:
    made = ball(1.0)
    faces = np.array(made.faces)
    faces[5] = faces[5, ::-1]
    assert triangle_measures(made.vertices, faces).open_edges == 3


def test_two_cubes_that_touch_in_one_vertex_are_two_pieces() -> None:
    corner = trimesh.creation.box(bounds=[[0, 0, 0], [1, 1, 1]])
    other = trimesh.creation.box(bounds=[[1, 1, 1], [2, 2, 2]])
    both = trimesh.util.concatenate([corner, other])
    both.merge_vertices()
    assert len(both.vertices) == 15
    assert triangle_measures(both.vertices, both.faces).pieces == 2


def test_where_a_solid_stands_changes_neither_volumes_nor_voids() -> None:
    mesh = trimesh.util.concatenate([ball(3.0), ball(1.0, void=True)])
    moved = triangle_measures(mesh.vertices + np.array([1e4, -2e4, 3e3]), mesh.faces)
    assert moved.volumes == pytest.approx(triangle_measures(mesh.vertices, mesh.faces).volumes, rel=1e-6)
    assert moved.trapped_voids == 1

"""Faults of meshes of triangles: none of a sound one, and each kind counted where it was made."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from gyroid_cad.mesh.triangles.faults import crossing_triangles, flat_triangles, triangle_faults

BALL = trimesh.creation.icosphere(2)
KINDS = ("watertight", "manifold", "orientation", "self-intersection")


def counts(vertices: np.ndarray, triangles: np.ndarray) -> dict[str, object]:
    return {name: worst.value for name, worst in triangle_faults(vertices, triangles).items()}


def crossings_of_all_pairs(mesh: trimesh.Trimesh) -> set[tuple[int, int]]:
    """Pairs with nothing in common whose edges pierce each other, edge by edge, by signed volumes."""
    corners = mesh.triangles
    found = set()
    for one, other in zip(*np.triu_indices(len(corners), 1), strict=True):
        if set(mesh.faces[one]) & set(mesh.faces[other]):
            continue
        for a, b in ((corners[one], corners[other]), (corners[other], corners[one])):
            for k in range(3):
                start, end = b[k], b[(k + 1) % 3]
                sides = [np.linalg.det([a[1] - a[0], a[2] - a[0], p - a[0]]) for p in (start, end)]
                turns = [np.linalg.det([a[i] - start, a[(i + 1) % 3] - start, end - start]) for i in range(3)]
                if sides[0] * sides[1] < 0 and (min(turns) > 0 or max(turns) < 0):
                    found.add((int(one), int(other)))
    return found


def test_a_ball_has_no_faults() -> None:
    assert counts(BALL.vertices, BALL.faces) == dict.fromkeys(KINDS, 0)


def test_without_a_triangle_three_edges_are_open_and_the_place_is_a_corner_of_the_hole() -> None:
    faults = triangle_faults(BALL.vertices, BALL.faces[1:])
    assert {name: worst.value for name, worst in faults.items() if worst.value} == {"watertight": 3}
    assert faults["watertight"].place in [tuple(corner) for corner in BALL.triangles[0].tolist()]


def test_a_triangle_turned_over_runs_its_three_edges_the_wrong_way_but_opens_none() -> None:
    turned = np.concatenate([BALL.faces[:1, ::-1], BALL.faces[1:]])
    assert counts(BALL.vertices, turned) == {**dict.fromkeys(KINDS, 0), "orientation": 3}


def test_a_fin_gives_an_edge_a_third_triangle() -> None:
    vertices = np.concatenate([BALL.vertices, [[0, 0, 3.0]]])
    fin = [[*BALL.faces[0, :2], len(BALL.vertices)]]
    found = counts(vertices, np.concatenate([BALL.faces, fin]))
    assert (found["manifold"], found["watertight"]) == (1, 2)


@pytest.mark.parametrize("seed", range(3))
def test_crossing_triangles_are_those_that_looking_at_every_pair_finds(seed: int) -> None:
    away = np.random.default_rng(seed).normal(size=3)
    away /= np.linalg.norm(away)
    ball = trimesh.creation.icosphere(0)
    other = ball.copy()
    other.apply_translation(away)
    both = trimesh.util.concatenate([ball, other])
    pairs, places = crossing_triangles(both.vertices, both.faces, 1e-9)
    assert set(map(tuple, pairs.tolist())) == crossings_of_all_pairs(both)
    assert len(pairs) > 0
    # Places lie on both balls, but for what the chords cut off.
    for centre in (0, away):
        assert np.linalg.norm(places - centre, axis=1) == pytest.approx(0.9, abs=0.11)


def test_sheets_that_only_touch_do_not_cross() -> None:
    box = trimesh.creation.box((1, 1, 1))
    for shift in ((1, 0, 0), (1, 1, 0), (0.5, 1, 0.25)):
        other = box.copy()
        other.apply_translation(shift)
        both = trimesh.util.concatenate([box, other])
        assert len(crossing_triangles(both.vertices, both.faces, 1e-9)[0]) == 0


def test_a_corner_pushed_through_the_other_side_crosses_there() -> None:
    vertices = np.array(BALL.vertices)
    vertices[0] *= -1.5
    faults = triangle_faults(vertices, BALL.faces)
    assert faults["self-intersection"].value > 0
    assert faults["watertight"].value == 0


def test_triangles_without_height_are_flat_and_slender_ones_are_not() -> None:
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-5, 0], [0.5, 1e-9, 0]])
    assert len(flat_triangles(corners, np.array([[0, 1, 2]]))) == 0
    assert len(flat_triangles(corners, np.array([[0, 1, 3]]))) == 1

"""Triangles that files hold: corners apart, closed by coordinates alone, no chips that rounding cuts off."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from gyroid_cad.mesh.triangles.booleans import Body, body_of, united
from gyroid_cad.mesh.triangles.files import renumbered
from gyroid_cad.mesh.triangles.measures import triangle_measures, unmatched_edges
from gyroid_cad.mesh.triangles.storing import TOLD_APART, joined_meshes, storable_triangles, without_chips
from gyroid_cad.mesh.triangles.writing import write_triangles


def box(low: tuple[float, ...], high: tuple[float, ...]) -> Body:
    mesh = trimesh.creation.box(bounds=[low, high])
    body = body_of(mesh.vertices, mesh.faces)
    assert body is not None
    return body


def notched(gap: float) -> Body:
    """Cube of 1 mm in the middle, with a notch at the origin whose corners are a gap apart."""
    cube = box((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5))
    return cube - box((-gap, -gap, 0.0), (gap / 2, gap / 2, 1.0)) - box((-gap / 3, -1.0, -1.0), (gap / 3, 0.0, 0.0))


@pytest.mark.parametrize("gap", [1e-11, 1e-9, 7e-9, 3e-8, 1e-7])
@pytest.mark.parametrize("ending", ["stl", "3mf", "obj", "ply"])
def test_corners_nearer_than_other_programs_tell_apart_are_one_in_every_file(
    gap: float, ending: str, tmp_path: Path
) -> None:
    vertices, triangles = storable_triangles(*notched(gap).triangles())
    one, other = vertices[cKDTree(vertices).query_pairs(1e-6, output_type="ndarray")].swapaxes(0, 1)
    assert np.linalg.norm(one - other, axis=1).min(initial=1.0) >= TOLD_APART
    write_triangles(vertices, triangles, tmp_path / f"a.{ending}")
    read = trimesh.load(tmp_path / f"a.{ending}", force="mesh")
    assert isinstance(read, trimesh.Trimesh)
    assert read.is_watertight
    assert read.volume == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("reach", [1.0, 100.0, 10_000.0])
@pytest.mark.parametrize("single", [True, False])
def test_corners_are_as_far_apart_as_the_numbers_of_a_file_and_round_no_further(reach: float, single: bool) -> None:
    ball = trimesh.creation.icosphere(3, 0.4)
    vertices, triangles = storable_triangles(np.array(ball.vertices) + reach, np.array(ball.faces), single)
    step = max(TOLD_APART, float(np.spacing(np.float32(reach)))) if single else TOLD_APART
    assert np.array_equal(vertices, np.rint(vertices / step) * step)
    assert np.abs(np.sort(vertices, axis=0) - np.sort(ball.vertices + reach, axis=0)).max() <= step / 2
    assert not unmatched_edges(triangles)
    if single:
        assert np.array_equal(vertices, vertices.astype(np.float32))


def test_what_hangs_on_an_edge_that_four_triangles_use_is_parted_and_dropped_as_a_chip() -> None:
    chip, cube = box((0.0, 0.0, 0.0), (0.05, 0.05, 1.0)), box((-1.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    vertices, triangles = joined_meshes([chip.triangles(), cube.triangles()])
    assert unmatched_edges(renumbered(vertices, triangles)[1]) == 1
    stored = storable_triangles(vertices, triangles)
    assert not unmatched_edges(stored[1])
    kept, numbers, solids = without_chips(*stored, shells=1, least=0.01)
    assert solids == 1
    assert triangle_measures(kept, numbers).volume == pytest.approx(1.0)
    assert len(kept) == len(cube.triangles()[0])
    for shells, least in ((2, 0.01), (1, 0.001)):
        assert without_chips(*stored, shells=shells, least=least)[2] == 2


def test_pieces_hold_what_is_round_their_voids_and_not_what_lies_in_these() -> None:
    nested = [box((-size,) * 3, (size,) * 3) for size in (5.0, 4.0, 3.0, 2.0, 1.0)]
    whole = united([nested[0] - nested[1], nested[2] - nested[3], nested[4]])
    assert [piece.volume for piece in whole.pieces()] == pytest.approx([1000 - 512, 216 - 64, 8])
    assert [piece.void_count for piece in whole.pieces()] == [1, 1, 0]


def test_voids_are_filled_that_are_small_and_hold_nothing() -> None:
    cube, *voids = (box((x - size,) * 3, (x + size,) * 3) for x, size in ((0, 9.0), (-5, 1.0), (-5, 0.5), (5, 0.4)))
    whole = united([cube - voids[0] - voids[2], voids[1]])
    assert whole.void_count == 2
    assert whole.without_films(0.1, 100.0).volume == pytest.approx(cube.volume - 8.0 + 1.0)

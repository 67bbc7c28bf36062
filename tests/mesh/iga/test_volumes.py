"""The wall as conforming trivariate patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from volume_cases import CELL_SIZE, KINDS, constant_wall, turned_placements, wall_named

from gyroid_cad import FitSettings, Lattice, ParameterError
from gyroid_cad.mesh.iga.data import BOUNDARY_PARTS, FACE_CORNERS
from gyroid_cad.mesh.iga.patches import VolumePatches, periodic_points, wall_volumes
from gyroid_cad.mesh.nodes import FACE_A, FACE_B, FREE_WALLS, place_count
from gyroid_cad.surface.symmetry import Placements
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import SIDES

Floats = NDArray[np.float64]

ALONG, ACROSS = np.linspace(-1, 1, 5), np.linspace(0, 1, 4)
# Corners of a patch at the ends of u, v and w.
CORNERS = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]


def face_points(volumes: VolumePatches, patch: int, face: int) -> Floats:
    """Points of a face on a grid: along its lower parameter first; w comes last where it is one."""
    axis, end = divmod(face, 2)
    parameters = [ALONG, ALONG, ACROSS]
    parameters[axis] = parameters[axis][[-end]]
    u, v, w = parameters
    points = volumes.patch(patch).evaluate(u[:, np.newaxis, np.newaxis], v[:, np.newaxis], w)
    return np.squeeze(points, axis=axis)


@pytest.mark.parametrize("kind", KINDS)
def test_both_sides_are_the_faces_of_the_wall(kind: str) -> None:
    wall = wall_named(kind)
    volumes = wall_volumes(wall)
    u, v = ALONG[:, np.newaxis], ALONG
    for patch in range(0, len(volumes), 5):
        for side in SIDES:
            face = wall.face(wall.patch_net[patch], side).evaluate(u, v) + wall.shifts[wall.patch_shift[patch]]
            np.testing.assert_allclose(volumes.patch(patch).evaluate(u, v, side), face, atol=1e-12 * CELL_SIZE)


@pytest.mark.parametrize("kind", KINDS)
def test_the_patches_hold_the_volume_of_the_wall_and_nowhere_fold(kind: str) -> None:
    wall = wall_named(kind)
    volumes = wall_volumes(wall)
    chosen = range(0, len(volumes), 7)
    held = sum(volumes.patch(patch).volume() for patch in chosen)
    assert held == pytest.approx(wall.volume(np.array(chosen)), rel=1e-11)
    u, v, w = ALONG[:, np.newaxis, np.newaxis], ALONG[:, np.newaxis], ACROSS
    assert all(np.min(volumes.patch(patch).jacobian_determinant(u, v, w)) > 0 for patch in chosen)


@pytest.mark.parametrize("kind", ["uniform", "rational", "graded"])
def test_degree_three_across_is_the_same_wall_at_the_same_parameters(kind: str) -> None:
    low, high = (wall_volumes(wall_named(kind), degree) for degree in (1, 3))
    assert (low.degrees, high.degrees) == ((3, 3, 1), (3, 3, 3))
    u, v, w = ALONG[:, np.newaxis, np.newaxis], ALONG[:, np.newaxis], ACROSS
    for patch in range(0, len(low), 5):
        for quantity in ("evaluate", "jacobian"):
            first, second = (getattr(volumes.patch(patch), quantity)(u, v, w) for volumes in (low, high))
            np.testing.assert_allclose(first, second, atol=1e-12 * CELL_SIZE)


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_every_control_point_has_one_number_and_every_number_a_control_point(kind: str, degree: int) -> None:
    wall = wall_named(kind)
    volumes = wall_volumes(wall, degree)
    count = (degree + 1) * place_count(wall.complex, len(wall.weights) - 1)
    assert np.array_equal(np.unique(volumes.patch_points), np.arange(count))
    own = wall.nets[wall.patch_net] + wall.shifts[wall.patch_shift][:, np.newaxis, np.newaxis, np.newaxis]
    ends = volumes.control_points[volumes.patch_points[..., [0, -1]]]
    # Neighbours' control points are the same but for rounding.
    np.testing.assert_allclose(ends, np.moveaxis(own, 1, 3), atol=1e-11 * CELL_SIZE)


@pytest.mark.parametrize("kind", KINDS)
def test_the_two_faces_of_an_interface_are_one_surface_run_as_it_says(kind: str) -> None:
    volumes = wall_volumes(wall_named(kind))
    for (patch, face, other, other_face), alike in zip(
        volumes.interfaces.tolist(), volumes.interface_alike.tolist(), strict=True
    ):
        there = face_points(volumes, other, other_face)
        np.testing.assert_allclose(
            face_points(volumes, patch, face), there if alike else there[::-1], atol=1e-11 * CELL_SIZE
        )


def test_parameters_may_meet_either_way() -> None:
    alike = wall_volumes(wall_named("turned")).interface_alike
    assert 0 < np.sum(alike) < len(alike)


@pytest.mark.parametrize("kind", KINDS)
def test_every_face_of_every_patch_is_in_one_interface_or_in_the_boundary(kind: str) -> None:
    wall = wall_named(kind)
    volumes = wall_volumes(wall)
    faces = np.concatenate([volumes.interfaces[:, :2], volumes.interfaces[:, 2:], volumes.boundary[:, :2]])
    assert sorted(map(tuple, faces.tolist())) == [(patch, face) for patch in range(len(volumes)) for face in range(6)]
    part = np.bincount(volumes.boundary[:, 2])
    assert part.tolist() == [len(volumes), len(volumes), np.sum(wall.complex.free)]
    assert np.all(
        volumes.boundary[volumes.boundary[:, 2] < 2, 1] == 4 + volumes.boundary[volumes.boundary[:, 2] < 2, 2]
    )
    assert BOUNDARY_PARTS == (FACE_B, FACE_A, FREE_WALLS)


@pytest.mark.parametrize("kind", KINDS)
def test_opposite_edges_of_every_patch_run_the_same_way_and_belong_to_one_chain(kind: str) -> None:
    volumes = wall_volumes(wall_named(kind))
    direction = {
        tuple(ends): (1, chain) for ends, chain in zip(volumes.edges.tolist(), volumes.edge_chain, strict=True)
    }
    direction |= {(end, start): (-1, chain) for (start, end), (_, chain) in direction.items()}
    parallel = [[(0, 1), (3, 2), (4, 5), (7, 6)], [(0, 3), (1, 2), (4, 7), (5, 6)], [(0, 4), (1, 5), (2, 6), (3, 7)]]
    for vertices in volumes.patch_vertices.tolist():
        for edges in parallel:
            assert len({direction[vertices[a], vertices[b]] for a, b in edges}) == 1


def test_strips_of_the_endless_lattice_close_up_and_one_closed_reversed_is_refused() -> None:
    endless = build_complex((1, 1, 1), closed=(True, True, True))
    wall = replace(constant_wall((1, 1, 1)), complex=endless)
    assert not endless.free.any()
    wall_volumes(wall)
    reversed_once = endless.edge_forward.copy()
    reversed_once[0, 0] ^= True
    with pytest.raises(ValueError, match="a strip of patches closes up reversed"):
        wall_volumes(replace(wall, complex=replace(endless, edge_forward=reversed_once)))


@pytest.mark.parametrize("kind", KINDS)
def test_vertices_stand_at_the_ends_of_u_v_and_w(kind: str) -> None:
    volumes = wall_volumes(wall_named(kind))
    at = np.full((volumes.patch_vertices.max() + 1, 3), np.nan)
    for patch, vertices in enumerate(volumes.patch_vertices):
        corners = volumes.patch(patch).evaluate(*np.array(CORNERS, float).T)
        known = ~np.isnan(at[vertices, 0])
        np.testing.assert_allclose(at[vertices[known]], corners[known], atol=1e-11 * CELL_SIZE)
        at[vertices] = corners
    assert not np.isnan(at).any()


def test_corners_of_faces_go_round_with_the_normal_out_of_the_patch() -> None:
    corners = np.array(CORNERS, float)
    for face, indices in enumerate(FACE_CORNERS):
        quad = corners[indices]
        normal = np.cross(quad[1] - quad[0], quad[3] - quad[0])
        axis, end = divmod(face, 2)
        assert np.flatnonzero(normal).tolist() == [axis]
        assert np.sign(normal[axis]) == 2 * end - 1
        assert len(np.unique(quad[:, axis])) == 1


@pytest.mark.parametrize("placements", [None, turned_placements()], ids=["as laid", "turned"])
@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 3)])
def test_in_the_endless_lattice_equal_numbers_are_whole_blocks_apart(
    cells: tuple[int, int, int], placements: Placements | None
) -> None:
    wall = constant_wall(cells, placements)
    volumes = wall_volumes(wall, 3)
    numbers = periodic_points(wall, volumes)
    # 16 corners, 48 edges and 24 patches in each cell: the Euler characteristic is -8.
    expected = 4 * np.prod(cells) * (16 + 48 * 3 + 24 * 3**2)
    assert np.array_equal(np.unique(numbers), np.arange(expected))
    first = np.empty((expected, 3))
    first[numbers] = volumes.control_points
    apart = (volumes.control_points - first[numbers]) / (CELL_SIZE * np.array(cells))
    np.testing.assert_allclose(apart, np.rint(apart), atol=1e-11)
    assert np.any(np.rint(apart))


def test_a_wall_that_reaches_beyond_its_cells_has_no_ends_to_join() -> None:
    wall = Lattice((1, 1, 1), CELL_SIZE, 0.8, fit=FitSettings(5), trim="box").wall()
    with pytest.raises(ParameterError, match=r"wall = .* patches.*: expected a block of whole cells"):
        periodic_points(wall, wall_volumes(wall))


@pytest.mark.parametrize("degree", [0, 2, 4, -1, True, 1.0, "3", None])
def test_a_degree_that_is_neither_one_nor_three_is_refused(degree: object) -> None:
    with pytest.raises(ParameterError, match=r"degree = .*: expected 1 or 3, across the wall"):
        wall_volumes(wall_named("uniform"), degree)  # type: ignore[arg-type]

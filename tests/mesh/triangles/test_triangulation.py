"""Triangles of the wall: closed, oriented, as near as asked for, of the right volume."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import manifold3d
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.makers import linear
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.measuring import face_cases, face_deviations, triangulated_volume
from gyroid_cad.mesh.triangles.triangulation import MOST_STEPS, Triangulation, subdivided, triangulated
from gyroid_cad.nurbs.surface import NurbsSurface
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.offset import SIDES, Wall

Floats = NDArray[np.float64]

L = 10.0
COARSE = FitSettings(5)


def graded() -> Lattice:
    """Walls so different that patches take different steps."""
    return Lattice((2, 1, 1), L, linear(0.5, x=0.12), fit=COARSE, tolerance=1e-2)


def ring() -> Lattice:
    return Lattice((8, 1, 1), L, 0.8, map="cylinder:radius=16,angle=360", fit=COARSE, tolerance=1e-2)


def grown() -> Lattice:
    return Lattice((2, 1, 1), L, 0.6, scale_field="1 + 0.05*x", fit=COARSE, tolerance=1e-2)


def assert_closed(triangulation: Triangulation) -> trimesh.Trimesh:
    """Two independent judges: manifold3d on the numbers, trimesh on the coordinates alone."""
    complex = triangulation.wall.complex
    vertices, triangles = indexed_triangles(triangulation)
    assert len(triangles) == triangulation.triangle_count
    euler = 2 * (complex.fan_count - complex.edge_count + complex.patch_count)
    judged = manifold3d.Manifold(manifold3d.Mesh(vertices, triangles.astype(np.uint32)))
    assert judged.status() == manifold3d.Error.NoError
    assert 2 - 2 * judged.genus() == euler
    by_coordinates = trimesh.Trimesh(vertices, triangles, process=True)
    assert len(by_coordinates.vertices) == len(vertices)
    assert by_coordinates.is_watertight
    assert by_coordinates.is_winding_consistent
    assert by_coordinates.euler_number == euler
    assert by_coordinates.volume > 0
    return by_coordinates


@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 2, 1), (2, 2, 2)])
def test_the_triangles_are_closed_though_the_wall_touches_itself_in_lines(cells: tuple[int, int, int]) -> None:
    triangulation = triangulated(Lattice(cells, L, 0.8, fit=COARSE).wall(), 0.1)
    assert triangulation.wall.complex.non_manifold_edges > 0
    assert assert_closed(triangulation).body_count == 1


@pytest.mark.parametrize("thickness", [0.01, 3.7])
@pytest.mark.parametrize("deviation", [0.5, 0.05])
def test_the_thinnest_and_the_thickest_walls_are_closed(thickness: float, deviation: float) -> None:
    assert_closed(triangulated(Lattice((2, 1, 1), L, thickness, fit=COARSE).wall(), deviation))


def test_patches_with_different_steps_share_the_places_on_their_edges() -> None:
    triangulation = triangulated(graded().wall(), 0.05)
    edges = triangulation.wall.complex.edge_patches
    first, second = triangulation.patch_steps[edges[edges[:, 1] >= 0]].T
    assert np.any(first != second)
    assert np.all(triangulation.edge_steps[edges[:, 1] >= 0] == np.maximum(first, second))
    assert_closed(triangulation)


@pytest.mark.parametrize("lattice", [ring(), grown()], ids=["closed ring", "growing cells"])
def test_lattices_carried_elsewhere_are_closed_too(lattice: Lattice) -> None:
    assert_closed(triangulated(lattice.wall(), 0.05))


sides = st.integers(1, 2)


@settings(max_examples=20)
@given(
    cells=st.tuples(sides, sides, sides),
    thickness=st.floats(0.02, 0.3),
    slope=st.sampled_from([0.0, 0.01, 0.02]),
    deviation=st.floats(0.004, 0.05),
    size=st.sampled_from([0.01, 1.0, 1e4]),
)
def test_whatever_the_lattice_its_triangles_are_closed_and_near(
    cells: tuple[int, int, int], thickness: float, slope: float, deviation: float, size: float
) -> None:
    wall: Any = linear(thickness * size, x=slope) if slope else thickness * size
    lattice = Lattice(cells, size, wall, fit=COARSE, tolerance=1e-2 if slope else None)
    triangulation = triangulated(lattice.wall(), deviation * size)
    assert triangulation.deviation <= deviation * size
    assert triangulation.volume == pytest.approx(lattice.wall().volume(), rel=1e-3)
    assert assert_closed(triangulation).volume == pytest.approx(triangulation.volume, rel=1e-4)


def distances_to_wall(wall: Wall, points: Floats, neighbours: int = 6) -> Floats:
    """From points to the nearest place on faces and side walls: Newton's method from the nearest of many samples."""
    complex = wall.complex
    placed = [(wall.face(int(wall.patch_net[p]), side), int(p)) for p in range(complex.patch_count) for side in SIDES]
    for edge in np.flatnonzero(complex.free).tolist():
        p = int(complex.edge_patches[edge, 0])
        side_wall = wall.side_wall(int(wall.patch_net[p]), int(np.argmax(complex.patch_edges[p] == edge)))
        placed.append((side_wall, p))
    shifts = wall.shifts[wall.patch_shift]
    at = np.linspace(0, 1, 17)
    samples = np.array([surface.evaluate(*spread(surface, at[:, None], at[None])) + shifts[p] for surface, p in placed])
    nearest = cKDTree(samples.reshape(-1, 3)).query(points, k=neighbours)[1]
    which, places = np.divmod(nearest, at.size**2)
    best = np.full(len(points), np.inf)
    for k in range(neighbours):
        for number in np.unique(which[:, k]).tolist():
            some = which[:, k] == number
            surface, p = placed[number]
            u, v = spread(surface, at[places[some, k] // at.size], at[places[some, k] % at.size])
            best[some] = np.minimum(best[some], projected(surface, points[some] - shifts[p], u, v))
    return best


def spread(surface: NurbsSurface, u: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Parameters in [0, 1] over the surface's own domain."""
    return tuple(k[0] + (k[-1] - k[0]) * x for k, x in ((surface.knots_u, u), (surface.knots_v, v)))  # type: ignore[return-value]


def projected(surface: NurbsSurface, points: Floats, u: Floats, v: Floats) -> Floats:
    """Distances to the surface's nearest places, by Gauss-Newton steps kept in its domain."""
    for _ in range(8):
        d = surface.derivatives(u, v)
        jacobian = np.stack([d[1, 0], d[0, 1]], axis=-1)
        step = np.linalg.solve(
            jacobian.transpose(0, 2, 1) @ jacobian, jacobian.transpose(0, 2, 1) @ (points - d[0, 0])[..., None]
        )[..., 0]
        u = np.clip(u + step[:, 0], surface.knots_u[0], surface.knots_u[-1])
        v = np.clip(v + step[:, 1], surface.knots_v[0], surface.knots_v[-1])
    return np.asarray(np.linalg.norm(surface.evaluate(u, v) - points, axis=-1))


def random_points(triangulation: Triangulation, count: int) -> Floats:
    """Points of the triangles, evenly by triangle."""
    vertices, triangles = indexed_triangles(triangulation)
    random = np.random.default_rng(6)
    chosen = vertices.astype(float)[triangles[random.integers(0, len(triangles), count)]]
    return np.asarray(np.einsum("pk,pkc->pc", random.dirichlet(np.ones(3), count), chosen))


@pytest.mark.parametrize(
    ("lattice", "deviation"),
    [
        (Lattice((1, 1, 1), L, 0.8), 0.05),
        (Lattice((1, 1, 1), L, 0.8), 0.01),
        (Lattice((1, 1, 1), L, 3.0), 0.05),
        (graded(), 0.05),
        (grown(), 0.1),
    ],
    ids=["usual", "fine", "thick", "graded", "growing cells"],
)
def test_no_point_of_a_triangle_is_further_from_the_wall_than_asked_for(lattice: Lattice, deviation: float) -> None:
    triangulation = triangulated(lattice.wall(), deviation)
    distances = distances_to_wall(lattice.wall(), random_points(triangulation, 600))
    assert np.max(distances) <= triangulation.deviation <= deviation
    # Nor are there more triangles than it takes: somewhere they are about as far off as they may be.
    assert np.max(distances) > deviation / 3


def test_no_place_of_the_faces_is_far_from_a_triangle() -> None:
    lattice, deviation = Lattice((1, 1, 1), L, 0.8), 0.05
    wall, along = lattice.wall(), np.linspace(-1, 1, 7)
    points = np.concatenate(
        [
            wall.face(net, side).evaluate(along[:, None], along[None]).reshape(-1, 3)
            for net in range(24)
            for side in SIDES
        ]
    )
    vertices, triangles = indexed_triangles(triangulated(wall, deviation))
    corners = vertices.astype(float)[triangles]
    nearest = cKDTree(corners.mean(axis=1)).query(points, k=40)[1]
    closest = [trimesh.triangles.closest_point(corners[some], points) for some in nearest.T]
    assert np.min(np.linalg.norm(np.array(closest) - points, axis=-1), axis=0).max() <= deviation


def test_one_step_less_would_be_too_few() -> None:
    wall = Lattice((1, 1, 1), L, 0.8).wall()
    for deviation in (0.05, 0.01):
        steps = subdivided(wall, deviation)
        (count,) = np.unique(steps.patch_steps)
        fewer = np.array([[*[count - 1] * 5, net] for net in range(24)])
        assert steps.deviation <= deviation < 1.06 * face_deviations(wall, fewer).max()


def test_the_deviation_and_the_missing_volume_fall_with_the_square_of_the_steps() -> None:
    """Of triangles with their corners on the faces, before they are offset."""
    wall = Lattice((1, 1, 1), L, 0.8).wall()
    counts = np.array([16, 32, 64])
    missing, deviation = [], []
    for count in counts.tolist():
        steps = np.full(wall.complex.patch_count, count), np.full(wall.complex.edge_count, count)
        missing.append(1 - triangulated_volume(wall, *steps, across=count // 4) / wall.volume())
        deviation.append(face_deviations(wall, face_cases(wall, *steps)[0][:4]).max())
    for error in (missing, deviation):
        assert np.polyfit(np.log(counts), np.log(error), 1)[0] == pytest.approx(-2, abs=0.1)


def test_what_corners_are_laid_off_falls_with_the_deviation_and_makes_up_the_volume() -> None:
    wall = Lattice((1, 1, 1), L, 0.8).wall()
    deviations = np.array([0.1, 0.02, 0.004])
    made = [triangulated(wall, deviation) for deviation in deviations.tolist()]
    volume_offset = [triangulation.volume_offset for triangulation in made]
    assert np.polyfit(np.log(deviations), np.log(volume_offset), 1)[0] == pytest.approx(1, abs=0.15)
    for triangulation, deviation in zip(made, deviations, strict=True):
        assert triangulation.volume_offset < 0.1 * deviation
        assert triangulation.volume == pytest.approx(wall.volume(), rel=1e-6)
        assert assert_closed(triangulation).volume == pytest.approx(wall.volume(), rel=1e-5)


def test_the_volume_of_the_plan_is_that_of_the_triangles_made() -> None:
    for lattice in (graded(), ring()):
        triangulation = triangulated(lattice.wall(), 0.05)
        assert assert_closed(triangulation).volume == pytest.approx(triangulation.volume, rel=1e-6)


def test_patches_that_touch_in_a_line_are_parted_by_less_than_anyone_can_print() -> None:
    triangulation = triangulated(Lattice((2, 2, 1), L, 0.8, fit=COARSE).wall(), 0.05)
    together = replace(triangulation, parting=0.0)
    apart, touching = (indexed_triangles(made)[0] for made in (triangulation, together))
    moved = np.linalg.norm(apart.astype(float) - touching, axis=1)
    assert 0 < moved.max() < 0.05 / 500
    pinched = len(touching) - len(np.unique(touching, axis=0))
    complex = triangulation.wall.complex
    assert pinched == (complex.fan_count - len(complex.corner_quarters)) * (triangulation.across + 1) > 0
    assert len(np.unique(apart, axis=0)) == len(apart)


def test_a_deviation_that_takes_too_many_squares_is_refused_with_one_that_would_do() -> None:
    wall = Lattice((1, 1, 1), L, 0.8).wall()
    with pytest.raises(
        ParameterError, match=rf"deviation = 1e-07: .*{MOST_STEPS} x {MOST_STEPS} are the most"
    ) as caught:
        triangulated(wall, 1e-7)
    (possible,) = re.findall(r"about ([\d.e-]+) mm or more", str(caught.value))
    assert triangulated(wall, float(possible)).deviation <= float(possible)


def test_rational_nets_are_measured_as_rational() -> None:
    paper = FitSettings.paper()
    rational = Lattice((1, 1, 1), L, 0.8, fit=FitSettings(paper.control_points, paper.knots, paper.weights))
    triangulation = triangulated(rational.wall(), 0.05)
    assert np.ptp(rational.wall().weights) > 0
    distances = distances_to_wall(rational.wall(), random_points(triangulation, 400))
    assert np.max(distances) <= 0.05
    assert_closed(triangulation)

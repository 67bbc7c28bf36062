"""Areas of the wall's surfaces, against the tube formula and the kernel."""

from __future__ import annotations

import numpy as np
import pytest

from gyroid_cad.kernel.part import measure
from gyroid_cad.lattice import Lattice
from gyroid_cad.wall.areas import distinct_patches, exact_areas, fitted_areas


@pytest.mark.parametrize("surface", ["gyroid", "diamond", "primitive"])
def test_areas_of_the_faces_are_the_tube_formula_s(surface: str) -> None:
    lattice = Lattice((2, 1, 1), 10.0, 1.2, surface=surface)
    fitted = lattice.fitted()
    expected = 2 * 100 * lattice.minimal_surface.tube.face_area(0.12)
    exact = exact_areas(fitted.complex, fitted.spec.grading, *distinct_patches(fitted.wall))
    areas = fitted_areas(fitted.wall)
    assert exact.face_a == pytest.approx(expected, rel=1e-7)
    assert exact.face_b == pytest.approx(expected, rel=1e-7)
    assert areas.face_a == pytest.approx(expected, rel=1e-6)
    assert areas.face_b == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "lattice",
    [
        Lattice((1, 1, 1), 10.0, 0.8),
        Lattice((2, 1, 1), 10.0, "0.8 + 0.02*x"),
    ],
    ids=["uniform", "graded"],
)
def test_faces_and_rim_are_all_of_the_solid_s_area(lattice: Lattice) -> None:
    # The kernel's own integral of the area of its solid.
    assert fitted_areas(lattice.wall()).total == pytest.approx(measure(lattice.solid())[1], rel=1e-4)


def test_the_rim_is_the_sum_of_the_side_walls_areas() -> None:
    wall = Lattice((1, 1, 1), 10.0, 2.5).wall()
    patches, edges = np.nonzero(wall.complex.free[wall.complex.patch_edges])
    areas = []
    for net, edge in zip(wall.patch_net[patches].tolist(), edges.tolist(), strict=True):
        u, v, weights = wall.side_wall(net, edge).quadrature()
        d = wall.side_wall(net, edge).derivatives(u, v)
        areas.append(np.sum(weights * np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1)))
    assert fitted_areas(wall).rim == pytest.approx(sum(areas), rel=1e-7)

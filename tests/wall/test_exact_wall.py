"""The exact wall of a graded lattice: its volume, area and mean thickness, and the block's volume."""

from __future__ import annotations

from math import pi, radians, sin
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyroid_cad.errors import SelfIntersectionError
from gyroid_cad.fields.field import Field, as_field
from gyroid_cad.maps.block import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.space import SpaceMap
from gyroid_cad.surface.families import USUAL
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.exact import (
    ExactMeasures,
    block_volume,
    differentiation_matrix,
    exact_measures,
    offset_patches,
    sampled_point,
)
from gyroid_cad.wall.grading import Grading

TUBE = USUAL.tube

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]

L = 10.0
SIZE = (L, L, L)
CELL = build_complex((1, 1, 1))
ANGLES = st.tuples(*3 * [st.floats(-180, 180)])
# What 16 Gauss points along each side of a patch leave of its area.
QUADRATURE = 1e-8


def field(text: str) -> Field:
    made = as_field("thickness", text, "")
    assert isinstance(made, Field)
    return made


def affine(matrix: Any, shift: Any = (0, 0, 0)) -> SpaceMap:
    turn = np.array(matrix, dtype=float)

    def function(x: Floats, y: Floats, z: Floats) -> Floats:
        return turn @ np.stack([x, y, z]) + np.array(shift)[:, np.newaxis]

    return SpaceMap(function, lambda x, y, z: turn.tolist())


def of(thickness: Any = None, cells: Cells = (1, 1, 1), **varied: Any) -> ExactMeasures:
    return exact_measures(build_complex(cells), Grading(L, thickness, **varied))


@settings(max_examples=20)
@given(st.floats(1e-3, 0.37))
def test_a_uniform_wall_has_the_volume_of_the_tube_formula(relative_thickness: float) -> None:
    measures = of(relative_thickness * L)
    assert measures.volume == pytest.approx(TUBE.density(relative_thickness) * L**3, rel=QUADRATURE)
    assert measures.area == pytest.approx(TUBE.area * L**2, rel=QUADRATURE)
    assert measures.mean_thickness == pytest.approx(relative_thickness * L, rel=1e-14)


@settings(max_examples=20)
@given(st.floats(1e-3, 0.94))
def test_a_uniform_density_is_met(density: float) -> None:
    assert of(density=density).volume == pytest.approx(density * L**3, rel=QUADRATURE)


@pytest.mark.parametrize("cells", [(2, 1, 1), (1, 2, 3)])
def test_measures_go_with_the_number_of_cells(cells: Cells) -> None:
    one, many, count = of(0.8), of(0.8, cells), np.prod(cells)
    assert many.volume == pytest.approx(count * one.volume, rel=1e-12)
    assert many.area == pytest.approx(count * one.area, rel=1e-12)


def test_a_varying_block_measures_as_its_cells_do_one_by_one() -> None:
    both = of(field("0.8 + 0.03*x - 0.01*y*z/10"), (2, 1, 1))
    first = of(field("0.8 + 0.03*x - 0.01*y*z/10"))
    second = of(field("0.8 + 0.03*(x + 10) - 0.01*y*z/10"))
    assert both.volume == pytest.approx(first.volume + second.volume, rel=1e-12)
    assert both.mean_thickness == pytest.approx((first.mean_thickness + second.mean_thickness) / 2, rel=1e-12)


@pytest.mark.parametrize("axis", "xyz")
def test_a_slope_about_the_middle_takes_volume_by_its_square(axis: str) -> None:
    # H = 0: V = int t + K t^3 / 12 dA; with t = t0 + a (x - c) every odd power of a cancels.
    even = of(0.8)
    up, down, twice = (of(field(f"0.8 + {a}*({axis} - 5)")) for a in (0.05, -0.05, 0.1))
    for measures in (up, down, twice):
        assert measures.mean_thickness == pytest.approx(0.8, rel=1e-13)
        assert measures.area == even.area
    assert up.volume == pytest.approx(down.volume, rel=1e-11)
    assert even.volume > up.volume
    assert twice.volume - even.volume == pytest.approx(4 * (up.volume - even.volume), rel=1e-7)


def test_three_slopes_take_volume_by_the_moment_of_the_curvature() -> None:
    # Over the axes, int K (x - c)^2 dA adds up to int K |p - c|^2 dA, whichever way they are turned; third moments
    # cancel between a slope and its reverse.
    turn = Rotation.from_euler("xyz", [20, -35, 50], degrees=True).as_matrix()

    def taken(directions: Floats) -> float:
        slopes = [field(f"0.8 + 0.05*({a}*(x-5) + {b}*(y-5) + {c}*(z-5))") for a, b, c in directions.tolist()]
        return sum(of(slope).volume - of(0.8).volume for slope in slopes)

    assert taken(np.concatenate([turn, -turn])) == pytest.approx(2 * taken(np.eye(3)), rel=1e-6)


def test_curvature_takes_the_same_volume_from_a_wall_twice_as_thick_eight_times() -> None:
    def taken(thickness: float) -> float:
        return of(thickness).volume - thickness * of(thickness).area

    assert taken(1.0) == pytest.approx(2 * pi * TUBE.euler_characteristic / 12, rel=1e-7)
    assert taken(2.0) == pytest.approx(8 * taken(1.0), rel=1e-9)


@settings(max_examples=10)
@given(ANGLES, st.tuples(*3 * [st.floats(-1e3, 1e3)]))
def test_rigid_motions_change_no_measure(angles: Any, shift: Any) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    wall = field("0.8 + 0.05*x")
    still, moved = of(wall), of(wall, map=affine(turn, shift))
    assert moved.volume == pytest.approx(still.volume, rel=1e-10)
    assert moved.area == pytest.approx(still.area, rel=1e-10)
    assert moved.mean_thickness == pytest.approx(still.mean_thickness, rel=1e-12)


@settings(max_examples=10)
@given(st.floats(0.05, 20))
def test_similar_walls_measure_as_the_powers_of_their_scale(scale: float) -> None:
    plain = of(field("0.8 + 0.05*x"))
    for varied in ({"map": affine(scale * np.eye(3))}, {"scale_field": scale}):
        scaled = of(field(f"{scale!r}*(0.8 + 0.05*x)"), **varied)
        assert scaled.volume == pytest.approx(scale**3 * plain.volume, rel=1e-11)
        assert scaled.area == pytest.approx(scale**2 * plain.area, rel=1e-11)
        assert scaled.mean_thickness == pytest.approx(scale * plain.mean_thickness, rel=1e-12)


@settings(max_examples=20)
@given(arrays(float, (3, 3), elements=st.floats(-0.3, 0.3)))
def test_affine_maps_scale_the_blocks_volume_by_their_determinant(off: Floats) -> None:
    matrix = np.eye(3) + off
    expected = np.linalg.det(matrix) * 2 * L**3
    assert block_volume((2, 1, 1), Grading(L, 0.5, map=affine(matrix))) == pytest.approx(expected, rel=1e-12)


@settings(max_examples=20)
@given(st.floats(5, 500), st.floats(1, 360))
def test_a_block_on_a_cylinder_is_a_sector_of_an_annulus(radius: float, angle: float) -> None:
    grading = Grading(L, 0.5, map=Cylinder(radius, angle).over((3 * L, L, 2 * L)))
    expected = radians(angle) / 2 * ((radius + 2 * L) ** 2 - radius**2) * L
    assert block_volume((3, 1, 2), grading) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("angle", [30, 360])
def test_a_block_on_a_sphere_is_a_sector_of_a_shell(angle: float) -> None:
    radius = 25.0
    grading = Grading(L, 0.5, map=Sphere(radius, angle).over((L, 3 * L, L)))
    expected = radians(angle) * 2 * sin(1.5 * L / radius) * ((radius + L) ** 3 - radius**3) / 3
    assert block_volume((1, 3, 1), grading) == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("block_map", [Twist(500), Twist(-30), Bend(60), Bend(-120)], ids=str)
def test_a_twist_and_a_bend_keep_the_blocks_volume(block_map: Twist | Bend) -> None:
    grading = Grading(L, 0.5, map=block_map.over((4 * L, L, L)))
    assert block_volume((4, 1, 1), grading) == pytest.approx(4 * L**3, rel=1e-12)


def test_a_scale_that_varies_scales_the_blocks_volume_by_its_own_determinant() -> None:
    # det (s I + p grad s^T) = s^2 (s + p . grad s); for s = 1 + a x that is (1 + a x)^2 (1 + 2 a x).
    x = np.polynomial.Polynomial([0, 1])
    integral = ((1 + 0.05 * x) ** 2 * (1 + 0.1 * x)).integ()
    grading = Grading(L, 0.5, scale_field=field("1 + 0.05*x"))
    assert block_volume((2, 1, 1), grading) == pytest.approx((integral(2 * L) - integral(0)) * L**2, rel=1e-8)


def test_a_block_that_folds_has_no_volume() -> None:
    with pytest.raises(SelfIntersectionError, match="inside out"):
        block_volume((1, 1, 1), Grading(L, 0.5, map=Bend(300).over(SIZE)))


@settings(max_examples=30)
@given(st.integers(2, 16), arrays(float, 16, elements=st.floats(-1, 1)))
def test_polynomials_are_differentiated_exactly(count: int, coefficients: Floats) -> None:
    nodes = np.polynomial.legendre.leggauss(count)[0]
    polynomial = np.polynomial.Chebyshev(coefficients[:count])
    taken = differentiation_matrix(nodes) @ polynomial(nodes)
    np.testing.assert_allclose(taken, polynomial.deriv()(nodes), rtol=0, atol=1e-11 * count**2)


@pytest.mark.parametrize("patches", [None, np.array([70, 3, 3, 55])])
def test_patches_are_laid_in_order_whichever_are_asked_for(patches: NDArray[np.int64] | None) -> None:
    complex, grading, samples = build_complex((3, 1, 1)), Grading(L, field("1 + 0.1*x")), np.array([-1, 0.2, 1])
    parts = list(offset_patches(complex, grading, samples, patches))
    numbers = np.arange(complex.patch_count) if patches is None else patches
    covered = np.concatenate([np.arange(len(numbers))[some] for some, _ in parts])
    np.testing.assert_array_equal(covered, np.arange(len(numbers)))
    points = np.concatenate([part.points for _, part in parts]).reshape(len(numbers), -1, 3)
    for row, patch in zip(points, numbers.tolist(), strict=True):
        places = [sampled_point(complex, L, samples, patch, index) for index in range(9)]
        np.testing.assert_allclose(row, places, rtol=0, atol=1e-13 * L)


def corners(complex: CellComplex, grading: Grading) -> tuple[Floats, Floats]:
    """Points and normals at the patches' corners, in their order round each; shape (patches, 4, 3)."""
    parts = [part for _, part in offset_patches(complex, grading, np.array([-1.0, 1]))]
    points, normals = (np.concatenate([getattr(p, name) for p in parts]) for name in ("points", "normals"))
    return points.reshape(-1, 4, 3)[:, [0, 2, 3, 1]], normals.reshape(-1, 4, 3)[:, [0, 2, 3, 1]]


@pytest.mark.parametrize("space", [None, Cylinder(12, 360).over((2 * L, L, L))], ids=["flat", "closed"])
def test_patches_that_share_a_corner_share_its_place_and_its_normal(space: SpaceMap | None) -> None:
    grading = Grading(L, 0.8, map=space)
    complex = build_complex((2, 1, 1), closed=grading.closed)
    for values in corners(complex, grading):
        mean = np.zeros((len(complex.corner_quarters), 3))
        np.add.at(mean, complex.patch_corners, values)
        mean /= np.bincount(complex.patch_corners.ravel())[:, np.newaxis]
        np.testing.assert_allclose(values, mean[complex.patch_corners], rtol=0, atol=1e-12 * L)

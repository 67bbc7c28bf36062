"""B-spline bases, rational curves and surfaces."""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.basis import basis, gauss_points, uniform_knots
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface, edge_row, grid_derivatives
from gyroid_cad.surface.fit import FitSettings

Floats = NDArray[np.float64]

ROOT_HALF = sqrt(1 / 2)
ARC_KNOTS = np.array([0.0, 0, 0, 1, 1, 1])
LINE_KNOTS = np.array([0.0, 0, 1, 1])
QUARTER_ARC = np.array([[1.0, 0], [1, 1], [0, 1]])
ARC_WEIGHTS = np.array([1, ROOT_HALF, 1])


@st.composite
def knot_vectors(draw: st.DrawFn, degree: int = 3) -> Floats:
    """Clamped on [-1, 1]; inner knots may be repeated up to ``degree`` times."""
    places = draw(st.lists(st.integers(-9, 9), unique=True, max_size=5))
    inner = np.repeat(np.sort(places) / 10, [draw(st.integers(1, degree)) for _ in places])
    return np.concatenate([np.full(degree + 1, -1.0), inner, np.full(degree + 1, 1.0)])


def paper_surface() -> NurbsSurface:
    """The paper's knots and weights over an uneven net."""
    paper = FitSettings.paper()
    net = np.random.default_rng(1).normal(size=(10, 10, 3))
    return NurbsSurface(net, paper.weight_net(), paper.knot_vector(), paper.knot_vector())


def uneven_surface() -> NurbsSurface:
    """Different sizes, degrees, domains and asymmetric knots along u and v."""
    rng = np.random.default_rng(2)
    knots_u = np.array([-1.0, -1, -1, -1, -0.7, 0.6, 1, 1, 1, 1])
    knots_v = np.array([0.0, 0, 0, 0.4, 3, 3, 3])
    return NurbsSurface(rng.normal(size=(6, 4, 3)), rng.uniform(0.5, 2, (6, 4)), knots_u, knots_v)


def cylinder(radius: float) -> NurbsSurface:
    """A quarter of a cylinder about z, u round it and v along it: du x dv points outwards."""
    arc = np.column_stack([radius * QUARTER_ARC, np.zeros(3)])
    net = np.stack([arc, arc + np.array([0, 0, 2.0])], axis=1)
    return NurbsSurface(net, np.column_stack([ARC_WEIGHTS] * 2), ARC_KNOTS, LINE_KNOTS)


def sphere_octant(radius: float) -> NurbsSurface:
    """A quarter arc in the meridian plane (v) turned about z (u): du x dv points outwards."""
    net = np.array([[[x * r, y * r, z] for r, z in radius * QUARTER_ARC] for x, y in QUARTER_ARC])
    return NurbsSurface(net, np.outer(ARC_WEIGHTS, ARC_WEIGHTS), ARC_KNOTS, ARC_KNOTS)


@settings(max_examples=50, deadline=None)
@given(knot_vectors(), st.integers(0, 2))
def test_basis_and_its_derivatives_are_those_of_scipy(knots: Floats, derivative: int) -> None:
    x = np.linspace(-0.987, 0.987, 41)
    reference = BSpline(knots, np.eye(len(knots) - 4), 3)(x, nu=derivative)
    scale = max(1.0, np.abs(reference).max())
    np.testing.assert_allclose(basis(knots, 3, x, derivative), reference, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_derivatives_beyond_the_degree_vanish(degree: int) -> None:
    x = np.linspace(-0.9, 0.9, 7)
    np.testing.assert_array_equal(basis(uniform_knots(7, degree), degree, x, degree + 1), np.zeros((7, 7)))


@settings(max_examples=50, deadline=None)
@given(knot_vectors(), arrays(float, 5, elements=st.floats(-1, 1)))
def test_basis_is_a_partition_of_unity_by_non_negative_functions(knots: Floats, x: Floats) -> None:
    functions = basis(knots, 3, x)
    assert functions.min() >= 0
    np.testing.assert_allclose(functions.sum(axis=1), 1, rtol=0, atol=1e-14)
    np.testing.assert_allclose(basis(knots, 3, x, 1).sum(axis=1), 0, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(knot_vectors())
def test_first_and_last_basis_function_are_one_at_the_ends(knots: Floats) -> None:
    np.testing.assert_allclose(basis(knots, 3, [-1, 1])[:, [0, -1]], np.eye(2), rtol=0, atol=1e-14)


@settings(max_examples=25, deadline=None)
@given(knot_vectors())
def test_two_gauss_points_a_span_integrate_cubic_basis_functions_exactly(knots: Floats) -> None:
    points, weights = gauss_points(knots, 2)
    np.testing.assert_allclose(weights @ basis(knots, 3, points), (knots[4:] - knots[:-4]) / 4, rtol=0, atol=1e-14)


@pytest.mark.parametrize("per_span", [1, 3, 5])
def test_gauss_points_are_exact_up_to_degree_2n_minus_1_and_no_further(per_span: int) -> None:
    points, weights = gauss_points(np.array([0.0, 0, 0.3, 1, 1]), per_span)
    errors = [abs(weights @ points**k - 1 / (k + 1)) for k in range(2 * per_span + 1)]
    assert max(errors[:-1]) < 1e-15
    assert errors[-1] > 1e-9


@pytest.mark.parametrize("rational", [False, True])
def test_quadrature_integrates_the_flux_through_a_surface_to_rounding(rational: bool) -> None:
    rng, knots = np.random.default_rng(4), FitSettings.paper().knot_vector()
    weights = FitSettings.paper().weight_net() if rational else np.ones((10, 10))
    surface = NurbsSurface(rng.normal(size=(10, 10, 3)), weights, knots, knots)
    fine, fine_weights = gauss_points(knots, 40)
    fluxes = []
    for u, v, w in (surface.quadrature(), (fine[:, np.newaxis], fine, np.outer(fine_weights, fine_weights))):
        d = surface.derivatives(u, v)
        fluxes.append(np.sum(w * np.sum(d[0, 0] * np.cross(d[1, 0], d[0, 1]), axis=-1)))
    assert fluxes[0] == pytest.approx(fluxes[1], rel=1e-10)


@pytest.mark.parametrize("count", [4, 5, 10])
def test_uniform_knots_have_even_spans_between_clamped_ends(count: int) -> None:
    knots = uniform_knots(count)
    assert len(knots) == count + 4
    assert np.all(knots[:4] == -1)
    assert np.all(knots[-4:] == 1)
    np.testing.assert_allclose(np.diff(knots[3:-3]), 2 / (count - 3))


def test_a_rational_quadratic_is_an_exact_circle() -> None:
    circle = NurbsCurve(np.column_stack([QUARTER_ARC, np.zeros(3)]), ARC_WEIGHTS, ARC_KNOTS)
    points = circle.evaluate(np.linspace(0, 1, 33))
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1, rtol=0, atol=1e-15)


def test_a_cylinder_has_mean_curvature_half_its_radius_inverse() -> None:
    u, v = np.linspace(0, 1, 9)[:, np.newaxis], np.linspace(0, 1, 5)
    surface = cylinder(3.0)
    points, normals = surface.evaluate(u, v), surface.normals(u, v)
    np.testing.assert_allclose(np.hypot(points[..., 0], points[..., 1]), 3, rtol=1e-15)
    np.testing.assert_allclose(normals, points * [1, 1, 0] / 3, rtol=0, atol=1e-14)
    # The normal points away from the centre of curvature.
    np.testing.assert_allclose(surface.mean_curvature(u, v), -1 / 6, rtol=1e-13)


def test_a_sheared_cylinder_keeps_its_mean_curvature() -> None:
    # Control points slid along the rulings: the same surface, no longer with perpendicular parameter lines.
    straight = cylinder(3.0)
    slide = np.array([0.0, 0.4, 1.3])[:, np.newaxis, np.newaxis] * [0, 0, 1]
    sheared = NurbsSurface(straight.control_points + slide, straight.weights, ARC_KNOTS, LINE_KNOTS)
    np.testing.assert_allclose(sheared.mean_curvature(np.linspace(0, 1, 9), 0.3), -1 / 6, rtol=1e-13)


def test_a_ruled_surface_is_straight_along_its_rulings() -> None:
    assert np.all(cylinder(1.0).derivatives(0.3, 0.6, order=2)[0, 2] == 0)


def test_a_sphere_has_mean_curvature_its_radius_inverse() -> None:
    u, v = np.linspace(0, 1, 9)[:, np.newaxis], np.linspace(0, 0.9, 7)
    surface = sphere_octant(2.0)
    points = surface.evaluate(u, v)
    np.testing.assert_allclose(np.linalg.norm(points, axis=-1), 2, rtol=1e-14)
    np.testing.assert_allclose(surface.normals(u, v), points / 2, rtol=0, atol=1e-13)
    np.testing.assert_allclose(surface.mean_curvature(u, v), -1 / 2, rtol=1e-12)


def test_gauss_quadrature_of_the_sphere_octant_gives_its_area() -> None:
    nodes, weights = gauss_points(ARC_KNOTS, 20)
    d = sphere_octant(2.0).derivatives(nodes[:, np.newaxis], nodes)
    area = weights @ np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1) @ weights
    assert area == pytest.approx(4 * pi * 2**2 / 8, rel=1e-12)


@pytest.mark.parametrize(("k", "m"), [(1, 0), (0, 1), (2, 0), (1, 1), (0, 2)])
@pytest.mark.parametrize("surface", [paper_surface(), uneven_surface()], ids=["paper", "uneven"])
def test_rational_derivatives_are_the_limit_of_central_differences_at_second_order(
    surface: NurbsSurface, k: int, m: int
) -> None:
    u, v = np.array([0.05, 0.1, 0.4 + 0.1]), np.array([0.1, 0.31, 0.06])
    along_u = k > 0
    lower = (k - 1, m) if along_u else (k, m - 1)

    def error(step: float) -> float:
        du, dv = (step, 0.0) if along_u else (0.0, step)
        ahead, behind = (surface.derivatives(u + s * du, v + s * dv, order=2)[lower] for s in (1, -1))
        return float(np.max(np.abs((ahead - behind) / (2 * step) - surface.derivatives(u, v, order=2)[k, m])))

    assert np.log2(error(4e-3) / error(2e-3)) == pytest.approx(2, abs=0.1)


def test_weights_all_alike_change_nothing() -> None:
    surface = uneven_surface()
    one, five = (
        NurbsSurface(surface.control_points, np.full((6, 4), w), surface.knots_u, surface.knots_v) for w in (1, 5)
    )
    u, v = np.linspace(-1, 1, 7), np.linspace(0, 3, 7)
    np.testing.assert_allclose(one.evaluate(u, v), five.evaluate(u, v), rtol=0, atol=1e-14)
    assert not one.rational
    assert not five.rational
    assert surface.rational


def test_edges_run_round_the_square() -> None:
    surface = uneven_surface()
    u, v = np.linspace(-1, 1, 17), np.linspace(0, 3, 17)
    one = np.ones_like(u)
    border = [(u, 0 * one), (one, v), (u[::-1], 3 * one), (-one, v[::-1])]
    for k, (along_u, along_v) in enumerate(border):
        curve, following = surface.edge(k), surface.edge((k + 1) % 4)
        np.testing.assert_allclose(
            curve.evaluate((u, v)[k % 2]), surface.evaluate(along_u, along_v), rtol=0, atol=1e-14
        )
        np.testing.assert_array_equal(curve.control_points[-1], following.control_points[0])


def test_edge_rows_of_a_net_meet_end_to_start() -> None:
    net = np.arange(20.0).reshape(5, 4)
    rows = [edge_row(net, k) for k in range(4)]
    assert [row[-1] for row in rows] == [row[0] for row in rows[1:] + rows[:1]]
    assert {int(i) for row in rows for i in row} == set(net.ravel().tolist()) - set(net[1:-1, 1:-1].ravel().tolist())


def test_a_reversed_curve_runs_backwards_and_twice_reversed_is_itself() -> None:
    curve = uneven_surface().edge(0)
    x = np.linspace(-1, 1, 13)
    np.testing.assert_allclose(curve.reversed().evaluate(x), curve.evaluate(-x), rtol=0, atol=1e-14)
    np.testing.assert_allclose(curve.reversed().reversed().evaluate(x), curve.evaluate(x), rtol=0, atol=1e-14)


@settings(max_examples=25, deadline=None)
@given(arrays(float, (3, 3), elements=st.floats(-5, 5)), arrays(float, 3, elements=st.floats(-5, 5)))
def test_affine_maps_act_on_the_control_points(matrix: Floats, translation: Floats) -> None:
    surface = uneven_surface()
    u, v = np.linspace(-1, 1, 7), np.linspace(0, 3, 7)
    mapped = surface.transformed(matrix, translation).evaluate(u, v)
    np.testing.assert_allclose(mapped, surface.evaluate(u, v) @ matrix.T + translation, rtol=0, atol=1e-12)


def test_arrays_are_copies_and_read_only() -> None:
    net, weights, knots = np.ones((3, 3, 3)), np.ones((3, 3)), ARC_KNOTS.copy()
    surface = NurbsSurface(net, weights, knots, knots)
    net[:], weights[:], knots[:] = 7, 7, 7
    for array in (surface.control_points, surface.weights, surface.knots_u, surface.edge(0).control_points):
        assert array.max() <= 1
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_there_is_one_weight_a_control_point() -> None:
    with pytest.raises(ParameterError, match=r"weights = \(3, 2\): expected one weight per control point: \(3, 3\)"):
        NurbsSurface(np.ones((3, 3, 3)), np.ones((3, 2)), ARC_KNOTS, ARC_KNOTS)


def polynomial_surface() -> NurbsSurface:
    surface = uneven_surface()
    return NurbsSurface(surface.control_points, np.full((6, 4), 3.0), surface.knots_u, surface.knots_v)


@pytest.mark.parametrize("lead", [(), (2,), (3, 2)])
@pytest.mark.parametrize(
    "surface",
    [paper_surface(), uneven_surface(), polynomial_surface(), cylinder(2.0)],
    ids=["paper", "uneven", "polynomial", "cylinder"],
)
def test_derivatives_of_many_nets_on_a_grid_are_those_of_each_surface(
    surface: NurbsSurface, lead: tuple[int, ...]
) -> None:
    nets = np.random.default_rng(7).normal(size=(*lead, *surface.control_points.shape))
    knots = (surface.knots_u, surface.knots_v)
    u, v = (np.linspace(knot[0], knot[-1], count) for knot, count in zip(knots, (7, 5), strict=True))
    together = grid_derivatives(nets, surface.weights, knots, u, v)
    for index in np.ndindex(*lead):
        d = NurbsSurface(nets[index], surface.weights, *knots).derivatives(u[:, np.newaxis], v[np.newaxis])
        for mine, reference in zip(together, (d[0, 0], d[1, 0], d[0, 1]), strict=True):
            assert mine.shape == (*lead, 7, 5, 3)
            np.testing.assert_allclose(mine[index], reference, rtol=0, atol=1e-13 * np.abs(reference).max())


def test_derivatives_on_a_grid_take_views_of_nets() -> None:
    surface = uneven_surface()
    pair = np.stack([surface.control_points, 2 * surface.control_points], axis=2)
    knots, u, v = (surface.knots_u, surface.knots_v), np.linspace(-1, 1, 4), np.linspace(0, 3, 3)
    views = grid_derivatives(np.moveaxis(pair, 2, 0), surface.weights, knots, u, v)
    alone = grid_derivatives(surface.control_points, surface.weights, knots, u, v)
    for both, one in zip(views, alone, strict=True):
        np.testing.assert_allclose(both, [one, 2 * one], rtol=1e-13)

"""Curves and surfaces handed to the kernel: the same numbers, the same points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt, gp_Vec

from gyroid_cad.kernel.surfaces import kernel_curve, kernel_surface, nurbs_of_surface
from gyroid_cad.nurbs.surface import NurbsCurve, NurbsSurface
from gyroid_cad.surface.fit import FitSettings, fit_patch

Floats = NDArray[np.float64]

PAPER_WEIGHTS = replace(FitSettings.paper(), parameterisation="smooth")


@st.composite
def knot_vectors(draw: st.DrawFn) -> Floats:
    """Clamped on [-1, 1], of degree 1 to 3, with inner knots some of which may be double."""
    degree = draw(st.integers(1, 3))
    inner = draw(st.lists(st.integers(-7, 7), max_size=4, unique=True))
    doubled = inner[:1] if degree > 1 else []
    return np.sort(np.concatenate([np.full(degree + 1, -1.0), np.array(inner + doubled) / 8, np.ones(degree + 1)]))


def degree_of(knots: Floats) -> int:
    return int(np.sum(knots == -1.0)) - 1


@st.composite
def surfaces(draw: st.DrawFn) -> NurbsSurface:
    knots_u, knots_v = draw(knot_vectors()), draw(knot_vectors())
    shape = (len(knots_u) - degree_of(knots_u) - 1, len(knots_v) - degree_of(knots_v) - 1)
    random = np.random.default_rng(draw(st.integers(0, 2**32)))
    weights = random.uniform(0.2, 3.0, shape) if draw(st.booleans()) else np.ones(shape)
    return NurbsSurface(random.normal(size=(*shape, 3)), weights, knots_u, knots_v)


parameters = st.floats(-1, 1, allow_subnormal=False)


def coordinates(point: gp_Pnt | gp_Vec) -> tuple[float, float, float]:
    return point.X(), point.Y(), point.Z()


@given(surfaces())
def test_the_kernel_gives_back_every_pole_weight_and_knot_bit_for_bit(surface: NurbsSurface) -> None:
    back = nurbs_of_surface(kernel_surface(surface))
    for part in ("control_points", "weights", "knots_u", "knots_v"):
        np.testing.assert_array_equal(getattr(back, part), getattr(surface, part))


@given(surfaces(), parameters, parameters)
def test_the_kernel_evaluates_the_same_point_and_tangents(surface: NurbsSurface, u: float, v: float) -> None:
    point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
    kernel_surface(surface).D1(u, v, point, along_u, along_v)
    ours = surface.derivatives(u, v)
    # Both take the right-hand derivative at a knot where a double knot leaves a kink.
    for kernel, expected in ((point, ours[0, 0]), (along_u, ours[1, 0]), (along_v, ours[0, 1])):
        np.testing.assert_allclose(coordinates(kernel), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("fit", [FitSettings(), PAPER_WEIGHTS, FitSettings.paper()], ids=["ours", "weights", "paper"])
def test_the_fitted_patch_is_the_same_surface_in_the_kernel(fit: FitSettings) -> None:
    surface = fit_patch(fit).surface
    kernel = kernel_surface(surface)
    random = np.random.default_rng(7)
    for u, v in random.uniform(-1, 1, (200, 2)).tolist():
        np.testing.assert_allclose(coordinates(kernel.Value(u, v)), surface.evaluate(u, v), atol=1e-14)
    assert (kernel.IsURational() or kernel.IsVRational()) == surface.rational


@given(surfaces(), st.floats(0.1, 10))
def test_equal_weights_however_large_make_a_polynomial_surface(surface: NurbsSurface, weight: float) -> None:
    weighted = NurbsSurface(
        surface.control_points, np.full_like(surface.weights, weight), surface.knots_u, surface.knots_v
    )
    kernel = kernel_surface(weighted)
    assert not kernel.IsURational()
    assert not kernel.IsVRational()


@given(surfaces(), st.integers(0, 3), parameters)
def test_the_kernels_curve_is_the_border_of_the_kernels_surface(surface: NurbsSurface, index: int, s: float) -> None:
    curve = kernel_curve(surface.edge(index))
    u, v = ((s, -1.0), (1.0, s), (-s, 1.0), (-1.0, -s))[index]
    on_surface = kernel_surface(surface).Value(u, v)
    np.testing.assert_allclose(coordinates(curve.Value(s)), coordinates(on_surface), atol=1e-11)


@given(surfaces(), st.integers(0, 3), parameters)
def test_a_reversed_curve_is_the_curve_run_backwards_in_the_kernel_too(
    surface: NurbsSurface, index: int, s: float
) -> None:
    curve = surface.edge(index)
    backwards = kernel_curve(curve.reversed())
    np.testing.assert_allclose(coordinates(backwards.Value(s)), curve.evaluate(-s)[0], atol=1e-11)
    assert backwards.Degree() == curve.degree


@given(surfaces(), st.integers(0, 3))
@settings(max_examples=30)
def test_the_kernels_curve_holds_the_same_poles_and_weights(surface: NurbsSurface, index: int) -> None:
    curve = surface.edge(index)
    kernel = kernel_curve(curve)
    count = range(1, kernel.NbPoles() + 1)
    np.testing.assert_array_equal([coordinates(kernel.Pole(i)) for i in count], curve.control_points)
    np.testing.assert_array_equal([kernel.Weight(i) for i in count], curve.weights)
    assert kernel.IsRational() == bool(np.ptp(curve.weights) > 0)


def test_a_straight_line_is_a_curve_of_degree_one() -> None:
    ends = np.array([[0.0, 0.0, 0.0], [2.0, 4.0, 6.0]])
    line = kernel_curve(NurbsCurve(ends, np.ones(2), np.array([0.0, 0.0, 1.0, 1.0])))
    assert line.Degree() == 1
    np.testing.assert_allclose(coordinates(line.Value(0.25)), (0.5, 1.0, 1.5))


def test_the_kernels_surface_is_its_own_not_a_view_of_ours() -> None:
    surface = fit_patch(FitSettings(4)).surface
    kernel: Geom_BSplineSurface = kernel_surface(surface)
    kernel.SetPole(1, 1, gp_Pnt(9, 9, 9))
    assert not np.any(surface.control_points == 9)

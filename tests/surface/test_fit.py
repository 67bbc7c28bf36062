"""The fit: how close it is, how fast it converges, and whether neighbours share their edges."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.optimize import least_squares

from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.surface.families import SURFACES, USUAL, MinimalSurface
from gyroid_cad.surface.fit import (
    EDGE_GAP_LIMIT,
    FitSettings,
    FittedPatch,
    edge_gap,
    fit_patch,
    require_shared_edges,
)
from gyroid_cad.surface.fit_report import error_within_reach, fit_report, fit_within
from gyroid_cad.surface.patch import ROTOINVERSION, parameter_corners, smooth
from gyroid_cad.surface.weierstrass import Family

TUBE = USUAL.tube

Floats = NDArray[np.float64]

PATCHES_PER_CELL = 24
CELL_SIZE = 2.0  # in bounding-cell lengths, the unit of the patch
SIZES = (8, 11, 14, 20)


@pytest.fixture(scope="module")
def fitted() -> FittedPatch:
    return fit_patch()


def settings_with(change: Callable[[Floats], None]) -> FitSettings:
    weights = np.ones((10, 10))
    change(weights)
    return FitSettings(weights=tuple(map(tuple, weights.tolist())))


def mid_surface_area(patch: FittedPatch) -> float:
    nodes, weights = gauss_points(patch.surface.knots_u, 8)
    d = patch.surface.derivatives(nodes[:, np.newaxis], nodes)
    area = weights @ np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1) @ weights
    return float(area * PATCHES_PER_CELL / CELL_SIZE**2)


def normal_error(patch: FittedPatch) -> float:
    u, v = np.linspace(-1, 1, 97)[:, np.newaxis], np.linspace(-1, 1, 97)
    return float(np.max(np.linalg.norm(patch.normals.evaluate(u, v) - smooth(u, v)[1], axis=-1)))


def thickness_error(patch: FittedPatch) -> float:
    """Of the fitted normals, along the exact ones: relative, as a wall's."""
    u, v = np.linspace(-1, 1, 97)[:, np.newaxis], np.linspace(-1, 1, 97)
    return float(np.abs(np.sum(patch.normals.evaluate(u, v) * smooth(u, v)[1], axis=-1) - 1).max())


def test_the_fit_is_within_a_hundred_thousandth_of_the_cell_and_a_ninth_of_a_degree(fitted: FittedPatch) -> None:
    report = fit_report(fitted)
    assert report.max_distance <= 1e-5
    assert report.max_normal_angle <= 0.11
    assert 0 < report.rms_distance < report.max_distance


def test_corners_are_interpolated_and_edges_shared(fitted: FittedPatch) -> None:
    report = fit_report(fitted)
    assert report.corner_error <= 1e-15
    assert report.edge_gap == edge_gap(fitted) <= EDGE_GAP_LIMIT
    require_shared_edges(fitted)


def test_the_fitted_mid_surface_has_the_area_of_the_gyroid(fitted: FittedPatch) -> None:
    assert mid_surface_area(fitted) == pytest.approx(TUBE.area, rel=2e-7)


def test_the_reported_distance_is_that_of_the_nearest_points(fitted: FittedPatch) -> None:
    u, v = (grid.ravel() for grid in np.meshgrid(*[np.linspace(-1, 1, 121)] * 2))
    exact, normals = smooth(u, v)
    along_normal = np.abs(np.sum((fitted.surface.evaluate(u, v) - exact) * normals, axis=1))

    def apart(uv: Floats, target: Floats) -> Floats:
        return np.asarray(fitted.surface.evaluate(uv[0], uv[1]) - target)

    nearest = []
    for sample in np.argsort(along_normal)[-8:]:
        start = np.clip([u[sample], v[sample]], -0.999, 0.999)
        result = least_squares(apart, start, bounds=(-1, 1), args=(exact[sample],), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        nearest.append(np.linalg.norm(result.fun) / CELL_SIZE)
    assert max(nearest) == pytest.approx(fit_report(fitted).max_distance, rel=0.02)


def test_the_reported_angle_is_in_degrees_and_the_curvature_per_cell_size(fitted: FittedPatch) -> None:
    # Curvature is largest at knots: seven spans, of sixteen steps each.
    u, v = np.linspace(-1, 1, 113)[:, np.newaxis], np.linspace(-1, 1, 113)
    sine = np.linalg.norm(np.cross(fitted.surface.normals(u, v), smooth(u, v)[1]), axis=-1)
    report = fit_report(fitted)
    assert report == fit_report(fitted)
    # The normals compared here are not quite at the nearest points.
    assert np.degrees(np.arcsin(sine.max())) == pytest.approx(report.max_normal_angle, rel=0.25)
    per_cell_size = fitted.surface.transformed(np.eye(3) / CELL_SIZE).mean_curvature(u, v)
    assert np.abs(per_cell_size).max() == pytest.approx(report.max_mean_curvature, rel=0.05)


@pytest.mark.parametrize(
    ("measure", "order"),
    [
        (lambda patch: fit_report(patch).max_distance, 3.3),
        (lambda patch: fit_report(patch).rms_distance, 3.3),
        (lambda patch: fit_report(patch).max_normal_angle, 2.3),
        (lambda patch: fit_report(patch).rms_mean_curvature, 1.8),
        (normal_error, 2.8),
        (thickness_error, 3.3),
        (lambda patch: abs(mid_surface_area(patch) / TUBE.area - 1), 5.5),
    ],
    ids=["distance", "rms distance", "normal angle", "mean curvature", "fitted normals", "thickness", "area"],
)
def test_errors_fall_with_the_order_of_cubic_splines(measure: Callable[[FittedPatch], float], order: float) -> None:
    errors = [measure(fit_patch(FitSettings(n))) for n in SIZES]
    spans = [n - 3 for n in SIZES]
    for (coarse, fine), (few, many) in zip(pairwise(errors), pairwise(spans), strict=True):
        assert np.log(coarse / fine) / np.log(many / few) >= order


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES.keys())
def test_what_the_finest_fit_reaches_is_known_from_a_coarse_one(surface: MinimalSurface) -> None:
    coarse, fine = (
        error_within_reach(n, fit_report(fit_patch(FitSettings(n), surface.family)).max_distance) for n in (8, 20)
    )
    assert 0.5 < coarse / fine < 2


def test_a_tolerance_out_of_reach_is_refused_before_the_finest_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[int] = []

    def fit(settings: FitSettings, family: Family) -> FittedPatch:
        tried.append(settings.control_points)
        return fit_patch(settings, family)

    monkeypatch.setattr("gyroid_cad.surface.fit_report.fit_patch", fit)
    with pytest.raises(ParameterError, match=r"tolerance = 1e-12: expected at least about 5\.\de-09, which 40 control"):
        fit_within(FitSettings(), 1e-12)
    assert tried == [10]


def test_fitted_normals_are_nearly_of_unit_length_and_perpendicular(fitted: FittedPatch) -> None:
    u, v = np.linspace(-1, 1, 41)[:, np.newaxis], np.linspace(-1, 1, 41)
    normals = fitted.normals.evaluate(u, v)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, rtol=0, atol=2e-4)
    np.testing.assert_allclose(normals, fitted.surface.normals(u, v), rtol=0, atol=1e-3)


def test_fitted_normals_are_exact_at_the_corners(fitted: FittedPatch) -> None:
    u, v = parameter_corners().T
    np.testing.assert_allclose(fitted.normals.evaluate(u, v), smooth(u, v)[1], rtol=0, atol=1e-15)


def test_the_net_has_the_rotoinversion_of_the_patch(fitted: FittedPatch) -> None:
    for net, sign in ((fitted.surface.control_points, 1), (fitted.normals.control_points, -1)):
        np.testing.assert_allclose(net, sign * np.rot90(net) @ ROTOINVERSION.T, rtol=0, atol=1e-12)


@settings(max_examples=20, deadline=None)
@given(st.floats(-0.3, 0.3))
def test_offsets_are_linear_in_the_distance(distance: float) -> None:
    patch = fit_patch()
    u, v = np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)
    moved = patch.offset(distance).evaluate(u, v)
    expected = patch.surface.evaluate(u, v) + distance * patch.normals.evaluate(u, v)
    np.testing.assert_allclose(moved, expected, rtol=0, atol=1e-14)


def test_edges_of_the_fit_depend_on_nothing_but_the_edge(fitted: FittedPatch) -> None:
    def heavy_interior(weights: Floats) -> None:
        weights[1:-1, 1:-1] = np.random.default_rng(3).uniform(0.5, 2, (8, 8))

    other = fit_patch(settings_with(heavy_interior))
    for k in range(4):
        np.testing.assert_array_equal(other.surface.edge(k).control_points, fitted.surface.edge(k).control_points)
    assert np.any(other.surface.control_points != fitted.surface.control_points)


def test_equal_settings_are_fitted_once() -> None:
    assert fit_patch(FitSettings(9)) is fit_patch(FitSettings(control_points=9))


def test_the_paper_has_the_knots_of_eq_14_and_the_weights_of_fig_7() -> None:
    paper = FitSettings.paper()
    knots = paper.knot_vector()
    assert paper.parameterisation == "polar"
    assert knots[:4].tolist() == [-1] * 4
    assert knots[-4:].tolist() == [1] * 4
    np.testing.assert_allclose(knots[4:-4], [-0.6, -0.4, -0.2, 0.2, 0.4, 0.6])
    weights = paper.weight_net()
    values, counts = np.unique(weights, return_counts=True)
    # 4 corners; the central 2 x 2; the ring of a 4 x 4 less those; the rest of 10 x 10.
    assert dict(zip(values.tolist(), counts.tolist(), strict=True)) == {0.25: 4, 0.75: 4, 1.5: 12, 1.0: 80}
    np.testing.assert_array_equal(weights, np.rot90(weights))
    np.testing.assert_array_equal(weights, weights.T)
    assert weights[0, 0] == 1 / 4
    assert weights[4, 5] == 3 / 4
    assert weights[3, 6] == 3 / 2


def test_the_papers_fit_does_not_share_edges_and_is_refused_with_the_gap() -> None:
    patch = fit_patch(FitSettings.paper())
    gap = edge_gap(patch)
    assert gap > 1e-3
    assert fit_report(patch).corner_error > 1e-4
    with pytest.raises(FitError, match=f"{gap:.2e} of the cell size apart in the polar parameterisation"):
        require_shared_edges(patch)


def test_the_papers_weights_and_knots_share_edges_in_the_smooth_parameterisation(fitted: FittedPatch) -> None:
    paper = FitSettings.paper()
    patch = fit_patch(FitSettings(10, paper.knots, paper.weights, "smooth"))
    require_shared_edges(patch)
    assert fit_report(patch).corner_error <= 1e-15
    assert fit_report(patch).max_distance > 50 * fit_report(fitted).max_distance


def test_weights_that_differ_between_the_halves_of_an_edge_are_refused() -> None:
    def lopsided(weights: Floats) -> None:
        weights[0, 2] = 2

    with pytest.raises(FitError, match="symmetric weights"):
        require_shared_edges(fit_patch(settings_with(lopsided)))


def test_weights_that_differ_from_edge_to_edge_are_refused() -> None:
    # In the cell an edge meets the next or the previous one of its neighbour, never the same one.
    def two_heavy_edges(weights: Floats) -> None:
        weights[1:-1, [0, -1]] = 2

    with pytest.raises(FitError, match="symmetric weights"):
        require_shared_edges(fit_patch(settings_with(two_heavy_edges)))


@pytest.mark.parametrize("n", [4, 40])
def test_the_fewest_and_the_most_control_points_are_accepted(n: int) -> None:
    assert FitSettings(n).knot_vector().shape == (n + 4,)
    assert FitSettings(n).weight_net().shape == (n, n)


def test_settings_given_as_what_is_left_out_give_the_same_fit(fitted: FittedPatch) -> None:
    default = FitSettings()
    spelled = FitSettings(10, tuple(default.knot_vector()), tuple(map(tuple, default.weight_net())))
    np.testing.assert_array_equal(fit_patch(spelled).surface.control_points, fitted.surface.control_points)


KNOTS = tuple(FitSettings().knot_vector().tolist())
ONES = ((1.0,) * 10,) * 10


@pytest.mark.parametrize(
    ("field", "value", "accepted"),
    [
        ("control_points", 3, "4 to 40 a side"),
        ("control_points", 41, "4 to 40 a side"),
        ("control_points", 10.0, "a whole number"),
        ("control_points", True, "a whole number"),
        ("control_points", "10", "a whole number"),
        ("parameterisation", "conformal", "smooth or polar"),
        ("parameterisation", ["smooth"], "smooth or polar"),
        ("knots", KNOTS[:-1], "14 non-decreasing numbers"),
        ("knots", (*KNOTS[:5], 0.3, *KNOTS[6:]), "symmetric about 0"),
        ("knots", tuple(2 * k for k in KNOTS), "four times -1"),
        ("knots", (*KNOTS[:6], float("nan"), *KNOTS[7:]), "14 non-decreasing numbers"),
        ("knots", (-1,) * 4 + (-0.5, -0.5, 0.0, 0.0, 0.5, 0.5) + (1,) * 4, "distinct ones"),
        ("knots", "evenly", "14 non-decreasing numbers"),
        ("weights", ONES[1:], "10 x 10 positive numbers"),
        ("weights", (*ONES[1:], (1.0,) * 9), "10 x 10 positive numbers"),
        ("weights", (*ONES[1:], (0.0,) * 10), "10 x 10 positive numbers"),
        ("weights", (*ONES[1:], (float("inf"),) * 10), "10 x 10 positive numbers"),
        ("weights", np.ones((3, 3)), "10 x 10 positive numbers"),
    ],
)
def test_a_bad_setting_is_refused_in_one_line_by_name_value_and_what_is_accepted(
    field: str, value: object, accepted: str
) -> None:
    with pytest.raises(ParameterError) as refusal:
        FitSettings(**{field: value})  # type: ignore[arg-type]
    message = str(refusal.value)
    assert message.startswith(f"{field} = {repr(value)[:20]}")
    assert accepted in message.split(": expected ")[1]
    assert "\n" not in message

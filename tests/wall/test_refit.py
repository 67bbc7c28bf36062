"""The wall of a graded lattice, fitted anew: how close it is, and that neighbours meet."""

from __future__ import annotations

import re
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from gyroid_cad import Lattice
from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.fields.field import Field, as_field
from gyroid_cad.maps.block import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.space import SpaceMap
from gyroid_cad.nurbs.basis import basis, uniform_knots
from gyroid_cad.nurbs.surface import NurbsSurface, edge_row
from gyroid_cad.surface.fit import MOST_CONTROL_POINTS, FitSettings, fit_patch
from gyroid_cad.wall import refit as refit_module
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.exact import offset_patches
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import SIDES, Wall, build_wall
from gyroid_cad.wall.refit import WALL_PER_TOLERANCE, Refit, fitted_nets, graded_wall, likely_control_points, measured

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]

L = 10.0
SIZE = (L, L, L)
CELL = build_complex((1, 1, 1))
ALL = np.arange(CELL.patch_count)
TOLERANCE = 1e-4


def field(text: str) -> Field:
    made = as_field("thickness", text, "")
    assert isinstance(made, Field)
    return made


PAPER = Lattice.paper((1, 1, 1), "0.08 + 0.05*x + 0.02*y", "1 + 0.05*x + 0.08*y").grading()
GRADINGS = {
    "slope": Grading(L, field("0.8 + 0.03*x")),
    "density": Grading(L, density=field("0.2 + 0.01*y"), map=Twist(30).over(SIZE)),
    "scale": Grading(L, 0.8, scale_field=field("1 + 0.02*x - 0.01*z")),
    "cylinder": Grading(L, 0.8, map=Cylinder(L).over(SIZE)),
    "sphere": Grading(L, 0.8, map=Sphere(2 * L).over(SIZE)),
    "twist": Grading(L, 0.5, map=Twist(60).over(SIZE)),
    "without jacobian": Grading(L, field("0.8 + 0.1*sin(x/2)"), map=SpaceMap(Bend(40).over(SIZE).function)),
    "paper": PAPER,
}


@lru_cache(maxsize=64)
def fit(name: str, control_points: int) -> Refit:
    nets = fitted_nets(CELL, GRADINGS[name], control_points, ALL)
    return measured(nets, CELL, GRADINGS[name])


def closed_ring(wave: float = 0.2) -> tuple[CellComplex, Grading]:
    """Three cells round a cylinder, the wall as thick at both ends of the block."""
    ring = Cylinder(7, 360).over((3 * L, L, L))
    grading = Grading(L, field(f"0.6 + {wave}*sin(2*pi*x/30)"), map=ring)
    return build_complex((3, 1, 1), closed=ring.closed), grading


def dense(wall: Wall, grading: Grading, count: int) -> tuple[float, float]:
    """Largest deviation and relative wall error at other places than the fit measured."""
    samples, knots = np.linspace(-0.999, 0.999, count), wall.knots
    functions = basis(knots, 3, samples)
    faces = np.einsum("ui,psijc,vj->psuvc", functions, wall.nets, functions, optimize=True)
    deviation = error = 0.0
    for some, fitted in offset_patches(wall.complex, grading, samples):
        normal, shape = fitted.normals.reshape(-1, count, count, 3), (-1, count, count)
        height = np.einsum("psuvc,puvc->psuv", faces[some] - fitted.points.reshape(-1, 1, count, count, 3), normal)
        thickness = fitted.thickness.reshape(shape)
        off = height - np.stack([-thickness, thickness], axis=1) / 2
        deviation = max(deviation, float(np.abs(off).max()))
        error = max(error, float(np.abs((height[:, 1] - height[:, 0]) / thickness - 1).max()))
    return deviation, error


@pytest.mark.parametrize("control_points", [6, 10, 17])
def test_a_wall_that_does_not_vary_is_that_of_the_staged_fit(control_points: int) -> None:
    grading = Grading(L, 0.8)
    anew = graded_wall(CELL, grading, control_points)
    staged = build_wall(CELL, fit_patch(FitSettings(control_points)), L, 0.8)
    u, v = np.linspace(-1, 1, 13)[:, np.newaxis], np.linspace(-1, 1, 13)
    close = 2 * measured(anew.nets, CELL, grading).max_deviation
    for net in range(0, 24, 5):
        for side in SIDES:
            points = [wall.face(net, side).evaluate(u, v) for wall in (anew, staged)]
            np.testing.assert_allclose(*points, rtol=0, atol=close)
    assert anew.volume() == pytest.approx(staged.volume(), rel=close / 0.8)


@settings(max_examples=25)
@given(st.integers(4, MOST_CONTROL_POINTS), arrays(float, (4, 3), elements=st.floats(-1, 1)))
def test_polynomials_of_degree_three_are_fitted_exactly(control_points: int, coefficients: Floats) -> None:
    samples, operator = refit_module._fit_operator(control_points)
    net = operator @ np.vander(samples, 4) @ coefficients
    u = np.linspace(-1, 1, 57)
    fitted = basis(uniform_knots(control_points), 3, u) @ net
    np.testing.assert_allclose(fitted, np.vander(u, 4) @ coefficients, rtol=0, atol=1e-12)


@pytest.mark.parametrize("control_points", [4, 9, 24, MOST_CONTROL_POINTS])
def test_the_fit_of_an_edge_is_the_same_run_backwards_and_keeps_its_ends(control_points: int) -> None:
    samples, operator = refit_module._fit_operator(control_points)
    np.testing.assert_allclose(samples, -samples[::-1], rtol=0, atol=1e-15)
    np.testing.assert_allclose(operator, operator[::-1, ::-1], rtol=0, atol=1e-13)
    ends = np.eye(len(samples))[[0, -1]]
    np.testing.assert_array_equal(operator[[0, -1]], ends)


def test_an_affine_map_of_space_is_one_of_the_control_points() -> None:
    matrix = np.array([[1.5, 0.2, 0], [0, 1, -0.1], [0, 0, 0.8]])
    space = SpaceMap(lambda x, y, z: matrix @ np.stack([x, y, z]) + 3)
    # The mean of the two faces' nets is the mid-surface's.
    flat, mapped = (fitted_nets(CELL, Grading(L, 0.5, map=m), 9, ALL).mean(axis=1) for m in (None, space))
    np.testing.assert_allclose(mapped, flat @ matrix.T + 3, rtol=0, atol=1e-12 * L)


@pytest.mark.parametrize("name", GRADINGS)
def test_the_error_falls_with_the_fourth_power_of_the_spans(name: str) -> None:
    counts = np.array([8, 12, 17, 24])
    made = [fit(name, n) for n in counts.tolist()]
    for errors in ([r.max_deviation for r in made], [r.max_wall_error for r in made]):
        order = -np.polyfit(np.log(counts - 3), np.log(errors), 1)[0]
        assert order == pytest.approx(4, abs=0.6)
    angles = [r.max_normal_angle for r in made]
    assert -np.polyfit(np.log(counts - 3), np.log(angles), 1)[0] > 2


@pytest.mark.parametrize("name", GRADINGS)
@pytest.mark.parametrize("control_points", [9, 14])
def test_nowhere_is_the_fit_much_worse_than_measured(name: str, control_points: int) -> None:
    grading, reported = GRADINGS[name], fit(name, control_points)
    wall = graded_wall(CELL, grading, control_points)
    deviation, error = dense(wall, grading, 37)
    assert deviation == pytest.approx(reported.max_deviation, rel=0.15)
    assert error == pytest.approx(reported.max_wall_error, rel=0.15)


def gaps(wall: Wall) -> Floats:
    """How far apart the control points of each shared edge are in its two patches, in mm."""
    complex, largest = wall.complex, []
    for edge in np.flatnonzero(~complex.free).tolist():
        rows = []
        for patch in complex.edge_patches[edge].tolist():
            k = int(np.flatnonzero(complex.patch_edges[patch] == edge)[0])
            row = np.stack([edge_row(wall.nets[patch, side], k) for side in SIDES])
            rows.append(row if complex.edge_forward[patch, k] else row[:, ::-1])
        largest.append(np.abs(rows[0] - rows[1]).max())
    return np.array(largest)


@pytest.mark.parametrize("name", GRADINGS)
def test_neighbours_share_the_edges_of_both_faces(name: str) -> None:
    wall = graded_wall(CELL, GRADINGS[name], 10)
    assert gaps(wall).max() < 2e-11 * L


def test_a_closed_ring_shares_its_edges_across_the_seam_too() -> None:
    complex, grading = closed_ring()
    seam = np.ptp(complex.patch_cell[complex.edge_patches[~complex.free]][..., 0], axis=1) == 2
    assert 2 * seam.sum() == build_complex((3, 1, 1)).free.sum() - complex.free.sum()
    apart = gaps(graded_wall(complex, grading, 10))
    assert apart[seam].max() < 2e-11 * L
    assert apart.max() < 2e-11 * L


@pytest.mark.parametrize("thickness", ["0.6 + 0.01*x", "0.6 + 1e-8*x"])
def test_a_field_that_differs_at_the_ends_a_map_joins_is_refused(thickness: str) -> None:
    ring = Cylinder(7, 360).over((3 * L, L, L))
    complex = build_complex((3, 1, 1), closed=ring.closed)
    with pytest.raises(FitError, match=r"edges of neighbouring patches are .* the same at both ends that a map joins"):
        graded_wall(complex, Grading(L, field(thickness), map=ring), 8)


def test_a_map_that_only_says_that_it_closes_is_refused() -> None:
    space = SpaceMap(lambda x, y, z: (x, y, z), closed=(True, False, False))
    with pytest.raises(FitError, match="edges of neighbouring patches are 10 mm apart"):
        graded_wall(build_complex((1, 1, 1), closed=space.closed), Grading(L, 0.8, map=space), 8)


def ray_lengths(face: NurbsSurface, origin: Floats, along: Floats, start: tuple[Floats, Floats], s: Floats) -> Floats:
    """How far along rays (m, 3) a face is met, by Newton's method from a start near by."""
    u, v = (np.array(parameter) for parameter in start)
    for _ in range(8):
        d = face.derivatives(u, v)
        residual = d[0, 0] - origin - s[:, np.newaxis] * along
        step = np.linalg.solve(np.stack([d[1, 0], d[0, 1], -along], axis=-1), -residual[..., np.newaxis])[..., 0]
        u, v, s = np.clip(u + step[:, 0], -1, 1), np.clip(v + step[:, 1], -1, 1), s + step[:, 2]
    assert np.abs(residual).max() < 1e-12
    return s


@pytest.mark.parametrize("name", ["paper", "cylinder", "twist"])
def test_rays_along_the_exact_normal_meet_the_faces_half_a_thickness_away(name: str) -> None:
    grading = GRADINGS[name]
    wall = wall_within(CELL, grading, TOLERANCE)
    samples = np.sort(np.random.default_rng(11).uniform(-0.97, 0.97, 9))
    u, v = (parameter.ravel() for parameter in np.meshgrid(samples, samples, indexing="ij"))
    ((_, fitted),) = offset_patches(CELL, grading, samples)
    for patch in range(CELL.patch_count):
        rays = slice(patch * len(u), (patch + 1) * len(u))
        middle, normal, half = fitted.points[rays], fitted.normals[rays], fitted.thickness[rays] / 2
        below, above = (
            ray_lengths(wall.face(patch, side), middle, normal, (u, v), (2 * side - 1) * half) for side in SIDES
        )
        np.testing.assert_allclose(above - below, 2 * half, rtol=1.1 * WALL_PER_TOLERANCE * TOLERANCE)
        np.testing.assert_allclose([-below, above], [half, half], rtol=1e-3)


def wall_within(complex: CellComplex, grading: Grading, tolerance: float, least: int = 10) -> Wall:
    """As close a fit as a build makes."""
    wanted, n = likely_control_points(complex, grading, least, tolerance), 0
    while n != wanted:
        n = wanted
        wall = graded_wall(complex, grading, n)
        wanted = measured(wall.nets, complex, grading).control_points_for(tolerance, grading.cell_size)
    return wall


def test_control_points_rise_for_all_patches_alike_until_the_tolerance_is_met() -> None:
    counts = []
    for tolerance in (1e-3, 1e-5, 1e-6):
        lattice = Lattice((1, 1, 1), L, 0.8, map="cylinder:radius=8", tolerance=tolerance, fit=FitSettings(5))
        wall, grading = lattice.wall(), lattice.grading()
        n = len(wall.weights)
        assert wall.nets.shape == (24, 2, n, n, 3)
        made = measured(wall.nets, CELL, grading)
        assert made.max_deviation <= tolerance * L
        assert made.max_wall_error <= WALL_PER_TOLERANCE * tolerance
        counts.append(n)
    assert counts[0] < counts[1] < counts[2]
    # A tenth of the error takes 10^(1/4) times the spans.
    assert (counts[2] - 3) / (counts[1] - 3) == pytest.approx(10**0.25, rel=0.2)


def test_no_fewer_control_points_are_tried_than_the_settings_say() -> None:
    lattice = Lattice((1, 1, 1), L, "0.8 + 0.01*x", fit=FitSettings(19), tolerance=1e-2)
    assert len(lattice.wall().weights) == 19


@given(st.integers(4, 40), st.floats(1e-9, 1), st.floats(1e-9, 1), st.floats(1e-6, 1e-1))
def test_more_control_points_are_asked_for_until_both_errors_are_small(
    n: int, deviation: float, wall_error: float, tolerance: float
) -> None:
    made = Refit(n, deviation, wall_error, 0.0, 1.0, 1.0, 5)
    if deviation <= tolerance * L and wall_error <= WALL_PER_TOLERANCE * tolerance:
        assert made.control_points_for(tolerance, L) == n
    elif n < MOST_CONTROL_POINTS:
        assert n < made.control_points_for(tolerance, L) <= MOST_CONTROL_POINTS
    else:
        with pytest.raises(ParameterError, match=rf"^tolerance = .* {MOST_CONTROL_POINTS} control points a side"):
            made.control_points_for(tolerance, L)


def test_the_first_guess_is_no_less_than_asked_for_and_stays_in_bounds() -> None:
    assert likely_control_points(CELL, GRADINGS["slope"], 14, 0.1) == 14
    # The guess is not trusted far.
    assert 10 < likely_control_points(CELL, GRADINGS["slope"], 10, 1e-6) < 20
    assert likely_control_points(CELL, GRADINGS["slope"], MOST_CONTROL_POINTS, 1e-6) == MOST_CONTROL_POINTS


@pytest.mark.parametrize(
    ("grading", "tolerance"),
    # Twisted over and over: no fit is any good.
    [(GRADINGS["slope"], 1e-12), (Grading(L, 0.1, map=Twist(3000).over(SIZE)), 1e-6)],
    ids=["too small", "twisted"],
)
def test_a_tolerance_out_of_reach_is_refused_from_a_few_patches(
    monkeypatch: pytest.MonkeyPatch, grading: Grading, tolerance: float
) -> None:
    fitted: list[tuple[int, int]] = []

    def counted(complex: CellComplex, grading: Grading, control_points: int, patches: NDArray[np.int64]) -> Floats:
        fitted.append((control_points, len(patches)))
        return fitted_nets(complex, grading, control_points, patches)

    monkeypatch.setattr(refit_module, "fitted_nets", counted)
    block = build_complex((3, 3, 3))
    with pytest.raises(ParameterError, match=r"^tolerance = .* 40 control points a side are"):
        likely_control_points(block, grading, 10, tolerance)
    assert [count for n, count in fitted if n > 10] == [32]


@pytest.mark.parametrize(
    ("thickness", "error"),
    [
        ("0.8 + 0.2*(x % 3)", FitError | ParameterError),
        ("0.8 + 0.2*(x % 5)", FitError),
        ("0.8 + 0.2*abs(x - 4)", ParameterError),
        ("0.8 + 0.5*sin(20*x)", ParameterError),
    ],
)
def test_a_field_that_no_fit_can_follow_is_refused_in_one_line(thickness: str, error: Any) -> None:
    with pytest.raises((FitError, ParameterError)) as caught:
        wall_within(CELL, Grading(L, field(thickness)), TOLERANCE)
    assert isinstance(caught.value, error)
    assert re.search("continuous|not smooth", str(caught.value))
    assert "\n" not in str(caught.value)


def test_what_is_refused_for_its_tolerance_is_built_with_a_larger_one() -> None:
    grading = Grading(L, field("0.8 + 0.2*abs(x - 4)"))
    with pytest.raises(ParameterError, match=r"^tolerance = ") as caught:
        wall_within(CELL, grading, TOLERANCE)
    reached = float(re.findall(r"at least ([\d.e-]+):", str(caught.value))[0])
    wall_within(CELL, grading, 1.1 * reached)

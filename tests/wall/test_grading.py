"""What varies over a lattice: normals, thickness and density under scale fields and maps of space."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from gyroid_cad.errors import ParameterError, SelfIntersectionError
from gyroid_cad.fields.field import Field, as_field
from gyroid_cad.maps.block import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.space import SpaceMap
from gyroid_cad.surface.families import USUAL
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.exact import block_volume, differentiation_matrix, exact_measures, offset_patches
from gyroid_cad.wall.grading import THINNEST_WALL, Grading

TUBE = USUAL.tube

Floats = NDArray[np.float64]

L = 8.0
CELLS = (1, 1, 1)
ONE_CELL = build_complex(CELLS)
SIZE = (L, L, L)
NODES = np.polynomial.legendre.leggauss(18)[0]
ANGLES = st.tuples(*3 * [st.floats(-180, 180)])
SHIFTS = st.tuples(*3 * [st.floats(-100, 100)])


def field(text: str) -> Field:
    made = as_field("thickness", text, "")
    assert isinstance(made, Field)
    return made


def affine(matrix: Any, shift: Any = (0, 0, 0), known: bool = True) -> SpaceMap:
    turn = np.array(matrix, dtype=float)
    jacobian = (lambda x, y, z: turn.tolist()) if known else None
    return SpaceMap(lambda x, y, z: turn @ np.stack([x, y, z]) + np.array(shift)[:, np.newaxis], jacobian)


def fitted(grading: Grading, samples: Floats = NODES, complex: CellComplex = ONE_CELL) -> tuple[Floats, Floats, Floats]:
    """Points, normals (patches, m, m, 3) and thickness (patches, m, m) of the exact wall."""
    parts = [part for _, part in offset_patches(complex, grading, samples)]
    shape = (-1, len(samples), len(samples))
    points, normals = (np.concatenate([getattr(p, name) for p in parts]) for name in ("points", "normals"))
    thickness = np.concatenate([p.thickness for p in parts])
    return points.reshape(*shape, 3), normals.reshape(*shape, 3), thickness.reshape(shape)


def differentiated_normals(points: Floats) -> Floats:
    rate = differentiation_matrix(NODES)
    area = np.cross(np.einsum("ab,pbvc->pavc", rate, points), np.einsum("ab,pubc->puac", rate, points))
    return np.asarray(area / np.linalg.norm(area, axis=-1, keepdims=True))


def wavy(x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Floats]:
    return x + 0.5 * np.sin(y / 4), y + 0.1 * z, z + 0.03 * x * y / L


VARIED = {
    "flat": Grading(L, 0.5),
    "stretch": Grading(L, 0.5, map=affine(np.diag([2, 1, 0.5]))),
    "shear": Grading(L, 0.5, map=affine([[1, 0.7, 0], [0, 1, -0.4], [0.3, 0, 1]], known=False)),
    "cylinder": Grading(L, 0.5, map=Cylinder(2 * L).over(SIZE)),
    "sphere": Grading(L, 0.5, map=Sphere(2 * L, 70).over(SIZE)),
    "twist": Grading(L, 0.5, map=Twist(-60).over(SIZE)),
    "bend": Grading(L, 0.5, map=Bend(45).over(SIZE)),
    "wavy": Grading(L, 0.5, map=SpaceMap(wavy)),
    "scale": Grading(L, 0.5, scale_field=field("1 + 0.05*x + 0.01*y*z/8")),
    "constant scale": Grading(L, 0.5, scale_field=1.7),
    "scale and map": Grading(L, 0.5, scale_field=field("1 + 0.03*x - 0.02*z"), map=Twist(40).over(SIZE)),
}
FLAT_POINTS, FLAT_NORMALS, _ = fitted(VARIED["flat"])


@pytest.mark.parametrize("name", VARIED)
def test_normals_are_those_of_the_surface_that_was_carried(name: str) -> None:
    points, normals, _ = fitted(VARIED[name])
    np.testing.assert_allclose(np.linalg.norm(normals, axis=-1), 1, rtol=1e-14)
    # What the derivatives of the polynomial through the points err by in flat space, several times.
    np.testing.assert_allclose(normals, differentiated_normals(points), rtol=0, atol=2e-6)


def test_flat_space_is_handed_through() -> None:
    points, normals = FLAT_POINTS.reshape(-1, 3), FLAT_NORMALS.reshape(-1, 3)
    part = Grading(L, field("1 + 0.1*x")).lay(points, normals)
    np.testing.assert_array_equal(part.points, points)
    np.testing.assert_array_equal(part.normals, normals)
    np.testing.assert_array_equal(part.thickness, 1 + 0.1 * points[:, 0])


@settings(max_examples=15)
@given(ANGLES, SHIFTS, st.booleans())
def test_a_rigid_motion_moves_the_wall_and_leaves_its_thickness(angles: Any, shift: Any, known: bool) -> None:
    turn = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    for wall in ({"thickness": field("0.5 + 0.05*x")}, {"density": field("0.2 + 0.01*y")}):
        still, moved = Grading(L, **wall), Grading(L, **wall, map=affine(turn, shift, known))
        (points, normals, thickness), after = fitted(still, NODES[::6]), fitted(moved, NODES[::6])
        np.testing.assert_allclose(after[0], points @ turn.T + shift, rtol=0, atol=1e-12 * 200)
        np.testing.assert_allclose(after[1], normals @ turn.T, rtol=0, atol=1e-9)
        np.testing.assert_allclose(after[2], thickness, rtol=1e-9)


@settings(max_examples=15)
@given(st.floats(0.1, 10), st.floats(0.01, 0.9))
def test_a_constant_scale_makes_a_larger_lattice_of_the_same_density(scale: float, density: float) -> None:
    thickness = exact_measures(ONE_CELL, Grading(L, density=density)).mean_thickness
    scaled = exact_measures(ONE_CELL, Grading(L, density=density, scale_field=scale))
    assert scaled.volume == pytest.approx(scale**3 * density * L**3, rel=2e-8)
    assert scaled.mean_thickness == pytest.approx(scale * thickness, rel=1e-12)
    assert block_volume(CELLS, Grading(L, density=density, scale_field=scale)) == pytest.approx((scale * L) ** 3)


@pytest.mark.parametrize("scale", [0.5, 3])
def test_a_constant_scale_leaves_the_thickness_as_asked_for(scale: float) -> None:
    requested = field("0.3 + 0.02*x")
    points, _, thickness = fitted(Grading(L, requested, scale_field=scale))
    np.testing.assert_allclose(points, scale * FLAT_POINTS, rtol=1e-14)
    np.testing.assert_array_equal(thickness, 0.3 + 0.02 * FLAT_POINTS[..., 0])
    # The tube formula of a lattice that large.
    volume = exact_measures(ONE_CELL, Grading(L, 0.3, scale_field=scale)).volume
    assert volume == pytest.approx(TUBE.density(0.3 / (scale * L)) * (scale * L) ** 3, rel=1e-8)


@pytest.mark.parametrize("name", ["thickness", "density", "scale_field"])
def test_fields_are_asked_in_the_lattices_own_space(name: str) -> None:
    places: list[Floats] = []

    def requested(x: Floats, y: Floats, z: Floats) -> Floats:
        places.append(np.stack([x, y, z]))
        return np.full_like(x, 0.5)

    wall: dict[str, Any] = {name: Field(requested, "asked")}
    if name == "scale_field":
        wall["thickness"] = 0.5
    fitted(Grading(L, **wall, map=affine(2 * np.eye(3), (1e3, 1e3, 1e3))), NODES[::6])
    reached = np.concatenate(places, axis=1)
    assert reached.min() > -0.251 * L
    assert reached.max() < 1.251 * L


def test_the_scale_field_comes_before_the_map() -> None:
    scale, space = field("1 + 0.03*x - 0.02*z"), Twist(40).over(SIZE)

    def both(x: Floats, y: Floats, z: Floats) -> Any:
        factor = 1 + 0.03 * x - 0.02 * z
        return space.function(factor * x, factor * y, factor * z)

    for wall in ({"thickness": field("0.5 + 0.05*x")}, {"density": field("0.2 + 0.01*y")}):
        stages = fitted(Grading(L, **wall, scale_field=scale, map=space))
        for apart, at_once in zip(stages, fitted(Grading(L, **wall, map=SpaceMap(both))), strict=True):
            np.testing.assert_allclose(apart, at_once, rtol=0, atol=1e-7)


@pytest.mark.parametrize(
    "space",
    [
        affine(np.diag([2, 1, 1])),
        affine(np.diag([0.4, 1, 3])),
        affine([[1, 0.7, 0], [0, 1, -0.4], [0.3, 0, 1]]),
        Cylinder(2 * L).over(SIZE),
        Cylinder(3 * L, 30).over(SIZE),
        Bend(40).over(SIZE),
    ],
    ids=["stretch", "squeeze", "shear", "cylinder", "narrow cylinder", "bend"],
)
def test_a_thin_wall_takes_up_the_density_asked_for_however_the_map_stretches(space: SpaceMap) -> None:
    # These maps stretch evenly, or linearly about the block's middle: the mean over the surface is the block's.
    def error(density: float) -> float:
        grading = Grading(L, density=density, map=space)
        return exact_measures(ONE_CELL, grading).volume / block_volume(CELLS, grading) / density - 1

    assert abs(error(0.01)) < 1e-4
    assert np.log2(error(0.08) / error(0.04)) == pytest.approx(2, abs=0.05)


def test_thickness_of_a_density_is_stretched_with_the_space_across_the_wall() -> None:
    plain, normals = (fitted(Grading(L, density=0.3))[2], FLAT_NORMALS)
    stretched = fitted(Grading(L, density=0.3, map=affine(np.diag([2, 1, 1]))))[2]
    # Two parallel planes with normal n, stretched along x by 2.
    across = 1 / np.linalg.norm(normals * [0.5, 1, 1], axis=-1)
    np.testing.assert_allclose(stretched, plain * across, rtol=1e-13)


BAD: dict[str, tuple[Grading, str, str]] = {
    "negative thickness": (Grading(L, field("0.5 - 0.2*x")), "thickness", "at least"),
    "no thickness": (Grading(L, field("0*x")), "thickness", "at least"),
    "thin": (Grading(L, field("0.9999e-4 + 0*x")), "thickness", "at least"),
    "no density": (Grading(L, density=field("0.5 - 0.2*x")), "density", "above"),
    "density too thin": (Grading(L, density=1e-7), "density", "at least"),
    "dense": (Grading(L, density=field("0.5 + 0.1*x")), "density", "below"),
    "negative scale": (Grading(L, 0.5, scale_field=field("1 - 0.3*x")), "scale_field", "above"),
    "scale that folds": (Grading(L, 0.5, scale_field=field("exp(-x/2)")), "scale_field", "above"),
    "mirror": (Grading(L, 0.5, map=affine(np.diag([-1, 1, 1]))), "map", "above"),
    "fold": (Grading(L, 0.5, map=SpaceMap(lambda x, y, z: ((x - 3) ** 2, y, z))), "map", "above"),
    "flat map": (Grading(L, 0.5, map=affine(np.diag([1, 1, 0]))), "map", "above"),
}
# What the value and the limit are of, as a function of the worst place.
VALUES: dict[str, Callable[[float, float, float], float]] = {
    "negative thickness": lambda x, y, z: 0.5 - 0.2 * x,
    "no thickness": lambda x, y, z: 0.0,
    "thin": lambda x, y, z: 0.9999e-4,
    "no density": lambda x, y, z: 0.5 - 0.2 * x,
    "dense": lambda x, y, z: 0.5 + 0.1 * x,
    "negative scale": lambda x, y, z: 1 - 0.3 * x,
    # det (s I + p grad s^T) = s^2 (s + p . grad s)
    "scale that folds": lambda x, y, z: np.exp(-1.5 * x) * (1 - x / 2),
    "mirror": lambda x, y, z: -1.0,
    "fold": lambda x, y, z: 2 * (x - 3),
    "flat map": lambda x, y, z: 0.0,
}


@pytest.mark.parametrize(("scale", "accepted", "limit"), [("1e300", "at most", 1e5), ("1e-300", "at least", 1e-2)])
@pytest.mark.parametrize("varies", ["", " + 0*x", "*(1 + x*x)"])
def test_cells_are_scaled_to_no_other_sizes_than_can_be_given(
    scale: str, accepted: str, limit: float, varies: str
) -> None:
    with pytest.raises(SelfIntersectionError) as caught:
        fitted(Grading(L, density=0.3, scale_field=field(f"{scale}{varies}") if varies else float(scale)))
    assert (caught.value.parameter, caught.value.accepted) == ("scale_field", accepted)
    assert caught.value.limit * L == pytest.approx(limit)


@pytest.mark.parametrize("name", BAD)
def test_what_cannot_be_built_is_refused_with_the_worst_place(name: str) -> None:
    grading, parameter, accepted = BAD[name]
    with pytest.raises(
        SelfIntersectionError, match=rf"^{parameter}.* at \(x, y, z\) = .* expected {accepted} "
    ) as caught:
        fitted(grading)
    error = caught.value
    assert (error.parameter, error.accepted) == (parameter, accepted)
    assert isinstance(error, ParameterError)
    assert "\n" not in str(error)
    assert error.limit == {"below": TUBE.max_density, "at least": THINNEST_WALL, "above": 0}[accepted]
    assert error.value >= error.limit if accepted == "below" else error.value <= error.limit
    if name in VALUES:
        assert error.value == pytest.approx(VALUES[name](*error.place), rel=1e-5, abs=1e-9)
    # The place is one that was looked at.
    assert np.linalg.norm(FLAT_POINTS.reshape(-1, 3) - error.place, axis=1).min() < 1e-12


@pytest.mark.parametrize("name", BAD)
def test_refusals_can_be_sent_between_processes(name: str) -> None:
    with pytest.raises(SelfIntersectionError) as caught:
        fitted(BAD[name][0])
    again = pickle.loads(pickle.dumps(caught.value))
    assert type(again) is SelfIntersectionError
    assert str(again) == str(caught.value)
    assert vars(again) == vars(caught.value)


def test_the_thinnest_wall_and_just_under_the_largest_density_pass() -> None:
    np.testing.assert_array_equal(fitted(Grading(L, field(f"{THINNEST_WALL!r} + 0*x")))[2], THINNEST_WALL)
    fitted(Grading(L, density=float(np.nextafter(TUBE.max_density, 0))))
    with pytest.raises(SelfIntersectionError, match="the density at which the wall meets itself"):
        fitted(Grading(L, density=TUBE.max_density))


@pytest.mark.parametrize("parameter", ["thickness", "density", "scale_field"])
@pytest.mark.parametrize("bad", [lambda x, y, z: x * np.nan, lambda x, y, z: 1j * x, lambda x, y, z: x[:-1]])
def test_a_field_that_gives_no_finite_numbers_is_refused_by_its_name(parameter: str, bad: Any) -> None:
    wall: dict[str, Any] = {parameter: Field(bad, "bad")}
    if parameter == "scale_field":
        wall["thickness"] = 0.5
    with pytest.raises(ParameterError, match=f"^{parameter} = bad: expected "):
        fitted(Grading(L, **wall))


def test_only_a_constant_wall_in_flat_space_is_uniform() -> None:
    assert Grading(L, 0.5).uniform
    assert not any(VARIED[name].uniform for name in VARIED if name != "flat")
    assert not Grading(L, field("0.5 + x")).uniform
    assert not Grading(L, density=field("0.5 + x")).uniform


def test_a_map_joins_the_blocks_ends_unless_a_scale_parts_them() -> None:
    ring = Cylinder(L, 360).over(SIZE)
    assert Grading(L, 0.5, map=ring).closed == (True, False, False)
    assert not any(Grading(L, 0.5).closed)
    assert not any(Grading(L, 0.5, scale_field=field("1 + x"), map=ring).closed)

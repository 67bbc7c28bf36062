"""The maps that have a name: their geometry, when they close, and how they are spelled."""

from __future__ import annotations

import re
from math import cos, inf, nan, pi, radians, tau
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad import Lattice
from gyroid_cad.errors import ParameterError, SelfIntersectionError
from gyroid_cad.maps import Bend, Cylinder, Sphere, Twist
from gyroid_cad.maps.block import MAPS, parse_map
from gyroid_cad.maps.space import BlockMap, Size, SpaceMap, carried, differences

Floats = NDArray[np.float64]

LENGTHS = st.floats(1, 200)
SIZES = st.tuples(LENGTHS, LENGTHS, LENGTHS)
RADII = st.floats(1, 1e4)
TURNS = st.floats(0.1, 360)
TWISTS = st.floats(-720, 720)
BENDS = st.floats(-360, 360).filter(lambda angle: abs(angle) > 0.1)
ROUNDS = (Cylinder, Sphere)
UNIT_CUBE = np.random.default_rng(5).uniform(0, 1, (3, 50))


@st.composite
def block_maps(draw: st.DrawFn) -> BlockMap:
    return draw(
        st.one_of(*(st.builds(kind, RADII, TURNS) for kind in ROUNDS), st.builds(Twist, TWISTS), st.builds(Bend, BENDS))
    )


def inside(size: Size) -> Floats:
    return UNIT_CUBE * np.array(size)[:, np.newaxis]


def at(space: SpaceMap, points: Floats) -> tuple[Floats, Floats]:
    """Images and exact Jacobian, (3, n) and (3, 3, n)."""
    return carried("map", space, points, 1e-5 * float(np.ptp(points)))


def metric(jacobian: Floats) -> Floats:
    return np.asarray(np.einsum("kin,kjn->nij", jacobian, jacobian))


def determinant(jacobian: Floats) -> Floats:
    return np.asarray(np.linalg.det(np.moveaxis(jacobian, -1, 0)))


def plane(size: Size, axis: int, height: float) -> Floats:
    """Points of the block's layer at a height along an axis."""
    points = inside(size)
    points[axis] = height
    return points


@given(block_maps(), SIZES)
def test_jacobians_are_the_derivatives_of_their_maps(block_map: BlockMap, size: Size) -> None:
    points, space = inside(size), block_map.over(size)
    images, jacobian = at(space, points)

    def function(places: Floats) -> Floats:
        return np.stack([np.broadcast_to(c, places[0].shape) for c in space.function(*places)])

    # Far less than the length over which the Jacobian itself changes.
    step = 1e-5 * min(*size, getattr(block_map, "radius", inf))
    taken = differences(function, points, step)
    scale = np.abs(jacobian).max()
    rounding = np.finfo(float).eps * np.abs(images).max() / step
    np.testing.assert_allclose(taken, jacobian, rtol=0, atol=1e-7 * scale + 10 * rounding)


@given(RADII, TURNS, SIZES)
def test_a_cylinder_stretches_space_by_its_own_radius_over_the_first(radius: float, angle: float, size: Size) -> None:
    points = inside(size)
    _, jacobian = at(Cylinder(radius, angle).over(size), points)
    rate = radians(angle) / size[0]
    np.testing.assert_allclose(determinant(jacobian), rate * (radius + points[2]), rtol=1e-12)


@given(RADII, TURNS, SIZES)
def test_a_sphere_stretches_space_as_spherical_coordinates_do(radius: float, angle: float, size: Size) -> None:
    points = inside(size)
    _, jacobian = at(Sphere(radius, angle).over(size), points)
    latitude, out = (points[1] - size[1] / 2) / radius, radius + points[2]
    expected = radians(angle) / size[0] / radius * out**2 * np.cos(latitude)
    np.testing.assert_allclose(determinant(jacobian), expected, rtol=1e-11, atol=1e-13 * np.abs(expected).max())


@given(TWISTS, SIZES)
def test_a_twist_keeps_volume_and_every_layers_lengths(angle: float, size: Size) -> None:
    points = inside(size)
    images, jacobian = at(Twist(angle).over(size), points)
    np.testing.assert_allclose(determinant(jacobian), 1, rtol=1e-12)
    np.testing.assert_allclose(metric(jacobian)[:, :2, :2], np.broadcast_to(np.eye(2), (50, 2, 2)), atol=1e-14)
    np.testing.assert_array_equal(images[2], points[2])


def test_a_twist_may_turn_about_any_upright_axis_and_leaves_that_where_it_is() -> None:
    twist = Twist(angle=90, x=1, y=-2)
    axis = np.array([[1.0, 1.0], [-2.0, -2.0], [0.0, 10.0]])
    np.testing.assert_allclose(at(twist.over((10.0, 10.0, 10.0)), axis)[0], axis, atol=1e-12)
    beside = at(twist.over((10.0, 10.0, 10.0)), np.array([[4.0], [-2.0], [10.0]]))[0]
    np.testing.assert_allclose(beside, [[1.0], [1.0], [10.0]], atol=1e-12)
    assert parse_map(str(twist)) == twist == parse_map("twist:angle=90,x=1,y=-2")


@given(TWISTS, SIZES)
def test_a_twist_turns_the_top_by_its_angle_against_the_bottom(angle: float, size: Size) -> None:
    middle = np.array([size[0] / 2, size[1] / 2])[:, np.newaxis]
    bottom, top = (at(Twist(angle).over(size), plane(size, 2, z))[0][:2] - middle for z in (0.0, size[2]))
    turned = (bottom[0] + 1j * bottom[1]) * np.exp(1j * radians(angle))
    np.testing.assert_allclose(top[0] + 1j * top[1], turned, rtol=0, atol=1e-12 * max(size))


@given(BENDS, SIZES)
def test_a_bend_keeps_the_middle_layers_lengths_and_stretches_the_others_evenly(angle: float, size: Size) -> None:
    points, level = inside(size), size[2] / 2
    space = Bend(angle).over(size)
    _, layer = at(space, plane(size, 2, level))
    np.testing.assert_allclose(metric(layer), np.broadcast_to(np.eye(3), (50, 3, 3)), rtol=0, atol=1e-13)
    curvature = radians(angle) / size[0]
    expected = 1 - (points[2] - level) * curvature
    np.testing.assert_allclose(determinant(at(space, points)[1]), expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@given(BENDS, SIZES)
def test_a_bend_turns_its_ends_by_the_angle_between_them(angle: float, size: Size) -> None:
    ends = np.array([[0, size[0]], [size[1] / 2] * 2, [size[2] / 2] * 2])
    along = at(Bend(angle).over(size), ends)[1][:, 0]
    turn = np.exp(1j * radians(angle) / 2)
    np.testing.assert_allclose(along[0] + 1j * along[2], [1 / turn, turn], rtol=0, atol=1e-12)
    np.testing.assert_allclose(along[1], 0, atol=1e-15)


@given(BENDS, SIZES)
def test_bending_down_is_bending_up_seen_upside_down(angle: float, size: Size) -> None:
    points = inside(size)
    flipped = points * np.array([[1], [1], [-1]]) + np.array([[0], [0], [size[2]]])
    up, down = at(Bend(angle).over(size), points)[0], at(Bend(-angle).over(size), flipped)[0]
    down = down * np.array([[1], [1], [-1]]) + np.array([[0], [0], [size[2]]])
    np.testing.assert_allclose(up, down, rtol=0, atol=1e-11 * np.abs(up).max())


@given(RADII, SIZES)
def test_a_cylinder_keeps_all_lengths_on_its_own_radius(radius: float, size: Size) -> None:
    assume(size[0] < 0.99 * tau * radius)
    images, jacobian = at(Cylinder(radius).over(size), plane(size, 2, 0.0))
    np.testing.assert_allclose(metric(jacobian), np.broadcast_to(np.eye(3), (50, 3, 3)), rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.hypot(images[0], images[1]), radius, rtol=1e-14)


@given(RADII, SIZES)
def test_a_sphere_keeps_lengths_along_its_equator_and_meridians(radius: float, size: Size) -> None:
    assume(size[0] < 0.99 * tau * radius)
    space = Sphere(radius).over(size)
    on_equator = plane(size, 2, 0.0)
    on_equator[1] = size[1] / 2
    np.testing.assert_allclose(metric(at(space, on_equator)[1]), np.broadcast_to(np.eye(3), (50, 3, 3)), atol=1e-13)
    points = plane(size, 2, 0.0)
    images, jacobian = at(space, points)
    latitude = (points[1] - size[1] / 2) / radius
    expected = np.stack([np.cos(latitude) ** 2, np.ones(50), np.ones(50)], axis=-1)[..., np.newaxis] * np.eye(3)
    np.testing.assert_allclose(metric(jacobian), expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(images, axis=0), radius, rtol=1e-14)


@pytest.mark.parametrize("kind", ROUNDS)
@given(RADII, TURNS, SIZES)
def test_z_runs_outwards_and_x_takes_up_the_angle(kind: Any, radius: float, angle: float, size: Size) -> None:
    space = kind(radius, angle).over(size)
    low, high = (at(space, plane(size, 2, z))[0] for z in (0.0, size[2]))
    np.testing.assert_allclose(high - low, low * np.where([[1], [1], [kind is Sphere]], size[2] / radius, 0), atol=1e-9)
    ends = np.array([[0, size[0]], [size[1] / 2] * 2, [0, 0]])
    x, y, _ = at(space, ends)[0]
    turned = np.exp(1j * radians(angle))
    np.testing.assert_allclose((x + 1j * y) / radius, [1, turned], rtol=0, atol=1e-12)


@given(block_maps(), SIZES)
def test_space_is_turned_inside_out_only_past_the_axis_or_the_poles(block_map: BlockMap, size: Size) -> None:
    points = inside(size)
    positive = np.ones(50, dtype=bool)
    if isinstance(block_map, Sphere):
        positive = np.cos((points[1] - size[1] / 2) / block_map.radius) > 0
    if isinstance(block_map, Bend):
        positive = (points[2] - size[2] / 2) * radians(block_map.angle) / size[0] < 1
    np.testing.assert_array_equal(determinant(at(block_map.over(size), points)[1]) > 0, positive)


@pytest.mark.parametrize("kind", ROUNDS)
@given(RADII, st.floats(-9.9e-4, 9.9e-4), LENGTHS, LENGTHS)
def test_a_block_about_as_long_as_the_circumference_closes(
    kind: Any, radius: float, off: float, width: float, height: float
) -> None:
    size = (tau * radius * (1 + off), width, height)
    space = kind(radius).over(size)
    assert space.closed == (True, False, False)
    near, far = (at(space, plane(size, 0, x))[0] for x in (0.0, size[0]))
    np.testing.assert_allclose(near, far, rtol=0, atol=1e-14 * (radius + height + width) * 10)


@pytest.mark.parametrize("kind", ROUNDS)
@given(RADII, st.floats(1.1e-3, 20), LENGTHS)
def test_a_longer_block_is_refused_with_the_radius_that_would_do(
    kind: Any, radius: float, excess: float, height: float
) -> None:
    size = (tau * radius * (1 + excess), height, height)
    with pytest.raises(ParameterError, match=r"^map = .*angle=360 to close them round this one") as caught:
        kind(radius).over(size)
    enough = float(re.findall(r"radius of at least (\S+) mm", str(caught.value))[0])
    assert enough == pytest.approx(size[0] / tau, rel=1e-5)
    assert kind(enough).over(size).closed == (True, False, False)
    assert kind(radius, 360).over(size).closed == (True, False, False)


@pytest.mark.parametrize("kind", ROUNDS)
@given(RADII, st.floats(0.05, 0.9989), TURNS.filter(lambda angle: angle < 360))
def test_a_shorter_block_stays_open(kind: Any, radius: float, part: float, angle: float) -> None:
    size = (tau * radius * part, 5.0, 5.0)
    assert not any(kind(radius).over(size).closed)
    assert not any(kind(radius, angle).over(size).closed)


@pytest.mark.parametrize("block_map", [Cylinder(3, 360), Sphere(3, 360), Bend(360), Bend(-360)], ids=str)
def test_a_full_turn_joins_the_blocks_ends(block_map: BlockMap) -> None:
    size = (100.0, 7.0, 5.0)
    space = block_map.over(size)
    assert space.closed == (True, False, False)
    near, far = (at(space, plane(size, 0, x)) for x in (0.0, size[0]))
    np.testing.assert_allclose(near[0], far[0], rtol=0, atol=1e-13)
    np.testing.assert_allclose(near[1], far[1], rtol=0, atol=1e-13)


@pytest.mark.parametrize("block_map", [Twist(360), Twist(0), Bend(359.9), Bend(-90)], ids=str)
def test_other_maps_leave_the_block_open(block_map: BlockMap) -> None:
    assert not any(block_map.over((10.0, 10.0, 10.0)).closed)


@given(st.one_of(block_maps(), st.builds(Cylinder, RADII), st.builds(Sphere, RADII)))
def test_a_map_spelled_and_read_again_is_the_same(block_map: BlockMap) -> None:
    again = parse_map(str(block_map))
    assert again == block_map
    assert hash(again) == hash(block_map)
    assert str(again) == str(block_map)


def test_spaces_and_the_order_of_parameters_do_not_matter() -> None:
    assert parse_map(" cylinder : angle = 90 , radius = 3e1, ") == Cylinder(30, 90)


def test_a_lattice_takes_a_map_by_its_spelling() -> None:
    spelled, made = (Lattice((1, 1, 1), 10.0, 0.8, map=given) for given in ("cylinder:radius=30", Cylinder(30)))
    assert spelled == made
    assert set(MAPS) == {"cylinder", "sphere", "twist", "bend"}


@pytest.mark.parametrize(
    ("text", "accepted"),
    [
        *((text, r"one of cylinder:.*sphere:.*twist:.*bend:") for text in ("", "torus:radius=3", "Bend:angle=3")),
        *((text, "radius of cylinder to be given") for text in ("cylinder", "cylinder:", "cylinder:angle=90")),
        *((text, "angle of (twist|bend) to be given") for text in ("twist", "bend:,,")),
        ("cylinder:radius=3,height=2", "radius and angle of cylinder, each once, not 'height=2'"),
        ("cylinder:radius=3,radius=3", "radius and angle of cylinder, each once, not 'radius=3'"),
        ("twist:radius=3", "angle and x and y of twist, each once, not 'radius=3'"),
        *((f"twist:angle=3,x={bad}", "x: .*mm") for bad in ("nan", "inf", "1e8")),
        ("cylinder:30", "each once, not '30'"),
        *((f"sphere:radius={bad}", "a number for radius") for bad in ("", "x", "3mm", "3;angle=2", "None", "0x10")),
        *((f"cylinder:radius={bad}", "radius: .*mm") for bad in ("nan", "inf", "-inf", "0", "-3", "1e400")),
        *((f"cylinder:radius=3,angle={bad}", "angle: .*360") for bad in ("0", "-1", "360.01", "1e9")),
        *((f"bend:angle={bad}", "angle: -360 to 360 degrees, not 0") for bad in ("0", "-0", "361", "-361")),
        *((f"twist:angle={bad}", "angle: .*degrees") for bad in ("nan", "inf")),
        ("cylinder:radius=3\n4", "a number for radius"),
    ],
)  # fmt: skip
def test_a_bad_spelling_is_refused_in_one_line(text: str, accepted: str) -> None:
    with pytest.raises(ParameterError, match=rf"^map = .*: expected .*{accepted}") as caught:
        Lattice((1, 1, 1), 10.0, 0.8, map=text)
    assert caught.value.parameter == "map"
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ROUNDS)
@pytest.mark.parametrize("bad", [nan, inf, -inf, 0, -1.0, "3", True, None, 3j, [3], 10**400, -(10**400)])
def test_a_radius_is_a_positive_number(kind: Any, bad: Any) -> None:
    with pytest.raises(ParameterError, match=r"^radius = .*mm"):
        kind(bad)


@pytest.mark.parametrize("bad", [nan, inf, "3", True, None, 3j, 10**400])
def test_an_angle_is_a_finite_number(bad: Any) -> None:
    for make in (Twist, Bend, *([] if bad is None else [lambda angle: Cylinder(3, angle), lambda a: Sphere(3, a)])):
        with pytest.raises(ParameterError, match=r"^angle = .*degrees"):
            make(bad)


@pytest.mark.parametrize("bad", [0, -1, 360.0001, 720])
def test_a_round_takes_up_part_of_a_turn(bad: float) -> None:
    for kind in ROUNDS:
        with pytest.raises(ParameterError, match=r"^angle = .*360"):
            kind(3, bad)


def test_a_block_past_the_axis_or_the_poles_is_refused() -> None:
    # Patches hang over the block by a quarter of a cell.
    for block_map, cells in ((Cylinder(2.0, 90), (1, 1, 1)), (Sphere(40 / pi / cos(0.1)), (1, 4, 1))):
        lattice = Lattice(cells, 10.0, 0.8, map=block_map)
        with pytest.raises(SelfIntersectionError, match=r"map: Jacobian determinant .* turned inside out"):
            lattice.exact_volume  # noqa: B018

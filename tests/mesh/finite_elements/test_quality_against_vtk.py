"""The measures of elements against VTK's own (the Verdict library), element by element."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
import vtk
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.mesh.finite_elements.quality import HEXAHEDRA, element_measures, hexahedron_nodes, shape_gradients

Floats = NDArray[np.float64]

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
CUBE = (hexahedron_nodes(8) + 1) / 2
FACES = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7))
UNDEFINED = 1e30
# Near 180 degrees VTK's arc cosine loses half its digits: there the cosines are compared.
CLOSE = {"rtol": 1e-12, "atol": 1e-12}

coordinates = st.floats(-1, 1, allow_subnormal=False)
QUADRILATERAL_FILTERS = {
    "scaled_jacobian": "ScaledJacobian",
    "aspect_ratio": "AspectRatio",
    "edge_ratio": "EdgeRatio",
    "skew": "Skew",
    "warpage": "Warpage",
    "min_angle": "MinAngle",
    "max_angle": "MaxAngle",
}


def vtk_cell(kind: type, points: Floats) -> vtk.vtkCell:
    cell = kind()
    for number, point in enumerate(points.tolist()):
        cell.GetPointIds().SetId(number, number)
        cell.GetPoints().SetPoint(number, *point)
    return cell


def vtk_quadrilaterals(corners: Floats) -> dict[str, Floats]:
    """Of shape (m, 4, 3)."""
    cells = [vtk_cell(vtk.vtkQuad, points) for points in corners]
    return {
        name: np.array([getattr(vtk.vtkMeshQuality, f"Quad{measure}")(cell) for cell in cells])
        for name, measure in QUADRILATERAL_FILTERS.items()
    }


def vtk_hexahedra(corners: Floats, measure: str) -> Floats:
    """Of shape (m, 8, 3)."""
    return np.array(
        [getattr(vtk.vtkMeshQuality, f"Hex{measure}")(vtk_cell(vtk.vtkHexahedron, points)) for points in corners]
    )


def measures_of(corners: Floats) -> dict[str, Floats]:
    """Of elements that share no node; shape (m, nodes, 3)."""
    return element_measures(
        corners.reshape(-1, 3), np.arange(corners.shape[0] * corners.shape[1]).reshape(corners.shape[:2])
    )


def perturbed(element: Floats, count: int, seed: int) -> Floats:
    """Copies stretched, moved, every node shifted by up to more than the element; shape (m, nodes, 3)."""
    random = np.random.default_rng(seed)
    amounts = np.geomspace(1e-6, 1.5, count)[:, np.newaxis, np.newaxis]
    stretch = np.exp(random.uniform(-2, 2, (count, 1, 3)))
    return (element + amounts * random.uniform(-1, 1, (count, *element.shape))) * stretch + random.normal(
        size=(count, 1, 3)
    )


def assert_same_angles(ours: Floats, theirs: Floats) -> None:
    np.testing.assert_allclose(ours, theirs, atol=2e-6)
    np.testing.assert_allclose(np.cos(np.radians(ours)), np.cos(np.radians(theirs)), **CLOSE)


def assert_agrees_on_quadrilaterals(corners: Floats) -> None:
    """On any without an edge of no length."""
    ours, theirs = measures_of(corners), vtk_quadrilaterals(corners)
    for name in ("scaled_jacobian", "aspect_ratio", "edge_ratio", "skew"):
        np.testing.assert_allclose(ours[name], theirs[name], **CLOSE, err_msg=name)
    # VTK's warpage lacks the manual's "1 -".
    np.testing.assert_allclose(ours["warpage"], 1 - theirs["warpage"], **CLOSE)
    for name in ("min_angle", "max_angle"):
        assert_same_angles(ours[name], theirs[name])


def test_quadrilaterals_agree_with_vtk_from_square_to_crossed() -> None:
    corners = perturbed(SQUARE, 1500, 1)
    ours = measures_of(corners)
    assert ours["scaled_jacobian"].min() < -0.5 < 0.99 < ours["scaled_jacobian"].max()
    assert ours["max_angle"].max() > 180
    assert_agrees_on_quadrilaterals(corners)


def test_hexahedra_agree_with_vtk_from_cube_to_inverted() -> None:
    corners = perturbed(CUBE, 1500, 2)
    ours = measures_of(corners)
    assert ours["scaled_jacobian"].min() < -0.5 < 0.99 < ours["scaled_jacobian"].max()
    for name, measure in (("scaled_jacobian", "ScaledJacobian"), ("aspect_ratio", "MaxEdgeRatio"), ("skew", "Skew")):
        np.testing.assert_allclose(ours[name], vtk_hexahedra(corners, measure), **CLOSE, err_msg=name)


def test_warpage_and_angles_of_a_hexahedron_are_those_of_its_worst_face() -> None:
    corners = perturbed(CUBE, 500, 3)
    ours = measures_of(corners)
    faces = [vtk_quadrilaterals(corners[:, face]) for face in FACES]
    np.testing.assert_allclose(ours["warpage"], 1 - np.min([face["warpage"] for face in faces], axis=0), **CLOSE)
    assert_same_angles(ours["min_angle"], np.min([face["min_angle"] for face in faces], axis=0))
    assert_same_angles(ours["max_angle"], np.max([face["max_angle"] for face in faces], axis=0))


def rotations_of_the_cube() -> list[NDArray[np.int64]]:
    """The 24 renumberings of a hexahedron that turn it."""
    nodes = hexahedron_nodes(8)
    turns = [
        np.eye(3)[list(order)] * signs
        for order in permutations(range(3))
        for signs in product((-1, 1), repeat=3)
        if np.linalg.det(np.eye(3)[list(order)] * signs) > 0
    ]
    return [np.argmax((nodes @ turn.T) @ nodes.T == 3, axis=1) for turn in turns]


def test_vtk_takes_the_longest_of_six_edges_only_so_its_edge_ratio_agrees_once_all_edges_have_had_their_turn() -> None:
    corners = perturbed(CUBE, 300, 4)
    ours = measures_of(corners)["edge_ratio"]
    turned = [vtk_hexahedra(corners[:, order], "EdgeRatio") for order in rotations_of_the_cube()]
    assert np.any(turned[0] < 0.99 * ours)
    np.testing.assert_allclose(ours, np.max(turned, axis=0), **CLOSE)


def test_the_determinant_ratio_of_a_hexahedron_is_no_more_than_vtks_of_the_corners_alone() -> None:
    corners = perturbed(CUBE, 600, 5)
    sound = vtk_hexahedra(corners, "ScaledJacobian") > 0.1
    ours = measures_of(corners)["determinant_ratio"][sound]
    theirs = vtk_hexahedra(corners[sound], "NodalJacobianRatio")
    assert sound.sum() > 100
    assert np.all(ours <= theirs * (1 + 1e-12))
    # A trilinear map's determinant is nearly always extreme at a corner.
    assert np.median(theirs - ours) < 1e-12


@settings(max_examples=150)
@given(st.lists(coordinates, min_size=12, max_size=12).map(lambda values: np.reshape(values, (1, 4, 3))))
@example((SQUARE * [1, 0, 0])[np.newaxis])
@example(SQUARE[np.newaxis, ::-1])
@example(SQUARE[np.newaxis, [0, 1, 3, 2]])
@example(np.zeros((1, 4, 3)))
def test_every_measure_of_any_quadrilateral_is_a_number_and_without_a_warning(corners: Floats) -> None:
    with np.errstate(all="raise", under="ignore"):
        ours = measures_of(corners)
    assert all(np.isfinite(values).all() for values in ours.values())


@settings(max_examples=150)
@given(st.lists(coordinates, min_size=24, max_size=24).map(lambda values: np.reshape(values, (1, 8, 3))))
@example((CUBE * [1, 1, 0])[np.newaxis])
@example((CUBE * [1, 1, -1])[np.newaxis])
@example(CUBE[np.newaxis, [0, 0, 2, 3, 4, 5, 6, 7]])
@example(np.zeros((1, 8, 3)))
def test_every_measure_of_any_hexahedron_is_a_number_and_without_a_warning(corners: Floats) -> None:
    with np.errstate(all="raise", under="ignore"):
        ours = measures_of(corners)
    assert all(np.isfinite(values).all() for values in ours.values())


@pytest.mark.parametrize("corners", [SQUARE[[0, 1, 3, 2]], np.outer(range(4), [1, 0, 0])], ids=["crossed", "straight"])
def test_crossed_and_straight_quadrilaterals_agree_with_vtk(corners: Floats) -> None:
    assert_agrees_on_quadrilaterals(corners[np.newaxis].astype(float))


def test_a_straight_angle_is_180_degrees_here_and_less_in_vtk() -> None:
    corners = np.array([[[0, 0, 0], [1, 0, 0], [0.5, 0.5, 0], [0, 1, 0]]])
    assert measures_of(corners)["max_angle"] == pytest.approx(180, abs=1e-12)
    assert 1e-7 < 180 - vtk_quadrilaterals(corners)["max_angle"] < 1e-5


@pytest.mark.parametrize("edge", range(4))
def test_a_quadrilateral_with_an_edge_of_no_length_is_among_the_worst_whichever_edge_it_is(edge: int) -> None:
    corners = SQUARE.copy()
    corners[(edge + 1) % 4] = corners[edge]
    ours, theirs = measures_of(corners[np.newaxis]), vtk_quadrilaterals(corners[np.newaxis])
    assert ours["scaled_jacobian"] == 0
    assert (ours["min_angle"], ours["max_angle"]) == (0, 180)
    for name in ("aspect_ratio", "edge_ratio", "skew"):
        np.testing.assert_allclose(ours[name], theirs[name], **CLOSE, err_msg=name)
    np.testing.assert_allclose(ours["warpage"], 1 - theirs["warpage"], **CLOSE)
    # Verdict knows a triangle by its last two nodes alone; other collapsed ones have angles of 360 and 0.
    if edge == 2:
        assert theirs["scaled_jacobian"] > 0.5
    else:
        assert (theirs["min_angle"], theirs["max_angle"]) == (360, 0)


@pytest.mark.parametrize("edge", [(0, 1), (2, 6), (7, 4)])
def test_a_hexahedron_with_an_edge_of_no_length_has_no_scaled_jacobian_in_vtk_and_0_here(edge: tuple[int, int]) -> None:
    corners = CUBE[np.newaxis].copy()
    corners[:, edge[1]] = corners[:, edge[0]]
    ours = measures_of(corners)
    assert vtk_hexahedra(corners, "ScaledJacobian") == UNDEFINED
    assert ours["scaled_jacobian"] == 0
    assert ours["edge_ratio"] == UNDEFINED == vtk_hexahedra(corners, "EdgeRatio")
    np.testing.assert_allclose(ours["aspect_ratio"], vtk_hexahedra(corners, "MaxEdgeRatio"), **CLOSE)
    np.testing.assert_allclose(ours["skew"], vtk_hexahedra(corners, "Skew"), **CLOSE)


def test_a_flat_hexahedron_has_no_skew_and_no_aspect_ratio_as_in_vtk() -> None:
    corners = (CUBE * [1, 1, 0])[np.newaxis]
    ours = measures_of(corners)
    assert ours["skew"] == UNDEFINED == vtk_hexahedra(corners, "Skew")
    assert ours["aspect_ratio"] == UNDEFINED == vtk_hexahedra(corners, "MaxEdgeRatio")
    assert ours["scaled_jacobian"] == 0 == ours["determinant_ratio"]


@pytest.mark.parametrize(
    ("count", "kind"),
    list(zip(HEXAHEDRA, (vtk.vtkHexahedron, vtk.vtkQuadraticHexahedron, vtk.vtkTriQuadraticHexahedron), strict=True)),
)
def test_nodes_and_shape_functions_are_vtks(count: int, kind: type) -> None:
    cell = kind()
    # VTK's cube is [0, 1]^3.
    theirs = np.reshape([cell.GetParametricCoords()[i] for i in range(3 * count)], (count, 3))
    assert np.array_equal((hexahedron_nodes(count) + 1) / 2, theirs)
    places = np.random.default_rng(6).uniform(-1, 1, (20, 3))
    gradients = shape_gradients(count, places)
    for place, ours in zip(places, np.moveaxis(gradients, 1, 0), strict=True):
        derivatives = [0.0] * (3 * count)
        cell.InterpolationDerivs(((place + 1) / 2).tolist(), derivatives)
        np.testing.assert_allclose(ours, np.reshape(derivatives, (3, count)) / 2, atol=1e-14)

"""What the measures of elements mean, and what their summaries say."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.quality import (
    USUAL_BOUNDS,
    combined,
    element_measures,
    hexahedron_nodes,
    inverted,
    quality_report,
    sample_points,
    shape_gradients,
)
from gyroid_cad.mesh.finite_elements.summaries import shown_name

Floats = NDArray[np.float64]

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
CUBE = (hexahedron_nodes(8) + 1) / 2
# Nodes of a hexahedron one step further round the axis zeta.
TURNED = [1, 2, 3, 0, 5, 6, 7, 4]
MIRRORED = [4, 5, 6, 7, 0, 1, 2, 3]

matrices = st.lists(st.floats(-1, 1), min_size=9, max_size=9).map(lambda values: np.reshape(values, (3, 3)))


def measures_of(*elements: Floats) -> dict[str, Floats]:
    points = np.concatenate(elements)
    return element_measures(points, np.arange(len(points)).reshape(len(elements), -1))


def values_of(element: Floats) -> dict[str, float]:
    return {name: float(values[0]) for name, values in measures_of(element).items()}


def rough(element: Floats, seed: int, amount: float = 0.2) -> Floats:
    return element + amount * np.random.default_rng(seed).uniform(-1, 1, element.shape)


def grid_of_hexahedra(n: int, seed: int = 0, amount: float = 0.0) -> tuple[Floats, NDArray[np.int64]]:
    """n^3 unit cubes, their nodes moved at random."""
    places = np.stack(np.meshgrid(*[np.arange(n + 1.0)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    numbers = np.arange(len(places)).reshape([n + 1] * 3)
    corners = [tuple(slice(int(c), n + int(c)) for c in corner) for corner in CUBE]
    return rough(places, seed, amount), np.stack([numbers[corner].ravel() for corner in corners], axis=1)


@pytest.mark.parametrize("element", [SQUARE, CUBE, hexahedron_nodes(20), hexahedron_nodes(27)], ids=len)
def test_squares_and_cubes_are_perfect(element: Floats) -> None:
    perfect = {
        "scaled_jacobian": 1,
        "aspect_ratio": 1,
        "edge_ratio": 1,
        "skew": 0,
        "warpage": 0,
        "min_angle": 90,
        "max_angle": 90,
        "determinant_ratio": 1,
        "sampled_scaled_jacobian": 1,
    }
    values = values_of(7.3 * element + [1, 2, 3])
    assert values == pytest.approx({name: perfect[name] for name in values}, abs=1e-12)


@given(matrices.filter(lambda matrix: abs(np.linalg.det(matrix)) > 1e-3))
def test_a_parallelepiped_is_measured_by_its_three_edges(matrix: Floats) -> None:
    a, b, c = units = (matrix / np.linalg.norm(matrix, axis=0)).T
    lengths = np.linalg.norm(matrix, axis=0)
    cosines = np.abs([a @ b, b @ c, c @ a])
    values = values_of(CUBE @ matrix.T)
    assert values["scaled_jacobian"] == pytest.approx(np.linalg.det(units), abs=1e-11)
    assert values["aspect_ratio"] == pytest.approx(lengths.max() / lengths.min())
    assert values["edge_ratio"] == pytest.approx(lengths.max() / lengths.min())
    assert values["skew"] == pytest.approx(cosines.max(), abs=1e-11)
    assert values["min_angle"] == pytest.approx(np.degrees(np.arccos(cosines.max())), abs=1e-6)
    assert values["max_angle"] == pytest.approx(180 - values["min_angle"])
    assert values["warpage"] == pytest.approx(0, abs=1e-11)
    assert values["determinant_ratio"] == pytest.approx(np.sign(np.linalg.det(matrix)), abs=1e-9)


def test_a_square_folded_along_its_diagonal_is_warped_by_the_cube_of_the_angles_cosine() -> None:
    angle = np.radians(25)
    folded = np.array([[0, -1, 0], [1, 0, 0], [0, 1, 0], [-np.cos(angle), 0, np.sin(angle)]])
    assert values_of(folded)["warpage"] == pytest.approx(1 - np.cos(angle) ** 3)


@pytest.mark.parametrize("element", [SQUARE, CUBE, hexahedron_nodes(20), hexahedron_nodes(27)], ids=len)
@given(matrices, st.floats(1e-6, 1e6), st.integers(0, 1000))
def test_turning_moving_and_scaling_an_element_changes_nothing(
    element: Floats, matrix: Floats, scale: float, seed: int
) -> None:
    rotation = np.linalg.qr(matrix + 2 * np.eye(3))[0]
    rotation *= np.linalg.det(rotation)
    before = rough(element, seed)
    after = scale * (before @ rotation.T + [1, -2, 0.5])
    assert values_of(after) == pytest.approx(values_of(before), rel=1e-9, abs=1e-9)


@pytest.mark.parametrize(("element", "order"), [(SQUARE, [1, 2, 3, 0]), (SQUARE, [3, 2, 1, 0]), (CUBE, TURNED)])
@given(st.integers(0, 1000))
def test_numbering_an_element_from_another_corner_changes_nothing(element: Floats, order: list[int], seed: int) -> None:
    before = rough(element, seed)
    assert values_of(before[order]) == pytest.approx(values_of(before), rel=1e-9, abs=1e-9)


@given(st.integers(0, 1000))
def test_reflecting_a_hexahedron_or_its_numbering_turns_the_sign_of_its_determinants(seed: int) -> None:
    sound = rough(CUBE, seed, 0.1)
    for turned_over in (sound * [1, 1, -1], sound[MIRRORED]):
        before, after = measures_of(sound), measures_of(turned_over)
        assert before["scaled_jacobian"] > 0 > after["scaled_jacobian"]
        assert after["determinant_ratio"] == pytest.approx(-1)
        for name in ("aspect_ratio", "edge_ratio", "skew", "warpage", "min_angle", "max_angle"):
            assert after[name] == pytest.approx(before[name], rel=1e-9, abs=1e-9)
    parallel = CUBE @ np.array([[1, 0.3, 0], [0, 1, 0.2], [0.4, 0, 1]])
    reflected = values_of(parallel * [-1, 1, 1])
    assert reflected["scaled_jacobian"] == pytest.approx(-values_of(parallel)["scaled_jacobian"])


@pytest.mark.parametrize("count", [8, 20, 27])
def test_shape_functions_carry_linear_maps_exactly(count: int) -> None:
    matrix = np.random.default_rng(1).normal(size=(3, 3))
    gradients = shape_gradients(count, sample_points(count))
    nodes = hexahedron_nodes(count) @ matrix.T + [3, 2, 1]
    columns = gradients @ nodes
    np.testing.assert_allclose(columns, np.broadcast_to(matrix.T[:, np.newaxis], columns.shape), atol=1e-13)


@pytest.mark.parametrize("count", [20, 27])
def test_a_middle_node_past_the_quarter_of_its_edge_inverts_a_hexahedron_whose_corners_are_those_of_a_cube(
    count: int,
) -> None:
    # With the middle of the edge from -1 to 1 at m the map along it is m + x - m x^2, its rate 1 - 2 m x.
    nodes = hexahedron_nodes(count)
    middle = 8
    for place, sound in ((0.49, True), (0.51, False)):
        nodes[middle, 0] = place
        values = values_of(nodes)
        assert values["scaled_jacobian"] == pytest.approx(1)
        assert (values["determinant_ratio"] > 0) == (values["sampled_scaled_jacobian"] > 0) == sound
        assert len(inverted(nodes, [range(count)]).elements) == (not sound)


def test_inverted_elements_are_named_with_their_place_and_determinant() -> None:
    points, cells = grid_of_hexahedra(4)
    points[:, 0] *= 2
    cells[[5, 17]] = cells[[5, 17]][:, MIRRORED]
    found = inverted(points, cells)
    assert found.elements.tolist() == [5, 17]
    np.testing.assert_allclose(found.places, points[cells[[5, 17]]].mean(axis=1))
    # Half the edges' product: the cube [-1, 1]^3 has edges of 2.
    np.testing.assert_allclose(found.determinants, -2 / 8)


@pytest.mark.parametrize("height", [0.0, 1e-17])
def test_a_flat_hexahedron_counts_as_inverted_though_rounding_may_call_it_positive(height: float) -> None:
    tilted = (CUBE * [1, 1, height]) @ np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    assert inverted(tilted, [range(8)]).elements.tolist() == [0]
    assert len(inverted((CUBE * [1, 1, 1e-9]), [range(8)]).elements) == 0


def test_a_report_summarises_what_each_element_measures() -> None:
    points, cells = grid_of_hexahedra(15, 3, 0.2)
    report, measures = quality_report(points, cells), element_measures(points, cells)
    assert report.elements == len(cells)
    assert list(report.measures) == list(measures)
    for name, values in measures.items():
        summary = report.measures[name]
        given_numbers = (summary.smallest, summary.largest, summary.mean, summary.standard_deviation)
        assert given_numbers == pytest.approx((values.min(), values.max(), values.mean(), values.std()), rel=1e-12)
        inside = np.clip(values, summary.edges[0], np.nextafter(summary.edges[-1], -np.inf))
        assert np.abs(summary.counts - np.histogram(inside, summary.edges)[0]).sum() <= 2
        assert summary.counts.sum() == len(cells)
        worst = values.min() if name.endswith(("jacobian", "min_angle", "determinant_ratio")) else values.max()
        # Neighbours whose worst is the face between them are alike but for rounding.
        assert values[summary.worst_element] == pytest.approx(worst, rel=1e-8)
        np.testing.assert_allclose(summary.worst_place, points[cells[summary.worst_element]].mean(axis=0))


def test_a_mesh_reported_on_in_pieces_is_reported_on_as_a_whole() -> None:
    points, cells = grid_of_hexahedra(12, 4, 0.3)
    whole = quality_report(points, cells)
    pieces = combined(quality_report(points, cells[first : first + 100]) for first in range(0, len(cells), 100))
    assert (pieces.elements, pieces.inverted) == (whole.elements, whole.inverted)
    for name, summary in whole.measures.items():
        for field, value in summary.as_dict().items():
            assert pieces.measures[name].as_dict()[field] == pytest.approx(value, rel=1e-12), (name, field)


def test_of_elements_that_are_images_of_each_other_the_first_is_named_whatever_the_rounding() -> None:
    points, cells = grid_of_hexahedra(12, 4, 0.3)
    for seed in range(4):
        turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
        image = points @ (turn * np.linalg.det(turn)) + [9.0, 2.0, 4.0]
        images = quality_report(np.concatenate([points, image]), np.concatenate([cells, cells + len(points)]))
        for name, summary in quality_report(points, cells).measures.items():
            assert images.measures[name].worst_element == summary.worst_element, name


def test_elements_beyond_a_bound_are_counted_on_the_bad_side_of_it() -> None:
    points, cells = grid_of_hexahedra(8, 5, 0.3)
    measures = element_measures(points, cells)
    summaries = quality_report(points, cells, {"scaled_jacobian": 0.7, "skew": 0.2}).measures
    assert summaries["scaled_jacobian"].beyond == np.sum(measures["scaled_jacobian"] < 0.7) > 0
    assert summaries["skew"].beyond == np.sum(measures["skew"] > 0.2) > 0
    assert summaries["max_angle"].bound == USUAL_BOUNDS["max_angle"]


def test_elements_without_a_number_are_counted_apart_and_are_the_worst() -> None:
    points, cells = grid_of_hexahedra(2)
    cells[3] = cells[3, 0]
    report = quality_report(points, cells)
    ratio = report.measures["aspect_ratio"]
    assert (ratio.undefined, ratio.worst_element, ratio.mean, ratio.beyond) == (1, 3, 1.0, 1)
    assert (report.inverted, report.measures["scaled_jacobian"].smallest) == (1, 0)


def test_a_report_is_plain_values_that_json_takes_and_a_line_for_each_measure() -> None:
    points, cells = grid_of_hexahedra(2)
    cells[3] = cells[3, 0]
    report = quality_report(points, cells)
    assert json.loads(json.dumps(report.as_dict(), allow_nan=False)) == report.as_dict()
    assert [line.split("  ")[0] for line in str(report).splitlines()] == ["measure", *map(shown_name, report.measures)]


BAD: dict[str, tuple[Callable[[], object], str]] = {
    "no cells": (lambda: quality_report(CUBE, np.empty((0, 8), int)), "one element or more"),
    "tetrahedra": (lambda: quality_report(CUBE, [[0, 1, 2, 3, 4]]), "4, 8, 20 or 27"),
    "node numbers that are no integers": (lambda: quality_report(CUBE, [[0.0] * 8]), "node numbers"),
    "a node that does not exist": (lambda: quality_report(CUBE, [[0, 1, 2, 3, 4, 5, 6, 8]]), "from 0 to 7"),
    "points in a plane": (lambda: quality_report(CUBE[:, :2], [range(8)]), r"shape \(n, 3\)"),
    "points nowhere": (lambda: quality_report(CUBE * np.inf, [range(8)]), "finite"),
    "a bound of no measure": (lambda: quality_report(CUBE, [range(8)], {"shape": 1}), "scaled_jacobian"),
    "a bound that is none": (lambda: quality_report(CUBE, [range(8)], {"skew": np.nan}), "finite"),
    "the sign of a face": (lambda: inverted(SQUARE, [range(4)]), "no sign"),
    "different elements": (
        lambda: combined([quality_report(SQUARE, [range(4)]), quality_report(CUBE, [range(8)])]),
        "4 nodes too",
    ),
    "different bounds": (
        lambda: combined(quality_report(CUBE, [range(8)], {"skew": bound}) for bound in (0.1, 0.2)),
        "the same bound of skew",
    ),
}


@pytest.mark.filterwarnings("ignore:invalid value")
@pytest.mark.parametrize(("call", "accepted"), BAD.values(), ids=BAD)
def test_what_cannot_be_measured_is_refused_with_what_can(call: Callable[[], object], accepted: str) -> None:
    with pytest.raises(ParameterError, match=accepted):
        call()

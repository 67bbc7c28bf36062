"""Integrals over all and over part of a face."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import Graph
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gyroid_cad.nurbs.basis import uniform_knots
from gyroid_cad.nurbs.quadrature import SquareQuadrature
from gyroid_cad.trim.edge_crossings import FacesToCut

Floats = NDArray[np.float64]


def wavy(x: Floats, y: Floats) -> Floats:
    return 0.4 * x * y + 0.3 * x * x - 0.2 * y


def bent(graph: Graph, lean: float) -> tuple[FacesToCut, SquareQuadrature, Floats]:
    face = graph(wavy, {}, lean)
    quadrature = SquareQuadrature(face.knots)
    return face, quadrature, quadrature.densities(face.nets, face.weights)[0]


def over_disc(quadrature: SquareQuadrature, density: Floats, x: float, y: float, radius: float) -> Floats:
    angles = np.linspace(0, 2 * np.pi, 256, endpoint=False)
    places = np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])
    return quadrature.over(places, radius * np.cos(angles) * 2 * np.pi / len(angles), density)


@pytest.mark.parametrize("lean", [0.0, 0.25])
def test_over_the_whole_square_it_is_as_by_hand(graph: Graph, lean: float) -> None:
    face, quadrature, _ = bent(graph, lean)
    flux, x, y, z, area = quadrature.over_square(face.nets, face.weights)[0]
    # The normal leans by the mean slopes, 0 along x and -0.2 along y; z - x z_x - y z_y = -(0.4 x y + 0.3 x^2).
    assert (x, y, z) == pytest.approx((0, 0.8, 4), abs=1e-9)
    assert flux == pytest.approx(-0.4 / 3, rel=1e-7)
    s = (np.arange(400) + 0.5) / 200 - 1
    slopes = (0.4 * s[np.newaxis] + 0.6 * s[:, np.newaxis], 0.4 * s[:, np.newaxis] - 0.2)
    assert area == pytest.approx(4 * np.mean(np.sqrt(1 + slopes[0] ** 2 + slopes[1] ** 2)), rel=1e-5)


@settings(max_examples=30)
@given(st.floats(-0.4, 0.4), st.floats(-0.4, 0.4), st.floats(0.05, 0.6), st.sampled_from([0.0, 0.25]))
def test_over_a_disc_greens_theorem_gives_its_area_and_moments(
    graph: Graph, x: float, y: float, radius: float, lean: float
) -> None:
    _, quadrature, density = bent(graph, lean)
    sums = over_disc(quadrature, density, x, y, radius)
    flat = np.pi * radius**2
    # Means over a disc: x^2 + r^2 / 4, x y.
    flux = -(0.4 * x * y + 0.3 * (x**2 + radius**2 / 4)) * flat / 3
    mean_slopes = 0.4 * y + 0.6 * x, 0.4 * x - 0.2
    assert sums[:4] == pytest.approx([flux, -mean_slopes[0] * flat, -mean_slopes[1] * flat, flat], abs=1e-6)
    assert sums[4] >= np.linalg.norm(sums[1:4])


@given(st.floats(-1, 1))
def test_what_lies_left_and_right_of_a_line_is_all(graph: Graph, at: float) -> None:
    face, quadrature, density = bent(graph, 0.25)
    nodes, weights = quadrature.places, quadrature.weights
    left, up_to_end = (
        quadrature.over(np.column_stack([np.full_like(nodes, u), nodes]), weights, density) for u in (at, 1.0)
    )
    turned = density[::-1, :] * 1.0
    right = quadrature.over(np.column_stack([np.full_like(nodes, -at), nodes]), weights, turned)
    np.testing.assert_allclose(up_to_end, quadrature.over_square(face.nets, face.weights)[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(left + right, up_to_end, rtol=0, atol=1e-12)


def test_no_faces_have_no_integrals() -> None:
    assert SquareQuadrature(uniform_knots(6)).over_square(np.zeros((0, 6, 6, 3)), np.ones((6, 6))).shape == (0, 5)

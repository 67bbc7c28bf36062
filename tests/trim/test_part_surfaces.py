"""Signed distances from a part's surfaces undo a step along the normal, on either side of the axis of a turned one."""

from __future__ import annotations

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.common.arrays import unit
from gyroid_cad.trim.surfaces import Quadric, QuadricKind

AXES = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [-0.3, 1.0, 2.0], [2.0, -1.0, 0.7]]))[0]
# Ranges of the second parameter on both sides of the place where the meridian crosses the axis.
TURNED = {
    "cone": (Quadric("cone", np.array([1.0, -2.0, 3.0]), AXES, 2.0, 0.5), (-12.0, -5.0), (-3.0, 6.0)),
    "lemon and apple": (Quadric("torus", np.array([1.0, -2.0, 3.0]), AXES, 2.0, 5.0), (2.2, 2 * pi - 2.2), (-1.5, 1.5)),
    "left-handed cone": (Quadric("cone", np.zeros(3), AXES[[1, 0, 2]], 2.0, 0.5), (-12.0, -5.0), (-3.0, 6.0)),
}


@pytest.mark.parametrize("crossed", [True, False])
@pytest.mark.parametrize("name", TURNED)
@given(st.floats(-3, 3), st.floats(0, 1), st.floats(-0.3, 0.3))
def test_a_step_along_the_normal_is_the_distance(name: str, crossed: bool, s: float, share: float, step: float) -> None:
    given_surface, *ranges = TURNED[name]
    low, high = ranges[0 if crossed else 1]
    place = np.array([[s, low + share * (high - low)]])
    assert given_surface.crosses_at(place[0]) == crossed
    surface = replace(given_surface, crossed=crossed)
    normal = unit(surface.area_vectors(place))
    found, gradient, where = surface.distances(surface.points(place) + step * normal)
    assert found == pytest.approx(step, abs=1e-9)
    assert gradient == pytest.approx(normal, abs=1e-9)
    turns = (where - place) / (2 * pi)
    assert turns[:, 0] == pytest.approx(np.round(turns[:, 0]), abs=1e-9)
    if surface.kind == "torus":
        assert turns[:, 1] == pytest.approx(np.round(turns[:, 1]), abs=1e-9)
    else:
        assert where[:, 1] == pytest.approx(place[:, 1], abs=1e-9)


@pytest.mark.parametrize("kind", ["plane", "cylinder", "cone", "sphere", "torus"])
@given(st.floats(-3, 3), st.floats(-1.5, 1.5), st.booleans())
def test_left_handed_axes_turn_the_normal_of_the_parameters(kind: QuadricKind, s: float, t: float, left: bool) -> None:
    surface = Quadric(kind, np.array([1.0, -2.0, 3.0]), AXES[[1, 0, 2] if left else [0, 1, 2]], 5.0, 0.5)
    place = np.array([[s, t]])
    normal = unit(surface.area_vectors(place))
    found, gradient, where = surface.distances(surface.points(place) + 0.1 * normal)
    assert found == pytest.approx(0.1, abs=1e-9)
    assert gradient == pytest.approx(normal, abs=1e-9)
    assert where == pytest.approx(place, abs=1e-9)

"""Faces of a part by selector, by a point on them, or as themselves."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import build123d as bd
import pytest
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.TopoDS import TopoDS_Face

from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.part import require_part, selected_faces

BOX = bd.Box(2, 4, 6)
TOP = BOX.faces().sort_by(bd.Axis.Z)[-1]
PART = require_part(BOX.wrapped)


def in_cadquery(face: TopoDS_Face) -> Any:
    return pytest.importorskip("cadquery", reason="no CadQuery for this kernel").Face(face)


def centre(face: TopoDS_Face) -> tuple[float, float, float]:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    middle = properties.CentreOfMass()
    return middle.X(), middle.Y(), middle.Z()


@pytest.mark.parametrize(
    ("selector", "expected"),
    [
        (">X", (1, 0, 0)),
        ("<X", (-1, 0, 0)),
        (">y", (0, 2, 0)),
        ("<Y", (0, -2, 0)),
        (" >Z ", (0, 0, 3)),
        ("<z", (0, 0, -3)),
    ],
)
def test_a_selector_finds_the_face_furthest_that_way(selector: str, expected: tuple[float, ...]) -> None:
    (found,) = selected_faces(PART, [selector])
    assert centre(found) == pytest.approx(expected, abs=1e-9)


def test_a_selector_finds_all_faces_as_far_that_way() -> None:
    two = require_part((bd.Box(1, 1, 1) + bd.Pos(9) * bd.Box(1, 1, 1)).wrapped)
    assert len(selected_faces(two, [">Z"])) == 2


def test_a_point_finds_the_face_it_lies_on() -> None:
    (found,) = selected_faces(PART, [(0.3, 2.0, -1.0)])
    assert centre(found) == pytest.approx((0, 2, 0), abs=1e-9)


@pytest.mark.parametrize("given", [in_cadquery, bd.Face, lambda face: face], ids=["cadquery", "build123d", "kernel"])
def test_faces_are_taken_from_any_host(given: Callable[[TopoDS_Face], Any]) -> None:
    (found,) = selected_faces(PART, [given(TOP.wrapped)])
    assert centre(found) == pytest.approx((0, 0, 3), abs=1e-9)


@pytest.mark.parametrize("wrong", ["Z", ">W", "", 3, None, (1, 2), (float("nan"), 0, 0), BOX.edges()[0]])
def test_what_points_at_no_face_is_refused(wrong: Any) -> None:
    with pytest.raises(ParameterError, match="openings"):
        selected_faces(PART, [wrong])


def test_a_point_far_from_every_face_is_refused_with_its_distance() -> None:
    with pytest.raises(ParameterError, match="the nearest is 7 mm away"):
        selected_faces(PART, [(8, 0, 0)])


def test_one_selector_is_no_sequence_of_them() -> None:
    with pytest.raises(ParameterError, match="a sequence of"):
        selected_faces(PART, ">Z")

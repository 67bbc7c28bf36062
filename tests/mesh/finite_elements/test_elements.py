"""Nodes and faces of elements against VTK's own parametric coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from vtkmodules.vtkCommonDataModel import (
    vtkBiQuadraticQuad,
    vtkHexahedron,
    vtkQuad,
    vtkQuadraticHexahedron,
    vtkQuadraticQuad,
    vtkTriQuadraticHexahedron,
)

from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.elements import element_type

TWINS = {
    "quad": (vtkQuad, False, 1, False),
    "quad8": (vtkQuadraticQuad, False, 2, False),
    "quad9": (vtkBiQuadraticQuad, False, 2, True),
    "hexahedron": (vtkHexahedron, True, 1, False),
    "hexahedron20": (vtkQuadraticHexahedron, True, 2, False),
    "hexahedron27": (vtkTriQuadraticHexahedron, True, 2, True),
}


def places(cell: object) -> np.ndarray:
    return np.array(cell.GetParametricCoords()).reshape(-1, 3)  # type: ignore[attr-defined]


@pytest.mark.parametrize("name", TWINS)
def test_nodes_stand_where_vtk_has_them(name: str) -> None:
    twin, *which = TWINS[name]
    element = element_type(*which)  # type: ignore[arg-type]
    assert element.name == name
    np.testing.assert_array_equal(element.nodes / 2, places(twin()))


@pytest.mark.parametrize("name", ["hexahedron", "hexahedron20", "hexahedron27"])
def test_each_face_has_the_nodes_in_its_plane_and_looks_outwards(name: str) -> None:
    element = element_type(*TWINS[name][1:])  # type: ignore[arg-type]
    for face in element.faces:
        nodes = element.nodes[face] - 1
        axis = int(np.argmax(np.all(nodes == nodes[0], axis=0)))
        in_plane = np.flatnonzero(element.nodes[:, axis] - 1 == nodes[0, axis])
        assert sorted(face) == in_plane.tolist()
        normal = np.cross(nodes[1] - nodes[0], nodes[3] - nodes[0])
        assert normal[axis] * nodes[0, axis] > 0


@pytest.mark.parametrize("name", ["hexahedron20", "hexahedron27"])
def test_a_face_s_middle_nodes_follow_its_corners_in_order(name: str) -> None:
    element = element_type(*TWINS[name][1:])  # type: ignore[arg-type]
    for face in element.faces:
        corners, middles = element.nodes[face[:4]], element.nodes[face[4:8]]
        np.testing.assert_array_equal(2 * middles, corners + np.roll(corners, -1, axis=0))


@pytest.mark.parametrize("order", [0, 3, 1.5, "1", True, None])
def test_orders_other_than_1_and_2_are_refused(order: object) -> None:
    with pytest.raises(ParameterError, match=r"order = .*1 for linear elements or 2"):
        element_type(True, order)  # type: ignore[arg-type]


def test_linear_elements_have_no_nodes_in_their_middle() -> None:
    with pytest.raises(ParameterError, match="full = True: expected none with linear elements"):
        element_type(True, 1, True)

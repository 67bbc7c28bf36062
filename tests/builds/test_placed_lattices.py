"""A lattice that is placed is the lattice, turned and moved: whatever is made of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.fields import linear
from gyroid_cad.kernel.part import measure
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.covering import frame_of

COARSE = FitSettings(4)
ORIGIN, ROTATION = (100.0, -20.0, 7.0), (20.0, -35.0, 50.0)
LATTICES = {
    "alike": Lattice((2, 1, 1), 10, 0.8, fit=COARSE),
    "graded": Lattice((1, 1, 1), 10, linear(0.7, x=0.02), tolerance=1e-3),
    "mapped": Lattice((1, 1, 1), 10, 0.8, map="twist:angle=10", tolerance=1e-3),
}


def control_points(lattice: Lattice) -> NDArray[np.float64]:
    return lattice.volumes().control_points


def nodes_of_hexahedra(lattice: Lattice) -> NDArray[np.float64]:
    return lattice.hexahedra(2).points


def nodes_of_quadrilaterals(lattice: Lattice) -> NDArray[np.float64]:
    return lattice.quadrilaterals(2).points


def corners_of_triangles(lattice: Lattice) -> NDArray[np.float64]:
    return indexed_triangles(lattice.triangles(0.05).triangulation)[0][:, :3].astype(float)


@pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES)
@pytest.mark.parametrize("points", [control_points, nodes_of_hexahedra, nodes_of_quadrilaterals, corners_of_triangles])
def test_its_points_are_those_at_home_turned_about_x_y_and_z_and_moved(lattice: Lattice, points: Any) -> None:
    placed = points(replace(lattice, origin=ORIGIN, rotation=ROTATION))
    frame = frame_of(ORIGIN, ROTATION)
    np.testing.assert_allclose(placed, points(lattice) @ frame.rotation.T + frame.origin, atol=1e-4)


@pytest.mark.parametrize("trim", [None, "box"])
def test_its_solid_has_the_same_volume_elsewhere(trim: Any) -> None:
    home = Lattice((1, 1, 1), 10, 0.8, fit=COARSE, trim=trim)
    placed = replace(home, origin=ORIGIN, rotation=ROTATION)
    assert measure(placed.solid()) == pytest.approx(measure(home.solid()), rel=1e-5)
    assert (placed.report().faces, placed.report().valid) == (home.report().faces, True)
    low, high = np.array(placed.bounding_box())
    assert np.all(low < np.array(ORIGIN) + 12)
    assert np.all(high > np.array(ORIGIN) - 12)


def test_an_assembly_stands_where_the_lattice_does() -> None:
    placed = Lattice((2, 1, 1), 10, 0.8, fit=COARSE, origin=ORIGIN, rotation=ROTATION).assembly()
    frame = frame_of(ORIGIN, ROTATION)
    (_, first), (_, second) = placed.places()
    np.testing.assert_allclose(np.subtract(second, first), 10 * frame.rotation[:, 0], atol=1e-9)


def test_fields_go_with_it() -> None:
    """A wall that grows along the lattice's own x grows along y when it is turned by a right angle about z."""
    graded = Lattice((1, 1, 1), 10, linear(0.5, x=0.06), tolerance=1e-3)
    turned = replace(graded, rotation=(0.0, 0.0, 90.0))
    assert turned.exact_volume == graded.exact_volume
    assert turned.report().volume == pytest.approx(graded.report().volume, rel=1e-9)
    (low, high), (own_low, own_high) = turned.bounding_box(), graded.bounding_box()
    assert (low[1], high[1]) == pytest.approx((own_low[0], own_high[0]))
    assert (-high[0], -low[0]) == pytest.approx((own_low[1], own_high[1]))

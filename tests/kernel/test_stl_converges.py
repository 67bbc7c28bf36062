"""Triangles of trimmed solids near the solid's area and volume as the deviation falls, like those of whole patches."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad import Lattice
from gyroid_cad.kernel.check import measure
from gyroid_cad.kernel.step import read_step
from gyroid_cad.kernel.stl import closed_triangles
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.areas import fitted_areas

Floats = NDArray[np.float64]

PARTS = Path(__file__).parents[3] / "shared" / "parts"
# In mm; the angle is left free.
DEVIATIONS, LOOSE_ANGLE = np.array([0.06, 0.02, 0.0075]), 80.0
BLOCK = {"cells": (1, 1, 1), "cell_size": 6.0, "density": 0.3, "fit": FitSettings(6)}


def off(vertices: Floats, triangles: NDArray[np.integer], exact: Floats) -> Floats:
    """Volume and area of triangles less the exact ones, in parts of these."""
    found = triangle_measures(vertices.astype(float), triangles)
    return np.array([found.volumes.sum(), found.area]) / exact - 1


def order(errors: Floats) -> float:
    return float(np.polyfit(np.log(DEVIATIONS), np.log(np.abs(errors)), 1)[0])


def of_solid(solid: TopoDS_Shape) -> Floats:
    exact = np.array(measure(solid))
    return np.array([off(*closed_triangles(solid, "a", each, LOOSE_ANGLE), exact) for each in DEVIATIONS.tolist()])


@pytest.mark.parametrize("surface", SURFACES)
def test_area_and_volume_of_a_cut_lattice_converge_as_those_of_a_whole_one_do(surface: str) -> None:
    """Its area goes with the deviation, as that of any triangles; its volume is made up for, and far nearer."""
    cut = of_solid(Lattice(**BLOCK, surface=surface, trim="box", keep_islands=True).solid())
    wall = Lattice(**BLOCK, surface=surface).wall()
    exact = np.array([wall.volume(), fitted_areas(wall).total])
    whole = np.array([off(*indexed_triangles(triangulated(wall, each)), exact) for each in DEVIATIONS.tolist()])
    assert order(cut[:, 1]) == pytest.approx(order(whole[:, 1]), abs=0.15)
    # It may cross the solid's on its way, so it is no power law.
    assert np.all(np.abs(cut[:, 0]) < 0.04 * DEVIATIONS)
    assert np.all(np.abs(cut[:, 0]) < cut[:, 1] / 5)


@pytest.mark.skipif(not PARTS.exists(), reason="parts that others drew are not here")
@pytest.mark.parametrize(("name", "of_volume"), [("torus", 1.8), ("cone_apex", 0.9)])
def test_area_and_volume_of_a_part_converge(name: str, of_volume: float) -> None:
    """Where a face has places inside that can be moved, as of a torus, volume does so faster."""
    found = of_solid(read_step(PARTS / f"{name}.step"))
    assert order(found[:, 1]) > 0.9
    assert order(found[:, 0]) > of_volume

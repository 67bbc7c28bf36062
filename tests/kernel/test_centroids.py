"""Centroids by the flux of squares: where symmetry, another quadrature, a mesh or a sum over all of space has them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_SOLID

from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.areas import ShapeSize, fitted_areas, joint_size, piece_sizes

COARSE = FitSettings(5)
TURNED = {"origin": (5000.0, -3.0, 7.0), "rotation": (10.0, 20.0, 30.0)}


def by_kernel(shape: Any) -> tuple[float, float, float]:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-5)
    place = properties.CentreOfMass()
    return place.X(), place.Y(), place.Z()


@pytest.mark.parametrize("cells", [(1, 1, 1), (3, 2, 1)])
@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
@pytest.mark.parametrize("trim", [None, "box"])
def test_uniform_cells_have_it_in_the_middle_of_their_block(cells: tuple[int, int, int], trim: Any) -> None:
    # A cut lattice's is as good as its section curves are fitted, and as the shift that keeps it off the box.
    lattice = Lattice(cells, 10.0, 0.8, trim=trim, keep_islands=trim is not None, fit=COARSE)
    sizes = lattice.built().sizes if trim else piece_sizes(lattice.wall())
    assert joint_size(sizes).centroid == pytest.approx(5.0 * np.array(cells), abs=4e-6 if trim else 1e-9)


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
@pytest.mark.parametrize("trim", [None, "box"])
def test_it_turns_and_moves_with_the_lattice(trim: Any) -> None:
    plain, placed = (Lattice((1, 1, 1), 10.0, "0.6+0.05*x", trim=trim, fit=COARSE, **where) for where in ({}, TURNED))
    here, there = (joint_size(one.built().sizes) for one in (plain, placed))
    assert there.volume == pytest.approx(here.volume, rel=1e-9)
    rotation, origin = placed.spec().frame.rotation, np.array(TURNED["origin"])
    assert there.centroid == pytest.approx(origin + rotation @ np.array(here.centroid), abs=1e-7)
    assert np.abs(np.array(here.centroid) - 5.0).max() > 0.1


@pytest.mark.parametrize(
    "lattice",
    [
        Lattice((2, 1, 1), 10.0, "0.6+0.04*x", tolerance=1e-3),
        Lattice((1, 1, 1), 10.0, 0.8, map="twist:angle=30", tolerance=1e-3),
    ],
    ids=["graded", "twisted"],
)
def test_of_a_whole_lattice_a_fine_mesh_has_it_too(lattice: Lattice, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    (size,) = piece_sizes(lattice.wall())
    lattice.write(tmp_path / "a.stl", deviation=0.01)
    assert size.centroid == pytest.approx(trimesh.load(tmp_path / "a.stl").center_mass, abs=1e-3)
    assert size.volume == pytest.approx(lattice.wall().volume(), rel=1e-12)
    assert size.area == pytest.approx(fitted_areas(lattice.wall()).total, rel=1e-12)


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
def test_each_piece_of_a_lattice_that_falls_apart_has_its_own() -> None:
    built = Lattice((1, 1, 1), 10.0, 0.8, trim="box", keep_islands=True, fit=COARSE).built()
    solids = list(parts_of(built.solid(), TopAbs_SOLID))
    assert len(built.sizes) == len(solids) > 1
    for size, solid in zip(built.sizes, solids, strict=True):
        assert size.centroid == pytest.approx(by_kernel(solid), abs=1e-4)
    assert sum(size.volume for size in built.sizes) == pytest.approx(built.volume, rel=1e-12)


def test_wall_and_channels_of_a_ball_have_together_that_of_the_ball() -> None:
    ball = BRepPrimAPI_MakeSphere(gp_Pnt(1.0, 2.0, 3.0), 2.0).Shape()
    made = [fill(ball, 5.0, 0.6, kind=kind, keep_islands=True, fit=COARSE) for kind in ("sheet", "channels")]
    sizes = [size for one in made for some in one.sizes.values() for size in some]
    whole = joint_size(sizes)
    assert whole.volume == pytest.approx(4 / 3 * np.pi * 2.0**3, rel=1e-8)
    assert whole.centroid == pytest.approx((1.0, 2.0, 3.0), abs=1e-7)
    for one in made:
        for name, shape in one.domains.items():
            assert joint_size(one.sizes[name]).centroid == pytest.approx(by_kernel(shape), abs=1e-4)


def test_of_several_together_it_is_known_if_all_are() -> None:
    known, unknown = ShapeSize(1.0, 6.0, (1.0, 0.0, 0.0)), ShapeSize(1.0, 6.0)
    assert joint_size([known, unknown]) == ShapeSize(2.0, 12.0)
    assert joint_size([ShapeSize(0.0, 6.0)]) == ShapeSize(0.0, 6.0)

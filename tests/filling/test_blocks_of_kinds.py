"""Blocks of cells that are more than a wall: networks, channels, and bodies that share their faces."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_SOLID

import gyroid_cad.cq_plugin  # noqa: F401 (adds to cadquery.Workplane)
from gyroid_cad import fill, print_check
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields import linear
from gyroid_cad.kernel.assembly import read_bodies
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.extent import box_of, solid_of_box
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.box import Box
from gyroid_cad.wall.covering import frame_of

FIT, CELL = FitSettings(5), 8.0
ORIGIN, ROTATION = (1.0, -2.0, 3.0), (20.0, 0.0, 35.0)


def block(kind: str, cells: tuple[int, int, int] = (1, 1, 1), **given: Any) -> Lattice:
    return Lattice(cells, CELL, trim="box", kind=kind, fit=FIT, **given)


@pytest.fixture(scope="module")
def bodies() -> Lattice:
    return block("bodies", thickness=0.7, origin=ORIGIN, rotation=ROTATION)


def test_the_bodies_of_a_block_fill_it_wherever_it_stands(bodies: Lattice, tmp_path: Path) -> None:
    made = bodies.filled()
    assert sum(made.report.volumes.values()) == pytest.approx(CELL**3, rel=1e-9)
    assert made.report.volume == pytest.approx(bodies.exact_volume, rel=1e-2)
    assert bodies.report() is made.report
    low, high = (np.array(corner) for corner in bodies.bounding_box())
    corners = frame_of(ORIGIN, ROTATION).placed(np.array(list(np.ndindex(2, 2, 2))) * CELL)
    np.testing.assert_allclose([low, high], [corners.min(axis=0), corners.max(axis=0)], atol=1e-9)
    bodies.write(tmp_path / "block.step")
    shapes, _ = read_bodies(tmp_path / "block.step")
    assert sum(1 for shape in shapes for _ in parts_of(shape, TopAbs_SOLID)) == 3


def test_a_network_and_the_other_ones_complement_are_the_block() -> None:
    pairs = (("network-a", 0.3), ("network-b", 0.7))
    volumes = {d: block(kind, density=d, keep_islands=True).report().volume for kind, d in pairs}
    for density, volume in volumes.items():
        assert volume == pytest.approx(density * CELL**3, rel=1e-4)
    assert sum(volumes.values()) == pytest.approx(CELL**3, rel=1e-6)


def test_a_network_may_vary_and_its_density_is_what_it_is_asked_to_be() -> None:
    graded = Lattice((2, 1, 1), CELL, density="0.2 + 0.0125*x", trim="box", kind="network-b", tolerance=1e-3)
    found = graded.report()
    assert found.volume == pytest.approx(0.3 * 2 * CELL**3, rel=1e-3)
    assert graded.exact_volume == pytest.approx(found.volume, rel=1e-3)
    # The end where x is small has less of it.
    at = cq.Shape.cast(graded.solid()).Center().x
    assert at == pytest.approx(CELL * (1 + 0.1 / 0.3 / 3), rel=2e-2)
    # A part, whose places the field is of.
    part = cq.Workplane().box(5, 4, 4)
    even = fill(part, CELL, density=0.3, kind="network-a", fit=FIT, origin=ORIGIN).report.volume
    varied = fill(part, CELL, density=linear(0.3), kind="network-a", tolerance=1e-3, origin=ORIGIN).report.volume
    assert varied == pytest.approx(even, rel=1e-4)


@pytest.mark.parametrize("density", ["0.45 + 0.02*x", "0.01 + 0.001*x"])
def test_a_network_that_varies_stays_below_a_half_and_its_wall_below_the_largest(density: str) -> None:
    with pytest.raises(ParameterError, match=r"1 - 2 x density = .* expected (above 0|below 0.94)"):
        Lattice((1, 1, 1), CELL, density=density, trim="box", kind="network-a").report()


def test_channels_of_a_graded_block_and_its_wall_are_the_block() -> None:
    wall = linear(0.5, x=0.03)
    sheet = Lattice((1, 1, 1), CELL, wall, trim="box", tolerance=1e-3, keep_islands=True)
    channels = Lattice((1, 1, 1), CELL, wall, trim="box", tolerance=1e-3, keep_islands=True, kind="channels")
    with pytest.warns(match="islands"):
        volume = sheet.report().volume
    assert volume + channels.report().volume == pytest.approx(CELL**3, rel=1e-5)


def test_a_network_is_drawn_written_and_checked_for_printing(tmp_path: Path) -> None:
    network = block("network-a", density=0.3)
    network.write(tmp_path / "network.stl", deviation=0.1)
    assert (tmp_path / "network.stl").stat().st_size > 84
    assert network.picture(size=(80, 60))[1:4] == b"PNG"
    assert print_check(network, "form2", deviation=0.1).pieces == 1


def test_hosts_know_the_bodies_by_name() -> None:
    given: dict[str, Any] = {"thickness": 0.7, "trim": "box", "kind": "bodies", "fit": FIT}
    placed = cq.Workplane().center(20, 0).gyroid((1, 1, 1), CELL, **given)
    assert placed.solids().size() == 3
    fluid = placed.solids(tag="fluid-a").val()
    assert fluid.Volume() < placed.val().Volume() / 2
    assert fluid.Center().x == pytest.approx(20, abs=1)
    bd = pytest.importorskip("build123d")
    from gyroid_cad.bd_objects import Gyroid

    turned = Gyroid((1, 1, 1), CELL, rotation=(0, 0, 45), mode=bd.Mode.PRIVATE, **given)
    assert [child.label for child in turned.children] == ["wall", "fluid-a", "fluid-b"]
    assert sum(child.volume for child in turned.children) == pytest.approx(CELL**3, rel=1e-5)
    assert turned.bounding_box().size.X > CELL * 1.4


def test_a_part_is_filled_with_the_kind_that_its_lattice_has_or_another_of_its_wall() -> None:
    part = cq.Workplane().box(5, 4, 4)
    wall = Lattice((1, 1, 1), CELL, 0.7, fit=FIT)
    made = fill(part, lattice=wall, kind="channels")
    assert list(made.domains) == ["channel-a", "channel-b"]
    network = fill(part, lattice=block("network-b", density=0.3))
    assert network.report.kind == "network-b"
    with pytest.raises(ParameterError, match="the density of a network is its own"):
        fill(part, lattice=wall, kind="network-a")
    with pytest.raises(ParameterError, match="whose own is network-b"):
        fill(part, lattice=block("network-b", density=0.3), kind="bodies")
    with pytest.raises(ParameterError, match="carries the block"):
        fill(part, lattice=Lattice((1, 1, 1), CELL, 0.7, map="twist:angle=10"), kind="bodies")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"kind": "bodies", "thickness": 0.7}, "kind.*unless trim is box"),
        ({"kind": "surface", "thickness": 0.7, "trim": "box"}, "kind.*'surface'"),
        ({"kind": "network-a", "thickness": 0.7, "trim": "box"}, "thickness.*told by its density"),
        ({"kind": "network-a", "density": 0.99, "trim": "box"}, "density.*the network's volume fraction"),
        ({"kind": "bodies", "thickness": 0.7, "trim": "box", "map": "twist:angle=10"}, "trim.*carries the block"),
    ],
)
def test_a_block_is_refused_a_kind_that_it_cannot_be(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        Lattice((1, 1, 1), CELL, fit=FIT, **given)


def test_what_is_made_of_the_wall_alone_is_refused_to_other_kinds() -> None:
    lattice = block("network-a", density=0.3)
    for asked in (lattice.fitted, lattice.built, lattice.wall, lambda: lattice.hexahedra(2)):
        with pytest.raises(ParameterError, match="no control nets and no meshes"):
            asked()


def test_a_box_is_found_again_in_the_solid_that_it_is() -> None:
    axes = frame_of(ORIGIN, ROTATION).rotation
    box = Box(axes, np.array([1.0, 2, 3]), np.array([4.0, 6, 8]))
    found = box_of([solid_of_box(box)])
    assert found is not None
    # The same lengths round the same middle; which axis comes first is the kernel's to say.
    middles = [one.axes @ (one.low + one.high) / 2 for one in (box, found)]
    np.testing.assert_allclose(middles[0], middles[1], atol=1e-9)
    np.testing.assert_allclose(np.sort(found.high - found.low), [3, 4, 5], atol=1e-9)
    assert np.abs(np.round(axes.T @ found.axes, 9)).sum() == 3

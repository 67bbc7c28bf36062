"""Lattices and filled parts as CadQuery's and build123d's own shapes, through each of their doors."""

from __future__ import annotations

import pickle
import re
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from gyroid_cad.errors import MissingHostError, host_import
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.host_shapes import HostShapes
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.lattice import Lattice

SIDES = (6.0, 5.0, 4.0)


def block() -> Any:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

    return BRepPrimAPI_MakeBox(*SIDES).Shape()


@pytest.fixture(scope="module")
def channels() -> Filled:
    """Two solids."""
    return fill(block(), 10, 0.8, kind="channels")


@pytest.fixture(params=["lattice", "channels"])
def made(request: pytest.FixtureRequest, cell: Lattice, channels: Filled) -> HostShapes:
    return {"lattice": cell, "channels": channels}[request.param]


def volume_of(made: Any) -> float:
    return made.report.volume if isinstance(made, Filled) else made.report().volume


@pytest.fixture
def cq() -> Any:
    return pytest.importorskip("cadquery", reason="no CadQuery for this kernel")


@pytest.fixture
def bd() -> Any:
    return pytest.importorskip("build123d", reason="build123d is not installed")


def test_a_cadquery_assembly_takes_it_and_writes_it(made: HostShapes, cq: Any, tmp_path: Path) -> None:
    assembly = cq.Assembly(name="both").add(made.to_cadquery(), name="ours", loc=cq.Location((50, 0, 0)))
    assembly.add(cq.Workplane().box(1, 1, 1), name="box")
    assembly.export(str(tmp_path / "both.step"))
    back = cq.importers.importStep(str(tmp_path / "both.step"))
    assert sum(solid.Volume() for solid in back.solids().vals()) == pytest.approx(volume_of(made) + 1, rel=1e-3)


def test_a_cadquery_workplane_takes_it_at_its_start_and_in_its_chain(made: HostShapes, cq: Any) -> None:
    shape = made.to_cadquery()
    assert isinstance(shape, cq.Shape)
    faces = len(shape.Faces())
    assert cq.Workplane(obj=shape).faces().size() == faces
    added = cq.Workplane().box(1, 1, 1).add(shape)
    assert added.faces().size() == faces + 6
    assert cq.Workplane(obj=shape).translate((0, 0, 9)).val().Volume() == pytest.approx(volume_of(made), rel=1e-3)


def test_build123d_writes_it_and_reads_it_back(made: HostShapes, bd: Any, tmp_path: Path) -> None:
    part = made.to_build123d()
    assert isinstance(part, bd.Part)
    tree = bd.Compound(label="both", children=[part, bd.Pos(50, 0, 0) * bd.Box(1, 1, 1)])
    assert bd.export_step(tree, tmp_path / "both.step")
    back = bd.import_step(tmp_path / "both.step")
    assert back.volume == pytest.approx(volume_of(made) + 1, rel=1e-3)


def test_build123d_adds_to_it_and_cuts_from_it_and_has_it_in_builders(made: HostShapes, bd: Any) -> None:
    part = made.to_build123d()
    volume = volume_of(made)
    assert (part + bd.Pos(50, 0, 0) * bd.Box(1, 1, 1)).volume == pytest.approx(volume + 1, rel=1e-3)
    with bd.BuildPart() as builder:
        bd.insert(part)
    assert builder.part.volume == pytest.approx(volume, rel=1e-3)
    below = bd.Pos(0, 0, 2) * bd.Box(40, 40, 80, align=(bd.Align.CENTER, bd.Align.CENTER, bd.Align.MIN))
    assert 0 < (part - below).volume < volume


def test_what_a_host_does_with_its_shape_moves_no_other(made: HostShapes, bd: Any) -> None:
    before = bounding_box(made.solid()).tolist()
    moved = made.to_build123d()
    moved.position = (100, 0, 0)
    assert bounding_box(made.solid()).tolist() == before
    assert bounding_box(made.to_build123d().wrapped).tolist() == before


def test_the_bare_surface_is_a_compound_of_shells_in_both(bd: Any) -> None:
    surface = fill(block(), 10, kind="surface")
    part = surface.to_build123d()
    assert not part.solids()
    assert part.area == pytest.approx(surface.report.area, rel=1e-3)
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    shape = surface.to_cadquery()
    assert isinstance(shape, cq.Compound | cq.Shell)
    assert shape.Area() == pytest.approx(part.area)


DOORS = {"cadquery": ("to_cadquery", "cq_plugin"), "build123d": ("to_build123d", "bd_objects")}
EXTRAS = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]["optional-dependencies"]


@pytest.mark.parametrize("name", DOORS)
def test_without_its_host_a_door_says_which_extra_brings_it(
    name: str, cell: Lattice, monkeypatch: pytest.MonkeyPatch
) -> None:
    method, module = DOORS[name]
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, f"gyroid_cad.{module}", raising=False)
    for door in (getattr(cell, method), lambda: import_module(f"gyroid_cad.{module}")):
        with pytest.raises(MissingHostError) as raised:
            door()
        assert str(raised.value).startswith(f'{name} is not installed: pip install "gyroid_cad[{name}]", or ')
        assert str(pickle.loads(pickle.dumps(raised.value))) == str(raised.value)
    assert set(re.findall(r"gyroid_cad\[(\w+)\]", str(raised.value))) == {name, "hosts"} <= set(EXTRAS)


def test_what_a_host_itself_lacks_is_for_the_host_to_say() -> None:
    with pytest.raises(ModuleNotFoundError, match="nlopt") as raised, host_import("cadquery"):
        raise ModuleNotFoundError("No module named 'nlopt'", name="nlopt")
    assert not isinstance(raised.value, MissingHostError)

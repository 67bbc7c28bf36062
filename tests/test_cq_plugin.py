"""CadQuery: where ``Workplane.gyroid`` puts lattices, how they combine, and what importing it changes."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest

import gyroid_cad.cq_plugin
from gyroid_cad.cq_plugin import GyroidWorkplane
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.makers import linear
from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice
from gyroid_cad.maps.block import Twist
from gyroid_cad.surface.fit import FitSettings

GYROID: dict[str, Any] = {"cells": (1, 1, 1), "cell_size": 10.0, "thickness": 0.8, "fit": FitSettings(4)}
# Seen from the middle of the lattice, the centre of one of its patches: a small box there cuts few faces.
CHIP = (2.5, -1.25)
CHIP_SIDE = 1.5


@pytest.fixture(scope="module")
def lattice() -> Lattice:
    return Lattice(**GYROID)


@pytest.fixture(scope="module")
def volume() -> float:
    return total_volume(cq.Workplane().gyroid(**GYROID))


def total_volume(workplane: cq.Workplane) -> float:
    return float(sum(shape.Volume() for shape in workplane.vals()))


def box_of(shape: cq.Shape) -> np.ndarray:
    box = shape.BoundingBox()
    return np.array([[box.xmin, box.ymin, box.zmin], [box.xmax, box.ymax, box.zmax]])


def chip() -> cq.Workplane:
    """A small box at the origin; the point on the stack is where a lattice's middle must be to be cut by it."""
    return cq.Workplane().box(CHIP_SIDE, CHIP_SIDE, CHIP_SIDE).center(-CHIP[0], -CHIP[1])


@pytest.mark.parametrize(
    "centered", [True, False, (True, True, True), (False, False, False), (True, False, True), (False, True, False)]
)
def test_the_bounding_box_has_its_middle_or_its_lowest_corner_on_the_point(
    lattice: Lattice, centered: bool | tuple[bool, bool, bool]
) -> None:
    shape = cq.Workplane(origin=(1, 2, 3)).gyroid(**GYROID, centered=centered).val()
    low, high = np.array(lattice.bounding_box())
    middle = np.broadcast_to(centered, 3)
    start = np.array([1, 2, 3]) - np.where(middle, (high - low) / 2, 0)
    np.testing.assert_allclose(box_of(shape), [start, start + high - low], atol=1e-6)


def test_centred_as_a_box_of_the_same_size_would_be(lattice: Lattice) -> None:
    low, high = np.array(lattice.bounding_box())
    for centered in (True, (True, False, True)):
        ours = cq.Workplane("XZ").gyroid(**GYROID, centered=centered).val()
        box = cq.Workplane("XZ").box(*(high - low)[[0, 1, 2]].tolist(), centered=centered).val()
        np.testing.assert_allclose(box_of(ours), box_of(box), atol=1e-6)


def test_two_in_a_row_are_in_the_same_place(lattice: Lattice) -> None:
    first, second = (cq.Workplane().gyroid(**GYROID).val() for _ in range(2))
    np.testing.assert_array_equal(box_of(first), box_of(second))
    assert first.wrapped.IsPartner(second.wrapped)
    assert lattice.solid().Location().IsIdentity()


def test_moving_the_result_moves_no_later_lattice(lattice: Lattice) -> None:
    before = lattice.bounding_box()
    cq.Workplane().gyroid(**GYROID).val().move(cq.Location(cq.Vector(50, 0, 0)))
    assert lattice.bounding_box() == before
    again = cq.Workplane().gyroid(**GYROID, centered=False).val()
    np.testing.assert_allclose(box_of(again)[0], 0, atol=1e-6)


@pytest.mark.parametrize("combine", [True, False])
def test_a_lattice_stands_at_each_point_of_the_stack(volume: float, combine: bool) -> None:
    points = [(0, 0), (30, 0), (0, 40)]
    made = cq.Workplane().pushPoints(points).gyroid(**GYROID, combine=combine)
    solids = made.solids().vals()
    assert made.size() == (1 if combine else 3)
    assert len(solids) == 3
    middles = sorted(tuple(np.mean(box_of(solid), axis=0).round(6).tolist()) for solid in solids)
    assert middles == sorted((float(x), float(y), 0.0) for x, y in points)
    assert total_volume(made) == pytest.approx(3 * volume, rel=1e-9)


def test_the_point_may_be_on_a_face_and_turned_with_it(volume: float) -> None:
    made = cq.Workplane().box(2, 2, 2).faces(">X").workplane(offset=20).gyroid(**GYROID, combine=False)
    np.testing.assert_allclose(np.mean(box_of(made.val()), axis=0), [21, 0, 0], atol=1e-6)
    assert total_volume(made) == pytest.approx(volume, rel=1e-6)


def test_volumes_of_union_and_common_part_add_up_to_those_of_both(volume: float) -> None:
    """Inclusion and exclusion, for a lattice onto a box; what is cut and what is common make up the box."""
    box = CHIP_SIDE**3
    fused, cut = (total_volume(chip().gyroid(**GYROID, combine=how)) for how in (True, "cut"))
    common = total_volume(chip().intersect(chip().gyroid(**GYROID, combine=False)))
    assert 0 < common < box
    assert fused + common == pytest.approx(volume + box, abs=1e-4 * box)
    assert cut + common == pytest.approx(box, rel=1e-4)


def test_a_box_combines_with_a_lattice_as_well_as_the_other_way_round(volume: float) -> None:
    lattice = cq.Workplane().gyroid(**GYROID).center(*CHIP)
    box = CHIP_SIDE**3
    fused = lattice.box(CHIP_SIDE, CHIP_SIDE, CHIP_SIDE)
    cut = lattice.box(CHIP_SIDE, CHIP_SIDE, CHIP_SIDE, combine="cut")
    assert fused.val().isValid()
    assert cut.val().isValid()
    assert total_volume(fused) - total_volume(cut) == pytest.approx(box, rel=1e-4)
    assert total_volume(fused) == pytest.approx(total_volume(chip().gyroid(**GYROID)), rel=1e-6)
    assert volume - box < total_volume(cut) < volume


def test_uncombined_lattices_leave_the_box_in_the_chain_alone(volume: float) -> None:
    made = chip().gyroid(**GYROID, combine=False)
    assert total_volume(made) == pytest.approx(volume, rel=1e-9)
    assert made.findSolid().Volume() == pytest.approx(volume, rel=1e-9)


def test_cleaning_finds_nothing_to_merge() -> None:
    """No two faces of a lattice lie on one surface."""
    kept, cleaned = (cq.Workplane().gyroid(**GYROID, clean=clean) for clean in (False, True))
    assert cleaned.faces().size() == kept.faces().size()
    assert total_volume(cleaned) == pytest.approx(total_volume(kept), rel=1e-9)


def test_density_says_the_same_as_the_thickness_it_gives(lattice: Lattice, volume: float) -> None:
    by_density = {**GYROID, "thickness": None, "density": lattice.volume_fraction}
    assert total_volume(cq.Workplane().gyroid(**by_density)) == pytest.approx(volume, rel=1e-9)


@pytest.mark.parametrize("bad", [{"cells": (0, 1, 1)}, {"thickness": 4.0}, {"density": 0.2}, {"cell_size": -1}])
def test_bad_values_raise_the_packages_own_error(bad: dict[str, Any]) -> None:
    with pytest.raises(ParameterError):
        cq.Workplane().gyroid(**{**GYROID, **bad})


INSTALLATION = """
import importlib, json, sys
import cadquery as cq
from gyroid_cad.errors import GyroidError

classes = {value for value in vars(cq).values() if isinstance(value, type)}
before = {kind: dict(vars(kind)) for kind in classes}

def theirs(self): ...
cq.Workplane.gyroid = theirs
try:
    import gyroid_cad.cq_plugin
    refusal = None
except GyroidError as problem:
    refusal = str(problem)
kept = cq.Workplane.gyroid is theirs
del cq.Workplane.gyroid

import gyroid_cad.cq_plugin
from gyroid_cad.cq_plugin import GyroidWorkplane
importlib.reload(gyroid_cad.cq_plugin)
changed = [
    [kind.__name__, name]
    for kind in classes
    for name in {*before[kind], *vars(kind)}
    if before[kind].get(name) is not vars(kind).get(name)
]
print(json.dumps({"refusal": refusal, "kept": kept, "changed": changed}))
"""


@pytest.fixture(scope="module")
def installation() -> dict[str, Any]:
    """What a fresh interpreter finds on importing the plugin with the name taken, then free, then again."""
    run = subprocess.run([sys.executable, "-c", INSTALLATION], capture_output=True, text=True, check=True)
    return dict(json.loads(run.stdout))


def test_importing_the_plugin_adds_two_methods_to_one_class(installation: dict[str, Any]) -> None:
    assert sorted(installation["changed"]) == [["Workplane", "gyroid"], ["Workplane", "gyroid_fill"]]
    assert cq.Workplane.gyroid is gyroid_cad.cq_plugin.gyroid


def test_a_name_already_taken_is_not_replaced_but_complained_of(installation: dict[str, Any]) -> None:
    assert installation["kept"]
    assert "cadquery.Workplane.gyroid is taken by __main__" in installation["refusal"]


def test_fields_and_maps_are_those_of_a_lattice() -> None:
    varying: dict[str, Any] = {
        "thickness": linear(0.6, x=0.02),
        "scale_field": "1 + 0.01*y",
        "map": Twist(20),
        "tolerance": 1e-2,
    }
    lattice = Lattice((1, 1, 1), 10.0, fit=FitSettings(6), **varying)
    shape = cq.Workplane().gyroid((1, 1, 1), 10.0, fit=FitSettings(6), centered=False, **varying).val()
    assert shape.isValid()
    assert shape.ShapeType() == "Solid"
    assert shape.Volume() == pytest.approx(lattice.exact_volume, rel=2e-3)
    np.testing.assert_allclose(np.ptp(box_of(shape), axis=0), np.ptp(lattice.bounding_box(), axis=0), atol=1e-6)


def test_a_part_in_the_chain_is_filled_and_replaced_by_what_is_left() -> None:
    part = cq.Workplane().box(4, 5, 3).faces(">Z").workplane()
    light = part.gyroid_fill(10, 0.9, fit=FitSettings(4))
    expected = fill(cq.Workplane().box(4, 5, 3), 10, 0.9, fit=FitSettings(4))
    assert light.size() == 1
    assert light.val().isValid()
    assert total_volume(light) == pytest.approx(expected.report.volume, rel=1e-5)
    assert part.findSolid().Volume() == pytest.approx(4 * 5 * 3)


def test_selected_faces_are_where_the_skin_is_left_open() -> None:
    box = cq.Workplane().box(5, 5, 4)
    open_above = box.faces(">Z").gyroid_fill(10, 0.9, skin=0.5, fit=FitSettings(4))
    area_above = sum(face.Area() for face in open_above.faces(">Z").vals())
    assert open_above.val().isValid()
    assert area_above < 5 * 5 - 1
    assert box.gyroid_fill(10, 0.9, skin=0.5, fit=FitSettings(4)).faces(">Z").val().Area() == pytest.approx(25)


def test_a_chain_without_a_solid_is_refused() -> None:
    with pytest.raises(ParameterError, match="a chain with a solid in it"):
        cq.Workplane().gyroid_fill(10, 0.9)


def test_a_lattice_cut_to_its_box_has_the_size_of_its_cells() -> None:
    block = cq.Workplane().gyroid((2, 1, 1), 10.0, density=0.3, fit=FitSettings(6), trim="box")
    corners = np.array([vertex.toTuple() for vertex in block.vertices().vals()])
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [[-10, -5, -5], [10, 5, 5]], atol=1e-9)


@pytest.mark.parametrize(("keep", "solids"), [(False, 1), (True, 3)])
def test_chips_at_the_corners_of_whole_cells_are_dropped_unless_they_are_to_be_kept(keep: bool, solids: int) -> None:
    made = cq.Workplane().gyroid(**GYROID, trim="box", keep_islands=keep)
    filled = cq.Workplane().box(10, 10, 10, centered=False).gyroid_fill(10, 0.8, fit=GYROID["fit"], keep_islands=keep)
    assert len(made.solids().vals()) == len(filled.solids().vals()) == solids


TYPED = """
import cadquery as cq
from gyroid_cad.cq_plugin import GyroidWorkplane, gyroid, gyroid_fill

block = GyroidWorkplane().box(9, 9, 9)
chain = block.faces(">Z").gyroid_fill(8, density=0.3, skin=1).gyroid(cells=(1, 1, 1), cell_size=10, thickness=0.8)
plain = gyroid(gyroid_fill(cq.Workplane().box(9, 9, 9), 8, density=0.3), (1, 1, 1), 10, 0.8)
reveal_type(chain)
reveal_type(plain)
block.gyroid(cells="many", cell_size=10)
"""
# What else is imported is left out: reading all of it takes seven times as long.
TYPING = """
[mypy]
ignore_missing_imports = True
[mypy-numpy.*,scipy.*,OCP.*,vtkmodules.*,ezdxf.*,pyparsing.*,build123d.*,gyroid_cad.*]
follow_imports = skip
[mypy-gyroid_cad.cq_plugin]
follow_imports = silent
"""


def test_a_type_checker_knows_both_methods_and_both_functions(tmp_path: Path) -> None:
    (tmp_path / "typed.py").write_text(TYPED)
    (tmp_path / "mypy.ini").write_text(TYPING)
    run = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", "mypy.ini", "--cache-dir", "cache", "typed.py"],
        cwd=tmp_path,
        env={**os.environ, "MYPYPATH": str(Path(gyroid_cad.__file__).parents[1])},
        capture_output=True,
        text=True,
        check=False,
    )
    said = run.stdout.splitlines()
    assert 'typed.py:8: note: Revealed type is "gyroid_cad.cq_plugin.GyroidWorkplane"' in said
    assert 'typed.py:9: note: Revealed type is "cadquery.cq.Workplane"' in said
    errors = [line for line in said if "error:" in line and line.startswith("typed.py")]
    assert len(errors) == 1
    assert errors[0].startswith('typed.py:10: error: Argument "cells" ')


def test_the_typed_workplane_is_cadquerys_with_the_same_methods() -> None:
    made = GyroidWorkplane().box(5, 4, 3).gyroid_fill(cell_size=8, density=0.3, fit=FitSettings(4))
    assert isinstance(made, GyroidWorkplane)
    plain = cq.Workplane().box(5, 4, 3).gyroid_fill(cell_size=8, density=0.3, fit=FitSettings(4))
    assert made.val().Volume() == pytest.approx(plain.val().Volume())
    assert not isinstance(plain, GyroidWorkplane)


def test_each_domain_of_a_filled_part_is_tagged_by_its_name() -> None:
    fluids = cq.Workplane().box(6, 5, 4).gyroid_fill(10, 0.8, kind="channels")
    a, b = (fluids.solids(tag=name).val().Volume() for name in ("channel-a", "channel-b"))
    assert min(a, b) > 0
    assert a + b == pytest.approx(fluids.val().Volume())

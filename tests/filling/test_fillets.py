"""Fillets where a lattice meets a skin: what a rolling ball leaves, and nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from manifold3d import Manifold
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox

from gyroid_cad import ParameterError, fill
from gyroid_cad.cli.app import main
from gyroid_cad.filling.fillet import rounded
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.mesh.triangles.booleans import Body, body_of
from gyroid_cad.mesh.triangles.measures import unmatched_edges

# Of a square in the corner of two planes, what a circle that touches both leaves.
BESIDE_CIRCLE = 1 - np.pi / 4
USUAL: dict[str, Any] = {"cell_size": 8.0, "density": 0.3, "route": "triangles", "deviation": 0.05, "skin": 0.8}


def own(body: Manifold) -> Body:
    found = body_of(*Body(body).triangles())
    assert found is not None
    return found


def block(low: float, high: float) -> Body:
    return own(Manifold.cube([high - low] * 3).translate([low] * 3))


PART, CORE = block(-1.0, 11.0), block(0.0, 10.0)
SLAB = own(Manifold.cube([1.0, 14.0, 14.0]).translate([4.5, -2.0, -2.0]))


@pytest.mark.parametrize("radius", [0.4, 0.7])
def test_a_plate_across_a_hollow_box_gets_the_corners_of_a_circle(radius: float) -> None:
    left = CORE - SLAB
    void = rounded(left, PART, CORE, 1.0, radius, 0.004)
    # Eight corners of ten, but where two of them meet in a corner of the box.
    assert left.volume - void.volume == pytest.approx(8 * 10 * BESIDE_CIRCLE * radius**2, rel=0.06)
    assert (void - left).volume == 0.0
    assert unmatched_edges(void.triangles()[1]) == 0


def test_further_than_the_radius_from_the_junction_all_stays_as_it_is() -> None:
    radius = 0.6
    left = CORE - SLAB
    added = left - rounded(left, PART, CORE, 1.0, radius, 0.01)
    vertices = added.triangles()[0]
    from_slab = np.abs(vertices[:, 0] - 5.0) - 0.5
    from_skin = np.minimum(vertices, 10.0 - vertices)[:, 1:].min(axis=1)
    assert from_slab.max() <= radius + 0.01
    assert from_skin.max() <= radius + 0.01


def test_a_pin_has_fillets_round_its_ends() -> None:
    radius = 0.4
    pin = own(Manifold.cylinder(14.0, 2.0, 2.0, 128).translate([5.0, 5.0, -2.0]))
    left = CORE - pin
    # The centre of what a circle leaves is 0.2234 of its radius from the corner (Pappus).
    expected = 2 * 2 * np.pi * BESIDE_CIRCLE * radius**2 * (2 + 0.2234 * radius)
    assert left.volume - rounded(left, PART, CORE, 1.0, radius, 0.004).volume == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("kind", ["sheet", "network-a", "channels"])
def test_a_filled_box_stays_closed_and_fillets_only_add(kind: Any) -> None:
    box = BRepPrimAPI_MakeBox(6.0, 6.0, 6.0).Shape()
    plain, made = (
        fill(box, kind=kind, openings=[">Z"], keep_islands=True, **given, **USUAL).report
        for given in ({}, {"fillet": 0.5})
    )
    assert made.closed
    grown = made.volume - plain.volume if kind != "channels" else plain.volume - made.volume
    assert 0.0 < grown < 0.1 * made.part_volume


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"fillet": 3.0}, "fillet = 3.0: expected below 1.3"),
        ({"fillet": -1.0}, "fillet = -1.0: expected a length in mm"),
        ({"fillet": 0.3, "skin": None}, "none without a skin or a core"),
        ({"fillet": 0.3, "route": "brep", "deviation": None}, 'route="triangles" rounds them'),
    ],
)
def test_a_fillet_that_cannot_be_is_refused_in_one_line(given: dict[str, Any], words: str) -> None:
    with pytest.raises(ParameterError) as refused:
        fill(BRepPrimAPI_MakeBox(6.0, 6.0, 6.0).Shape(), **{**USUAL, **given})
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_step_file_has_no_fillets_and_the_shell_says_which_route_has(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_brep(BRepPrimAPI_MakeBox(6.0, 6.0, 6.0).Shape(), tmp_path / "box.brep")
    arguments = ["fill", str(tmp_path / "box.brep"), "-o", str(tmp_path / "a.step"), "--cell-size", "8"]
    assert main([*arguments, "--density", "0.3", "--skin", "0.8", "--fillet", "0.3"]) != 0
    assert "--fillet = 0.3: expected none at --route brep" in capsys.readouterr().err
    assert not (tmp_path / "a.step").exists()

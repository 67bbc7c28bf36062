"""What a STEP file holds is counted in its own text; a file that lost something is not left behind."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge, BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeWire
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Geom import Geom_OffsetCurve
from OCP.gp import gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopLoc import TopLoc_Location

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import compound_of, topology
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.kernel.surfaces import kernel_curve
from gyroid_cad.lattice import Lattice
from gyroid_cad.nurbs.basis import uniform_knots
from gyroid_cad.nurbs.surface import NurbsCurve
from gyroid_cad.step.counts import Topology, topology_in_step

PARTS = sorted((Path(__file__).parents[3] / "shared" / "parts").glob("*.step"))
DRAWN = {
    "box": lambda: BRepPrimAPI_MakeBox(3, 4, 5).Shape(),
    "ball": lambda: BRepPrimAPI_MakeSphere(3).Shape(),
    "ring": lambda: BRepPrimAPI_MakeTorus(5, 1).Shape(),
    "cone with its tip": lambda: BRepPrimAPI_MakeCone(3, 0, 5).Shape(),
}


def along_an_offset_curve() -> Any:
    """A prism whose face over a spline's offset curve the kernel's writer leaves out without a word."""
    points = np.array([(0, 0, 0), (2, 2, 0), (4, -1.5, 0), (6, 2, 0), (8, 0, 0)], float)
    spline = kernel_curve(NurbsCurve(points, np.ones(len(points)), uniform_knots(len(points))))
    curve = Geom_OffsetCurve(spline, 3.0, gp_Dir(0, 0, 1))
    start, end = curve.Value(curve.FirstParameter()), curve.Value(curve.LastParameter())
    corners = [end, gp_Pnt(end.X(), -20, 0), gp_Pnt(start.X(), -20, 0), start]
    straight = [BRepBuilderAPI_MakeEdge(a, b).Edge() for a, b in pairwise(corners)]
    wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(curve).Edge(), *straight).Wire()
    return BRepPrimAPI_MakePrism(BRepBuilderAPI_MakeFace(wire).Face(), gp_Vec(0, 0, 5)).Shape()


@pytest.mark.parametrize("draw", DRAWN.values(), ids=DRAWN)
def test_the_text_counts_what_the_kernel_does(draw: Any, tmp_path: Path) -> None:
    shape = draw()
    write_step(shape, tmp_path / "a.step")
    assert topology_in_step(tmp_path / "a.step") == topology(shape)


def test_of_a_lattice_too(cell: Lattice, tmp_path: Path) -> None:
    cell.write(tmp_path / "a.step")
    assert topology_in_step(tmp_path / "a.step") == topology(cell.solid()) == Topology(1, cell.report().faces, 0)


@pytest.mark.parametrize("part", PARTS or [None], ids=lambda part: part.stem if part else "no parts")
def test_a_part_that_others_drew_is_written_whole(part: Path | None, tmp_path: Path) -> None:
    if part is None:
        pytest.skip("the folder of parts is not there")
    shape = read_step(part)
    write_step(shape, tmp_path / "a.step")
    # Solids that stand at several places are in the text once, and all there when it is read.
    found, back, wanted = (
        topology_in_step(tmp_path / "a.step"),
        topology(read_step(tmp_path / "a.step")),
        topology(shape),
    )
    assert (back.solids, back.faces, found.open_edges) == (wanted.solids, wanted.faces, 0)


def test_a_solid_that_stands_at_two_places_is_in_the_file_once(tmp_path: Path) -> None:
    box, there = BRepPrimAPI_MakeBox(3, 4, 5).Shape(), gp_Trsf()
    there.SetTranslation(gp_Vec(10, 0, 0))
    write_step(compound_of([box, box.Moved(TopLoc_Location(there))]), tmp_path / "a.step")
    assert topology_in_step(tmp_path / "a.step") == Topology(1, 6, 0)
    assert topology(read_step(tmp_path / "a.step")) == Topology(2, 12, 0)


def test_a_file_whose_writer_left_faces_out_is_not_left_behind(tmp_path: Path) -> None:
    (tmp_path / "a.step").write_text("what was there")
    with pytest.raises(ExportError, match=r"of 6 faces and \d+ open edges; BREP holds"):
        write_step(along_an_offset_curve(), tmp_path / "a.step")
    assert (tmp_path / "a.step").read_text() == "what was there"
    assert [file.name for file in tmp_path.iterdir()] == ["a.step"]

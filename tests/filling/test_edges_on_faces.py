"""Edges of cut and filled lattices lie on their faces as closely as a reader of STEP says they do."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import build123d as bd
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of
from gyroid_cad.kernel.compat import as_edge, as_face
from gyroid_cad.kernel.seams import without_seams
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.kernel.trimmed import build_trimmed
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.trim.box import Box, cut_to_box
from gyroid_cad.wall.covering import AT_HOME, covering_complex
from gyroid_cad.wall.offset import build_wall

# In mm: the kernel's smallest distance, which its reader gives edges as their tolerance.
SMALLEST = 1e-7
# By which what is seen at the reader's places and at ours may differ.
FOUND = 1e-10
LOOKED_AT = 151
COARSE = FitSettings(5)
# In mm: large ones, of which a curve is furthest off before it counts in parts of a cell.
CELL, WALL = 25.0, 2.0
Made = Callable[[], TopoDS_Shape]


def uses(shape: TopoDS_Shape) -> Iterator[tuple[TopoDS_Face, TopoDS_Edge]]:
    for face in map(as_face, parts_of(shape, TopAbs_FACE)):
        for edge in map(as_edge, parts_of(face, TopAbs_EDGE)):
            if not BRep_Tool.Degenerated_s(edge):
                yield face, edge


def furthest(face: TopoDS_Face, edge: TopoDS_Edge) -> float:
    """How far an edge's curve is from its place on a face, at many more places than the reader looks at."""
    curve, on_face = BRepAdaptor_Curve(edge), BRepAdaptor_Curve(edge, face)
    places = np.linspace(curve.FirstParameter(), curve.LastParameter(), LOOKED_AT).tolist()
    return max(curve.Value(t).Distance(on_face.Value(t)) for t in places)


def filled(part: bd.Part, at: float) -> TopoDS_Shape:
    return fill((bd.Pos(at, at, 0) * part).wrapped, CELL, WALL, fit=COARSE).solid()


def cut_to_corner(at: float) -> TopoDS_Shape:
    """A corner of a cell, by the way of lattices that are trimmed to a box."""
    low, extent = np.array([at, at, 0.0]), np.array([0.4, 0.3, 0.35]) * CELL
    complex = covering_complex(low, low + extent, AT_HOME, CELL, WALL / 2)
    box = Box(np.eye(3), low, low + extent)
    wall = build_wall(complex, fit_patch(COARSE), CELL, WALL)
    return compound_of(build_trimmed(cut_to_box(wall, box, [(0, True), (1, False)], CELL, True, True)))


MADE: dict[str, Made] = {
    "filled cylinder": lambda: filled(bd.Cylinder(3, 5), 0),
    "filled cylinder far away": lambda: filled(bd.Cylinder(3, 5), 5000),
    "trimmed to a box": lambda: cut_to_corner(0),
    "trimmed to a box far away": lambda: cut_to_corner(5000),
}


@pytest.mark.parametrize("name", MADE)
def test_no_edge_of_a_file_is_further_from_its_faces_than_its_tolerance(name: str, tmp_path: Path) -> None:
    write_step(MADE[name](), path := tmp_path / "made.step")
    read = read_step(path)
    found = np.array([(furthest(face, edge), BRep_Tool.Tolerance_s(edge)) for face, edge in uses(read)])
    assert np.all(found[:, 0] <= np.maximum(found[:, 1], SMALLEST) + FOUND)


@pytest.mark.parametrize(
    "solid", [bd.Sphere(3), bd.Pos(7, 1, 2) * bd.Torus(5, 1), bd.Rot(30, 0, 0) * bd.Cylinder(2, 5)]
)
def test_halves_of_closed_faces_meet_in_a_line_of_their_surface(solid: bd.Part) -> None:
    halves = without_seams(solid.wrapped)
    assert is_valid(halves)
    assert len(list(uses(halves))) > len(list(uses(solid.wrapped)))
    for face, edge in uses(halves):
        assert furthest(face, edge) < 1e-12
        assert BRep_Tool.Tolerance_s(edge) == SMALLEST

"""Our own STEP writer: what it writes comes back from the kernel as it was, face by face and edge by edge."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import build123d as bd
import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps
from OCP.ShapeFix import ShapeFix_ShapeTolerance
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_VERTEX
from scipy.spatial import cKDTree

from gyroid_cad.common.formats import SCHEMAS
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.check import is_valid, measure, parts_of, topology
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.header import StepHeader
from gyroid_cad.surface.fit import FitSettings

PARTS = Path(__file__).parents[3] / "shared" / "parts"
WAVE = ((0, 0), (2, 2), (4, -1.5), (6, 2), (8, 0))


def over(curve: bd.Edge) -> bd.Face:
    """The area between a curve and a rectangle's three other sides."""
    start, end = curve @ 0, curve @ 1
    low = [bd.Vector(point.X, -5) for point in (end, start)]
    return bd.make_face([curve, bd.Polyline(end, *low, start)]).face()


def hollow() -> Any:
    """A box with a sealed void that has a ball's shape, and one that has a ring's."""
    void = bd.Pos(5, 5, 5) * bd.Sphere(3) + bd.Pos(14, 5, 5) * bd.Torus(2.5, 1)
    return bd.Pos(10, 5, 5) * bd.Box(20, 10, 10) - void


DRAWN = {
    "box": lambda: bd.Box(3, 4, 5),
    "cylinder": lambda: bd.Cylinder(2, 5),
    "ball": lambda: bd.Sphere(3),
    "piece of a ball": lambda: bd.Sphere(3, arc_size1=-30, arc_size2=50, arc_size3=200),
    "zone of a ball": lambda: bd.Sphere(3, arc_size1=-30, arc_size2=50),
    "half a ball": lambda: bd.Rot(30, 0, 0) * bd.Sphere(3, arc_size1=0, arc_size2=90),
    "ball with a hole at its poles": lambda: bd.Sphere(3) - bd.Cylinder(1, 9),
    "ring": lambda: bd.Torus(5, 1),
    "cone": lambda: bd.Cone(3, 1, 5),
    "cone with its tip": lambda: bd.Cone(3, 0, 5),
    "cone on its tip": lambda: bd.Cone(0, 3, 5),
    "cut cylinder": lambda: bd.Cylinder(2, 5) - bd.Rot(35, 0, 0) * bd.Pos(0, 0, 5) * bd.Box(10, 10, 10),
    "cylinder over an ellipse": lambda: bd.extrude(bd.Ellipse(4, 2), 5),
    "extruded spline": lambda: bd.extrude(over(bd.Spline(*WAVE)), 4),
    "extruded Bezier curve": lambda: bd.extrude(over(bd.Bezier(*WAVE[:4])), 4),
    "revolved spline": lambda: bd.revolve(bd.Pos(0, 9) * over(bd.Spline(*WAVE)), bd.Axis.X, 250),
    "loft": lambda: bd.loft([bd.Rectangle(4, 4).face(), (bd.Pos(1, 0, 5) * bd.Circle(1.5)).face()]),
    "rational splines": lambda: bd.Solid(BRepBuilderAPI_NurbsConvert(bd.Torus(5, 1).wrapped).Shape()),
    "box with rounded edges": lambda: bd.fillet(bd.Box(3, 4, 5).edges(), 0.7),
    "sealed voids": hollow,
    "turned inside out": lambda: bd.Solid(bd.Box(3, 4, 5).solid().wrapped.Reversed()),
    "mirror image": lambda: bd.mirror(bd.Pos(3, 0, 0) * bd.Cone(3, 1, 5) - bd.Pos(3, 0, 0) * bd.Cylinder(0.5, 9)),
}


def is_ours(path: Path) -> bool:
    """Whether no other program had a hand in a file."""
    return "Open CASCADE" not in path.read_text()[:1000]


def counts(shape: Any) -> list[int]:
    """Of its faces, edges and vertices, each once."""
    found = []
    for kind in (TopAbs_FACE, TopAbs_EDGE, TopAbs_VERTEX):
        parts = NumberedShapes()
        for part in parts_of(shape, kind):
            parts.Add(part)
        found.append(parts.Extent())
    return found


def sizes(shape: Any, kind: TopAbs_ShapeEnum, measure: Callable[[Any, GProp_GProps], Any]) -> NDArray[np.float64]:
    """Size and centre of every part of a kind, in mm, each once for its use; poles have none."""
    found = []
    for part in parts_of(shape, kind):
        properties = GProp_GProps()
        measure(part, properties)
        centre = properties.CentreOfMass()
        if properties.Mass() > 0:
            found.append((properties.Mass(), centre.X(), centre.Y(), centre.Z()))
    return np.array(found)


def require_same(back: Any, shape: Any, of_edges: float, of_faces: float) -> None:
    assert is_valid(back)
    assert topology(back) == topology(shape)
    assert counts(back) == counts(shape)
    for kind, size_of, tolerance in (
        (TopAbs_EDGE, BRepGProp.LinearProperties_s, of_edges),
        (TopAbs_FACE, BRepGProp.SurfaceProperties_s, of_faces),
    ):
        found, wanted = sizes(back, kind, size_of), sizes(shape, kind, size_of)
        scale = 1 + np.abs(wanted).max(axis=1)
        assert len(found) == len(wanted)
        assert np.all(cKDTree(found).query(wanted)[0] <= tolerance * scale)


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("draw", DRAWN.values(), ids=DRAWN)
def test_what_is_drawn_comes_back_as_it_was(draw: Any, schema: Any, tmp_path: Path) -> None:
    shape = draw().wrapped
    write_step(shape, tmp_path / "a.step", StepHeader(schema))
    assert is_ours(tmp_path / "a.step")
    # Along a curve that its reader made in the parameter plane the kernel integrates less closely.
    assert topology(shape).closed
    require_same(read_step(tmp_path / "a.step"), shape, 1e-9, 1e-5)


MADE = {
    "graded": lambda: Lattice((1, 1, 1), 5.0, "0.4+0.05*x", fit=FitSettings(5)).solid(),
    "cut to its box": lambda: Lattice((1, 1, 1), 5.0, 0.6, trim="box", fit=FitSettings(6)).solid(),
    "filled plate": lambda: fill((bd.Box(5, 4, 3) - bd.Cylinder(1, 9)).wrapped, 5.0, density=0.3).solid(),
    "bare surface": lambda: fill(bd.Box(5, 4, 3).wrapped, 5.0, kind="surface", fit=FitSettings(6)).solid(),
    "filled ball far off": lambda: fill((bd.Pos(5000, -3000, 4000) * bd.Sphere(2)).wrapped, 5.0, density=0.3).solid(),
}


@pytest.mark.parametrize("make", MADE.values(), ids=MADE)
def test_what_is_built_comes_back_as_it_was(make: Any, tmp_path: Path) -> None:
    shape = make()
    write_step(shape, tmp_path / "a.step")
    assert is_ours(tmp_path / "a.step")
    # Its reader ends a curve where it passes the vertex nearest, which is some 1e-7 mm off.
    require_same(read_step(tmp_path / "a.step"), shape, 1e-5, 1e-4)


def test_names_with_letters_of_any_script_and_quotes_come_into_the_file_whole(tmp_path: Path) -> None:
    write_step(bd.Box(1, 2, 3).wrapped, tmp_path / "a.step", name="d'Île")
    assert "PRODUCT('d''\\X2\\00CE\\X0\\le'," in (tmp_path / "a.step").read_text(encoding="ascii")


def test_a_shape_with_an_offset_surface_is_left_to_the_kernels_writer_and_comes_back_too(tmp_path: Path) -> None:
    wavy = bd.Face.extrude(bd.Spline((0, 0), (4, 1), (8, 0)), (0, 0, 4))
    shape = bd.Solid.thicken(wavy, 0.3).wrapped
    write_step(shape, tmp_path / "a.step")
    assert not is_ours(tmp_path / "a.step")
    require_same(read_step(tmp_path / "a.step"), shape, 1e-5, 1e-5)


def test_zeros_have_no_sign(tmp_path: Path) -> None:
    write_step((bd.Rot(90, 0, 180) * bd.Cone(3, 1, 5)).wrapped, tmp_path / "a.step")
    assert "-0." not in re.sub(r"-0\.\d", "", (tmp_path / "a.step").read_text())


def uncertainty(path: Path) -> float:
    return float(re.findall(r"LENGTH_MEASURE\(([^)]*)\)", path.read_text())[0])


def test_the_uncertainty_is_how_far_edges_are_from_their_faces_not_what_somebody_stated(tmp_path: Path) -> None:
    shape = bd.Box(3, 4, 5).wrapped
    ShapeFix_ShapeTolerance().SetTolerance(shape, 1e-3)
    write_step(shape, tmp_path / "box.step")
    assert uncertainty(tmp_path / "box.step") == 1e-7
    # Ours are closer than any file states; the kernel's own sections of a cone are not.
    cut = (bd.Cone(4, 2, 6) - bd.Rot(20, 70, 0) * bd.Pos(1, 0, 0) * bd.Cylinder(1, 9)).wrapped
    write_step(MADE["cut to its box"](), tmp_path / "ours.step")
    assert uncertainty(tmp_path / "ours.step") == 1e-7
    write_step(cut, tmp_path / "cut.step")
    gaps = []
    for face in parts_of(cut, TopAbs_FACE):
        for edge in parts_of(face, TopAbs_EDGE):
            curve, on_face = BRepAdaptor_Curve(as_edge(edge)), BRepAdaptor_Curve(as_edge(edge), as_face(face))
            places = np.linspace(curve.FirstParameter(), curve.LastParameter(), 24).tolist()
            gaps.append(max(curve.Value(at).Distance(on_face.Value(at)) for at in places))
    assert 1e-7 < 0.9 * max(gaps) < uncertainty(tmp_path / "cut.step") < 2 * max(gaps)


def test_a_ball_that_holes_leave_both_poles_is_written_without_its_seam(tmp_path: Path) -> None:
    shape = (bd.Sphere(3) - bd.Rot(20, 70, 0) * bd.Cylinder(1, 9) - bd.Box(1, 9, 1)).wrapped
    write_step(shape, tmp_path / "a.step")
    loops = re.findall(r"EDGE_LOOP\('',\(([^)]*)\)", (tmp_path / "a.step").read_text())
    edges = dict(re.findall(r"(#\d+)=ORIENTED_EDGE\('',\*,\*,(#\d+)", (tmp_path / "a.step").read_text()))
    used = [[edges[use] for use in loop.split(",")] for loop in loops]
    # That of the hole's cylinder alone is there.
    assert sum(len(loop) - len(set(loop)) for loop in used) == 1
    back = read_step(tmp_path / "a.step")
    assert is_valid(back)
    assert measure(back) == pytest.approx(measure(shape), rel=1e-6)

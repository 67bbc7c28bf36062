"""What a STEP file holds, in its colours: against assemblies that CadQuery and build123d wrote."""

from __future__ import annotations

from pathlib import Path

import build123d as bd
import pytest
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import topology
from gyroid_cad.kernel.coloured import Colour, coloured_shapes
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.step import write_step

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
ORANGE = (0.8, 0.4, 0.1)


def centre(shape: TopoDS_Shape) -> tuple[float, ...]:
    return tuple((bounding_box(shape).mean(axis=0).round(6) + 0.0).tolist())


def rounded(colour: Colour) -> Colour:
    return None if colour is None else tuple(round(part, 4) + 0.0 for part in colour)  # type: ignore[return-value]


def in_cadquery(path: Path) -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    box = cq.Workplane().box(1, 1, 1).val()
    pair = cq.Assembly(name="pair")
    pair.add(box, name="left", color=cq.Color(*RED))
    pair.add(cq.Workplane().sphere(0.5).val(), name="right", loc=cq.Location((3, 0, 0)), color=cq.Color(*ORANGE))
    whole = cq.Assembly(name="whole")
    whole.add(pair, name="first")
    whole.add(pair, name="second", loc=cq.Location((0, 10, 0), (0, 0, 1), 90))
    whole.export(str(path))


def in_build123d(path: Path) -> None:
    def pair(label: str) -> bd.Compound:
        left, right = bd.Box(1, 1, 1), bd.Pos(3) * bd.Sphere(0.5)
        left.color, right.color = bd.Color(*RED), bd.Color(*ORANGE)
        return bd.Compound(label=label, children=[left, right])

    second = bd.Pos(0, 10, 0) * bd.Rot(0, 0, 90) * pair("second")
    bd.export_step(bd.Compound(label="whole", children=[pair("first"), second]), path)


@pytest.fixture(scope="module", params=[in_cadquery, in_build123d])
def nested(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two pairs, one of them moved and turned; a pair is a red box and an orange ball."""
    path: Path = tmp_path_factory.mktemp("nested") / "nested.step"
    request.param(path)
    return path


def test_shapes_of_nested_assemblies_stand_where_their_places_carry_them_in_their_colours(nested: Path) -> None:
    found = {centre(shape): rounded(colour) for shape, colour in coloured_shapes(nested)}
    assert found == {(0, 0, 0): RED, (3, 0, 0): ORANGE, (0, 10, 0): RED, (0, 13, 0): ORANGE}


def test_faces_of_other_colours_than_their_solids_are_taken_apart_and_none_is_lost(tmp_path: Path) -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    box = cq.Workplane().box(2, 2, 2)
    assembly = cq.Assembly(name="painted")
    assembly.add(box, name="box", color=cq.Color(*BLUE))
    assembly["box"].addSubshape(box.faces(">Z").val(), color=cq.Color(*RED))
    assembly.add(box.translate((5, 0, 0)), name="plain")
    assembly.export(str(tmp_path / "painted.step"))
    found = coloured_shapes(tmp_path / "painted.step")
    counted = {(rounded(colour), centre(shape)): topology(shape).faces for shape, colour in found}
    assert counted[RED, (0, 0, 1)] == 1
    assert counted[BLUE, (0, 0, 0)] == 5
    assert sum(counted.values()) == 12


def test_a_file_that_says_nothing_of_colours_holds_its_shape_whole(tmp_path: Path) -> None:
    write_step(bd.Box(1, 2, 3).wrapped, tmp_path / "plain.step")
    ((shape, colour),) = coloured_shapes(tmp_path / "plain.step")
    assert colour is None
    assert topology(shape).solids == 1


def test_what_is_no_step_file_is_an_export_error(tmp_path: Path) -> None:
    (tmp_path / "text.step").write_text("text")
    for name in ("text.step", "missing.step"):
        with pytest.raises(ExportError, match="could not be read as STEP"):
            coloured_shapes(tmp_path / name)

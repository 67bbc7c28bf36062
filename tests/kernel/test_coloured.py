"""What a STEP file holds, in its colours: against assemblies that CadQuery and build123d wrote."""

from __future__ import annotations

from pathlib import Path

import build123d as bd
import pytest
from OCP.TopAbs import TopAbs_FACE

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.check import parts_of, topology
from gyroid_cad.kernel.coloured import ColouredPart, OwnColour, coloured_parts, diagonal_of
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.step import write_step

RED, BLUE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
ORANGE = (0.8, 0.4, 0.1)


def rounded(colour: OwnColour) -> OwnColour:
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


def middles(part: ColouredPart) -> list[tuple[float, ...]]:
    """Of a part, in each of its places."""
    found = part.places[..., :3] @ bounding_box(part.shape).mean(axis=0) + part.places[..., 3]
    return [tuple(middle) for middle in (found.round(6) + 0.0).tolist()]


def test_parts_of_nested_assemblies_are_found_once_and_where_their_places_carry_them(nested: Path) -> None:
    found: dict[OwnColour, list[tuple[float, ...]]] = {}
    for part in coloured_parts(nested):
        (colour,) = set(map(rounded, part.colours))
        found[colour] = sorted(found.get(colour, []) + middles(part))
    assert found == {RED: [(0, 0, 0), (0, 10, 0)], ORANGE: [(0, 13, 0), (3, 0, 0)]}


def test_faces_have_their_own_colours_or_those_of_their_part(tmp_path: Path) -> None:
    """Two parts, each with a face of its own colour: neither gets those of the other."""
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    assembly = cq.Assembly(name="painted")
    for name, place, side in (("one", (0, 0, 0), ">Z"), ("other", (5, 0, 0), "<X")):
        box = cq.Workplane().box(2, 2, 2 if name == "one" else 3)
        assembly.add(box, name=name, loc=cq.Location(place), color=cq.Color(*BLUE))
        assembly[name].addSubshape(box.faces(side).val(), color=cq.Color(*RED))
    assembly.add(cq.Workplane().box(1, 1, 1), name="plain", loc=cq.Location((9, 0, 0)))
    assembly.export(str(tmp_path / "painted.step"))
    red = {}
    for part in coloured_parts(tmp_path / "painted.step"):
        faces = zip(parts_of(part.shape, TopAbs_FACE), part.colours, strict=True)
        red[middles(part)[0]] = [
            tuple(bounding_box(face).mean(axis=0)) for face, colour in faces if rounded(colour) == RED
        ]
    assert red == {(0, 0, 0): [pytest.approx((0, 0, 1))], (5, 0, 0): [pytest.approx((-1, 0, 0))], (9, 0, 0): []}


def test_an_occurrence_s_own_colour_goes_before_that_of_its_part(tmp_path: Path) -> None:
    cq = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    box = cq.Workplane().box(1, 1, 1)
    assembly = cq.Assembly(name="two")
    assembly.add(box, name="blue", color=cq.Color(*BLUE))
    assembly.add(box, name="red", loc=cq.Location((3, 0, 0)), color=cq.Color(*RED))
    assembly.export(str(tmp_path / "two.step"))
    found = {rounded(part.colours[0]): middles(part) for part in coloured_parts(tmp_path / "two.step")}
    assert found == {BLUE: [(0, 0, 0)], RED: [(3, 0, 0)]}


def test_a_file_that_says_nothing_of_colours_holds_its_shape_whole(tmp_path: Path) -> None:
    write_step(bd.Box(1, 2, 3).wrapped, tmp_path / "plain.step")
    (part,) = coloured_parts(tmp_path / "plain.step")
    assert part.colours == (None,) * 6
    assert topology(part.shape).solids == 1
    assert diagonal_of([part]) == pytest.approx(14**0.5, abs=1e-3)


def test_what_is_no_step_file_is_an_export_error(tmp_path: Path) -> None:
    (tmp_path / "text.step").write_text("text")
    for name in ("text.step", "missing.step"):
        with pytest.raises(ExportError, match="could not be read"):
            coloured_parts(tmp_path / name)

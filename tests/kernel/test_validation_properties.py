"""Volume and area stand in a STEP file as the CAx-IF's practice has them, for receivers to compare theirs with."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.IFSelect import IFSelect_RetDone
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TDF import TDF_Label
from OCP.TopAbs import TopAbs_SOLID
from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool, XCAFDoc_Volume

from gyroid_cad.common.formats import SCHEMAS
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.assembly import new_document, read_bodies
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import LabelSequence
from gyroid_cad.kernel.step import write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(5)


def read(path: Path) -> list[tuple[float, float]]:
    """Volume and area of the root, and of the products of an assembly, as a receiver finds them in a file."""
    document, reader = new_document(), STEPCAFControl_Reader()
    reader.SetPropsMode(True)
    assert reader.ReadFile(str(path)) == IFSelect_RetDone
    assert reader.Transfer(document)
    labels = LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(labels)
    root, parts, found = labels.First(), LabelSequence(), []
    XCAFDoc_ShapeTool.GetComponents_s(root, parts)
    for component in [None, *(parts.Value(number) for number in range(1, min(parts.Length(), 1) + 1))]:
        label = root if component is None else TDF_Label()
        if component is not None:
            assert XCAFDoc_ShapeTool.GetReferredShape_s(component, label)
        volume, area = XCAFDoc_Volume(), XCAFDoc_Area()
        assert label.FindAttribute(XCAFDoc_Volume.GetID_s(), volume)
        assert label.FindAttribute(XCAFDoc_Area.GetID_s(), area)
        found.append((volume.Get(), area.Get()))
    return found


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("trim", [None, "box"])
def test_a_receiver_finds_the_volume_and_the_area_that_the_report_tells(schema: Any, trim: Any, tmp_path: Path) -> None:
    lattice = Lattice((1, 1, 1), 5.0, 0.6, trim=trim, fit=COARSE)
    lattice.write(tmp_path / "a.step", schema=schema)
    ((volume, area),) = read(tmp_path / "a.step")
    assert volume == pytest.approx(lattice.report().volume, rel=1e-11)
    assert area == pytest.approx(lattice.report().area, rel=1e-11)


def test_of_a_filled_part_too(tmp_path: Path) -> None:
    made = fill(BRepPrimAPI_MakeBox(4, 4, 4).Shape(), 8.0, density=0.3, kind="channels", fit=COARSE)
    made.write(tmp_path / "a.step")
    assert read(tmp_path / "a.step") == [pytest.approx((made.report.volume, made.report.area), rel=1e-11)]


def test_of_an_assembly_those_of_its_part_and_of_all_of_it(tmp_path: Path) -> None:
    lattice = Lattice((2, 1, 1), 5.0, 0.6, fit=COARSE)
    lattice.write(tmp_path / "a.step", instances=True)
    whole, part = read(tmp_path / "a.step")
    assert whole == pytest.approx([2 * value for value in part], rel=1e-11)
    assert whole[0] == pytest.approx(lattice.report().volume, rel=1e-9)


def test_properties_are_named_as_the_practice_has_them_and_measured_in_cubic_and_square_millimetres(
    tmp_path: Path,
) -> None:
    lattice = Lattice((1, 1, 1), 5.0, 0.6, fit=COARSE)
    lattice.write(tmp_path / "a.step")
    text = (tmp_path / "a.step").read_text()
    entities = dict(re.findall(r"^#(\d+)=(.*);$", text, re.MULTILINE))
    for name, item, power in (("volume", "volume measure", "3."), ("surface area", "surface area measure", "2.")):
        (shape,) = re.findall(rf"PROPERTY_DEFINITION\('geometric validation property','{name}',#(\d+)\)", text)
        assert entities[shape].startswith("PRODUCT_DEFINITION_SHAPE(")
        (measured,) = re.findall(rf"REPRESENTATION\('{name}',\(#(\d+)\),#\d+\)", text)
        assert entities[measured].startswith(f"MEASURE_REPRESENTATION_ITEM('{item}',")
        (element,) = re.findall(r"#(\d+)", entities[re.findall(r"#(\d+)", entities[measured])[-1]])
        assert re.fullmatch(rf"DERIVED_UNIT_ELEMENT\(#\d+,{power}\)", entities[element])


def test_of_a_shape_whose_size_nobody_gave_nothing_is_said(cell: Lattice, tmp_path: Path) -> None:
    write_step(cell.solid(), tmp_path / "a.step")
    assert "validation" not in (tmp_path / "a.step").read_text()


def test_solids_of_a_filled_part_bear_the_names_of_their_domains(tmp_path: Path) -> None:
    made = fill(BRepPrimAPI_MakeBox(4, 4, 4).Shape(), 8.0, density=0.3, kind="channels", fit=COARSE)
    made.write(tmp_path / "a.step")
    _, names = read_bodies(tmp_path / "a.step")
    assert [name for _, name in names] == [name for name, shape in made.domains.items() for _ in solids_in(shape)]
    assert {name for _, name in names} == {"channel-a", "channel-b"}


def solids_in(shape: Any) -> Any:
    return parts_of(shape, TopAbs_SOLID)

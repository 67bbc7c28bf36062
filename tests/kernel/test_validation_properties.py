"""Volume, area and centroid stand in a STEP file as the CAx-IF has them, for receivers to compare theirs with."""

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
from OCP.XCAFDoc import XCAFDoc_Area, XCAFDoc_Centroid, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool, XCAFDoc_Volume

from gyroid_cad.common.formats import SCHEMAS
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.assembly import new_document, read_bodies
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import LabelSequence
from gyroid_cad.kernel.step import write_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.areas import ShapeSize, joint_size

COARSE = FitSettings(5)


def read(path: Path) -> list[ShapeSize]:
    """Size of the root, and of the products of an assembly, as a receiver finds them in a file."""
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
        volume, area, centroid = XCAFDoc_Volume(), XCAFDoc_Area(), XCAFDoc_Centroid()
        assert label.FindAttribute(XCAFDoc_Volume.GetID_s(), volume)
        assert label.FindAttribute(XCAFDoc_Area.GetID_s(), area)
        place = None
        # One that is not there is not to be asked for: the kernel's binding crashes.
        if label.IsAttribute(XCAFDoc_Centroid.GetID_s()):
            assert label.FindAttribute(XCAFDoc_Centroid.GetID_s(), centroid)
            place = centroid.Get()
        found.append(ShapeSize(volume.Get(), area.Get(), place and (place.X(), place.Y(), place.Z())))
    return found


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("trim", [None, "box"])
def test_a_receiver_finds_the_volume_and_the_area_that_the_report_tells(schema: Any, trim: Any, tmp_path: Path) -> None:
    lattice = Lattice((1, 1, 1), 5.0, 0.6, trim=trim, fit=COARSE)
    lattice.write(tmp_path / "a.step", schema=schema)
    (found,) = read(tmp_path / "a.step")
    assert found.volume == pytest.approx(lattice.report().volume, rel=1e-11)
    assert found.area == pytest.approx(lattice.report().area, rel=1e-11)
    assert found.centroid == pytest.approx((2.5, 2.5, 2.5), abs=1e-6)


def test_of_a_filled_part_too(tmp_path: Path) -> None:
    made = fill(BRepPrimAPI_MakeBox(4, 4, 4).Shape(), 8.0, density=0.3, kind="channels", fit=COARSE)
    made.write(tmp_path / "a.step")
    (found,) = read(tmp_path / "a.step")
    assert (found.volume, found.area) == pytest.approx((made.report.volume, made.report.area), rel=1e-11)
    assert found.centroid == pytest.approx(joint_size([*made.sizes["channel-a"], *made.sizes["channel-b"]]).centroid)


@pytest.mark.parametrize("schema", SCHEMAS)
def test_each_of_several_solids_has_its_own_besides(schema: Any, tmp_path: Path) -> None:
    made = fill(BRepPrimAPI_MakeBox(4, 4, 4).Shape(), 8.0, density=0.3, kind="channels", fit=COARSE)
    made.write(tmp_path / "a.step", schema=schema)
    wanted = {name: size for name in made.domains for size in made.sizes[name]}
    assert len(wanted) == made.report.solids > 1
    found = read_of_solids(tmp_path / "a.step")
    assert found.keys() == wanted.keys()
    for name, size in wanted.items():
        assert size.centroid is not None
        assert found[name] == pytest.approx([size.volume, size.area, *size.centroid], rel=1e-11, abs=1e-11)
    (whole,) = read(tmp_path / "a.step")
    assert whole.volume == pytest.approx(made.report.volume, rel=1e-11)


def read_of_solids(path: Path) -> dict[str, list[float]]:
    """Volume, area and centroid of each solid by its name, along the references from it to its properties."""
    entities = dict(re.findall(r"^#(\d+)=(.*);$", path.read_text(), re.MULTILINE))
    text, found = "\n".join(f"#{number}={entity}" for number, entity in entities.items()), {}
    for aspect, solid in re.findall(r"GEOMETRIC_ITEM_SPECIFIC_USAGE\('','',#(\d+),#\d+,#(\d+)\)", text):
        assert entities[aspect].startswith("SHAPE_ASPECT(")
        (name,) = re.findall(r"^MANIFOLD_SOLID_BREP\('([^']*)'", entities[solid])
        found[name] = []
        for kind in ("volume", "surface area", "centroid"):
            (own,) = re.findall(
                rf"#(\d+)=PROPERTY_DEFINITION\('geometric validation property','{kind}',#{aspect}\)", text
            )
            (representation,) = re.findall(rf"PROPERTY_DEFINITION_REPRESENTATION\(#{own},#(\d+)\)", text)
            (item,) = re.findall(rf"^REPRESENTATION\('{kind}',\(#(\d+)\)", entities[representation])
            found[name] += [float(number) for number in re.findall(r"-?\d+\.\d*(?:E[-+]\d+)?", entities[item])]
    return found


def test_where_the_kernel_measures_a_skin_no_centroid_is_stated(tmp_path: Path) -> None:
    made = fill(BRepPrimAPI_MakeBox(4, 4, 4).Shape(), 8.0, density=0.3, skin=0.5, openings=[">Z"], fit=COARSE)
    made.write(tmp_path / "a.step")
    (found,) = read(tmp_path / "a.step")
    assert found.volume == pytest.approx(made.report.volume, rel=1e-11)
    assert found.centroid is None


def test_of_an_assembly_those_of_its_part_and_of_all_of_it(tmp_path: Path) -> None:
    lattice = Lattice((2, 1, 1), 5.0, 0.6, fit=COARSE)
    lattice.write(tmp_path / "a.step", instances=True)
    whole, part = read(tmp_path / "a.step")
    assert (whole.volume, whole.area) == pytest.approx((2 * part.volume, 2 * part.area), rel=1e-11)
    assert whole.volume == pytest.approx(lattice.report().volume, rel=1e-9)
    assert (part.centroid, whole.centroid) == (pytest.approx((2.5, 2.5, 2.5)), pytest.approx((5.0, 2.5, 2.5)))


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
    (point,) = re.findall(r"REPRESENTATION\('centroid',\(#(\d+)\),#\d+\)", text)
    assert entities[point].startswith("CARTESIAN_POINT('centre point',(")


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

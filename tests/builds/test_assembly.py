"""STEP assemblies: one cell, named, coloured, and found wherever the lattice has one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest
from OCP.BRep import BRep_Tool
from OCP.IFSelect import IFSelect_RetDone
from OCP.Interface import Interface_Static
from OCP.Quantity import Quantity_Color
from OCP.STEPCAFControl import STEPCAFControl_Reader
from OCP.TCollection import TCollection_ExtendedString
from OCP.TDataStd import TDataStd_Name
from OCP.TDF import TDF_Label
from OCP.TDocStd import TDocStd_Document
from OCP.TopoDS import TopoDS_Shape
from OCP.XCAFApp import XCAFApp_Application
from OCP.XCAFDoc import XCAFDoc_ColorGen, XCAFDoc_ColorSurf, XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

from gyroid_cad.common import memory
from gyroid_cad.errors import ExportError, KernelError, ParameterError
from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.compat import LabelSequence, as_face
from gyroid_cad.kernel.step import read_step
from gyroid_cad.kernel.surfaces import nurbs_of_surface
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.complex import build_complex

CELLS, SIZE = (3, 2, 2), 10.0
COARSE = FitSettings(5)


@dataclass(frozen=True)
class ReadBack:
    """An assembly as the kernel's reader finds it in a file."""

    document: TDocStd_Document
    root: TDF_Label
    instances: dict[str, tuple[float, ...]]
    parts: list[TDF_Label]

    @property
    def part(self) -> TopoDS_Shape:
        return XCAFDoc_ShapeTool.GetShape_s(self.parts[0])

    @property
    def faces(self) -> dict[str, tuple[Any, str]]:
        """Face and colour, by name; of the part's colour where a face has none of its own."""
        labels = LabelSequence()
        XCAFDoc_ShapeTool.GetSubShapes_s(self.parts[0], labels)
        whole = colour_of(self.parts[0])
        found = [labels.Value(i) for i in range(1, labels.Length() + 1)]
        return {
            name_of(label): (as_face(XCAFDoc_ShapeTool.GetShape_s(label)), colour_of(label) or whole) for label in found
        }


def name_of(label: TDF_Label) -> str:
    name = TDataStd_Name()
    assert label.FindAttribute(TDataStd_Name.GetID_s(), name)
    return name.Get().ToExtString()


def colour_of(label: TDF_Label) -> str:
    colour = Quantity_Color()
    for kind in (XCAFDoc_ColorSurf, XCAFDoc_ColorGen):
        if XCAFDoc_DocumentTool.ColorTool_s(label).GetColor_s(label, kind, colour):
            return Quantity_Color.StringName_s(colour.Name())
    return ""


def read_assembly(path: Path) -> ReadBack:
    document = TDocStd_Document(TCollection_ExtendedString("BinXCAF"))
    XCAFApp_Application.GetApplication_s().InitDocument(document)
    # The first reader of a process registers the settings.
    reader = STEPCAFControl_Reader()
    assert Interface_Static.SetIVal_s("read.stepcaf.subshapes.name", 1)
    assert reader.ReadFile(str(path)) == IFSelect_RetDone
    assert reader.Transfer(document)
    roots, components = LabelSequence(), LabelSequence()
    XCAFDoc_DocumentTool.ShapeTool_s(document.Main()).GetFreeShapes(roots)
    assert roots.Length() == 1
    XCAFDoc_ShapeTool.GetComponents_s(roots.First(), components)
    instances, parts = {}, []
    for i in range(1, components.Length() + 1):
        label, part = components.Value(i), TDF_Label()
        assert XCAFDoc_ShapeTool.GetReferredShape_s(label, part)
        placement = XCAFDoc_ShapeTool.GetLocation_s(label).Transformation()
        assert np.array_equal([[placement.Value(r, c) for c in (1, 2, 3)] for r in (1, 2, 3)], np.eye(3))
        instances[name_of(label)] = tuple(placement.Value(r, 4) for r in (1, 2, 3))
        if not any(part.IsEqual(other) for other in parts):
            parts.append(part)
    return ReadBack(document, roots.First(), instances, parts)


@pytest.fixture(scope="module")
def lattice() -> Lattice:
    return Lattice(CELLS, SIZE, 0.8, fit=COARSE)


@pytest.fixture(scope="module", params=["ap214", "ap242"])
def path(request: pytest.FixtureRequest, lattice: Lattice, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("assembly") / "block.step"
    lattice.write(file, schema=request.param, instances=True)
    return file


@pytest.fixture(scope="module")
def read(path: Path) -> Iterator[ReadBack]:
    return read_assembly(path)


def test_every_cell_of_the_lattice_is_an_instance_of_one_part_at_its_place(read: ReadBack) -> None:
    assert len(read.parts) == 1
    expected = {f"CC_{i + 1}_{j + 1}_{k + 1}": (i * SIZE, j * SIZE, k * SIZE) for i, j, k in np.ndindex(CELLS)}
    assert read.instances == expected
    assert (name_of(read.root), name_of(read.parts[0])) == ("block", "CC")


def test_the_part_is_one_valid_closed_solid_and_all_cells_have_the_merged_volume(
    read: ReadBack, lattice: Lattice
) -> None:
    counted = topology(read.part)
    assert is_valid(read.part)
    assert counted.closed
    assert counted.solids == 1
    assert len(read.instances) * enclosed_volume(read.part) == pytest.approx(lattice.built().volume, rel=1e-8)


def test_a_reader_that_knows_no_assemblies_finds_as_many_solids_in_their_places(path: Path, lattice: Lattice) -> None:
    shape = read_step(path)
    assert topology(shape).solids == np.prod(CELLS)
    assert enclosed_volume(shape) == pytest.approx(lattice.built().volume, rel=1e-8)


def test_a_patch_is_yellow_its_bounding_cell_red_and_the_cubic_cell_green(read: ReadBack) -> None:
    patch = {name.rpartition("_side_")[0] or name.rpartition("_edge_")[0]: c for name, (_, c) in read.faces.items()}
    assert Counter(patch.values()) == {"YELLOW": 1, "RED": 5, "GREEN": 18}
    assert patch["BC_1_SFP_1"] == "YELLOW"
    assert {name for name, colour in patch.items() if colour == "RED"} == {f"BC_1_SFP_{k}" for k in range(2, 7)}
    assert len(read.faces) == topology(read.part).faces


def test_each_face_bears_the_name_of_the_patch_whose_control_points_it_has(read: ReadBack, lattice: Lattice) -> None:
    wall = Lattice((1, 1, 1), SIZE, 0.8, fit=COARSE).wall()
    number = dict.fromkeys(range(4), 0)
    for patch, group in enumerate(wall.complex.placements.bounding_cell.tolist()):
        number[group] += 1
        for side in (0, 1):
            face, _ = read.faces[f"BC_{group + 1}_SFP_{number[group]}_side_{side}"]
            expected = wall.nets[wall.patch_net[patch], side] + wall.shifts[wall.patch_shift[patch]]
            found = nurbs_of_surface(BRep_Tool.Surface_s(face)).control_points
            # A reader may turn the parameters round.
            assert np.allclose(
                np.sort(found.reshape(-1, 3), axis=0), np.sort(expected.reshape(-1, 3), axis=0), atol=1e-7
            )


def test_faces_through_the_wall_are_named_by_the_free_edges_they_stand_on(read: ReadBack) -> None:
    complex = build_complex((1, 1, 1))
    named = sorted(int(name[-1]) for name in read.faces if "_edge_" in name)
    assert named == sorted((np.nonzero(complex.free[complex.patch_edges])[1] + 1).tolist())


@pytest.mark.parametrize("surface", SURFACES)
def test_every_surface_of_the_table_makes_an_assembly(surface: str, tmp_path: Path) -> None:
    lattice = Lattice((1, 1, 2), SIZE, density=0.2, fit=COARSE, surface=surface)
    lattice.write(tmp_path / "two.stp", instances=True)
    read = read_assembly(tmp_path / "two.stp")
    assert read.instances == {"CC_1_1_1": (0.0, 0.0, 0.0), "CC_1_1_2": (0.0, 0.0, SIZE)}
    assert {colour for _, colour in read.faces.values()} == {"YELLOW", "RED", "GREEN"}
    report = lattice.assembly_report()
    assert report.instances == 2
    assert report.valid
    assert report.closed
    assert report.volume == pytest.approx(2 * enclosed_volume(read.part), rel=1e-8)


def test_more_cells_cost_a_few_hundred_bytes_each(lattice: Lattice, tmp_path: Path) -> None:
    sizes = []
    for cells in ((1, 1, 1), (4, 5, 5)):
        file = tmp_path / f"{cells[0]}.step"
        Lattice(cells, SIZE, 0.8, fit=COARSE).write(file, instances=True)
        sizes.append(file.stat().st_size)
    assert sizes[1] - sizes[0] < 99 * 700


def test_build123d_reads_the_tree_with_its_name_and_colour(path: Path) -> None:
    import build123d

    tree = build123d.import_step(path)
    assert tree.label == "block"
    assert sorted(tuple(child.location.position) for child in tree.children) == sorted(
        (i * SIZE, j * SIZE, k * SIZE) for i, j, k in np.ndindex(CELLS)
    )
    assert {tuple(child.color) for child in tree.children} == {(0.0, 1.0, 0.0, 1.0)}


def test_cadquery_reads_the_tree_with_its_names(path: Path) -> None:
    cadquery = pytest.importorskip("cadquery", reason="no CadQuery for this kernel")
    assembly = cadquery.Assembly.importStep(str(path))
    assert [child.name for child in assembly.children] == [
        f"CC_{i + 1}_{j + 1}_{k + 1}" for i, j, k in np.ndindex(CELLS)
    ]


def varying(x: Any, y: Any, z: Any) -> Any:
    return 0.8 + 0.01 * x


@pytest.mark.parametrize(
    "settings",
    [{"thickness": varying}, {"thickness": 0.8, "map": "twist:angle=10"}, {"thickness": 0.8, "trim": "box"}],
    ids=["varying", "mapped", "trimmed"],
)
def test_cells_that_differ_or_are_cut_have_no_part_in_common(settings: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="instances = True: expected a lattice whose cells are uniform"):
        Lattice((2, 1, 1), SIZE, **settings).write(tmp_path / "none.step", instances=True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["part.stl", "part.brep", "part.3mf"])
def test_only_step_holds_an_assembly(name: str, lattice: Lattice, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"an assembly: a file name ending in \.step, \.stp"):
        lattice.write(tmp_path / "part.step", tmp_path / name, instances=True)
    assert not list(tmp_path.iterdir())


def test_a_given_moment_makes_files_of_the_same_bytes_whatever_was_written_before(
    lattice: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    contents = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        lattice.write(tmp_path / folder / "part.step", instances=True)
        contents.append((tmp_path / folder / "part.step").read_bytes())
    assert contents[0] == contents[1]
    assert b"1970-01-01T00:00:00" in contents[0]


def test_the_kernels_settings_are_put_back(lattice: Lattice, tmp_path: Path) -> None:
    lattice.write(tmp_path / "first.step", instances=True)
    texts, numbers = ("write.step.schema", "write.step.product.name"), ("write.stepcaf.subshapes.name",)
    Interface_Static.SetCVal_s("write.step.product.name", "another's")
    before = [*map(Interface_Static.CVal_s, texts), *map(Interface_Static.IVal_s, numbers)]
    lattice.write(tmp_path / "second.step", schema="ap242", instances=True)
    assert [*map(Interface_Static.CVal_s, texts), *map(Interface_Static.IVal_s, numbers)] == before


def test_a_full_disk_leaves_the_older_file_and_nothing_else(lattice: Lattice, tmp_path: Path, disk_full: Any) -> None:
    older = tmp_path / "part.step"
    older.write_text("older")
    lattice.assembly()
    with disk_full(100_000), pytest.raises(ExportError, match="was not written"):
        lattice.write(older, instances=True)
    assert older.read_text() == "older"
    assert list(tmp_path.iterdir()) == [older]


def test_an_invalid_cell_is_not_written(lattice: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = lattice.assembly()
    monkeypatch.setattr(made.cell, "_valid", False)
    with pytest.raises(KernelError, match="invalid; nothing was written"):
        made.write(tmp_path / "part.step")
    assert not list(tmp_path.iterdir())


def test_more_instances_than_memory_holds_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Lattice((10, 10, 10), SIZE, 0.8, fit=COARSE).assembly()
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=memory._BASE_BYTES + 2_000_000))
    with pytest.raises(ParameterError, match=r"cells = \(10, 10, 10\): expected at most about 200 cells"):
        made.write(tmp_path / "part.step")
    assert not list(tmp_path.iterdir())

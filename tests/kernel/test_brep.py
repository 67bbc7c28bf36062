"""BREP: the kernel's own format, there and back."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepTools import BRepTools
from OCP.TopAbs import TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.lattice import Lattice


def read(path: Path) -> TopoDS_Shape:
    shape = TopoDS_Shape()
    assert BRepTools.Read_s(shape, str(path), BRep_Builder())
    return shape


def test_a_solid_comes_back_valid_closed_and_as_full_as_it_was(block: Lattice, tmp_path: Path) -> None:
    write_brep(block.solid(), tmp_path / "block.brep")
    back = read(tmp_path / "block.brep")
    assert back.ShapeType() == TopAbs_SOLID
    assert topology(back) == topology(block.solid())
    assert topology(back).closed
    assert is_valid(back)
    assert enclosed_volume(back) == pytest.approx(enclosed_volume(block.solid()), rel=1e-14)


def test_a_second_copy_through_a_file_is_the_first_to_the_last_byte(cell: Lattice, tmp_path: Path) -> None:
    first, second = tmp_path / "first.brep", tmp_path / "second.brep"
    write_brep(cell.solid(), first)
    write_brep(read(first), second)
    assert first.read_bytes() == second.read_bytes()


def test_shared_geometry_is_written_once(tmp_path: Path, cell: Lattice, block: Lattice) -> None:
    """A file of eight cells is far smaller than eight files of one: all cells use the same surfaces."""
    single = Lattice((1, 1, 1), block.cell_size, block.thickness)
    write_brep(single.solid(), tmp_path / "one.brep")
    write_brep(block.solid(), tmp_path / "eight.brep")
    assert (tmp_path / "eight.brep").stat().st_size < 4 * (tmp_path / "one.brep").stat().st_size


def test_a_disk_that_fills_up_leaves_the_older_file_and_nothing_else(
    cell: Lattice, tmp_path: Path, disk_full: Callable[[int], AbstractContextManager[None]]
) -> None:
    path = tmp_path / "part.brep"
    path.write_text("older")
    with disk_full(10_000), pytest.raises(ExportError, match=r"part\.brep was not written"):
        write_brep(cell.solid(), path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_is_not_there_is_an_export_error(cell: Lattice, tmp_path: Path) -> None:
    with pytest.raises(ExportError):
        write_brep(cell.solid(), tmp_path / "nowhere" / "part.brep")
    assert not list(tmp_path.iterdir())

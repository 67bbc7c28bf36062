"""STEP files that are packed hold the same text, and what is no such file is refused in one line."""

from __future__ import annotations

import gzip
from pathlib import Path
from zipfile import ZipFile

import cadquery as cq
import pytest

from gyroid_cad.builds.file_check import check_file
from gyroid_cad.errors import ExportError
from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice

PACKED = ("cell.stpz", "cell.step.gz", "CELL.STP.GZ")


def text_in(path: Path) -> bytes:
    if path.suffix == ".stpz":
        with ZipFile(path) as archive:
            (name,) = archive.namelist()
            assert name == "cell.stp"
            return archive.read(name)
    return gzip.decompress(path.read_bytes())


@pytest.fixture
def plain(cell: Lattice, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> bytes:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    cell.write(tmp_path / "cell.step")
    return (tmp_path / "cell.step").read_bytes()


@pytest.mark.parametrize("name", PACKED)
def test_a_packed_file_holds_the_text_of_the_plain_one_in_less_than_a_quarter(
    cell: Lattice, plain: bytes, tmp_path: Path, name: str
) -> None:
    cell.write(tmp_path / name)
    assert text_in(tmp_path / name).lower() == plain.lower()
    assert (tmp_path / name).stat().st_size < len(plain) / 4
    before = (tmp_path / name).read_bytes()
    cell.write(tmp_path / name)
    assert (tmp_path / name).read_bytes() == before


@pytest.mark.parametrize("name", PACKED[:2])
def test_a_packed_file_is_checked_as_the_plain_one(cell: Lattice, tmp_path: Path, name: str) -> None:
    cell.write(tmp_path / "cell.step", tmp_path / name)
    one, other = (check_file(tmp_path / file).as_dict() for file in ("cell.step", name))
    assert {**one, "file": ""} == {**other, "file": ""}


def test_a_packed_part_is_filled_and_packed_again(tmp_path: Path) -> None:
    part = tmp_path / "part.step"
    cq.Workplane().box(3, 3, 3).export(str(part))
    (tmp_path / "part.stp.gz").write_bytes(gzip.compress(part.read_bytes()))
    filled = fill(tmp_path / "part.stp.gz", 5.0, density=0.3)
    filled.write(tmp_path / "filled.stpz")
    with ZipFile(tmp_path / "filled.stpz") as archive:
        assert archive.namelist() == ["filled.stp"]
        assert archive.testzip() is None
    assert filled.report.part_volume == pytest.approx(27)


def archived(**texts: bytes) -> bytes:
    from io import BytesIO

    with ZipFile(out := BytesIO(), "w") as archive:
        for name, text in texts.items():
            archive.writestr(name.replace("_", "."), text)
    return out.getvalue()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.stpz", b"ISO-10303-21;", "could not be unpacked: File is not a zip file"),
        ("a.stpz", archived(a_stp=b"1", b_stp=b"2"), "it holds 2 files (a.stp, b.stp), where exactly one is needed"),
        ("a.stpz", archived(a_txt=b"1"), "it holds 1 files (a.txt), where exactly one is needed, ending in .stp"),
        ("a.stpz", archived(), "it holds 0 files (none)"),
        ("a.stpz", archived(a_stp=b"1"), "could not be read as STEP: it does not begin as such a file does"),
        ("a.step.gz", b"ISO-10303-21;", "could not be unpacked: Not a gzipped file"),
        ("a.step.gz", gzip.compress(bytes(1000), mtime=0)[:-9], "could not be unpacked: Compressed file ended before"),
        ("a.step.gz", gzip.compress(bytes(10**7), mtime=0), "it holds over 500 times its own size"),
    ],
)
def test_what_is_no_packed_step_file_is_refused_in_one_line(
    tmp_path: Path, name: str, content: bytes, words: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ExportError) as caught:
        check_file(tmp_path / name)
    assert words in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert "\n" not in str(caught.value)

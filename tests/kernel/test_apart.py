"""Users' files are read in a process of their own: what crashes the kernel there is one line here."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import build123d as bd
import pytest

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.apart import Contents, read_apart, read_shape
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import topology
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step, write_step

HEADER = (
    "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
    "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\nENDSEC;\nDATA;\n"
)


@pytest.fixture(scope="module")
def peg(tmp_path_factory: pytest.TempPathFactory) -> Path:
    box = bd.Box(6, 5, 7)
    part = bd.fillet(box.edges().filter_by(bd.Axis.Z), 1) - bd.Cylinder(0.75, 7)
    path = tmp_path_factory.mktemp("peg") / "peg.step"
    write_step(part.solid().wrapped, path)
    write_brep(part.solid().wrapped, path.with_suffix(".brep"))
    return path


@pytest.mark.parametrize(("system", "ending"), [("linux", ".step"), ("linux", ".brep"), ("another system", ".step")])
def test_what_comes_from_the_other_process_is_what_the_reader_gives(
    peg: Path, system: str, ending: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Forked or a new Python.
    if system != "linux":
        monkeypatch.setattr("gyroid_cad.common.processes.sys.platform", system)
    given, own = read_shape(peg.with_suffix(ending)), read_step(peg)
    assert topology(given) == topology(own)
    assert measure(given) == pytest.approx(measure(own), rel=1e-9)


def test_brackets_in_brackets_that_crash_the_reader_are_one_line(tmp_path: Path) -> None:
    path = tmp_path / "nested.step"
    path.write_text(f"{HEADER}#1=A({'(' * 200_000}{')' * 200_000});\nENDSEC;\nEND-ISO-10303-21;\n")
    with pytest.raises(ExportError, match=r"nested\.step (could not be read: the kernel crashes on it|holds no shape)"):
        read_shape(path)


def test_a_damaged_file_that_crashes_the_reader_is_one_line(peg: Path, tmp_path: Path) -> None:
    # Where a line's vector is an entity that it does not know the kernel follows a null pointer.
    text = peg.read_text()
    assert "=VECTOR(" in text or "= VECTOR(" in text
    (tmp_path / "damaged.step").write_text(text.replace("VECTOR(", "VECTER(", 1))
    with pytest.raises(ExportError, match=r"damaged\.step could not be read: the kernel crashes on it"):
        read_shape(tmp_path / "damaged.step")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("nothere.step", None, "nothere.step could not be read: No such file or directory"),
        (
            "part.stl",
            b"solid a\nendsolid a\n",
            "part.stl could not be read: it is STL by its ending, where STEP or BREP is needed",
        ),
        ("part.3mf", b"PK", "it is 3MF by its ending"),
        ("part.step", b"", "part.step could not be read as STEP: it does not begin as such a file does"),
        ("part.step", b"solid a\nendsolid a\n", "part.step could not be read as STEP"),
        ("part.brep", b"ISO-10303-21;", "part.brep could not be read as BREP"),
        ("part", b"ISO-10303-21;\nHEADER;", "part could not be read as STEP"),
        ("part.step", f"{HEADER}ENDSEC;\nEND-ISO-10303-21;\n".encode(), "part.step holds no shape"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, name: str, content: bytes | None, words: str) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ExportError) as caught:
        read_shape(tmp_path / name)
    assert str(caught.value).startswith(str(tmp_path / name))
    assert words in str(caught.value)


def test_a_folder_and_a_device_are_no_files(tmp_path: Path) -> None:
    (tmp_path / "a.step").mkdir()
    with pytest.raises(ExportError, match="it is a folder"):
        read_shape(tmp_path / "a.step")
    if Path("/dev/zero").exists():
        (tmp_path / "b.step").symlink_to("/dev/zero")
        with pytest.raises(ExportError, match="it is a device or a pipe"):
            read_shape(tmp_path / "b.step")


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere file names are Unicode")
@pytest.mark.parametrize("ending", [".step", ".brep"])
def test_a_name_that_is_no_utf_8_is_read_too(peg: Path, tmp_path: Path, ending: str) -> None:
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/caf\xe9" + ending.encode()))
    path.write_bytes(peg.with_suffix(ending).read_bytes())
    assert topology(read_shape(path)).faces == topology(read_step(peg)).faces


def endless(path: str) -> Contents:
    time.sleep(60)
    return [], None


def test_a_program_that_does_not_end_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gyroid_cad.kernel.apart.SECONDS_AT_LEAST", 0.2)
    (tmp_path / "a.step").touch()
    start = time.perf_counter()
    with pytest.raises(ExportError, match=r"a\.step could not be read: the kernel was still at it after 0 s"):
        read_apart(tmp_path / "a.step", endless)
    assert time.perf_counter() - start < 10

"""By whom a STEP file is stands in its header, in letters of any script, and its names come back as they were given."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.IFSelect import IFSelect_RetDone
from OCP.StepBasic import StepBasic_Product
from OCP.STEPControl import STEPControl_Reader

from gyroid_cad.cli.app import main
from gyroid_cad.common.choices import SCHEMAS
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel import step as kernel_step
from gyroid_cad.kernel.step import reading_step, write_step
from gyroid_cad.kernel.step_geometry import UnknownGeometryError
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.header import StepHeader
from gyroid_cad.step.text import escaped, quoted
from gyroid_cad.surface.fit import FitSettings

TEXTS = ("Jörg Müller", "d'Île", "back\\slash", "山田\u3000太郎", "Ω \U0001d53e ü")
BOX = BRepPrimAPI_MakeBox(1.0, 2.0, 3.0).Shape()


def read(path: Path) -> tuple[str, str, str, str]:
    """Name, author and organisation in a file's header, and the name of its product, as the kernel reads them."""
    with reading_step():
        reader = STEPControl_Reader()
        assert reader.ReadFile(str(path)) == IFSelect_RetDone
        model = reader.StepModel()
        header = APIHeaderSection_MakeHeader(model)
        (product,) = (
            entity
            for entity in map(model.Value, range(1, model.NbEntities() + 1))
            if isinstance(entity, StepBasic_Product)
        )
        texts = (header.Name(), header.AuthorValue(1), header.OrganizationValue(1), product.Name())
        name, author, organisation, called = (text.ToCString() for text in texts)
    return name, author, organisation, called


@pytest.mark.parametrize("schema", SCHEMAS)
@pytest.mark.parametrize("text", TEXTS)
def test_names_and_authors_come_back_as_they_were_given(text: str, schema: Any, tmp_path: Path) -> None:
    write_step(BOX, tmp_path / "a.step", StepHeader(schema, text, text[::-1]), name=text)
    (tmp_path / "a.step").read_text(encoding="ascii")
    assert read(tmp_path / "a.step") == (text, text, text[::-1], text)


@pytest.mark.parametrize("text", [text for text in TEXTS if "\\" not in text])
def test_where_the_kernels_writer_is_asked_too(text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def unknown(*given: Any) -> None:
        raise UnknownGeometryError("nothing is known")

    monkeypatch.setattr(kernel_step, "products_of", unknown)
    write_step(BOX, tmp_path / "a.step", StepHeader("ap214", text, text[::-1]), name=text)
    (tmp_path / "a.step").read_text(encoding="ascii")
    assert read(tmp_path / "a.step") == (text, text, text[::-1], text)


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
@pytest.mark.parametrize("settings", [{}, {"trim": "box"}, {"instances": True}, {"kernel_check": True}])
def test_every_kind_of_lattice_names_its_author(settings: dict[str, Any], tmp_path: Path) -> None:
    own = {name: value for name, value in settings.items() if name == "trim"}
    lattice = Lattice((1, 1, 1), 5.0, 0.6, fit=FitSettings(4), **own)
    rest = settings.keys() - own.keys()
    lattice.write(tmp_path / "Würfel.step", author="Ann", organisation="Werk", **dict.fromkeys(rest, True))
    text = (tmp_path / "Würfel.step").read_text(encoding="ascii")
    assert f"FILE_NAME({quoted('Würfel')}," in text
    assert "('Ann'),('Werk')," in text


def test_characters_are_written_by_their_numbers_in_runs_of_one_width() -> None:
    assert escaped("a~ b") == "a~ b"
    assert escaped("äöa\u20ac") == "\\X2\\00E400F6\\X0\\a\\X2\\20AC\\X0\\"
    assert escaped("ä\U0001d53e") == "\\X4\\000000E40001D53E\\X0\\"


@pytest.mark.parametrize("bad", ["two\nlines", "a\x00", "\udc80", "a" * 257, 5, None])
@pytest.mark.parametrize("parameter", ["author", "organisation"])
def test_what_is_no_line_of_text_is_refused_before_anything_is_built(parameter: str, bad: Any, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=f"^{parameter} = .*: expected text of at most 256 characters in one line"):
        Lattice((1, 1, 1), 5.0, 0.6).write(tmp_path / "a.step", **{parameter: bad})
    assert not list(tmp_path.iterdir())


def test_the_shell_says_so_in_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    size = ["--cells", "1", "1", "1", "--cell-size", "5", "--thickness", "0.6"]
    assert main(["build", *size, "-o", str(tmp_path / "a.step"), "--author", "a\tb"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--author" in line
    assert "no control characters" in line

"""Printers come from a file, the package's or one's own."""

from __future__ import annotations

import tomllib
from importlib.resources import files
from pathlib import Path

import pytest

from gyroid_cad.errors import ParameterError
from gyroid_cad.printing.printers import printer_named, printers

OWN = """
[big]
name = "Big"
process = "resin"
build_volume = [300, 200.5, 400]
min_supported_wall = 0.3
min_unsupported_wall = 0.5
min_drain_hole = 4
"""


def test_the_form_2_is_as_its_maker_describes_it() -> None:
    printer = printer_named("form2")
    assert printer.build_volume == (145.0, 145.0, 175.0)
    assert (printer.min_supported_wall, printer.min_unsupported_wall) == (0.4, 0.6)
    assert printer.min_drain_hole == 3.5


def test_every_table_of_the_packages_file_is_a_printer() -> None:
    tables = tomllib.loads(files("gyroid_cad.printing").joinpath("printers.toml").read_text())
    assert list(printers()) == list(tables)
    assert all(printer.key == key for key, printer in printers().items())


def test_a_file_of_ones_own_is_read(tmp_path: Path) -> None:
    (tmp_path / "own.toml").write_text(OWN)
    printer = printer_named(str(tmp_path / "own.toml"))
    assert (printer.key, printer.build_volume, printer.min_drain_hole) == ("big", (300.0, 200.5, 400.0), 4.0)


def test_an_unknown_name_is_told_those_that_are_known() -> None:
    with pytest.raises(ParameterError, match=r"form2, or the path of a \.toml file") as caught:
        printer_named("prusa")
    assert str(caught.value).startswith("printer = 'prusa'")


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("name =", "nam =", "big.nam = 'Big': expected a known key: name, process"),
        ('name = "Big"\n', "", "the key name as well"),
        ('"Big"', "3", "big.name = 3: expected text"),
        ("[300, 200.5, 400]", "[300, 200]", "big.build_volume = [300, 200]: expected three lengths"),
        ("[300, 200.5, 400]", "[300, 200, 0]", "big.build_volume = [300, 200, 0]"),
        ("= 0.3", '= "thin"', "big.min_supported_wall = 'thin': expected a length in mm"),
        ("= 4", "= -4", "big.min_drain_hole = -4"),
        ("= 4", "= inf", "big.min_drain_hole = inf"),
        ("= 4", "= = 4", "expected TOML"),
        ("[big]", "[small]\n[big]", "small = []: expected the key name as well"),
        ("[big]", "big = 3\n[other]", "big = 3: expected a table that describes a printer"),
    ],
)
def test_what_no_printer_is_like_is_refused_in_one_line(tmp_path: Path, before: str, after: str, words: str) -> None:
    path = tmp_path / "own.toml"
    assert before in OWN
    path.write_text(OWN.replace(before, after, 1))
    with pytest.raises(ParameterError) as caught:
        printer_named(str(path))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_must_describe_one_printer_and_be_there(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="No such file"):
        printer_named(str(tmp_path / "gone.toml"))
    (tmp_path / "two.toml").write_text(OWN + OWN.replace("[big]", "[bigger]"))
    with pytest.raises(ParameterError, match="of one printer; it has 2"):
        printer_named(str(tmp_path / "two.toml"))

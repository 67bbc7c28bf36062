"""The table of file formats: each ending stands there once, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import pytest

from gyroid_cad.common.formats import (
    FORMATS,
    MESH_FORMATS,
    PART_FORMATS,
    TRIANGLE_FORMATS,
    VOLUME_FORMATS,
    Format,
    format_of,
    listed_endings,
    require_format,
    require_formats,
)
from gyroid_cad.errors import ParameterError

ENDINGS = [ending for form in FORMATS for ending in form.endings]


def test_an_ending_belongs_to_one_format() -> None:
    assert len(set(ENDINGS)) == len(ENDINGS)
    assert all(ending.startswith(".") and ending == ending.lower() for ending in ENDINGS)


@pytest.mark.parametrize("form", FORMATS, ids=lambda form: form.name)
def test_a_file_is_of_its_ending_s_format_however_it_is_spelled(form: Format, tmp_path: Path) -> None:
    for ending in form.endings:
        assert format_of(f"a.b{ending}") is format_of(tmp_path / f"A{ending.upper()}") is form


@pytest.mark.parametrize("path", ["part", "part.dwg", ".step", "part.stl.gz", "part.gz", "folder.stl/part", ""])
def test_other_names_are_of_no_format(path: str) -> None:
    assert format_of(path) is None


@pytest.mark.parametrize("formats", [PART_FORMATS, TRIANGLE_FORMATS, MESH_FORMATS, VOLUME_FORMATS])
def test_a_format_that_is_not_wanted_is_refused_with_the_endings_of_those_that_are(formats: tuple[Format, ...]) -> None:
    assert require_format("output", f"a{formats[-1].endings[-1]}", formats) is formats[-1]
    for other in [form for form in FORMATS if form not in formats]:
        with pytest.raises(ParameterError) as caught:
            require_format("file", f"a{other.endings[0]}", formats)
        message = f"file = 'a{other.endings[0]}': expected a file name ending in {listed_endings(formats)}"
        assert str(caught.value) == message


def test_every_file_to_be_written_is_checked_before_the_first_is(tmp_path: Path) -> None:
    good, bad = tmp_path / "a.step", tmp_path / "a.vtu"
    assert require_formats([good]) == [good]
    with pytest.raises(ParameterError, match=r"a\.vtu"):
        require_formats([good, bad])
    assert require_formats([bad], MESH_FORMATS) == [bad]

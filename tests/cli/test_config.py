"""A lattice in a file: what is read, what is refused, and that it is printed back."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gyroid_cad.cli.config import printed_config, read_config
from gyroid_cad.common.inputs import key_line
from gyroid_cad.errors import ParameterError

KNOWN = ["cells", "cell_size", "thickness", "scale_field", "map"]

words = st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1)
values = st.one_of(st.integers(-(10**12), 10**12), st.floats(allow_nan=False), words)


def written(folder: Path, text: str) -> str:
    path = folder / "lattice.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


@given(given=st.dictionaries(st.sampled_from(KNOWN), st.one_of(values, st.lists(values, min_size=1).map(tuple))))
def test_what_is_printed_is_read_back(tmp_path_factory: pytest.TempPathFactory, given: dict[str, object]) -> None:
    path = written(tmp_path_factory.mktemp("config"), printed_config(given))
    read = read_config(path, KNOWN).values
    assert set(read) == set(given)
    for key, value in given.items():
        parts, expected = (list(a) if isinstance(a, list | tuple) else [a] for a in (read[key], value))
        for part, wanted in zip(parts, expected, strict=True):
            assert part == wanted or float(part) == float(wanted)  # type: ignore[arg-type]


def test_what_is_not_given_is_not_printed() -> None:
    assert printed_config({"cells": (1, 2, 3), "thickness": None, "output": ()}).split() == [
        *("cells", "=", "[", "1,", "2,", "3,", "]")
    ]


def test_a_number_given_as_text_is_printed_as_a_number() -> None:
    assert printed_config({"thickness": "0.80"}) == "thickness = 0.8\n"
    assert printed_config({"thickness": "0.8 + x"}) == 'thickness = "0.8 + x"\n'


@pytest.mark.parametrize(
    ("key", "near"),
    [
        ("cell-size", "cell_size"),
        ("cellsize", "cell_size"),
        ("Thickness", "thickness"),
        ("thicknes", "thickness"),
        ("scale", "scale_field"),
    ],
)
def test_an_unknown_key_is_named_with_the_nearest_known_one(tmp_path: Path, key: str, near: str) -> None:
    path = written(tmp_path, f"cells = [1, 1, 1]\n{key} = 10\n")
    with pytest.raises(ParameterError, match=f"{key} = 10: expected a known key; did you mean {near}"):
        read_config(path, KNOWN)


def test_a_key_like_none_is_answered_with_all_that_are_known(tmp_path: Path) -> None:
    with pytest.raises(ParameterError) as caught:
        read_config(written(tmp_path, "qqq = 1"), KNOWN)
    assert all(key in str(caught.value) for key in KNOWN)


@pytest.mark.parametrize("value", ["true", "[1, true]", "[]", "{a = 1}", "[[1]]", "1979-05-27", "[{a = 1}]"])
def test_a_value_that_is_neither_number_nor_text_is_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(ParameterError, match="a number or text"):
        read_config(written(tmp_path, f"thickness = {value}"), KNOWN)


@pytest.mark.parametrize("text", ["cells = [1, 1", "= 3", "cells = 1\ncells = 2", "a b", "x = " + "[" * 5000])
def test_what_is_no_toml_is_refused_in_one_line_with_its_file(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ParameterError) as caught:
        read_config(path, KNOWN)
    assert "lattice.toml" in str(caught.value)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.toml", tmp_path):
        with pytest.raises(ParameterError, match="a TOML file that can be read"):
            read_config(str(path), KNOWN)
    (tmp_path / "latin.toml").write_bytes(b"map = '\xe9'")
    with pytest.raises(ParameterError, match="TOML"):
        read_config(str(tmp_path / "latin.toml"), KNOWN)


def test_keys_may_stand_in_a_table_of_the_lattice_or_at_the_top(tmp_path: Path) -> None:
    text = "map = 'twist:angle=9'\n[lattice]\ncells = [1, 2, 3]\nthickness = 0.8\n"
    expected = {"map": "twist:angle=9", "cells": ["1", "2", "3"], "thickness": "0.8"}
    assert read_config(written(tmp_path, text), KNOWN).values == expected
    with pytest.raises(ParameterError, match=r"lattice.toml, line 1: map = .*each key once"):
        read_config(written(tmp_path, "map = 'a'\n[lattice]\nmap = 'b'\n"), KNOWN)
    with pytest.raises(
        ParameterError, match=r"lattice.toml, line 2: build = \['map'\]: expected no table but \[lattice"
    ):
        read_config(written(tmp_path, "\n[build]\nmap = 'b'\n"), KNOWN)


@pytest.mark.parametrize(
    ("text", "key", "line"),
    [
        ("cells = [1, 1, 1]\nmap = 3", "map", 2),
        ("cells = [\n1,\n1,\n1]\n\n  'map' = 3", "map", 6),
        ("# map is given below\nmap.radius = 3", "map", 2),
        ("mapped = 1\n[map]", "map", 2),
    ],
)
def test_a_key_is_found_on_its_line(text: str, key: str, line: int) -> None:
    assert key_line(text, key) == line


def test_a_file_to_be_written_stays_in_the_folder_of_the_file_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "away").symlink_to(tmp_path)
    config = read_config(written(tmp_path / "inner", "map = 'a'"), KNOWN)
    for inside in ("a.step", "./a.step", "../inner/a.step", str(tmp_path / "inner" / "a.step")):
        assert Path(config.output("map", inside)).resolve() == (tmp_path / "inner" / "a.step").resolve()
    for outside in ("../a.step", str(tmp_path / "a.step"), "away/a.step"):
        with pytest.raises(ParameterError, match=r"line 1: map = .*in the folder of .*or --allow-outside"):
            config.output("map", outside)
        assert Path(config.output("map", outside, anywhere=True)).resolve() == (tmp_path / "a.step").resolve()


def test_a_flag_is_true_or_false_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "lattice.toml"
    path.write_text("instances = true\n")
    assert read_config(str(path), ["instances"], ["instances"]).values == {"instances": "True"}
    for value in ("1", '"true"', "[true]"):
        path.write_text(f"instances = {value}\n")
        with pytest.raises(ParameterError, match=r"instances = .*: expected true or false"):
            read_config(str(path), ["instances"], ["instances"])


def test_flags_are_printed_only_where_they_are_set() -> None:
    assert printed_config({"instances": True, "full": False}) == "instances = true\n"


def test_a_parameter_of_python_is_known_by_its_key(tmp_path: Path) -> None:
    (tmp_path / "fill.toml").write_text('paths = ["a.step"]')
    with pytest.raises(ParameterError, match="did you mean output"):
        read_config(str(tmp_path / "fill.toml"), ["output", "part", "cells"])


def test_a_key_of_another_command_is_said_to_be_that(tmp_path: Path) -> None:
    (tmp_path / "fill.toml").write_text("skin = 0.5")
    with pytest.raises(ParameterError, match="skin is one of gyroid-cad fill"):
        read_config(str(tmp_path / "fill.toml"), ["cells", "keep_islands"])

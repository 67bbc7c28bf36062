"""A file that a user gives is looked at before it is read: nothing is read without bound."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from gyroid_cad.common.inputs import read_toml, unreadable
from gyroid_cad.errors import ParameterError

DEVICES = [path for path in ("/dev/zero", "/dev/urandom") if Path(path).exists()]


@pytest.mark.parametrize("device", DEVICES)
def test_a_link_to_an_endless_device_is_no_file(tmp_path: Path, device: str) -> None:
    (tmp_path / "a.toml").symlink_to(device)
    with pytest.raises(ParameterError, match="it is a device or a pipe"):
        read_toml("config", tmp_path / "a.toml")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name here")
def test_a_pipe_is_not_opened_which_would_wait_for_its_writer(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.toml")
    assert unreadable(tmp_path / "a.toml") == "it is a device or a pipe, not a file"


def test_a_loop_of_links_and_a_name_that_none_can_have_are_told(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    assert "symbolic links" in str(unreadable(tmp_path / "a"))
    assert unreadable("a\0b") == "its name has a null character"
    assert "too long" in str(unreadable("a" * 300))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        pytest.param(".".join(["a"] * 40_000) + " = 1", "at most 2000 characters in a line", id="a key of many parts"),
        pytest.param("a = " + "9" * 5000, "at most 2000 characters in a line", id="a number of many digits"),
        pytest.param("a = " + "[\n" * 40_000, "fewer brackets", id="brackets in brackets"),
        pytest.param("#\n" * 50_001, "at most 100,000 bytes", id="a large file"),
        pytest.param("a = 1\nb = = 2", "at line 2", id="no TOML"),
    ],
)
def test_text_made_to_take_long_is_refused_at_once(tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "a.toml").write_text(text)
    start = time.perf_counter()
    with pytest.raises(ParameterError, match=words) as caught:
        read_toml("config", tmp_path / "a.toml")
    assert time.perf_counter() - start < 1
    assert "a.toml" in str(caught.value)


def test_the_slowest_text_that_is_let_through_takes_seconds_at_most(tmp_path: Path) -> None:
    keys = [".".join([f"a{number}", *["b"] * 990]) for number in range(49)]
    (tmp_path / "a.toml").write_text("\n".join(f"{key} = 1" for key in keys))
    start = time.perf_counter()
    assert len(read_toml("config", tmp_path / "a.toml")[0]) == 49
    assert time.perf_counter() - start < 10


def test_a_value_too_deep_to_print_is_still_named_in_one_line() -> None:
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert str(ParameterError("a", deep, "less")) == "a = a list too long to print: expected less"

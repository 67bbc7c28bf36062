"""What the README says is so."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from examples.light_bracket import bracket
from gyroid_cad.kernel.step import write_step

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_no_block_is_left_out_of_the_tests() -> None:
    # A citation is none of ours to run.
    kinds = ("sh", "python", "bibtex")
    assert set(re.findall(r"^```(.*)$", README, flags=re.MULTILINE)) == {*kinds, ""}
    assert len(re.findall(r"^```", README, flags=re.MULTILINE)) == 2 * sum(len(blocks(kind)) for kind in kinds)


def commands() -> list[str]:
    return [line for block in blocks("sh") for line in block.splitlines()]


def test_ci_runs_the_readmes_test_command_word_for_word() -> None:
    (test_command,) = [command for command in commands() if "pytest" in command]
    assert test_command in (ROOT / ".ci" / "run").read_text().splitlines()


def test_the_build_command_makes_step_and_stl_of_two_cells_cubed() -> None:
    (build,) = [command for command in commands() if "pip install ." in command]
    assert build.startswith("python3 -m venv")
    assert "--cells 2 2 2" in build
    assert {word for word in build.split() if word.startswith("gyroid.")} == {"gyroid.step", "gyroid.stl"}


@pytest.mark.parametrize("block", blocks("python"))
def test_each_python_block_runs(block: str, tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", block], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


SHELL_BLOCKS = [block for block in blocks("sh") if block.startswith("gyroid-cad")]


@pytest.mark.parametrize("block", SHELL_BLOCKS, ids=[block[11:60] for block in SHELL_BLOCKS])
def test_each_shell_block_runs_line_by_line(block: str, tmp_path: Path) -> None:
    if "bracket.step" in block:
        write_step(bracket().val().wrapped, tmp_path / "bracket.step")
    for command in block.splitlines():
        done = subprocess.run(
            [sys.executable, "-m", *shlex.split(command.replace("gyroid-cad", "gyroid_cad", 1))],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr


def test_the_picture_is_there() -> None:
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", README):
        assert (ROOT / picture).read_bytes().startswith(b"\x89PNG")

"""What the README says is so: its commands run on a fresh clone as they stand, and print what it shows."""

from __future__ import annotations

import re
import shutil
import tomllib
from pathlib import Path

import pytest
from documented import ROOT, Block, blocks_of, missing, run_python, run_shell

from benchmarks.commands import COMMANDS
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.surface.fit_report import fit_report

PAGE = ROOT / "README.md"
README = PAGE.read_text()
BLOCKS = blocks_of(PAGE)
FINDS_THE_PROGRAM = 'export PATH="$PWD/.venv/bin:$PATH"'


def with_language(language: str) -> list[Block]:
    return [block for block in BLOCKS if block.language == language]


COMMAND_BLOCKS = [block for block in with_language("sh") if block.text.startswith("gyroid-cad")]
# These are run beside the example that makes the same: see test_examples.py.
BESIDE_EXAMPLES = ("thickness.step", "cell_length.step", "both.step", "cylinder.step", "bracket.step")
COMMANDS_ALONE = [block for block in COMMAND_BLOCKS if not any(name in block.text for name in BESIDE_EXAMPLES)]


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What of a fresh clone the commands read."""
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_no_block_is_left_out_of_the_tests() -> None:
    # A citation is none of ours to run.
    assert {block.language for block in BLOCKS} == {"sh", "python", "text", "bibtex"}
    assert len(re.findall(r"^```", README, flags=re.MULTILINE)) == 2 * len(BLOCKS)
    assert len(with_language("text")) == sum(block.printed is not None for block in BLOCKS)
    others = [block.text for block in with_language("sh") if block not in COMMAND_BLOCKS]
    assert [text.split()[0] for text in others] == ["python3", "python3", "export"]
    assert others[-1].strip() == FINDS_THE_PROGRAM


def test_what_is_run_beside_an_example_is_no_less_run() -> None:
    beside = [block for block in COMMAND_BLOCKS if block not in COMMANDS_ALONE]
    assert len(beside) == len(BESIDE_EXAMPLES) + 1
    assert all(sum(name in block.text for block in beside) for name in BESIDE_EXAMPLES)


def test_ci_runs_the_readmes_test_command_word_for_word() -> None:
    (test_command,) = [line for line in README.splitlines() if line.endswith("-m pytest")]
    assert test_command in (ROOT / ".ci" / "run").read_text().splitlines()


def test_the_extras_that_are_named_are_there_and_each_host_has_one() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = set(re.findall(r'pip install (?:-e )?"\.\[(\w+)\]"', README))
    assert {"build123d", "cadquery", "hosts"} <= named <= set(extras)


def test_ci_finds_the_command_that_the_wheel_alone_has_to_run() -> None:
    # As .ci/run does: were it to find none, it would run none.
    (pattern,) = re.findall(r"sed -n 's\|(.*?)\|", (ROOT / ".ci" / "run").read_text())
    (first,) = re.findall(pattern.replace(r"\(", "(").replace(r"\)", ")"), README, flags=re.MULTILINE)
    assert first == next(line for line in README.splitlines() if "pip install . &&" in line).split(".venv/bin/")[-1]


def test_the_build_command_makes_step_and_stl_of_two_cells_cubed() -> None:
    (build,) = [line for line in README.splitlines() if "pip install . &&" in line]
    assert build.startswith("python3 -m venv")
    assert "--cells 2 2 2" in build
    assert {word for word in build.split() if word.startswith("gyroid.")} == {"gyroid.step", "gyroid.stl"}


@pytest.mark.parametrize("block", with_language("python"), ids=str)
def test_each_python_block_runs(block: Block, clone: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = run_python(block, capsys, {"__name__": "__main__"})
    assert missing(block.printed or "", printed) == []


@pytest.mark.parametrize("block", COMMANDS_ALONE, ids=str)
def test_each_shell_block_runs_in_a_fresh_clone_and_prints_what_is_shown(
    block: Block, clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert missing(block.printed or "", run_shell(block, capsys)) == []


def test_the_files_that_commands_read_are_in_the_clone() -> None:
    read = set(re.findall(r"examples/[\w.]+", README)) | set(re.findall(r"(?<=python )images/\w+\.py", README))
    assert {"examples/lattice.toml", "examples/bracket.step"} <= read
    for path in read:
        assert (ROOT / path).is_file(), path


def test_the_commands_timed_are_those_that_the_benchmark_times() -> None:
    section = README[README.index("## How long it takes") :]
    assert re.findall(r"^\| `gyroid-cad (.*?)` \|", section, flags=re.MULTILINE) == list(COMMANDS)


def test_the_table_of_surfaces_is_the_codes() -> None:
    rows = {
        "patches a cell": lambda surface: f"{len(surface.cell)}",
        "area of a cell, in L²": lambda surface: f"{surface.tube.area:.7f}",
        "wall, in L, below": lambda surface: f"{surface.tube.max_thickness:.5f}",
        "10 x 10 fit off by, in L": lambda surface: shown(fit_report(fit_patch(family=surface.family)).max_distance),
    }
    for name, value in rows.items():
        cells = [value(SURFACES[surface]) for surface in ("gyroid", "diamond", "primitive")]
        assert f"| {name} | {' | '.join(cells)} |" in README


def shown(value: float) -> str:
    """A small number without the nought in its exponent."""
    return f"{value:.1e}".replace("e-0", "e-")


def test_the_pictures_are_there() -> None:
    for picture in re.findall(r"!\[.*?\]\((.*?)\)", README):
        assert (ROOT / picture).read_bytes().startswith(b"\x89PNG")

"""Every example runs and leaves the files it names, valid ones; beside it the README's commands for the same part."""

from __future__ import annotations

import re
import runpy
import shutil
from functools import wraps
from pathlib import Path
from typing import Any

import pytest
from documented import ROOT, Block, blocks_of, missing, run_shell
from remembered import filled_once

from gyroid_cad.filling import fill as filling
from gyroid_cad.kernel.check import is_valid
from gyroid_cad.kernel.part import measure
from gyroid_cad.kernel.step import read_step

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
README = ROOT / "README.md"
# A file by which the README's commands for the same part are known. Whichever of the two comes second finds what the
# first one built: specimens are among the slowest things that either makes.
BESIDE = {
    "paper_variable_thickness": "thickness.step",
    "paper_variable_cell_length": "cell_length.step",
    "paper_variable_both": "both.step",
    "closed_cylinder": "cylinder.step",
    "light_bracket": "bracket.step",
}
# What the README says that they find.
QUOTED = {"stiffness_in_calculix": ("160.81", "210.98"), "isogeometric_heat": ("0.20771",)}


# The bracket is filled twice, plain and with a skin, by the kernel's booleans: half a minute.
@pytest.mark.parametrize(
    "example",
    [
        pytest.param(path, id=path.stem, marks=[pytest.mark.slow] if path.stem == "light_bracket" else [])
        for path in EXAMPLES
    ],
)
def test_an_example_runs_and_its_step_file_is_valid(
    example: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    if "ccx" in example.read_text() and shutil.which("ccx") is None:
        pytest.skip("CalculiX (ccx) is not installed")
    clone, folder = tmp_path / "clone", tmp_path / "example"
    shutil.copytree(ROOT / "examples", clone / "examples")
    folder.mkdir()
    fills: list[Any] = []
    fill = filling.fill

    @wraps(fill)
    def counted(*given: Any, **named: Any) -> Any:
        fills.append(given)
        return fill(*given, **named)

    monkeypatch.setattr(filling, "fill", filled_once(counted))
    monkeypatch.chdir(clone)
    for block in readme_blocks(BESIDE.get(example.stem)):
        assert missing(block.printed or "", run_shell(block, capsys)) == []
    monkeypatch.chdir(folder)
    runpy.run_path(str(example), run_name="__main__")
    printed = capsys.readouterr().out
    assert printed.strip()
    # What the README's commands filled is not filled again.
    assert len(fills) <= example.read_text().lower().count("fill(")
    promised = re.findall(r'"(\w+\.\w+)"', example.read_text())
    assert sorted(path.name for path in folder.iterdir()) == sorted(promised)
    for path in folder.glob("*.step"):
        assert is_valid(read_step(path))
    for figure in QUOTED.get(example.stem, ()):
        assert figure in printed
        assert figure in README.read_text()


def readme_blocks(file: str | None) -> list[Block]:
    found = [block for block in blocks_of(README) if file and block.language == "sh" and file in block.text]
    assert found or file is None
    return found


def test_the_bracket_s_file_is_what_the_example_draws() -> None:
    drawn = runpy.run_path(str(ROOT / "examples" / "light_bracket.py"))["bracket"]()
    shipped = read_step(ROOT / "examples" / "bracket.step")
    assert measure(shipped) == pytest.approx(measure(drawn.val().wrapped), rel=1e-9)
    assert (ROOT / "examples" / "bracket.step").stat().st_size < 50_000

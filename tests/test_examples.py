"""Every example runs, and leaves a file that holds a valid solid."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gyroid_cad.kernel.check import is_valid
from gyroid_cad.kernel.step import read_step

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs_and_its_step_file_is_valid(example: Path, tmp_path: Path) -> None:
    if "ccx" in example.read_text() and shutil.which("ccx") is None:
        pytest.skip("CalculiX (ccx) is not installed")
    done = subprocess.run(
        [sys.executable, str(example)], cwd=tmp_path, capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    promised = re.findall(r'"(\w+\.\w+)"', example.read_text())
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(promised)
    for path in tmp_path.glob("*.step"):
        assert is_valid(read_step(path))

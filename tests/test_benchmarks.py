"""Every benchmark runs: at the least size at which all of its steps do, so that none breaks unseen."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import pytest

from benchmarks import __main__ as all_of_them
from benchmarks.__main__ import BENCHMARKS

FOLDER = Path(all_of_them.__file__).parent
# What benchmarks share is none itself.
SHARED = {"__init__", "__main__", "subject", "timing"}


def test_each_module_with_a_benchmark_is_run_with_the_others() -> None:
    names = {benchmark.__name__.removeprefix("benchmarks.") for benchmark in BENCHMARKS}
    assert names == {path.stem for path in FOLDER.glob("*.py")} - SHARED


@pytest.mark.parametrize("benchmark", BENCHMARKS, ids=lambda benchmark: benchmark.__name__.removeprefix("benchmarks."))
def test_a_small_benchmark_runs_and_prints_its_tables(
    benchmark: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    # Ratios mean nothing at this size, nor beside other tests: whether they are met is not asked.
    assert benchmark.main(["--small"]) in (True, False)
    assert "┏" in capsys.readouterr().out

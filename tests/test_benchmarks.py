"""Every benchmark runs: at the least size at which all of its steps do, so that none breaks unseen."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from benchmarks import __main__ as all_of_them
from benchmarks.__main__ import BENCHMARKS
from benchmarks.random_parts import is_part, random_part
from gyroid_cad.kernel.check import is_valid

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


def test_a_random_part_whose_faces_cross_each_other_is_none_though_the_kernel_calls_it_valid() -> None:
    crossed, sound = (random_part(np.random.default_rng(seed)) for seed in (96, 0))
    assert is_valid(crossed)
    assert (is_part(crossed), is_part(sound)) == (False, True)

"""A process that is forked after the kernel was used can use it too; threads take turns at what is global in it."""

from __future__ import annotations

import multiprocessing
import os
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

from gyroid_cad.kernel.check import is_valid
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.kernel.stl import write_meshed_stl
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.header import StepHeader
from gyroid_cad.surface.fit import FitSettings

forks = pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on Windows")
PATIENCE = 60.0


def solid(cells: int = 1) -> Lattice:
    return Lattice((cells, 1, 1), 10.0, 0.8, fit=FitSettings(5))


def checks(folder: Path) -> bool:
    return is_valid(solid().solid())


def meshes(folder: Path) -> bool:
    write_meshed_stl(solid().solid(), folder / "a.stl", 0.5)
    return (folder / "a.stl").exists()


def writes(folder: Path) -> bool:
    write_step(solid().solid(), folder / "a.step")
    return not read_step(folder / "a.step").IsNull()


@forks
@pytest.mark.parametrize("before", [checks, meshes, writes])
@pytest.mark.parametrize("after", [checks, meshes, writes])
def test_what_was_done_before_a_fork_can_be_done_after_it(
    tmp_path: Path, before: Callable[[Path], bool], after: Callable[[Path], bool]
) -> None:
    # The kernel checks and meshes in threads of its own, which no forked process has: it waited for them for ever.
    assert before(tmp_path)
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(after, (tmp_path,)).get(PATIENCE)
    assert before(tmp_path)


@forks
def test_a_fork_while_another_thread_writes_waits_for_it_and_leaves_nothing_locked(tmp_path: Path) -> None:
    large = solid(4).solid()
    thread = threading.Thread(target=write_step, args=(large, tmp_path / "large.step"))
    thread.start()
    with multiprocessing.get_context("fork").Pool(1) as pool:
        assert pool.apply_async(writes, (tmp_path,)).get(PATIENCE)
    thread.join()
    assert not read_step(tmp_path / "large.step").IsNull()


def test_threads_write_one_file_at_once_and_each_its_own_schema(tmp_path: Path) -> None:
    shapes, problems = [solid(1).solid(), solid(2).solid()], []

    def write(k: int) -> None:
        try:
            header = StepHeader(("ap214", "ap242")[k % 2])
            write_step(shapes[k % 2], tmp_path / f"own{k}.step", header)
            write_step(shapes[k % 2], tmp_path / "same.step", header)
        except BaseException as problem:
            problems.append(problem)

    threads = [threading.Thread(target=write, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not problems
    assert len(list(tmp_path.iterdir())) == 5
    for k in range(4):
        text = (tmp_path / f"own{k}.step").read_text()
        assert ("AUTOMOTIVE_DESIGN" in text) == (k % 2 == 0)
        assert not read_step(tmp_path / f"own{k}.step").IsNull()

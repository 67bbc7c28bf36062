"""A part and the faces of a lattice split where they cross, region by region, in processes.

Nearly all the time of ``split`` goes into the curves where a face of the lattice meets one of the part; and those of
one region know nothing of another. So each process cuts the faces of a region against the part, and sends back what
is left of them in the part. Edges and vertices that faces of two regions share are then made one again; and the part's
boundary is split along all the section edges at once, which takes no time to speak of, as no surfaces are intersected.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager

from OCP.TopoDS import (
    TopoDS_Shape,
)

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.region_merge import Joining
from gyroid_cad.kernel.region_split import Found, RegionSplit, Task
from gyroid_cad.kernel.split import Pieces, split

__all__ = ["split_by_region"]

# With fewer faces, starting processes is not worth it.
_FEW = 64


def split_by_region(
    part: Part,
    faces: Sequence[TopoDS_Shape],
    processes: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Pieces:
    """Split a part's boundary and faces where they cross, as ``split`` does, in several processes.

    The result does not depend on how many processes there are, if more than one: then, and if there are many faces,
    and processes can be forked, it is made region by region; else ``split`` makes it.

    Parameters
    ----------
    part : Part
    faces : sequence of TopoDS_Shape
        Faces that share their edges.
    processes : int, optional
        As many as there are processors to run on, if left out.
    progress : callable, optional
        Called now and then with (faces done, faces in all).

    Raises
    ------
    KernelError
        If the kernel fails, or a process.
    """
    usable = _processors() if processes is None else processes
    if len(faces) < _FEW or usable < 2 or not _can_fork():
        pieces = split(part, faces)
        if progress is not None:
            progress(len(faces), len(faces))
        return pieces
    task = Task(part, faces)
    found = _found_in_processes(task, usable, progress)
    with _kernel_errors():
        return Joining(task, found).pieces()


def _processors() -> int:
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _can_fork() -> bool:
    # On macOS there is fork, but system libraries may crash in the forked process.
    return sys.platform != "darwin" and "fork" in multiprocessing.get_all_start_methods()


# What a process was started for.
_inherited: list[Task] = []


def _found_in_processes(task: Task, processes: int, progress: Callable[[int, int], None] | None) -> list[Found]:
    """Pieces found in each region."""
    before = multiprocessing.active_children()
    executor = ProcessPoolExecutor(
        min(processes, len(task.regions)),
        multiprocessing.get_context("fork"),
        # Not sent: a forked process has it already.
        initializer=_begin,
        initargs=(task,),
    )
    done = 0
    try:
        with _interrupts_later():
            futures = {executor.submit(_found, number): region for number, region in enumerate(task.regions)}
        for future in as_completed(futures):
            future.result()
            done += len(futures[future])
            if progress is not None:
                progress(done, len(task.faces))
        return [future.result() for future in futures]
    except KeyboardInterrupt:
        # Nobody waits for what the kernel is at.
        for process in multiprocessing.active_children():
            if process not in before:
                process.terminate()
        raise
    except BrokenProcessPool as broken:
        raise KernelError("a process that split the part against the lattice ended too soon") from broken
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _interrupts_later() -> Iterator[None]:
    """Hold interrupts back until the context ends: what comes while a process is forked, Python reports and forgets."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)
    if heard:
        signal.raise_signal(signal.SIGINT)


def _begin(task: Task) -> None:
    """Make a process ready; a terminal interrupts all of a program's processes, and only the first has an answer."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _inherited.append(task)


def _found(number: int) -> Found:
    (task,) = _inherited
    with _kernel_errors():
        return RegionSplit(task, task.regions[number]).found()


@contextmanager
def _kernel_errors() -> Iterator[None]:
    """Errors of the kernel as ours: they have no class in common, and cannot be sent from one process to another."""
    try:
        yield
    except KernelError:
        raise
    except Exception as failed:
        raise KernelError(f"the kernel could not split the part against the lattice: {failed}") from failed

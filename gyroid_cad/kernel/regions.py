"""A part and the faces of a lattice split where they cross, region by region, in processes.

Nearly all the time of ``split`` goes into the curves where a face of the lattice meets one of the part; and those of
one region know nothing of another. So each process cuts the faces of a region against the part, and sends back what
is left of them in the part. Edges and vertices that faces of two regions share are then made one again; and the part's
boundary is split along all the section edges at once, which takes no time to speak of, as no surfaces are intersected.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress

from OCP.Standard import Standard_OutOfMemory
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.processes import can_fork, interrupts_later, processors, settle_in
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

    The result does not depend on how many there are: where there is one processor, or processes cannot be forked, one
    region is split after the other. Only few faces are split all at once.

    Parameters
    ----------
    part : Part
    faces : sequence of TopoDS_Shape
        Faces that share their edges.
    processes : int, optional
        As many as there are processors to run on, if left out; with 1, what ``split`` gives.
    progress : callable, optional
        Called now and then with (faces done, faces in all).

    Raises
    ------
    KernelError
        If the kernel fails, or a process.
    """
    if len(faces) < _FEW or processes == 1:
        pieces = split(part, faces)
        if progress is not None:
            progress(len(faces), len(faces))
        return pieces
    task = Task(part, faces)
    usable = processors() if processes is None else processes
    find = _found_in_processes if usable > 1 and can_fork() else _found_here
    found = find(task, usable, progress)
    with _kernel_errors():
        return Joining(task, found).pieces()


def _found_here(task: Task, processes: int, progress: Callable[[int, int], None] | None) -> list[Found]:
    """Pieces found in each region, one after the other."""
    found, done = [], 0
    for region in task.regions:
        found.append(_found_in(task, region))
        done += len(region)
        if progress is not None:
            progress(done, len(task.faces))
    return found


# What a process was started for.
_inherited: list[Task] = []


def _found_in_processes(task: Task, processes: int, progress: Callable[[int, int], None] | None) -> list[Found]:
    """Pieces found in each region, several at a time."""
    before = multiprocessing.active_children()
    executor = ProcessPoolExecutor(
        min(processes, len(task.regions)),
        multiprocessing.get_context("fork"),
        # Not sent: a forked process has it already.
        initializer=_begin,
        initargs=(task, os.getpid()),
    )
    done = 0
    try:
        with interrupts_later():
            futures = {executor.submit(_found, number): region for number, region in enumerate(task.regions)}
        for future in as_completed(futures):
            future.result()
            done += len(futures[future])
            if progress is not None:
                progress(done, len(task.faces))
        return [future.result() for future in futures]
    except BrokenProcessPool as broken:
        raise KernelError("a process that split the part against the lattice ended too soon") from broken
    except BaseException as problem:
        # Nobody waits for what the kernel is at; and if not all could be started, the others would wait for ever.
        for process in multiprocessing.active_children():
            if process not in before:
                process.kill()
                process.join()
        if isinstance(problem, RuntimeError | OSError) and not isinstance(problem, KernelError):
            raise KernelError(f"no processes could be started to split the part: {problem}") from problem
        raise
    finally:
        # If none could be started there is no thread of the pool's to wait for.
        with suppress(RuntimeError):
            executor.shutdown(cancel_futures=True)


def _begin(task: Task, parent: int) -> None:
    settle_in(parent)
    _inherited.append(task)


def _found(number: int) -> Found:
    (task,) = _inherited
    return _found_in(task, task.regions[number])


def _found_in(task: Task, region: Sequence[int]) -> Found:
    with _kernel_errors():
        return RegionSplit(task, region).found()


@contextmanager
def _kernel_errors() -> Iterator[None]:
    """Errors of the kernel as ours: they have no class in common, and cannot be sent from one process to another."""
    try:
        yield
    except (KernelError, MemoryError):
        raise
    except Standard_OutOfMemory as failed:
        raise MemoryError(str(failed)) from failed
    except Exception as failed:
        raise KernelError(f"the kernel could not split the part against the lattice: {failed}") from failed

"""Processes beside this one: where they can be forked, what ends them, and work done in one of its own, or in many."""

from __future__ import annotations

import faulthandler
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from io import StringIO
from multiprocessing.connection import Connection
from multiprocessing.context import ForkProcess
from typing import Any, Protocol, TypeVar, cast

from gyroid_cad.errors import KernelError

__all__ = ["Started", "beside", "can_fork", "processors", "results_of", "slowed", "started"]

T = TypeVar("T")

# Of prctl(2): the signal that a process gets when the one that started it ends.
_SET_SIGNAL_AT_PARENTS_END = 1
# Times longer that work may be thought to take: a load may be that of a large machine of which this is a part.
_MOST_SLOWED = 5.0


class Started(Protocol):
    """Work in a process of its own."""

    def wait(self, seconds: float) -> int | None:
        """Return the status with which the process ended; None if it is still at it after so many seconds."""

    def kill(self) -> None:
        """End the process at once, if it has not ended."""


def started(work: Callable[..., None], *arguments: str) -> Started:
    """Start work of the kernel in a process of its own; nothing that it prints is seen.

    Forked, it begins at once; a new Python would first load the kernel, for a second or two.

    Parameters
    ----------
    work : callable
        A function of a module.
    *arguments : str
    """
    return _Forked(work, arguments) if can_fork() else _Fresh(work, arguments)


def can_fork() -> bool:
    """Tell whether this process can fork others that end with it."""
    # Elsewhere they could outlive this process; on macOS system libraries may crash in them. And a process of a pool,
    # which ends with its parent, may have none of its own.
    return sys.platform == "linux" and not multiprocessing.current_process().daemon


def processors() -> int:
    """Count the processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def slowed() -> float:
    """Tell how many times longer work takes than it does alone, as others want the processors too: from 1 to 5.

    What is given a while to finish gets more of it, for it is to come out the same on a busy machine.
    """
    if not hasattr(os, "getloadavg"):
        return 1.0
    return min(max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1)), _MOST_SLOWED)


def results_of(
    work: Callable[[int], T],
    count: int,
    aim: str,
    processes: int | None = None,
    done: Callable[[int], object] = lambda number: None,
) -> list[T]:
    """Results of a function for each of so many numbers, several at a time in forked processes where that can be.

    What the function reaches is not sent: a forked process has it already. What it returns is.

    Parameters
    ----------
    work : callable
        From a number below ``count`` to its result.
    count : int
    aim : str
        What the work is to do, for messages, as in "a process that ... ended too soon".
    processes : int, optional
        As many as there are processors to run on, if left out; with 1 all is done here.
    done : callable, optional
        Called with each number once its result is there.

    Raises
    ------
    KernelError
        If a process ends before its work, or cannot be started.

    Examples
    --------
    >>> results_of(lambda number: number**2, 4, "squared numbers")
    [0, 1, 4, 9]
    """
    usable = min(processors() if processes is None else processes, count)
    if usable > 1 and can_fork():
        return _results_in_processes(work, count, aim, usable, done)
    results = []
    for number in range(count):
        results.append(work(number))
        done(number)
    return results


@contextmanager
def beside(work: Callable[[], T], aim: str) -> Iterator[Callable[[], T]]:
    """Let a forked process do some work while this one goes on, where there is a second processor for it.

    Parameters
    ----------
    work : callable
    aim : str
        As of :func:`results_of`.

    Yields
    ------
    callable
        That waits for the result of the work, or does it now.

    Raises
    ------
    KernelError
        From that callable, if the process ended before its work.

    Examples
    --------
    >>> with beside(lambda: sum(range(10)), "adds numbers") as total:
    ...     print(total())
    45
    """
    if processors() < 2 or not can_fork():
        yield work
        return
    mine, theirs = multiprocessing.Pipe(duplex=False)
    process = ForkProcess(target=_work_for, args=(os.getpid(), work, theirs), daemon=True)
    try:
        with interrupts_later():
            process.start()
    except OSError:
        yield work
        return
    theirs.close()

    def result() -> T:
        try:
            succeeded, found = mine.recv()
        except EOFError:
            raise KernelError(f"a process that {aim} ended too soon") from None
        if not succeeded:
            raise found
        return cast("T", found)

    try:
        yield result
    finally:
        process.kill()
        process.join()


def _work_for(parent: int, work: Callable[[], object], answer: Connection) -> None:
    settle_in(parent)
    try:
        answer.send((True, work()))
    except Exception as problem:
        answer.send((False, problem))


def _results_in_processes(
    work: Callable[[int], T], count: int, aim: str, processes: int, done: Callable[[int], object]
) -> list[T]:
    before = multiprocessing.active_children()
    executor = ProcessPoolExecutor(
        processes, multiprocessing.get_context("fork"), initializer=_begin, initargs=(work, os.getpid())
    )
    try:
        with interrupts_later():
            futures = {executor.submit(_inherited_work, number): number for number in range(count)}
        for future in as_completed(futures):
            future.result()
            done(futures[future])
        return [future.result() for future in futures]
    except BrokenProcessPool as broken:
        raise KernelError(f"a process that {aim} ended too soon") from broken
    except BaseException as problem:
        # Nobody waits for what they are at; and if not all could be started, the others would wait for ever.
        for process in multiprocessing.active_children():
            if process not in before:
                process.kill()
                process.join()
        if isinstance(problem, RuntimeError | OSError) and not isinstance(problem, KernelError):
            raise KernelError(f"no processes that {aim} could be started: {problem}") from problem
        raise
    finally:
        # If none could be started there is no thread of the pool's to wait for.
        with suppress(RuntimeError):
            executor.shutdown(cancel_futures=True)


# What a process was started for.
_inherited: list[Callable[[int], Any]] = []


def _begin(work: Callable[[int], Any], parent: int) -> None:
    settle_in(parent)
    _inherited.append(work)


def _inherited_work(number: int) -> Any:
    return _inherited[-1](number)


class _Forked:
    """A copy of this process, which has all modules already."""

    def __init__(self, work: Callable[..., None], arguments: tuple[str, ...]) -> None:
        self._process = ForkProcess(target=_work_unseen, args=(os.getpid(), work, arguments), daemon=True)
        with interrupts_later():
            self._process.start()

    def wait(self, seconds: float) -> int | None:
        self._process.join(seconds)
        return self._process.exitcode

    def kill(self) -> None:
        self._process.kill()
        self._process.join()


class _Fresh:
    """A new Python that finds the same modules."""

    def __init__(self, work: Callable[..., None], arguments: tuple[str, ...]) -> None:
        program = f"import sys; from {work.__module__} import {work.__name__} as work; work(*sys.argv[1:])"
        paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
        self._process = subprocess.Popen(
            [sys.executable, "-c", program, *arguments],
            env={**os.environ, "PYTHONPATH": paths},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def wait(self, seconds: float) -> int | None:
        try:
            return self._process.wait(seconds)
        except subprocess.TimeoutExpired:
            return None

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()


def _work_unseen(parent: int, work: Callable[..., None], arguments: tuple[str, ...]) -> None:
    settle_in(parent)
    # The kernel's crashes are what such a process is for, and nothing to report.
    faulthandler.disable()
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    sys.stdout = sys.stderr = StringIO()
    work(*arguments)


def settle_in(parent: int) -> None:
    """Make a forked process ready for its work.

    A terminal interrupts all of a program's processes, and only the first has an answer; nor should the others do what
    it answers to being ended.

    Parameters
    ----------
    parent : int
        The number of the process that forked it, as ``os.getpid`` gives it there.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    _end_with_parent(parent)


def _end_with_parent(parent: int) -> None:
    """Let the system end this process at once when its parent ends, however that ends (Linux; elsewhere nothing)."""
    if sys.platform != "linux":
        return
    import ctypes  # not needed by those who never start a process

    ctypes.CDLL(None).prctl(_SET_SIGNAL_AT_PARENTS_END, signal.SIGKILL)
    # It may have ended already.
    if os.getppid() != parent:
        os._exit(1)


@contextmanager
def interrupts_later() -> Iterator[None]:
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

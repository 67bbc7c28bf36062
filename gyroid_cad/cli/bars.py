"""A progress display on the terminal, on the error stream so that output can be piped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

__all__ = ["terminal_progress"]


@contextmanager
def terminal_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A function (stage, done, total) that keeps one line a stage up to date while the context lasts.

    The time that remains is shown of stages that tell how far they have come. One that only begins and ends, the kernel
    at work in one call, has none to show, and its bar says so by running to and fro.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        tasks: dict[str, TaskID] = {}

        def update(stage: str, done: int, total: int) -> None:
            known = None if (done, total) == (0, 1) else total
            if stage not in tasks:
                tasks[stage] = display.add_task(stage, total=known)
            display.update(tasks[stage], completed=done, total=known)

        yield update

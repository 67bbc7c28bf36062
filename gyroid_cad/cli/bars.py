"""A progress display on the terminal, on the error stream so that output can be piped."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import timedelta

from rich.console import Console
from rich.progress import BarColumn, Progress, Task, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.text import Text

from gyroid_cad.common.progress import is_forecast

__all__ = ["terminal_progress"]


class _Remaining(TimeRemainingColumn):
    """Time that remains: of a forecast by the clock, of all else by how far it has come."""

    def render(self, task: Task) -> Text:
        forecast = task.fields.get("forecast")
        if forecast is None:
            return super().render(task)
        left = max(0, round(forecast - (task.elapsed or 0)))
        return Text(f"{timedelta(seconds=left)}", style="progress.remaining")


@contextmanager
def terminal_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A function (stage, done, total) that keeps one line a stage up to date while the context lasts.

    The time that remains is shown of stages that tell how far they have come, and of all that a forecast is of. One
    that only begins and ends, the kernel at work in one call, has none to show, and its bar says so by running to and
    fro.
    """
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), _Remaining())
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        tasks: dict[str, TaskID] = {}

        def update(stage: str, done: int, total: int) -> None:
            forecast = total if is_forecast(stage) else None
            known = None if (done, total) == (0, 1) or forecast is not None else total
            if stage not in tasks:
                tasks[stage] = display.add_task(stage, total=known, forecast=forecast)
            display.update(tasks[stage], completed=done, total=known)

        yield update

"""Work done in stages: told of as it goes on, and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["Progress", "Timed", "is_forecast", "named_progress", "report_progress", "timed"]

Progress = Callable[[str, int, int], None]
# What a stage begins with that tells what all of it takes: its total is of seconds.
_FORECAST = "about "
Timed = Callable[[str], AbstractContextManager[None]]


@contextmanager
def timed(seconds: dict[str, float], stage: str, progress: Progress | None) -> Iterator[None]:
    """Tell that a stage begins and ends, and add the seconds between to those of the stage."""
    start = time.perf_counter()
    report_progress(progress, stage, 0, 1)
    yield
    report_progress(progress, stage, 1, 1)
    seconds[stage] = seconds.get(stage, 0.0) + time.perf_counter() - start


def report_progress(progress: Progress | None, stage: str, done: int, total: int) -> None:
    """Tell how far a stage has come, if anyone listens."""
    if progress is not None:
        progress(stage, done, total)


def is_forecast(stage: str) -> bool:
    """Tell whether a stage is none, but what all of them are expected to take; its total then is that, in seconds.

    >>> is_forecast("solid 1 of 2: about 300 crossings"), is_forecast("cover")
    (True, False)
    """
    return stage.rpartition(": ")[2].startswith(_FORECAST)


def named_progress(progress: Progress | None, name: str) -> Progress | None:
    """Return a progress that tells the name of what each stage is of, where there are several.

    >>> named_progress(lambda stage, done, total: print(stage), "solid 2 of 3")("split", 0, 1)
    solid 2 of 3: split
    """
    return progress and (lambda stage, done, total: progress(f"{name}: {stage}", done, total))

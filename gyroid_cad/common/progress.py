"""Work done in stages: told of as it goes on, and timed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

__all__ = ["Progress", "Timed", "named_progress", "report_progress", "timed"]

Progress = Callable[[str, int, int], None]
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


def named_progress(progress: Progress | None, name: str) -> Progress | None:
    """Return a progress that tells the name of what each stage is of, where there are several.

    >>> named_progress(lambda stage, done, total: print(stage), "solid 2 of 3")("split", 0, 1)
    solid 2 of 3: split
    """
    return progress and (lambda stage, done, total: progress(f"{name}: {stage}", done, total))

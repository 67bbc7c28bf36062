"""What every benchmark shares: best-of timing, fresh processes, tables with what is required beside the figures.

Times depend on the machine and on its mood, so they are judged as ratios of two things timed in one run,
each the best of several.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TypeVar

from rich.console import Console
from rich.table import Table

__all__ = ["Row", "best_of", "best_process_time", "fresh_python", "plain_table", "print_verdicts", "printed_by"]

ROOT = Path(__file__).resolve().parent.parent
_NARROWEST = 130

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Row:
    """One figure and what it is measured against.

    Attributes
    ----------
    what : str
    measured : float
    required, aim : float, optional
        Bounds; without them the row is for comparison only.
    unit : str
    at_least : bool
        Whether the bounds are lower ones.
    remark : str
    """

    what: str
    measured: float
    required: float | None = None
    aim: float | None = None
    unit: str = ""
    at_least: bool = False
    remark: str = ""

    @property
    def verdict(self) -> str:
        if self.required is None:
            return ""
        if not self._meets(self.required):
            return "[bold red]falls short[/]"
        return "[green]required[/]" if self.aim is None or not self._meets(self.aim) else "[bold green]aim[/]"

    @property
    def failed(self) -> bool:
        return self.required is not None and not self._meets(self.required)

    def _meets(self, bound: float) -> bool:
        return self.measured >= bound if self.at_least else self.measured <= bound

    def _bound(self, bound: float | None) -> str:
        return "" if bound is None else f"{'≥' if self.at_least else '≤'} {_shown(bound)}{self.unit}"

    def cells(self) -> tuple[str, str, str, str, str, str]:
        measured = f"{_shown(self.measured)}{self.unit}"
        return self.what, measured, self._bound(self.required), self._bound(self.aim), self.verdict, self.remark


def best_of(task: Callable[[], Result], repeats: int) -> tuple[float, Result]:
    """Shortest time in seconds of several runs, and the last run's result."""
    shortest = float("inf")
    for _ in range(repeats):
        start = perf_counter()
        result = task()
        shortest = min(shortest, perf_counter() - start)
    return shortest, result


def fresh_python(*arguments: str) -> str:
    """Run this Python anew, with the project importable, and give back what it printed."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    process = subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} failed:\n{process.stderr}")
    return process.stdout


def printed_by(program: str, *arguments: object) -> list[float]:
    """The numbers a program prints when it is run in a fresh process."""
    return [float(word) for word in fresh_python("-c", program, *map(str, arguments)).split()]


def best_process_time(repeats: int, *arguments: str) -> float:
    """Shortest time in seconds of a whole fresh process, start of the interpreter included."""
    return best_of(lambda: fresh_python(*arguments), repeats)[0]


def print_verdicts(title: str, rows: Iterable[Row]) -> bool:
    """Print measured figures beside what is required; returns whether every requirement is met."""
    rows = tuple(rows)
    table = Table("what", title=title, title_justify="left", title_style="bold")
    for heading in ("measured", "required", "aim"):
        table.add_column(heading, justify="right", no_wrap=True)
    table.add_column("meets", no_wrap=True)
    table.add_column("remark")
    for row in rows:
        table.add_row(*row.cells())
    _console().print(table)
    return not any(row.failed for row in rows)


def plain_table(title: str, headings: Iterable[str], lines: Iterable[Iterable[str]]) -> None:
    """Print figures that nothing is required of."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, heading in enumerate(headings):
        table.add_column(heading, justify="right" if index else "left", no_wrap=index > 0)
    for line in lines:
        table.add_row(*line)
    _console().print(table)


def _console() -> Console:
    console = Console()
    return console if console.is_terminal else Console(width=max(console.width, _NARROWEST))


def _shown(value: float) -> str:
    if value != 0 and not 1e-3 <= abs(value) < 1e5:
        return f"{value:.2e}"
    return f"{value:.0f}" if float(value).is_integer() else f"{value:.3g}"

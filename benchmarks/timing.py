"""What every benchmark shares: best-of timing, fresh processes, tables with what is required beside the figures.

Times depend on the machine, so they are judged as ratios of two things timed in one run, each the best of several.
Inside one process it is processor time that counts, all threads together: other work on the machine then slows
neither side alone, however long the one runs and however short the other. Whole processes go by the clock.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import TypeVar

from rich.console import Console
from rich.table import Table

__all__ = [
    "ROOT",
    "Row",
    "arguments_for",
    "best_in_turn",
    "best_of",
    "fresh_python",
    "plain_table",
    "print_verdicts",
    "seconds_of_process",
]

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


def arguments_for(description: str) -> argparse.ArgumentParser:
    """Parser of a benchmark's command line, with the one option that all of them have.

    ``--small`` runs every step at the least size at which it can be run: it shows that a benchmark works, and its
    ratios mean little.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--small", action="store_true", help="the least size at which every step runs")
    return parser


def best_of(task: Callable[[], Result], repeats: int) -> tuple[float, Result]:
    """Least processor time in seconds of several runs, and the last run's result."""
    return best_in_turn(repeats, task)[0]


def best_in_turn(repeats: int, *tasks: Callable[[], Result]) -> list[tuple[float, Result]]:
    """The same of several tasks, run in turn, so that what slows the machine slows all of them."""
    rounds = [[_timed(task) for task in tasks] for _ in range(repeats)]
    return [(min(seconds for seconds, _ in runs), runs[-1][1]) for runs in zip(*rounds, strict=True)]


def _timed(task: Callable[[], Result]) -> tuple[float, Result]:
    start = process_time()
    result = task()
    return process_time() - start, result


def seconds_of_process(*arguments: str, folder: Path | None = None) -> float:
    """Seconds on the clock of a whole fresh process, in this folder, start of the interpreter included."""
    start = perf_counter()
    fresh_python(*arguments, folder=folder)
    return perf_counter() - start


def fresh_python(*arguments: str, folder: Path | None = None, **environment: str) -> str:
    """Run this Python anew, with the project importable and these variables set, and give back what it printed."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    # Users' Pythons keep what they compiled; where this one is told not to, each start would compile the project anew.
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.run(
        [sys.executable, *arguments],
        cwd=folder,
        env={**kept, "PYTHONPATH": path, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if process.returncode:
        raise RuntimeError(f"python {' '.join(arguments)} failed:\n{process.stderr}")
    return process.stdout


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

"""Tables and progress on the terminal."""

from __future__ import annotations

import errno
import os
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

from gyroid_cad.common.progress import is_forecast

if TYPE_CHECKING:
    from gyroid_cad.cli.installation import Diagnosis
    from gyroid_cad.common.tables import Rows
    from gyroid_cad.printing.verdict import PrintCheck

__all__ = ["SILENT_SECONDS", "print_check_table", "print_doctor", "print_report", "print_table", "shown_progress"]

Progress = Callable[[str, int, int], None]

# Of a command whose stages are printed: what takes no longer is told by its result alone.
SILENT_SECONDS = 5.0
# Columns of a pipe, which has none.
_UNWRAPPED = 100_000


def print_report(rows: Rows, files: Sequence[dict[str, Any]], seconds: float) -> None:
    """Print the rows of a report, the files that were written and the time it took.

    Parameters
    ----------
    rows : list of (str, str)
    files : sequence of dict
        With ``path`` and ``bytes``.
    seconds : float
    """
    written = [(file["path"], f"{file['bytes']:,} bytes") for file in files]
    print_table(None, [*rows, *written, ("time", f"{seconds:.2f} s")])


def print_check_table(check: PrintCheck) -> None:
    """Print what a printer makes of a part, row by row, and the verdict."""
    print_table(check.header(), [*check.rows(), check.verdict_row()])


def print_doctor(diagnosis: Diagnosis) -> None:
    """Print what is installed and what the self-test found."""
    rows = [(finding.subject, finding.state, finding.detail) for finding in diagnosis.findings]
    verdict = "all that is required is there and works" if diagnosis.ok else "something is missing or fails"
    print_table(None, [*rows, ("verdict", "ok" if diagnosis.ok else "failed", verdict)])


def shown_progress(shown: bool, lines: bool = False) -> AbstractContextManager[Progress | None]:
    """A progress display on the terminal while the context lasts, or none.

    Parameters
    ----------
    shown : bool
    lines : bool
        Where the error stream is no terminal, to print a line there for each stage of what takes long.
    """
    if not shown:
        return nullcontext(None)
    if lines and not sys.stderr.isatty():
        return nullcontext(_line_progress(time.perf_counter()))
    from gyroid_cad.cli.bars import terminal_progress

    return terminal_progress()


def _line_progress(start: float) -> Progress:
    """A function that prints each stage once, with the seconds since the start, for logs.

    Nothing is printed of what ends, or is refused, within :data:`SILENT_SECONDS`.
    """
    said: set[str] = set()
    held: list[str] = []

    def update(stage: str, done: int, total: int) -> None:
        seconds = time.perf_counter() - start
        if stage not in said:
            said.add(stage)
            held.append(f"{seconds:7.1f} s  {stage}{f', {total} s' if is_forecast(stage) else ''}")
        if seconds >= SILENT_SECONDS and held:
            print(*held, sep="\n", file=sys.stderr, flush=True)
            held.clear()

    return update


def print_table(header: tuple[str, ...] | None, rows: Sequence[tuple[str, ...]]) -> None:
    """Print rows of text in columns, under a header if there is one."""
    from rich.console import Console
    from rich.table import Table

    class Patient(Console):
        def on_broken_pipe(self) -> None:
            # Rich would leave at once; what a closed pipe means is for the command line to say, as of all it prints.
            raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))

    table = Table(*(header or [""] * len(rows[0])), show_header=header is not None, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    # In a pipe there is no width to respect: nothing is wrapped.
    console = Patient(highlight=False, markup=False, **({} if sys.stdout.isatty() else {"width": _UNWRAPPED}))  # type: ignore[arg-type]
    console.print(table)

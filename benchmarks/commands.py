"""Whole commands as a user gives them, by the clock: from the prompt to the files, start of the program included.

Each is run in a folder of its own that has the examples in it, as a fresh clone does. The README's table of times is
what this prints.

Run: ``python -m benchmarks.commands [--small]``; ``--small`` runs the first one only.
"""

from __future__ import annotations

import shlex
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.timing import ROOT, arguments_for, plain_table, seconds_of_process

__all__ = ["COMMANDS", "main"]

COMMANDS = (
    "build -o gyroid.step -o gyroid.stl --cells 2 2 2 --cell-size 10 --thickness 0.8",
    "build -o large.stl --cells 10 10 10 --cell-size 10 --thickness 0.8",
    "build -o large.step --cells 10 10 10 --cell-size 10 --thickness 0.8",
    "build -o many.step --instances --cells 10 10 10 --cell-size 10 --thickness 0.8",
    "build -o block.step --trim box --cells 5 5 5 --cell-size 7 --density 0.3",
    "mesh -o paper.vtu --cells 4 3 2 --cell-size 10 --thickness 1 --subdivisions 20",
    "fill examples/bracket.step -o light.step --cell-size 8 --density 0.30",
    'fill examples/bracket.step -o skinned.step --cell-size 8 --density 0.30 --skin 1 --opening ">X"',
)
_EXAMPLES = "examples"


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table; nothing is required, so always True."""
    small = arguments_for("Time whole commands.").parse_args(arguments).small
    lines = [(f"gyroid-cad {command}", *_taken(command)) for command in (COMMANDS[:1] if small else COMMANDS)]
    plain_table("Whole commands, by the clock", ("", "seconds", "MB of files"), lines)
    return True


def _taken(command: str) -> tuple[str, str]:
    with TemporaryDirectory() as name:
        folder = Path(name)
        shutil.copytree(ROOT / _EXAMPLES, folder / _EXAMPLES)
        seconds = seconds_of_process("-m", "gyroid_cad", *shlex.split(command), "--quiet", folder=folder)
        size = sum(path.stat().st_size for path in folder.iterdir() if path.is_file())
    return f"{seconds:.2g}", f"{size / 1e6:.2g}"


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

"""What a user waits for before the first result, each time in fresh processes, best of several.

Importing and the first fit are timed inside the process, after the interpreter has started; building one
cell to STEP and importing CadQuery are timed as whole processes.

Run: ``python -m benchmarks.startup [--repeats N] [--small]``; ``--small`` starts each once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.timing import Row, arguments_for, fresh_python, print_verdicts, seconds_of_process

__all__ = ["main"]

_IMPORT = """
from time import perf_counter
start = perf_counter()
import gyroid_cad
print(perf_counter() - start)
"""
_FIRST_FIT = """
import gyroid_cad
from time import perf_counter
start = perf_counter()
from gyroid_cad.surface.fit import fit_patch
fit_patch()
print(perf_counter() - start)
"""
_BUILD = ("-m", "gyroid_cad", "build", "--cells", "1", "1", "1", "--cell-size", "10", "--thickness", "0.8", "--quiet")


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table; returns whether every requirement is met."""
    parser = arguments_for("Time the start of fresh processes.")
    parser.add_argument("--repeats", type=int, default=5, help="the best counts (default 5)")
    options = parser.parse_args(arguments)
    with TemporaryDirectory() as folder:
        output = str(Path(folder) / "cell.step")
        rounds = [_one_round(output) for _ in range(1 if options.small else options.repeats)]
    importing, fitting, building, cadquery, kernel = (min(times) for times in zip(*rounds, strict=True))
    return print_verdicts(
        "Start",
        [
            Row("import gyroid_cad", importing, 0.3, 0.15, " s"),
            Row("first fit_patch(), with the imports it triggers", fitting, 0.5, 0.2, " s"),
            Row("gyroid-cad build, one cell to STEP / import cadquery", building / cadquery, 1, 0.5, "x"),
            Row("gyroid-cad build, one cell to STEP", building, unit=" s", remark="whole process"),
            Row("python -c 'import cadquery'", cadquery, unit=" s", remark="whole process"),
            Row("python -c 'import OCP.BRep'", kernel, unit=" s", remark="whole process: the kernel alone"),
        ],
    )


def _one_round(output: str) -> tuple[float, ...]:
    """Seconds of each: in turn, so that what slows the machine slows all of them."""
    inside = [float(fresh_python("-c", program)) for program in (_IMPORT, _FIRST_FIT)]
    processes = [(*_BUILD, "-o", output), ("-c", "import cadquery"), ("-c", "import OCP.BRep")]
    return *inside, *(seconds_of_process(*arguments) for arguments in processes)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

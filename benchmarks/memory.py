"""Peak memory and file size for each cell: of the solid, of writing it as STEP, of meshing it as STL.

Every figure is the peak resident memory of a fresh process; the slope over the number of cells is what a
cell costs, the intercept what the interpreter and the kernel cost. The check of available memory before a
build rests on these slopes.

Run: ``python -m benchmarks.memory [--sides 2 4 6] [--small]``; ``--small`` is files of one cell and eight.
"""

from __future__ import annotations

import resource
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.timing import arguments_for, fresh_python, plain_table

__all__ = ["main", "peak"]

_KINDS = ("solid", "step", "stl")
# Linux's own record of this program's peak: ru_maxrss starts there from the peak of the process that started it.
_STATUS = Path("/proc/self/status")


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; nothing is required, so always True."""
    parser = arguments_for("Measure peak memory in fresh processes.")
    parser.add_argument("--sides", type=int, nargs="+", default=[2, 4, 6], help="cells along a side (default 2 4 6)")
    options = parser.parse_args(arguments)
    sides = [1, 2] if options.small else options.sides
    kinds = _KINDS[1:] if options.small else _KINDS
    measured = {kind: np.array([_measured(kind, side) for side in sides]) for kind in kinds}
    cells = np.array(sides) ** 3
    _print_peaks(cells, measured)
    _print_slopes(cells, measured)
    return True


def _print_peaks(cells: np.ndarray, measured: dict[str, np.ndarray]) -> None:
    headings = ("peak memory, MB; file size, MB", *(f"{count} cells" for count in cells))
    lines = [(kind, *(f"{peak / 1e6:.0f}; {size / 1e6:.1f}" for peak, size in rows)) for kind, rows in measured.items()]
    plain_table("Peak memory of a fresh process", headings, lines)


def _print_slopes(cells: np.ndarray, measured: dict[str, np.ndarray]) -> None:
    lines = []
    for kind, columns in measured.items():
        peak, size = (np.polyfit(cells, column, 1) for column in columns.T)
        lines.append((kind, f"{peak[1] / 1e6:.0f} MB", f"{peak[0] / 1e3:.0f} kB", f"{size[0] / 1e3:.0f} kB"))
    plain_table("What a cell costs", ("up to", "before the first", "memory a cell", "file a cell"), lines)


def _measured(kind: str, side: int) -> tuple[int, int]:
    """Peak memory and file size in bytes, from a process of its own."""
    peak, size = fresh_python("-m", "benchmarks.memory", "--alone", kind, str(side)).split()
    return int(peak), int(size)


def _alone(kind: str, side: int) -> None:
    """Build, write, and print this process's peak and the size of what it wrote."""
    from benchmarks.subject import CELL_SIZE, block_solid
    from gyroid_cad.kernel.step import write_step
    from gyroid_cad.kernel.stl import write_meshed_stl

    solid = block_solid(side)
    size = 0
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"block.{kind}"
        if kind == "step":
            write_step(solid, path)
        elif kind == "stl":
            write_meshed_stl(solid, path, CELL_SIZE / 1000)
        if path.exists():
            size = path.stat().st_size
    print(peak(), size)


def peak() -> int:
    """Peak resident memory of this process, in bytes."""
    if _STATUS.exists():
        lines = (line.split() for line in _STATUS.read_text().splitlines())
        return next(int(words[1]) for words in lines if words[0] == "VmHWM:") * 1024
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        _alone(sys.argv[2], int(sys.argv[3]))
    else:
        main(sys.argv[1:])

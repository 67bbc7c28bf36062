"""STEP assemblies beside merged solids: bytes, time, and what they hold when read back.

A merged solid's file grows with its cells and, a little, with its outer walls: bytes = a n^3 + b n^2 + c for n cells a
side. The three are found from blocks of 2, 3 and 4 cells a side, tried on one of 5, and carried on to 10, whose merged
file would be some 380 MB. The assembly of 10 x 10 x 10 cells is really written, and read again by the kernel.

Run: ``python -m benchmarks.assembly [--small]``; ``--small`` finds a, b and c from blocks of 1, 2 and 3 cells a side,
and goes no further than 4.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from benchmarks.subject import CELL_SIZE, THICKNESS
from benchmarks.timing import Row, arguments_for, plain_table, print_verdicts
from gyroid_cad.kernel.check import enclosed_volume, topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice

__all__ = ["main"]

# Cells a side of the blocks that the three numbers are found from, of the one they are tried on, of the large one.
_SIDES, _SMALL_SIDES = ((2, 3, 4), 5, 10), ((1, 2, 3), 3, 4)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    small = arguments_for("Measure STEP assemblies against merged solids.").parse_args(arguments).small
    fitted, tried, large = _SMALL_SIDES if small else _SIDES
    lines = []
    with TemporaryDirectory() as folder:
        merged, single = {}, {}
        for cells in sorted({*fitted, tried}):
            merged[cells], seconds = _written(cells, Path(folder), instances=False)
            single[cells], fast = _written(cells, Path(folder), instances=True)
            lines.append(_line(cells, merged[cells], seconds, single[cells], fast))
        bytes_of = np.polynomial.Polynomial(_coefficients({n: merged[n] for n in fitted}))
        single[large], fast = _written(large, Path(folder), instances=True)
        lines.append(_line(large, int(bytes_of(large)), None, single[large], fast))
        foretold = f"merged file of {tried} a side off what {', '.join(map(str, fitted))} foretell"
        rows = [
            Row(foretold, abs(bytes_of(tried) / merged[tried] - 1), 0.01),
            Row(f"merged / assembly, {large}³ cells", bytes_of(large) / single[large], 100, 200, "x", True),
            Row("bytes an instance", (single[large] - single[tried]) / (large**3 - tried**3), 700),
            *_read_back(large, Path(folder)),
        ]
    plain_table(
        "STEP: one solid, and one cell in many places",
        ("cells", "merged, bytes", "seconds", "assembly, bytes", "seconds", "ratio"),
        lines,
    )
    return print_verdicts("STEP assemblies, cells of 10 mm, wall 0.8 mm", rows)


def _written(cells: int, folder: Path, instances: bool) -> tuple[int, float]:
    """Bytes of a block's file, and the seconds by the clock from its description to it."""
    path = folder / "block.step"
    start = perf_counter()
    Lattice((cells,) * 3, CELL_SIZE, THICKNESS).write(path, instances=instances)
    return path.stat().st_size, perf_counter() - start


def _coefficients(sizes: dict[int, int]) -> list[float]:
    """Of 1, n, n^2, n^3, without the second."""
    n = np.array(list(sizes), dtype=float)
    c, b, a = np.linalg.solve(np.stack([np.ones_like(n), n**2, n**3], axis=1), list(sizes.values())).tolist()
    return [c, 0.0, b, a]


def _read_back(cells: int, folder: Path) -> list[Row]:
    lattice = Lattice((cells,) * 3, CELL_SIZE, THICKNESS)
    lattice.write(folder / "block.step", instances=True)
    start = perf_counter()
    shape = read_step(folder / "block.step")
    seconds = perf_counter() - start
    return [
        Row(
            "solids off the number of cells",
            abs(topology(shape).solids - cells**3),
            0,
            remark=f"read in {seconds:.2g} s",
        ),
        Row("volume off the tube formula's", abs(enclosed_volume(shape) / lattice.exact_volume - 1), 2e-7),
    ]


def _line(cells: int, merged: int, seconds: float | None, single: int, fast: float) -> tuple[str, ...]:
    slow = "foretold" if seconds is None else f"{seconds:.2f}"
    return f"{cells} x {cells} x {cells}", f"{merged:,}", slow, f"{single:,}", f"{fast:.2f}", f"{merged / single:.0f}"


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

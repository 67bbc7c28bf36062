"""STEP assemblies beside merged solids: bytes, time, and what they hold when read back.

A merged solid's file grows with its cells and, a little, with its outer walls: bytes = a n^3 + b n^2 + c for n cells a
side. The three are found from blocks of 2, 3 and 4 cells a side, tried on one of 5, and carried on to 10, whose merged
file would be some 380 MB. The assembly of 10 x 10 x 10 cells is really written, and read again by the kernel.

Run: ``python -m benchmarks.assembly [--quick]``; ``--quick`` reads no more than 3 cells a side.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np

from benchmarks.subject import CELL_SIZE, THICKNESS
from benchmarks.timing import Row, plain_table, print_verdicts
from gyroid_cad.kernel.check import enclosed_volume, topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice

__all__ = ["main"]

_FITTED, _TRIED, _LARGE = (2, 3, 4), 5, 10


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    parser = argparse.ArgumentParser(description="Measure STEP assemblies against merged solids.")
    parser.add_argument("--quick", action="store_true", help="read a small assembly back")
    quick = parser.parse_args(arguments).quick
    lines = []
    with TemporaryDirectory() as folder:
        merged, single = {}, {}
        for cells in (*_FITTED, _TRIED):
            merged[cells], seconds = _written(cells, Path(folder), instances=False)
            single[cells], fast = _written(cells, Path(folder), instances=True)
            lines.append(_line(cells, merged[cells], seconds, single[cells], fast))
        bytes_of = np.polynomial.Polynomial(_coefficients({n: merged[n] for n in _FITTED}))
        single[_LARGE], fast = _written(_LARGE, Path(folder), instances=True)
        lines.append(_line(_LARGE, int(bytes_of(_LARGE)), None, single[_LARGE], fast))
        rows = [
            Row("merged file of 5 a side off what 2, 3, 4 foretell", abs(bytes_of(5) / merged[5] - 1), 0.01),
            Row("merged / assembly, 10 x 10 x 10 cells", bytes_of(_LARGE) / single[_LARGE], 100, 200, "x", True),
            Row("bytes an instance", (single[_LARGE] - single[_TRIED]) / (_LARGE**3 - _TRIED**3), 700),
            *_read_back(3 if quick else _LARGE, Path(folder)),
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

"""Files that receivers take: random lattices and filled parts by the limits of ``gyroid-cad check``, and what it takes.

Lattices of all three surfaces, uniform, graded, scaled, bent and trimmed, and random parts filled, each written as STEP
and checked by the default profile. Told are the criteria that any file broke, with the worst value and its seed, and
the time of a check against that of OpenCascade's reading and own check alone.

Run: ``python -m benchmarks.receivers [--small] [--lattices N] [--fills N] [--first SEED]``.
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from benchmarks.random_parts import random_part
from benchmarks.timing import Row, arguments_for, plain_table, print_verdicts
from gyroid_cad import FileCheck, Lattice, check_file, fill
from gyroid_cad.common.choices import SURFACE_NAMES
from gyroid_cad.errors import GyroidError
from gyroid_cad.kernel.check import is_valid
from gyroid_cad.kernel.reading import read_shape

__all__ = ["main"]

# The share of files that may break a limit, and how much longer a check may take than the kernel's reading and its own.
_BROKEN, _TIMES = 0.05, 4.0
_LATTICES, _FILLS = 200, 40


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether as many files pass as are required."""
    parser = arguments_for("Check random lattices and filled parts.")
    parser.add_argument("--lattices", type=int, default=_LATTICES)
    parser.add_argument("--fills", type=int, default=_FILLS)
    parser.add_argument("--first", type=int, default=0, help="seed of the first of either")
    given = parser.parse_args(arguments)
    counts = (1, 1) if given.small else (given.lattices, given.fills)
    share, rows, seconds = [], [], np.zeros(2)
    with TemporaryDirectory() as folder:
        for name, make, count in zip(("lattices", "fills"), (_lattice, _filled), counts, strict=True):
            checks = {}
            for seed in range(given.first, given.first + count):
                check = _checked(make, seed, Path(folder) / "made.step", seconds)
                if check is not None:
                    checks[seed] = check
            rows += _broken(name, checks)
            share.append(sum(not check.ok for check in checks.values()) / max(len(checks), 1))
    plain_table("Broken limits", ("of", "criterion", "files", "worst", "limit", "seed", "place"), rows)
    return print_verdicts(
        "Files by the limits of receivers",
        [
            Row("share of lattices that break a limit", share[0], _BROKEN, 0.0),
            Row("share of filled parts that break a limit", share[1], _BROKEN, 0.0),
            Row("a check, against the kernel's reading and check", seconds[0] / max(seconds[1], 1e-9), _TIMES, 1.5),
        ],
    )


def _checked(
    make: Callable[[np.random.Generator, Path], None], seed: int, path: Path, seconds: np.ndarray[Any, Any]
) -> FileCheck | None:
    """Make and check a file, and add to the seconds of our check and of the kernel's; nothing where it is refused."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            make(np.random.default_rng(seed), path)
    except GyroidError as refused:
        print(f"seed {seed}: refused: {refused}", flush=True)
        return None
    start = time.perf_counter()
    check = check_file(path)
    between = time.perf_counter()
    is_valid(read_shape(path))
    seconds += (between - start, time.perf_counter() - between)
    return check


def _lattice(random: np.random.Generator, path: Path) -> None:
    cell = float(np.round(10 ** random.uniform(0.4, 1.2), 2))
    kinds: tuple[dict[str, Any], ...] = (
        {},
        {"trim": "box"},
        {"density": f"{random.uniform(0.15, 0.3):.3f} + {0.05 / cell:.4f}*x"},
        {"scale_field": f"1 + {0.1 / cell:.4f}*x"},
        {"map": "bend:angle=30"},
    )
    kind = {"density": float(random.uniform(0.1, 0.4)), **kinds[random.integers(len(kinds))]}
    cells = random.integers(1, 3, 3)
    surface = SURFACE_NAMES[random.integers(len(SURFACE_NAMES))]
    Lattice((int(cells[0]), int(cells[1]), int(cells[2])), cell, surface=surface, **kind).write(path)


def _filled(random: np.random.Generator, path: Path) -> None:
    part = random_part(random)
    surface = SURFACE_NAMES[random.integers(len(SURFACE_NAMES))]
    fill(part, float(random.uniform(4, 9)), density=0.3, surface=surface).write(path)


def _broken(name: str, checks: dict[int, FileCheck]) -> list[tuple[str, ...]]:
    """Rows of the criteria that were broken, with the value furthest off."""
    rows = []
    for number, criterion in enumerate(next(iter(checks.values())).checks if checks else ()):
        found = {seed: check.checks[number] for seed, check in checks.items() if not check.checks[number].ok}
        if found:
            seed = max(found, key=lambda seed: abs(float(found[seed].worst or 0) - float(found[seed].limit or 0)))
            worst, place = found[seed], found[seed].place
            shown = "" if place is None else ", ".join(f"{x:.3f}" for x in place)
            rows.append(
                (name, criterion.name, str(len(found)), f"{worst.worst:.4g}", f"{worst.limit:g}", str(seed), shown)
            )
    return rows


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

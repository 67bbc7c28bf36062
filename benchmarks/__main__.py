"""Every table, one after the other; the exit status says whether all requirements are met.

Run: ``python -m benchmarks [--quick]``. Sewing 48,000 faces takes the kernel a quarter of an hour; ``--quick`` sews
5 cells a side instead of 10, where the ratios are smaller, fills small parts and writes small files only.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from benchmarks import (
    accuracy,
    assembly,
    filling,
    grading,
    memory,
    meshes,
    parameterisation,
    solid_against_sewing,
    solid_against_thickening,
    startup,
    triangles,
)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print all the tables; returns whether every requirement is met."""
    parser = argparse.ArgumentParser(description="Run every benchmark.")
    parser.add_argument("--quick", action="store_true", help="sew 5 cells a side, small parts and files only")
    quick = parser.parse_args(arguments).quick
    cells = "5" if quick else "10"
    results = [
        accuracy.main(),
        assembly.main(["--quick"] if quick else []),
        filling.main(["--quick"] if quick else []),
        grading.main(),
        meshes.main(),
        parameterisation.main(),
        startup.main(),
        solid_against_thickening.main(),
        solid_against_sewing.main(["--cells", cells]),
        memory.main(),
        triangles.main(["--quick"] if quick else []),
    ]
    return all(results)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

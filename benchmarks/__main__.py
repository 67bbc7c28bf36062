"""Every table, one after the other; the exit status says whether all requirements are met.

Run: ``python -m benchmarks [--small]``. All of it takes the better part of an hour: sewing 48,000 faces alone takes the
kernel a quarter of one. ``--small`` runs every step in a minute or so, at sizes at which ratios mean little.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from benchmarks import (
    accuracy,
    assembly,
    commands,
    filling,
    grading,
    memory,
    meshes,
    parameterisation,
    random_parts,
    real_parts,
    receivers,
    skins,
    solid_against_sewing,
    solid_against_thickening,
    startup,
    step_files,
    triangles,
    trimmed,
)
from benchmarks.timing import arguments_for

__all__ = ["BENCHMARKS", "main"]

BENCHMARKS = (
    accuracy,
    assembly,
    filling,
    grading,
    meshes,
    parameterisation,
    random_parts,
    real_parts,
    receivers,
    startup,
    step_files,
    solid_against_thickening,
    solid_against_sewing,
    memory,
    skins,
    triangles,
    trimmed,
    commands,
)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print all the tables; returns whether every requirement is met."""
    small = arguments_for("Run every benchmark.").parse_args(arguments).small
    results = [benchmark.main(["--small"] if small else []) for benchmark in BENCHMARKS]
    return all(results)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

"""``python -m benchmarks``: every table, one after the other; the status says whether all requirements are met."""

from __future__ import annotations

import sys

from benchmarks import (
    accuracy,
    memory,
    parameterisation,
    solid_against_sewing,
    solid_against_thickening,
    startup,
)


def main() -> bool:
    """Print all the tables; returns whether every requirement is met."""
    mains = (
        accuracy.main,
        parameterisation.main,
        startup.main,
        solid_against_thickening.main,
        solid_against_sewing.main,
        memory.main,
    )
    results = [run() for run in mains]
    return all(results)


if __name__ == "__main__":
    sys.exit(not main())

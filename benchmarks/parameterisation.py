"""How the two interior shifts of the smooth parameterisation move the fit's deviation.

The edges are given; where the interior lies between them is free, and ``patch.py`` shifts it by two small
coefficients. This scans both round the chosen values, and shows plain transfinite interpolation (no shift)
beside, for the 10 x 10 fit.

Run: ``python -m benchmarks.parameterisation [--steps N] [--width W]``
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from benchmarks.timing import Row, plain_table, print_verdicts
from gyroid_cad import patch
from gyroid_cad.fit import FitReport, fit_patch, fit_report

__all__ = ["main"]

Shifts = tuple[float, float]

# How far from the best of the scan the chosen values may be.
_NEAR_THE_BEST = 1.02


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether the chosen values are near the best of the scan."""
    options = _parsed(arguments)
    radial, cubic = chosen = (patch._RADIAL_SHIFT, patch._CUBIC_SHIFT)
    around = options.width * np.linspace(-1, 1, 2 * options.steps + 1)
    reports = {(radial + dr, cubic + dc): _report((radial + dr, cubic + dc)) for dr in around for dc in around}
    plain = _report((0.0, 0.0))
    _print_scan(
        "Deviation / L over the radial (down) and cubic (across) shift", reports, lambda r: f"{r.max_distance:.2e}"
    )
    _print_scan("Angle between normals, degrees", reports, lambda r: f"{r.max_normal_angle:.4f}")
    best = min(reports, key=lambda shifts: reports[shifts].max_distance)
    return print_verdicts("Shifts of the interior", _rows(reports[chosen], plain, best, reports[best]))


def _rows(chosen: FitReport, plain: FitReport, best: Shifts, at_best: FitReport) -> list[Row]:
    ratio = chosen.max_distance / at_best.max_distance
    return [
        Row("deviation / L as chosen", chosen.max_distance, remark=f"angle {chosen.max_normal_angle:.4f}°"),
        Row("deviation / L without shifts", plain.max_distance, remark=f"angle {plain.max_normal_angle:.4f}°"),
        Row("deviation / L, best of the scan", at_best.max_distance, remark=f"at {best[0]:.4f}, {best[1]:.4f}"),
        Row("as chosen / best of the scan", ratio, _NEAR_THE_BEST, unit="x"),
    ]


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Scan the interior shifts of the parameterisation.")
    parser.add_argument("--steps", type=int, default=2, help="to each side of the chosen values (default 2)")
    parser.add_argument("--width", type=float, default=2e-3, help="of the scan to each side (default 0.002)")
    return parser.parse_args(arguments)


def _report(shifts: Shifts) -> FitReport:
    with _shifted(*shifts):
        return fit_report(fit_patch())


@contextmanager
def _shifted(radial: float, cubic: float) -> Iterator[None]:
    """Set the two coefficients; put them back, and forget the fits made with them."""
    before = (patch._RADIAL_SHIFT, patch._CUBIC_SHIFT)
    _set_shifts(radial, cubic)
    try:
        yield
    finally:
        _set_shifts(*before)


def _set_shifts(radial: float, cubic: float) -> None:
    patch._RADIAL_SHIFT, patch._CUBIC_SHIFT = radial, cubic
    fit_patch.cache_clear()
    fit_report.cache_clear()


def _print_scan(title: str, reports: dict[Shifts, FitReport], shown: Callable[[FitReport], str]) -> None:
    radials, cubics = (sorted({shifts[axis] for shifts in reports}) for axis in (0, 1))
    lines = [(f"{radial:.4f}", *(shown(reports[radial, cubic]) for cubic in cubics)) for radial in radials]
    plain_table(title, ("", *(f"{cubic:.4f}" for cubic in cubics)), lines)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

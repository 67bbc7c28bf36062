"""How the two interior shifts of the smooth parameterisation move the fit's deviation, surface by surface.

The edges are given; where the interior lies between them is free, and each family shifts it by two small
coefficients of its own. This scans both round the chosen values, in parts of the patch's size, and shows plain
transfinite interpolation (no shift) beside, for the 10 x 10 fit.

Run: ``python -m benchmarks.parameterisation [--steps N] [--width W] [--small]``; ``--small`` scans one surface, a step
to each side.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.timing import Row, arguments_for, plain_table, print_verdicts
from gyroid_cad.surface.families import SURFACES, USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import FitReport, fit_report
from gyroid_cad.surface.weierstrass import Family

__all__ = ["main"]

Shifts = tuple[float, float]

# How far from the best of the scan the chosen values may be.
_NEAR_THE_BEST = 1.05


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether the chosen values are near the best of the scan."""
    options = _parsed(arguments)
    steps, surfaces = (1, [USUAL]) if options.small else (options.steps, list(SURFACES.values()))
    around = options.width * np.linspace(-1, 1, 2 * steps + 1)
    results = [_scanned(surface.family, around) for surface in surfaces]
    return all(results)


def _scanned(family: Family, around: np.ndarray) -> bool:
    reports = {(dr, dc): _report(family, (dr, dc)) for dr in around.tolist() for dc in around.tolist()}
    plain = fit_report(fit_patch(FitSettings(), replace(family, interior_shift=(0.0, 0.0))))
    _print_scan(
        f"{family.name}: deviation / L over changes of the radial (down) and cubic (across) shift",
        reports,
        lambda r: f"{r.max_distance:.2e}",
    )
    best = min(reports, key=lambda shifts: reports[shifts].max_distance)
    rows = _rows(reports[0.0, 0.0], plain, best, reports[best])
    return print_verdicts(f"Shifts of the interior, {family.name}", rows)


def _rows(chosen: FitReport, plain: FitReport, best: Shifts, at_best: FitReport) -> list[Row]:
    ratio = chosen.max_distance / at_best.max_distance
    return [
        Row("deviation / L as chosen", chosen.max_distance, remark=f"angle {chosen.max_normal_angle:.4f}°"),
        Row("deviation / L without shifts", plain.max_distance, remark=f"angle {plain.max_normal_angle:.4f}°"),
        Row("deviation / L, best of the scan", at_best.max_distance, remark=f"at {best[0]:+.4f}, {best[1]:+.4f}"),
        Row("as chosen / best of the scan", ratio, _NEAR_THE_BEST, unit="x"),
    ]


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = arguments_for("Scan the interior shifts of the parameterisation.")
    parser.add_argument("--steps", type=int, default=2, help="to each side of the chosen values (default 2)")
    parser.add_argument("--width", type=float, default=4e-3, help="of the scan to each side (default 0.004)")
    return parser.parse_args(arguments)


def _report(family: Family, changes: Shifts) -> FitReport:
    radial, cubic = family.interior_shift
    # The surface's symmetry leaves the cubic one a direction in the complex plane.
    shifted = (radial + changes[0], cubic + changes[1] * cubic / abs(cubic))
    return fit_report(fit_patch(FitSettings(), replace(family, interior_shift=shifted)))


def _print_scan(title: str, reports: dict[Shifts, FitReport], shown: Callable[[FitReport], str]) -> None:
    radials, cubics = (sorted({shifts[axis] for shifts in reports}) for axis in (0, 1))
    lines = [(f"{radial:.4f}", *(shown(reports[radial, cubic]) for cubic in cubics)) for radial in radials]
    plain_table(title, ("", *(f"{cubic:.4f}" for cubic in cubics)), lines)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

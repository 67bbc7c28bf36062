"""How close the fit, the edges, the area and the volume come to the exact surface.

Distances are in cell sizes L and measured along the exact normal. The volume of a cell is that of the
control nets by Gauss quadrature, the area that of the fitted mid-surface; the references are exact.

Run: ``python -m benchmarks.accuracy [--small]``; ``--small`` fits no more than 14 control points a side.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from benchmarks.subject import CELL_SIZE, THICKNESS, block, block_solid, kernel_volume
from benchmarks.timing import Row, arguments_for, plain_table, print_verdicts
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, FittedPatch, fit_patch
from gyroid_cad.surface.fit_report import FitReport, fit_report

TUBE = USUAL.tube

__all__ = ["main"]

_CONTROL_POINTS = (8, 10, 12, 14, 17, 20, 24, 28, 34, 40)
_FEW_CONTROL_POINTS = (8, 10, 14)
_DEGREE = 3
# The area integrand is no polynomial; more points on a span no longer change it.
_AREA_POINTS_PER_SPAN = 8


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    small = arguments_for("Measure the fit against the exact surface.").parse_args(arguments).small
    counts = _FEW_CONTROL_POINTS if small else _CONTROL_POINTS
    _print_convergence(counts)
    return print_verdicts("Accuracy of the 10 x 10 fit", [*_fit_rows(), _order_row(counts), *_cell_rows()])


def _fit_rows() -> list[Row]:
    ours, paper = fit_report(fit_patch()), fit_report(fit_patch(FitSettings.paper()))
    return [
        Row("deviation / L", ours.max_distance, 1e-5, 5e-6, remark=_beside(paper.max_distance)),
        Row("angle between normals", ours.max_normal_angle, 0.11, 0.05, "°", remark=_beside(paper.max_normal_angle)),
        Row("gap between neighbouring edges / L", ours.edge_gap, 1e-12, remark=_beside(paper.edge_gap)),
        Row("corners off by / L", ours.corner_error, remark=_beside(paper.corner_error)),
        Row("mean curvature x L, rms", ours.rms_mean_curvature, remark=_beside(paper.rms_mean_curvature)),
    ]


def _beside(value: float) -> str:
    return f"the paper's fit: {value:.2e}"


def _order_row(counts: tuple[int, ...]) -> Row:
    remark = f"slope of log deviation over log span, {counts[0]} to {counts[-1]} control points"
    orders = [_order(counts[k : k + 2]) for k in range(len(counts) - 1)]
    return Row(
        "order of convergence",
        _order(counts),
        3.3,
        4,
        at_least=True,
        remark=f"{remark}; stepwise at least {min(orders):.2f}",
    )


def _order(control_points: tuple[int, ...]) -> float:
    """Least-squares slope of the deviation over the width of a knot span, both logarithmic."""
    spans = -np.log([n - _DEGREE for n in control_points])
    deviations = np.log([_report(n).max_distance for n in control_points])
    return float(np.polynomial.Polynomial.fit(spans, deviations, 1).convert().coef[1])


def _print_convergence(counts: tuple[int, ...]) -> None:
    headings = ("control points a side", "deviation / L", "angle", "gap between edges / L")
    lines = [
        (f"{n}", f"{r.max_distance:.2e}", f"{r.max_normal_angle:.5f}°", f"{r.edge_gap:.1e}")
        for n, r in ((n, _report(n)) for n in counts)
    ]
    plain_table("Convergence of the fit", headings, lines)


def _report(control_points: int) -> FitReport:
    return fit_report(fit_patch(FitSettings(control_points)))


def _cell_rows() -> list[Row]:
    exact = TUBE.density(THICKNESS / CELL_SIZE) * CELL_SIZE**3
    volume, area = block(1).volume(), _area_per_cell(fit_patch())
    by_kernel = kernel_volume(block_solid(1))
    return [
        Row(
            "volume of a cell, relative error",
            abs(volume / exact - 1),
            2e-6,
            1e-7,
            remark=f"{volume:.7f}, exactly {exact:.7f} mm³",
        ),
        Row("the same by the kernel's BRepGProp", abs(by_kernel / exact - 1), remark=f"{by_kernel:.7f} mm³"),
        Row(
            "area of the mid-surface of a cell, relative error",
            abs(area / TUBE.area - 1),
            2e-7,
            remark=f"{area:.8f}, exactly {TUBE.area:.8f} L²",
        ),
    ]


def _area_per_cell(patch: FittedPatch) -> float:
    """Area of a cell's patches in squared cell sizes; the patch is in halves of the cell size."""
    points, weights = gauss_points(patch.surface.knots_u, _AREA_POINTS_PER_SPAN)
    u, v = (grid.ravel() for grid in np.meshgrid(points, points, indexing="ij"))
    d = patch.surface.derivatives(u, v)
    stretch = np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=1)
    return len(USUAL.cell) * float(np.outer(weights, weights).ravel() @ stretch) / 4


if __name__ == "__main__":
    sys.exit(not main())

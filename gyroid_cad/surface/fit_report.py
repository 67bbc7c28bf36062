"""Deviation of a fit from the exact surface, and the control points that a tolerance takes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import ceil

import numpy as np

from gyroid_cad.common.tables import Rows, text_table
from gyroid_cad.errors import ParameterError
from gyroid_cad.nurbs.roots import line_step
from gyroid_cad.surface.fit import (
    CELL_SIZE,
    DEGREE,
    MOST_CONTROL_POINTS,
    FitSettings,
    FittedPatch,
    edge_gap,
    fit_patch,
)
from gyroid_cad.surface.patch import PARAMETERISATIONS, parameter_corners
from gyroid_cad.surface.weierstrass import GYROID, Family

__all__ = ["FitReport", "error_within_reach", "fewest_within", "fit_report", "fit_within", "more_control_points"]

_REPORT_SAMPLES_PER_SPAN = 8
_MOST_REPORT_SAMPLES = 121
_FOOT_POINT_STEPS = 4
# How far below what the finest fit is expected to reach a tolerance is refused without trying.
_HOPELESS = 10
# Less than this is rounding, of which the digits differ from machine to machine.
_ROUNDING = 1e-15
# The error of a cubic fit falls with the fourth power of the number of spans; a little more than needed is taken.
_ORDER, _SURPLUS = 4, 1.05


@dataclass(frozen=True, slots=True)
class FitReport:
    """Errors of a fit; lengths in units of the cell size L, angles in degrees, curvature in 1/L."""

    max_distance: float
    rms_distance: float
    max_normal_angle: float
    max_mean_curvature: float
    rms_mean_curvature: float
    edge_gap: float
    corner_error: float

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed; L is the cell size."""
        found = {
            "largest distance along the normal / L": self.max_distance,
            "rms distance along the normal / L": self.rms_distance,
            "largest angle between normals, degrees": self.max_normal_angle,
            "largest mean curvature x L (exact: 0)": self.max_mean_curvature,
            "rms mean curvature x L": self.rms_mean_curvature,
            "gap between an edge and its neighbour's / L": self.edge_gap,
            "corners off by / L": self.corner_error,
        }
        return [(subject, "< 1e-15" if value < _ROUNDING else f"{value:.2e}") for subject, value in found.items()]

    def __str__(self) -> str:
        return text_table(self.rows())


@lru_cache(maxsize=32)
def fit_report(fitted: FittedPatch) -> FitReport:
    """Measure a fit against the exact surface on a dense grid.

    Distance is measured along the exact normal through the exact point, to where that line meets the
    fitted surface (Newton's method); the angle is that between the two normals there.
    """
    n = fitted.settings.control_points
    samples = np.linspace(-1, 1, min(_REPORT_SAMPLES_PER_SPAN * (n - DEGREE) + 1, _MOST_REPORT_SAMPLES))
    u, v = (grid.ravel() for grid in np.meshgrid(samples, samples, indexing="ij"))
    exact = PARAMETERISATIONS[fitted.settings.parameterisation]
    points, normals = exact(u, v, fitted.family)
    distance = np.zeros(len(u))
    foot_u, foot_v = u.copy(), v.copy()
    for _ in range(_FOOT_POINT_STEPS):
        d = fitted.surface.derivatives(foot_u, foot_v)
        step_u, step_v, distance = line_step(d[0, 0] - points, d[1, 0], d[0, 1], normals)
        foot_u, foot_v = foot_u + step_u, foot_v + step_v
        # Newton's steps square: after one this small nothing is left to gain.
        if max(np.max(np.abs(step_u)), np.max(np.abs(step_v))) < 1e-8:
            break
    sine = np.linalg.norm(np.cross(fitted.surface.normals(foot_u, foot_v), normals), axis=1)
    curvature = fitted.surface.mean_curvature(samples[:, np.newaxis], samples[np.newaxis]) * CELL_SIZE
    corner_u, corner_v = parameter_corners().T
    off_corners = fitted.surface.evaluate(corner_u, corner_v) - exact(corner_u, corner_v, fitted.family)[0]
    return FitReport(
        max_distance=float(np.max(np.abs(distance))) / CELL_SIZE,
        rms_distance=float(np.sqrt(np.mean(distance**2))) / CELL_SIZE,
        max_normal_angle=float(np.degrees(np.arcsin(np.max(sine)))),
        max_mean_curvature=float(np.max(np.abs(curvature))),
        rms_mean_curvature=float(np.sqrt(np.mean(curvature**2))),
        edge_gap=edge_gap(fitted),
        corner_error=float(np.max(np.linalg.norm(off_corners, axis=1)) / CELL_SIZE),
    )


def fit_within(settings: FitSettings, tolerance: float, family: Family = GYROID) -> FitSettings:
    """Raise the control points of settings until a tolerance is met.

    Parameters
    ----------
    settings : FitSettings
    tolerance : float
        Largest deviation of the mid-surface, in cell sizes.
    family : Family

    Raises
    ------
    ParameterError
        If it is out of reach, or the settings' own knots and weights miss it.
    """
    while (reached := fit_report(fit_patch(settings, family)).max_distance) > tolerance:
        n = settings.control_points
        least = error_within_reach(n, reached)
        if tolerance < least / _HOPELESS and settings.plain:
            # The finest fit takes seconds.
            raise ParameterError(
                "tolerance", tolerance, f"at least about {least:.2g}, which {MOST_CONTROL_POINTS} control points reach"
            )
        if n == MOST_CONTROL_POINTS or not settings.plain:
            raise ParameterError("tolerance", tolerance, f"at least {reached:.2g}, which {n} control points reach")
        settings = replace(settings, control_points=more_control_points(n, reached / tolerance))
    return settings


def fewest_within(settings: FitSettings, tolerance: float, family: Family = GYROID) -> FitSettings:
    """Raise the control points of settings no further than a tolerance takes.

    :func:`fit_within` goes up by leaps, to be there soon, and may land a little past the fewest that do.

    Parameters
    ----------
    settings : FitSettings
        With the fewest control points to be had.
    tolerance : float
        Largest deviation of the mid-surface, in cell sizes.
    family : Family

    Raises
    ------
    ParameterError
        If it is out of reach.
    """
    found = fit_within(settings, tolerance, family)
    while found.control_points > settings.control_points:
        fewer = replace(found, control_points=found.control_points - 1)
        if fit_report(fit_patch(fewer, family)).max_distance > tolerance:
            break
        found = fewer
    return found


def error_within_reach(control_points: int, error: float) -> float:
    """About the error of the finest fit, where one of so many control points, six or more, has ``error``."""
    return error * ((control_points - DEGREE) / (MOST_CONTROL_POINTS - DEGREE)) ** _ORDER


def more_control_points(control_points: int, excess: float) -> int:
    """Number of control points to try next, where the error of a fit is ``excess`` times what it may be."""
    wanted = DEGREE + (control_points - DEGREE) * (_SURPLUS * excess) ** (1 / _ORDER)
    return int(min(max(control_points + 1, ceil(wanted)), MOST_CONTROL_POINTS))

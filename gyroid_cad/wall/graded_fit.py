"""A lattice's wall, fitted: one patch for all where cells are alike, and every patch anew where they vary."""

from __future__ import annotations

from collections.abc import Callable

from gyroid_cad.common.progress import Timed
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall, build_wall
from gyroid_cad.wall.refit import Refit, fitted_wall, likely_control_points, measured
from gyroid_cad.wall.self_intersection import require_sound, require_sound_fit

__all__ = ["fit_wall"]


def fit_wall(
    complex: CellComplex,
    grading: Grading,
    settings: FitSettings,
    tolerance: float,
    timed: Timed,
    allow: Callable[[int], None] = lambda control_points: None,
) -> tuple[Wall, Refit | None]:
    """Fit the wall; where it varies, check that it can exist, and fit until it is as close as asked for.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading
    settings : FitSettings
    tolerance : float
        Largest deviation of a wall that varies, in cell sizes.
    timed : callable
        A context for each stage, by its name.
    allow : callable, optional
        Called with each number of control points before it is tried: may refuse it.

    Returns
    -------
    Wall
    Refit
        What the fit is worth; None where cells are alike.

    Raises
    ------
    ParameterError, SoundnessError, FitError
    """
    if grading.uniform:
        with timed("fit"):
            patch = fit_patch(settings, grading.surface.family)
        with timed("wall"):
            return build_wall(complex, patch, grading.cell_size, float(grading.thickness)), None  # type: ignore[arg-type]
    with timed("soundness"):
        require_sound(complex, grading)
    with timed("deviation"):
        wanted = likely_control_points(complex, grading, settings.control_points, tolerance)
    n = 0
    while n != wanted:
        n = wanted
        allow(n)
        with timed("fit"):
            wall = fitted_wall(complex, grading, n)
        with timed("deviation"):
            refit = measured(wall.nets, complex, grading)
        wanted = refit.control_points_for(tolerance, grading.cell_size)
    with timed("soundness"):
        require_sound_fit(wall, grading)
    return wall, refit

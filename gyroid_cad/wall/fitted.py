"""A lattice's wall, fitted from its description, stage by stage, timed: all that comes before a solid or a mesh."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.cache import Cache
from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress, Timed, timed
from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fewest_within, fit_within
from gyroid_cad.surface.weierstrass import Family
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.covering import AT_HOME, PERTURBATIONS, Frame, covering_complex, frame_of, wall_extremes
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall, build_wall
from gyroid_cad.wall.refit import Refit, graded_wall, likely_control_points, measured
from gyroid_cad.wall.self_intersection import CLEARANCE_SAMPLES, FOLD_SAMPLES, require_simple, require_simple_fit
from gyroid_cad.wall.tangency import smoothed

__all__ = [
    "HOME",
    "USUAL_TOLERANCE",
    "Closeness",
    "FittedWall",
    "LatticeSpec",
    "fit_spec",
    "fit_wall",
    "fitted_wall",
    "valid_tolerance",
]

# Of a graded lattice, in cell sizes.
USUAL_TOLERANCE = 1e-4
# Control points a side, from which a compact fit goes up: with 4 each edge is a single span.
_FEWEST_COMPACT = 5


def valid_tolerance(tolerance: float) -> float:
    """The largest deviation of a fit, in cell sizes.

    Raises
    ------
    ParameterError
        If it is not above 0 and below 1.
    """
    accepted = "a part of the cell size, a finite number above 0 and below 1"
    number = finite_number("tolerance", tolerance, accepted)
    if not 0 < number < 1:
        raise ParameterError("tolerance", tolerance, accepted)
    return number


@dataclass(frozen=True, slots=True)
class Closeness:
    """A fit, or the deviation that chooses its control points.

    Attributes
    ----------
    fit : FitSettings
        To begin with.
    tolerance : float, optional
        Largest deviation in cell sizes, to which control points rise.
    compact : float, optional
        Largest deviation in mm instead, which the fewest control points are to meet.

    Examples
    --------
    >>> from gyroid_cad.surface.weierstrass import GYROID
    >>> settings, tolerance = Closeness(FitSettings(), compact=0.01).chosen(10.0, GYROID)
    >>> settings.control_points, tolerance
    (5, 0.001)
    """

    fit: FitSettings
    tolerance: float | None = None
    compact: float | None = None

    def require(self, cell_size: float) -> None:
        """Refuse what is no deviation, or is said twice.

        Raises
        ------
        ParameterError
        """
        if self.tolerance is not None:
            valid_tolerance(self.tolerance)
        if self.compact is None:
            return
        accepted = f"a length in mm, a finite number above 0 and below the cell size, {cell_size:g}"
        if not 0 < finite_number("compact", self.compact, accepted) < cell_size:
            raise ParameterError("compact", self.compact, accepted)
        if self.tolerance is not None or self.fit != FitSettings():
            accepted = "none beside a tolerance, control points or a fit: it chooses the control points itself"
            raise ParameterError("compact", self.compact, accepted)

    def chosen(self, cell_size: float, family: Family | None) -> tuple[FitSettings, float]:
        """The fit to begin with, and the deviation in cell sizes to which a graded wall is brought from there.

        Parameters
        ----------
        cell_size : float
            In mm.
        family : Family, optional
            Of a uniform wall, whose fit is settled here; none of a graded one.

        Raises
        ------
        ParameterError
            If the deviation is out of reach.
        """
        if self.compact is None:
            settled = self.tolerance is None or family is None
            fit = self.fit if settled else fit_within(self.fit, self.tolerance, family)  # type: ignore[arg-type]
            return fit, self.tolerance or USUAL_TOLERANCE
        least, part = FitSettings(_FEWEST_COMPACT), self.compact / cell_size
        if family is None:
            return least, part
        try:
            return fewest_within(least, part, family), part
        except ParameterError as refused:
            accepted = f"a larger one: it is {part:.2g} of the cell size, which has to be {refused.accepted}"
            raise ParameterError("compact", self.compact, accepted) from None


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
        Largest deviation of a graded wall, in cell sizes.
    timed : callable
        A context for each stage, by its name.
    allow : callable, optional
        Called with each number of control points before it is tried: may refuse it.

    Returns
    -------
    Wall
    Refit
        What the fit is worth; None where it is uniform.

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError
    """
    if grading.uniform:
        with timed("fit"):
            patch = fit_patch(settings, grading.surface.family)
        with timed("wall"):
            return build_wall(complex, patch, grading.cell_size, float(grading.thickness)), None  # type: ignore[arg-type]
    with timed("soundness"):
        require_simple(complex, grading)
    with timed("deviation"):
        wanted = likely_control_points(complex, grading, settings.control_points, tolerance)
    n = 0
    while n != wanted:
        n = wanted
        allow(n)
        with timed("fit"):
            wall = smoothed(graded_wall(complex, grading, n))
        with timed("deviation"):
            refit = measured(wall.nets, complex, grading)
        wanted = refit.control_points_for(tolerance, grading.cell_size)
    with timed("soundness"):
        require_simple_fit(wall, grading)
    return wall, refit


Floats = NDArray[np.float64]

# Peak memory a cell of control nets and of all that is sampled to fit and check them, rounded up.
_BYTES_PER_CELL = 500_000
# Of whole cells that are all alike: they have their nets in common, only the complex grows; writing STL included.
_BYTES_PER_ALIKE_CELL = 40_000
HOME: Point = (0.0, 0.0, 0.0)
_SHIFTS = float(np.abs(PERTURBATIONS).max())


@dataclass(frozen=True, slots=True)
class LatticeSpec:
    """Description of a lattice to be built.

    Attributes
    ----------
    cells : tuple of int
    grading : Grading
    settings : FitSettings
    tolerance : float
        Largest deviation of a graded wall, in cell sizes; one that does not is fitted as the settings say.
    trimmed : bool
        Whether it is cut to the block of cells.
    keep_islands : bool
        Whether pieces that the cut leaves unconnected are kept however small.
    origin, rotation : tuple of float
        Where the finished wall is placed, as of :func:`~gyroid_cad.wall.covering.frame_of`.
    """

    cells: tuple[int, int, int]
    grading: Grading
    settings: FitSettings
    tolerance: float
    trimmed: bool = False
    keep_islands: bool = False
    origin: Point = HOME
    rotation: Point = HOME

    @property
    def frame(self) -> Frame:
        """Frame that the finished wall is placed by."""
        return frame_of(self.origin, self.rotation)

    def block_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box round the block of cells, in mm."""
        corners = np.array(list(np.ndindex(2, 2, 2))) * self.cells * self.grading.cell_size
        placed = self.frame.placed(corners)
        return placed.min(axis=0), placed.max(axis=0)

    def at_home(self) -> LatticeSpec:
        """Return the same lattice where it is fitted: unplaced, in the coordinates of its fields and maps."""
        return replace(self, origin=HOME, rotation=HOME)


@dataclass(frozen=True, slots=True, eq=False)
class FittedWall:
    """The wall of a lattice, fitted, found sound, and placed.

    Attributes
    ----------
    spec : LatticeSpec
    complex : CellComplex
    wall : Wall
        Where the spec places it. The exact surface and its fields know nothing of that: see :meth:`at_home`.
    refit : Refit, optional
        What the fit is worth, of a graded wall.
    seconds : dict
        By stage.
    """

    spec: LatticeSpec
    complex: CellComplex
    wall: Wall
    refit: Refit | None
    seconds: dict[str, float]

    @property
    def min_thickness(self) -> float:
        """The thinnest wall, in mm."""
        return float(self.spec.grading.thickness) if self.refit is None else self.refit.min_thickness  # type: ignore[arg-type]

    @property
    def max_thickness(self) -> float:
        """The thickest wall, in mm."""
        return float(self.spec.grading.thickness) if self.refit is None else self.refit.max_thickness  # type: ignore[arg-type]

    @property
    def samples_per_patch(self) -> dict[str, int]:
        """At how many places of every patch a graded wall was checked, by what for."""
        if self.refit is None:
            return {}
        return {"deviation": self.refit.samples**2, "fold": FOLD_SAMPLES**2, "clearance": CLEARANCE_SAMPLES**2}

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box round the wall, or round the block it is to be cut to, in mm."""
        return self.spec.block_box() if self.spec.trimmed else self.wall.bounding_box()

    def at_home(self) -> FittedWall:
        """Return the wall before it was placed, to be compared with the exact surface, its fields and maps."""
        return fitted_wall(self.spec.at_home())


def fit_spec(spec: LatticeSpec, progress: Progress | None = None) -> FittedWall:
    """Fit the wall of a lattice, in its own coordinates, and check that it can exist.

    Parameters
    ----------
    spec : LatticeSpec
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, saying how much it would take.
    SelfIntersectionError
        If a graded wall cannot exist somewhere.
    FitError
        If the fit's edges do not meet those of its neighbours.
    """
    alike = spec.grading.uniform and not spec.trimmed
    require_memory(
        spec.cells,
        _BYTES_PER_ALIKE_CELL if alike else _BYTES_PER_CELL,
        10 if alike else spec.settings.control_points,
        kernel=False,
    )
    seconds: dict[str, float] = {}
    with timed(seconds, "complex", progress):
        complex = _complex(spec)
    wall, refit = fit_wall(
        complex,
        spec.grading,
        spec.settings,
        spec.tolerance,
        lambda stage: timed(seconds, stage, progress),
        lambda control_points: require_memory(spec.cells, _BYTES_PER_CELL, control_points, kernel=False),
    )
    return FittedWall(spec, complex, wall, refit, seconds)


_fitted: Cache[LatticeSpec, FittedWall] = Cache()


def fitted_wall(spec: LatticeSpec, progress: Progress | None = None) -> FittedWall:
    """Fit and check the wall of a lattice, as :func:`fit_spec` does, and place it; the last few fits are cached."""
    # What becomes of pieces is for the solid to know, and where the wall stands for nobody: the fit is the same.
    home = replace(spec.at_home(), keep_islands=False)
    fitted = _fitted.get(home, lambda: fit_spec(home, progress))
    wall = fitted.wall
    if (spec.origin, spec.rotation) != (HOME, HOME):
        wall = wall.moved(spec.frame.rotation, spec.frame.origin)
    return replace(fitted, spec=spec, wall=wall)


def _complex(spec: LatticeSpec) -> CellComplex:
    grading = spec.grading
    if not spec.trimmed:
        return build_complex(spec.cells, grading.surface.cell, grading.closed)
    low, high = np.zeros(3), np.array(spec.cells) * grading.cell_size
    reach = wall_extremes(low, high, AT_HOME, grading)[1] / 2 + _SHIFTS * grading.cell_size
    return covering_complex(low, high, AT_HOME, grading.cell_size, reach, grading.surface)

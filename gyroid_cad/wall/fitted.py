"""From the description of a lattice to its wall, stage by stage, timed: all that comes before a solid or a mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.cache import Remembered
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.covering import AT_HOME, PHASES, covering_complex, wall_extremes
from gyroid_cad.wall.graded_fit import fit_wall
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall
from gyroid_cad.wall.refit import Refit
from gyroid_cad.wall.self_intersection import CLEARANCE_SAMPLES, FOLD_SAMPLES

__all__ = ["LaidWall", "Recipe", "laid_wall", "lay_wall"]

Floats = NDArray[np.float64]

# Peak memory a cell of control nets and of all that is sampled to fit and check them, rounded up.
_BYTES_PER_CELL = 500_000
# Of whole cells that are all alike: they have their nets in common, only the complex grows; writing STL included.
_BYTES_PER_ALIKE_CELL = 40_000
_SHIFTS = float(np.abs(PHASES).max())


@dataclass(frozen=True, slots=True)
class Recipe:
    """What to build.

    Attributes
    ----------
    cells : tuple of int
    grading : Grading
    settings : FitSettings
    tolerance : float
        Largest deviation of a wall that varies, in cell sizes; one that does not is fitted as the settings say.
    boxed : bool
        Whether it is cut to the block of cells.
    """

    cells: tuple[int, int, int]
    grading: Grading
    settings: FitSettings
    tolerance: float
    boxed: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class LaidWall:
    """The wall of a lattice, fitted and found sound.

    Attributes
    ----------
    recipe : Recipe
    complex : CellComplex
    wall : Wall
    refit : Refit, optional
        What the fit is worth, of a wall that varies.
    seconds : dict
        By stage.
    """

    recipe: Recipe
    complex: CellComplex
    wall: Wall
    refit: Refit | None
    seconds: dict[str, float]

    @property
    def thinnest(self) -> float:
        """The thinnest wall, in mm."""
        return float(self.recipe.grading.thickness) if self.refit is None else self.refit.thinnest  # type: ignore[arg-type]

    @property
    def thickest(self) -> float:
        """The thickest wall, in mm."""
        return float(self.recipe.grading.thickness) if self.refit is None else self.refit.thickest  # type: ignore[arg-type]

    @property
    def samples_per_patch(self) -> dict[str, int]:
        """At how many places of every patch a wall that varies was checked, by what for."""
        if self.refit is None:
            return {}
        return {"deviation": self.refit.samples**2, "fold": FOLD_SAMPLES**2, "clearance": CLEARANCE_SAMPLES**2}

    def bounding_box(self) -> tuple[Floats, Floats]:
        """Lowest and highest corner of the box round the wall, or of the block it is to be cut to, in mm."""
        if self.recipe.boxed:
            return np.zeros(3), np.array(self.recipe.cells) * self.recipe.grading.cell_size
        return self.wall.bounding_box()


def lay_wall(recipe: Recipe, progress: Progress | None = None) -> LaidWall:
    """Fit the wall of a lattice and check that it can exist.

    Parameters
    ----------
    recipe : Recipe
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, saying how much it would take.
    SoundnessError
        If a wall that varies cannot exist somewhere.
    FitError
        If the fit's edges do not meet those of its neighbours.
    """
    alike = recipe.grading.uniform and not recipe.boxed
    require_memory(
        recipe.cells,
        _BYTES_PER_ALIKE_CELL if alike else _BYTES_PER_CELL,
        10 if alike else recipe.settings.control_points,
        kernel=False,
    )
    seconds: dict[str, float] = {}
    with timed(seconds, "complex", progress):
        complex = _complex(recipe)
    wall, refit = fit_wall(
        complex,
        recipe.grading,
        recipe.settings,
        recipe.tolerance,
        lambda stage: timed(seconds, stage, progress),
        lambda control_points: require_memory(recipe.cells, _BYTES_PER_CELL, control_points, kernel=False),
    )
    return LaidWall(recipe, complex, wall, refit, seconds)


_laid: Remembered[Recipe, LaidWall] = Remembered()


def laid_wall(recipe: Recipe, progress: Progress | None = None) -> LaidWall:
    """The same; the last few are remembered."""
    return _laid.get(recipe, lambda: lay_wall(recipe, progress))


def _complex(recipe: Recipe) -> CellComplex:
    grading = recipe.grading
    if not recipe.boxed:
        return build_complex(recipe.cells, grading.surface.cell, grading.closed)
    low, high = np.zeros(3), np.array(recipe.cells) * grading.cell_size
    reach = wall_extremes(low, high, AT_HOME, grading)[1] / 2 + _SHIFTS * grading.cell_size
    return covering_complex(low, high, AT_HOME, grading.cell_size, reach, grading.surface)

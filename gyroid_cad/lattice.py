"""The lattice: a frozen description in millimetres, and what can be made of it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from math import inf, isfinite, nan, prod
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

from gyroid_cad.build import Build, Progress, build, require_formats, require_settings
from gyroid_cad.errors import ParameterError
from gyroid_cad.fit import FitSettings, fit_patch, fit_report
from gyroid_cad.tube import LARGEST_DENSITY, LARGEST_THICKNESS, density_of_thickness, thickness_of_density
from gyroid_cad.wall import Wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["Lattice", "LatticeReport"]

Corner = tuple[float, float, float]

# The kernel takes lengths under 1e-7 mm for nothing; these keep every edge and wall well above.
SMALLEST_CELL, LARGEST_CELL = 1e-2, 1e5
THINNEST_WALL = 1e-4
MOST_CELLS_ALONG = 1_000_000


@dataclass(frozen=True, slots=True)
class LatticeReport:
    """What was built, and how exactly.

    Attributes
    ----------
    cells : tuple of int
    cell_size, thickness : float
        In mm.
    density : float
        Volume fraction of a cell.
    patches, faces, solids : int
    valid, closed : bool
        By the kernel's own check; every edge bounds exactly two faces.
    free_edges : int
        Mid-surface edges that bound one patch only: each carries a ruled side wall.
    pinch_lines : int
        Lines through the wall in which patches touch without joining.
    volume, volume_exact : float
        In mm3: enclosed by the kernel's faces, and by the tube formula.
    max_deviation : float
        In mm, of the fitted mid-surface along the exact normal.
    max_normal_angle : float
        In degrees, between fitted and exact normal.
    seconds : dict
        By stage.
    """

    cells: tuple[int, int, int]
    cell_size: float
    thickness: float
    density: float
    patches: int
    faces: int
    solids: int
    valid: bool
    closed: bool
    free_edges: int
    pinch_lines: int
    volume: float
    volume_exact: float
    max_deviation: float
    max_normal_angle: float
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Lattice:
    """A block of gyroid cells with a wall of constant thickness.

    The block of cells stands on the origin, [0, nx L] x [0, ny L] x [0, nz L]; as in the paper, patches
    are whole: the mid-surface reaches a quarter of a cell beyond the block, the wall about half its thickness more.

    Parameters
    ----------
    cells : tuple of int
        Number of cubic cells along x, y, z.
    cell_size : float
        Period L of the cubic cell, in mm.
    thickness : float, optional
        Whole wall, in mm, less than 0.37647 L.
    density : float, optional
        Volume fraction instead of thickness, less than 0.94033.
    fit : FitSettings
        How the patch is fitted.

    Raises
    ------
    ParameterError
        Naming the parameter, its value and what is accepted.
    """

    cells: tuple[int, int, int]
    cell_size: float
    thickness: float | None = None
    density: float | None = None
    fit: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", _validated_cells(self.cells))
        object.__setattr__(self, "cell_size", _number("cell_size", self.cell_size, "a length in mm"))
        if not SMALLEST_CELL <= self.cell_size <= LARGEST_CELL:
            raise ParameterError("cell_size", self.cell_size, f"{SMALLEST_CELL:g} to {LARGEST_CELL:g} mm")
        if (self.thickness is None) == (self.density is None):
            given = {"thickness": self.thickness, "density": self.density}
            raise ParameterError("thickness, density", given, "exactly one of the two")
        if not isinstance(self.fit, FitSettings):
            raise ParameterError("fit", self.fit, "a FitSettings")
        if self.thickness is not None:
            object.__setattr__(self, "thickness", _number("thickness", self.thickness, "a length in mm"))
        else:
            object.__setattr__(self, "density", _number("density", self.density, "a volume fraction"))
        self._require_sound_wall()

    @property
    def wall_thickness(self) -> float:
        """The whole wall in mm, whichever of thickness and density was given."""
        if self.thickness is not None:
            return self.thickness
        assert self.density is not None
        return thickness_of_density(self.density) * self.cell_size

    @property
    def volume_fraction(self) -> float:
        """The density, whichever of thickness and density was given: exact, by the tube formula."""
        if self.density is not None:
            return self.density
        return density_of_thickness(self.wall_thickness / self.cell_size)

    @property
    def exact_volume(self) -> float:
        """Volume in mm3 of the exact lattice, by the tube formula."""
        return prod(self.cells) * self.volume_fraction * self.cell_size**3

    def wall(self) -> Wall:
        """Control nets of the wall's faces, in mm, and the cell complex they belong to.

        Raises
        ------
        FitError
            If the fit's edges do not meet those of its neighbours.
        """
        return self._build().wall

    def bounding_box(self) -> tuple[Corner, Corner]:
        """Lowest and highest corner of the box round the wall, in mm."""
        low, high = self._build().bounding_box
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])

    def solid(self, progress: Progress | None = None) -> KernelShape:
        """The lattice as a closed solid, checked.

        Built once and remembered; each call hands out a shape of its own that shares the geometry, so that
        moving one does not move another.

        Parameters
        ----------
        progress : callable, optional
            Called with (stage, done, total).

        Returns
        -------
        TopoDS_Solid
            A TopoDS_Compound of solids if the lattice falls into several.

        Raises
        ------
        KernelError
            If the kernel's shape is not closed or does not enclose the right volume.
        FitError
            If the fit's edges do not meet those of its neighbours.
        ParameterError
            If memory would not do, or the wall is so thick that the fit folds over.
        """
        return self._build(progress).solid()

    def report(self, progress: Progress | None = None) -> LatticeReport:
        """Build the solid if it isn't yet, have the kernel check it too, and say what it is."""
        built = self._build(progress)
        valid = built.valid(progress)
        with built.timed("fit report"):
            fit = fit_report(fit_patch(self.fit))
        return LatticeReport(
            cells=self.cells,
            cell_size=self.cell_size,
            thickness=self.wall_thickness,
            density=self.volume_fraction,
            patches=built.wall.complex.patch_count,
            faces=built.topology.faces,
            solids=built.topology.solids,
            valid=valid,
            closed=built.topology.closed,
            free_edges=int(built.wall.complex.free.sum()),
            pinch_lines=built.wall.complex.pinch_lines,
            volume=built.volume,
            volume_exact=self.exact_volume,
            max_deviation=fit.max_distance * self.cell_size,
            max_normal_angle=fit.max_normal_angle,
            seconds=dict(built.seconds),
        )

    def write(
        self,
        *paths: str | os.PathLike[str],
        schema: str = "ap214",
        deviation: float | None = None,
        angle: float = 15.0,
        progress: Progress | None = None,
    ) -> None:
        """Write the solid; each path's ending chooses STEP (.step, .stp), BREP (.brep) or STL (.stl).

        Every path and setting is checked before anything is built. A file appears whole or not at all.

        Parameters
        ----------
        *paths : path-like
        schema : {"ap214", "ap242"}
            Of STEP files.
        deviation : float, optional
            Of STL facets from the surface, in mm; if left out, a thousandth of the cell size, or a tenth of the
            wall if that is less.
        angle : float
            Between neighbouring STL facets, in degrees.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError, FitError, KernelError, ExportError
        """
        targets = require_formats(paths)
        usual = min(self.cell_size / 1000, self.wall_thickness / 10)
        limit = usual if deviation is None else _number("deviation", deviation, "a length in mm")
        require_settings(self.cells, schema, limit, angle)
        built = self._build(progress)
        built.write(targets, schema, limit, angle, progress)

    def _build(self, progress: Progress | None = None) -> Build:
        return build(self.cells, self.cell_size, self.wall_thickness, self.fit, progress)

    def _require_sound_wall(self) -> None:
        if self.density is not None:
            if not 0 < self.density < LARGEST_DENSITY:
                raise ParameterError(
                    "density", self.density, f"above 0 and below {LARGEST_DENSITY:.5f}, where the wall meets itself"
                )
            if self.wall_thickness < THINNEST_WALL:
                thinnest = density_of_thickness(THINNEST_WALL / self.cell_size)
                raise ParameterError("density", self.density, f"at least {thinnest:.3g} (a wall of {THINNEST_WALL} mm)")
            return
        assert self.thickness is not None
        limit = LARGEST_THICKNESS * self.cell_size
        if not THINNEST_WALL <= self.thickness < limit:
            raise ParameterError(
                "thickness",
                self.thickness,
                f"{THINNEST_WALL:g} mm or more and below {limit:.5g} mm, "
                f"the curvature limit {LARGEST_THICKNESS:.5f} x cell_size",
            )


def _number(parameter: str, value: object, meaning: str) -> float:
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else nan
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise ParameterError(parameter, value, f"{meaning}, a finite number")
    return number


def _validated_cells(cells: Sequence[int]) -> tuple[int, int, int]:
    accepted = f"three whole numbers, each from 1 to {MOST_CELLS_ALONG}"
    try:
        counts = tuple(cells)
    except TypeError:
        raise ParameterError("cells", cells, accepted) from None
    whole = all(isinstance(n, Integral) and not isinstance(n, bool) and 1 <= n <= MOST_CELLS_ALONG for n in counts)
    if len(counts) != 3 or not whole:
        raise ParameterError("cells", cells, accepted)
    return int(counts[0]), int(counts[1]), int(counts[2])

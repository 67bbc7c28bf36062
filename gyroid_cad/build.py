"""From numbers to a checked solid and its files, stage by stage, timed."""

from __future__ import annotations

import os
from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from math import prod
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyroid_cad.box_cut import Box, cut_to_box
from gyroid_cad.complex import CellComplex, build_complex
from gyroid_cad.covering import AT_HOME, PHASES, covering_complex, wall_extremes
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.files import require_writable
from gyroid_cad.fit import FitSettings
from gyroid_cad.grading import Grading
from gyroid_cad.soundness import CLEARANCE_SAMPLES, FOLD_SAMPLES
from gyroid_cad.stages import Progress, tell, timed
from gyroid_cad.wall_fit import fit_wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.solid import KernelShape

__all__ = [
    "FORMATS",
    "Build",
    "Progress",
    "Recipe",
    "build",
    "require_formats",
    "require_settings",
    "write_shape",
]

FORMATS = {".step": "step", ".stp": "step", ".brep": "brep", ".stl": "stl"}

# Peak memory a cell, as benchmarks/memory.py measures it, rounded up; and what imports and one cell take.
_SOLID_BYTES_PER_CELL = 1_500_000
_FILE_BYTES_PER_CELL = 6_000_000
_BASE_BYTES = 400_000_000
# Volume in the kernel against that of the nets it was given: rounding only.
_VOLUME_AGREEMENT = 1e-9
# Of cut cells against whole ones: how closely the section curves are fitted.
_BOXED_VOLUME_AGREEMENT = 1e-5
_SHIFTS = float(np.abs(PHASES).max())
_REMEMBERED_BUILDS = 2


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


class Build:
    """A lattice's wall and its solid, checked closed and full, with the seconds each stage took.

    Attributes
    ----------
    recipe : Recipe
    complex : CellComplex
    wall : Wall
    refit : Refit, optional
        What the fit is worth, of a wall that varies.
    topology : Topology
    volume : float
        In mm3, from the control points the kernel holds.
    patches : int
    shift : tuple of float
        Of the lattice in its box, in mm, where it could not be cut without.
    seconds : dict
        By stage.
    """

    def __init__(self, recipe: Recipe, progress: Progress | None) -> None:
        self.recipe = recipe
        self.cells = recipe.cells
        _require_memory(self.cells, _SOLID_BYTES_PER_CELL, recipe.settings.control_points)
        self.seconds: dict[str, float] = {}
        self._valid: bool | None = None
        self.shift = (0.0, 0.0, 0.0)
        with self.timed("complex", progress):
            self.complex = self._complex()
        self.wall, self.refit = fit_wall(
            self.complex,
            recipe.grading,
            recipe.settings,
            recipe.tolerance,
            lambda stage: self.timed(stage, progress),
            lambda control_points: _require_memory(self.cells, _SOLID_BYTES_PER_CELL, control_points),
        )
        with self.timed("kernel", progress):
            from gyroid_cad.kernel.check import enclosed_volume, topology
            from gyroid_cad.kernel.solid import realise
        if recipe.boxed:
            self._shape, self.volume, self.patches = self._boxed(progress)
            expected, agreement = self._volume_in_box(), _BOXED_VOLUME_AGREEMENT
        else:
            with self.timed("solid", progress):
                self._shape = realise(self.wall, lambda done, total: tell(progress, "solid", done, total))
            self.volume, self.patches = enclosed_volume(self._shape), self.complex.patch_count
            expected, agreement = self.wall.volume(), _VOLUME_AGREEMENT
        with self.timed("check", progress):
            self.topology = topology(self._shape)
            self._require_closed_and_full(expected, agreement)

    def _complex(self) -> CellComplex:
        grading = self.recipe.grading
        if not self.recipe.boxed:
            return build_complex(self.cells, closed=grading.closed)
        low, high = np.zeros(3), np.array(self.cells) * grading.cell_size
        reach = wall_extremes(low, high, AT_HOME, grading)[1] / 2 + _SHIFTS * grading.cell_size
        return covering_complex(low, high, AT_HOME, grading.cell_size, reach)

    def _boxed(self, progress: Progress | None) -> tuple[KernelShape, float, int]:
        """The shape cut to the block of cells, its volume, and how many patches are in it."""
        from gyroid_cad.kernel.boxed import realise_boxed
        from gyroid_cad.kernel.split import compound_of

        size = self.recipe.grading.cell_size
        box = Box(np.eye(3), np.zeros(3), np.array(self.cells) * size)
        problem: KernelError | None = None
        for phase in PHASES:
            shift = np.array(phase) * size
            try:
                with self.timed("cut", progress):
                    # Some curve always ends on an edge of whole cells: nobody asks whether their corners are filled.
                    left = cut_to_box(self.wall.moved(np.eye(3), shift), box, [(0, True), (1, False)], size, True)
                with self.timed("solid", progress):
                    solids = realise_boxed(left)
            except KernelError as failed:
                problem = problem or failed
                continue
            self.shift = (float(shift[0]), float(shift[1]), float(shift[2]))
            shape = solids[0] if len(solids) == 1 else compound_of(solids)
            return shape, float(left.volumes.sum()), len({face.patch for face in left.faces})
        raise KernelError(f"{problem}; nor with the lattice shifted a little, twice")

    def _volume_in_box(self) -> float | None:
        """Of whole cells, all alike; none where they vary."""
        if not self.recipe.grading.uniform:
            return None
        cell = np.unique(self.wall.patch_net, return_index=True)[1]
        return prod(self.cells) * self.wall.volume(cell)

    @contextmanager
    def timed(self, stage: str, progress: Progress | None = None) -> Iterator[None]:
        """Tell that a stage begins and ends, and add the seconds between."""
        with timed(self.seconds, stage, progress):
            yield

    @cached_property
    def bounding_box(self) -> tuple[list[float], list[float]]:
        """Lowest and highest corner of the box round the wall, in mm."""
        if self.recipe.boxed:
            return [0.0, 0.0, 0.0], [count * self.recipe.grading.cell_size for count in self.cells]
        low, high = self.wall.bounding_box()
        return low.tolist(), high.tolist()

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

    def solid(self) -> KernelShape:
        """A shape of the caller's own, to move as they like, that shares the geometry."""
        from gyroid_cad.kernel.solid import another_handle

        return another_handle(self._shape)

    def valid(self, progress: Progress | None = None) -> bool:
        """Whether the kernel's own check, asked once, finds the solid valid."""
        if self._valid is None:
            from gyroid_cad.kernel.check import is_valid

            with self.timed("check", progress):
                self._valid = is_valid(self._shape)
        return self._valid

    def write(
        self, targets: Sequence[Path], schema: str, deviation: float, angle: float, progress: Progress | None = None
    ) -> None:
        """Write the solid to each target in the format of its ending.

        Raises
        ------
        KernelError
            If the kernel finds the solid invalid: then nothing is written.
        ExportError
        """
        _require_memory(self.cells, _FILE_BYTES_PER_CELL, len(self.wall.weights))
        if not self.valid(progress):
            raise KernelError(f"the kernel finds its solid of {self.cells} cells invalid; nothing was written")
        for path in targets:
            with self.timed(f"write {path.name}", progress):
                write_shape(self._shape, path, schema, deviation, angle, cut=self.recipe.boxed)

    def _require_closed_and_full(self, expected: float | None, agreement: float) -> None:
        if not self.topology.closed:
            raise KernelError(
                f"the kernel's shape of {self.cells} cells is not closed: "
                f"{self.topology.open_edges} edges do not bound exactly two faces"
            )
        if expected is not None and not abs(self.volume - expected) <= agreement * expected:
            raise KernelError(
                f"the kernel's shape of {self.cells} cells encloses {self.volume:.9g} mm3, "
                f"its control nets {expected:.9g} mm3"
            )


def write_shape(shape: KernelShape, path: Path, schema: str, deviation: float, angle: float, cut: bool = False) -> None:
    """Write a shape, whose faces may have been cut, in the format of the path's ending.

    Raises
    ------
    ExportError
    """
    from gyroid_cad.kernel.brep import write_brep
    from gyroid_cad.kernel.step import write_step
    from gyroid_cad.kernel.stl import write_stl

    match FORMATS[path.suffix.lower()]:
        case "step":
            write_step(shape, path, schema, parameter_curves=cut)
        case "brep":
            write_brep(shape, path)
        case _:
            write_stl(shape, path, deviation, angle)


_builds: OrderedDict[Recipe, Build] = OrderedDict()


def build(recipe: Recipe, progress: Progress | None = None) -> Build:
    """The build of a lattice; the last few are remembered.

    Parameters
    ----------
    recipe : Recipe
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, saying how much it would take.
    FitError
        If the fit's edges do not meet those of its neighbours.
    KernelError
        If the kernel's shape is not closed or does not enclose the right volume.
    """
    if recipe not in _builds:
        made = Build(recipe, progress)
        while len(_builds) >= _REMEMBERED_BUILDS:
            _builds.popitem(last=False)
        _builds[recipe] = made
    _builds.move_to_end(recipe)
    return _builds[recipe]


def require_formats(paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Check the endings and folders of files to be written, before anything is built.

    Raises
    ------
    ParameterError
    """
    if not paths:
        raise ParameterError("output", [], "at least one file name")
    targets = []
    for path in paths:
        if Path(path).suffix.lower() not in FORMATS:
            raise ParameterError("output", str(path), f"a file name ending in {', '.join(FORMATS)}")
        targets.append(require_writable(path))
    if len({target.resolve() for target in targets}) < len(targets):
        raise ParameterError("output", [str(path) for path in paths], "each file once")
    return targets


def require_settings(cells: tuple[int, int, int], schema: str, deviation: float | None, angle: float) -> None:
    """Check the settings of files to be written, and that memory will do, before anything is built.

    Raises
    ------
    ParameterError
    """
    from gyroid_cad.kernel.step import require_schema
    from gyroid_cad.kernel.stl import require_meshing

    require_schema(schema)
    require_meshing(1.0 if deviation is None else deviation, angle)
    _require_memory(cells, _FILE_BYTES_PER_CELL)


def _require_memory(cells: tuple[int, int, int], bytes_per_cell: int, control_points: int = 10) -> None:
    import psutil

    bytes_per_cell = int(bytes_per_cell * max(1.0, (control_points / 10) ** 2))

    needed = _BASE_BYTES + prod(cells) * bytes_per_cell
    available = psutil.virtual_memory().available
    if needed > available:
        most = max(0, (available - _BASE_BYTES) // bytes_per_cell)
        raise ParameterError(
            "cells",
            cells,
            f"at most about {most} cells in all: these take about {needed / 1e9:.3g} GB of memory "
            f"and {available / 1e9:.3g} GB are free",
        )

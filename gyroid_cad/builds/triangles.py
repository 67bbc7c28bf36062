"""From the wall of a lattice to files of triangles, stage by stage, timed: no kernel, no solid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import ceil, prod
from pathlib import Path
from typing import Any

from gyroid_cad.common.cache import Remembered
from gyroid_cad.common.formats import FORMATS
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.stl import write_stl
from gyroid_cad.mesh.triangles.three_mf import write_3mf
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.wall.fitted import LaidWall, Recipe, laid_wall

__all__ = ["TriangleReport", "Triangles", "triangle_report", "triangles"]

# Peak memory of writing 3MF, as measured, rounded up.
_3MF_BYTES_PER_TRIANGLE = 400


class Triangles:
    """The triangles of a lattice of whole patches, with the seconds each stage took.

    Attributes
    ----------
    laid : LaidWall
        The wall they are made of.
    triangulation : Triangulation
    seconds : dict
        By stage.
    """

    def __init__(self, laid: LaidWall, deviation: float, progress: Progress | None) -> None:
        self.laid = laid
        self.seconds = dict(laid.seconds)
        with timed(self.seconds, "triangles", progress):
            self.triangulation = triangulated(laid.wall, deviation)

    def write(self, targets: Sequence[Path], progress: Progress | None = None) -> None:
        """Write the triangles to each target in the format of its ending.

        Raises
        ------
        ParameterError
            If a file cannot count so many triangles, or memory would not do for 3MF.
        ExportError
        """
        if any(FORMATS[path.suffix.lower()] == "3mf" for path in targets):
            cells = self.laid.recipe.cells
            count = self.triangulation.triangle_count
            require_memory(cells, ceil(_3MF_BYTES_PER_TRIANGLE * count / prod(cells)), kernel=False)
        for path in targets:
            stage = f"write {path.name}"
            if FORMATS[path.suffix.lower()] == "3mf":
                with timed(self.seconds, stage, progress):
                    write_3mf(*indexed_triangles(self.triangulation), path)
            else:
                with timed(self.seconds, stage, None):
                    write_stl(self.triangulation, path, progress, stage)


@dataclass(frozen=True, slots=True)
class TriangleReport:
    """What the triangles of a lattice are worth.

    Attributes
    ----------
    cells : tuple of int
    cell_size : float
        In mm, before any map.
    thickness, thinnest, thickest : float
        Whole wall in mm: its mean over the mid-surface and its extremes.
    density : float
        Volume fraction: of a cell, or of the mapped block where the lattice varies.
    patches, triangles : int
    fewest_steps, most_steps : int
        Squares along a side of a patch, each two triangles.
    steps_through : int
        Of the free side walls, from face to face.
    free_edges : int
        Mid-surface edges that bound one patch only: each carries a ruled side wall.
    pinch_lines : int
        Lines through the wall in which patches touch without joining; there triangles are parted by a hair.
    volume, volume_wall, volume_exact : float
        In mm3: enclosed by the triangles, by the NURBS faces, and of the exact wall: by the tube formula, or by
        quadrature where the lattice varies.
    deviation : float
        Largest distance between triangles and NURBS faces, in mm, as measured.
    laid_off : float
        In mm, how far from the faces the corners of triangles lie at most, for the sake of the volume.
    seconds : dict
        By stage.
    """

    cells: tuple[int, int, int]
    cell_size: float
    thickness: float
    thinnest: float
    thickest: float
    density: float
    patches: int
    triangles: int
    fewest_steps: int
    most_steps: int
    steps_through: int
    free_edges: int
    pinch_lines: int
    volume: float
    volume_wall: float
    volume_exact: float
    deviation: float
    laid_off: float
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)


def triangle_report(made: Triangles, thickness: float, density: float, volume_exact: float) -> TriangleReport:
    """The report on triangles.

    Parameters
    ----------
    made : Triangles
    thickness, density, volume_exact : float
        Of the exact lattice.
    """
    laid, triangulation = made.laid, made.triangulation
    complex, varies = laid.complex, laid.refit is not None
    return TriangleReport(
        cells=laid.recipe.cells,
        cell_size=laid.recipe.grading.cell_size,
        thickness=thickness,
        thinnest=laid.thinnest if varies else thickness,
        thickest=laid.thickest if varies else thickness,
        density=density,
        patches=complex.patch_count,
        triangles=triangulation.triangle_count,
        fewest_steps=int(triangulation.patch_steps.min()),
        most_steps=int(triangulation.patch_steps.max()),
        steps_through=triangulation.across,
        free_edges=int(complex.free.sum()),
        pinch_lines=complex.pinch_lines,
        volume=triangulation.volume,
        volume_wall=laid.wall.volume(),
        volume_exact=volume_exact,
        deviation=triangulation.deviation,
        laid_off=triangulation.laid_off,
        seconds=dict(made.seconds),
    )


_made: Remembered[tuple[Recipe, float], Triangles] = Remembered()


def triangles(recipe: Recipe, deviation: float, progress: Progress | None = None) -> Triangles:
    """The triangles of a lattice; the last few are remembered.

    Parameters
    ----------
    recipe : Recipe
        Of whole patches.
    deviation : float
        Largest distance of a triangle from the wall's faces and side walls, in mm.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, or a patch would take too many steps.
    FitError
        If the fit's edges do not meet those of its neighbours.
    """
    return _made.get((recipe, deviation), lambda: Triangles(laid_wall(recipe, progress), deviation, progress))

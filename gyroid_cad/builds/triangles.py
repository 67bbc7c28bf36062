"""Triangles of a lattice's wall and their files, made stage by stage, timed: no kernel, no solid."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from math import ceil, prod
from typing import Any

from gyroid_cad.common.cache import Cache
from gyroid_cad.common.formats import STL, TRIANGLE_FORMATS, format_of, require_formats
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.common.tables import Rows, cells_shown, text_table, volume_shown, wall_shown
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.stl import require_near_origin, write_stl
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.mesh.triangles.writing import write_triangles
from gyroid_cad.wall.areas import fitted_areas
from gyroid_cad.wall.fitted import FittedWall, LatticeSpec, fitted_wall

__all__ = ["TriangleReport", "Triangles", "triangle_report", "triangles"]

# Peak memory of writing 3MF, which takes the most, as measured, rounded up.
_BYTES_PER_TRIANGLE = 400


class Triangles:
    """The triangles of a lattice of whole patches, with the seconds each stage took.

    Attributes
    ----------
    fitted : FittedWall
        The wall they are made of.
    triangulation : Triangulation
    seconds : dict
        By stage.
    """

    def __init__(self, fitted: FittedWall, deviation: float, progress: Progress | None) -> None:
        self.fitted = fitted
        self.seconds = dict(fitted.seconds)
        with timed(self.seconds, "triangles", progress):
            self.triangulation = triangulated(fitted.wall, deviation)

    def write(self, *paths: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write files; each path's ending chooses STL, 3MF, OBJ or PLY. A file appears whole or not at all.

        Parameters
        ----------
        *paths : path-like
            All are checked before any is written.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError
            If a file cannot count so many triangles, memory would not do for other formats than STL, or the lattice is
            too far off for single precision.
        ExportError
        """
        targets = require_formats(paths, TRIANGLE_FORMATS)
        for path in targets:
            require_near_origin(path, self.fitted.bounding_box(), self.triangulation.deviation)
        if any(format_of(path) is not STL for path in targets):
            cells = self.fitted.spec.cells
            count = self.triangulation.triangle_count
            require_memory(cells, ceil(_BYTES_PER_TRIANGLE * count / prod(cells)), kernel=False)
        for path in targets:
            stage = f"write {path.name}"
            if format_of(path) is STL:
                with timed(self.seconds, stage, None):
                    write_stl(self.triangulation, path, progress, stage)
            else:
                with timed(self.seconds, stage, progress):
                    write_triangles(*indexed_triangles(self.triangulation), path)


@dataclass(frozen=True, slots=True)
class TriangleReport:
    """Report on the triangles of a lattice.

    Attributes
    ----------
    cells : tuple of int
    cell_size : float
        In mm, before any map.
    cells_alike : bool
        False where a scale field or a map makes cells of other sizes.
    thickness, min_thickness, max_thickness : float
        Whole wall in mm: its mean over the mid-surface and its extremes.
    density : float
        Volume fraction: of a cell, or of the mapped block where the lattice is graded.
    patches, triangles : int
    fewest_steps, most_steps : int
        Squares along a side of a patch, each two triangles.
    steps_through : int
        Of the free side walls, from face to face.
    boundary_edges : int
        Mid-surface edges that bound one patch only: each carries a ruled side wall.
    non_manifold_edges : int
        Lines through the wall in which patches touch without joining; there triangles are parted by a hair.
    volume, volume_wall, volume_exact : float
        In mm3: enclosed by the triangles, by the NURBS faces, and of the exact wall: by the tube formula, or by
        quadrature where the lattice is graded.
    area : float
        In mm2, of the NURBS faces and side walls that the triangles stand for.
    deviation : float
        Largest distance between triangles and NURBS faces, in mm, as measured.
    volume_offset : float
        In mm, how far from the faces the corners of triangles lie at most, for the sake of the volume.
    seconds : dict
        By stage.
    """

    cells: tuple[int, int, int]
    cell_size: float
    cells_alike: bool
    thickness: float
    min_thickness: float
    max_thickness: float
    density: float
    patches: int
    triangles: int
    fewest_steps: int
    most_steps: int
    steps_through: int
    boundary_edges: int
    non_manifold_edges: int
    volume: float
    volume_wall: float
    volume_exact: float
    area: float
    deviation: float
    volume_offset: float
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed."""
        fewest, most = (f"{steps} x {steps}" for steps in (self.fewest_steps, self.most_steps))
        squares = most if fewest == most else f"{fewest} to {most}"
        return [
            ("cells", cells_shown(self.cells, self.cell_size, self.cells_alike)),
            ("wall", wall_shown(self.thickness, self.min_thickness, self.max_thickness, self.density)),
            ("triangles", f"{self.triangles:,} (closed), {squares} squares a patch and face"),
            ("boundary edges, non-manifold edges", f"{self.boundary_edges}, {self.non_manifold_edges}"),
            ("volume", volume_shown(self.volume, self.volume_exact)),
            ("area", f"{self.area:.8g} mm2"),
            ("deviation", f"{self.deviation:.2g} mm from the NURBS faces"),
        ]

    def __str__(self) -> str:
        return text_table(self.rows())


def triangle_report(made: Triangles, thickness: float, density: float, volume_exact: float) -> TriangleReport:
    """The report on triangles.

    Parameters
    ----------
    made : Triangles
    thickness, density, volume_exact : float
        Of the exact lattice.
    """
    fitted, triangulation = made.fitted, made.triangulation
    complex, varies = fitted.complex, fitted.refit is not None
    return TriangleReport(
        cells=fitted.spec.cells,
        cell_size=fitted.spec.grading.cell_size,
        cells_alike=fitted.spec.grading.cells_alike,
        thickness=thickness,
        min_thickness=fitted.min_thickness if varies else thickness,
        max_thickness=fitted.max_thickness if varies else thickness,
        density=density,
        patches=complex.patch_count,
        triangles=triangulation.triangle_count,
        fewest_steps=int(triangulation.patch_steps.min()),
        most_steps=int(triangulation.patch_steps.max()),
        steps_through=triangulation.across,
        boundary_edges=int(complex.free.sum()),
        non_manifold_edges=complex.non_manifold_edges,
        volume=triangulation.volume,
        volume_wall=fitted.wall.volume(),
        volume_exact=volume_exact,
        area=fitted_areas(fitted.wall).total,
        deviation=triangulation.deviation,
        volume_offset=triangulation.volume_offset,
        seconds=dict(made.seconds),
    )


_made: Cache[tuple[LatticeSpec, float], Triangles] = Cache()


def triangles(spec: LatticeSpec, deviation: float, progress: Progress | None = None) -> Triangles:
    """The triangles of a lattice; the last few are remembered.

    Parameters
    ----------
    spec : LatticeSpec
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
    return _made.get((spec, deviation), lambda: Triangles(fitted_wall(spec, progress), deviation, progress))

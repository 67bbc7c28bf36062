"""The lattice that a part is filled with: an endless one, or a block that was described before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import Kind
from gyroid_cad.common.memory import require_room
from gyroid_cad.common.progress import Timed
from gyroid_cad.errors import ParameterError, SelfIntersectionError
from gyroid_cad.fields.field import Field, FieldLike
from gyroid_cad.filling.extent import BoundedExtent, extent_of
from gyroid_cad.filling.wanted import SHEET, Region, Regions, regions_of
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.solid import build_faces, build_patches
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.families import MinimalSurface
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.surface.fit_report import fit_within
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.covering import (
    SIDE_SAMPLES,
    Frame,
    PlacedExtent,
    covering_complex,
    patch_sides,
    periodic_offsets,
    wall_extremes,
)
from gyroid_cad.wall.distances import nearest_offsets
from gyroid_cad.wall.exact import offset_patches, patch_points_and_normals
from gyroid_cad.wall.fitted import fit_wall
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall
from gyroid_cad.wall.parameters import USUAL_TOLERANCE, require_cell_size

__all__ = ["Infill", "InfillIn", "block_infill", "described_infill", "endless_infill", "require_cover"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_BLOCK_SAMPLES = 13
# Peak memory of filling and writing, for each cell of the box round a part, as measured, rounded up.
_BYTES_PER_CELL = 10_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Infill:
    """A lattice in the space of a part.

    Attributes
    ----------
    frame : Frame
        Where it stands.
    grading : Grading
        In its own space.
    complex : CellComplex
    wall : Wall
        In the part's space.
    min_thickness, max_thickness : float
        Wall in mm.
    endless : bool
        Whether it goes on beyond its patches; else it ends at its free side walls.
    """

    frame: Frame
    grading: Grading
    complex: CellComplex
    wall: Wall
    min_thickness: float
    max_thickness: float
    endless: bool

    def sides(self, distance: Any, contains: Any) -> Integers:
        """Side of a part on which each patch lies, or that it may be crossed, as :func:`covering.patch_sides` tells."""
        samples = np.linspace(-1, 1, SIDE_SAMPLES)
        if self.endless:
            own = patch_points_and_normals(self.complex, self.grading.cell_size, samples)[0]
        else:
            fitted = [some.points for _, some in offset_patches(self.complex, self.grading, samples)]
            own = np.concatenate(fitted).reshape(-1, SIDE_SAMPLES**2, 3)
        points = self.frame.placed(own)
        return patch_sides(self.complex, points, self.max_thickness / 2, distance, contains)

    def offsets(self, points: Floats) -> Floats:
        """Signed distance of points of the part's space from an endless mid-surface, in mm."""
        return periodic_offsets(self.frame, self.grading.cell_size, points, self.grading.surface)

    def contains(self, region: Region, points: Floats) -> Booleans:
        """Mask of the points of the part's space, shape (n, 3), that lie in a region, to about 1e-3 cell sizes."""
        if not self.endless:
            return self._block_holds(region, points)
        if self.grading.uniform:
            return region.contains(self.offsets(points), np.full(len(points), self.max_thickness / 2))
        own = self.frame.own(points)
        half_thickness = self.grading.lay(own, np.broadcast_to([0.0, 0.0, 1.0], own.shape)).thickness / 2
        return region.contains(self.offsets(points), half_thickness)

    def _block_holds(self, region: Region, points: Floats) -> Booleans:
        fitted = [
            fitted for _, fitted in offset_patches(self.complex, self.grading, np.linspace(-1, 1, _BLOCK_SAMPLES))
        ]
        places, normals, thickness = (
            np.concatenate([getattr(some, name) for some in fitted]) for name in ("points", "normals", "thickness")
        )
        own = self.frame.own(points)
        offsets, nearest = nearest_offsets(places, normals, own)
        # Beyond the block's boundary edges the nearest sample is far to the side.
        grid = places.reshape(-1, _BLOCK_SAMPLES, _BLOCK_SAMPLES, 3)
        gap = sum(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).max() for axis in (1, 2)) / 2
        aside = np.linalg.norm(own - places[nearest] - offsets[:, np.newaxis] * normals[nearest], axis=1)
        return np.asarray(region.contains(offsets, thickness[nearest] / 2) & (aside <= gap))

    def faces(self, region: Region) -> list[list[Any]]:
        """The faces of every patch that bound a region, oriented out of it; neighbours share their edges."""

        if not self.endless:
            return build_patches(self.wall)
        pairs = build_faces(self.wall)
        return [
            [pair[side].Reversed() if backwards else pair[side] for side, backwards in region.sides] for pair in pairs
        ]


class InfillIn(Protocol):
    """Gives the lattice for a part and a frame, each stage timed, with a uniform wall of so many mm at least."""

    def __call__(self, part: Part | BoundedExtent, frame: Frame, timed: Timed, least: float = 0.0) -> Infill: ...


def described_infill(
    kind: Kind,
    cell_size: float | None,
    thickness: FieldLike | None,
    density: FieldLike | None,
    fit: FitSettings,
    tolerance: float | None,
    lattice: Lattice | None,
    surface: MinimalSurface,
) -> tuple[tuple[Region, ...], float, FitSettings, InfillIn]:
    """The regions wanted, the cell size, the fit, and how the lattice is to be had for a part and a frame.

    Arguments and errors are those of :func:`gyroid_cad.fill`.
    """
    if lattice is not None:
        given = {"cell_size": cell_size, "thickness": thickness, "density": density, "tolerance": tolerance}
        for name, value in given.items():
            if value is not None:
                raise ParameterError(name, value, "none beside a lattice, which has its own")
        if kind != SHEET:
            raise ParameterError("kind", kind, f"{SHEET}: of a block of cells only the wall is a solid of its own")
        regions = regions_of(kind, lattice.cell_size, lattice.wall_thickness, None, lattice.minimal_surface.tube)
        block: InfillIn = lambda part, frame, timed, least=0.0: block_infill(lattice, frame)  # noqa: E731
        return regions.regions, lattice.cell_size, fit, block
    size = finite_number("cell_size", cell_size, "a length in mm, a finite number")
    require_cell_size(size)
    wanted = regions_of(kind, size, thickness, density, surface.tube)
    settings = fit if tolerance is None or not wanted.uniform else fit_within(fit, tolerance, surface.family)
    closeness = tolerance or USUAL_TOLERANCE

    def endless(part: Part | BoundedExtent, frame: Frame, timed: Timed, least: float = 0.0) -> Infill:
        made = endless_infill(part, frame, size, wanted.at_least(least), settings, closeness, timed, surface)
        smallest = float(np.min(part.high - part.low))
        if smallest <= made.max_thickness:
            name, given = ("thickness", thickness) if density is None else ("density", density)
            raise ParameterError(
                name,
                given,
                f"a wall below the part's smallest extent, {smallest:.6g} mm; it would be {made.max_thickness:.6g} mm",
            )
        return made

    return wanted.regions, size, settings, endless


def endless_infill(
    part: Part | BoundedExtent,
    frame: Frame,
    cell_size: float,
    regions: Regions,
    fit: FitSettings,
    tolerance: float,
    timed: Timed,
    surface: MinimalSurface,
) -> Infill:
    """An endless lattice, as far as a part needs it; fields are heeded where its wall may be in the part.

    Parameters
    ----------
    part : Part or BoundedExtent
    frame : Frame
    cell_size : float
        In mm.
    regions : Regions
    fit : FitSettings
    tolerance : float
        Of a graded wall, in cell sizes.
    timed : callable
        A context for each stage, by its name.
    surface : MinimalSurface

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError
    """
    low, high = part.low, part.high
    # So that no digits are lost in places of a lattice whose origin is far away.
    frame = frame.nearest_to((low + high) / 2, cell_size)
    thickness, density = (_in_frame(value, frame) for value in (regions.thickness, regions.density))
    grading = Grading(cell_size, thickness, density, surface=surface)
    try:
        with timed("cover"):
            if not (grading.uniform and isinstance(part, Part)):
                grading = replace(grading, extent=PlacedExtent(extent_of(part, cell_size), frame))
            min_thickness, max_thickness = wall_extremes(low, high, frame, grading)
            complex = covering_complex(low, high, frame, cell_size, max_thickness / 2, surface, grading.extent)
        wall, refit = fit_wall(complex, grading, fit, tolerance, timed)
    except SelfIntersectionError as error:
        raise _moved(error, frame) from None
    if refit is not None:
        min_thickness, max_thickness = min(min_thickness, refit.min_thickness), max(max_thickness, refit.max_thickness)
    return Infill(frame, grading, complex, wall.moved(frame.rotation, frame.origin), min_thickness, max_thickness, True)


def require_cover(low: Floats, high: Floats, cell_size: float, control_points: int) -> None:
    """Check that there is memory for the cells that cover a part, before any of them is made.

    Parameters
    ----------
    low, high : ndarray, shape (3,)
        Corners of the box round the part, in mm.
    cell_size : float
        In mm.
    control_points : int
        Of a patch, along a side.

    Raises
    ------
    ParameterError
        Saying how many cells that would be, and which size would do.
    """
    count = float(np.prod(np.maximum((high - low) / cell_size, 1)))
    each = _BYTES_PER_CELL * max(1.0, (control_points / 10) ** 2)

    def accepted(left: int) -> str:
        return f"at least about {cell_size * (count * each / max(left, each)) ** (1 / 3):.3g} mm for this part"

    require_room("cell_size", cell_size, int(count * each), accepted, subject=f"about {count:,.0f} cells")


def block_infill(lattice: Lattice, frame: Frame) -> Infill:
    """A block of cells that was described as a lattice, with whatever varies in it.

    Parameters
    ----------
    lattice : Lattice
    frame : Frame
        That the lattice is placed by, wherever it stands in its own space.
    """
    fitted = lattice.fitted().at_home()
    frame = lattice.spec().frame.within(frame)
    wall = fitted.wall.moved(frame.rotation, frame.origin)
    return Infill(frame, fitted.spec.grading, fitted.complex, wall, fitted.min_thickness, fitted.max_thickness, False)


def _in_frame(value: float | Field | None, frame: Frame) -> float | Field | None:
    """A field of the part's space as one of the lattice's own."""
    if not isinstance(value, Field):
        return value
    function = value.function

    def carried(x: Floats, y: Floats, z: Floats) -> Any:
        return function(*frame.placed(np.stack([x, y, z], axis=-1)).T)

    return replace(value, function=carried)


def _moved(error: SelfIntersectionError, frame: Frame) -> SelfIntersectionError:
    """Move an infill to its place in the part's space."""
    x, y, z = frame.placed(np.array(error.place)).tolist()
    kind, given = error.__reduce__()
    parameter, value, _, *rest = given
    return kind(parameter, value, (x, y, z), *rest)  # type: ignore[arg-type]

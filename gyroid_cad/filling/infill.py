"""The lattice that a part is filled with: an endless one, or a block that was described before."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial as partial_of
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import BLOCK_KINDS, Kind
from gyroid_cad.common.progress import Timed
from gyroid_cad.errors import ParameterError, SelfIntersectionError
from gyroid_cad.fields.field import Field, FieldLike
from gyroid_cad.filling.extent import BoundedExtent, MappedExtent, block_round, extent_of, preimages, uncovered
from gyroid_cad.filling.forecast import Forecast, forecast_of, require_thicker
from gyroid_cad.filling.wanted import NETWORK_A, NETWORK_B, SHEET, Region, Regions, regions_of
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.solid import build_faces, build_patches
from gyroid_cad.surface.families import MinimalSurface
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.lattice_faces import LatticeFaces
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
from gyroid_cad.wall.distances import in_wall
from gyroid_cad.wall.exact import offset_patches, patch_points_and_normals
from gyroid_cad.wall.fitted import Closeness, LatticeSpec, fit_wall
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.limits import require_cell_size, require_none_beside_lattice
from gyroid_cad.wall.offset import Wall, side_along
from gyroid_cad.wall.parameters import LatticeParameters
from gyroid_cad.wall.self_intersection import require_simple

__all__ = [
    "Infill",
    "InfillIn",
    "block_infill",
    "described_infill",
    "endless_infill",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places of a part that tell what of it a block covers; and how often the block is cut back where its wall would fold.
_COVER_POINTS, _MOST_CUTS = 2000, 20


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
    uncovered : float
        Share of the part that it does not reach.
    """

    frame: Frame
    grading: Grading
    complex: CellComplex
    wall: Wall
    min_thickness: float
    max_thickness: float
    endless: bool
    uncovered: float = 0.0

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
        """Mask of the points of the part's space, shape (n, 3), that lie in a region, to about 1e-3 cell sizes.

        Of a block the wall is the only region, and known as it was fitted, with its ends.
        """
        if not self.endless:
            return in_wall(self.wall, points)
        return region.contains(self.offsets(points), self.half_thickness(points))

    def half_thickness(self, points: Floats) -> Floats:
        """Half of an endless lattice's wall at points of the part's space, in mm."""
        if self.grading.uniform:
            return np.full(len(points), self.max_thickness / 2)
        own = self.frame.own(points)
        return np.asarray(self.grading.lay(own, np.broadcast_to([0.0, 0.0, 1.0], own.shape)).thickness / 2)

    def bounding(self, region: Region, patches: Integers) -> tuple[LatticeFaces, Booleans]:
        """Faces of some patches that bound a region, side walls too, and whether their normals point into it."""
        kinds = [(patches, *side) for side in region.sides]
        if not self.endless:
            free = self.complex.free[self.complex.patch_edges[patches]]
            kinds += [(patches[free[:, edge]], side_along(edge), False) for edge in range(4)]
        patch, side, backwards = (
            np.concatenate(some)
            for some in zip(
                *((own, np.full(len(own), side), np.full(len(own), back)) for own, side, back in kinds), strict=True
            )
        )
        return LatticeFaces(self.wall, patch, side), backwards

    def faces(self, region: Region) -> list[list[Any]]:
        """The faces of every patch that bound a region, oriented out of it; neighbours share their edges."""

        if not self.endless:
            return build_patches(self.wall)
        pairs = build_faces(self.wall)
        return [
            [pair[side].Reversed() if backwards else pair[side] for side, backwards in region.sides] for pair in pairs
        ]


class Foreseen(Protocol):
    """Tells what filling a part takes, and refuses one that memory would not hold, or that is thinner than the wall."""

    def __call__(self, part: Part) -> Forecast: ...


class InfillIn(Protocol):
    """Gives the lattice for a part and a frame, each stage timed, with a uniform wall of so many mm at least."""

    def __call__(self, part: Part | BoundedExtent, frame: Frame, timed: Timed, least: float = 0.0) -> Infill: ...


def described_infill(
    kind: Kind,
    cell_size: float | None,
    thickness: FieldLike | None,
    density: FieldLike | None,
    closeness: Closeness,
    lattice: LatticeParameters | None,
    surface: MinimalSurface,
    partial: bool = False,
) -> tuple[tuple[Region, ...], float, FitSettings, Foreseen, InfillIn]:
    """The regions wanted, the cell size, the fit, what a part would take, and how the lattice is to be had for one.

    Arguments and errors are those of :func:`gyroid_cad.fill`.
    """
    if lattice is not None:
        fit = {"tolerance": closeness.tolerance, "compact": closeness.compact}
        require_none_beside_lattice({"cell_size": cell_size, "thickness": thickness, "density": density, **fit})
        regions = _regions_beside(lattice, kind)

        def block(part: Part | BoundedExtent, frame: Frame, timed: Timed, least: float = 0.0) -> Infill:
            return block_infill(lattice, part, frame, timed, partial, least if lattice.network else 0.0)

        uniform, settings = lattice.wall_thickness if lattice.uniform else 0.0, lattice.spec().settings
        own = lattice.cell_size, uniform, lattice.thickness, lattice.density
        foreseen = partial_of(_foreseen, lattice.grading().cells_alike, settings.control_points, *own)
        return regions.regions, lattice.cell_size, settings, foreseen, block
    size = finite_number("cell_size", cell_size, "a length in mm, a finite number")
    require_cell_size(size)
    wanted = regions_of(kind, size, thickness, density, surface.tube)
    closeness.require(size)
    settings, tolerance = closeness.chosen(size, surface.family if wanted.uniform else None)

    def endless(part: Part | BoundedExtent, frame: Frame, timed: Timed, least: float = 0.0) -> Infill:
        made = endless_infill(part, frame, size, wanted.at_least(least), settings, tolerance, timed, surface)
        require_thicker(part, made.max_thickness, thickness, density)
        return made

    uniform = wanted.thickness if isinstance(wanted.thickness, float) else 0.0
    foreseen = partial_of(_foreseen, True, settings.control_points, size, uniform, thickness, density)
    return wanted.regions, size, settings, foreseen, endless


def _regions_beside(lattice: LatticeParameters, kind: Kind) -> Regions:
    """Regions of a kind, with the wall of a lattice, or with its network."""
    if kind not in BLOCK_KINDS:
        raise ParameterError("kind", kind, f"{' or '.join(BLOCK_KINDS)} beside a lattice, whose wall is described")
    if kind != SHEET and not lattice.grading().cells_alike:
        accepted = f"{SHEET}: where a map or a scale field carries the block only its wall is a solid of its own"
        raise ParameterError("kind", kind, accepted)
    if kind in (NETWORK_A, NETWORK_B) and not lattice.network:
        raise ParameterError("kind", kind, "none beside a lattice of a wall: the density of a network is its own")
    size, tube = lattice.cell_size, lattice.minimal_surface.tube
    if lattice.network:
        return regions_of(kind, size, None, lattice.density, tube)
    return regions_of(kind, size, lattice.wall_thickness, None, tube)


def _foreseen(
    without_end: bool,
    control_points: int,
    cell_size: float,
    wall: float,
    thickness: FieldLike | None,
    density: FieldLike | None,
    part: Part,
) -> Forecast:
    forecast = forecast_of(part, cell_size, control_points)
    if without_end:
        forecast.require_memory(cell_size)
    require_thicker(part, wall, thickness, density)
    return forecast


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


def block_infill(
    lattice: LatticeParameters,
    part: Part | BoundedExtent,
    frame: Frame,
    timed: Timed,
    partial: bool = False,
    least: float = 0.0,
) -> Infill:
    """A lattice that was described as a block of cells, with whatever varies in it, as far as a part needs it.

    Where its cells are alike it goes on for ever. Else cells are added round the block as far as its map goes on.

    Parameters
    ----------
    lattice : Lattice
    part : Part or BoundedExtent
    frame : Frame
        That the lattice is placed by, wherever it stands in its own space.
    timed : callable
        A context for each stage, by its name.
    partial : bool
        Whether some of the part may be out of reach.
    least : float
        Of a uniform wall, in mm, of cells that are alike.

    Raises
    ------
    ParameterError
        If it is, and may not be, saying how much and where.
    SelfIntersectionError, FitError
    """
    spec = lattice.spec()
    frame, grading = spec.frame.within(frame), spec.grading
    if not grading.cells_alike:
        return _mapped_infill(spec, part, frame, timed, partial)
    back = Frame(frame.own(np.zeros(3)), frame.rotation.T)
    thickness, density = (_in_frame(value, back) for value in (grading.thickness, grading.density))
    regions = Regions((), thickness, density).at_least(least)
    return endless_infill(
        part, frame, spec.grading.cell_size, regions, spec.settings, spec.tolerance, timed, grading.surface
    )


def _mapped_infill(spec: LatticeSpec, part: Part | BoundedExtent, frame: Frame, timed: Timed, partial: bool) -> Infill:
    """A block that a scale or a map carries, with cells added round it, until the part is covered or they end."""
    with timed("cover"):
        extent = PlacedExtent(extent_of(part, spec.grading.cell_size), frame)
        grading = replace(spec.grading, extent=MappedExtent(extent, spec.grading))
        held = part.points_inside(_COVER_POINTS)
        wanted = preimages(spec.grading, spec.cells, frame.own(held))
        skin = preimages(spec.grading, spec.cells, frame.own(part.surface_samples(spec.grading.cell_size)[0]))
    limits, refit, reason = np.array([[-np.inf] * 3, [np.inf] * 3]), None, "where its map ends"
    while refit is None:
        with timed("cover"):
            complex = block_round(grading, spec.cells, extent, np.concatenate([wanted, skin]), limits)
            out = held[uncovered(grading, complex, spec.cells, wanted)]
        share = len(out) / max(len(held), 1)
        try:
            if share and not partial:
                # Where the wall would fold the block ends sooner: then still less of the part is within reach.
                require_simple(complex, grading)
                shown = ", ".join(f"{round(number, 6) + 0.0:.6g}" for number in _amid(out))
                accepted = (
                    f"a block that covers the part, or partial: {100 * share:.2g} % of it is out of reach, {reason}"
                )
                raise ParameterError("cells", spec.cells, f"{accepted}, about ({shown}) mm")
            wall, refit = fit_wall(complex, grading, spec.settings, spec.tolerance, timed)
        except SelfIntersectionError as error:
            nearer = _short_of(np.array(error.place), spec, limits)
            if nearer is None:
                raise
            limits, reason = nearer, error.reason
    placed = wall.moved(frame.rotation, frame.origin)
    return Infill(frame, grading, complex, placed, refit.min_thickness, refit.max_thickness, False, share)


def _amid(points: Floats) -> list[float]:
    """The one of some points that is nearest to their middle."""
    found: list[float] = points[np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1))].tolist()
    return found


def _short_of(place: Floats, spec: LatticeSpec, limits: Floats) -> Floats | None:
    """Limits within which there is nothing of a place beyond the block; None of a place in the block itself."""
    size = spec.grading.cell_size
    ends = np.array([[0, 0, 0], spec.cells]) * size
    beyond = np.where(spec.grading.closed, -np.inf, np.array([ends[0] - place, place - ends[1]]))
    side, axis = np.unravel_index(int(np.argmax(beyond)), beyond.shape)
    if beyond[side, axis] <= 0 or limits[side, axis] == ends[side, axis]:
        return None
    inwards, cut = 1 - 2 * side, limits.copy()
    cell = np.ceil(place[axis] * inwards / size) * size * inwards
    if cell * inwards <= limits[side, axis] * inwards:
        # What reaches out of the cells within the limit folds.
        cell = limits[side, axis] + inwards * size
    cut[side, axis] = inwards * min(inwards * cell, inwards * ends[side, axis])
    return cut


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

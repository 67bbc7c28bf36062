"""Roads to what a lattice leaves in a part: a box's sections, crossings with any part, and the kernel's booleans.

The first two know where faces cross from numbers alone; the kernel is asked where something touches, and to check.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.processes import beside
from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.errors import KernelError
from gyroid_cad.filling.bodies import Crossed, FaceNames, Made, merged_chips
from gyroid_cad.filling.infill import Infill
from gyroid_cad.filling.wanted import SKIN, Region
from gyroid_cad.kernel.boundary import ReadBoundary
from gyroid_cad.kernel.check import measure
from gyroid_cad.kernel.crossed import crossed_pieces
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.regions import split_by_region
from gyroid_cad.kernel.shells import VolumeOf, connected_shells
from gyroid_cad.kernel.skin import Hollow
from gyroid_cad.kernel.solid import KernelShape
from gyroid_cad.kernel.split import Pieces, bounded_solids, parted_solids
from gyroid_cad.kernel.trimmed import build_trimmed, hollowed_by
from gyroid_cad.trim.box import TrimmedWall, cut_to_box
from gyroid_cad.trim.crossing import cross_part
from gyroid_cad.trim.measures import PieceMeasures, boundary_measures, joined, lattice_measures, whole_measures
from gyroid_cad.wall.covering import CROSSING, INSIDE

__all__ = ["Job", "Road", "crossed_by", "patches_of", "taken"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Road = Literal["sections", "crossings", "booleans", "bodies"]
# Solids by the name of their region; patches that the part's boundary may cross; and those that lie wholly inside.
Found = tuple[dict[str, list[Made]], int, int]


class Job(Protocol):
    """A part to be filled, and with which regions of the lattice."""

    @property
    def part(self) -> Part: ...
    @property
    def hollow(self) -> Hollow | None: ...
    @property
    def core(self) -> Part: ...
    @property
    def regions(self) -> tuple[Region, ...]: ...
    @property
    def cell_size(self) -> float: ...
    @property
    def progress(self) -> Progress | None: ...
    @property
    def boundary(self) -> ReadBoundary: ...
    def sides(self, infill: Infill) -> NDArray[np.int64]: ...
    def timed(self, stage: str) -> AbstractContextManager[None]: ...


def taken(road: Road, job: Job, infill: Infill, processes: int | None = None) -> Found:
    """Return the solids that a road leads to, how many patches were cut, and how many are whole.

    Parameters
    ----------
    road : {"sections", "crossings", "booleans", "bodies"}
        Sections are of a box alone, and of endless lattices, for they cut no side walls. Bodies are those of crossings
        with the first region, and what it leaves.
    job : Job
    infill : Infill
    processes : int, optional
        For booleans.

    Raises
    ------
    KernelError
    """
    if road == "sections":
        return _by_sections(job, infill)
    if road in ("crossings", "bodies"):
        return _by_crossings(job, infill, road == "bodies")
    return _by_booleans(job, infill, processes)


def _by_sections(job: Job, infill: Infill) -> Found:
    """Fill a box, whose sides are planes."""
    box = job.core.box
    assert box is not None
    corner = (box.axes @ box.low)[np.newaxis]
    made, cut, whole = {}, 0, 0
    for region in job.regions:
        # A skin and what is joined to it are the part less the voids that the lattice leaves in the core.
        skinned = job.hollow is not None and not region.fluid
        sides = [(side, backwards != skinned) for side, backwards in region.sides]
        with job.timed("cut"):
            filled = not region.surface and bool(infill.contains(region, corner)[0]) != skinned
            left = cut_to_box(infill.wall, box, sides, job.cell_size, filled, capped=not region.surface)
        with job.timed("solid"):
            shapes = build_trimmed(left)
        pieces = [
            Made(shape, 0.0, area) if region.surface else Made(shape, volume, area, centroid)
            for shape, volume, area, centroid in zip(
                shapes, left.volumes.tolist(), left.areas.tolist(), map(tuple, left.centroids.tolist()), strict=True
            )
        ]
        made[region.name] = [_less(job.part, pieces)] if skinned else pieces
        counted = _patches_of(left)
        cut, whole = max(cut, counted[0]), max(whole, counted[1])
    return made, cut, whole


def _less(part: Part, voids: list[Made]) -> Made:
    """The part less voids within it."""
    volume, area = measure(part.shape)
    shape = hollowed_by(part.shape, (void.shape for void in voids))
    return Made(shape, volume - sum(void.volume for void in voids), area + sum(void.area for void in voids))


def _patches_of(left: TrimmedWall) -> tuple[int, int]:
    """Count the patches that a box cuts, and those that it leaves whole."""
    cut = {
        face.patch
        for face in left.faces
        if any(patch_edge < 0 for patch_edges in face.patch_edges for patch_edge in patch_edges)
    }
    return len(cut), len({face.patch for face in left.faces} - cut)


def _by_crossings(job: Job, infill: Infill, bodies: bool) -> Found:
    """Fill any part: the curves in which the lattice crosses its boundary are found by number."""
    crossing, inside = patches_of(job, infill)
    if bodies:
        made = _bodies(job, infill, crossed_by(job, infill, job.regions[0], crossing, inside, outer=True))
    else:
        made = {
            region.name: _joined_crossed(
                job, infill, region, crossed_by(job, infill, region, crossing, inside, job.hollow is not None)
            )
            for region in job.regions
        }
    return made, len(crossing), len(inside)


def patches_of(job: Job, infill: Infill) -> tuple[Integers, Integers]:
    """Patches that the boundary of what is filled may cross, and those that lie wholly inside."""
    with job.timed("cover"):
        sides = job.sides(infill)
    return np.flatnonzero(sides == CROSSING), np.flatnonzero(sides == INSIDE)


def _bodies(job: Job, infill: Infill, crossed: Crossed) -> dict[str, list[Made]]:
    """The first region, what it leaves on either side of it, and the skin, as bodies that share their faces."""
    wall, *fluids = job.regions
    pieces, faces, sizes = crossed.pieces, crossed.faces, crossed.sizes

    def volume_of(shell: KernelShape) -> float:
        return sizes.of(shell).volume

    with job.timed("join"):
        within, beside = parted_solids(
            pieces, faces, lambda point: bool(infill.contains(wall, point[np.newaxis])[0]), volume_of
        )
        found: dict[str, list[KernelShape]] = {wall.name: list(within), **{fluid.name: [] for fluid in fluids}}
        named = FaceNames(crossed, job.hollow, {side: fluid.name for fluid in fluids for side, _ in fluid.sides})
        for solid in beside:
            found[named.fluid_of(solid)].append(solid)
        if job.hollow is not None:
            found[SKIN] = list(job.hollow.skin_solids(pieces, volume_of))
        found = merged_chips(found, volume_of, job.cell_size**3)
    return {name: [named.made(shape, name, sizes) for shape in some] for name, some in found.items()}


def _joined_crossed(job: Job, infill: Infill, region: Region, crossed: Crossed) -> list[Made]:
    sizes = crossed.sizes
    with job.timed("join"):
        shapes = _joined(job, infill, region, crossed.pieces, crossed.faces, lambda shell: sizes.of(shell).volume)
        made = [(shape, sizes.of(shape)) for shape in shapes]
    return [
        Made(shape, 0.0, size.area) if region.surface else Made(shape, size.volume, size.area, size.centroid)
        for shape, size in made
    ]


def crossed_by(
    job: Job,
    infill: Infill,
    region: Region,
    crossing: Integers,
    inside: Integers,
    outer: bool,
) -> Crossed:
    """Cross what bounds a region with the boundary of what is filled.

    Parameters
    ----------
    job : Job
    infill : Infill
    region : Region
    crossing, inside : ndarray of int
        As of :func:`patches_of`.
    outer : bool
        Whether pieces of the boundary beside the region are wanted too.

    Raises
    ------
    KernelError
    """

    def in_region(points: Floats) -> Booleans:
        return infill.contains(region, points)

    with job.timed("cut"):
        try:
            cut = cross_part(
                *infill.bounding(region, crossing),
                job.boundary.boundary,
                job.cell_size,
                job.core.contains,
                None if region.surface else in_region,
                outer=outer,
                progress=lambda done, count: report_progress(job.progress, "cut", done, count),
            )
        except np.linalg.LinAlgError as singular:
            raise KernelError("an edge of the part lies along the lattice") from singular
    whole = infill.bounding(region, inside)
    middle = (job.part.low + job.part.high) / 2

    def measured() -> PieceMeasures:
        return joined(
            lattice_measures(cut, middle),
            boundary_measures(cut, [*cut.inner, *cut.outer], middle),
            whole_measures(*whole, middle),
        )

    with beside(measured, "measures the faces") as measures:
        with job.timed("solid"):
            pieces, faces = crossed_pieces(cut, job.boundary, *whole)
        with job.timed("measure"):
            found = measures()
    sides = [*cut.faces.side[[piece.face for piece in cut.lattice]].tolist(), *whole[0].side.tolist()]
    return Crossed(pieces, faces, found, middle, sides)


def _by_booleans(job: Job, infill: Infill, processes: int | None = None) -> Found:
    """Fill any part by the kernel's general fuse."""
    with job.timed("cover"):
        sides = job.sides(infill)
    made = {}
    for region in job.regions:
        with job.timed("faces"):
            faces = infill.faces(region)
        cut, whole = (
            [face for patch in np.flatnonzero(sides == side).tolist() for face in faces[patch]]
            for side in (CROSSING, INSIDE)
        )
        with job.timed("split"):
            pieces = split_by_region(
                job.core, cut, processes, lambda done, count: report_progress(job.progress, "split", done, count)
            )
        with job.timed("join"):
            shapes = _joined(job, infill, region, pieces, whole)
        with job.timed("measure"):
            made[region.name] = [
                Made(shape, 0.0, measure(shape)[1]) if region.surface else Made(shape, *measure(shape))
                for shape in shapes
            ]
    return made, int(np.sum(sides == CROSSING)), int(np.sum(sides == INSIDE))


def _joined(
    job: Job, infill: Infill, region: Region, pieces: Pieces, whole: list[Any], volume_of: VolumeOf | None = None
) -> list[KernelShape]:
    """Solids, or shells, that pieces of the lattice and of the part bound."""

    def wanted_at(point: Floats) -> bool:
        return bool(infill.contains(region, point[np.newaxis])[0])

    if region.surface:
        return list(connected_shells([*pieces.inside, *whole]))
    if job.hollow is None or region.fluid:
        return list(bounded_solids(pieces, whole, wanted_at, volume_of))
    return list(job.hollow.solids(pieces, whole, wanted_at, volume_of))

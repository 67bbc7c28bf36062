"""Checked solids that a lattice leaves in a part; the lattice is shifted a little where the kernel fails."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.formats import TRIANGLE_FORMATS, format_of
from gyroid_cad.common.progress import Progress, report_progress, timed
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.bodies import Made
from gyroid_cad.filling.extent import PartExtent
from gyroid_cad.filling.infill import Infill
from gyroid_cad.filling.roads import Road, taken
from gyroid_cad.filling.wanted import Region
from gyroid_cad.host_shapes import named_shapes
from gyroid_cad.kernel.apart import read_named
from gyroid_cad.kernel.boundary import ReadBoundary, read_boundary
from gyroid_cad.kernel.check import compound_of, faces_of, is_valid, measure, sealed_shells, topology, without_shells
from gyroid_cad.kernel.part import Part, require_part, sound_part
from gyroid_cad.kernel.repair import separate_solids
from gyroid_cad.kernel.skin import Hollow
from gyroid_cad.kernel.solid import KernelFace, KernelShape
from gyroid_cad.trim.clearance import NearMisses, near_misses
from gyroid_cad.trim.islands import SealedVoid, piece_size, speck_below
from gyroid_cad.trim.lattice_faces import LatticeFaces
from gyroid_cad.wall.covering import CROSSING, PERTURBATIONS, Frame, first_success

__all__ = [
    "FilledBy",
    "Filling",
    "Made",
    "Outcome",
    "bodies_of",
    "part_of",
    "shapes_of",
    "solid_names",
    "without_specks",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Share of all volume that a piece may be below zero by: rounding.
_INSIDE_OUT = 1e-9
# An estimate of the volume from so many points; further off than so many of its deviations, something is wrong.
_ESTIMATE_POINTS, _ESTIMATE_DEVIATIONS, _ESTIMATE_ERROR = 4096, 6.0, 0.02
# Of the layer round a bare surface whose volume tells its area, in cell sizes.
_SURFACE_LAYER = 0.05
# In mm. The kernel's sections of the two faces of a thinner wall run into each other.
_THIN_WALL = 0.01


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Solids that filling gave, and how they came about.

    Attributes
    ----------
    domains : dict
        Solids, or shells, by the name of their region; the largest first.
    infill : Infill
    shift : ndarray, shape (3,)
        Of the lattice, in mm, where the kernel did not manage without.
    cut, whole : int
        Patches that the part's boundary may cross, and that lie wholly inside.
    by_sections : bool
        Whether it was cut without the kernel's booleans.
    """

    domains: dict[str, list[Made]]
    infill: Infill
    shift: Floats
    cut: int
    whole: int
    by_sections: bool


class FilledBy(Protocol):
    """Part that was filled, with what, and how long it took."""

    @property
    def part(self) -> Part: ...
    @property
    def hollow(self) -> Hollow | None: ...
    @property
    def regions(self) -> tuple[Region, ...]: ...
    @property
    def cell_size(self) -> float: ...
    @property
    def seconds(self) -> dict[str, float]: ...
    def near_misses(self, frame: Frame, within: float) -> NearMisses: ...
    def timed(self, stage: str) -> AbstractContextManager[None]: ...
    def of(self, fluid: str) -> Filling: ...


@dataclass(frozen=True, eq=False)
class Filling:
    """A part to be filled: all that stays the same however the lattice is shifted.

    Attributes
    ----------
    part : Part
    hollow : Hollow, optional
        The part with its skin taken off, of which the rest is filled.
    regions : tuple of Region
    infill_in : callable
        The lattice in a frame.
    cell_size : float
        In mm.
    progress : callable, optional
    shared : bool
        Whether the regions are wanted as bodies that share their faces, the skin too.
    opened : tuple of KernelFace
        The part's faces where its skin is open.
    seconds : dict
        By stage.
    """

    part: Part
    hollow: Hollow | None
    regions: tuple[Region, ...]
    infill_in: Callable[[Frame, Callable[[str], AbstractContextManager[None]]], Infill]
    cell_size: float
    progress: Progress | None
    shared: bool = False
    opened: tuple[KernelFace, ...] = ()
    seconds: dict[str, float] = field(default_factory=dict)

    @cached_property
    def infill_at(self) -> Callable[[Frame], Infill]:
        """The lattice in a frame, made once for each."""
        made: dict[tuple[float, ...], Infill] = {}

        def infill(frame: Frame) -> Infill:
            key = tuple(frame.origin.tolist())
            if key not in made:
                made[key] = self.infill_in(frame, self.timed)
            return made[key]

        return infill

    @cached_property
    def boundary(self) -> ReadBoundary:
        """Boundary of what is filled, as numbers.

        Raises
        ------
        KernelError
        """
        return read_boundary(self.core.shape)

    @cached_property
    def _sides(self) -> dict[int, Integers]:
        return {}

    @cached_property
    def _extent(self) -> PartExtent:
        return PartExtent(self.core, self.cell_size)

    @property
    def core(self) -> Part:
        """The part that is filled: the whole one, or what its skin leaves of it."""
        return self.part if self.hollow is None else self.hollow.core

    @property
    def cells(self) -> float:
        """Number of cells that have the volume of what is filled."""
        return self.core.volume / self.cell_size**3

    def of(self, fluid: str) -> Filling:
        """The filling that gives a fluid: this one."""
        return self

    def run(self, frame: Frame) -> Outcome:
        """Fill, with the lattice a little shifted where the kernel does not manage otherwise.

        Raises
        ------
        KernelError
        """
        points = np.random.default_rng(0).uniform(self.core.low, self.core.high, (_ESTIMATE_POINTS, 3))
        with self.timed("cover"):
            points = points[self.core.contains(points)]

        def infill_at(phase: Point) -> Infill:
            return self.infill_at(replace(frame, origin=frame.origin + np.array(phase) * self.cell_size))

        # Faces that touch the part are in doubt there: first shift, and only then ask the kernel; the last time in one
        # process, should it be the joining of regions that fails.
        attempts: list[tuple[Road, Point, int | None]] = [
            ("booleans", phase, processes) for phase, processes in zip(PERTURBATIONS, (None, None, 1), strict=True)
        ]
        attempts = [("crossings", phase, None) for phase in PERTURBATIONS] + attempts
        if self.shared:
            attempts = [("bodies", phase, None) for phase in PERTURBATIONS]
        # A box's sections know nothing of walls where a lattice ends.
        single = self.hollow is None or len(self.part.solids) == 1
        if self.core.box is not None and single and not self.shared and infill_at(PERTURBATIONS[0]).endless:
            attempts = [("sections", phase, None) for phase in PERTURBATIONS] + attempts
        return first_success(
            partial(self._attempt, number, infill_at, phase, points, road, processes)
            for number, (road, phase, processes) in enumerate(attempts, 1)
        )

    def near_misses(self, frame: Frame, within: float) -> NearMisses:
        """Places where the lattice in a frame is so near to the part's edges and faces, in mm; none if it ends.

        Raises
        ------
        ParameterError, SelfIntersectionError, FitError
        """
        infill = self.infill_at(frame)
        if not infill.endless:
            return NearMisses.joined([])
        with self.timed("cover"):
            crossing = np.flatnonzero(self.sides(infill) == CROSSING)
            sides = sorted({side for region in self.regions for side, _ in region.sides})
            faces = LatticeFaces(infill.wall, np.tile(crossing, len(sides)), np.repeat(sides, len(crossing)))
            try:
                return near_misses(faces, self.boundary.boundary, within)
            except KernelError:
                # What ails the part is found again, and said, where it is cut.
                return NearMisses.joined([])

    def sides(self, infill: Infill) -> Integers:
        """Side of the part on which each patch lies, or that it may be crossed."""
        # Infills are kept, so that none gets the number of another.
        if id(infill) not in self._sides:
            self._sides[id(infill)] = infill.sides(self._extent.clearance, self.core.contains)
        return self._sides[id(infill)]

    def _attempt(self, number: int, *given: Any) -> Outcome:
        """Fill, and announce it where it fails: another attempt takes as long again."""
        try:
            return self._filled(*given)
        except KernelError as failed:
            report_progress(self.progress, f"attempt {number} failed, the next one follows: {failed}", 1, 1)
            raise

    def timed(self, stage: str) -> AbstractContextManager[None]:
        return timed(self.seconds, stage, self.progress)

    def _filled(
        self, infill_at: Callable[[Point], Infill], phase: Point, points: Floats, road: Road, processes: int | None
    ) -> Outcome:
        infill, shift = infill_at(phase), np.array(phase) * self.cell_size
        try:
            made, cut, whole = taken(road, self, infill, processes)
        except KernelError as failed:
            if infill.min_thickness >= _THIN_WALL or all(region.surface for region in self.regions):
                raise
            thin = f"{infill.min_thickness:.3g} mm"
            raise KernelError(f"{failed}; the wall is {thin} where it is thinnest, too thin to be cut") from failed
        with self.timed("check"):
            for region in self.regions:
                self._require_right_size(infill, region, made[region.name], points)
            domains = {name: sorted(some, key=piece_size, reverse=True) for name, some in made.items() if some}
            if not domains:
                raise KernelError("nothing of the lattice lies in the part")
            self._require_simple(piece.shape for some in domains.values() for piece in some)
        return Outcome(domains, infill, shift, cut, whole, road != "booleans")

    def _require_right_size(self, infill: Infill, region: Region, made: list[Made], points: Floats) -> None:
        """Compare with an estimate that asks no boolean: how many of the points in the part lie in the region."""
        layer = 1.0
        if region.surface:
            layer = 2 * _SURFACE_LAYER * self.cell_size
            hits = int(np.sum(np.abs(infill.offsets(points)) < layer / 2))
        else:
            hits = int(np.sum(infill.contains(region, points)))
        box = float(np.prod(self.core.high - self.core.low)) / _ESTIMATE_POINTS / layer
        apart = self.hollow is None or region.fluid or self.shared
        skin = 0.0 if apart else self.part.volume - self.core.volume
        sizes = [piece_size(piece) for piece in made]
        if min(sizes, default=0.0) < -_INSIDE_OUT * sum(map(abs, sizes)):
            # Beside another that is too large it would not be seen in their sum.
            raise KernelError(f"a piece of the {region.name} is inside out")
        size = sum(sizes) - skin
        expected, deviation = hits * box, np.sqrt(hits + 1) * box
        if not abs(size - expected) <= _ESTIMATE_DEVIATIONS * deviation + _ESTIMATE_ERROR * expected:
            unit = "mm2" if region.surface else "mm3"
            raise KernelError(
                f"the kernel's {region.name} has {size:.6g} {unit}, where about {expected:.4g} {unit} are expected"
            )

    def _require_simple(self, shapes: Iterable[KernelShape]) -> None:

        # One by one: bodies that share a face have its edges four times.
        everything = compound_of(shapes)
        counted, valid = topology(everything), is_valid(everything)
        closed = counted.closed or all(region.surface for region in self.regions)
        if not (valid and closed):
            state = "valid" if valid else "invalid"
            raise KernelError(f"the kernel's filled part is {state}, with {counted.open_edges} open edges")


def without_specks(
    domains: dict[str, list[Made]], filling: FilledBy
) -> tuple[dict[str, list[Made]], tuple[SealedVoid, ...]]:
    """Return the solids of every domain without specks of void, and the voids that they enclose, the largest first.

    The part's own voids are none that filling sealed.

    Parameters
    ----------
    domains : dict
        As of :class:`Outcome`. What a wall leaves and the bare surface enclose nothing.
    filling : Filling
        That they come from.
    """
    least, voids = speck_below(filling.cell_size), []
    chosen = dict(domains)
    for name in (region.name for region in filling.regions if not (region.fluid or region.surface)):
        chosen[name] = []
        for made in domains.get(name, ()):
            sealed = sealed_shells(made.shape, filling.part.shape)
            voids += [SealedVoid(volume, place) for _, volume, place in sealed if volume >= least]
            specks = [shell for shell, volume, _ in sealed if volume < least]
            chosen[name].append(_without(made, specks) if specks else made)
    return {name: some for name, some in chosen.items() if some}, tuple(sorted(voids, key=lambda void: -void.volume))


def _without(made: Made, shells: Sequence[KernelShape]) -> Made:
    """A solid that is filled where some of its shells run round voids."""
    sizes = np.array([measure(shell) for shell in shells])
    volume, area = np.abs(sizes).sum(axis=0).tolist()
    return Made(without_shells(made.shape, shells), made.volume + volume, made.area - area)


def bodies_of(given: Any, solids: Sequence[str | int] = ()) -> tuple[list[tuple[str, Part]], list[str]]:
    """The closed, valid solids of whatever a user gives as a part, each by itself; those that overlap are united.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`fill`.
    solids : sequence of str or int
        Names or numbers of those that are wanted, if not all.

    Returns
    -------
    parts : list of (str, Part)
        Each with what to call it.
    remarks : list of str
        On what was repaired or united.

    Raises
    ------
    ParameterError
    ExportError
        If a file is neither STEP nor BREP, or holds no shape.
    """
    shapes, names, called = shapes_of(given)
    named = tuple(
        (face, name)
        for shape, some in zip(shapes, called, strict=True)
        for face, name in zip(faces_of(shape), some, strict=False)
        if name
    )
    separate, remarks = separate_solids(shapes, names, solid_names(solids))
    return [(name, replace(sound_part(solid), named_faces=named)) for name, solid in separate], remarks


def shapes_of(given: Any) -> tuple[Sequence[KernelShape], Sequence[Sequence[str]], Sequence[Sequence[str]]]:
    """The kernel's shapes of whatever a user gives as a part, unchecked, the names of each, and those of its faces."""
    if not isinstance(given, str | os.PathLike):
        shapes, names = named_shapes(given)
        return shapes, names, [[] for _ in shapes]
    if format_of(given) in TRIANGLE_FORMATS:
        raise ParameterError("part", str(given), 'a STEP or BREP file; triangles are filled by route="triangles"')
    return read_named(given)


def solid_names(solids: Sequence[str | int]) -> list[str | int]:
    """Names or numbers of the solids that are wanted, be it one alone."""
    return [solids] if isinstance(solids, str | int) else list(solids)


def part_of(given: Any) -> Part:
    """The same as one part."""
    parts, _ = bodies_of(given)
    return parts[0][1] if len(parts) == 1 else require_part(compound_of(part.shape for _, part in parts))

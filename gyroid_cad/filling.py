"""Fill a part from CAD with gyroid: the wall, one of the two labyrinths, or the space that the wall leaves."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.build import Progress, require_formats, require_settings, timed, write_shape
from gyroid_cad.checks import finite_number, positive_number
from gyroid_cad.complex import CellComplex
from gyroid_cad.covering import CROSSING, INSIDE, Frame, covering_complex, patch_sides, signed_offsets
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.fit import FitSettings, fit_patch
from gyroid_cad.limits import require_cell_size, require_density, require_thickness
from gyroid_cad.tube import LARGEST_DENSITY, offset_of_network, thickness_of_density
from gyroid_cad.wall import build_wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.part import Part
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["KINDS", "FillReport", "Filled", "fill"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
Point = tuple[float, float, float]

SHEET, NETWORK_A, NETWORK_B, CHANNELS = KINDS = ("sheet", "network-a", "network-b", "channels")
# Points on the boundary, in cell sizes: so far apart that the patches it crosses are told closely, and quickly.
_BOUNDARY_SPACING = 1 / 12
# Tangent or nearly coincident faces defeat the kernel; a shift that no symmetry knows parts them.
_PHASES = ((0.0, 0.0, 0.0), (0.0031, 0.0047, 0.0023), (-0.0053, 0.0029, 0.0071))
# An estimate of the volume from so many points; further off than so many of its deviations, something is wrong.
_ESTIMATE_POINTS, _ESTIMATE_DEVIATIONS = 4096, 6.0


@dataclass(frozen=True, slots=True)
class FillReport:
    """What a filled part turned out to be.

    Attributes
    ----------
    kind : str
    cell_size, thickness : float
        In mm; the wall, or for a labyrinth twice the distance of its border from the surface.
    solids, faces : int
    valid, closed : bool
        By the kernel's own check; every edge bounds exactly two faces.
    part_volume, volume : float
        In mm3.
    density : float
        Volume by that of the part.
    area : float
        Of the surface, in mm2.
    mass, part_mass : float, optional
        In g, for a material's density.
    islands : int
        Pieces besides the largest one of each domain.
    dropped : int
        Islands left out.
    cut_patches, whole_patches : int
        That the part's boundary may cross, and that lie wholly inside.
    shift : tuple of float
        Of the lattice, in mm, where the kernel did not manage without.
    seconds : dict
        By stage.
    """

    kind: str
    cell_size: float
    thickness: float
    solids: int
    faces: int
    valid: bool
    closed: bool
    part_volume: float
    volume: float
    density: float
    area: float
    mass: float | None
    part_mass: float | None
    islands: int
    dropped: int
    cut_patches: int
    whole_patches: int
    shift: Point
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)


@dataclass(frozen=True, slots=True, eq=False)
class Filled:
    """A filled part.

    Attributes
    ----------
    domains : dict
        Shape by name: "sheet", "network-a", "network-b", or "channel-a" and "channel-b".
    report : FillReport
    """

    domains: dict[str, KernelShape]
    report: FillReport

    def solid(self) -> KernelShape:
        """One TopoDS_Solid, or a TopoDS_Compound of all of them, under a handle of the caller's own."""
        from gyroid_cad.kernel.solid import another_handle
        from gyroid_cad.kernel.split import compound_of

        shapes = list(self.domains.values())
        return another_handle(shapes[0]) if len(shapes) == 1 else compound_of(shapes)

    def write(
        self,
        *paths: str | os.PathLike[str],
        schema: str = "ap214",
        deviation: float | None = None,
        angle: float = 15.0,
    ) -> None:
        """Write the filled part, as :meth:`gyroid_cad.Lattice.write` does a lattice.

        Raises
        ------
        ParameterError, ExportError
        """
        targets = require_formats(paths)
        usual = min(self.report.cell_size / 1000, (self.report.thickness or self.report.cell_size) / 10)
        limit = usual if deviation is None else finite_number("deviation", deviation)
        require_settings((1, 1, 1), schema, limit, angle)
        for path in targets:
            write_shape(self.solid(), path, schema, limit, angle, cut=True)


@dataclass(frozen=True, slots=True)
class _Region:
    """Space between two offsets of the mid-surface, in mm along its normal; None where there is no end."""

    name: str
    lowest: float | None
    highest: float | None

    def holds(self, offsets: Floats) -> Booleans:
        """Which offsets, in mm, lie between."""
        low = -np.inf if self.lowest is None else self.lowest
        high = np.inf if self.highest is None else self.highest
        return np.asarray((offsets > low) & (offsets < high))

    def bounds(self, faces: tuple[Any, Any]) -> list[Any]:
        """Those of a patch's two faces that bound it, oriented outwards."""
        below = [] if self.lowest is None else [faces[self.lowest >= 0].Reversed()]
        return below + ([] if self.highest is None else [faces[self.highest > 0]])


def fill(
    part: Any,
    cell_size: float,
    thickness: float | None = None,
    density: float | None = None,
    kind: str = SHEET,
    origin: Point = (0.0, 0.0, 0.0),
    rotation: Point = (0.0, 0.0, 0.0),
    fit: FitSettings | None = None,
    drop_islands: bool = False,
    material_density: float | None = None,
    progress: Progress | None = None,
) -> Filled:
    """Fill a part with gyroid: what is left is one exact B-rep, closed and valid.

    Parameters
    ----------
    part : shape, Workplane or path-like
        A TopoDS_Shape, a shape of CadQuery or build123d, or a STEP file; its solids must be closed and valid.
    cell_size : float
        Period of the cubic cell, in mm.
    thickness : float, optional
        Whole wall in mm; of the wall that is left, or that the channels leave.
    density : float, optional
        Volume fraction instead: of the wall, or of the labyrinth.
    kind : {"sheet", "network-a", "network-b", "channels"}
        The wall; one of the two labyrinths it parts; or both of them, the wall left out.
    origin, rotation : tuple of float
        Where the lattice's origin is, in mm, and its turns about the axes x, y, z one after the other, in degrees.
    fit : FitSettings, optional
    drop_islands : bool
        Whether to leave out pieces cut off from the largest one.
    material_density : float, optional
        In g/cm3, for the masses in the report.
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    Filled

    Raises
    ------
    ParameterError
    KernelError
        If the kernel fails, or gives something that is not closed, not valid, or of the wrong volume.
    """
    require_cell_size(finite_number("cell_size", cell_size, "a length in mm, a finite number"))
    if kind not in KINDS:
        raise ParameterError("kind", kind, " or ".join(KINDS))
    half, regions = _regions(kind, float(cell_size), thickness, density)
    frame = Frame(_vector("origin", origin), _turn(_vector("rotation", rotation)))
    grams = None if material_density is None else positive_number("material_density", material_density) / 1000
    filling = _Filling(part_of(part), float(cell_size), half, regions, fit or FitSettings(), drop_islands, progress)
    smallest = float(np.min(filling.part.high - filling.part.low))
    if smallest <= 2 * half:
        raise ParameterError("thickness", 2 * half, f"less than the part's smallest extent, {smallest:.6g} mm")
    return filling.run(kind, frame, grams)


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """A solid, with its volume and area, which the kernel takes long to find."""

    solid: KernelShape
    volume: float
    area: float


@dataclass(frozen=True, slots=True, eq=False)
class _Filling:
    """What stays the same however the lattice is shifted."""

    part: Part
    cell_size: float
    half: float
    regions: tuple[_Region, ...]
    fit: FitSettings
    drop_islands: bool
    progress: Progress | None
    seconds: dict[str, float] = field(default_factory=dict)

    def run(self, kind: str, frame: Frame, grams: float | None) -> Filled:
        """Fill, with the lattice a little shifted where the kernel does not manage otherwise."""
        points = np.random.default_rng(0).uniform(self.part.low, self.part.high, (_ESTIMATE_POINTS, 3))
        points = points[self.part.holds(points)]
        distance = self._distance_from_boundary()
        problem: KernelError | None = None
        for phase in _PHASES:
            shift = np.array(phase) * self.cell_size
            try:
                domains, sides = self._domains(replace(frame, origin=frame.origin + shift), points, distance)
                return self._reported(kind, domains, sides, shift, grams)
            except KernelError as failed:
                problem = problem or failed
        raise KernelError(f"{problem}; nor with the lattice shifted a little, twice")

    def _domains(
        self, frame: Frame, points: Floats, distance: Callable[[Floats], Floats]
    ) -> tuple[dict[str, list[_Measured]], Integers]:
        """The solids of each region, and how the patches lie."""
        from gyroid_cad.kernel.part import measure
        from gyroid_cad.kernel.split import bounded_solids, split

        with self.timed("cover"):
            complex = covering_complex(self.part.low, self.part.high, frame, self.cell_size, self.half)
            sides = patch_sides(complex, frame, self.cell_size, self.half, distance, self.part.holds)
        with self.timed("faces"):
            faces = self._faces(complex, frame)
        domains: dict[str, list[_Measured]] = {}
        for region in self.regions:
            cut, whole = (
                [face for patch in np.flatnonzero(sides == side).tolist() for face in region.bounds(faces[patch])]
                for side in (CROSSING, INSIDE)
            )
            with self.timed("split"):
                pieces = split(self.part, cut)

            def wanted_at(point: Floats, region: _Region = region) -> bool:
                return bool(region.holds(signed_offsets(complex, frame, self.cell_size, point[np.newaxis]))[0])

            with self.timed("join"):
                solids = bounded_solids(pieces, whole, wanted_at)
            with self.timed("check"):
                domains[region.name] = [_Measured(solid, *measure(solid)) for solid in solids]
        with self.timed("check"):
            offsets = signed_offsets(complex, frame, self.cell_size, points)
            self._require_right_volumes(domains, offsets)
        return domains, sides

    def _distance_from_boundary(self) -> Callable[[Floats], Floats]:
        from scipy.spatial import cKDTree

        with self.timed("cover"):
            samples, error = self.part.surface_samples(_BOUNDARY_SPACING * self.cell_size)
            tree = cKDTree(samples)
        return lambda points: np.asarray(tree.query(points)[0]) - error

    def _faces(self, complex: CellComplex, frame: Frame) -> list[tuple[Any, Any]]:
        from gyroid_cad.kernel.solid import realise_faces

        wall = build_wall(complex, fit_patch(self.fit), self.cell_size, 2 * self.half)
        return realise_faces(wall.moved(frame.rotation, frame.origin))

    def _require_right_volumes(self, domains: dict[str, list[_Measured]], offsets: Floats) -> None:
        """Compare with an estimate that asks no boolean: how many of the points in the part lie in the region."""
        box = float(np.prod(self.part.high - self.part.low))
        for region in self.regions:
            hits = int(np.sum(region.holds(offsets)))
            volume = sum(made.volume for made in domains[region.name])
            expected = hits / _ESTIMATE_POINTS * box
            deviation = np.sqrt(hits + 1) / _ESTIMATE_POINTS * box
            if not abs(volume - expected) <= _ESTIMATE_DEVIATIONS * deviation + 0.02 * expected:
                raise KernelError(
                    f"the kernel's {region.name} has {volume:.6g} mm3, where about {expected:.4g} mm3 are expected"
                )

    def _reported(
        self, kind: str, domains: dict[str, list[_Measured]], sides: Integers, shift: Floats, grams: float | None
    ) -> Filled:
        from gyroid_cad.kernel.check import is_valid, topology
        from gyroid_cad.kernel.part import measure
        from gyroid_cad.kernel.split import compound_of

        islands, dropped = sum(max(0, len(solids) - 1) for solids in domains.values()), 0
        if self.drop_islands and islands:
            islands, dropped = 0, islands
            domains = {name: [max(solids, key=lambda made: made.volume)] for name, solids in domains.items() if solids}
        shapes = {
            name: solids[0].solid if len(solids) == 1 else compound_of(made.solid for made in solids)
            for name, solids in domains.items()
            if solids
        }
        if not shapes:
            raise KernelError("nothing of the lattice lies in the part")
        everything = compound_of(shapes.values())
        with self.timed("check"):
            counted, valid = topology(everything), is_valid(everything)
            if not (valid and counted.closed):
                state = "valid" if valid else "invalid"
                raise KernelError(f"the kernel's filled part is {state}, with {counted.open_edges} open edges")
            # Of several solids the kernel's quadrature of all at once differs from the sum by 2e-9.
            made = [made for solids in domains.values() for made in solids]
            volume, area = (made[0].volume, made[0].area) if len(made) == 1 else measure(everything)
        return Filled(
            shapes,
            FillReport(
                kind=kind,
                cell_size=self.cell_size,
                thickness=2 * self.half,
                solids=counted.solids,
                faces=counted.faces,
                valid=valid,
                closed=counted.closed,
                part_volume=self.part.volume,
                volume=volume,
                density=volume / self.part.volume,
                area=area,
                mass=None if grams is None else grams * volume,
                part_mass=None if grams is None else grams * self.part.volume,
                islands=islands,
                dropped=dropped,
                cut_patches=int(np.sum(sides == CROSSING)),
                whole_patches=int(np.sum(sides == INSIDE)),
                shift=(float(shift[0]), float(shift[1]), float(shift[2])),
                seconds=dict(self.seconds),
            ),
        )

    def timed(self, stage: str) -> AbstractContextManager[None]:
        return timed(self.seconds, stage, self.progress)


def part_of(given: Any) -> Part:
    """The closed, valid solids of whatever a user gives as a part.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`fill`.

    Raises
    ------
    ParameterError
    ExportError
        If a file is no STEP file or holds no shape.
    """
    from gyroid_cad.kernel.part import require_part
    from gyroid_cad.kernel.split import compound_of
    from gyroid_cad.kernel.step import read_step

    if isinstance(given, str | os.PathLike):
        return require_part(read_step(given))
    if hasattr(given, "vals"):
        return require_part(compound_of(shape.wrapped for shape in given.vals()))
    shape = getattr(given, "wrapped", given)
    if not hasattr(shape, "ShapeType"):
        raise ParameterError("part", given, "a shape of the kernel, CadQuery or build123d, a Workplane, or a STEP file")
    return require_part(shape)


def _regions(
    kind: str, cell_size: float, thickness: float | None, density: float | None
) -> tuple[float, tuple[_Region, ...]]:
    """Half the wall in mm, and the regions that a kind is made of."""
    if (thickness is None) == (density is None):
        raise ParameterError(
            "thickness, density", {"thickness": thickness, "density": density}, "exactly one of the two"
        )
    if kind in (NETWORK_A, NETWORK_B):
        return _network(kind, cell_size, density)
    if thickness is not None:
        wall = finite_number("thickness", thickness, "a length in mm, a finite number")
        require_thickness(wall, cell_size)
    else:
        fraction = finite_number("density", density, "a volume fraction, a finite number")
        require_density(fraction, cell_size)
        wall = thickness_of_density(fraction) * cell_size
    half = wall / 2
    if kind == CHANNELS:
        return half, (_Region("channel-a", half, None), _Region("channel-b", None, -half))
    return half, (_Region(SHEET, -half, half),)


def _network(kind: str, cell_size: float, density: float | None) -> tuple[float, tuple[_Region, ...]]:
    low, high = (1 - LARGEST_DENSITY) / 2, (1 + LARGEST_DENSITY) / 2
    accepted = f"the labyrinth's volume fraction, above {low:.5f} and below {high:.5f}"
    fraction = finite_number("density", density, accepted)
    if not low < fraction < high:
        raise ParameterError("density", density, accepted)
    offset = offset_of_network(fraction) * cell_size
    region = _Region(kind, offset, None) if kind == NETWORK_A else _Region(kind, None, -offset)
    return abs(offset), (region,)


def _vector(parameter: str, value: Sequence[float]) -> Floats:
    accepted = "three finite numbers"
    try:
        numbers = [finite_number(parameter, number, accepted) for number in value]
    except TypeError:
        raise ParameterError(parameter, value, accepted) from None
    if len(numbers) != 3:
        raise ParameterError(parameter, value, accepted)
    return np.array(numbers)


def _turn(degrees: Floats) -> Floats:
    """Turns about x, then y, then z."""
    matrix = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees).tolist()):
        turn = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turn[[i, j], [i, j]] = np.cos(angle)
        turn[j, i], turn[i, j] = np.sin(angle), -np.sin(angle)
        matrix = turn @ matrix
    return matrix

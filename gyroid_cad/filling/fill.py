"""Fill a part from CAD with gyroid: the wall, one of the two networks, or the space that the wall leaves."""

from __future__ import annotations

import functools
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.cache import Cache
from gyroid_cad.common.choices import TARGETS, Kind, Route, SurfaceName
from gyroid_cad.common.progress import Progress, named_progress, report_progress
from gyroid_cad.errors import ParameterError, PartWarning
from gyroid_cad.fields.field import FieldLike
from gyroid_cad.filling.bodies import with_own_names
from gyroid_cad.filling.distance_skin import Shell
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.fillet import checked_fillet
from gyroid_cad.filling.forecast import require_cover
from gyroid_cad.filling.infill import Foreseen, InfillIn, described_infill
from gyroid_cad.filling.part import FilledBy, Filling, Outcome, bodies_of, part_of, without_specks
from gyroid_cad.filling.ports import ANY, OpenFaces, PortedFilling, checked_plug, open_faces, require_of_bodies
from gyroid_cad.filling.report import FillReport, joint_report, warn_of_uncovered
from gyroid_cad.filling.throats import fluid_of
from gyroid_cad.filling.triangle_part import naming_triangles, require_route
from gyroid_cad.filling.triangles import TRIANGLES, TriangleJob
from gyroid_cad.filling.wanted import (
    BODIES,
    NETWORK_A,
    NETWORK_B,
    SHEET,
    SURFACE,
    Region,
    checked_skin,
    grams_of,
    kind_beside,
)
from gyroid_cad.kernel.check import compound_of, topology
from gyroid_cad.kernel.depth import NamedFaces
from gyroid_cad.kernel.extent import solid_of_box
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.skin import Hollow, hollow_round
from gyroid_cad.kernel.skin import hollow as hollowed
from gyroid_cad.kernel.solid import KernelFace
from gyroid_cad.surface.families import surface_named
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.box import Box
from gyroid_cad.trim.clearance import NearMisses, clear_frame
from gyroid_cad.trim.islands import Islands, SealedVoid, island_rule, warn_caller, warn_of_voids, without_islands
from gyroid_cad.wall.covering import frame_of, placement
from gyroid_cad.wall.fitted import Closeness, valid_tolerance
from gyroid_cad.wall.laws import wall_from
from gyroid_cad.wall.limits import require_none_beside_lattice
from gyroid_cad.wall.parameters import LatticeParameters

__all__ = ["fill", "filled_block"]

# Blocks that were filled last.
_blocks: Cache[Hashable, Filled] = Cache()


def fill(
    part: Any,
    cell_size: float | None = None,
    thickness: FieldLike | None = None,
    density: FieldLike | None = None,
    kind: Kind = SHEET,
    origin: Point | None = None,
    rotation: Point = (0.0, 0.0, 0.0),
    fit: FitSettings | None = None,
    drop_islands: bool = False,
    material_density: float | None = None,
    progress: Progress | None = None,
    *,
    skin: float | None = None,
    openings: Sequence[Any] = (),
    plug: float | None = None,
    core: Any = None,
    fillet: float | None = None,
    tolerance: float | None = None,
    lattice: LatticeParameters | None = None,
    surface: SurfaceName = "gyroid",
    keep_islands: bool = False,
    solids: Sequence[str | int] = (),
    partial: bool = False,
    route: Route = "brep",
    deviation: float | None = None,
    repair: bool = False,
    compact: float | None = None,
    porosity: FieldLike | None = None,
    pore_size: float | None = None,
    throat: float | None = None,
    hydraulic_diameter: float | None = None,
    area_per_volume: float | None = None,
    curvature_radius: float | None = None,
) -> Filled:
    """Fill a part with gyroid, or another surface's lattice: what is left is one exact B-rep, closed and valid.

    Parameters
    ----------
    part : shape, Workplane or path-like
        A TopoDS_Shape, a shape or an assembly of CadQuery or build123d, or a STEP or BREP file. Its solids are filled
        each by itself. Those that overlap are united, and those that are open or invalid repaired where the kernel's
        tools can: the report says so, and a :class:`~gyroid_cad.PartWarning`.
    cell_size : float
        Period of the cubic cell, in mm.
    thickness : number or field, optional
        Whole wall in mm; of the wall that is left, or that the channels leave. As of :class:`gyroid_cad.Lattice`,
        with x, y and z places in the part's space.
    density : number or field, optional
        Volume fraction instead: of the wall, or of the network; where that varies, below a half.
    kind : {"sheet", "network-a", "network-b", "channels", "bodies", "surface"}
        The wall; one of the two networks it parts; both of them, the wall left out; the wall, both fluids and the skin,
        as bodies that share the faces between them; or the mid-surface alone. A lattice may have a kind of its own.
    origin, rotation : tuple of float
        Where the lattice's origin is, in mm, and its turns about the axes x, y, z one after the other, in degrees.
        Left out, and if no lattice is given, the origin is (0, 0, 0) or a few hundredths of a cell beside, where edges
        would come out too short for who receives the solid: the report says so.
    fit : FitSettings, optional
    drop_islands : bool
        Drop every island: pieces not connected to the largest one. If not, small ones are dropped, which have less
        than a hundredth of what one cell holds, and of the largest piece (of the bare surface, by area). The report
        counts what is left or dropped, and an :class:`~gyroid_cad.IslandsWarning` says so.
    material_density : float, optional
        In g/cm3, for the masses in the report.
    progress : callable, optional
        Called with (stage, done, total).
    skin : float, optional
        Thickness in mm of a solid shell kept from the part and fused with the infill; channels end at it.
    openings : sequence
        Where the skin is left open, so that resin or powder can leave: faces of the part, selectors such as ">Z" for
        the faces furthest that way, or points (x, y, z), each for the face next to it. Of bodies each may name the
        fluid it is for, as in "a:>Z" or ("a", face): the channels of the other end at the skin there.
    plug : float, optional
        Thickness in mm of the wall at which they end there, from the skin's, which it is if left out, to a cell's size;
        more than the skin's where faces are flat.
    core : shape, Workplane or path-like, optional
        Instead of a skin's thickness, the inner solid that is filled, as of ``part``: the skin is the part less the
        core, open wherever the core comes to the part's boundary.
    fillet : float, optional
        Radius in mm of the fillets where the infill meets the skin, at the route of triangles.
    tolerance : float, optional
        Largest deviation in cell sizes; 1e-4 of a graded wall if left out.
    lattice : Lattice, optional
        A block of cells with whatever varies in it, maps of space too, instead of an endless lattice: then cell
        size, thickness, density and surface are its own. It is placed by its own origin and rotation first. Cells are
        added round it until it covers the part, as far as its fields and its map go on.
    surface : {"gyroid", "diamond", "primitive"}
    keep_islands : bool
        Keep every island, however small.
    solids : sequence of str or int
        Which of the part's solids are filled: names that its file or assembly gives them, or numbers from 1. All of
        them if left out.
    partial : bool
        Fill what the given lattice reaches, even if that is not all of the part; the report says how much it is not.
    route : {"brep", "triangles"}
        Through exact solids; or through triangles alone, for what is printed: the part may be an STL, 3MF, OBJ or PLY
        file, and what comes out is no :class:`Filled` but :class:`~gyroid_cad.FilledTriangles`.
    deviation : float, optional
        Of the triangles of that route, in mm; of the other, :meth:`Filled.write` takes it.
    repair : bool
        Close a part of triangles that is open, at that route; the report says what was done.
    compact : float, optional
        Instead of ``tolerance`` or ``fit``, largest deviation in mm, met by as few control points as can be.
    porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius : optional
        Two of these and of ``cell_size``, ``thickness`` and ``density``, as of :class:`gyroid_cad.Lattice`; of channels
        and bodies the wall's.

    Returns
    -------
    Filled

    Raises
    ------
    ParameterError
    KernelError
        If the kernel fails, or gives something that is not closed, not valid, or of the wrong volume; or cannot
        offset the part by its skin.

    Examples
    --------
    >>> import cadquery as cq
    >>> from gyroid_cad import FitSettings, fill
    >>> block = cq.Workplane().box(4, 4, 4, centered=False)
    >>> filled = fill(block, cell_size=8, density=0.3, fit=FitSettings(5))
    >>> abs(filled.report.density - 0.3) < 0.01
    True
    """
    kind = kind_beside(None if lattice is None else lattice.kind, kind)
    values = (porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius)
    targets = {name: value for name, value in zip(TARGETS, values, strict=True) if value is not None}
    if lattice is not None:
        require_none_beside_lattice(targets)
    cell_size, thickness, density = wall_from(surface, kind, cell_size, thickness, density, targets)
    frame = frame_of(*placement((0.0, 0.0, 0.0) if origin is None else origin, rotation))
    grams = None if material_density is None else grams_of(material_density)
    shell = checked_skin(skin, openings, core, kind)
    require_of_bodies(kind, openings, drop_islands, route)
    rule = island_rule(keep_islands or kind == BODIES, drop_islands)
    closeness = Closeness(fit or FitSettings(), None if tolerance is None else valid_tolerance(tolerance), compact)
    chosen = surface_named(surface)
    require_route(route, deviation=deviation, repair=repair, fillet=fillet)
    radius = checked_fillet(fillet, shell, core)
    regions, size, settings, foreseen, infill_in = described_infill(
        kind, cell_size, thickness, density, closeness, lattice, chosen, partial
    )
    stopped = checked_plug(plug, shell, openings, size)
    if route == TRIANGLES:
        cover = functools.partial(require_cover, cell_size=size, control_points=settings.control_points)
        given = (cover if lattice is None else None, frame, rule, grams, deviation, progress)
        job = TriangleJob(kind, size, regions, infill_in, *given)
        # Not of the class, but with all of it that needs no B-rep.
        return job.filled(part, solids, repair, Shell(shell, openings, core, radius))  # type: ignore[return-value]
    report_progress(progress, "read", 0, 1)
    parts, remarks = bodies_of(part, solids)
    report_progress(progress, "read", 1, 1)
    if core is not None and len(parts) > 1:
        raise ParameterError("core", core, f"none of a part of {len(parts)} solids, unless solids chooses one")
    for remark in remarks:
        warn_caller(remark, PartWarning)
    naming = [functools.partial(naming_triangles, kind, name if len(parts) > 1 else "") for name, _ in parts]
    wanted = _Wanted(kind, regions, size, shell, stopped, core, infill_in, foreseen)
    fillings, made, islands = [], [], Islands()
    for (name, whole), faces, named in zip(parts, open_faces(parts, openings), naming, strict=True):
        with named():
            fillings.append(
                wanted.filling(whole, faces, progress if len(parts) == 1 else named_progress(progress, name))
            )
    clear = frame
    if origin is None and lattice is None:
        every = tuple(fillings)
        clear = clear_frame(
            lambda place, within: NearMisses.joined([one.near_misses(place, within) for one in every]), frame, size
        )
    for filling, named in zip(fillings, naming, strict=True):
        with named():
            outcome = filling.run(clear)
        outcome = replace(outcome, shift=outcome.shift + clear.origin - frame.origin)
        domains, left = without_islands(outcome.domains, filling.cells, rule)
        voids: tuple[SealedVoid, ...] = ()
        if kind != BODIES:
            domains, voids = without_specks(domains, filling)
        made.append(_reported(filling, replace(outcome, domains=domains), left, voids, kind, grams))
        islands += left
    islands.warn("" if kind == BODIES else "drop_islands drops")
    together = _together(made, remarks)
    warn_of_voids(together.report.voids)
    warn_of_uncovered(together.report.uncovered)
    return together


def filled_block(lattice: LatticeParameters, progress: Progress | None = None) -> Filled:
    """The block of cells of a lattice as the box that it is, filled with the lattice; the last few are remembered.

    Parameters
    ----------
    lattice : LatticeParameters
        Trimmed.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError, SelfIntersectionError, FitError, KernelError
    """

    def made() -> Filled:
        axes, origin = lattice.spec().frame.rotation, lattice.spec().frame.origin
        low = origin @ axes
        box = Box(axes, low, low + np.array(lattice.cells) * lattice.cell_size)
        return fill(solid_of_box(box), lattice=lattice, keep_islands=lattice.keep_islands, progress=progress)

    return _blocks.get((lattice.spec(), lattice.kind, lattice.density), made)


@dataclass(frozen=True, slots=True, eq=False)
class _Wanted:
    """Lattice, skin and core that every solid of a part is filled with."""

    kind: Kind
    regions: tuple[Region, ...]
    cell_size: float
    skin: float | None
    plug: float | None
    core: Any
    infill_in: InfillIn
    foreseen: Foreseen

    def filling(self, part: Part, opened: OpenFaces, progress: Progress | None) -> Filling | PortedFilling:
        """The filling of a solid, once what it takes has been said."""
        forecast = self.foreseen(part)
        report_progress(progress, str(forecast), 0, round(forecast.seconds))
        fillings = {fluid: self._one(part, fluid, opened, progress) for fluid in opened}
        return fillings[ANY] if ANY in fillings else PortedFilling(fillings)

    def _one(self, part: Part, fluid: str, opened: OpenFaces, progress: Progress | None) -> Filling:
        others = [face for other, faces in opened.items() if other != fluid for face in faces]
        hollow = _hollow(part, self.skin, opened[fluid], self.core, others, self.plug)
        inner = part if hollow is None else hollow.core
        regions = self.regions if fluid == ANY else tuple(one for one in self.regions if one.name == fluid)
        shared = self.kind == BODIES and fluid == ANY
        infill = functools.partial(self.infill_in, inner)
        return Filling(part, hollow, regions, infill, self.cell_size, progress, shared, tuple(opened[fluid]))


def _hollow(
    part: Part,
    skin: float | None,
    openings: Sequence[KernelFace],
    core: Any,
    plugged: Sequence[KernelFace],
    plug: float | None,
) -> Hollow | None:
    """The part in skin and core, if it has a skin."""
    if core is None:
        return None if skin is None else hollowed(part, skin, openings, plugged, plug)
    try:
        inner = part_of(core)
    except ParameterError as refused:
        raise ParameterError("core", refused.value, refused.accepted) from None
    return hollow_round(part, inner)


def _together(filled: Sequence[Filled], remarks: Sequence[str]) -> Filled:
    """Bodies that were filled each by itself, as one."""
    report = joint_report([one.report for one in filled], remarks)
    if len(filled) == 1:
        return replace(filled[0], report=report)
    names = dict.fromkeys(name for one in filled for name in one.domains)
    return Filled(
        {name: compound_of(one.domains[name] for one in filled if name in one.domains) for name in names},
        report,
        {name: tuple(size for one in filled for size in one.sizes.get(name, ())) for name in names},
        {name: tuple(called for one in filled for called in one.face_names.get(name, ())) for name in names},
    )


def _reported(
    filling: FilledBy,
    outcome: Outcome,
    islands: Islands,
    voids: tuple[SealedVoid, ...],
    kind: Kind,
    grams: float | None,
) -> Filled:
    domains = outcome.domains
    skin = None if filling.hollow is None else filling.hollow.thickness
    shapes = {
        name: some[0].shape if len(some) == 1 else compound_of(made.shape for made in some)
        for name, some in domains.items()
    }
    counted = topology(compound_of(shapes.values()))
    # Beside a wall the fluids are no material.
    fluids = {region.name for region in filling.regions if region.fluid} if kind == BODIES else set()
    material = [made for name, some in domains.items() if name not in fluids for made in some]
    volume = sum(made.volume for made in material)
    walls = [outcome.infill.min_thickness] if kind not in (NETWORK_A, NETWORK_B, SURFACE) else []
    x, y, z = outcome.shift.tolist()
    reports = tuple(fluid_of(name, some, filling, outcome) for name, some in domains.items() if name in fluids)
    report = FillReport(
        kind=kind,
        cell_size=filling.cell_size,
        thickness=outcome.infill.max_thickness,
        min_wall=min([*walls, *([] if skin is None else [skin])], default=None),
        skin=skin,
        solids=counted.solids,
        faces=counted.faces,
        valid=True,
        closed=counted.closed,
        part_volume=filling.part.volume,
        volume=volume,
        density=volume / filling.part.volume,
        area=sum(made.area for made in material),
        mass=None if grams is None else grams * volume,
        part_mass=None if grams is None else grams * filling.part.volume,
        islands=islands.kept,
        islands_volume=islands.kept_volume,
        dropped=islands.dropped,
        dropped_volume=islands.dropped_volume,
        voids=voids,
        cut_patches=outcome.cut,
        whole_patches=outcome.whole,
        by_sections=outcome.by_sections,
        shift=(x, y, z),
        seconds=dict(filling.seconds),
        cells_alike=outcome.infill.grading.cells_alike,
        uncovered=outcome.infill.uncovered,
        volumes={name: sum(made.volume for made in some) for name, some in domains.items()},
        fluids=reports,
    )
    sizes = {name: tuple(made.size for made in some) for name, some in domains.items()}
    own = NamedFaces(filling.part.named_faces)
    face_names = {
        name: tuple(called for made in some for called in with_own_names(made, own)) for name, some in domains.items()
    }
    return Filled(shapes, report, sizes, face_names)

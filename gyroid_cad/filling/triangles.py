"""A part filled with triangles alone: no solid of the kernel's is made, cut or meshed but the part itself."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.choices import Kind, Route
from gyroid_cad.common.formats import STL, THREE_MF, TRIANGLE_FORMATS, format_of, require_formats
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import KernelError, ParameterError, PartWarning
from gyroid_cad.filling.distance_skin import Shell, opened_facets, without_small_voids
from gyroid_cad.filling.fillet import require_narrower, rounded
from gyroid_cad.filling.infill import Infill, InfillIn
from gyroid_cad.filling.report import FillReport, joint_report, warn_of_uncovered
from gyroid_cad.filling.triangle_part import TrianglePart, require_deviation, triangle_part
from gyroid_cad.filling.wanted import NETWORK_A, NETWORK_B, SHEET, SURFACE, Region
from gyroid_cad.mesh.triangles.booleans import Body, body_of, united
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.stl import is_coarse, require_near_origin
from gyroid_cad.mesh.triangles.storing import joined_meshes, storable_triangles, without_chips
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.mesh.triangles.writing import write_triangles
from gyroid_cad.render.notebook import MimeBundle, mime_bundle, triangles_picture
from gyroid_cad.render.picture import CAMERA, SIZE, require_view
from gyroid_cad.trim.islands import (
    IslandRule,
    Islands,
    SealedVoid,
    speck_below,
    warn_caller,
    warn_of_voids,
    without_islands,
)
from gyroid_cad.wall.covering import Frame
from gyroid_cad.wall.grading import THINNEST_WALL

__all__ = ["TRIANGLES", "FilledTriangles", "TriangleFilling", "TriangleJob"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

TRIANGLES: Route = "triangles"
# The usual deviation in parts of the cell size and of the wall: finer than printers are, and a quarter of the triangles
# that the exact solids' usual one would take.
_USUAL, _USUAL_OF_WALL = 250, 20
# Of the deviation, the wall of a network whose border is the mid-surface itself: there it is cut out and not missed.
_SEAM = 0.05
# Of the deviation, how far vertices may move that are of no use to the shape, so that there are fewer.
_SIMPLER = 0.05
# Vertices of a piece that tell on which side of the mid-surface it lies.
_ASKED = 24


@dataclass(frozen=True, slots=True, eq=False)
class FilledTriangles:
    """A filled part, by its triangles.

    Attributes
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Numbers of vertices, counterclockwise seen from outside.
    report : FillReport

    Examples
    --------
    >>> import cadquery as cq
    >>> from gyroid_cad import fill
    >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, route="triangles", deviation=0.05)
    >>> filled.report.closed, filled.triangles.shape[1]
    (True, 3)
    """

    vertices: Floats
    triangles: Integers
    report: FillReport

    def write(self, *paths: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write STL, 3MF, OBJ or PLY, by each path's ending; a file appears whole and closed or not at all.

        Raises
        ------
        ParameterError, ExportError

        Examples
        --------
        >>> import cadquery as cq
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, route="triangles", deviation=0.05)
        >>> filled.write("light.stl")
        """
        targets = require_formats(paths, TRIANGLE_FORMATS)
        box = np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])
        for path in targets:
            if format_of(path) in (STL, THREE_MF):
                require_near_origin(path, box, self.report.deviation or 0.0)
        for path in targets:
            with timed(self.report.seconds, f"write {path.name}", progress):
                write_triangles(self.vertices, self.triangles, path)

    def picture(self, size: tuple[int, int] = SIZE, camera: Point = CAMERA) -> bytes:
        """The filled part drawn, as a PNG file, as :meth:`gyroid_cad.Lattice.picture` draws a lattice.

        Raises
        ------
        ParameterError

        Examples
        --------
        >>> import cadquery as cq
        >>> filled = fill(cq.Workplane().box(4, 4, 4), cell_size=8, density=0.3, route="triangles", deviation=0.05)
        >>> filled.picture(size=(120, 100))[1:4]
        b'PNG'
        """
        return triangles_picture(self.vertices, self.triangles, *require_view(size, camera))

    def _repr_mimebundle_(self, include: object = None, exclude: object = None) -> MimeBundle:
        return mime_bundle("filled part", self.report.rows, self.picture)

    def __str__(self) -> str:
        return str(self.report)


@dataclass(frozen=True, slots=True, eq=False)
class TriangleFilling:
    """Body of a part to be filled, and the lattice that fills it.

    Attributes
    ----------
    part : Body
    core : Body, optional
        What of it is filled, if not all: it may reach beyond the part where a skin is open.
    regions : tuple of Region
    infill : Infill
    deviation : float
        Of triangles from the lattice, in mm.
    fillet, skin : float, optional
        Radius where the lattice meets the skin, and how thin that is at least, in mm.
    progress : callable, optional
    seconds : dict
        By stage.
    """

    part: Body
    core: Body | None
    regions: tuple[Region, ...]
    infill: Infill
    deviation: float
    fillet: float | None
    skin: float | None
    progress: Progress | None
    seconds: dict[str, float]

    def domains(self) -> dict[str, Body]:
        """The body of every region.

        Raises
        ------
        KernelError
            If the wall's triangles are no manifold, or nothing of the lattice lies in the part.
        """
        with timed(self.seconds, "triangles", self.progress):
            wall = self._wall()
        with timed(self.seconds, "cut", self.progress):
            part, core = self._placed(self.part), None if self.core is None else self._placed(self.core)
            if self.regions[0].name == SHEET:
                sheet = part & wall if core is None else part - self._rounded(core - wall, part, core)
                found: dict[str, Body] = {SHEET: sheet}
            else:
                found = self._between(part, core, wall)
        if all(body.empty for body in found.values()):
            raise KernelError("nothing of the lattice lies in the part")
        return {name: body for name, body in found.items() if not body.empty}

    @property
    def middle(self) -> Floats:
        """Point that is brought to the origin, where single precision is finest, in mm; shape (3,)."""
        return np.asarray(self.part.bounds.mean(axis=0))

    def _placed(self, body: Body) -> Body:
        return body.moved(-self.middle).tolerant(_SIMPLER * self.deviation)

    def _wall(self) -> Body:
        wall = self.infill.wall.moved(np.eye(3), -self.middle)
        body = body_of(*indexed_triangles(triangulated(wall, self.deviation)))
        if body is None:
            raise KernelError("the triangles of the lattice's wall are no closed manifold")
        return body

    def _between(self, part: Body, core: Body | None, wall: Body) -> dict[str, Body]:
        """Networks or channels: pieces that the wall leaves, by the side of it that they are on."""
        left = (part if core is None else core) - wall
        pieces = (self._rounded(left, part, core) if self.regions[0].fluid else left).pieces()
        above = self._above(pieces)
        found = {}
        for region in self.regions:
            own, others = (
                united(piece for piece, on_side in zip(pieces, above, strict=True) if on_side == side)
                for side in (region.highest is None, region.highest is not None)
            )
            # A network with more than its half of space has the wall too.
            if region.fluid or (core is None and region.end >= 0):
                found[region.name] = own & part
            else:
                void = others if region.end < 0 or core is None else core - own
                found[region.name] = part - self._rounded(void, part, core)
        return found

    def _rounded(self, void: Body, part: Body, core: Body | None) -> Body:
        """Space that a lattice leaves, its corners along the skin filled if they are to be."""
        if core is None or self.fillet is None:
            return void
        with timed(self.seconds, "fillet", self.progress):
            return rounded(void, part, core, self.skin, self.fillet, self.deviation)

    def _above(self, pieces: Sequence[Body]) -> list[bool]:
        """Tell which pieces lie on the side of the mid-surface that its normals point to, by the vertices of each."""
        places = [np.empty((0, 3))]
        for piece in pieces:
            vertices = piece.triangles()[0]
            places.append(vertices[np.linspace(0, len(vertices) - 1, _ASKED).astype(int)])
        offsets = self.infill.offsets(np.concatenate(places) + self.middle).reshape(-1, _ASKED)
        furthest = np.take_along_axis(offsets, np.abs(offsets).argmax(axis=1)[:, np.newaxis], axis=1)
        return [bool(offset > 0) for offset in furthest[:, 0]]


@dataclass(frozen=True, slots=True, eq=False)
class TriangleJob:
    """Lattice and fineness that a part is filled with, by triangles.

    Attributes
    ----------
    kind : str
    cell_size : float
        In mm.
    regions : tuple of Region
    infill_in : callable
        The lattice for a part, in a frame.
    cover : callable, optional
        Checks that there is memory for the cells that cover a box, given its corners.
    frame : Frame
    rule : IslandRule
    grams : float, optional
        That a mm3 of the material weighs.
    deviation : float, optional
        In mm.
    progress : callable, optional
    """

    kind: Kind
    cell_size: float
    regions: tuple[Region, ...]
    infill_in: InfillIn
    cover: Callable[[Floats, Floats], None] | None
    frame: Frame
    rule: IslandRule
    grams: float | None
    deviation: float | None
    progress: Progress | None

    def filled(self, given: Any, solids: Sequence[str | int], repair: bool, shell: Shell) -> FilledTriangles:
        """The part filled, each of its bodies by itself.

        Raises
        ------
        ParameterError, KernelError, ExportError
        """
        if self.kind == SURFACE:
            raise ParameterError("kind", self.kind, "one that bounds a volume to print: a bare surface has none")
        require_deviation(self.deviation, self.cell_size)
        seconds: dict[str, float] = {}
        with timed(seconds, "part", self.progress):
            whole = triangle_part(given, solids, self._fineness, repair, closely=self.deviation is None)
            opened = None if shell.skin is None else opened_facets(whole, shell.openings)
        for remark in whole.remarks:
            warn_caller(remark, PartWarning)
        parts = whole.bodies()
        if shell.core is not None and len(parts) > 1:
            raise ParameterError(
                "core", shell.core, f"none of a part of {len(parts)} bodies, unless solids chooses one"
            )
        places, reports, islands = [], [], Islands()
        for part in parts:
            own = opened if opened is None or len(parts) == 1 else opened_facets(part, shell.openings)
            made, report, left = self._body(part, shell, own, seconds)
            places.append(made)
            reports.append(report)
            islands += left
        islands.warn("drop_islands drops")
        report = joint_report(reports, whole.remarks)
        warn_of_voids(report.voids)
        warn_of_uncovered(report.uncovered)
        return FilledTriangles(*joined_meshes(places), report)

    @property
    def _fineness(self) -> float:
        """Deviation of the part's triangles, in mm."""
        return self.deviation or self.cell_size / _USUAL

    def _body(
        self, part: TrianglePart, shell: Shell, opened: Booleans | None, before: dict[str, float]
    ) -> tuple[tuple[Floats, Integers], FillReport, Islands]:
        """Triangles of one body filled, their report, and what islands there were."""
        seconds = dict(before)
        before.clear()
        with timed(seconds, "skin", self.progress):
            core, skin = shell.core_of(part, opened, self._fineness)
            inner = part if core is None else replace(core, body=core.body & part.body)
        if self.cover is not None:
            self.cover(inner.low, inner.high)
        network = self.kind in (NETWORK_A, NETWORK_B)
        least = max(_SEAM * self._fineness, THINNEST_WALL) if network else 0.0
        infill = self.infill_in(inner, self.frame, lambda stage: timed(seconds, stage, self.progress), least)
        wall = self.cell_size if network else infill.max_thickness
        deviation = self.deviation or min(self._fineness, wall / _USUAL_OF_WALL)
        if shell.fillet is not None:
            require_narrower(shell.fillet, infill, self.regions)
        bodies = part.body, None if core is None else core.body
        filling = TriangleFilling(*bodies, self.regions, infill, deviation, shell.fillet, skin, self.progress, seconds)
        domains = filling.domains()
        with timed(seconds, "check", self.progress):
            pieces = {name: body.pieces() for name, body in domains.items()}
            kept, islands = without_islands(pieces, inner.body.volume / self.cell_size**3, self.rule)
            whole = [piece for some in kept.values() for piece in some]
            speck = speck_below(self.cell_size)
            left, voids = [[piece] for piece in whole], list[SealedVoid]()
            if not any(region.fluid for region in self.regions):
                left, voids = without_small_voids(whole, part.body, filling.middle, speck)
            shells = [shell for shells in left for shell in shells]
            made, solids = _stored(shells, filling.middle, deviation, speck)
        return made, self._report(filling, shells, islands, voids, skin, solids, len(made[1])), islands

    def _report(
        self,
        filling: TriangleFilling,
        shells: Sequence[Body],
        islands: Islands,
        voids: Sequence[SealedVoid],
        skin: float | None,
        solids: int,
        count: int,
    ) -> FillReport:
        infill, part = filling.infill, filling.part
        volume = sum(shell.volume for shell in shells)
        walls = [] if self.kind in (NETWORK_A, NETWORK_B) else [infill.min_thickness]
        return FillReport(
            kind=self.kind,
            cell_size=self.cell_size,
            thickness=infill.max_thickness,
            min_wall=min([*walls, *([] if skin is None else [skin])], default=None),
            skin=skin,
            solids=solids,
            faces=count,
            valid=True,
            closed=True,
            part_volume=part.volume,
            volume=volume,
            density=volume / part.volume,
            area=sum(shell.area for shell in shells),
            mass=None if self.grams is None else self.grams * volume,
            part_mass=None if self.grams is None else self.grams * part.volume,
            islands=islands.kept,
            islands_volume=islands.kept_volume,
            dropped=islands.dropped,
            dropped_volume=islands.dropped_volume,
            voids=tuple(voids),
            cut_patches=infill.complex.patch_count,
            whole_patches=0,
            by_sections=False,
            shift=(0.0, 0.0, 0.0),
            seconds=filling.seconds,
            cells_alike=infill.grading.cells_alike,
            uncovered=infill.uncovered,
            route=TRIANGLES,
            deviation=filling.deviation,
        )


def _stored(
    shells: Sequence[Body], middle: Floats, deviation: float, speck: float
) -> tuple[tuple[Floats, Integers], int]:
    """Vertices and triangles of all shells where they stand, as files can hold them, and how many bound solids."""
    vertices, triangles = joined_meshes([shell.triangles() for shell in shells])
    vertices = vertices + middle
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    # Where single precision is too coarse only files are written that have more.
    single = not is_coarse(float(np.abs(vertices).max()), size, deviation)
    stored = storable_triangles(vertices, triangles, single)
    vertices, triangles, solids = without_chips(*stored, len(shells), speck)
    return (vertices, triangles), solids

"""One cell and the places where it stands, instead of one solid of all of them: files of a few bytes a cell."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from math import prod
from typing import Any

import numpy as np

from gyroid_cad.builds.solid import Build, build
from gyroid_cad.common.choices import Schema
from gyroid_cad.common.formats import STEP, require_formats
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress
from gyroid_cad.common.tables import Rows, cells_shown, text_table, volume_shown, wall_shown
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.kernel.assembly import GREEN, RED, YELLOW, NamedFace, NamedPart, Place, write_assembly
from gyroid_cad.kernel.solid import faces_by_patch
from gyroid_cad.step.header import StepHeader
from gyroid_cad.wall.areas import joint_size
from gyroid_cad.wall.fitted import LatticeSpec

__all__ = ["Assembly", "AssemblyReport", "assembly"]

PART_NAME = "CC"
# Peak memory of an occurrence in the kernel's document and its writer, as measured, rounded up.
_BYTES_PER_INSTANCE = 10_000


@dataclass(frozen=True, slots=True, eq=False)
class Assembly:
    """A cell as a closed solid of its own, and the block that its translates make up.

    Every cell ends in side walls of its own: neighbours touch in them and are not fused.

    Attributes
    ----------
    cells : tuple of int
        How often the cell stands along x, y, z.
    cell_size : float
        How far apart, in mm.
    cell : Build
        Of the one cell, with its solid.
    """

    cells: tuple[int, int, int]
    cell_size: float
    cell: Build

    def places(self) -> Iterator[Place]:
        """Name, ``CC_i_j_k`` counted from 1, and translation in mm of every cell."""
        axes = self.cell.fitted.spec.frame.rotation
        for x, y, z in np.ndindex(self.cells):
            a, b, c = (axes @ np.array([x, y, z]) * self.cell_size).tolist()
            yield f"{PART_NAME}_{x + 1}_{y + 1}_{z + 1}", (a, b, c)

    def part(self) -> NamedPart:
        """The cell with names and colours of its faces.

        As in the paper's Fig. 11 a semi-fundamental patch (SFP) is yellow, the bounding cell (BC) it belongs to
        red and the cubic cell (CC) green. A face is called ``BC_b_SFP_p_side_s``, with side 0 or 1 of the wall, or
        ``BC_b_SFP_p_edge_k`` where it goes through the wall along edge k of the patch.
        """

        solid, complex = self.cell.solid(), self.cell.fitted.complex
        bounding_cell = complex.placements.bounding_cell[complex.patch_placement].tolist()
        free = complex.free[complex.patch_edges]
        faces = []
        for patch, some in enumerate(faces_by_patch(solid, self.cell.fitted.wall)):
            group = bounding_cell[patch]
            colour = YELLOW if patch == 0 else RED if group == bounding_cell[0] else GREEN
            name = f"BC_{group + 1}_SFP_{bounding_cell[:patch].count(group) + 1}"
            kinds = ["side_0", "side_1", *(f"edge_{k + 1}" for k in np.flatnonzero(free[patch]))]
            faces += [NamedFace(face, f"{name}_{kind}", colour) for face, kind in zip(some, kinds, strict=True)]
        return NamedPart(solid, PART_NAME, GREEN, faces, joint_size(self.cell.sizes))

    def report(self, thickness: float, density: float, volume_exact: float) -> AssemblyReport:
        """Report on the assembly.

        Parameters
        ----------
        thickness, density, volume_exact : float
            Of the exact lattice.
        """
        count = prod(self.cells)
        return AssemblyReport(
            cells=self.cells,
            cell_size=self.cell_size,
            thickness=thickness,
            density=density,
            instances=count,
            faces=self.cell.topology.faces,
            valid=self.cell.valid(),
            closed=self.cell.topology.closed,
            volume=count * self.cell.volume,
            volume_exact=volume_exact,
            area=count * self.cell.area(),
            seconds=dict(self.cell.seconds),
        )

    def write(
        self,
        *paths: str | os.PathLike[str],
        schema: Schema = "ap214",
        progress: Progress | None = None,
        author: str = "",
        organisation: str = "",
        pcurves: bool = False,
    ) -> None:
        """Write STEP assemblies. A file appears whole or not at all.

        Parameters
        ----------
        *paths : path-like
            Ending in .step or .stp. All are checked before any is written.
        schema : {"ap214", "ap242"}
        progress : callable, optional
            Called with (stage, done, total).
        author, organisation : str
            For the files' headers.
        pcurves : bool
            As of :meth:`gyroid_cad.Lattice.write`.

        Raises
        ------
        ParameterError
            If a file's ending is none of STEP's, or memory would not do.
        KernelError
            If the kernel finds the cell invalid: then nothing is written.
        ExportError
        """

        targets, header = require_formats(paths, [STEP]), StepHeader(schema, author, organisation, pcurves)
        require_memory(self.cells, _BYTES_PER_INSTANCE)
        if not self.cell.valid(progress):
            raise KernelError("the kernel finds the solid of one cell invalid; nothing was written")
        part = self.part()
        for path in targets:
            with self.cell.timed(f"write {path.name}", progress):
                write_assembly(part, self.places(), path, header)


@dataclass(frozen=True, slots=True)
class AssemblyReport:
    """Report on an assembly: its cells, faces, volume and file.

    Attributes
    ----------
    cells : tuple of int
    cell_size, thickness : float
        In mm.
    density : float
        Volume fraction.
    instances : int
        How often the cell stands in it.
    faces : int
        Of the cell.
    valid, closed : bool
        The cell, by the kernel's own check; every edge bounds exactly two faces.
    volume, volume_exact : float
        In mm3, of all cells: enclosed by the kernel's faces, and by the tube formula.
    area : float
        In mm2, of all that bounds the cells, each by itself.
    seconds : dict
        By stage.
    """

    cells: tuple[int, int, int]
    cell_size: float
    thickness: float
    density: float
    instances: int
    faces: int
    valid: bool
    closed: bool
    volume: float
    volume_exact: float
    area: float
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed."""
        state = f"{'valid' if self.valid else 'invalid'} and {'closed' if self.closed else 'open'}"
        return [
            ("cells", cells_shown(self.cells, self.cell_size)),
            ("wall", wall_shown(self.thickness, self.thickness, self.thickness, self.density)),
            ("instances", f"{self.instances:,} of one {state} solid of {self.faces} faces, not fused"),
            ("volume", volume_shown(self.volume, self.volume_exact)),
            ("area", f"{self.area:.8g} mm2"),
        ]

    def __str__(self) -> str:
        return text_table(self.rows())


def assembly(spec: LatticeSpec, progress: Progress | None = None) -> Assembly:
    """The assembly of a lattice of whole cells that are all alike.

    Parameters
    ----------
    spec : LatticeSpec
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If its cells differ, or are cut.
    FitError, KernelError
        As of the solid of one cell.
    """
    if not spec.grading.uniform or spec.trimmed:
        raise ParameterError(
            "instances", True, "a lattice whose cells are uniform and not trimmed: its one cell stands for all"
        )
    one = build(replace(spec, cells=(1, 1, 1)), progress)
    return Assembly(spec.cells, spec.grading.cell_size, one)

"""A checked solid and its files, made stage by stage, timed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from math import prod
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.cache import Cache
from gyroid_cad.common.choices import CheckedBy
from gyroid_cad.common.formats import BREP, FILE_BYTES_PER_CELL, STEP, STL, format_of
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.progress import Progress, report_progress, timed
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.check import compound_of, enclosed_volume, is_valid, topology
from gyroid_cad.kernel.solid import KernelShape, another_handle, build_solid
from gyroid_cad.kernel.step import write_step
from gyroid_cad.kernel.stl import closed_triangles, write_meshed_stl
from gyroid_cad.kernel.trimmed import build_trimmed
from gyroid_cad.mesh.triangles.writing import write_triangles
from gyroid_cad.step.header import StepHeader
from gyroid_cad.step.products import UNLABELLED, BodyLabels
from gyroid_cad.trim.box import Box, cut_to_box
from gyroid_cad.trim.islands import Islands, island_rule, islands_of, kept_pieces
from gyroid_cad.wall.areas import ShapeSize, joint_size, piece_sizes
from gyroid_cad.wall.covering import PERTURBATIONS, first_success
from gyroid_cad.wall.fitted import FittedWall, LatticeSpec, fitted_wall

__all__ = ["Build", "build", "write_shape"]

Floats = NDArray[np.float64]

# Peak memory a cell, as benchmarks/memory.py measures it, rounded up.
_SOLID_BYTES_PER_CELL = 1_500_000
# Volume in the kernel against that of the nets it was given: rounding only.
_VOLUME_AGREEMENT = 1e-9
# Of cut cells against whole ones: how closely the section curves are fitted.
_BOXED_VOLUME_AGREEMENT = 1e-5


class Build:
    """A lattice's solid, checked closed and full, with the seconds each stage took.

    Attributes
    ----------
    fitted : FittedWall
        The wall it is made of.
    topology : Topology
    volume : float
        In mm3, from the control points the kernel holds.
    patches : int
    islands : Islands
        Of a lattice that was cut.
    shift : tuple of float
        Of the lattice in its box, along its own axes, in mm, where it could not be cut without.
    seconds : dict
        By stage.
    """

    checked_by: CheckedBy = "kernel"

    def __init__(self, fitted: FittedWall, progress: Progress | None) -> None:
        self.fitted = fitted
        self.seconds = dict(fitted.seconds)
        self._valid: bool | None = None
        self.shift = (0.0, 0.0, 0.0)
        self.islands = Islands()
        self._cut: list[ShapeSize] = []
        self._require_memory(_SOLID_BYTES_PER_CELL)
        wall = fitted.wall
        if fitted.spec.trimmed:
            self._shape, self.volume, self.patches = first_success(
                partial(self._trimmed, np.array(phase) * fitted.spec.grading.cell_size, progress)
                for phase in PERTURBATIONS
            )
            expected, agreement = self._volume_in_box(), _BOXED_VOLUME_AGREEMENT
        else:
            with self.timed("solid", progress):
                self._shape = build_solid(wall, lambda done, total: report_progress(progress, "solid", done, total))
            self.volume, self.patches = enclosed_volume(self._shape), fitted.complex.patch_count
            expected, agreement = wall.volume(), _VOLUME_AGREEMENT
        with self.timed("check", progress):
            self.topology = topology(self._shape)
            self._require_closed_and_full(self.volume + self.islands.dropped_volume, expected, agreement)

    @property
    def cells(self) -> tuple[int, int, int]:
        return self.fitted.spec.cells

    @property
    def density(self) -> float:
        """Volume by that of the block of cells before any map."""
        return self.volume / (prod(self.cells) * self.fitted.spec.grading.cell_size**3)

    def _trimmed(self, shift: Floats, progress: Progress | None) -> tuple[KernelShape, float, int]:
        """Return the shape cut to the block of cells, its volume, and how many patches are in it."""

        spec = self.fitted.spec
        size = spec.grading.cell_size
        axes = spec.frame.rotation
        low = spec.frame.origin @ axes
        box = Box(axes, low, low + np.array(self.cells) * size)
        with self.timed("cut", progress):
            # Some curve always ends on an edge of whole cells: nobody asks whether their corners are filled.
            left = cut_to_box(self.fitted.wall.moved(np.eye(3), axes @ shift), box, [(0, True), (1, False)], size, True)
        with self.timed("solid", progress):
            solids = build_trimmed(left)
        volumes = left.volumes.tolist()
        kept = kept_pieces(volumes, sum(volumes) / prod(self.cells), island_rule(spec.keep_islands))
        self.islands = islands_of(volumes, kept)
        measures = zip(left.volumes.tolist(), left.areas.tolist(), map(tuple, left.centroids.tolist()), strict=True)
        sizes = [ShapeSize(*measured) for measured in measures]
        self._cut = [sizes[piece] for piece in kept]
        self.shift = (float(shift[0]), float(shift[1]), float(shift[2]))
        shape = solids[kept[0]] if len(kept) == 1 else compound_of(solids[piece] for piece in kept)
        of_faces = left.component[: len(left.faces)].tolist()
        patches = {face.patch for face, piece in zip(left.faces, of_faces, strict=True) if piece in kept}
        return shape, sum(volumes[piece] for piece in kept), len(patches)

    def _volume_in_box(self) -> float | None:
        """Volume of the wall in whole uniform cells, in mm3; None where they vary."""
        if not self.fitted.spec.grading.uniform:
            return None
        cell = np.unique(self.fitted.wall.patch_net, return_index=True)[1]
        return prod(self.cells) * self.fitted.wall.volume(cell)

    @contextmanager
    def timed(self, stage: str, progress: Progress | None = None) -> Iterator[None]:
        """Tell that a stage begins and ends, and add the seconds between."""
        with timed(self.seconds, stage, progress):
            yield

    def area(self) -> float:
        """Area in mm2 of all that bounds the solid, by quadrature of the nets and of what was cut of them."""
        return joint_size(self.sizes).area

    @cached_property
    def sizes(self) -> list[ShapeSize]:
        """Of each of its solids, as the kernel counts them, by quadrature of the nets and of what was cut of them."""
        return self._cut if self.fitted.spec.trimmed else piece_sizes(self.fitted.wall)

    def solid(self) -> KernelShape:
        """A shape of the caller's own, to move as they like, that shares the geometry."""

        return another_handle(self._shape)

    def valid(self, progress: Progress | None = None) -> bool:
        """Verdict of the kernel's own check, asked once."""
        if self._valid is None:
            with self.timed("check", progress):
                self._valid = is_valid(self._shape)
        return self._valid

    def write(
        self,
        targets: Sequence[Path],
        header: StepHeader,
        deviation: float,
        angle: float,
        progress: Progress | None = None,
    ) -> None:
        """Write the solid to each target in the format of its ending.

        Raises
        ------
        KernelError
            If the kernel finds the solid invalid: then nothing is written.
        ExportError
        """
        self._require_memory(FILE_BYTES_PER_CELL)
        if not self.valid(progress):
            raise KernelError(f"the kernel finds its solid of {self.cells} cells invalid; nothing was written")
        for path in targets:
            with self.timed(f"write {path.name}", progress):
                write_shape(self._shape, self.sizes, path, header, deviation, angle)

    def _require_memory(self, bytes_per_cell: int) -> None:
        require_memory(self.cells, bytes_per_cell, len(self.fitted.wall.weights))

    def _require_closed_and_full(self, volume: float, expected: float | None, agreement: float) -> None:
        if not self.topology.closed:
            raise KernelError(
                f"the kernel's shape of {self.cells} cells is not closed: "
                f"{self.topology.open_edges} edges do not bound exactly two faces"
            )
        if expected is not None and not abs(volume - expected) <= agreement * expected:
            raise KernelError(
                f"the kernel's shape of {self.cells} cells encloses {volume:.9g} mm3, "
                f"its control nets {expected:.9g} mm3"
            )


def write_shape(
    shape: KernelShape,
    sizes: Sequence[ShapeSize],
    path: Path,
    header: StepHeader,
    deviation: float,
    angle: float,
    labels: BodyLabels = UNLABELLED,
) -> None:
    """Write a shape, whose solids' sizes are known, and how they are labelled, in the format of the path's ending.

    Raises
    ------
    ExportError
    """

    form = format_of(path)
    if form is STEP:
        write_step(shape, path, header, sizes=sizes, labels=labels)
    elif form is BREP:
        write_brep(shape, path)
    elif form is STL:
        write_meshed_stl(shape, path, deviation, angle)
    else:
        write_triangles(*closed_triangles(shape, path, deviation, angle), path)


_builds: Cache[LatticeSpec, Build] = Cache()


def build(spec: LatticeSpec, progress: Progress | None = None) -> Build:
    """The build of a lattice; the last few are remembered.

    Parameters
    ----------
    spec : LatticeSpec
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, saying how much it would take.
    FitError
        If the fit's edges do not meet those of its neighbours.
    KernelError
        If the kernel's shape is not closed or does not enclose the right volume.
    """

    def made() -> Build:
        require_memory(spec.cells, _SOLID_BYTES_PER_CELL, spec.settings.control_points)
        return Build(fitted_wall(spec, progress), progress)

    return _builds.get(spec, made)

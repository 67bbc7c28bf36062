"""A lattice of whole patches as a STEP solid, checked and written from its arrays: the kernel is not loaded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from gyroid_cad.common.cache import Cache
from gyroid_cad.common.choices import CheckedBy
from gyroid_cad.common.memory import require_memory
from gyroid_cad.common.packed import replacing_step
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import FitError
from gyroid_cad.step.bodies import LEAST_GAP
from gyroid_cad.step.counts import Topology, require_counts
from gyroid_cad.step.header import StepHeader, product_name
from gyroid_cad.step.products import StepPart, write_products
from gyroid_cad.step.walls import WallBody, wall_bodies
from gyroid_cad.trim.islands import Islands
from gyroid_cad.wall.areas import ShapeSize, joint_size, piece_sizes
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.fitted import FittedWall, LatticeSpec, fitted_wall
from gyroid_cad.wall.offset import SIDES

__all__ = ["WholeBuild", "whole_build"]

# Peak memory a cell, as benchmarks/memory.py measures it, rounded up.
_BYTES_PER_CELL = 500_000
# Volume by the flux through the faces against that between them: rounding only.
_VOLUME_AGREEMENT = 1e-9
_NOT_CUT = Islands()


class WholeBuild:
    """A lattice's solids as numbers and nets, found closed, its borders in common, and as full as its wall.

    Attributes
    ----------
    fitted : FittedWall
    topology : Topology
    volume : float
        In mm3, that the faces enclose.
    bodies : list of WallBody
    sizes : list of ShapeSize
        One a body.
    islands : Islands
        None: nothing is cut.
    seconds : dict
        By stage.
    """

    checked_by: CheckedBy = "nets"

    def __init__(self, fitted: FittedWall, progress: Progress | None) -> None:
        self.fitted, self.islands, self.seconds = fitted, _NOT_CUT, dict(fitted.seconds)
        wall, complex = fitted.wall, fitted.complex
        with self.timed("check", progress):
            self.bodies: list[WallBody] = wall_bodies(wall)
            faces = len(SIDES) * complex.patch_count + int(complex.free.sum())
            self.topology = Topology(len(self.bodies), faces, _open_edges(complex))
            self.sizes: list[ShapeSize] = piece_sizes(wall)
            self.volume = joint_size(self.sizes).volume
            self._require_sound(wall.volume())

    @property
    def cells(self) -> tuple[int, int, int]:
        return self.fitted.spec.cells

    @property
    def patches(self) -> int:
        return self.fitted.complex.patch_count

    @contextmanager
    def timed(self, stage: str, progress: Progress | None = None) -> Iterator[None]:
        """Tell that a stage begins and ends, and add the seconds between."""
        with timed(self.seconds, stage, progress):
            yield

    def area(self) -> float:
        """Area in mm2 of all that bounds the solid."""
        return joint_size(self.sizes).area

    def valid(self, progress: Progress | None = None) -> bool:
        """Tell whether it is sound; what is not is refused before."""
        return self.topology.closed

    def write(self, targets: Sequence[Path], header: StepHeader, progress: Progress | None = None) -> None:
        """Write the solid to STEP files.

        Raises
        ------
        ExportError
        """
        size = joint_size(self.sizes)
        for path in targets:
            with self.timed(f"write {path.name}", progress), replacing_step(path) as temporary:
                name = product_name(path)
                part = StepPart(name, self.bodies, body_sizes=self.sizes)
                write_products(temporary, name, [part], header=header, size=size)
                require_counts(path, temporary, self.topology, self.topology)

    def _require_sound(self, volume: float) -> None:
        if self.topology.open_edges:
            raise FitError(f"the faces of {self.cells} cells do not close: {self.topology.open_edges} edges are open")
        gap = max(body.gap for body in self.bodies)
        if gap > LEAST_GAP:
            raise FitError(f"the faces of {self.cells} cells are up to {gap:.2g} mm apart at edges they have in common")
        if not abs(self.volume - volume) <= _VOLUME_AGREEMENT * volume:
            raise FitError(
                f"the faces of {self.cells} cells enclose {self.volume:.9g} mm3, their nets {volume:.9g} mm3: "
                "they do not close, or cross"
            )


def _open_edges(complex: CellComplex) -> int:
    """Count edges that do not bound exactly two faces, once in each direction."""
    edges, ways = complex.patch_edges.ravel(), np.where(complex.edge_forward, 1, -1).ravel()
    # Along a free edge a side wall runs against its patch.
    uses = np.bincount(edges, minlength=complex.edge_count) + complex.free
    turns = np.bincount(edges, ways, complex.edge_count)
    rims = (uses != 2) | ((turns != 0) & ~complex.free)
    # Of a straight edge through the wall: side walls that end there, and that begin.
    free = complex.free[complex.patch_edges]
    starts, ends = complex.patch_fans[free], np.roll(complex.patch_fans, -1, axis=1)[free]
    begun, ended = (np.bincount(fans, minlength=complex.fan_count) for fans in (starts, ends))
    posts = (begun != complex.border_fans) | (ended != complex.border_fans)
    return int(len(SIDES) * rims.sum() + posts.sum())


_builds: Cache[LatticeSpec, WholeBuild] = Cache()


def whole_build(spec: LatticeSpec, progress: Progress | None = None) -> WholeBuild:
    """The solid of a lattice of whole patches; the last few are remembered.

    Parameters
    ----------
    spec : LatticeSpec
        Not trimmed.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If memory would not do, saying how much it would take.
    FitError
        If faces do not meet, or do not enclose as much as is between them.
    """

    def made() -> WholeBuild:
        require_memory(spec.cells, _BYTES_PER_CELL, spec.settings.control_points, kernel=False)
        return WholeBuild(fitted_wall(spec, progress), progress)

    return _builds.get(spec, made)

"""Report on a lattice's solid, as plain values."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from gyroid_cad.common.choices import CheckedBy
from gyroid_cad.common.tables import Rows, cells_shown, islands_shown, text_table, volume_shown, wall_shown
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.surface.fit_report import fit_report

if TYPE_CHECKING:
    from gyroid_cad.builds.solid import Build
    from gyroid_cad.builds.whole import WholeBuild

__all__ = ["LatticeReport", "report_of"]


@dataclass(frozen=True, slots=True)
class LatticeReport:
    """Report on a built lattice: its size, its faces, and how exact they are.

    Attributes
    ----------
    cells : tuple of int
    cell_size : float
        In mm, before any map.
    cells_alike : bool
        False where a scale field or a map makes cells of other sizes.
    thickness, min_thickness, max_thickness : float
        Whole wall in mm: its mean over the mid-surface and its extremes.
    density : float
        Volume fraction: of a cell, of the mapped block where the lattice is graded, or of what is left of a block
        that is cut.
    patches, faces, solids : int
    islands, dropped : int
        Pieces that a trimmed lattice has besides the largest one, and small ones that were dropped.
    islands_volume, dropped_volume : float
        Of either, in mm3.
    control_points : int
        Along each side of a patch.
    valid, closed : bool
        By the check that was made; every edge bounds exactly two faces.
    checked_by : {"nets", "kernel"}
        From the numbers of edges and the control nets, or by the kernel's own check of the solid.
    boundary_edges : int
        Mid-surface edges that bound one patch only: each carries a ruled side wall.
    non_manifold_edges : int
        Lines through the wall in which patches touch without joining.
    volume, volume_exact : float
        In mm3: enclosed by the faces, and of the exact wall: by the tube formula, or by quadrature
        where the lattice is graded; the latter without what was dropped, and none of a graded lattice that is cut.
    area : float
        In mm2, of all that bounds the solid: both faces, and side walls or flat sides.
    max_deviation : float
        In mm: of the fitted mid-surface along the exact normal, or of both faces where the lattice is graded.
    max_wall_error : float, optional
        Relative, of the wall along the exact normal; where the lattice is graded.
    max_normal_angle : float
        In degrees, between fitted and exact normal of the mid-surface.
    samples_per_patch : dict
        At how many places of every patch deviation, folding and clearance between walls were checked; empty where
        they hold in closed form.
    seconds : dict
        By stage.

    Examples
    --------
    >>> print(Lattice((1, 1, 1), 10, thickness=0.8).report())
    cells                               1 x 1 x 1, 10 mm each
    wall                                0.8 mm, density 0.24517
    solids, faces                       1, 84 (valid and closed)
    boundary edges, non-manifold edges  36, 1
    volume                              245.17085 mm3, +2.0e-08 of the exact one
    area                                731.6526 mm2
    deviation                           4.5e-05 mm, 0.023 degrees; 10 x 10 control points a patch
    """

    cells: tuple[int, int, int]
    cell_size: float
    cells_alike: bool
    thickness: float
    min_thickness: float
    max_thickness: float
    density: float
    patches: int
    faces: int
    solids: int
    islands: int
    islands_volume: float
    dropped: int
    dropped_volume: float
    control_points: int
    valid: bool
    closed: bool
    checked_by: CheckedBy
    boundary_edges: int
    non_manifold_edges: int
    volume: float
    volume_exact: float | None
    area: float
    max_deviation: float
    max_wall_error: float | None
    max_normal_angle: float
    samples_per_patch: dict[str, int]
    seconds: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed."""
        state = f"{'valid' if self.valid else 'invalid'} and {'closed' if self.closed else 'open'}"
        return [
            ("cells", cells_shown(self.cells, self.cell_size, self.cells_alike)),
            ("wall", wall_shown(self.thickness, self.min_thickness, self.max_thickness, self.density)),
            ("solids, faces", f"{self.solids}, {self.faces} ({state})"),
            *([("islands", self._islands_shown())] if self.islands or self.dropped else []),
            ("boundary edges, non-manifold edges", f"{self.boundary_edges}, {self.non_manifold_edges}"),
            ("volume", volume_shown(self.volume, self.volume_exact)),
            ("area", f"{self.area:.8g} mm2"),
            ("deviation", self._deviation_shown()),
            *([("checked", self._checks_shown())] if self.samples_per_patch else []),
        ]

    def __str__(self) -> str:
        return text_table(self.rows())

    def _islands_shown(self) -> str:
        return islands_shown(self.islands, self.islands_volume, self.dropped, self.dropped_volume)

    def _deviation_shown(self) -> str:
        n = self.control_points
        shown = f"{self.max_deviation:.1e} mm, {self.max_normal_angle:.3f} degrees"
        if self.max_wall_error is not None:
            shown += f", wall {self.max_wall_error:.1e} of itself"
        return f"{shown}; {n} x {n} control points a patch"

    def _checks_shown(self) -> str:
        samples = self.samples_per_patch
        return (
            f"at {samples['deviation']} sample points a patch for deviation, {samples['fold']} for local "
            f"self-intersection, {samples['clearance']} for walls that meet"
        )


def report_of(built: Build | WholeBuild, thickness: float, density: float, volume_exact: float | None) -> LatticeReport:
    """The report on what was built and checked.

    Parameters
    ----------
    built : Build or WholeBuild
    thickness, density : float
        Of the exact lattice.
    volume_exact : float, optional
        Of the exact lattice, if it is known.
    """
    fitted = built.fitted
    refit, complex, spec = fitted.refit, fitted.complex, fitted.spec
    with built.timed("fit report"):
        fit = fit_report(fit_patch(spec.settings, spec.grading.surface.family))
    cell_size = spec.grading.cell_size
    return LatticeReport(
        cells=built.cells,
        cell_size=cell_size,
        cells_alike=spec.grading.cells_alike,
        thickness=thickness,
        min_thickness=refit.min_thickness if refit else thickness,
        max_thickness=refit.max_thickness if refit else thickness,
        density=density,
        patches=built.patches,
        faces=built.topology.faces,
        solids=built.topology.solids,
        islands=built.islands.kept,
        islands_volume=built.islands.kept_volume,
        dropped=built.islands.dropped,
        dropped_volume=built.islands.dropped_volume,
        control_points=len(fitted.wall.weights),
        valid=built.valid(),
        closed=built.topology.closed,
        checked_by=built.checked_by,
        boundary_edges=0 if spec.trimmed else int(complex.free.sum()),
        non_manifold_edges=0 if spec.trimmed else complex.non_manifold_edges,
        volume=built.volume,
        volume_exact=volume_exact,
        area=built.area(),
        max_deviation=refit.max_deviation if refit else fit.max_distance * cell_size,
        max_wall_error=refit.max_wall_error if refit else None,
        max_normal_angle=refit.max_normal_angle if refit else fit.max_normal_angle,
        samples_per_patch=fitted.samples_per_patch,
        seconds=dict(built.seconds),
    )

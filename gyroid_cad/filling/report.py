"""Report on a filled part: its size, its mass, and how it was made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.choices import Kind, Route
from gyroid_cad.common.tables import Rows, cell_shown, islands_shown, text_table
from gyroid_cad.errors import PartWarning
from gyroid_cad.trim.islands import SealedVoid, warn_caller

__all__ = ["FillReport", "FluidReport", "fluid_report", "joint_report", "warn_of_uncovered"]

# Of several bodies these add up.
_SUMMED = (
    "solids",
    "faces",
    "part_volume",
    "volume",
    "area",
    "islands",
    "islands_volume",
    "dropped",
    "dropped_volume",
    "cut_patches",
    "whole_patches",
)
_MASSES = ("mass", "part_mass")


@dataclass(frozen=True, slots=True)
class FluidReport:
    """Report on one fluid of a part.

    Attributes
    ----------
    name : str
    volume, wetted_area : float
        In mm3 and mm2; mouths are not wetted.
    hydraulic_diameter : float
        Four times the volume by the wetted area, in mm.
    pieces, dead_ends : int
        Not connected to each other, and those of them that cannot be flowed through: in a skin, that come to no second
        opening; in a part without one, whose mouths join over its edges, that have no mouth.
    throat : float
        Diameter of the largest sphere that passes between all openings of the fluid, in mm, to about a twentieth of a
        cell, 0 where it is no wider; without a skin that has two the lattice's own, which is exact where the wall is
        uniform.
    """

    name: str
    volume: float
    wetted_area: float
    hydraulic_diameter: float
    pieces: int
    dead_ends: int
    throat: float

    def __str__(self) -> str:
        pieces = "" if self.pieces == 1 else f" in {self.pieces} pieces"
        if self.dead_ends:
            pieces = f" in {self.pieces} pieces, {self.dead_ends} dead end{'s' * (self.dead_ends > 1)}"
            pieces = " in a dead end" if self.pieces == 1 else pieces
        sizes = f"wetted {self.wetted_area:.6g} mm2, hydraulic diameter {self.hydraulic_diameter:.4g} mm"
        return f"{self.volume:.8g} mm3{pieces}, {sizes}, throat {self.throat:.4g} mm"


# In the table; the report has all of them.
_VOIDS_SHOWN = 3


@dataclass(frozen=True, slots=True)
class FillReport:
    """Report on a filled part.

    Attributes
    ----------
    kind : str
    cell_size, thickness : float
        In mm; cells before a scale field or a map of a block; the wall where it is thickest, or for a network twice the
        distance of its border from the surface.
    min_wall : float, optional
        The lattice's wall where it is thinnest, or the skin if that is thinner, in mm; none of a network.
    skin : float, optional
        In mm, where it is thinnest.
    solids, faces : int
    valid, closed : bool
        By the kernel's own check; every edge bounds exactly two faces. The bare surface is not closed.
    part_volume, volume : float
        In mm3.
    density : float
        Volume by that of the part.
    area : float
        Of the surface, in mm2.
    mass, part_mass : float, optional
        In g, for a material's density.
    islands, dropped : int
        Pieces besides the largest one of each domain, and pieces that were dropped.
    islands_volume, dropped_volume : float
        Of either, in mm3; of the bare surface 0.
    voids : tuple of SealedVoid
        Space that the solids enclose and no opening reaches, the largest first, each with its volume in mm3 and its
        place in mm; the part's own voids are none of them.
    cut_patches, whole_patches : int
        That the part's boundary may cross, and that lie wholly inside.
    by_sections : bool
        Whether it was cut without the kernel's booleans.
    shift : tuple of float
        Of the lattice, in mm, where cuts failed without, or left edges too short.
    seconds : dict
        By stage.
    cells_alike : bool
        False where a scale field or a map makes cells of other sizes.
    uncovered : float
        Share of the part that the given lattice does not reach.
    bodies : int
        Solids of the part, each of which was filled by itself.
    remarks : tuple of str
        On what was repaired or united before that.
    route : {"brep", "triangles"}
        At the latter ``faces`` counts triangles, and patches are not told apart by the part's boundary.
    deviation : float, optional
        Of triangles from the lattice and the part, in mm, at that route.
    volumes : dict
        In mm3, by the name of what there is.
    fluids : tuple of FluidReport
        Of bodies that share their faces.

    Examples
    --------
    >>> import cadquery as cq
    >>> from gyroid_cad import FitSettings, fill
    >>> block = cq.Workplane().box(4, 4, 4, centered=False)
    >>> print(fill(block, cell_size=8, density=0.3, fit=FitSettings(5)).report)
    kind           sheet, cells of 8 mm, wall 0.786642 mm
    smallest wall  0.786642 mm
    solids, faces  1, 30 (valid and closed)
    volume         19.093472 mm3 of 64, density 0.29834
    area           69.9646 mm2
    islands        0 left, 2 dropped (0.1072 mm3)
    """

    kind: Kind
    cell_size: float
    thickness: float
    min_wall: float | None
    skin: float | None
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
    islands_volume: float
    dropped: int
    dropped_volume: float
    voids: tuple[SealedVoid, ...]
    cut_patches: int
    whole_patches: int
    by_sections: bool
    shift: Point
    seconds: dict[str, float]
    cells_alike: bool
    uncovered: float = 0.0
    bodies: int = 1
    remarks: tuple[str, ...] = ()
    route: Route = "brep"
    deviation: float | None = None
    volumes: dict[str, float] = field(default_factory=dict)
    fluids: tuple[FluidReport, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The report as plain values, ready for JSON."""
        return asdict(self)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed."""
        of_part = f"{self.part_volume:.8g}, density {self.density:.5f}"
        return [
            ("kind", f"{self.kind}, {cell_shown(self.cell_size, self.cells_alike)}, wall {self.thickness:.6g} mm"),
            *([] if self.min_wall is None else [("smallest wall", f"{self.min_wall:.6g} mm")]),
            *([] if self.skin is None else [("skin", f"{self.skin:g} mm")]),
            *([] if self.bodies == 1 else [("bodies", f"{self.bodies}, each filled by itself")]),
            *([("uncovered", f"{100 * self.uncovered:.3g} % of the part")] if self.uncovered else []),
            *(("part", remark) for remark in self.remarks),
            self._counted(),
            ("volume", f"{self.volume:.8g} mm3 of {of_part}"),
            *self._volumes_shown(),
            ("area", f"{self.area:.6g} mm2"),
            *([] if self.mass is None else [("mass", f"{self.mass:.4g} g of {self.part_mass:.4g} g")]),
            ("islands", islands_shown(self.islands, self.islands_volume, self.dropped, self.dropped_volume)),
            *([("sealed voids", self._voids_shown())] if self.voids else []),
            *(
                [("shifted by", f"{self._shift_shown()} mm: where it stood, cuts failed or left edges too short")]
                if any(self.shift)
                else []
            ),
        ]

    def _counted(self) -> tuple[str, str]:
        if self.route == "triangles":
            within = f"closed, within {self.deviation:.3g} mm; no B-rep was made"
            return "solids, triangles", f"{self.solids}, {self.faces:,} ({within})"
        state = f"{'valid' if self.valid else 'invalid'}{' and closed' if self.closed else ''}"
        return "solids, faces", f"{self.solids}, {self.faces} ({state})"

    def _shift_shown(self) -> str:
        return f"({', '.join(f'{along:.4g}' for along in self.shift)})"

    def _volumes_shown(self) -> Rows:
        """Volumes of what there is more than one of."""
        several = self.volumes if len(self.volumes) > 1 else {}
        shown = {fluid.name: str(fluid) for fluid in self.fluids}
        return [(name, shown.get(name, f"{volume:.8g} mm3")) for name, volume in several.items()]

    def _voids_shown(self) -> str:
        shown = "; ".join(map(str, self.voids[:_VOIDS_SHOWN]))
        return f"{len(self.voids)} that no opening reaches: {shown}{'; ...' * (len(self.voids) > _VOIDS_SHOWN)}"

    def __str__(self) -> str:
        return text_table(self.rows())


def warn_of_uncovered(share: float) -> None:
    """Emit a :class:`~gyroid_cad.PartWarning` if some of a part is out of the lattice's reach."""
    if share:
        warn_caller(f"{100 * share:.3g} % of the part is out of the lattice's reach", PartWarning)


def fluid_report(
    name: str, volume: float, wetted: float, pieces: int, dead_ends: int = 0, throat: float = 0.0
) -> FluidReport:
    """Report on a fluid of so many mm3, that wets so many mm2.

    >>> fluid_report("fluid-a", 30.0, 60.0, 1).hydraulic_diameter
    2.0
    """
    return FluidReport(name, volume, wetted, 4 * volume / wetted if wetted else 0.0, pieces, dead_ends, throat)


def _joint_fluid(some: Sequence[FluidReport]) -> FluidReport:
    volume, wetted = (sum(getattr(one, name) for one in some) for name in ("volume", "wetted_area"))
    pieces, dead_ends = (sum(getattr(one, name) for one in some) for name in ("pieces", "dead_ends"))
    return fluid_report(some[0].name, volume, wetted, pieces, dead_ends, min(one.throat for one in some))


def joint_report(reports: Sequence[FillReport], remarks: Sequence[str] = ()) -> FillReport:
    """Report on several bodies together, each of which was filled by itself.

    Parameters
    ----------
    reports : sequence of FillReport
        One of each body.
    remarks : sequence of str
        On what was done to the part before.
    """
    first, remarks = reports[0], tuple(remarks)
    if len(reports) == 1:
        return replace(first, remarks=remarks)
    sums = {name: sum(getattr(report, name) for report in reports) for name in _SUMMED}
    masses = {name: sum(getattr(report, name) for report in reports) for name in _MASSES if first.mass is not None}
    stages = dict.fromkeys(stage for report in reports for stage in report.seconds)
    return replace(
        first,
        **sums,
        **masses,
        thickness=max(report.thickness for report in reports),
        min_wall=min((report.min_wall for report in reports if report.min_wall is not None), default=None),
        density=sums["volume"] / sums["part_volume"],
        uncovered=sum(report.uncovered * report.part_volume for report in reports) / sums["part_volume"],
        by_sections=all(report.by_sections for report in reports),
        shift=next((report.shift for report in reports if any(report.shift)), first.shift),
        seconds={stage: sum(report.seconds.get(stage, 0.0) for report in reports) for stage in stages},
        voids=tuple(sorted((void for report in reports for void in report.voids), key=lambda void: -void.volume)),
        volumes={
            name: sum(report.volumes.get(name, 0.0) for report in reports)
            for name in dict.fromkeys(name for report in reports for name in report.volumes)
        },
        fluids=tuple(_joint_fluid(some) for some in zip(*(report.fluids for report in reports), strict=True)),
        bodies=len(reports),
        remarks=remarks,
    )

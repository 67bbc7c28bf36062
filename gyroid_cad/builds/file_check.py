"""Check of a file by the limits of those who receive it: a B-rep's edges and faces, or a mesh's triangles."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gyroid_cad.common.choices import PROFILES, Profile
from gyroid_cad.common.formats import PART_FORMATS, TRIANGLE_FORMATS, require_format
from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.common.tables import text_table
from gyroid_cad.common.verdicts import Check, Worst, counted
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.triangles.faults import flat_triangles, triangle_faults
from gyroid_cad.mesh.triangles.files import read_triangle_file
from gyroid_cad.mesh.triangles.measures import triangle_measures

__all__ = ["CRITERIA", "MESH_CRITERIA", "Criterion", "FileCheck", "check_file", "require_profile"]


@dataclass(frozen=True, slots=True)
class Criterion:
    """One criterion, and how each profile limits it.

    Attributes
    ----------
    name : str
    unit : str
        Empty of what is counted.
    at_least : bool
        Whether the limit is the smallest value that passes, or the largest.
    default, creo, nx : float, optional
        None where a profile takes any value.
    """

    name: str
    unit: str
    at_least: bool
    default: float | None
    creo: float | None
    nx: float | None

    def check(self, found: Worst, profile: Profile) -> Check:
        """Judge the worst value that was found; what was not there to be measured is ok."""
        limit: float | None = getattr(self, profile)
        value = found.value
        ok = limit is None or not isinstance(value, int | float)
        if not ok and isinstance(value, int | float) and limit is not None:
            ok = value >= limit if self.at_least else value <= limit
        return Check(self.name, value, limit, ok, found.place)


def _none(name: str) -> Criterion:
    """Faults of which no profile takes one."""
    return Criterion(name, "", False, 0, 0, 0)


# After VDA 4955 and SASIG-PDQ (ISO/PAS 26183): the defaults of Creo's GeomIntegrityCHECK, and those of Nissan's
# CADdoctor for NX. The default has of each the stricter one, but for what the size of cells and walls decides: how
# short the patches of a fine lattice are, and how narrowly a small cell is curved, no writer can help.
CRITERIA = (
    Criterion("solids", "", True, 1, 1, 1),
    _none("open edges"),
    _none("open borders"),
    _none("invalid faces"),
    _none("inside out"),
    Criterion("smallest edge", "mm", True, 0.02, 0.02, 0.01),
    Criterion("smallest segment", "mm", True, 0.005, 0.2, 0.005),
    Criterion("gap of edge and face", "mm", False, 0.01, 0.02, 0.01),
    Criterion("gap of edges", "mm", False, 0.01, 0.02, 0.01),
    Criterion("tangency", "degrees", False, 0.1, 0.1, 3.0),
    Criterion("degree", "", False, 11, 11, None),
    Criterion("knot distance", "mm", True, 0.02, 0.02, None),
    Criterion("narrowest face", "mm", True, 0.01, None, 0.01),
    Criterion("sharpest corner", "degrees", True, 2.0, 2.0, None),
    Criterion("radius of curvature", "mm", True, None, 0.5, None),
    _none("self-intersection"),
    Criterion("largest tolerance", "mm", False, 0.01, 0.02, 0.01),
)
MESH_CRITERIA = (
    _none("watertight"),
    _none("manifold"),
    _none("orientation"),
    _none("inside out"),
    _none("self-intersection"),
    _none("degenerate triangles"),
    Criterion("pieces", "", False, None, None, None),
    Criterion("units", "", False, None, None, None),
)


@dataclass(frozen=True, slots=True)
class FileCheck:
    """Check of a file.

    Attributes
    ----------
    file : str
    ok : bool
        Whether no limit is broken.
    solids, faces : int
        Of triangles the pieces, and the triangles.
    closed : bool
    valid : bool
        By the kernel's own check; of triangles whether none cross, no edge has more than two, and all are turned alike.
    volume : float, optional
        In mm3; None of what is not closed.
    checks : tuple of Check
        Each with its name, the worst value, the limit, whether that holds, and the place.

    Examples
    --------
    >>> Lattice((1, 1, 1), 10, thickness=0.8).write("cell.step")
    >>> check = check_file("cell.step")
    >>> check.ok, check.solids, check.faces, round(check.volume, 3)
    (True, 1, 84, 245.171)
    """

    file: str
    ok: bool
    solids: int
    faces: int
    closed: bool
    valid: bool
    volume: float | None
    checks: tuple[Check, ...]

    def as_dict(self) -> dict[str, Any]:
        """The check as plain values, ready for JSON.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).write("cell.step")
        >>> check_file("cell.step").as_dict()["checks"][0]
        {'name': 'solids', 'worst': 1, 'limit': 1, 'ok': True, 'place': None}
        """
        return {**asdict(self), "checks": [asdict(check) for check in self.checks]}

    def header(self) -> tuple[str, ...]:
        """Headings of the rows.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).write("cell.step")
        >>> check_file("cell.step").header()
        ('check', 'worst', 'limit', 'verdict', 'place')
        """
        return "check", "worst", "limit", "verdict", "place"

    def rows(self) -> list[tuple[str, ...]]:
        """Name, worst value, limit, verdict and place, check by check; last the verdict on the whole.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).write("cell.step")
        >>> check_file("cell.step").rows()[5]
        ('smallest edge', '0.8 mm', '>= 0.02 mm', 'ok', '(-2.5, 2.5, 2.5)')
        """
        units = {one.name: one for one in (*CRITERIA, *MESH_CRITERIA)}
        rows = [_row(check, units[check.name]) for check in self.checks]
        broken = sum(not check.ok for check in self.checks)
        volume = "no volume" if self.volume is None else f"{self.volume:.8g} mm3"
        state = f"{'closed' if self.closed else 'open'}, {'valid' if self.valid else 'invalid'}"
        verdict = f"{broken} limit{'s' * (broken != 1)} broken" if broken else "ok"
        return [*rows, ("whole", f"{state}, {self.faces} faces, {volume}", "", verdict, "")]

    def __str__(self) -> str:
        return text_table(self.rows(), self.header())


def _row(check: Check, criterion: Criterion) -> tuple[str, ...]:
    unit = f" {criterion.unit}" if criterion.unit else ""
    worst = (
        check.worst if isinstance(check.worst, str) else "none" if check.worst is None else f"{check.worst:.4g}{unit}"
    )
    limit = "" if check.limit is None else f"{'>=' if criterion.at_least else '<='} {check.limit:g}{unit}"
    verdict = "told" if check.limit is None else "ok" if check.ok else "broken"
    place = "" if check.place is None else f"({', '.join(f'{round(x, 3) + 0.0:g}' for x in check.place)})"
    return check.name, worst, limit, verdict, place


def require_profile(profile: Profile) -> None:
    """Check the name of a profile.

    Raises
    ------
    ParameterError
    """
    if profile not in PROFILES:
        raise ParameterError("profile", profile, " or ".join(PROFILES))


def check_file(
    path: str | os.PathLike[str], profile: Profile = "default", progress: Progress | None = None
) -> FileCheck:
    """Check a file as those who receive it will: a STEP or BREP file, or one of triangles, of any origin.

    Of a B-rep: solids that close, the kernel's own check, the volume; then the shortest edge, gaps, tangency across
    smooth edges, degrees, knots, narrow faces, sharp corners, curvature, faces that cross and tolerances, each with the
    worst value, the limit, and where it is. Of triangles: whether they close, are turned alike, cross or have no area.

    Parameters
    ----------
    path : path-like
        Ending in .step, .stp, .stpz, .step.gz, .stp.gz, .brep, .stl, .3mf, .obj or .ply.
    profile : {"default", "creo", "nx"}
        Limits of Creo's GeomIntegrityCHECK, or of CADdoctor for NX; by default the stricter of either, without those
        that the size of a lattice's cells decides.
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    FileCheck

    Raises
    ------
    ParameterError, ExportError
        If there is no such profile, or the file cannot be read.

    Examples
    --------
    >>> Lattice((1, 1, 1), 10, thickness=0.8).write("cell.stl")
    >>> check = check_file("cell.stl")
    >>> check.ok, check.closed, check.solids
    (True, True, 1)
    """
    require_profile(profile)
    form = require_format("file", path, PART_FORMATS)
    if form in TRIANGLE_FORMATS:
        return _check_triangles(path, profile, progress)
    return _check_shape(path, profile, progress)


def _check_shape(path: str | os.PathLike[str], profile: Profile, progress: Progress | None) -> FileCheck:
    # The kernel is loaded only for files that hold shapes.
    from gyroid_cad.kernel.quality import file_quality

    found = file_quality(path, progress)
    worst = {**found.worst, "solids": Worst(found.solids), "inside out": Worst(int(found.closed and found.volume < 0))}
    checks = tuple(criterion.check(worst[criterion.name], profile) for criterion in CRITERIA)
    ok = all(check.ok for check in checks) and found.closed and found.valid
    volume = found.volume if found.closed else None
    return FileCheck(str(path), ok, found.solids, found.faces, found.closed, found.valid, volume, checks)


def _check_triangles(path: str | os.PathLike[str], profile: Profile, progress: Progress | None) -> FileCheck:
    report_progress(progress, "read", 0, 1)
    read = read_triangle_file(path)
    report_progress(progress, "check", 0, 1)
    found, faults = triangle_measures(read.vertices, read.triangles), triangle_faults(read.vertices, read.triangles)
    flat = np.concatenate([read.without_area, flat_triangles(read.vertices, read.triangles)])
    worst = {
        **faults,
        "degenerate triangles": counted(flat),
        "inside out": Worst(found.inside_out),
        "pieces": Worst(found.pieces),
        "units": Worst(read.unit),
    }
    checks = tuple(criterion.check(worst[criterion.name], profile) for criterion in MESH_CRITERIA)
    valid = not any(worst[name].value for name in ("manifold", "orientation", "inside out", "self-intersection"))
    ok = all(check.ok for check in checks) and found.closed
    volume = found.volume if found.closed else None
    return FileCheck(str(path), ok, found.pieces, found.triangles, found.closed, valid, volume, checks)

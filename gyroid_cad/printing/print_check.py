"""Check of a part against a printer: does it fit, are its walls thick enough, does resin drain, is it one piece."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from itertools import permutations
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.formats import require_meshing
from gyroid_cad.common.graph import connected
from gyroid_cad.common.progress import Progress
from gyroid_cad.common.tables import text_table
from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.channels import way_out
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import TriangleMeasures, measured_walls, triangle_measures
from gyroid_cad.printing.printers import Printer, printer_named
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.pore_limits import narrowest_opening, pore_limiting_diameter

if TYPE_CHECKING:
    from gyroid_cad.filling.fill import FillReport
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["PrintCheck", "print_check", "trapped_voids"]

# At how many places the walls of a part that is known by its triangles alone are measured.
_WALLS_MEASURED = 4000
_UNITS = "STL in mm (STL has no unit: PreForm takes mm), 3MF says mm itself"
# A part as long as the build volume, but for rounding, fits.
_ROUNDING = 1e-9
# What has no height, a single face, is taken for so many mm high.
_FLAT = 1e-9


@runtime_checkable
class FilledPart(Protocol):
    """Stands for :class:`gyroid_cad.Filled`, which is loaded with the kernel; files of triangles need none."""

    @property
    def report(self) -> FillReport: ...

    def solid(self) -> KernelShape: ...

    def deviation(self, given: float | None = None) -> float: ...


@dataclass(frozen=True, slots=True)
class PrintCheck:
    """Verdict on a part for a printer; lengths in mm.

    Attributes
    ----------
    printer : Printer
    size : tuple of float
        Of the part's box, along its own x, y, z.
    orientation : tuple of int, optional
        Which of the part's axes lie along the printer's: (0, 1, 2) as it is, (2, 1, 0) with x and z exchanged. None
        if it fits in no way along the axes.
    scale_to_fit : float
        The largest scale at which it fits: below 1 it must be made smaller.
    min_wall : float, optional
        None where none was found.
    walls_measured : int
        At how many places; 0 if it is known from the lattice's description.
    scale_for_supported_wall, scale_for_wall : float, optional
        The scales from which on the smallest wall would pass as one that others support, and as one that stands free.
    opening : float, optional
        Diameter of the largest sphere that passes through a lattice's channels, or of triangles, that gets out of every
        hollow; None where there is none, or triangles do not close.
    opening_within : float, optional
        How closely that was measured in triangles; 0 if it was worked out, None if it was not looked for.
    trapped_voids : int
        Regions of empty space that do not reach outside.
    pieces : int
        That are connected by no edge.
    open_edges, inside_out : int
        Of triangles: edges not closed, and pieces turned inside out.
    triangles : int
    units : str
    """

    printer: Printer
    size: tuple[float, float, float]
    orientation: tuple[int, int, int] | None
    scale_to_fit: float
    min_wall: float | None
    walls_measured: int
    scale_for_supported_wall: float | None
    scale_for_wall: float | None
    opening: float | None
    opening_within: float | None
    trapped_voids: int
    pieces: int
    open_edges: int
    inside_out: int
    triangles: int
    units: str = _UNITS

    @property
    def fits(self) -> bool:
        """True if it fits the build volume, its axes along the printer's in one order or another."""
        return self.orientation is not None

    @property
    def wall(self) -> str:
        """ "good", "supported only" where it passes joined to others but not free, "too thin", or "unknown"."""
        if self.min_wall is None:
            return "unknown"
        if self.min_wall >= self.printer.min_unsupported_wall:
            return "good"
        return "supported only" if self.min_wall >= self.printer.min_supported_wall else "too thin"

    @property
    def drains(self) -> bool | None:
        """True if channels are as wide as a drain hole is to be; None if that is not known."""
        return None if self.opening is None else self.opening >= self.printer.min_drain_hole

    @property
    def suggested_scale(self) -> float | None:
        """1 if it can be made as it is, else the scale next to it at which it fits and no wall is too thin, or None."""
        least = self.scale_for_supported_wall or 0.0
        return None if least > self.scale_to_fit else float(np.clip(1.0, least, self.scale_to_fit))

    @property
    def passed(self) -> bool:
        """Absence of anything that stands in the way; narrow channels and boundary edges are the user's to judge."""
        sound = self.trapped_voids == 0 and self.open_edges == 0 and self.inside_out == 0
        return self.fits and self.wall != "too thin" and sound and self.pieces == 1

    def as_dict(self) -> dict[str, Any]:
        """The check as plain values, ready for JSON."""
        judged = {name: getattr(self, name) for name in ("passed", "fits", "wall", "drains", "suggested_scale")}
        return {**asdict(self), **judged}

    def header(self) -> tuple[str, str, str]:
        """Headings of the rows: the printer over the first of them."""
        return f"{self.printer.name}, {self.printer.process}", "", ""

    def rows(self) -> list[tuple[str, str, str]]:
        """Subject, finding and verdict, line by line."""
        return [self._fit_row(), self._wall_row(), *self._drain_rows(), *self._whole_rows()]

    def __str__(self) -> str:
        return text_table([*self.rows(), self.verdict_row()], self.header())

    def verdict_row(self) -> tuple[str, str, str]:
        """What follows from all the rows, as one more of them."""
        scale = self.suggested_scale
        if self.passed:
            return "verdict", "can be printed", "passed"
        if scale is not None and scale != 1:
            return "verdict", f"cannot be printed as it is; suggested scale {scale:.4g}", "failed"
        at_none = "" if scale else ", at no scale: what fits has too thin a wall"
        return "verdict", f"cannot be printed as it is{at_none}", "failed"

    def _fit_row(self) -> tuple[str, str, str]:
        volume = " x ".join(f"{length:g}" for length in self.printer.build_volume)
        finding = f"{' x '.join(f'{length:.4g}' for length in self.size)} mm in {volume} mm"
        if self.orientation is None:
            return "build volume", finding, f"too large: scale by {_rounded_down(self.scale_to_fit)}"
        if self.orientation == (0, 1, 2):
            return "build volume", finding, f"fits, up to a scale of {_rounded_down(self.scale_to_fit)}"
        order = ", ".join("xyz"[axis] for axis in self.orientation)
        return "build volume", finding, f"fits with its {order} along the printer's x, y, z"

    def _wall_row(self) -> tuple[str, str, str]:
        limits = self.printer.min_supported_wall, self.printer.min_unsupported_wall
        requested = f"asked {limits[0]:g} mm supported, {limits[1]:g} mm free"
        if self.min_wall is None:
            return "smallest wall", f"none found; {requested}", "unknown"
        how = f" at {self.walls_measured:,} places" if self.walls_measured else ""
        verdict = {
            "good": "good",
            "supported only": f"good but at boundary edges; there from a scale of {_rounded_up(self.scale_for_wall)}",
            "too thin": f"too thin: passes from a scale of {_rounded_up(self.scale_for_supported_wall)}, "
            f"boundary edges from {_rounded_up(self.scale_for_wall)}",
        }[self.wall]
        return "smallest wall", f"{self.min_wall:.4g} mm{how}; {requested}", verdict

    def _drain_rows(self) -> list[tuple[str, str, str]]:
        voids = "none" if self.trapped_voids == 0 else f"{self.trapped_voids}: resin cannot leave"
        rows = [("trapped voids", f"{self.trapped_voids} regions that do not reach outside", voids)]
        within = f" (to {self.opening_within:.2g} mm)" if self.opening_within else ""
        if self.opening is not None:
            verdict = "drain" if self.drains else "narrow: rinse long, or larger cells"
            finding = f"spheres up to {max(self.opening, 0.0):.4g} mm pass{within}"
        elif self.opening_within is not None:
            verdict, finding = "none", f"no hollow with a narrower way out{within}"
        else:
            verdict, finding = "unknown", "not measured: what is not closed has no inside"
        return [*rows, ("channels", f"{finding}; drain holes {self._hole:g} mm", verdict)]

    @property
    def _hole(self) -> float:
        return self.printer.min_drain_hole

    def _whole_rows(self) -> list[tuple[str, str, str]]:
        closed = "closed" if not self.open_edges else f"{self.open_edges:,} open edges"
        turned = f", {self.inside_out} inside out" if self.inside_out else ""
        pieces = "one piece" if self.pieces == 1 else "falls apart"
        return [
            ("pieces", f"{self.pieces}", pieces),
            ("triangles", f"{self.triangles:,}, {closed}{turned}", "not closed" if self.open_edges else "good"),
            ("units", self.units, "mm"),
        ]


def print_check(
    part: Lattice | FilledPart | str | os.PathLike[str] | tuple[NDArray[np.floating], NDArray[np.integer]],
    printer: str | Printer = "form2",
    deviation: float | None = None,
    progress: Progress | None = None,
) -> PrintCheck:
    """Check whether a printer can make a part.

    Of a lattice or a filled part the smallest wall is known, and of a lattice the channels' opening is worked out from
    the exact surface. Of triangles the walls are measured through them, straight from one side to one that faces away,
    at some thousands of places, sharp edges left out; and the channels on a grid. Pieces are what is connected; layers
    that begin in mid-air, which depend on how the part is turned, are for the printer's own program to find.

    Parameters
    ----------
    part : Lattice, Filled, path-like, or (vertices, triangles)
        A lattice; a filled part; an STL or 3MF file; or arrays of shapes (v, 3), in mm, and (t, 3).
    printer : str or Printer
        A key of ``gyroid_cad/printing/printers.toml``, or the path of a TOML file of one's own.
    deviation : float, optional
        Of the triangles of a lattice or a filled part, in mm, as of :meth:`gyroid_cad.Lattice.write`.
    progress : callable, optional
        Called with (stage, done, total).

    Returns
    -------
    PrintCheck

    Raises
    ------
    ParameterError
    """
    chosen = printer if isinstance(printer, Printer) else printer_named(printer)
    if deviation is not None:
        require_meshing(deviation)
    if isinstance(part, Lattice):
        return _check_lattice(part, chosen, deviation, progress)
    vertices: NDArray[np.floating]
    triangles: NDArray[np.integer]
    min_wall: float | None = None
    if isinstance(part, FilledPart):
        if not part.report.closed:
            raise ParameterError("kind", part.report.kind, "one that is a solid: a bare surface cannot be printed")
        vertices, triangles = _triangles_of(part.solid(), part.deviation(deviation))
        min_wall = part.report.min_wall
    elif isinstance(part, tuple):
        vertices, triangles = part
    elif isinstance(part, str | os.PathLike):
        vertices, triangles = read_triangles(part)
    else:
        accepted = "a Lattice, a filled part, an STL or 3MF file, or arrays of vertices and triangles"
        raise ParameterError("part", part, accepted)
    found = triangle_measures(vertices, triangles)
    ways = way_out(vertices, triangles) if found.closed and not found.inside_out else (None, None)
    if min_wall is not None:
        return _checked(chosen, found.high - found.low, min_wall, 0, ways, found)
    walls = measured_walls(vertices, triangles, _WALLS_MEASURED)
    smallest = float(walls[0]) if len(walls) else None
    return _checked(chosen, found.high - found.low, smallest, len(walls), ways, found)


def _check_lattice(
    lattice: Lattice, printer: Printer, deviation: float | None, progress: Progress | None
) -> PrintCheck:
    fitted = lattice.fitted(progress)
    grading = fitted.spec.grading
    opening = (
        pore_limiting_diameter(grading.surface, grading.cell_size, fitted.min_thickness)
        if grading.uniform
        else narrowest_opening(fitted.at_home().wall, grading, lattice.cells)
    )
    if fitted.spec.trimmed:
        limit = min(lattice.cell_size / 1000, fitted.min_thickness / 10) if deviation is None else deviation
        found = triangle_measures(*_triangles_of(lattice.solid(progress), limit))
        return _checked(printer, found.high - found.low, fitted.min_thickness, 0, (opening, 0.0), found)
    low, high = fitted.bounding_box()
    count = lattice.triangles(deviation, progress).triangulation.triangle_count
    voids, pieces = trapped_voids(fitted.complex), fitted.complex.component_count
    return _checked(printer, high - low, fitted.min_thickness, 0, (opening, 0.0), (voids, pieces, count))


def _triangles_of(shape: KernelShape, deviation: float) -> tuple[NDArray[np.floating], NDArray[np.integer]]:
    # The kernel is loaded only where a shape of it is checked: not for files of triangles.
    from gyroid_cad.kernel.stl import meshed

    return meshed(shape, "triangles", deviation)


def trapped_voids(complex: CellComplex) -> int:
    """Count the regions of empty space within a lattice of whole patches that do not reach outside.

    The wall's surface falls into shells: both faces of every patch, joined across shared edges on either side and,
    where an edge is free, to each other by its side wall. Every piece of the lattice has one shell outside; each
    further one goes round a void (Alexander duality: pieces and voids together are as many as shells).
    """
    first, second = complex.edge_patches[~complex.free].T
    rim = complex.edge_patches[complex.free, 0]
    count = complex.patch_count
    one = np.concatenate([first, first + count, rim])
    other = np.concatenate([second, second + count, rim + count])
    return int(connected(2 * count, one, other).max()) + 1 - complex.component_count


def _checked(
    printer: Printer,
    extents: NDArray[np.float64],
    min_wall: float | None,
    walls_measured: int,
    ways: tuple[float | None, float | None],
    found: TriangleMeasures | tuple[int, int, int],
) -> PrintCheck:
    x, y, z = extents.tolist()
    volume, extents = np.array(printer.build_volume), np.maximum(extents, _FLAT)
    scales = {order: float(np.min(volume / extents[list(order)])) for order in permutations(range(3))}
    # As it stands, if it fits so.
    fitting = next((order for order, scale in scales.items() if scale >= 1 - _ROUNDING), None)
    if isinstance(found, TriangleMeasures):
        counts = found.trapped_voids, found.pieces, found.open_edges, found.inside_out, found.triangles
    else:
        voids, pieces, triangles = found
        counts = voids, pieces, 0, 0, triangles
    wall = min_wall
    return PrintCheck(
        printer=printer,
        size=(x, y, z),
        orientation=None if fitting is None else (fitting[0], fitting[1], fitting[2]),
        scale_to_fit=max(scales.values()),
        min_wall=wall,
        walls_measured=walls_measured,
        scale_for_supported_wall=None if wall is None else printer.min_supported_wall / wall,
        scale_for_wall=None if wall is None else printer.min_unsupported_wall / wall,
        opening=ways[0],
        opening_within=ways[1],
        trapped_voids=counts[0],
        pieces=counts[1],
        open_edges=counts[2],
        inside_out=counts[3],
        triangles=counts[4],
    )


def _rounded_down(scale: float) -> str:
    """Three digits, none of them too large."""
    unit = 10.0 ** (np.floor(np.log10(scale)) - 2)
    return f"{np.floor(scale / unit * (1 + _ROUNDING)) * unit:.3g}"


def _rounded_up(scale: float | None) -> str:
    assert scale is not None
    unit = 10.0 ** (np.floor(np.log10(scale)) - 2)
    return f"{np.ceil(scale / unit * (1 - _ROUNDING)) * unit:.3g}"

"""Check of a part against a printer: does it fit, are its walls thick enough, does resin drain, is it one piece."""

from __future__ import annotations

import os
from itertools import permutations
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.choices import BLOCK_KINDS
from gyroid_cad.common.formats import require_meshing
from gyroid_cad.common.graph import connected
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.channels import way_out
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import TriangleMeasures, measured_walls, triangle_measures
from gyroid_cad.printing.printers import Printer, printer_named
from gyroid_cad.printing.verdict import ROUNDING, PrintCheck
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.pore_limits import narrowest_opening, pore_limiting_diameter

if TYPE_CHECKING:
    from gyroid_cad.filling.report import FillReport
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["print_check", "trapped_voids"]

# At how many places the walls of a part that is known by its triangles alone are measured.
_WALLS_MEASURED = 4000
# What has no height, a single face, is taken for so many mm high.
_FLAT = 1e-9


@runtime_checkable
class FilledPart(Protocol):
    """Stands for :class:`gyroid_cad.Filled`, which is loaded with the kernel; files of triangles need none."""

    @property
    def report(self) -> FillReport: ...

    def solid(self) -> KernelShape: ...

    def deviation(self, given: float | None = None) -> float: ...


@runtime_checkable
class FilledMesh(Protocol):
    """Stands for :class:`gyroid_cad.filling.triangles.FilledTriangles`, which is loaded with the kernel too."""

    @property
    def report(self) -> FillReport: ...

    @property
    def vertices(self) -> NDArray[np.float64]: ...

    @property
    def triangles(self) -> NDArray[np.int64]: ...


def print_check(
    part: Lattice | FilledPart | FilledMesh | str | os.PathLike[str] | tuple[NDArray[np.floating], NDArray[np.integer]],
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
        A lattice; a filled part; an STL, 3MF, OBJ or PLY file; or arrays of shapes (v, 3), in mm, and (t, 3).
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

    Examples
    --------
    >>> from gyroid_cad import Lattice, print_check
    >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
    >>> check.passed, check.wall
    (True, 'good')
    """
    chosen = printer if isinstance(printer, Printer) else printer_named(printer)
    if deviation is not None:
        require_meshing(deviation)
    if isinstance(part, Lattice) and part.kind != BLOCK_KINDS[0]:
        part = part.filled(progress)
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
    elif isinstance(part, FilledMesh):
        vertices, triangles, min_wall = part.vertices, part.triangles, part.report.min_wall
    elif isinstance(part, tuple):
        vertices, triangles = part
    elif isinstance(part, str | os.PathLike):
        vertices, triangles = read_triangles(part)
    else:
        accepted = "a Lattice, a filled part, a file of triangles, or arrays of vertices and triangles"
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
    fitting = next((order for order, scale in scales.items() if scale >= 1 - ROUNDING), None)
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

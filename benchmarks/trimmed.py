"""Triangles of lattices cut to their box: time beside the kernel's mesher and beside whole patches, closedness, order.

Times are of the processor, from the solid to triangles as a file would have them, against the kernel's mesher at the
same deviation and angle, and against the triangles of the same block of whole patches. Closedness is asked of
manifold3d, of thin to thick primitive lattices at deviations of half a wall to ten: more than a triangle can keep to.
Orders are those at which volume and area near the solid's as the deviation falls, angles left free.

Run: ``python -m benchmarks.trimmed [--cells N] [--small]``; ``--small`` is one cell, and few lattices.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import product
from math import radians
from typing import Any
from warnings import catch_warnings

import manifold3d
import numpy as np

from benchmarks.timing import Row, arguments_for, best_of, print_verdicts
from gyroid_cad import IslandsWarning, Lattice
from gyroid_cad.kernel.check import measure
from gyroid_cad.kernel.stl import closed_triangles
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.surface.fit import FitSettings

__all__ = ["main"]

_CELL_SIZE, _DENSITY, _DEVIATION, _ANGLE, _LOOSE_ANGLE = 6.0, 0.3, 0.01, 15.0, 80.0
# Cells, densities, deviations in walls, and angles in degrees.
_CELLS, _DENSITIES, _WALLS = ((1, 1, 1), (2, 1, 1), (2, 2, 2)), (0.03, 0.05, 0.1, 0.2, 0.4), (0.5, 1.0, 2.0, 5.0, 10.0)
_DEVIATIONS = (0.06, 0.03, 0.015, 0.0075)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table; returns whether every requirement is met."""
    parser = arguments_for("Measure triangles of lattices cut to their box.")
    parser.add_argument("--cells", type=int, default=3, help="along a side, for time (default 3)")
    given = parser.parse_args(arguments)
    cells = 1 if given.small else given.cells
    with catch_warnings(action="ignore", category=IslandsWarning):
        rows = [*_times(cells), *_closedness(given.small)]
        for surface in ("primitive",) if given.small else ("gyroid", "diamond", "primitive"):
            rows += _orders(surface)
    return print_verdicts(f"Triangles of lattices cut to their box, {cells} x {cells} x {cells} cells of 6 mm", rows)


def _lattice(cells: int, **options: Any) -> Lattice:
    return Lattice((cells,) * 3, _CELL_SIZE, density=_DENSITY, **options)


def _times(cells: int) -> list[Row]:
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    solid, wall = _lattice(cells, trim="box").solid(), _lattice(cells).wall()

    def by_kernel() -> None:
        copy = BRepBuilderAPI_Copy(solid, False, False).Shape()
        BRepMesh_IncrementalMesh(copy, _DEVIATION, False, radians(_ANGLE), True)

    kernel, _ = best_of(by_kernel, 1)
    ours, made = best_of(lambda: closed_triangles(solid, "triangles", _DEVIATION, _ANGLE), 2)
    whole, of_whole = best_of(lambda: indexed_triangles(triangulated(wall, _DEVIATION)), 2)
    remark = f"{len(made[1]):,} triangles, {ours:.3g} s; of whole patches {len(of_whole[1]):,}, {whole:.3g} s"
    return [
        Row("kernel's mesher, its triangles not joined / ours", kernel / ours, unit="x", remark=remark),
        Row("cut / whole, a triangle", ours / len(made[1]) / (whole / len(of_whole[1])), unit="x"),
    ]


def _closedness(small: bool) -> list[Row]:
    count, open_ones = 0, []
    for cells, density in product(_CELLS[:1], _DENSITIES[:1]) if small else product(_CELLS, _DENSITIES):
        lattice = Lattice(cells, 10, density=density, surface="primitive", trim="box", fit=FitSettings(6))
        solid = lattice.solid()
        for walls in _WALLS:
            vertices, triangles = closed_triangles(solid, "triangles", walls * lattice.wall_thickness, _LOOSE_ANGLE)
            judged = manifold3d.Manifold(manifold3d.Mesh(vertices.astype(np.float32), triangles.astype(np.uint32)))
            count += 1
            if judged.status() != manifold3d.Error.NoError:
                open_ones.append(f"{cells} {density} {walls}")
    return [Row(f"open or non-manifold of {count} primitive lattices", len(open_ones), 0, remark=", ".join(open_ones))]


def _orders(surface: Any) -> list[Row]:
    """Orders from the largest deviation to the smallest; volumes cross the solid's on their way."""
    solid = _lattice(1, trim="box", surface=surface).solid()
    exact = np.array(measure(solid))
    off = []
    for deviation in _DEVIATIONS:
        found = triangle_measures(*closed_triangles(solid, "triangles", deviation, _LOOSE_ANGLE))
        off.append(np.abs(np.array([found.volumes.sum(), found.area]) / exact - 1))
    volume, area = (np.polyfit(np.log(_DEVIATIONS), np.log(some), 1)[0] for some in np.transpose(off))
    remark = f"at {_DEVIATIONS[-1]:g} mm volume {off[-1][0]:.1e}, area {off[-1][1]:.1e} off"
    return [
        Row(f"order of the area of {surface} in the deviation", float(area), 0.85, at_least=True, remark=remark),
        Row(f"order of the volume of {surface}", float(volume), 0.9, at_least=True),
    ]


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

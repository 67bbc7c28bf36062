"""A block of cells to a closed solid: shared by construction, against the kernel's sewing of the same faces.

Ours goes from the fitted patch through the cell complex and the wall to the solid. Sewing
(``BRepBuilderAPI_Sewing``) is given the same faces, located cell by cell: making those is timed apart. It takes
1 ms a face, and more the larger a connected shell grows: at 10 cells a side a quarter of an hour or so.

So a way round that growth is timed beside: one cell sewn, its copies sewn into a row, rows into a layer,
layers into the block. It has no side walls, and gives no solid.

Run: ``python -m benchmarks.solid_against_sewing [--cells N] [--repeats N] [--small]``; ``--small`` builds and sews two
cells a side, once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BSplineSurface
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from benchmarks.subject import CELL_SIZE, block, block_solid, sewn, translation
from benchmarks.timing import Row, arguments_for, best_of, plain_table, print_verdicts
from gyroid_cad.kernel.check import topology
from gyroid_cad.kernel.solid import TOLERANCE
from gyroid_cad.kernel.surfaces import kernel_surface
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["main"]


@dataclass(frozen=True, slots=True)
class _Faces:
    """The kernel's surfaces of the distinct patches, and of their side walls where some patch has one."""

    surfaces: list[list[Geom_BSplineSurface]]
    side_walls: dict[tuple[int, int], Geom_BSplineSurface]


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    options = _parsed(arguments)
    ours, solid = best_of(lambda: block_solid(options.cells), options.repeats)
    wall = block(options.cells)
    making, faces = best_of(lambda: _separate_faces(wall), options.sewing_repeats)
    sewing, shape = best_of(lambda: sewn(faces), options.sewing_repeats)
    staging, staged = best_of(lambda: _sewn_in_stages(options.cells), options.sewing_repeats)
    lines = [
        ("ours, patch to solid", *_figures(ours, solid)),
        ("making the faces", f"{making:.2f} s", f"{len(faces)}", "", ""),
        ("sewing them", *_figures(sewing, shape)),
        ("sewing in stages, no side walls", *_figures(staging, staged)),
    ]
    plain_table(
        f"{options.cells}³ cells to a solid", ("", "processor time", "faces", "solids", "edges not of two faces"), lines
    )
    rows = [
        Row("sewing / ours", sewing / ours, 10, 20, "x", at_least=True),
        Row("making the faces and sewing / ours", (making + sewing) / ours, 10, 20, "x", at_least=True),
        Row("sewing in stages / ours", staging / ours, unit="x", remark="without side walls, no solid"),
        Row("ours, for each face", ours / topology(solid).faces * 1e6, unit=" µs"),
    ]
    return print_verdicts("Solid against sewing", rows)


def _parsed(arguments: Sequence[str]) -> argparse.Namespace:
    parser = arguments_for("Build a block of cells, and sew the same faces.")
    parser.add_argument(
        "--cells", type=int, default=10, help="along each side (default 10: 48,000 faces and side walls)"
    )
    parser.add_argument("--repeats", type=int, default=3, help="of our build; the best counts (default 3)")
    parser.add_argument("--sewing-repeats", type=int, default=1, help="of the sewing (default 1: it is slow)")
    options = parser.parse_args(arguments)
    if options.small:
        options.cells, options.repeats = 2, 1
    return options


def _figures(seconds: float, shape: TopoDS_Shape) -> tuple[str, str, str, str]:
    counts = topology(shape)
    return f"{seconds:.2f} s", f"{counts.faces}", f"{counts.solids}", f"{counts.open_edges}"


def _separate_faces(wall: Wall) -> list[TopoDS_Face]:
    """Every face of the wall by itself, as one makes them for sewing: surfaces and locations are shared."""
    kinds = _faces(wall)
    locations = [translation(shift) for shift in wall.shifts.tolist()]
    free = wall.complex.free[wall.complex.patch_edges].tolist()
    separate = []
    for net, shift, boundary_edges in zip(wall.patch_net.tolist(), wall.patch_shift.tolist(), free, strict=True):
        surfaces = [*kinds.surfaces[net], *(kinds.side_walls[net, k] for k in range(4) if boundary_edges[k])]
        for surface in surfaces:
            face = BRepBuilderAPI_MakeFace(surface, TOLERANCE).Face()
            separate.append(face.Located(locations[shift]))
    return separate


def _faces(wall: Wall) -> _Faces:
    free = wall.complex.free[wall.complex.patch_edges]
    kinds = np.unique(np.stack([np.repeat(wall.patch_net, 4), np.tile(range(4), len(free))])[:, free.ravel()], axis=1)
    return _Faces(
        [[kernel_surface(wall.face(net, side)) for side in SIDES] for net in range(len(wall.nets))],
        {(net, k): kernel_surface(wall.side_wall(net, k)) for net, k in kinds.T.tolist()},
    )


def _sewn_in_stages(cells: int) -> TopoDS_Shape:
    """A cell's faces sewn, then rows, layers and the block of copies of what was sewn before."""
    surfaces = (surface for sides in _faces(block(1)).surfaces for surface in sides)
    part = sewn(BRepBuilderAPI_MakeFace(surface, TOLERANCE).Face() for surface in surfaces)
    for axis in np.eye(3) * CELL_SIZE:
        steps = [translation((step * axis).tolist()) for step in range(cells)]
        part = sewn([part.Moved(step) for step in steps])
    return part


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

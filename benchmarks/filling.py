"""Parts filled with gyroid: boxes of whole cells against the kernel's booleans, and volumes against ray casting.

One period: ours, checks and all, against the kernel's boolean of the same box and a shell thickened by its simple
offset, turned right side out where that hands it back inverted. Five cells a side: against its boolean of the box and
our own untrimmed lattice. Ten: what the time and memory grow by; each of these in a process of its own, by the
processor time of the filling alone. A ball and a bracket read from STEP: the volume against columns of points, the
part's inside told by rays through a fine mesh of it, the wall by distance to dense samples of the exact surface; no
boolean is asked. And whole commands, by the clock.

Run: ``python -m benchmarks.filling [--small]``; ``--small`` fills a part of a period, few
cells and a small cylinder.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.TopoDS import TopoDS_Shape

from benchmarks.memory import peak
from benchmarks.solid_against_thickening import copies, thickened
from benchmarks.subject import CELL_SIZE, THICKNESS, kernel_volume, sewn
from benchmarks.timing import (
    ROOT,
    Row,
    arguments_for,
    best_in_turn,
    fresh_python,
    plain_table,
    print_verdicts,
    seconds_of_process,
)
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.part import part_of
from gyroid_cad.kernel.check import is_valid, topology
from gyroid_cad.kernel.solid import build_solid
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.covering import Frame, covering_complex, nearest_offsets
from gyroid_cad.wall.exact import patch_points_and_normals
from gyroid_cad.wall.offset import build_wall

TUBE = USUAL.tube

__all__ = ["main"]

Floats = NDArray[np.float64]
Fineness = tuple[int, float, float]

# The open request at another project: 5 x 5 x 5 cells of 7 mm at density 0.30.
SIZE, DENSITY = 7.0, 0.30
# Columns along the longest side of the part; of the mesh, mm and radians.
_FINE, _COARSE = (200, 2e-3, 0.02), (16, 2e-2, 0.2)
# Cells a side of the block, sides of the box in its middle in periods, and repeats.
_PERIOD, _SMALL_BOX = (2, 1.0, 2), (1, 0.3, 1)
_DENSE = 49
_POINTS = 4096
# Parts that others drew, if their folder is beside the project's.
PARTS = ROOT.parent / "shared" / "parts"
# Part, options, output, seconds at most, and better.
_COMMANDS = (
    ("plate", "--cell-size 6 --density 0.3", "plate_filled.step", 12, 6),
    ("ball", "--cell-size 6 --density 0.3", "ball_filled.step", 8, 4),
    ("cylinder", "--cell-size 3 --density 0.2+0.01*z --skin 0.5", "cylinder_filled.step", 90, 40),
    ("cylinder", "--cell-size 3 --density 0.2+0.01*z --skin 0.5", "cylinder_filled.stl", 20, 8),
    ("threaded", "--cell-size 6.5 --density 0.3", "threaded_filled.step", 60, 20),
    ("nozzle_band", "--cell-size 6 --density 0.3", "nozzle_filled.step", 60, 20),
)
_SMALL_COMMANDS = (("pin", "--cell-size 8 --density 0.3", "pin_filled.step", None, None),)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    small = arguments_for("Fill boxes, a ball and a bracket.").parse_args(arguments).small
    rows = [*_against_offset(*(_SMALL_BOX if small else _PERIOD)), *_many_cells(1 if small else 5)]
    passed = print_verdicts("Boxes", rows)
    passed &= print_verdicts("Whole commands, file written and checked", [*_commands(small), *_inside(small)])
    return print_verdicts("Free forms", _free_forms(small)) and passed


def _commands(small: bool) -> list[Row]:
    """Commands as a user gives them, by the clock."""
    rows = []
    with TemporaryDirectory() as name:
        folder = Path(name)
        for part, shape in _made().items():
            write_step(shape, folder / f"{part}.step")
        for part, options, output, required, aim in _SMALL_COMMANDS if small else _COMMANDS:
            file = PARTS / f"{part}.step" if part in ("threaded", "nozzle_band") else folder / f"{part}.step"
            if file.exists():
                asked = ["fill", str(file), "-o", output, *options.split(), "--quiet"]
                seconds = seconds_of_process("-m", "gyroid_cad", *asked, folder=folder)
                rows.append(Row(f"fill {part}.step -o {output} {options}", seconds, required, aim, " s"))
    return rows


def _made() -> dict[str, TopoDS_Shape]:
    plate = BRepPrimAPI_MakeBox(40.0, 25.0, 8.0).Shape()
    for x in (8.0, 32.0):
        hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(x, 12.5, -1.0), gp_Dir(0, 0, 1)), 3.0, 10.0).Shape()
        plate = BRepAlgoAPI_Cut(plate, hole).Shape()
    return {
        "plate": plate,
        "ball": BRepPrimAPI_MakeSphere(12.0).Shape(),
        "cylinder": BRepPrimAPI_MakeCylinder(10.0, 20.0).Shape(),
        "pin": BRepPrimAPI_MakeCylinder(2.0, 3.0).Shape(),
    }


def _inside(small: bool) -> list[Row]:
    """Deciding of which points lie in a part, the reading of it not counted."""
    file = PARTS / "threaded.step"
    if small or not file.exists():
        return []
    part = part_of(file)
    points = np.random.default_rng(0).uniform(part.low, part.high, (_POINTS, 3))
    start = time.perf_counter()
    part.contains(points)
    return [Row(f"{_POINTS} points in {file.name}", time.perf_counter() - start, 2, unit=" s")]


def _against_offset(cells: int, side: float, repeats: int) -> list[Row]:
    """A box of so many periods a side in the middle of a block of so many cells a side."""
    lattice = _outwards(thickened(sewn(copies(cells))))
    box = _box((cells - side) / 2 * CELL_SIZE, (cells + side) / 2 * CELL_SIZE)
    (ours, made), (theirs, common) = best_in_turn(
        repeats, lambda: fill(box, CELL_SIZE, THICKNESS), lambda: BRepAlgoAPI_Common(lattice, box).Shape()
    )
    exact = TUBE.density(THICKNESS / CELL_SIZE) * (side * CELL_SIZE) ** 3
    held = made.report.volume + made.report.dropped_volume
    return [
        Row(f"{side:g} periods a side: simple offset, cut / ours", theirs / ours, 5, unit="x", at_least=True),
        Row("  ours: volume off the tube formula", abs(held / exact - 1), 1e-4, remark="with dropped chips"),
        Row("  theirs: volume off the tube formula", abs(kernel_volume(common) / exact - 1), remark=_state(common)),
    ]


def _outwards(solid: TopoDS_Shape) -> TopoDS_Shape:
    """The solid, turned right side out: the simple offset hands back an inverted one at times, all space but a wall."""
    return solid.Reversed() if kernel_volume(solid) < 0 else solid


def _state(shape: TopoDS_Shape) -> str:
    sound = "valid" if is_valid(shape) and topology(shape).closed else "invalid or open"
    return f"{sound}, {topology(shape).faces} faces"


def _many_cells(cells: int) -> list[Row]:
    """So many cells a side by one boolean and by sections, and twice as many by sections."""
    boolean, some, more = (_alone(*what) for what in (("boolean", cells), ("fill", cells), ("fill", 2 * cells)))
    headings = ("", "processor time", "peak memory", "faces", "density")
    lines = [
        (name, f"{took['seconds']:.1f} s", f"{took['peak'] / 1e9:.2f} GB", f"{took['faces']}", f"{took['density']:.6f}")
        for name, took in (
            (f"{cells}³, one boolean", boolean),
            (f"{cells}³, ours", some),
            (f"{2 * cells}³, ours", more),
        )
    ]
    plain_table(f"Cells of {SIZE:g} mm at density {DENSITY}", headings, lines)
    return [
        Row(f"{cells}³: one boolean / ours", boolean["seconds"] / some["seconds"], 3, 8, "x", at_least=True),
        Row(f"{cells}³: density off by", abs(some["density"] - DENSITY), 2e-4),
        Row(f"{cells}³: peak memory", some["peak"] / 1e9, 2, unit=" GB"),
        Row(f"{2 * cells}³ / {cells}³: time", more["seconds"] / some["seconds"], 8, 4, "x"),
    ]


def _alone(what: str, cells: int) -> dict[str, float]:
    result: dict[str, float] = json.loads(fresh_python("-m", "benchmarks.filling", "--alone", what, str(cells)))
    return result


def _run_alone(what: str, cells: int) -> None:
    """Fill, or cut by one boolean, and print what it took."""
    low, high = 0.5 * SIZE, (cells + 0.5) * SIZE
    box = _box(low, high)
    if what == "boolean":
        thickness = float(TUBE.thickness(DENSITY)) * SIZE
        lattice = build_solid(build_wall(build_complex((cells + 1,) * 3), fit_patch(), SIZE, thickness))
        start = time.process_time()
        shape = BRepAlgoAPI_Common(lattice, box).Shape()
        seconds, faces = time.process_time() - start, topology(shape).faces
        density = kernel_volume(shape) / (high - low) ** 3
    else:
        fill(_box(0.0, 2.0), SIZE, density=DENSITY)
        start = time.process_time()
        report = fill(box, SIZE, density=DENSITY).report
        seconds, faces, density = time.process_time() - start, report.faces, report.density
    print(json.dumps({"seconds": seconds, "peak": peak(), "faces": faces, "density": density}))


def _free_forms(small: bool) -> list[Row]:
    if small:
        return _against_columns("cylinder", BRepPrimAPI_MakeCylinder(2.0, 3.0).Shape(), _COARSE)
    bracket = read_step(ROOT / "examples" / "bracket.step")
    return [
        *_against_columns("ball", _ball(12.0), _FINE),
        *_against_columns("bracket from STEP", bracket, _FINE),
    ]


def _ball(radius: float) -> TopoDS_Shape:
    return BRepPrimAPI_MakeSphere(gp_Pnt(1.0, 2.0, 3.0), radius).Shape()


def _against_columns(name: str, part: TopoDS_Shape, fineness: Fineness) -> list[Row]:
    report = fill(part, SIZE, density=DENSITY).report
    thickness = float(TUBE.thickness(DENSITY)) * SIZE
    expected = _volume_by_columns(part, thickness, fineness)
    remark = f"{report.faces} faces, {report.solids} solids, {sum(report.seconds.values()):.0f} s"
    return [
        Row(f"{name}: volume off the columns'", abs(report.volume / expected - 1), 1e-3, remark=remark),
        Row(f"{name}: solids besides the islands", report.solids - report.islands, 1),
    ]


def _volume_by_columns(part: TopoDS_Shape, thickness: float, fineness: Fineness) -> float:
    """Volume of the wall in a part: points at random places of the cells of a grid, along rays through a mesh."""
    columns, deviation, angle = fineness
    triangles = _mesh(part, deviation, angle)
    low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
    step = float((high - low).max()) / columns
    random = np.random.default_rng(0)
    along = [np.arange(low[axis], high[axis], step) for axis in range(3)]
    cell = covering_complex(np.zeros(3), np.full(3, SIZE), Frame(np.zeros(3), np.eye(3)), SIZE, 0.0)
    places, normals = patch_points_and_normals(cell, SIZE, np.linspace(-1, 1, _DENSE))
    hits = 0
    for y in along[1]:
        near = triangles[(triangles[:, :, 1].min(axis=1) <= y + step) & (triangles[:, :, 1].max(axis=1) >= y)]
        points = []
        for z in along[2]:
            at = np.array([y, z]) + step * random.random(2)
            x = along[0] + step * random.random(len(along[0]))
            inside = np.sum(_crossings(near, at)[:, np.newaxis] < x, axis=0) % 2 == 1
            points.append(np.column_stack([x[inside], np.broadcast_to(at, (int(inside.sum()), 2))]))
        some = np.mod(np.concatenate(points), SIZE)
        if len(some):
            hits += int(np.sum(np.abs(nearest_offsets(places, normals, some)[0]) < thickness / 2))
    return hits * step**3


def _crossings(triangles: Floats, at: Floats) -> Floats:
    """Where a ray along x at (y, z) goes through triangles, shape (n, 3, 3)."""
    corners = triangles[:, :, 1:] - at
    following = np.roll(corners, -1, axis=1)
    areas = corners[..., 0] * following[..., 1] - corners[..., 1] * following[..., 0]
    through = np.all(areas > 0, axis=1) | np.all(areas < 0, axis=1)
    # Side k runs from corner k to corner k + 1: its area is the share of the corner after those.
    shares = areas[through]
    x = np.roll(triangles[through][:, :, 0], -2, axis=1)
    return np.asarray(np.sum(shares * x, axis=1) / shares.sum(axis=1))


def _mesh(part: TopoDS_Shape, deviation: float, angle: float) -> Floats:
    """The triangles of a mesh; shape (n, 3, 3)."""
    import cadquery as cq

    vertices, triangles = cq.Shape.cast(part).tessellate(deviation, angle)
    return np.array([vertex.toTuple() for vertex in vertices])[np.array(triangles)]


def _box(low: float, high: float) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(low, low, low), gp_Pnt(high, high, high)).Shape()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        _run_alone(sys.argv[2], int(sys.argv[3]))
    else:
        sys.exit(not main(sys.argv[1:]))

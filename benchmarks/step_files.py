"""STEP files: how fast their text is made, how large it is, and whole commands that write them.

The text of a lattice of whole cells, from its control nets to the file, against the kernel's own writer, which
translates the solid and writes it, both by processor time; making the kernel's solid is not counted.

Run: ``python -m benchmarks.step_files [--small]``; ``--small`` takes one cell instead of five and ten a side.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Writer
from OCP.TopoDS import TopoDS_Shape

from benchmarks.timing import Row, arguments_for, best_in_turn, print_verdicts, seconds_of_process
from gyroid_cad.kernel.step import no_messages
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.counts import topology_in_step
from gyroid_cad.step.products import StepPart, write_products
from gyroid_cad.step.walls import wall_bodies
from gyroid_cad.wall.areas import ShapeSize
from gyroid_cad.wall.offset import Wall

__all__ = ["main"]

SIZE, THICKNESS, DENSITY = 10.0, 0.8, 0.3


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table; returns whether every requirement is met."""
    small = arguments_for("Time STEP files.").parse_args(arguments).small
    some, many = (1, 1) if small else (5, 10)
    lattice = Lattice((some,) * 3, SIZE, THICKNESS)
    wall, solid = lattice.wall(), lattice.solid()
    with TemporaryDirectory() as name:
        ours, theirs = Path(name) / "ours.step", Path(name) / "theirs.step"
        (seconds, _), (by_kernel, _) = best_in_turn(
            1 if small else 3, lambda: _write(wall, ours), lambda: _write_by_kernel(solid, theirs)
        )
        size, faces = ours.stat().st_size, topology_in_step(ours).faces
        whole = Path(name) / "whole.step"
        build = ("-m", "gyroid_cad", "build", "--quiet", "-o", str(whole), "--cell-size", str(SIZE), "--cells")
        all_whole = seconds_of_process(*build, *[str(many)] * 3, "--thickness", str(THICKNESS))
        in_box = seconds_of_process(*build, *[str(some)] * 3, "--density", str(DENSITY), "--trim", "box")
        return print_verdicts(
            "STEP files",
            [
                Row(f"{some}³ whole cells: the kernel's writer / ours", by_kernel / seconds, 5, 10, "x", at_least=True),
                Row(f"{some}³ whole cells: ours", seconds, unit=" s", remark=f"{size / 1e6:.1f} MB"),
                Row("size a face", size / faces / 1e3, 5.5, unit=" kB", remark=f"{faces} faces"),
                Row(f"{many}³ whole cells, options to STEP", all_whole, 25, 12, " s", remark="whole process"),
                Row(f"{some}³ cells in a box, options to STEP", in_box, unit=" s", remark="whole process"),
                Row(f"{some}³ cells in a box, file", whole.stat().st_size / 1e6, 48, 36, " MB"),
            ],
        )


def _write(wall: Wall, path: Path) -> None:
    write_products(path, path.stem, [StepPart(path.stem, wall_bodies(wall))], size=ShapeSize(1.0, 1.0, (0.0, 0.0, 0.0)))


def _write_by_kernel(solid: TopoDS_Shape, path: Path) -> None:
    with no_messages():
        writer = STEPControl_Writer()
        Interface_Static.SetIVal_s("write.surfacecurve.mode", 0)
        writer.Transfer(solid, STEPControl_AsIs)
        writer.Write(str(path))


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

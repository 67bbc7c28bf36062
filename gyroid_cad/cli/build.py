"""``gyroid-cad build``: a lattice as a solid or as triangles."""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.check import checked_files, print_made
from gyroid_cad.cli.console import shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options, printed_options
from gyroid_cad.cli.options import (
    HEADER_KEYS,
    angle_option,
    author_options,
    check_option,
    deviation_option,
    json_option,
    output_option,
    printer_option,
    quiet_option,
    regions_option,
    schema_option,
)
from gyroid_cad.cli.print_check import check_by
from gyroid_cad.common.files import file_sizes
from gyroid_cad.common.formats import BREP, PART_FORMATS, format_of, listed_endings

if TYPE_CHECKING:
    from gyroid_cad.builds.assembly import AssemblyReport
    from gyroid_cad.builds.report import LatticeReport
    from gyroid_cad.builds.triangles import TriangleReport
    from gyroid_cad.filling.report import FillReport

    _Report = AssemblyReport | LatticeReport | TriangleReport | FillReport

__all__ = ["build_command"]

# Of what is written by the kernel alone.
_BY_KERNEL = ("kernel_check", "pcurves", "products")


@click.command("build")
@output_option(
    f"{listed_endings(PART_FORMATS)}; may be repeated. For .stl and .3mf of whole patches no solid is built."
)
@lattice_options
@schema_option
@author_options
@click.option(
    "--instances",
    is_flag=True,
    help="Write .step as an assembly: one cell and its places, named and coloured. Hundreds of times smaller, to look "
    "at and lay out; the cells touch and are not fused. Of cells that are all alike and not trimmed.",
)
@click.option(
    "--kernel-check",
    is_flag=True,
    help="Have the kernel build and check the solid of .step too, as of .brep and of trimmed lattices.",
)
@regions_option
@deviation_option
@angle_option
@check_option
@printer_option("Check as well whether it can make this, such as form2.")
@click.option("--print-config", is_flag=True, help="Print the lattice as TOML, ready for LATTICE.toml; build nothing.")
@json_option
@quiet_option
def build_command(print_config: bool, as_json: bool, quiet: bool, **given: Any) -> None:
    """Build a lattice as a closed solid, or as triangles, and write it.

    Expressions are of x, y and z in mm, of places in the lattice before anything is moved; pi and functions
    such as sqrt, sin, clip and smooth_minimum are known. A TOML file has these options as keys, with underscores;
    options given as well override it.

    \b
    gyroid-cad build -o part.step -o part.stl --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad build -o print.stl -o print.3mf --cells 8 8 8 --cell-size 5 --density 0.2 --deviation 0.02
    gyroid-cad build -o many.step --instances --cells 20 20 20 --cell-size 5 --density 0.2
    gyroid-cad build -o part.step --cells 3 3 1 --cell-size 10 --thickness "0.6 + 0.04*x"
    gyroid-cad build -o block.step --cells 5 5 5 --cell-size 7 --density 0.3 --trim box
    gyroid-cad build -o core.step --cells 2 2 2 --cell-size 7 --thickness 0.6 --trim box --kind bodies
    gyroid-cad build -o ring.step --cells 12 2 1 --cell-size 10 --density 0.2 --map cylinder:radius=20,angle=360
    gyroid-cad build -o print.stl --cells 4 4 4 --cell-size 12 --thickness 0.8 --printer form2
    gyroid-cad build -o paper.step --cells 3 3 2 --thickness-factor "0.08 + 0.05*x" --bc-length "1 + 0.05*x" --scale 5
    """
    start = time.perf_counter()
    if not (given["output"] or print_config):
        raise click.UsageError("Missing option '-o' / '--output'.")
    lattice = lattice_of(given)
    if print_config:
        click.echo(printed_options(), nl=False)
        return
    outputs, printer = given["output"], given["printer"]
    checked = None if printer is None else check_by(printer)
    others = ("deviation", "angle", "regions", "instances", "kernel_check")
    settings = {name: given[name] for name in (*HEADER_KEYS, *others)}
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        lattice.write(*outputs, **settings, progress=progress)
        report: _Report
        if given["instances"]:
            report = lattice.assembly_report(progress)
        elif lattice.needs_solid(outputs):
            by_kernel = any(given[name] for name in _BY_KERNEL) or any(format_of(path) is BREP for path in outputs)
            report = lattice.report(progress, by_kernel)
        else:
            report = lattice.triangle_report(given["deviation"], progress)
        check = None if checked is None else checked(lattice, given["deviation"], progress)
        of_files = checked_files(outputs if given["check"] else (), progress)
    summary = _summary(report, outputs, time.perf_counter() - start)
    print_made(report.rows(), summary, check, of_files, as_json, quiet)


def _summary(report: _Report, outputs: Sequence[str], total: float) -> dict[str, Any]:

    summary = asdict(report)
    summary["seconds"] = {stage: round(value, 4) for stage, value in {**report.seconds, "total": total}.items()}
    summary["files"] = file_sizes(outputs)
    return summary

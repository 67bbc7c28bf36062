"""``gyroid-cad fill``: a part from a STEP file goes in, the same part filled with gyroid comes out."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import click

from gyroid_cad.cli.console import print_report, shown_progress
from gyroid_cad.cli.lattice_options import density_of, porosity_option, require_one_wall, surface_option
from gyroid_cad.cli.options import (
    angle_option,
    deviation_option,
    file_paths,
    json_option,
    output_option,
    quiet_option,
    schema_option,
)
from gyroid_cad.common.choices import KINDS, Schema
from gyroid_cad.common.files import file_sizes
from gyroid_cad.common.formats import PART_FORMATS, listed_endings

__all__ = ["fill_command"]


@click.command("fill")
@click.argument("part", metavar="PART.step", shell_complete=file_paths)
@output_option(f"{listed_endings(PART_FORMATS)}; may be repeated.", required=True)
@surface_option
@click.option("--cell-size", type=float, required=True, metavar="MM", help="Period of the cubic cell.")
@click.option(
    "--thickness",
    metavar="MM",
    help='Whole wall: a number, below 0.37647 of the cell size, or an expression such as "0.8 + 0.02*x".',
)
@click.option(
    "--density", metavar="RHO", help="Volume fraction instead: of the wall, which may be an expression, or a network."
)
@porosity_option
@click.option("--skin", type=float, metavar="MM", help="Keep a solid shell of the part, fused with the infill.")
@click.option(
    "--opening",
    "openings",
    multiple=True,
    metavar="FACE",
    help="Leave the skin open at a face: >Z, <X and the like for the one furthest that way, or a point X,Y,Z on it; "
    "may be repeated.",
)
@click.option(
    "--kind",
    type=click.Choice(KINDS),
    default="sheet",
    show_default=True,
    help="The wall, one of the two networks it parts, both of them without the wall, or the mid-surface alone.",
)
@click.option("--origin", nargs=3, type=float, default=(0, 0, 0), metavar="X Y Z", help="Of the lattice, in mm.")
@click.option("--rotation", nargs=3, type=float, default=(0, 0, 0), metavar="A B C", help="About x, y, z, in degrees.")
@click.option(
    "--control-points", type=int, default=10, show_default=True, metavar="N", help="Of a patch, along a side."
)
@click.option(
    "--drop-islands",
    is_flag=True,
    help="Drop all pieces not connected to the largest one; small ones, of less than a hundredth of what a cell holds, "
    "are dropped anyway.",
)
@click.option("--keep-islands", is_flag=True, help="Keep small ones too.")
@click.option("--material-density", type=float, metavar="G/CM3", help="For the masses in the report.")
@schema_option
@deviation_option
@angle_option
@json_option
@quiet_option
def fill_command(
    part: str,
    output: tuple[str, ...],
    control_points: int,
    schema: Schema,
    deviation: float | None,
    angle: float,
    openings: tuple[str, ...],
    as_json: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Fill the solids of a STEP file with gyroid and write what is left.

    \b
    gyroid-cad fill part.step -o light.step --cell-size 7 --density 0.30
    gyroid-cad fill part.step -o light.step --cell-size 7 --density 0.30 --skin 1 --opening ">Z"
    gyroid-cad fill part.step -o fluids.step --cell-size 7 --thickness 0.6 --kind channels
    """
    start = time.perf_counter()
    from gyroid_cad.builds.solid import require_settings
    from gyroid_cad.common.formats import require_formats
    from gyroid_cad.filling.fill import fill
    from gyroid_cad.surface.fit import FitSettings

    if given["kind"] != "surface":
        require_one_wall(given)
    require_formats(output)
    require_settings((1, 1, 1), schema, deviation, angle)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        faces = [_face(opening) for opening in openings]
        given["density"] = density_of(given)
        del given["porosity"]
        filled = fill(part, fit=FitSettings(control_points), openings=faces, progress=progress, **given)
        filled.write(*output, schema=schema, deviation=deviation, angle=angle, progress=progress)
    summary = filled.report.as_dict()
    summary["seconds"] = {**summary["seconds"], "total": time.perf_counter() - start}
    summary["files"] = file_sizes(output)
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        print_report(filled.report.rows(), summary["files"], summary["seconds"]["total"])


def _face(opening: str) -> str | list[float]:
    """A selector as it stands, or the coordinates of a point."""
    try:
        return [float(number) for number in opening.split(",")]
    except ValueError:
        return opening

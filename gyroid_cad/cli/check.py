"""``gyroid-cad check``: whether those who receive a file will take it."""

from __future__ import annotations

import json
import sys
import time
from typing import TYPE_CHECKING

import click

from gyroid_cad.cli.console import print_table, shown_progress
from gyroid_cad.cli.options import file_paths, json_option
from gyroid_cad.common.choices import PROFILES
from gyroid_cad.common.memory import require_libraries

if TYPE_CHECKING:
    from gyroid_cad.common.choices import Profile

__all__ = ["check_command"]


@click.command("check")
@click.argument("file", metavar="FILE", shell_complete=file_paths)
@click.option(
    "--profile",
    type=click.Choice(PROFILES),
    default="default",
    show_default=True,
    help="Limits of Creo's GeomIntegrityCHECK or of CADdoctor for NX; by default the stricter of either, without those "
    "that the size of cells decides.",
)
@json_option
@click.option("--quiet", is_flag=True, help="Print no table and no progress: the status tells.")
@click.pass_context
def check_command(context: click.Context, /, file: str, profile: Profile, as_json: bool, quiet: bool) -> None:
    """Check a file as those who receive it will: a STEP, BREP, STL, 3MF, OBJ or PLY file of any origin.

    Of solids: whether they are closed and valid, their volume; the shortest edge, gaps, tangency across smooth edges,
    degrees, knots, narrow faces, sharp corners, curvature, faces that cross, tolerances. Of triangles: whether they are
    watertight and manifold, cross, or have no area. Each is told with its worst value, its limit and its place. The
    status is 1 if a limit is broken.

    \b
    gyroid-cad check part.step
    gyroid-cad check part.step --profile creo --json
    gyroid-cad check part.stl
    """
    start = time.perf_counter()
    require_libraries(kernel=False)
    from gyroid_cad.builds.file_check import check_file

    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        check = check_file(file, profile, progress)
    if as_json:
        click.echo(json.dumps(check.as_dict()))
    elif not quiet:
        print_table(check.header(), [*check.rows(), ("time", f"{time.perf_counter() - start:.2f} s", "", "", "")])
    if not check.ok:
        context.exit(1)

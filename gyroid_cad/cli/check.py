"""``gyroid-cad check``: whether those who receive a file will take it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.console import print_check_table, print_report, print_table, shown_progress
from gyroid_cad.cli.options import file_paths, json_option
from gyroid_cad.common.choices import PROFILES
from gyroid_cad.common.memory import require_libraries
from gyroid_cad.common.progress import named_progress

if TYPE_CHECKING:
    from gyroid_cad.builds.file_check import FileCheck
    from gyroid_cad.common.choices import Profile
    from gyroid_cad.common.progress import Progress
    from gyroid_cad.common.tables import Rows
    from gyroid_cad.printing.verdict import PrintCheck

__all__ = ["check_command", "checked_files", "print_made"]


def checked_files(paths: Sequence[str], progress: Progress | None, profile: Profile = "default") -> list[FileCheck]:
    """Check files by the limits of a profile, one after the other."""
    from gyroid_cad.builds.file_check import check_file

    return [check_file(path, profile, named_progress(progress, path)) for path in paths]


def print_made(
    rows: Rows,
    summary: dict[str, Any],
    check: PrintCheck | None,
    of_files: Sequence[FileCheck],
    as_json: bool,
    quiet: bool,
) -> None:
    """Print what was made and what its checks found; leave with status 1 if a limit is broken in one of the files.

    Parameters
    ----------
    rows : list of (str, str)
        Of the report.
    summary : dict
        The same for JSON, with the files and the seconds in all.
    check : PrintCheck, optional
    of_files : sequence of FileCheck
    as_json, quiet : bool
    """
    if check is not None:
        summary["print_check"] = check.as_dict()
    if of_files:
        summary["checks"] = [one.as_dict() for one in of_files]
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        print_report(rows, summary["files"], summary["seconds"]["total"])
        if check is not None:
            print_check_table(check)
        for one in of_files:
            print_table((one.file, *one.header()[1:]), one.rows())
    _require_unbroken(of_files)


def _require_unbroken(checks: Sequence[FileCheck]) -> None:
    if not all(check.ok for check in checks):
        click.get_current_context().exit(1)


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
def check_command(file: str, profile: Profile, as_json: bool, quiet: bool) -> None:
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
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        (check,) = checked_files([file], progress, profile)
    if as_json:
        click.echo(json.dumps(check.as_dict()))
    elif not quiet:
        print_table(check.header(), [*check.rows(), ("time", f"{time.perf_counter() - start:.2f} s", "", "", "")])
    _require_unbroken([check])

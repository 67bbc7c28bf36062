"""``gyroid-cad print-check``: whether a printer can make a file of triangles, or a lattice."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.console import print_check_table, shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options_beside, options_given
from gyroid_cad.cli.options import json_option, printer_option
from gyroid_cad.common.formats import TOML, TRIANGLE_FORMATS, format_of, require_format
from gyroid_cad.common.memory import require_libraries

if TYPE_CHECKING:
    from gyroid_cad.common.progress import Progress
    from gyroid_cad.printing.verdict import PrintCheck

__all__ = ["check_by", "print_check_command"]

_HOW = ("printer", "deviation", "as_json", "quiet", "config")


def check_by(printer: str) -> Callable[[Any, float | None, Progress | None], PrintCheck]:
    """Return what checks a part by a printer of a name, or of a file, which is read at once.

    Raises
    ------
    ParameterError
        If there is no such printer.
    """
    from gyroid_cad.printing.print_check import print_check
    from gyroid_cad.printing.printers import printer_named

    chosen = printer_named(printer)
    return lambda part, deviation, progress: print_check(part, chosen, deviation, progress)


@click.command("print-check")
@lattice_options_beside("FILE.stl|FILE.3mf|LATTICE.toml")
@printer_option("One that is known, or a TOML file of one's own like the package's printers.toml.", "form2")
@click.option("--deviation", type=float, metavar="MM", help="Of a lattice's triangles, as of build.")
@json_option
@click.option("--quiet", is_flag=True, help="Print no table and no progress: the status tells.")
@click.pass_context
def print_check_command(
    context: click.Context, /, printer: str, deviation: float | None, as_json: bool, quiet: bool, **given: Any
) -> None:
    """Check whether a printer can make a part: its size, walls, trapped voids, drainage, pieces.

    The part is an STL or 3MF file of any origin, or a lattice described as for "build", by options or in a TOML
    file. STL has no unit and is taken in mm, as PreForm takes it; 3MF says its own. The status is 1 if the part
    cannot be printed as it is.

    \b
    gyroid-cad print-check part.stl --printer form2
    gyroid-cad print-check part.3mf --json
    gyroid-cad print-check --cells 4 4 4 --cell-size 12 --thickness 0.8
    """
    start = time.perf_counter()
    require_libraries(kernel=False)
    checked, file = check_by(printer), given["config"]
    part: Any = file
    if file is None or format_of(file) is TOML:
        part = lattice_of(given)
    else:
        require_format("input file", file, TRIANGLE_FORMATS, "a lattice in a .toml file, or a file ending in ")
        described = options_given(_HOW)
        if described:
            raise click.UsageError(f"{file} is a part already: none of {', '.join(described)}")
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        check = checked(part, deviation, progress)
    if as_json:
        click.echo(json.dumps({**check.as_dict(), "seconds": time.perf_counter() - start}))
    elif not quiet:
        print_check_table(check)
    if not check.passed:
        context.exit(1)

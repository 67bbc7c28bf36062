"""``gyroid-cad report``: a lattice, or what a file holds, on one page or as JSON."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.console import print_table, shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options_beside, options_given
from gyroid_cad.cli.options import file_paths, printer_option
from gyroid_cad.common.formats import PART_FORMATS, TOML, format_of, require_format
from gyroid_cad.common.memory import require_libraries
from gyroid_cad.errors import ParameterError

if TYPE_CHECKING:
    from gyroid_cad.common.progress import Progress
    from gyroid_cad.report.sections import Report

__all__ = ["report_command"]

# Of how the report is given, whatever it is on.
_COMMON = {"config", "output", "as_json", "quiet", "help"}


@click.command("report")
@click.option(
    "-o",
    "--output",
    multiple=True,
    metavar="FILE.html",
    shell_complete=file_paths,
    help="One page that needs nothing else and opens offline.",
)
@lattice_options_beside("LATTICE.toml|FILE")
@click.option(
    "--subdivisions",
    type=int,
    default=8,
    show_default=True,
    metavar="N",
    help="Elements along each side of a patch, of the mesh whose quality is told.",
)
@printer_option("By which the lattice is checked; one that is known, or a .toml file.", "form2")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.option("--quiet", is_flag=True, help="Print nothing and no progress.")
def report_command(
    output: tuple[str, ...], subdivisions: int, printer: str, as_json: bool, quiet: bool, **given: Any
) -> None:
    """Report on a lattice, or on a STEP, BREP, STL, 3MF, OBJ or PLY file.

    Of a lattice, described as for "build" by options or in a TOML file: pictures, wall thickness, pore sizes, density,
    areas, exact against fitted, element quality, print check. Of a file, named in place of LATTICE.toml: pictures,
    size, volume and area, whether it is closed and valid, and, of triangles, the print check.

    \b
    gyroid-cad report -o lattice.html --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad report lattice.toml -o lattice.html --json
    gyroid-cad report part.step -o part.html
    """
    start = time.perf_counter()
    require_libraries(kernel=False)
    from gyroid_cad.report.page import require_page, write_page

    if not output and not as_json:
        raise click.UsageError("Missing option '-o' / '--output', or --json.")
    if len(output) > 1:
        raise ParameterError("output", list(output), "one file")
    for page in output:
        require_page(page)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        report = _report(given, subdivisions, printer, progress)
        for page in output:
            write_page(report, page)
    if as_json:
        click.echo(json.dumps(report.as_dict()))
    elif not quiet:
        _print(report, output[0], time.perf_counter() - start)


def _report(given: dict[str, Any], subdivisions: int, printer: str, progress: Progress | None) -> Report:
    from gyroid_cad.report.sections import report_on_file, report_on_lattice, require_subdivisions

    path = given["config"]
    if path is None or format_of(path) is TOML:
        require_subdivisions(subdivisions)
        return report_on_lattice(lattice_of(given), subdivisions, progress, printer)
    require_format("input file", path, PART_FORMATS, "a lattice in a .toml file, or a file ending in ")
    mixed = options_given(_COMMON)
    if mixed:
        raise click.UsageError(f"of a file there is nothing to choose: without {', '.join(mixed)}")
    return report_on_file(path, progress)


def _print(report: Report, output: str, seconds: float) -> None:
    rows = [("report on", report.title)]
    values = report.as_dict()
    if report.kind == "lattice":
        measures, sizes = values["measures"], values["pores"]["sizes"]
        rows += [
            ("density", f"{measures['density']:.5f}"),
            ("pore sizes", f"median {sizes['median']:.4g} mm, largest {sizes['largest']:.4g} mm"),
            ("area / volume", f"{measures['area_per_volume']:.5g} mm2/mm3"),
        ]
    print_table(None, [*rows, (output, f"{Path(output).stat().st_size:,} bytes"), ("time", f"{seconds:.2f} s")])

"""The command line: parse, describe the lattice, build, write, print. No geometry."""

from __future__ import annotations

import json
import sys
import time
import warnings
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.cli.completion import answered_shell, completion_command
from gyroid_cad.cli.console import print_check_table, print_report, print_table, shown_progress
from gyroid_cad.cli.doctor import doctor_command, version_option
from gyroid_cad.cli.fill import fill_command
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options, printed_options
from gyroid_cad.cli.mesh import mesh_command, volumes_command
from gyroid_cad.cli.messages import BAD_USAGE, Session, debug_option, failed
from gyroid_cad.cli.options import (
    angle_option,
    deviation_option,
    json_option,
    output_option,
    printer_option,
    quiet_option,
    schema_option,
)
from gyroid_cad.cli.print_check import print_check_command
from gyroid_cad.cli.report import report_command
from gyroid_cad.cli.view import view_command
from gyroid_cad.common.files import file_sizes
from gyroid_cad.common.formats import PART_FORMATS, listed_endings
from gyroid_cad.errors import IslandsWarning

if TYPE_CHECKING:
    from gyroid_cad.builds.assembly import AssemblyReport
    from gyroid_cad.builds.triangles import TriangleReport
    from gyroid_cad.lattice import LatticeReport

__all__ = ["main"]

PROGRAM = "gyroid-cad"
DONE = 0


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@version_option
def commands() -> None:
    """The gyroid as exact-grade CAD solids. Lengths are in millimetres, angles in degrees.

    \b
    gyroid-cad build -o part.step --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad doctor
    """


@commands.command()
@output_option(
    f"{listed_endings(PART_FORMATS)}; may be repeated. For .stl and .3mf of whole patches no solid is built."
)
@lattice_options
@schema_option
@click.option(
    "--instances",
    is_flag=True,
    help="Write .step as an assembly: one cell and its places, named and coloured. Hundreds of times smaller, to look "
    "at and lay out; the cells touch and are not fused. Of cells that are all alike and not trimmed.",
)
@deviation_option
@angle_option
@printer_option("Check as well whether it can make this, such as form2.")
@click.option("--print-config", is_flag=True, help="Print the lattice as TOML, ready for LATTICE.toml; build nothing.")
@json_option
@quiet_option
def build(print_config: bool, as_json: bool, quiet: bool, **given: Any) -> None:
    """Build a lattice as a closed solid, or as triangles, and write it.

    Expressions are of x, y and z in mm, of places in the lattice before anything is moved; pi and functions
    such as sqrt, sin, exp and minimum are known. A TOML file has these options as keys, with underscores;
    options given as well override it.

    \b
    gyroid-cad build -o part.step -o part.stl --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad build -o print.stl -o print.3mf --cells 8 8 8 --cell-size 5 --density 0.2 --deviation 0.02
    gyroid-cad build -o many.step --instances --cells 20 20 20 --cell-size 5 --density 0.2
    gyroid-cad build -o part.step --cells 3 3 1 --cell-size 10 --thickness "0.6 + 0.04*x"
    gyroid-cad build -o block.step --cells 5 5 5 --cell-size 7 --density 0.3 --trim box
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
    if printer is not None:
        from gyroid_cad.printing.print_check import print_check
        from gyroid_cad.printing.printers import printer_named

        printer = printer_named(printer)
    settings = {name: given[name] for name in ("schema", "deviation", "angle", "instances")}
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        lattice.write(*outputs, **settings, progress=progress)
        report: AssemblyReport | LatticeReport | TriangleReport
        if given["instances"]:
            report = lattice.assembly_report(progress)
        elif lattice.needs_solid(outputs):
            report = lattice.report(progress)
        else:
            report = lattice.triangle_report(given["deviation"], progress)
        check = None if printer is None else print_check(lattice, printer, given["deviation"], progress)
    summary = _summary(report, outputs, time.perf_counter() - start)
    if check is not None:
        summary["print_check"] = check.as_dict()
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        print_report(report.rows(), summary["files"], summary["seconds"]["total"])
        if check is not None:
            print_check_table(check)


for _command in (
    *(fill_command, mesh_command, volumes_command, view_command, print_check_command),
    *(report_command, doctor_command, completion_command),
):
    commands.add_command(_command)


@commands.command("fit-report")
@click.option(
    "--control-points", type=int, default=10, show_default=True, metavar="N", help="Of our fit, along a side."
)
@json_option
def fit_report_command(control_points: int, as_json: bool) -> None:
    """Compare our fit of the patch with the paper's, side by side.

    \b
    gyroid-cad fit-report
    gyroid-cad fit-report --control-points 14 --json
    """
    from gyroid_cad.surface.fit import FitSettings, fit_patch
    from gyroid_cad.surface.fit_report import fit_report

    ours, paper = (fit_report(fit_patch(settings)) for settings in (FitSettings(control_points), FitSettings.paper()))
    if as_json:
        click.echo(json.dumps({"smooth": asdict(ours), "paper": asdict(paper)}))
        return
    rows = [(*row, beside) for row, (_, beside) in zip(ours.rows(), paper.rows(), strict=True)]
    print_table(("L is the cell size", f"ours ({control_points} x {control_points})", "the paper's (10 x 10)"), rows)


for _command in (commands, *commands.commands.values()):
    debug_option(_command)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        ``sys.argv[1:]`` if left out.

    Returns
    -------
    int
        0 done, 1 failed, 2 bad usage; an error is one line on stderr.
    """
    if (answered := answered_shell(commands, PROGRAM)) is not None:
        return answered
    session = Session()
    try:
        # Not commands.main: it would put an empty line before the one that says "interrupted".
        with (
            commands.make_context(
                PROGRAM, list(sys.argv[1:] if arguments is None else arguments), obj=session
            ) as context,
            warnings.catch_warnings(),
        ):
            # The tables and the JSON tell of them.
            warnings.simplefilter("ignore", IslandsWarning)
            commands.invoke(context)
        return DONE
    except click.exceptions.Exit as left:
        return left.exit_code
    except click.exceptions.NoArgsIsHelpError as shown:
        click.echo(shown.format_message(), err=True)
        return BAD_USAGE
    except (Exception, KeyboardInterrupt) as problem:
        return failed(problem, PROGRAM, session)


def _summary(
    report: AssemblyReport | LatticeReport | TriangleReport, outputs: Sequence[str], total: float
) -> dict[str, Any]:

    summary = asdict(report)
    summary["seconds"] = {stage: round(value, 4) for stage, value in {**report.seconds, "total": total}.items()}
    summary["files"] = file_sizes(outputs)
    return summary

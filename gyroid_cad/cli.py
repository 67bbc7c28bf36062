"""The command line: parse, describe the lattice, build, write, print. No geometry."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.errors import GyroidError, ParameterError
from gyroid_cad.version import __version__

if TYPE_CHECKING:
    from gyroid_cad.lattice import LatticeReport

__all__ = ["main"]

PROGRAM = "gyroid-cad"
# Columns of a pipe, which has none.
_UNWRAPPED = 100_000
DONE, FAILED, BAD_USAGE, INTERRUPTED = 0, 1, 2, 130

Progress = Callable[[str, int, int], None]


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name=PROGRAM)
def commands() -> None:
    """The gyroid as exact-grade CAD solids. Lengths are in millimetres, angles in degrees."""


@commands.command()
@click.option(
    "-o",
    "--output",
    "outputs",
    multiple=True,
    required=True,
    metavar="FILE",
    help=".step, .stp, .brep or .stl; may be repeated.",
)
@click.option("--cells", nargs=3, type=int, required=True, metavar="NX NY NZ", help="Cubic cells along x, y and z.")
@click.option("--cell-size", type=float, required=True, metavar="MM", help="Period of the cubic cell.")
@click.option("--thickness", type=float, metavar="MM", help="Whole wall, below 0.37647 of the cell size.")
@click.option("--density", type=float, metavar="RHO", help="Volume fraction instead of thickness, below 0.94033.")
@click.option(
    "--control-points", type=int, default=10, show_default=True, metavar="N", help="Of a patch, along a side."
)
@click.option(
    "--fit",
    type=click.Choice(["smooth", "paper"]),
    default="smooth",
    show_default=True,
    help="The paper's own leaves gaps between patches, and is refused with their size.",
)
@click.option(
    "--schema", type=click.Choice(["ap214", "ap242"]), default="ap214", show_default=True, help="Of STEP files."
)
@click.option(
    "--deviation",
    type=float,
    metavar="MM",
    help="Of STL facets; a thousandth of the cell size if left out, or a tenth of a thin wall.",
)
@click.option("--angle", type=float, default=15.0, show_default=True, metavar="DEGREES", help="Between STL facets.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
@click.option("--quiet", is_flag=True, help="Print no table and no progress.")
def build(
    outputs: tuple[str, ...],
    cells: tuple[int, int, int],
    cell_size: float,
    thickness: float | None,
    density: float | None,
    control_points: int,
    fit: str,
    schema: str,
    deviation: float | None,
    angle: float,
    as_json: bool,
    quiet: bool,
) -> None:
    """Build a lattice as a closed solid and write it.

    \b
    gyroid-cad build -o part.step -o part.stl --cells 2 2 2 --cell-size 10 --thickness 0.8
    """
    start = time.perf_counter()
    if (thickness is None) == (density is None):
        raise click.UsageError("give exactly one of --thickness and --density")

    from gyroid_cad.lattice import Lattice

    lattice = Lattice(cells, cell_size, thickness, density, _fit_settings(fit, control_points))
    with _progress(shown=sys.stderr.isatty() and not quiet) as progress:
        lattice.write(*outputs, schema=schema, deviation=deviation, angle=angle, progress=progress)
        report = lattice.report(progress)
    summary = _summary(report, outputs, time.perf_counter() - start)
    if as_json:
        click.echo(json.dumps(summary))
    elif not quiet:
        _print_summary(summary)


@commands.command("fit-report")
@click.option(
    "--control-points", type=int, default=10, show_default=True, metavar="N", help="Of our fit, along a side."
)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object instead of the table.")
def fit_report_command(control_points: int, as_json: bool) -> None:
    """What our fit and the paper's are worth, side by side."""
    from gyroid_cad.fit import FitSettings, fit_patch, fit_report

    reports = {
        "smooth": asdict(fit_report(fit_patch(FitSettings(control_points)))),
        "paper": asdict(fit_report(fit_patch(FitSettings.paper()))),
    }
    if as_json:
        click.echo(json.dumps(reports))
        return
    labels = {
        "max_distance": "largest distance along the normal / L",
        "rms_distance": "rms distance along the normal / L",
        "max_normal_angle": "largest angle between normals, degrees",
        "max_mean_curvature": "largest mean curvature x L (exact: 0)",
        "rms_mean_curvature": "rms mean curvature x L",
        "edge_gap": "gap between an edge and its neighbour's / L",
        "corner_error": "corners off by / L",
    }
    rows = [(label, *(f"{report[key]:.2e}" for report in reports.values())) for key, label in labels.items()]
    _print_table(("L is the cell size", f"ours ({control_points} x {control_points})", "the paper's (10 x 10)"), rows)


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
    try:
        # Not commands.main: it would put an empty line before the one that says "interrupted".
        with commands.make_context(PROGRAM, list(sys.argv[1:] if arguments is None else arguments)) as context:
            commands.invoke(context)
        status = DONE
    except click.exceptions.Exit as left:
        status = left.exit_code
    except click.exceptions.NoArgsIsHelpError as shown:
        click.echo(shown.format_message(), err=True)
        status = BAD_USAGE
    except click.ClickException as problem:
        status = _fail(problem.format_message(), BAD_USAGE)
    except ParameterError as problem:
        status = _fail(_with_option_name(problem), BAD_USAGE)
    except GyroidError as problem:
        status = _fail(str(problem), FAILED)
    except (click.Abort, KeyboardInterrupt):
        status = _fail("interrupted", INTERRUPTED)
    except Exception as problem:  # a defect of ours is still one line for the user
        status = _fail(f"unexpected {type(problem).__name__}: {problem}", FAILED)
    return status


def _fail(message: str, status: int) -> int:
    click.echo(f"{PROGRAM}: error: {' '.join(message.split())}", err=True)
    return status


def _with_option_name(problem: ParameterError) -> str:
    option = "-o" if problem.parameter == "output" else "--" + problem.parameter.replace("_", "-")
    return str(problem).replace(problem.parameter, option, 1)


def _fit_settings(fit: str, control_points: int) -> Any:
    from gyroid_cad.fit import FitSettings

    if fit == "smooth":
        return FitSettings(control_points)
    settings = FitSettings.paper()
    if control_points != settings.control_points:
        raise ParameterError("control_points", control_points, "10, the paper's own, with --fit paper")
    return settings


def _progress(shown: bool) -> AbstractContextManager[Progress | None]:
    if not shown:
        return nullcontext(None)
    from gyroid_cad.progress import terminal_progress

    return terminal_progress()


def _summary(report: LatticeReport, outputs: Sequence[str], total: float) -> dict[str, Any]:
    from pathlib import Path

    summary = asdict(report)
    summary["seconds"] = {stage: round(value, 4) for stage, value in {**report.seconds, "total": total}.items()}
    summary["files"] = [{"path": path, "bytes": Path(path).stat().st_size} for path in outputs]
    return summary


def _print_summary(summary: dict[str, Any]) -> None:
    nx, ny, nz = summary["cells"]
    error = summary["volume"] / summary["volume_exact"] - 1
    rows = [
        ("cells", f"{nx} x {ny} x {nz}, {summary['cell_size']:g} mm each"),
        ("wall", f"{summary['thickness']:.6g} mm, density {summary['density']:.5f}"),
        ("solids, faces", f"{summary['solids']}, {summary['faces']} (valid and closed)"),
        ("free edges, pinch lines", f"{summary['free_edges']}, {summary['pinch_lines']}"),
        ("volume", f"{summary['volume']:.8g} mm3, {error:+.1e} of the exact one"),
        ("deviation", f"{summary['max_deviation']:.1e} mm, {summary['max_normal_angle']:.3f} degrees"),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']['total']:.2f} s"),
    ]
    _print_table(None, rows)


def _print_table(header: tuple[str, ...] | None, rows: Sequence[tuple[str, ...]]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(*(header or ("", "")), show_header=header is not None, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    # In a pipe there is no width to respect: nothing is wrapped.
    console = Console(highlight=False, markup=False, **({} if sys.stdout.isatty() else {"width": _UNWRAPPED}))  # type: ignore[arg-type]
    console.print(table)

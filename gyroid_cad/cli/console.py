"""Tables and progress on the terminal."""

from __future__ import annotations

import errno
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from gyroid_cad.cli.installation import Diagnosis
    from gyroid_cad.printing.print_check import PrintCheck

__all__ = [
    "print_assembly",
    "print_built",
    "print_check_table",
    "print_doctor",
    "print_fill",
    "print_mesh",
    "print_summary",
    "print_table",
    "print_triangles",
    "print_volumes",
    "shown_progress",
]

Progress = Callable[[str, int, int], None]

# Columns of a pipe, which has none.
_UNWRAPPED = 100_000


def print_built(summary: dict[str, Any]) -> None:
    """Print the report of whatever a lattice was built as."""
    if "triangles" in summary:
        print_triangles(summary)
    elif "instances" in summary:
        print_assembly(summary)
    else:
        print_summary(summary)


def print_assembly(summary: dict[str, Any]) -> None:
    """Print a lattice's report as an assembly, its files and the time it took.

    Parameters
    ----------
    summary : dict
        The report's values, with ``files`` and ``seconds["total"]``.
    """
    nx, ny, nz = summary["cells"]
    error = summary["volume"] / summary["volume_exact"] - 1
    rows = [
        ("cells", f"{nx} x {ny} x {nz}, {summary['cell_size']:g} mm each"),
        ("wall", f"{summary['thickness']:.6g} mm, density {summary['density']:.5f}"),
        (
            "instances",
            f"{summary['instances']:,} of one valid and closed solid of {summary['faces']} faces, not fused",
        ),
        ("volume", f"{summary['volume']:.8g} mm3, {error:+.1e} of the exact one"),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']['total']:.2f} s"),
    ]
    print_table(None, rows)


def print_summary(summary: dict[str, Any]) -> None:
    """Print a lattice's report, its files and the time it took.

    Parameters
    ----------
    summary : dict
        The report's values, with ``files`` and ``seconds["total"]``.
    """
    nx, ny, nz = summary["cells"]
    exact = summary["volume_exact"]
    error = "" if exact is None else f", {summary['volume'] / exact - 1:+.1e} of the exact one"
    rows = [
        ("cells", f"{nx} x {ny} x {nz}, {summary['cell_size']:g} mm each"),
        ("wall", f"{_range(summary)} mm, density {summary['density']:.5f}"),
        ("solids, faces", f"{summary['solids']}, {summary['faces']} (valid and closed)"),
        ("boundary edges, non-manifold edges", f"{summary['boundary_edges']}, {summary['non_manifold_edges']}"),
        ("volume", f"{summary['volume']:.8g} mm3{error}"),
        ("deviation", _deviation(summary)),
        *([("checked", _checks(summary["samples_per_patch"]))] if summary["samples_per_patch"] else []),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']['total']:.2f} s"),
    ]
    print_table(None, rows)


def print_triangles(summary: dict[str, Any]) -> None:
    """Print a lattice's report as triangles, its files and the time it took.

    Parameters
    ----------
    summary : dict
        The report's values, with ``files`` and ``seconds["total"]``.
    """
    nx, ny, nz = summary["cells"]
    fewest, most = summary["fewest_steps"], summary["most_steps"]
    squares = f"{most} x {most}" if fewest == most else f"{fewest} x {fewest} to {most} x {most}"
    error = summary["volume"] / summary["volume_exact"] - 1
    rows = [
        ("cells", f"{nx} x {ny} x {nz}, {summary['cell_size']:g} mm each"),
        ("wall", f"{_range(summary)} mm, density {summary['density']:.5f}"),
        ("triangles", f"{summary['triangles']:,} (closed), {squares} squares a patch and face"),
        ("boundary edges, non-manifold edges", f"{summary['boundary_edges']}, {summary['non_manifold_edges']}"),
        ("volume", f"{summary['volume']:.8g} mm3, {error:+.1e} of the exact one"),
        ("deviation", f"{summary['deviation']:.2g} mm from the NURBS faces"),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']['total']:.2f} s"),
    ]
    print_table(None, rows)


def print_fill(summary: dict[str, Any]) -> None:
    """Print a filled part's report, its files and the time it took.

    Parameters
    ----------
    summary : dict
        The report's values, with ``files`` and ``seconds["total"]``.
    """
    islands = f"{summary['islands']} left, {summary['dropped']} dropped"
    rows = [
        ("kind", f"{summary['kind']}, cells of {summary['cell_size']:g} mm, wall {summary['thickness']:.6g} mm"),
        *([] if summary["min_wall"] is None else [("smallest wall", f"{summary['min_wall']:.6g} mm")]),
        *([] if summary["skin"] is None else [("skin", f"{summary['skin']:g} mm")]),
        (
            "solids, faces",
            f"{summary['solids']}, {summary['faces']} (valid{' and closed' if summary['closed'] else ''})",
        ),
        ("volume", f"{summary['volume']:.8g} mm3 of {summary['part_volume']:.8g}, density {summary['density']:.5f}"),
        ("surface", f"{summary['area']:.6g} mm2"),
        *([] if summary["mass"] is None else [("mass", f"{summary['mass']:.4g} g of {summary['part_mass']:.4g} g")]),
        ("islands", islands),
        *([("shifted by", f"{summary['shift']} mm: the kernel failed without")] if any(summary["shift"]) else []),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']['total']:.2f} s"),
    ]
    print_table(None, rows)


def print_mesh(summary: dict[str, Any]) -> None:
    """Print how many elements and nodes a mesh has, its files and the time it took.

    Parameters
    ----------
    summary : dict
        With ``element``, ``elements``, ``nodes``, ``patches``, ``subdivisions``, ``layers``, ``periodic_pairs``,
        ``files`` and ``seconds``.
    """
    n, layers = summary["subdivisions"], summary["layers"]
    across = f"{layers} across the wall" if layers else "of the mid-surface"
    rows = [
        ("elements", f"{summary['elements']:,} {summary['element']}: {n} x {n} a patch, {across}"),
        ("nodes", f"{summary['nodes']:,}"),
        ("patches", f"{summary['patches']:,}"),
        *([("periodic pairs", f"{summary['periodic_pairs']:,}")] if layers else []),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']:.2f} s"),
    ]
    print_table(None, rows)


def print_volumes(summary: dict[str, Any]) -> None:
    """Print how many trivariate patches there are, their files and the time it took.

    Parameters
    ----------
    summary : dict
        With ``patches``, ``degrees``, ``control_points``, ``interfaces``, ``files`` and ``seconds``.
    """
    rows = [
        ("patches", f"{summary['patches']:,} of degrees {', '.join(map(str, summary['degrees']))}"),
        ("control points", f"{summary['control_points']:,}"),
        ("interfaces", f"{summary['interfaces']:,}"),
        *((file["path"], f"{file['bytes']:,} bytes") for file in summary["files"]),
        ("time", f"{summary['seconds']:.2f} s"),
    ]
    print_table(None, rows)


def print_check_table(check: PrintCheck) -> None:
    """Print what a printer makes of a part, row by row, and the verdict."""
    scale = check.suggested_scale
    if check.passed:
        verdict = "can be printed"
    elif scale is not None and scale != 1:
        verdict = f"cannot be printed as it is; suggested scale {scale:.4g}"
    else:
        verdict = "cannot be printed as it is" + ("" if scale else ", at no scale: what fits has too thin a wall")
    rows = [*check.rows(), ("verdict", verdict, "passed" if check.passed else "failed")]
    print_table((f"{check.printer.name}, {check.printer.process}", "", ""), rows)


def print_doctor(diagnosis: Diagnosis) -> None:
    """Print what is installed and what the self-test found."""
    rows = [(finding.subject, finding.state, finding.detail) for finding in diagnosis.findings]
    verdict = "all that is required is there and works" if diagnosis.ok else "something required fails"
    print_table(None, [*rows, ("verdict", "ok" if diagnosis.ok else "failed", verdict)])


def shown_progress(shown: bool) -> AbstractContextManager[Progress | None]:
    """A progress display on the terminal while the context lasts, or none."""
    if not shown:
        return nullcontext(None)
    from gyroid_cad.cli.bars import terminal_progress

    return terminal_progress()


def _range(summary: dict[str, Any]) -> str:
    if summary["min_thickness"] == summary["max_thickness"]:
        return f"{summary['thickness']:.6g}"
    return f"{summary['min_thickness']:.4g} to {summary['max_thickness']:.4g}, on average {summary['thickness']:.4g}"


def _deviation(summary: dict[str, Any]) -> str:
    n = summary["control_points"]
    shown = f"{summary['max_deviation']:.1e} mm, {summary['max_normal_angle']:.3f} degrees"
    if summary["max_wall_error"] is not None:
        shown += f", wall {summary['max_wall_error']:.1e} of itself"
    return f"{shown}; {n} x {n} control points a patch"


def _checks(samples: dict[str, int]) -> str:
    return (
        f"at {samples['deviation']} places a patch for deviation, {samples['fold']} for folding, "
        f"{samples['clearance']} for walls that meet"
    )


def print_table(header: tuple[str, ...] | None, rows: Sequence[tuple[str, ...]]) -> None:
    """Print rows of text in columns, under a header if there is one."""
    from rich.console import Console
    from rich.table import Table

    class Patient(Console):
        def on_broken_pipe(self) -> None:
            # Rich would leave at once; what a closed pipe means is for the command line to say, as of all it prints.
            raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))

    table = Table(*(header or [""] * len(rows[0])), show_header=header is not None, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    # In a pipe there is no width to respect: nothing is wrapped.
    console = Patient(highlight=False, markup=False, **({} if sys.stdout.isatty() else {"width": _UNWRAPPED}))  # type: ignore[arg-type]
    console.print(table)

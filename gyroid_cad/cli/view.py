"""``gyroid-cad view``: a lattice, or what is in a file, in a window or as a picture."""

from __future__ import annotations

import sys
from typing import Any

import click

from gyroid_cad.cli.console import shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options_beside
from gyroid_cad.cli.options import file_paths

__all__ = ["view_command"]

_TOML_ENDING = ".toml"


@click.command("view")
@lattice_options_beside("LATTICE.toml|FILE")
@click.option(
    "-o",
    "--output",
    "--screenshot",
    "screenshot",
    metavar="FILE.png",
    shell_complete=file_paths,
    help="Draw into a file instead of opening a window; no display is needed.",
)
@click.option("--quiet", is_flag=True, help="Show no progress.")
def view_command(screenshot: str | None, quiet: bool, **given: Any) -> None:
    """Show a lattice, or a .step, .stp, .brep, .stl or .3mf file, in CadQuery's viewer.

    The lattice is described as for "build", by options or in a TOML file; no solid is built unless it is trimmed.
    STEP files are shown in their own colours. In the window: drag to turn, wheel to zoom, q to leave.

    \b
    gyroid-cad view --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad view part.step
    gyroid-cad view lattice.toml -o lattice.png
    """
    from gyroid_cad.cli.viewer import view

    file = given["config"]
    named = file is not None and not file.lower().endswith(_TOML_ENDING)
    what = file if named else lattice_of(given)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        view(what, screenshot, progress)

"""``gyroid-cad properties``: effective stiffness and conductivity of a lattice."""

from __future__ import annotations

import json
import sys
import time
from typing import Any

import click

from gyroid_cad.cli.console import print_table, shown_progress
from gyroid_cad.cli.lattice_options import quantity_options, surface_option
from gyroid_cad.cli.options import json_option, quiet_option
from gyroid_cad.lattice import Lattice

__all__ = ["properties_command"]


@click.command("properties")
@surface_option
@quantity_options
@click.option("--youngs-modulus", type=float, default=1.0, show_default=True, metavar="E", help="Of the solid.")
@click.option("--poisson-ratio", type=float, default=0.3, show_default=True, metavar="NU", help="Of the solid.")
@click.option("--conductivity", type=float, default=1.0, show_default=True, metavar="K", help="Of the solid.")
@json_option
@quiet_option
def properties_command(
    youngs_modulus: float, poisson_ratio: float, conductivity: float, as_json: bool, quiet: bool, **given: Any
) -> None:
    """Find the effective elasticity and conductivity of an endless lattice, along its own axes.

    One periodic cell is solved, by scikit-fem. Stiffnesses are in the unit of the solid's modulus, and go with it; the
    last row says how closely all of it is known.

    \b
    gyroid-cad properties --cell-size 10 --density 0.3 --youngs-modulus 110000 --poisson-ratio 0.34
    gyroid-cad properties --pore-size 0.6 --porosity 0.75 --surface primitive --json
    """
    start = time.perf_counter()
    lattice = Lattice((1, 1, 1), **given)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        found = lattice.properties(youngs_modulus, poisson_ratio, conductivity, progress)
    if as_json:
        seconds = time.perf_counter() - start
        click.echo(json.dumps({"cell_size": lattice.cell_size, **found.as_dict(), "seconds": seconds}))
    elif not quiet:
        print_table(None, [("cell size", f"{lattice.cell_size:.6g} mm"), *found.rows()])

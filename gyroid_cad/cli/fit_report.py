"""``gyroid-cad fit-report``: our fit of the patch beside the paper's."""

from __future__ import annotations

import json
from dataclasses import asdict

import click

from gyroid_cad.cli.console import print_table
from gyroid_cad.cli.options import json_option
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fit_report

__all__ = ["fit_report_command"]


@click.command("fit-report")
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
    ours, paper = (fit_report(fit_patch(settings)) for settings in (FitSettings(control_points), FitSettings.paper()))
    if as_json:
        click.echo(json.dumps({"smooth": asdict(ours), "paper": asdict(paper)}))
        return
    rows = [(*row, beside) for row, (_, beside) in zip(ours.rows(), paper.rows(), strict=True)]
    print_table(("L is the cell size", f"ours ({control_points} x {control_points})", "the paper's (10 x 10)"), rows)

"""``gyroid-cad doctor``: what is installed, and whether it works."""

from __future__ import annotations

import json

import click

from gyroid_cad.cli.console import print_doctor
from gyroid_cad.cli.installation import diagnose
from gyroid_cad.cli.options import json_option

__all__ = ["doctor_command"]


@click.command("doctor")
@json_option
@click.pass_context
def doctor_command(context: click.Context, as_json: bool) -> None:
    """Say what is installed, and build, write and read one cell to see whether it works.

    A host that is installed takes the cell as a shape of its own. The status is 1 if something that is required is
    missing, or something that is installed fails.

    \b
    gyroid-cad doctor
    gyroid-cad doctor --json
    """
    diagnosis = diagnose()
    if as_json:
        click.echo(json.dumps(diagnosis.as_dict()))
    else:
        print_doctor(diagnosis)
    if not diagnosis.ok:
        context.exit(1)

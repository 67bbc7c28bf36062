"""``gyroid-cad doctor`` and ``--version``: what is installed, and whether it works."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import click

from gyroid_cad.cli.console import print_doctor
from gyroid_cad.cli.options import json_option
from gyroid_cad.version import __version__

__all__ = ["doctor_command", "version_option"]


def _print_version(context: click.Context, parameter: click.Parameter, requested: bool) -> None:
    if requested:
        from gyroid_cad.cli.installation import kernel_version

        click.echo(f"{context.info_name} {__version__}, {kernel_version()}")
        context.exit()


def version_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the option ``--version``, which tells the kernel's version too and does not load it."""
    option = click.option(
        "--version",
        is_flag=True,
        expose_value=False,
        is_eager=True,
        callback=_print_version,
        help="Show the version, and the kernel's, and exit.",
    )
    return option(function)


@click.command("doctor")
@json_option
@click.pass_context
def doctor_command(context: click.Context, as_json: bool) -> None:
    """Say what is installed, and build, write and read one cell to see whether it works.

    The status is 1 if something that is required is missing or fails.

    \b
    gyroid-cad doctor
    gyroid-cad doctor --json
    """
    from gyroid_cad.cli.installation import diagnose

    diagnosis = diagnose()
    if as_json:
        click.echo(json.dumps(diagnosis.as_dict()))
    else:
        print_doctor(diagnosis)
    if not diagnosis.ok:
        context.exit(1)

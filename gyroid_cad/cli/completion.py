"""``gyroid-cad completion``: scripts by which shells complete commands and options, click's own."""

from __future__ import annotations

import os

import click

__all__ = ["answered_shell", "completion_command"]

_SHELLS = ("bash", "zsh", "fish")
# As click makes it of the program's name.
_VARIABLE = "_{}_COMPLETE"


@click.command("completion")
@click.argument("shell", type=click.Choice(_SHELLS))
@click.pass_context
def completion_command(context: click.Context, shell: str) -> None:
    """Print the script that makes a shell complete commands and options.

    \b
    gyroid-cad completion bash >> ~/.bashrc
    gyroid-cad completion zsh >> ~/.zshrc
    gyroid-cad completion fish > ~/.config/fish/completions/gyroid-cad.fish
    """
    from click.shell_completion import shell_complete

    root = context.find_root()
    program = root.info_name or ""
    shell_complete(root.command, {}, program, _variable(program), f"{shell}_source")


def answered_shell(commands: click.Command, program: str) -> int | None:
    """Answer a shell that asks, by an environment variable, how a line may go on.

    Parameters
    ----------
    commands : click.Command
    program : str

    Returns
    -------
    int or None
        The status to leave with; None if no shell asks.
    """
    instruction = os.environ.get(_variable(program))
    if not instruction:
        return None
    from click.shell_completion import shell_complete

    return shell_complete(commands, {}, program, _variable(program), instruction)


def _variable(program: str) -> str:
    return _VARIABLE.format(program.replace("-", "_").upper())

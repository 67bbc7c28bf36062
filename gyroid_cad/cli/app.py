"""The command line: one command is found, loaded and run, and its errors told."""

from __future__ import annotations

import codecs
import os
import re
import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from io import TextIOWrapper

import click
from click.shell_completion import shell_complete

from gyroid_cad.cli.messages import BAD_USAGE, Session, debug_option, failed
from gyroid_cad.cli.options import version_option
from gyroid_cad.errors import IslandsWarning, PartWarning, SealedVoidsWarning

__all__ = ["answered_shell", "commands", "completion_command", "main"]

_SHELLS = ("bash", "zsh", "fish")
# As click makes it of the program's name.
_VARIABLE = "_{}_COMPLETE"
# How what no text can say is encoded.
_AS_NAMED = "gyroid_cad.as_named"


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

    return shell_complete(commands, {}, program, _variable(program), instruction)


def _variable(program: str) -> str:
    return _VARIABLE.format(program.replace("-", "_").upper())


PROGRAM = "gyroid-cad"
DONE = 0
# In the order of the help, with the module of this folder that each stands in, as ``NAME_command``.
_MODULES = {
    "build": "build",
    "fill": "fill",
    "design": "design",
    "properties": "properties",
    "mesh": "mesh",
    "volumes": "mesh",
    "view": "view",
    "check": "check",
    "print-check": "print_check",
    "report": "report",
    "doctor": "doctor",
    "completion": "app",
    "fit-report": "fit_report",
}


# Words of a line of the shell, quotes and all.
_WORD = re.compile(r'(?:[^\s"]|"[^"]*")+')


class ExampleFormatter(click.HelpFormatter):
    """Formatter whose examples, which are lines to be pasted into a shell, go on in the next line as shells have it."""

    def write_text(self, text: str) -> None:
        width = self.width - self.current_indent
        super().write_text("\n".join(_wrapped(line, width) for line in text.splitlines()))


def _wrapped(line: str, width: int) -> str:
    """Break a line of the shell between options, where it is too long."""
    if not line.startswith(PROGRAM) or len(line) <= width:
        return line
    # An option stays beside its values.
    parts: list[str] = []
    for word in _WORD.findall(line):
        if parts and not word.startswith(("-", ">")):
            parts[-1] += f" {word}"
        else:
            parts.append(word)
    lines = [parts[0]]
    for part in parts[1:]:
        if len(f"{lines[-1]} {part} \\") <= width:
            lines[-1] += f" {part}"
        else:
            lines.append(f"    {part}")
    return " \\\n".join(lines)


class ExampleContext(click.Context):
    """Context of commands whose help has examples."""

    formatter_class = ExampleFormatter


class Commands(click.Group):
    """Group of commands, each loaded when it is asked for: none waits for what another one needs."""

    context_class = ExampleContext

    def list_commands(self, context: click.Context) -> list[str]:
        return list(_MODULES)

    def get_command(self, context: click.Context, name: str) -> click.Command | None:
        if name not in self.commands and name in _MODULES:
            module = import_module(f"gyroid_cad.cli.{_MODULES[name]}")
            command: click.Command = getattr(module, f"{name.replace('-', '_')}_command")
            command.context_class = ExampleContext
            debug_option(command)
            self.add_command(command, name)
        return self.commands.get(name)


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@version_option
@debug_option
def commands() -> None:
    """The gyroid as exact-grade CAD solids. Lengths are in millimetres, angles in degrees.

    \b
    gyroid-cad build -o part.step --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad doctor
    """


def _as_named(problem: UnicodeError) -> tuple[str | bytes, int]:
    """Print bytes of a file's name that are no text as they are, and letters that the terminal lacks escaped."""
    try:
        return codecs.lookup_error("surrogateescape")(problem)
    except UnicodeError:
        return codecs.lookup_error("backslashreplace")(problem)


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
    session = Session()
    if isinstance(sys.stdout, TextIOWrapper):
        codecs.register_error(_AS_NAMED, _as_named)
        sys.stdout.reconfigure(errors=_AS_NAMED)
    try:
        if (answered := answered_shell(commands, PROGRAM)) is not None:
            return answered
        # Not commands.main: it would put an empty line before the one that says "interrupted".
        with (
            commands.make_context(
                PROGRAM, list(sys.argv[1:] if arguments is None else arguments), obj=session
            ) as context,
            warnings.catch_warnings(),
        ):
            # The tables and the JSON tell of them.
            warnings.simplefilter("ignore", IslandsWarning)
            warnings.simplefilter("ignore", SealedVoidsWarning)
            warnings.simplefilter("ignore", PartWarning)
            commands.invoke(context)
        return DONE
    except click.exceptions.Exit as left:
        return left.exit_code
    except click.exceptions.NoArgsIsHelpError as shown:
        click.echo(shown.format_message(), err=True)
        return BAD_USAGE
    except (Exception, KeyboardInterrupt) as problem:
        return failed(problem, PROGRAM, session)

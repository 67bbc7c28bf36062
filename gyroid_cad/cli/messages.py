"""Messages of the command line when something fails: one line, with the names under which the user gave things."""

from __future__ import annotations

import errno
import os
import sys
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gyroid_cad.common.choices import TARGETS
from gyroid_cad.common.doors import key_of
from gyroid_cad.errors import GyroidError, ParameterError

if TYPE_CHECKING:
    from gyroid_cad.cli.config import Config

__all__ = [
    "BAD_USAGE",
    "FAILED",
    "INTERRUPTED",
    "Session",
    "config_of",
    "debug_option",
    "failed",
    "label",
    "remember_config",
]

# The last as shells say it of a program that wrote into a closed pipe.
FAILED, BAD_USAGE, INTERRUPTED, PIPE_CLOSED = 1, 2, 130, 141
_CONFIG = "gyroid_cad.config"
# What a parameter may have been reckoned from.
_GIVEN_AS = {"density": TARGETS, "thickness": TARGETS, "cell_size": TARGETS}
_MEMORY = "memory gave out: it takes fewer cells, coarser triangles, or more memory for this process"
_UNWRITTEN = (errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EBADF)
# What the system says, in an ImportError, when a library finds no room.
_NO_ROOM = ("cannot allocate memory", "failed to map segment")
# Of a number of thousands of digits the beginning tells.
_LONGEST_WORD, _SHOWN_OF_IT = 1000, 100


@dataclass(slots=True)
class Session:
    """One run of the command line.

    Attributes
    ----------
    debug : bool
        Whether tracebacks are shown.
    context : click.Context, optional
        Of the command that runs, once its options are being read.
    """

    debug: bool = False
    context: click.Context | None = None


def _note_debug(context: click.Context, parameter: click.Parameter, debug: bool) -> None:
    session = context.find_object(Session)
    if session is not None:
        session.debug |= debug
        session.context = context


def debug_option(function: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the option ``--debug``, and let the session know that it is the one that runs."""
    option = click.option(
        "--debug",
        is_flag=True,
        expose_value=False,
        is_eager=True,
        callback=_note_debug,
        help="Show where in the program an error came from.",
    )
    return option(function)


def remember_config(context: click.Context, config: Config, defaults: dict[str, Any]) -> None:
    """Keep the file that a command takes its defaults from, for what is to be said of them."""
    context.meta[_CONFIG] = config
    context.default_map = defaults


def config_of(context: click.Context) -> Config | None:
    """Return the file that a command takes its defaults from, if it takes any."""
    return context.meta.get(_CONFIG)


def label(context: click.Context | None, parameter: str) -> str:
    """Name a parameter as the user gave it: an option, or the line and key of a file.

    Parameters
    ----------
    context : click.Context, optional
        Of the command that runs.
    parameter : str
        As the options call it in Python.
    """
    known = {} if context is None else {option.name: option for option in context.command.params}
    option = known.get(parameter) or known.get(key_of(parameter))
    if context is None or option is None or option.name is None:
        return parameter
    parameter = option.name
    config = config_of(context)
    if isinstance(option, click.Argument):
        return config.place(parameter) if config is not None and parameter in config.values else parameter
    others = [other for other in _GIVEN_AS.get(parameter, ()) if context.params.get(other) is not None]
    if context.params.get(parameter) is None and others:
        return f"{', '.join(label(context, other) for other in others)}: {parameter}"
    if context.get_parameter_source(parameter) == click.core.ParameterSource.DEFAULT_MAP:
        assert config is not None
        return config.place(parameter)
    return option.opts[0]


def failed(problem: Exception | KeyboardInterrupt, program: str, session: Session) -> int:
    """Say on the error stream, in one line, what went wrong.

    Parameters
    ----------
    problem : Exception or KeyboardInterrupt
    program : str
    session : Session

    Returns
    -------
    int
        The status to leave with.
    """
    message, status = _message(problem, session.context)
    words = [word if len(word) <= _LONGEST_WORD else f"{word[:_SHOWN_OF_IT]}..." for word in message.split()]
    # Where nobody listens on the error stream either, the status has to do.
    with suppress(OSError):
        if session.debug:
            click.echo("".join(traceback.format_exception(problem)), err=True, nl=False)
        if words:
            click.echo(f"{program}: error: {' '.join(words)}", err=True)
    return status


def _message(problem: Exception | KeyboardInterrupt, context: click.Context | None) -> tuple[str, int]:
    if isinstance(problem, click.ClickException):
        return _of_click(problem), BAD_USAGE
    if isinstance(problem, ParameterError):
        return _of_parameter(problem, context), BAD_USAGE
    if isinstance(problem, click.Abort) or _was_interrupted(problem):
        return "interrupted", INTERRUPTED
    if isinstance(problem, GyroidError):
        return str(problem), FAILED
    return _of_system(problem)


def _of_system(problem: BaseException) -> tuple[str, int]:
    """Message of an error that is none of ours, nor of what the user gave."""
    if _ran_out_of_memory(problem):
        return _MEMORY, FAILED
    # Files are written by name, and then it is an ExportError: what is left is what is printed.
    if isinstance(problem, OSError) and problem.filename is None and problem.errno in _UNWRITTEN:
        _discard_output()
        if problem.errno == errno.EPIPE:
            # Whoever read it has had enough, as `head` has: nothing went wrong that anybody needs to be told.
            return "", PIPE_CLOSED
        return f"standard output could not be written: {problem.strerror}", FAILED
    # A defect of ours is still one line for the user.
    return f"unexpected {type(problem).__name__}: {problem}", FAILED


def _of_click(problem: click.ClickException) -> str:
    """Message of click; of a value from a file with the place where it stands."""
    option = getattr(problem, "param", None)
    context = getattr(problem, "ctx", None)
    if isinstance(option, click.Option) and context is not None and option.name is not None:
        place = label(context, option.name)
        if place not in option.opts:
            return f"{place}: {problem.message}"
    return problem.format_message()


def _of_parameter(problem: ParameterError, context: click.Context | None) -> str:
    names = problem.parameter.split(", ")
    if not all(name.isidentifier() for name in names):
        return str(problem)
    return str(problem).replace(problem.parameter, ", ".join(label(context, name) for name in names), 1)


def _discard_output() -> None:
    """Send what is left of standard output nowhere: Python writes it when it leaves, and would complain again."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)


def _ran_out_of_memory(problem: BaseException | None) -> bool:
    """Tell whether it is memory that an error is about: the kernel's has a class of its own, a library's none."""
    while problem is not None:
        if isinstance(problem, OSError) and problem.errno == errno.ENOMEM:
            return True
        if isinstance(problem, MemoryError) or type(problem).__name__ == "Standard_OutOfMemory":
            return True
        if isinstance(problem, ImportError) and any(words in str(problem).lower() for words in _NO_ROOM):
            return True
        problem = problem.__cause__ or problem.__context__
    return False


def _was_interrupted(problem: BaseException | None) -> bool:
    """Tell whether an interrupt is behind an error: one that comes while the kernel is loaded is an ImportError."""
    while problem is not None:
        if isinstance(problem, KeyboardInterrupt):
            return True
        problem = problem.__cause__ or problem.__context__
    return False

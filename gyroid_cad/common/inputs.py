"""Files that a user gives: looked at before they are read, for a device never ends and some text takes minutes."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gyroid_cad.errors import ParameterError

__all__ = ["key_line", "read_toml", "unreadable", "utf8_named"]

# A key of many parts takes Python's reader the square of their number: a line is then a moment's work at most.
_MOST_BYTES, _MOST_CHARACTERS_A_LINE = 100_000, 2000


def unreadable(path: str | os.PathLike[str]) -> str | None:
    """Say why a file cannot be read, in words that end a sentence; None if it can be.

    Parameters
    ----------
    path : path-like

    Returns
    -------
    str or None

    Examples
    --------
    >>> unreadable("nothere.step")
    'No such file or directory'
    >>> unreadable(".")
    'it is a folder'
    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            return "it is a folder"
        # Opening a pipe waits for whoever writes to it; a device may never end.
        if not stat.S_ISREG(mode):
            return "it is a device or a pipe, not a file"
        with open(path, "rb"):
            return None
    except OSError as problem:
        return problem.strerror or str(problem)
    except ValueError:
        return "its name has a null character"


@contextmanager
def utf8_named(path: str | os.PathLike[str]) -> Iterator[str]:
    """Give a path for libraries that know no names but UTF-8: the file's own, or that of a link to it.

    Parameters
    ----------
    path : path-like

    Examples
    --------
    >>> with utf8_named("bracket.step") as name:
    ...     name
    'bracket.step'
    """
    try:
        str(path).encode()
    except UnicodeEncodeError:
        with TemporaryDirectory() as folder:
            link = Path(folder, f"file{Path(path).suffix}")
            link.symlink_to(Path(path).resolve())
            yield str(link)
    else:
        yield str(path)


def read_toml(parameter: str, path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """Read a TOML file, and its text.

    Parameters
    ----------
    parameter : str
        That the file was given for, for errors.
    path : path-like

    Returns
    -------
    values : dict
    text : str

    Raises
    ------
    ParameterError
        If it cannot be read, is too large, has too long a line, or is no TOML.
    """
    name = str(path)
    if reason := unreadable(path):
        raise ParameterError(parameter, name, f"a TOML file that can be read: {reason}")
    with open(path, "rb") as file:
        content = file.read(_MOST_BYTES + 1)
    if len(content) > _MOST_BYTES:
        raise ParameterError(parameter, name, f"a TOML file of at most {_MOST_BYTES:,} bytes")
    try:
        text = content.decode()
        long = next((n for n, line in enumerate(text.splitlines(), 1) if len(line) > _MOST_CHARACTERS_A_LINE), None)
        if long is None:
            return tomllib.loads(text), text
    except RecursionError:
        raise ParameterError(parameter, name, "TOML with fewer brackets in brackets") from None
    # Of what is no TOML, and of bytes that are no UTF-8.
    except ValueError as problem:
        raise ParameterError(parameter, name, f"TOML: {problem}") from None
    raise ParameterError(
        parameter, name, f"at most {_MOST_CHARACTERS_A_LINE} characters in a line; line {long} has more"
    )


def key_line(text: str, key: str) -> int | None:
    """Find the line, from 1, on which a TOML file gives a key or begins a table of that name.

    Parameters
    ----------
    text : str
    key : str

    Returns
    -------
    int or None
        None if no line begins with the key, as where it stands in a table written on one line.

    Examples
    --------
    >>> key_line("cells = [1, 1, 1]\\ncell_size = 10", "cell_size")
    2
    """
    begins = re.compile(rf"\s*\[*\s*[\"']?{re.escape(key)}[\"']?\s*[=.\]]")
    return next((number for number, line in enumerate(text.splitlines(), 1) if begins.match(line)), None)

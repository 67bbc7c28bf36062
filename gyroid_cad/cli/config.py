"""A lattice in a TOML file: its keys are the long options of ``gyroid-cad build``, with underscores."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import tomli_w

from gyroid_cad.common.doors import commands_with, key_of
from gyroid_cad.common.inputs import key_line, read_toml
from gyroid_cad.errors import ParameterError

__all__ = ["Config", "printed_config", "read_config"]

# The one table that a file may keep its keys in.
_TABLE = "lattice"


@dataclass(frozen=True, slots=True)
class Config:
    """A TOML file that was read.

    Attributes
    ----------
    path : str
    values : dict
        Of str, or of lists of str, to be read as the command line is.
    text : str
    """

    path: str
    values: dict[str, Any]
    text: str

    def place(self, key: str) -> str:
        """Say where a key stands: the file, the line and the key."""
        return _place(self.path, self.text, key)

    def beside(self, path: str) -> str:
        """Path of a file that is named in this one, whose folder it is relative to."""
        return str(Path(self.path).parent / path)

    def output(self, key: str, path: str, anywhere: bool = False) -> str:
        """Path of a file that is to be written.

        Raises
        ------
        ParameterError
            If it is outside the folder of this file, be it by a link, and may not be anywhere.
        """
        folder, written = Path(self.path).resolve().parent, self.beside(path)
        try:
            inside = anywhere or Path(written).resolve().is_relative_to(folder)
        except (OSError, RuntimeError, ValueError):  # a loop of links, a null character: for the writer to refuse
            return written
        if not inside:
            raise ParameterError(self.place(key), path, f"a file in the folder of {self.path}, or --allow-outside")
        return written


def read_config(path: str, known: Iterable[str], flags: Iterable[str] = ()) -> Config:
    """Read a file, every number as text.

    Parameters
    ----------
    path : str
    known : iterable of str
        Keys that are understood, at the top of the file or in a table ``[lattice]``.
    flags : iterable of str
        Those among them that are true or false.

    Raises
    ------
    ParameterError
        If the file can't be read, is no TOML, or has an unknown key, or a value that is neither number nor text nor,
        of a flag, true or false.
    """
    known, flags = sorted(known), set(flags)
    tables, text = read_toml("config", path)
    values = _without_table(tables, known, path, text)
    for key, value in values.items():
        if key not in known:
            raise ParameterError(_place(path, text, key), value, f"a known key; {_hint(key, known)}")
        if key in flags:
            if not isinstance(value, bool):
                raise ParameterError(_place(path, text, key), value, "true or false")
            continue
        parts = value if isinstance(value, list) else [value]
        if not parts or not all(isinstance(part, str | int | float) and not isinstance(part, bool) for part in parts):
            raise ParameterError(_place(path, text, key), value, "a number or text, or a list of them")
    as_text = {
        key: [str(part) for part in value] if isinstance(value, list) else str(value) for key, value in values.items()
    }
    return Config(path, as_text, text)


def _hint(key: str, known: Sequence[str]) -> str:
    """Guess what an unknown key is meant to be: Python's name of one, one of another command, or one misspelt."""
    spelt = key.replace("-", "_").lower()
    near = [key_of(key)] if key_of(key) in known else difflib.get_close_matches(spelt, known, 1, 0.6)
    if not near and spelt not in known and (commands := commands_with(spelt)):
        return f"{spelt} is one of gyroid-cad {' or '.join(commands)}"
    near = near or difflib.get_close_matches(spelt, known, 1, 0.5)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"


def _without_table(tables: dict[str, Any], known: Sequence[str], path: str, text: str) -> dict[str, Any]:
    """Keys at the top of a file and those in its table together."""
    values = {name: value for name, value in tables.items() if not isinstance(value, dict) or name in known}
    for name in tables.keys() - values.keys():
        if name != _TABLE:
            raise ParameterError(_place(path, text, name), sorted(tables[name]), f"no table but [{_TABLE}]")
        for key, value in tables[name].items():
            if key in values:
                raise ParameterError(_place(path, text, key), value, f"each key once, at the top or in [{_TABLE}]")
            values[key] = value
    return values


def _place(path: str, text: str, key: str) -> str:
    line = key_line(text, key)
    return f"{path}{'' if line is None else f', line {line}'}: {key}"


def printed_config(values: Mapping[str, Any]) -> str:
    """TOML that :func:`read_config` reads back; what is None, empty or not the case is left out.

    Parameters
    ----------
    values : mapping
        Of numbers, text, truths, and sequences of them.
    """

    given = {
        key: list(value) if isinstance(value, tuple) else _number_or_text(value)
        for key, value in values.items()
        if value is not None and value not in ((), "") and value is not False
    }
    return tomli_w.dumps(given)


def _number_or_text(value: Any) -> Any:
    if not isinstance(value, str):
        return value
    try:
        number = float(value)
    except ValueError:
        return value
    # Words such as "NAN" are text that happens to be read as a number, and stay what they are.
    return number if isfinite(number) else value

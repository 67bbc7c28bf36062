"""A lattice in a TOML file: its keys are the long options of ``gyroid-cad build``, with underscores."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from gyroid_cad.errors import ParameterError

__all__ = ["printed_config", "read_config"]

_LARGEST_FILE = 1_000_000


def read_config(path: str, known: Iterable[str], flags: Iterable[str] = ()) -> dict[str, Any]:
    """What a file says, every number as text, to be read as the command line is.

    Parameters
    ----------
    path : str
    known : iterable of str
        Keys that are understood.
    flags : iterable of str
        Those among them that are true or false.

    Returns
    -------
    dict
        Of str, or of lists of str.

    Raises
    ------
    ParameterError
        If the file can't be read, is no TOML, or has an unknown key, or a value that is neither number nor text nor,
        of a flag, true or false.
    """
    known, flags = sorted(known), set(flags)
    try:
        if Path(path).stat().st_size > _LARGEST_FILE:
            raise ParameterError("config", path, f"a TOML file of at most {_LARGEST_FILE:,} bytes")
        values = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except OSError as problem:
        raise ParameterError("config", path, f"a TOML file that can be read: {problem.strerror}") from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as problem:
        raise ParameterError("config", path, f"TOML: {problem}") from None
    for key, value in values.items():
        if key not in known:
            near = difflib.get_close_matches(key.replace("-", "_").lower(), known, n=1, cutoff=0.5)
            hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            raise ParameterError(f"{path}: {key}", value, f"a known key; {hint}")
        if key in flags:
            if not isinstance(value, bool):
                raise ParameterError(f"{path}: {key}", value, "true or false")
            continue
        parts = value if isinstance(value, list) else [value]
        if not parts or not all(isinstance(part, str | int | float) and not isinstance(part, bool) for part in parts):
            raise ParameterError(f"{path}: {key}", value, "a number or text, or a list of them")
    return {
        key: [str(part) for part in value] if isinstance(value, list) else str(value) for key, value in values.items()
    }


def printed_config(values: Mapping[str, Any]) -> str:
    """TOML that :func:`read_config` reads back; what is None, empty or not the case is left out.

    Parameters
    ----------
    values : mapping
        Of numbers, text, truths, and sequences of them.
    """
    import tomli_w

    given = {
        key: list(value) if isinstance(value, tuple) else _number_or_text(value)
        for key, value in values.items()
        if value is not None and value != () and value is not False
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

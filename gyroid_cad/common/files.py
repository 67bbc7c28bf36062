"""Files appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gyroid_cad.errors import ExportError, ParameterError

__all__ = ["file_sizes", "replacing", "require_distinct", "require_writable"]


def require_writable(path: str | os.PathLike[str]) -> Path:
    """Check, before any work is done, that a file can be put at ``path``.

    Raises
    ------
    ParameterError
        If its folder is missing or cannot be written to, or the path is a folder.
    """
    target = Path(path)
    try:
        folder = target.resolve().parent
    except ValueError:
        raise ParameterError("output", str(path), "a file name without a null character") from None
    if not folder.is_dir():
        raise ParameterError("output", str(path), f"a file in an existing folder; {folder} is none")
    if target.is_dir():
        raise ParameterError("output", str(path), "a file, not a folder")
    if not os.access(folder, os.W_OK) or (target.exists() and not os.access(target, os.W_OK)):
        raise ParameterError("output", str(path), f"a file that may be written; {folder} does not allow it")
    return target


def require_distinct(
    paths: Sequence[str | os.PathLike[str]], checked: Callable[[str | os.PathLike[str]], Path]
) -> list[Path]:
    """Check files to be written, one by one and that each is there once, before any work is done.

    Parameters
    ----------
    paths : sequence of path-like
    checked : callable
        Gives a path where a file can be put, or raises.

    Raises
    ------
    ParameterError
    """
    if not paths:
        raise ParameterError("output", [], "at least one file name")
    targets = [checked(path) for path in paths]
    if len({target.resolve() for target in targets}) < len(targets):
        raise ParameterError("output", [str(path) for path in paths], "each file once")
    return targets


def file_sizes(paths: Iterable[str | os.PathLike[str]]) -> list[dict[str, Any]]:
    """Path and bytes of files that were written, as plain values ready for JSON."""
    return [{"path": str(path), "bytes": Path(path).stat().st_size} for path in paths]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary name beside ``path``; move it there if all went well, remove it if not.

    Parameters
    ----------
    path : path-like
        A link is followed: the file it points to is replaced.

    Raises
    ------
    ExportError
        If the file could not be written or moved.
    """
    target = Path(path).resolve()
    temporary = target.with_name(f".{target.name}.{os.getpid()}.partial")
    try:
        yield temporary
        with temporary.open("rb") as written:
            os.fsync(written.fileno())
        temporary.replace(target)
    except OSError as problem:
        if isinstance(problem, ExportError):
            raise
        raise ExportError(f"{path} was not written: {problem.strerror or problem}") from problem
    finally:
        temporary.unlink(missing_ok=True)

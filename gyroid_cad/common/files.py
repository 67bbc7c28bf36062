"""Files appear whole or not at all, however many write them, and whatever ends the program."""

from __future__ import annotations

import errno
import os
import secrets
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Any

from gyroid_cad.errors import ExportError, ParameterError

__all__ = ["file_sizes", "replacing", "require_distinct", "require_writable", "temporary_folder"]

# Signals that end a program at once, if nothing is said to the contrary: of `kill`, and of a terminal that is closed.
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))
# Why a name can be that of no file, whatever is in its folder.
_UNUSABLE = {
    errno.ENAMETOOLONG: "a shorter file name; the system takes none so long",
    errno.ELOOP: "a file; its links lead round in a circle",
}


def require_writable(path: str | os.PathLike[str]) -> Path:
    """Check, before any work is done, that a file can be put at ``path``.

    Raises
    ------
    ParameterError
        If its folder is missing or cannot be written to, if the path is a folder, or none that the system takes.
    """
    target = Path(path)
    try:
        # What is there tells loops of links and names that are too long from names that are merely new.
        os.stat(target)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as problem:
        reason = _UNUSABLE.get(problem.errno or 0, f"a file that can be written: {problem.strerror}")
        raise ParameterError("output", str(path), reason) from None
    except ValueError:
        raise ParameterError("output", str(path), "a file name without a null character") from None
    folder = target.resolve().parent
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

    The name is another one at every call, so that threads and processes can write one file at once: the last one that
    is done keeps it. It is short, whatever the file's own: that may be as long as the system allows.

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
    try:
        with _ended_in_order(), _reached(target.parent) as folder:
            temporary = folder / f".gyroid-cad-{secrets.token_hex(8)}.partial"
            try:
                yield temporary
                with temporary.open("rb") as written:
                    os.fsync(written.fileno())
                temporary.replace(target)
            finally:
                temporary.unlink(missing_ok=True)
    except OSError as problem:
        if isinstance(problem, ExportError):
            raise
        raise ExportError(f"{path} was not written: {problem.strerror or problem}") from problem


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Give a folder where the system keeps temporary files, and remove it with all that is in it."""
    with _ended_in_order(), TemporaryDirectory(prefix="gyroid-cad-") as folder:
        yield Path(folder)


@contextmanager
def _reached(folder: Path) -> Iterator[Path]:
    """Give a name of a folder that every writer can say: libraries take none that is not UTF-8, but follow links."""
    try:
        str(folder).encode()
        yield folder
        return
    except UnicodeEncodeError:
        pass
    with temporary_folder() as elsewhere:
        link = elsewhere / "folder"
        link.symlink_to(folder, target_is_directory=True)
        yield link


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let signals that would end the program at once end it by ``SystemExit``, so that nothing is left lying about.

    Only the main thread hears of signals, and who has an answer of their own to one keeps it.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard: list[int] = []

    def leave(number: int, frame: FrameType | None) -> None:
        # The next one would interrupt the tidying up.
        if not heard:
            heard.append(number)
            # The status that shells give to a program which a signal ended.
            raise SystemExit(128 + number)

    before = {number: signal.getsignal(number) for number in _ENDING}
    ours = [number for number, answer in before.items() if answer is signal.SIG_DFL]
    try:
        for number in ours:
            signal.signal(number, leave)
        yield
    finally:
        for number in ours:
            signal.signal(number, signal.SIG_DFL)

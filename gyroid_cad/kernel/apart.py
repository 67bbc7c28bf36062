"""Work of the kernel in a process of its own: on some input it crashes, on other it does not come to an end."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from OCP.BinTools import BinTools
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.common.formats import FORMATS, TRIANGLE_FORMATS
from gyroid_cad.common.inputs import unreadable
from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.brep import read_brep
from gyroid_cad.kernel.step import read_step

__all__ = ["name_for_kernel", "read_shape", "require_kind", "run_on_file", "started", "work"]

_WORK = "from gyroid_cad.kernel.apart import work; work()"
# What stands near the beginning of a file of each format, and how many bytes that is at most.
_MARKS = {"step": b"ISO-10303-21", "brep": b"CASCADE TOPOLOGY"}
_HEADER_BYTES = 4096
# A slow machine reads a MB of STEP in some seconds.
SECONDS_AT_LEAST, SECONDS_PER_MB = 60.0, 60.0


def started(program: str, *arguments: str) -> subprocess.Popen[bytes]:
    """Start a Python program that finds the same modules; nothing that it prints is seen.

    Parameters
    ----------
    program : str
        Its text.
    *arguments : str
        As ``sys.argv[1:]``.
    """
    paths = os.pathsep.join(path or os.getcwd() for path in sys.path)
    return subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        env={**os.environ, "PYTHONPATH": paths},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def run_on_file(path: str | os.PathLike[str], program: str, *arguments: str) -> None:
    """Run a Python program that reads a user's file, in a process of its own, to its end.

    Parameters
    ----------
    path : path-like
        Of the file: the larger it is, the longer the program may take.
    program : str
        Its text.
    *arguments : str
        As ``sys.argv[1:]``.

    Raises
    ------
    ExportError
        If it crashes, or does not come to an end.
    """
    process = started(program, *arguments)
    allowed = SECONDS_AT_LEAST + SECONDS_PER_MB * Path(path).stat().st_size / 1e6
    try:
        process.wait(allowed)
    except subprocess.TimeoutExpired:
        raise ExportError(f"{path} could not be read: the kernel was still at it after {allowed:.0f} s") from None
    finally:
        process.kill()
        process.wait()
    if process.returncode:
        raise ExportError(f"{path} could not be read: the kernel crashes on it, as on a file that is damaged")


def read_shape(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read the shape of a user's STEP or BREP file, in millimetres.

    The kernel's readers crash on a third of the files in which some characters were changed at random, and never end
    on others: they are at work in a process of their own.

    Parameters
    ----------
    path : path-like
        What does not end in .brep is read as STEP.

    Raises
    ------
    ExportError
        Saying what is wrong, if it cannot be read or holds no shape.
    """
    kind = require_kind(path)
    with TemporaryDirectory() as folder:
        known, result, problem = name_for_kernel(path, folder), Path(folder, "shape"), Path(folder, "problem")
        # A program that was packed into one file has no Python to start.
        if getattr(sys, "frozen", False):
            return _read(kind, known)
        run_on_file(path, _WORK, kind, known, str(result), str(problem))
        if problem.exists():
            raise ExportError(problem.read_text(encoding="utf-8").replace(known, str(path)))
        shape = TopoDS_Shape()
        BinTools.Read_s(shape, str(result))
        return shape


def work() -> None:
    """Read the file that the command line names, and leave its shape, or the problem with it, in a file."""
    kind, known, result, problem = sys.argv[1:]
    try:
        shape = _read(kind, known)
        if not BinTools.Write_s(shape, result):
            raise ExportError(f"{known} could not be read: the folder for temporary files is full")
    except ExportError as failed:
        Path(problem).write_text(str(failed), encoding="utf-8")


def _read(kind: str, path: str) -> TopoDS_Shape:
    return read_brep(path) if kind == "brep" else read_step(path)


def require_kind(path: str | os.PathLike[str]) -> str:
    """Tell by its ending and its first bytes what kind of file it is: "step" or "brep".

    Raises
    ------
    ExportError
        If there is no such file, or it is of another kind.
    """
    if reason := unreadable(path):
        raise ExportError(f"{path} could not be read: {reason}")
    kind = FORMATS.get(Path(path).suffix.lower(), "step")
    if kind in TRIANGLE_FORMATS:
        raise ExportError(f"{path} could not be read: {kind.upper()} holds triangles; a STEP or BREP file is needed")
    with open(path, "rb") as file:
        if _MARKS[kind] not in file.read(_HEADER_BYTES).upper():
            raise ExportError(f"{path} could not be read as {kind.upper()}: it does not begin as such a file does")
    return kind


def name_for_kernel(path: str | os.PathLike[str], folder: str) -> str:
    """Return the path, or that of a link to it in a folder: the kernel knows no names that are not UTF-8."""
    try:
        str(path).encode()
        return str(path)
    except UnicodeEncodeError:
        link = Path(folder, f"file{Path(path).suffix}")
        link.symlink_to(Path(path).resolve())
        return str(link)

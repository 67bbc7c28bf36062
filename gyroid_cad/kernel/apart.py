"""Work of the kernel in a process of its own: on some input it crashes, on other it does not come to an end."""

from __future__ import annotations

import os
import pickle
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from OCP.BinTools import BinTools
from OCP.TopoDS import TopoDS_Iterator, TopoDS_Shape

from gyroid_cad.common.formats import BREP, STEP, Format, format_of
from gyroid_cad.common.inputs import unreadable, utf8_named
from gyroid_cad.common.packed import unpacked
from gyroid_cad.common.processes import Started, started
from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.assembly import read_bodies_and_faces
from gyroid_cad.kernel.brep import read_brep
from gyroid_cad.kernel.check import compound_of
from gyroid_cad.kernel.step import read_step

__all__ = [
    "Contents",
    "answer",
    "bodies_of_step",
    "brep_contents",
    "read_apart",
    "read_named",
    "read_shape",
    "require_cad_file",
    "step_contents",
]

# Shapes, and whatever else a file says of them that can be pickled.
Contents = tuple[Sequence[TopoDS_Shape], Any]

# What stands near the beginning of a file of each format, and how many bytes that is at most.
_MARKS = {STEP: b"ISO-10303-21", BREP: b"CASCADE TOPOLOGY"}
_HEADER_BYTES = 4096
# A slow machine reads a MB of STEP in some seconds.
SECONDS_AT_LEAST, SECONDS_PER_MB = 60.0, 60.0
# Names of what the other process leaves in a folder.
_SHAPES, _VALUES, _PROBLEM = "shapes", "values", "problem"


def read_shape(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read the shape of a user's STEP or BREP file, in millimetres.

    Parameters
    ----------
    path : path-like
        What does not end in .brep is read as STEP.

    Raises
    ------
    ExportError
        Saying what is wrong, if it cannot be read or holds no shape.
    """
    form = require_cad_file(path)
    ((shape,), _) = read_apart(path, brep_contents if form is BREP else step_contents)
    return shape


def read_named(path: str | os.PathLike[str]) -> tuple[Sequence[TopoDS_Shape], list[list[str]], list[list[str]]]:
    """Read the bodies of a user's STEP or BREP file, in millimetres, each with its names, and those of its faces.

    Of BREP there are none.

    Raises
    ------
    ExportError
        As of :func:`read_shape`.
    """
    if require_cad_file(path) is BREP:
        shapes, _ = read_apart(path, brep_contents)
        return shapes, [[] for _ in shapes], [[] for _ in shapes]
    shapes, (names, face_names) = read_apart(path, bodies_of_step)
    return shapes, names, face_names


def bodies_of_step(path: str) -> Contents:
    """Read the bodies of a STEP file, their names and those of their faces, in this process."""
    shapes, *names = read_bodies_and_faces(path)
    return shapes, names


def step_contents(path: str) -> Contents:
    """Read the shape of a STEP file, in this process."""
    return [read_step(path)], None


def brep_contents(path: str) -> Contents:
    """Read the shape of a BREP file, in this process."""
    return [read_brep(path)], None


def read_apart(path: str | os.PathLike[str], reader: Callable[[str], Contents]) -> Contents:
    """Have a user's file read in another process.

    The kernel's readers crash on a third of the files in which some characters were changed at random, and never end
    on others.

    Parameters
    ----------
    path : path-like
    reader : callable
        A function of a module, from a path that the kernel takes to contents.

    Raises
    ------
    ExportError
        If the reader raises one, crashes, or does not come to an end.
    """
    with TemporaryDirectory() as folder, unpacked(path) as text, utf8_named(text) as known:
        # A program that was packed into one file has no Python to start.
        if getattr(sys, "frozen", False):
            return reader(known)
        _run(path, text, started(answer, reader.__module__, reader.__name__, known, folder))
        if Path(folder, _PROBLEM).exists():
            problem = Path(folder, _PROBLEM).read_text(encoding="utf-8")
            raise ExportError(problem.replace(known, str(path)))
        compound = TopoDS_Shape()
        BinTools.Read_s(compound, str(Path(folder, _SHAPES)))
        return _parts(compound), pickle.loads(Path(folder, _VALUES).read_bytes())


def answer(module: str, reader: str, known: str, folder: str) -> None:
    """Read a file by a function of a module, and leave its contents, or the problem with it, in a folder."""
    try:
        shapes, values = getattr(import_module(module), reader)(known)
        if not BinTools.Write_s(compound_of(shapes), str(Path(folder, _SHAPES))):
            raise ExportError(f"{known} could not be read: the folder for temporary files is full")
        Path(folder, _VALUES).write_bytes(pickle.dumps(values))
    except ExportError as failed:
        Path(folder, _PROBLEM).write_text(str(failed), encoding="utf-8")


def _run(path: str | os.PathLike[str], text: Path, process: Started) -> None:
    """Wait for a process that reads a file: longer, the larger its text is."""
    allowed = SECONDS_AT_LEAST + SECONDS_PER_MB * text.stat().st_size / 1e6
    try:
        status = process.wait(allowed)
    finally:
        process.kill()
    if status is None:
        raise ExportError(f"{path} could not be read: the kernel was still at it after {allowed:.0f} s")
    if status:
        raise ExportError(f"{path} could not be read: the kernel crashes on it, as on a file that is damaged")


def _parts(compound: TopoDS_Shape) -> list[TopoDS_Shape]:
    shapes, iterator = [], TopoDS_Iterator(compound)
    while iterator.More():
        shapes.append(iterator.Value())
        iterator.Next()
    return shapes


def require_cad_file(path: str | os.PathLike[str]) -> Format:
    """Tell by its ending and its first bytes what a file is: STEP or BREP.

    Raises
    ------
    ExportError
        If there is no such file, or it is something else.
    """
    if reason := unreadable(path):
        raise ExportError(f"{path} could not be read: {reason}")
    form = format_of(path) or STEP
    if form not in _MARKS:
        raise ExportError(f"{path} could not be read: it is {form.name} by its ending, where STEP or BREP is needed")
    with unpacked(path) as text, text.open("rb") as file:
        if _MARKS[form] not in file.read(_HEADER_BYTES).upper():
            raise ExportError(f"{path} could not be read as {form.name}: it does not begin as such a file does")
    return form

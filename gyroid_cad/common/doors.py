"""The doors of the package, and what each calls an option: Python, shell, TOML file, CadQuery and build123d.

What one door can do, all can; where one lacks an option, the table says why. ``LATTICE`` is of
:class:`gyroid_cad.Lattice` and its ``write``, of ``gyroid-cad build`` and its file, of ``Workplane.gyroid`` and
``Gyroid``; ``FILL`` of :func:`gyroid_cad.fill`, ``gyroid-cad fill``, ``Workplane.gyroid_fill`` and ``GyroidFill``.

>>> {row.option: row.shell for row in LATTICE}["cell size"]
'--cell-size'
>>> {row.option: row.cadquery for row in LATTICE}["file"]
Absent(reason="the host's exporters write")
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

__all__ = ["DOORS", "FILL", "LATTICE", "Absent", "Row", "commands_with", "key_of"]

DOORS = ("python", "shell", "toml", "cadquery", "build123d")


@dataclass(frozen=True, slots=True)
class Absent:
    """An option that a door lacks, and why."""

    reason: str


@dataclass(frozen=True, slots=True)
class Row:
    """One option, and its name at each door, or why there is none.

    Attributes
    ----------
    option : str
        In words.
    python, cadquery, build123d : str or Absent
        Parameters.
    shell : str or Absent
        Long options; an argument in capitals.
    toml : str or Absent
        Keys.
    """

    option: str
    python: str | Absent
    shell: str | Absent
    toml: str | Absent
    cadquery: str | Absent
    build123d: str | Absent


def _row(option: str, shell: str | Absent | None = None, **others: str | Absent) -> Row:
    """A row whose names follow from the option's words, where they are not given: the hosts' from Python's."""
    name = option.replace(" ", "_")
    shell = shell or f"--{name.replace('_', '-')}"
    key = shell if isinstance(shell, Absent) else shell.removeprefix("--").replace("-", "_").lower()
    python = others.get("python", name)
    names: dict[str, str | Absent] = {"python": python, "toml": key, "cadquery": python, "build123d": python}
    return Row(option, shell=shell, **{**names, **others})


def _but_python(reason: str) -> dict[str, Any]:
    """Python lacks it, and so do the hosts."""
    return {"python": Absent(reason)}


def _but_hosts(reason: str) -> dict[str, Any]:
    """Both hosts lack it."""
    return {"cadquery": Absent(reason), "build123d": Absent(reason)}


def _shell_alone(option: str, reason: str) -> Row:
    return _row(option, python=Absent(reason), toml=Absent("of how a command answers, not of what it makes"))


_FIT = _but_python("in `fit`, a `FitSettings`")
_WRITING = _but_hosts("the host's exporters write")
_MESHED = _but_hosts("the host's shapes hold no elements: `gyroid_cad.fill(...).mesh()`")
_NO_PROGRESS = _but_hosts("the host's methods show none")
_NO_TRIANGLES = _but_hosts("a host's shape needs a B-rep, which triangles are not")
_OF_PAPER = _but_hosts("`Lattice.paper(...)`, then `to_cadquery` or `to_build123d`")
_OF_BLOCK = _but_python("in `lattice`, a `Lattice`")
_CHECK = {"python": Absent("`print_check(made, printer)`")}
_OF_FILE = {"python": Absent("`check_file(path)`, of any file")}
_ELSEWHERE = {"python": Absent("nothing is there to combine with"), "shell": Absent("nothing is there to combine with")}

_WALL = (
    _row("cell size"),
    _row("thickness"),
    _row("density"),
    _row("porosity"),
    _row("pore size"),
    _row("throat"),
    _row("hydraulic diameter"),
    _row("area per volume"),
    _row("curvature radius"),
    _row("surface"),
    _row("tolerance"),
    _row("compact"),
    _row("fit"),
    _row("control points", **_FIT),
    _row("keep islands"),
)
_WRITTEN = (
    _row("file", "--output", python="paths", **_WRITING),
    _row("schema", **_WRITING),
    _row("author", **_WRITING),
    _row("organisation", **_WRITING),
    _row("pcurves", **_WRITING),
    _row("products", **_WRITING),
    _row("regions", **_WRITING),
    _row("deviation", **_WRITING),
    _row("angle", **_WRITING),
)
_ANSWER = (
    _row("check", **_OF_FILE),
    _row("printer", **_CHECK),
    _row("progress", Absent("shown on a terminal, unless `--quiet`"), **_NO_PROGRESS),
    _shell_alone("json", "`report.as_dict()`"),
    _shell_alone("quiet", "Python says nothing unless it is asked"),
    _shell_alone("print config", "the call is its own record"),
    _shell_alone("allow outside", "paths are the script's own"),
    _shell_alone("debug", "errors have tracebacks"),
)

LATTICE = (
    _row("cells"),
    *_WALL,
    _row("scale field"),
    _row("map"),
    _row("trim"),
    _row("kind"),
    _row("origin", **_but_hosts("the host places it: by workplane, `centered`, `align`, locations")),
    _row("rotation", cadquery=Absent("the workplane turns it")),
    _row("thickness factor", **_OF_PAPER),
    _row("bc length", **_OF_PAPER),
    _row("scale", **_OF_PAPER),
    *_WRITTEN,
    _row("kernel check", **_but_hosts("a host's shape is the kernel's own")),
    _row("instances", **_but_hosts("the host's assemblies hold one shape at many places")),
    *_ANSWER,
    _row(
        "alignment",
        Absent("`--origin` places it"),
        python=Absent("`origin` places it"),
        cadquery="centered",
        build123d="align",
    ),
    _row("combination", **_ELSEWHERE, cadquery="combine", build123d="mode"),
    _row("clean", **_ELSEWHERE, cadquery="clean", build123d=Absent("no two faces lie on one surface")),
)

FILL = (
    _row("part", "PART", cadquery=Absent("the solid in the chain")),
    *_WALL,
    _row("kind"),
    _row("skin"),
    _row("openings", "--opening"),
    _row("plug"),
    _row("core"),
    _row("fillet", **_NO_TRIANGLES),
    _row("solids", "--solid"),
    _row("partial"),
    _row("origin"),
    _row("rotation"),
    _row("drop islands"),
    _row("route", **_NO_TRIANGLES),
    _row("repair", **_NO_TRIANGLES),
    _row("material density", cadquery=Absent("a workplane keeps no report")),
    _row("lattice", Absent("described by `--cells` and what goes with it")),
    _row("cells", **_OF_BLOCK),
    _row("scale field", **_OF_BLOCK),
    _row("map", **_OF_BLOCK),
    _row("thickness factor", **_OF_BLOCK),
    _row("bc length", **_OF_BLOCK),
    _row("scale", **_OF_BLOCK),
    *_WRITTEN,
    _row("element size", **_MESHED),
    _row("elements through", **_MESHED),
    _row("order", **_MESHED),
    *_ANSWER,
    _row("combination", **_ELSEWHERE, cadquery=Absent("the filled part takes the chain's place"), build123d="mode"),
)


def key_of(parameter: str) -> str:
    """Key of a file, and name of the shell's option, for a parameter of Python's; itself where they are called alike.

    >>> key_of("openings"), key_of("thickness")
    ('opening', 'thickness')
    """
    others = {row.python: row.toml for row in (*LATTICE, *FILL)}
    key = others.get(parameter)
    return key if isinstance(key, str) else parameter


def commands_with(key: str) -> list[str]:
    """Commands of the shell that take a key of a file.

    >>> commands_with("skin"), commands_with("trim"), commands_with("cells"), commands_with("skn")
    (['fill'], ['build'], ['build', 'fill'], [])
    """
    tables = {"build": LATTICE, "fill": FILL}
    return [command for command, rows in tables.items() if any(row.toml == key for row in rows)]

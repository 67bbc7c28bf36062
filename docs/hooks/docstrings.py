"""Our docstrings as griffe reads them: Sphinx's roles as links, and one entry a name where several share a line.

Roles such as :class:`gyroid_cad.Lattice` become references that may be missing: what has no page is plain code. Of
"cells, cell_size" griffe would give both the first one's type, of "ParameterError, FitError" make one tuple, and of
{"box"} the default.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import griffe

_ROLE = re.compile(r":(?:class|func|meth|mod|attr|data|exc):`(~?)([\w.]+)`")
_SECTIONS = ("Parameters", "Attributes", "Raises")
_NAMES = re.compile(r"\*{0,2}\w+(, \*{0,2}\w+)+")
_CHOICES = re.compile(r"^([\w*, ]+ : )\{(.+)\}(.*)$")


class Docstrings(griffe.Extension):
    """Rewrites every docstring as it is read."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Called by griffe for every object."""
        if obj.docstring is not None:
            text = "\n".join(_apart(obj.docstring.value.split("\n")))
            obj.docstring.value = _ROLE.sub(lambda role: _reference(obj, *role.groups()), text)


def _apart(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring with an entry of its own for every name."""
    section, index = "", 0
    while index < len(lines):
        line, following = lines[index], lines[index + 1] if index + 1 < len(lines) else ""
        if line and following and set(following) == {"-"}:
            section = line
        index += 1
        if section not in _SECTIONS:
            yield line
        elif _NAMES.fullmatch(line):
            end = index
            while end < len(lines) and (lines[end].startswith(" ") or (not lines[end] and _indented(lines, end + 1))):
                end += 1
            for name in line.split(", "):
                yield name
                yield from lines[index:end]
            index = end
        else:
            yield _CHOICES.sub(r"\1\2\3", line)


def _indented(lines: list[str], index: int) -> bool:
    return index < len(lines) and lines[index].startswith(" ")


def _reference(obj: griffe.Object, shortened: str, target: str) -> str:
    text = target.rpartition(".")[2] if shortened else target
    parent = obj.parent
    # ":meth:`write`" and ":data:`NAME`" are of the class, or the module, that the docstring stands in.
    if "." not in target and parent is not None:
        own = [holder for holder in (obj, parent, obj.module) if target in holder.members]
        target = f"{own[0].path}.{target}" if own else target
    return f'<autoref identifier="{target}" optional>`{text}`</autoref>'

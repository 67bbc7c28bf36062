"""The table of doors, printed into the pages that ask for it by ``{{ doors LATTICE }}`` or ``{{ doors FILL }}``."""

from __future__ import annotations

import re
from collections.abc import Sequence

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import Files
from mkdocs.structure.pages import Page

from gyroid_cad.common import doors

ASKED = re.compile(r"\{\{ doors (LATTICE|FILL) \}\}")
HEADER = ("option", "Python", "shell", "TOML", "CadQuery", "build123d")


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Put the tables where a page asks for them."""
    return ASKED.sub(lambda asked: printed(getattr(doors, asked.group(1))), markdown)


def printed(rows: Sequence[doors.Row]) -> str:
    """A table of rows as Markdown, with numbered reasons below it for what a door lacks."""
    reasons: list[str] = []
    lines = [HEADER, tuple("---" for _ in HEADER)]
    for row in rows:
        lines.append((row.option, *(_entry(getattr(row, door), reasons) for door in doors.DOORS)))
    table = "\n".join(f"| {' | '.join(line)} |" for line in lines)
    notes = "\n".join(f"{number}. {reason}" for number, reason in enumerate(reasons, 1))
    return f"{table}\n\nNot there, because:\n\n{notes}\n"


def _entry(name: str | doors.Absent, reasons: list[str]) -> str:
    if isinstance(name, str):
        return f"`{name}`"
    if name.reason not in reasons:
        reasons.append(name.reason)
    return f"none ({reasons.index(name.reason) + 1})"

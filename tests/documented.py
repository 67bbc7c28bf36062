"""Markdown pages run as a reader runs them: their blocks, one after the other, in one folder."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import pytest

from gyroid_cad.cli.app import main

ROOT = Path(__file__).parents[1]
_FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Block:
    """A fenced block of a page, and the block of text right below that says what it prints.

    Attributes
    ----------
    page : Path
    number : int
        From 1, among the page's blocks.
    language, text : str
    printed : str, optional
    """

    page: Path
    number: int
    language: str
    text: str
    printed: str | None

    def __str__(self) -> str:
        return f"{self.page.stem}, block {self.number}: {self.text[:60].splitlines()[0]}"


def blocks_of(page: Path) -> list[Block]:
    """Blocks of a page in their order; text that shows what the one before prints is a part of that one."""
    found = list(_FENCE.finditer(page.read_text()))
    blocks = []
    for number, block in enumerate(found, start=1):
        below = found[number] if number < len(found) else None
        # With nothing but an empty line between: what is further down is no output of this one.
        adjacent = below is not None and page.read_text()[block.end() : below.start()].strip() == ""
        printed = below[2] if adjacent and below[1] == "text" else None
        blocks.append(Block(page, number, block[1], block[2], printed))
    return blocks


def run_shell(block: Block, captured: pytest.CaptureFixture[str]) -> str:
    """What the commands of a block print, in this process: to start the program takes longer than most of them."""
    printed = []
    for command in block.text.splitlines():
        program, *arguments = shlex.split(command)
        assert program == "gyroid-cad", command
        status = main(arguments)
        out, err = captured.readouterr()
        assert status == 0, f"{command}: {err}"
        printed.append(out)
    return "".join(printed)


def run_python(block: Block, captured: pytest.CaptureFixture[str], namespace: dict[str, object]) -> str:
    """What the code of a block prints."""
    exec(compile(block.text, str(block), "exec"), namespace)
    return captured.readouterr().out


def lines_of(text: str) -> list[str]:
    """Lines without the spaces that lay them out in columns."""
    return [" ".join(line.split()) for line in text.splitlines()]


def missing(expected: str, printed: str) -> list[str]:
    """Lines of a page that were not printed, each after the one before it."""
    rest: Iterable[str] = iter(lines_of(printed))
    return [line for line in lines_of(expected) if line not in rest]

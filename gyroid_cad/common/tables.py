"""Tables as plain text, and what is shown alike in all of them."""

from __future__ import annotations

from collections.abc import Sequence

__all__ = ["Rows", "cell_shown", "cells_shown", "islands_shown", "text_table", "volume_shown", "wall_shown"]

Rows = list[tuple[str, str]]


def text_table(rows: Sequence[tuple[str, ...]], header: tuple[str, ...] | None = None) -> str:
    """Rows of text in columns, two spaces apart.

    Parameters
    ----------
    rows : sequence of tuple of str
        All of one length.
    header : tuple of str, optional
        Headings of the columns.

    Returns
    -------
    str
        A line for each row, without spaces at its end.
    """
    lines = [*([] if header is None else [header]), *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    padded = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)
    return "\n".join(line.rstrip() for line in padded)


def cells_shown(cells: tuple[int, int, int], cell_size: float, alike: bool = True) -> str:
    """Number of cells and their size; where a scale field or a map changes them, before that."""
    counts = " x ".join(map(str, cells))
    return f"{counts}, {cell_size:g} mm each" if alike else f"{counts}, {cell_size:g} mm before scaling or mapping"


def cell_shown(cell_size: float, alike: bool) -> str:
    """Size of cells, as in a sentence; where a scale field or a map changes them, before that.

    >>> cell_shown(10.0, alike=False)
    'cells of 10 mm before scaling or mapping'
    """
    return f"cells of {cell_size:g} mm{'' if alike else ' before scaling or mapping'}"


def wall_shown(thickness: float, low: float, high: float, density: float) -> str:
    """Thickness of a wall in mm, or its range and mean where it varies, and the volume fraction."""
    span = f"{thickness:.6g}" if low == high else f"{low:.4g} to {high:.4g}, on average {thickness:.4g}"
    return f"{span} mm, density {density:.5f}"


def volume_shown(volume: float, exact: float | None) -> str:
    """Volume in mm3, and how far it is off the exact one where that is known."""
    error = "" if exact is None else f", {volume / exact - 1:+.1e} of the exact one"
    return f"{volume:.8g} mm3{error}"


def islands_shown(kept: int, kept_volume: float, dropped: int, dropped_volume: float) -> str:
    """Pieces that are left besides the largest one, and those that were dropped, with their volumes in mm3."""
    counted = (("left", kept, kept_volume), ("dropped", dropped, dropped_volume))
    return ", ".join(f"{count} {what}" + (f" ({volume:.4g} mm3)" if volume else "") for what, count, volume in counted)

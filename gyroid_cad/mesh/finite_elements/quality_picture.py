"""The quality of a mesh as a picture: a histogram of each measure."""

from __future__ import annotations

import os
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gyroid_cad.common.files import replacing, require_writable
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.summaries import MeasureSummary, Quality, shown_name

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_quality", "require_histogram"]

_FORMAT = ".png"
_COLUMNS = 4
# In inches, of each histogram; and how fine.
_WIDTH, _HEIGHT, _DOTS_PER_INCH = 3.1, 2.3, 110
_BAR_COLOUR, _BOUND_COLOUR = "#deae52", "#a03020"


def require_histogram(path: str | os.PathLike[str]) -> Path:
    """Check, before anything is meshed, that a picture of histograms can be drawn into a file.

    Raises
    ------
    ParameterError
        If the path does not end in .png or cannot be written to, or matplotlib is missing.
    """
    target = require_writable(path)
    if target.suffix.lower() != _FORMAT:
        raise ParameterError("histogram", str(path), f"a file name ending in {_FORMAT}")
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        raise ParameterError("histogram", str(path), "none without matplotlib: pip install matplotlib") from None
    return target


def draw_quality(quality: Quality, path: str | os.PathLike[str], title: str = "") -> Path:
    """Draw the histograms of every measure into a PNG file.

    A dashed line is the bound of what is acceptable, where it lies within the picture.

    Parameters
    ----------
    quality : Quality
    path : path-like
        Ending in .png. The file appears whole or not at all.
    title : str, optional
        Number and kind of the elements if left out.

    Returns
    -------
    Path

    Raises
    ------
    ParameterError
        If the path does not end in .png or cannot be written to, or matplotlib is missing.
    ExportError
        If the file could not be written.
    """
    target = require_histogram(path)
    from matplotlib.figure import Figure

    rows = ceil(len(quality.measures) / _COLUMNS)
    figure = Figure(figsize=(_COLUMNS * _WIDTH, rows * _HEIGHT + 0.4), dpi=_DOTS_PER_INCH, layout="constrained")
    figure.suptitle(title or _subject(quality))
    grid = figure.subplots(rows, _COLUMNS, squeeze=False).ravel()
    for name, axes in zip(quality.measures, grid, strict=False):
        _draw(axes, name, quality.measures[name])
    for axes in grid[len(quality.measures) :]:
        axes.set_axis_off()
    with replacing(target) as temporary:
        # The program's version in the file would make it differ where the picture does not.
        figure.savefig(temporary, format="png", metadata={"Software": None})
    return target


def _subject(quality: Quality) -> str:
    if quality.nodes_per_element == 4:
        return f"{quality.elements:,} quadrilaterals"
    return f"{quality.elements:,} hexahedra of {quality.nodes_per_element} nodes"


def _draw(axes: Axes, name: str, summary: MeasureSummary) -> None:
    used = np.flatnonzero(summary.counts)
    # Two empty bins on either side show where the values end.
    first, last = (max(used[0] - 2, 0), min(used[-1] + 3, len(summary.counts))) if len(used) else (0, 1)
    edges = summary.edges[first : last + 1]
    axes.stairs(summary.counts[first:last], edges, fill=True, color=_BAR_COLOUR)
    if edges[0] <= summary.bound <= edges[-1]:
        axes.axvline(summary.bound, color=_BOUND_COLOUR, linestyle="--", linewidth=1)
    axes.set_xlim(float(edges[0]), float(edges[-1]))
    axes.set_title(shown_name(name) + (", degrees" if name.endswith("angle") else ""), fontsize=10)
    axes.set_xlabel(f"{summary.smallest:.3g} to {summary.largest:.3g}, mean {summary.mean:.3g}", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.locator_params(axis="y", nbins=4, integer=True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)

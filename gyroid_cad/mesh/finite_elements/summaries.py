"""Summaries of all elements' measures: extremes, means, histograms, and the place of the worst. They add up."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from math import ceil
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import PNG, require_output
from gyroid_cad.common.tables import text_table
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.corner_measures import NO_NUMBER

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = [
    "USUAL_BOUNDS",
    "MeasureSummary",
    "Quality",
    "combined",
    "draw_quality",
    "require_histogram",
    "shown_name",
    "shown_number",
    "summary_of",
]

# Relative, and absolute below 1: above rounding, below what tells two shapes apart.
_ALIKE = 1e-9
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _Kind:
    """Properties of a measure: its good end, its acceptable range, and the bins it is counted in."""

    larger_is_better: bool
    bound: float
    lowest: float
    highest: float
    bins: int

    @property
    def edges(self) -> Floats:
        return np.linspace(self.lowest, self.highest, self.bins + 1)


# The bounds are those of CUBIT's manual (hexahedral and quadrilateral metrics), whose warpage is 1 less ours; that of
# the ratio of determinants, which it does not have, is ours.
_KINDS = {
    "scaled_jacobian": _Kind(True, 0.5, -1.0, 1.0, 200),
    "aspect_ratio": _Kind(False, 4.0, 1.0, 11.0, 200),
    "edge_ratio": _Kind(False, 4.0, 1.0, 11.0, 200),
    "skew": _Kind(False, 0.5, 0.0, 1.0, 100),
    "warpage": _Kind(False, 0.1, 0.0, 2.0, 400),
    "min_angle": _Kind(True, 45.0, 0.0, 90.0, 90),
    "max_angle": _Kind(False, 135.0, 90.0, 360.0, 135),
    "determinant_ratio": _Kind(True, 0.3, -1.0, 1.0, 200),
    "sampled_scaled_jacobian": _Kind(True, 0.5, -1.0, 1.0, 200),
}
USUAL_BOUNDS: Mapping[str, float] = MappingProxyType({name: kind.bound for name, kind in _KINDS.items()})


@dataclass(frozen=True, slots=True, eq=False)
class MeasureSummary:
    """One measure over all elements.

    Attributes
    ----------
    smallest, largest : float
        1e30 stands for no number, as in Verdict.
    mean, standard_deviation : float
        Of the elements that have a number; the deviation is the population's.
    counts : ndarray of int, shape (bins,)
        Elements by value. What lies outside the edges is counted in the bin next to it.
    edges : ndarray, shape (bins + 1,)
        The same for every mesh, so that histograms can be compared and added.
    bound : float
        Where acceptable ends.
    beyond : int
        Elements on the wrong side of the bound.
    undefined : int
        Elements that have no number; they count as beyond the bound.
    worst_element : int
        Index among the cells.
    worst_place : ndarray, shape (3,)
        Mean of its nodes, in mm.
    """

    smallest: float
    largest: float
    mean: float
    standard_deviation: float
    counts: Integers
    edges: Floats
    bound: float
    beyond: int
    undefined: int
    worst_element: int
    worst_place: Floats

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def as_dict(self) -> dict[str, Any]:
        """As plain values, ready for JSON."""
        values = {name: getattr(self, name) for name in self.__slots__}
        return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in values.items()}

    def cells(self, name: str) -> tuple[str, ...]:
        """Numbers of the measure of this name, as a table shows them."""
        numbers = (self.smallest, self.mean, self.largest, self.standard_deviation)
        side = "<" if _KINDS[name].larger_is_better else ">"
        place = (f"{coordinate + 0.0:.4g}" for coordinate in np.round(self.worst_place, 6).tolist())
        return *map(shown_number, numbers), f"{self.beyond} {side} {self.bound:.3g}", ", ".join(place)


@dataclass(frozen=True, slots=True, eq=False)
class Quality:
    """Quality of the elements of a mesh.

    Attributes
    ----------
    elements : int
    nodes_per_element : int
        4 (quadrilaterals), or 8, 20 or 27 (hexahedra).
    inverted : int
        Hexahedra with a determinant that is not positive at one of their nodes or Gauss points.
    measures : mapping of str to MeasureSummary
        Of quadrilaterals and hexahedra ``scaled_jacobian``, ``aspect_ratio``, ``edge_ratio``, ``skew``, ``warpage``,
        ``min_angle`` and ``max_angle`` (degrees); of hexahedra ``determinant_ratio`` too, and of quadratic
        ones ``sampled_scaled_jacobian``.
    """

    elements: int
    nodes_per_element: int
    inverted: int
    measures: Mapping[str, MeasureSummary]

    def as_dict(self) -> dict[str, Any]:
        """As plain values, ready for JSON."""
        return {
            "elements": self.elements,
            "nodes_per_element": self.nodes_per_element,
            "inverted": self.inverted,
            "measures": {name: summary.as_dict() for name, summary in self.measures.items()},
        }

    def header(self) -> tuple[str, ...]:
        """Headings of the rows."""
        return "measure", "smallest", "mean", "largest", "deviation", "beyond bound", "worst at (mm)"

    def rows(self) -> list[tuple[str, ...]]:
        """One line for each measure, as they are printed."""
        return [(shown_name(name), *summary.cells(name)) for name, summary in self.measures.items()]

    def __str__(self) -> str:
        return text_table(self.rows(), self.header())


def combined(qualities: Iterable[Quality]) -> Quality:
    """One report on several meshes of the same kind of element, numbered one after the other.

    Parameters
    ----------
    qualities : iterable of Quality
        One or more, made with the same bounds.
    """
    return reduce(_both, qualities)


def shown_name(name: str) -> str:
    """A measure's name as people read it."""
    return name.replace("_", " ").replace("jacobian", "Jacobian")


def shown_number(number: float) -> str:
    """A measure as people read it."""
    return "none" if number >= NO_NUMBER else f"{number:.4g}"


def summary_of(name: str, values: Floats, bound: float, centres: Floats) -> MeasureSummary:
    """Summarise one measure.

    Parameters
    ----------
    name : str
        Of the measure.
    values : ndarray, shape (m,)
    bound : float
        Where acceptable ends.
    centres : ndarray, shape (3, m)
        Of the elements, in mm.
    """
    kind = _KINDS[name]
    defined = values[values < NO_NUMBER]
    beyond = values < bound if kind.larger_is_better else values > bound
    badness = -values if kind.larger_is_better else values
    worst = int(np.argmax(badness >= _alike(badness.max())))
    inside = np.clip((defined - kind.lowest) / (kind.highest - kind.lowest) * kind.bins, 0, kind.bins - 1)
    return MeasureSummary(
        smallest=float(values.min()),
        largest=float(values.max()),
        mean=float(defined.mean()) if len(defined) else NO_NUMBER,
        standard_deviation=float(defined.std()) if len(defined) else 0.0,
        counts=np.bincount(inside.astype(np.int64), minlength=kind.bins),
        edges=kind.edges,
        bound=float(bound),
        beyond=int(beyond.sum()),
        undefined=len(values) - len(defined),
        worst_element=worst,
        worst_place=centres[:, worst],
    )


def _alike(badness: float) -> float:
    """Least value that is as bad: elements that are images of each other differ by rounding, and the first is named."""
    return badness - _ALIKE * max(abs(badness), 1.0)


def _both(first: Quality, second: Quality) -> Quality:
    if first.nodes_per_element != second.nodes_per_element:
        raise ParameterError("qualities", second.nodes_per_element, f"elements of {first.nodes_per_element} nodes too")
    summaries = {
        name: _both_summaries(name, summary, second.measures[name], first.elements, second.elements)
        for name, summary in first.measures.items()
    }
    return Quality(
        first.elements + second.elements,
        first.nodes_per_element,
        first.inverted + second.inverted,
        MappingProxyType(summaries),
    )


def _both_summaries(
    name: str, first: MeasureSummary, second: MeasureSummary, first_elements: int, second_elements: int
) -> MeasureSummary:
    """Mean and variance by Chan, Golub and LeVeque's updating formula (1983)."""
    if first.bound != second.bound:
        raise ParameterError("qualities", second.bound, f"the same bound of {name}, {first.bound:g}")
    n, m = first_elements - first.undefined, second_elements - second.undefined
    mean, deviation = first.mean if n else second.mean, first.standard_deviation if n else second.standard_deviation
    if n and m:
        apart = second.mean - first.mean
        mean = first.mean + apart * m / (n + m)
        squares = n * first.standard_deviation**2 + m * second.standard_deviation**2 + apart**2 * n * m / (n + m)
        deviation = float(np.sqrt(squares / (n + m)))
    larger_is_better = _KINDS[name].larger_is_better
    badness = (-first.smallest, -second.smallest) if larger_is_better else (first.largest, second.largest)
    keep = badness[0] >= _alike(badness[1])
    return replace(
        first,
        smallest=min(first.smallest, second.smallest),
        largest=max(first.largest, second.largest),
        mean=mean,
        standard_deviation=deviation,
        counts=first.counts + second.counts,
        beyond=first.beyond + second.beyond,
        undefined=first.undefined + second.undefined,
        worst_element=first.worst_element if keep else first_elements + second.worst_element,
        worst_place=first.worst_place if keep else second.worst_place,
    )


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
    target = require_output(path, [PNG], "histogram")
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

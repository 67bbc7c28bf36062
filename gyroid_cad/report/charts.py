"""Histograms as inline SVG: no script, no font, no colour of their own; the page's style sheet gives those."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from math import ceil, floor, log10
from types import MappingProxyType

__all__ = ["LABELS", "NOTES", "STYLE", "TITLES", "histogram", "label_of", "ticks"]

STYLE = """
:root { color-scheme: light dark; --paper: #fbfaf7; --card: #ffffff; --ink: #23211d; --faint: #77716a; --line: #e4dfd6;
  --bar: #d9a441; --accent: #2f6da3; --good: #2c7a4b; --bad: #b23a2e; }
@media (prefers-color-scheme: dark) { :root { --paper: #191817; --card: #232120; --ink: #ece8e1; --faint: #a29b92;
  --line: #3a3734; --bar: #d9a441; --accent: #7fb2df; --good: #6cc492; --bad: #ef8a7d; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); line-height: 1.5; font-size: 15px;
  font-family: system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Noto Sans", sans-serif; }
main { max-width: 1080px; margin: 0 auto; padding: 40px 28px 64px; }
header p { margin: 4px 0 0; color: var(--faint); }
h1 { font-size: 30px; line-height: 1.2; margin: 0; letter-spacing: -0.01em; overflow-wrap: anywhere; }
h2 { font-size: 19px; margin: 0 0 4px; letter-spacing: -0.005em; }
h3 { font-size: 15px; margin: 20px 0 2px; }
section { margin-top: 28px; background: var(--card); border: 1px solid var(--line); border-radius: 10px;
  padding: 22px 24px 24px; }
.note { color: var(--faint); margin: 0 0 12px; max-width: 78ch; }
.facts { display: grid; grid-template-columns: repeat(auto-fit, minmax(150px, 1fr)); gap: 12px; margin-top: 24px; }
.fact { background: var(--card); border: 1px solid var(--line); border-radius: 10px; padding: 12px 16px; }
.fact b { display: block; font-size: 21px; font-weight: 600; font-variant-numeric: tabular-nums; }
.fact span { color: var(--faint); font-size: 13px; }
.views { display: grid; grid-template-columns: repeat(6, 1fr); gap: 8px 20px; }
figure { margin: 0; grid-column: span 2; text-align: center; align-self: end; }
figure:first-child { grid-column: span 6; }
figure img { max-width: 100%; height: auto; max-height: 340px; }
figure:first-child img { max-height: 520px; }
figcaption { color: var(--faint); font-size: 13px; }
.key { display: inline-block; width: 11px; height: 11px; border-radius: 3px; margin: 0 4px 0 12px; vertical-align: -1px;
  border: 1px solid var(--line); }
.key:first-child { margin-left: 0; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 6px 18px 6px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child > * { border-bottom: 0; }
th { font-weight: 400; color: var(--faint); }
table.facts-table th { width: 42%; }
thead th { font-size: 13px; }
td { overflow-wrap: anywhere; }
td.number, th.number { text-align: right; padding-right: 4px; padding-left: 14px; white-space: nowrap; }
.yes { color: var(--good); } .no { color: var(--bad); }
.columns { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: 8px 36px; }
.chart { width: 100%; max-width: 640px; height: auto; display: block; margin: 6px 0 2px; }
.chart .bar { fill: var(--bar); } .chart .grid { stroke: var(--line); } .chart .axis { stroke: var(--faint); }
.chart .mark { stroke: var(--accent); stroke-width: 1.5; stroke-dasharray: 5 4; }
.chart .tick { fill: var(--faint); font-size: 12px; font-family: inherit; }
footer { color: var(--faint); font-size: 13px; margin-top: 28px; }
@media (max-width: 640px) { main { padding: 24px 14px; } figure { grid-column: span 6; } section { padding: 16px; } }
@media print {
  :root { color-scheme: light; --paper: #fff; --card: #fff; --ink: #000; --faint: #555; --line: #ccc; --bar: #d9a441;
    --accent: #2f6da3; --good: #2c7a4b; --bad: #b23a2e; }
  body { font-size: 10.5pt; } main { max-width: none; padding: 0; } section { padding: 10px 14px; margin-top: 14px; }
  figure, table, .chart, .fact, h2, h3 { break-inside: avoid; } h2, h3, .note { break-after: avoid; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
}
"""


_WIDTH, _HEIGHT = 560, 230
_LEFT, _RIGHT, _TOP, _BOTTOM = 48, 14, 14, 44
_TICKS_ALONG, _TICKS_UP = 6, 4


def histogram(
    edges: Sequence[float],
    shares: Sequence[float],
    axis: str,
    marks: Sequence[tuple[str, float]] = (),
) -> str:
    """A histogram as an ``<svg>`` element.

    Parameters
    ----------
    edges : sequence of float, length bins + 1
    shares : sequence of float, length bins
        Of the whole, from 0 to 1.
    axis : str
        What the values are, and their unit.
    marks : sequence of (str, float)
        Names of values that get a line of their own.
    """
    low, high, most = edges[0], edges[-1], max(shares)
    up = ticks(0.0, 100 * most, _TICKS_UP)
    top = max(100 * most, up[-1], 1e-9)

    def across(value: float) -> float:
        return _LEFT + (value - low) / (high - low) * (_WIDTH - _LEFT - _RIGHT)

    def upwards(percent: float) -> float:
        return _HEIGHT - _BOTTOM - percent / top * (_HEIGHT - _TOP - _BOTTOM)

    along = ticks(low, high, _TICKS_ALONG)
    base = upwards(0.0)
    parts = [
        f'<svg class="chart" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="Histogram: {escape(axis)}">',
        *(
            f'<line class="grid" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{upwards(p):.1f}" y2="{upwards(p):.1f}"/>'
            for p in up
        ),
        *(
            f'<text class="tick" x="{_LEFT - 7}" y="{upwards(p) + 4:.1f}" text-anchor="end">{_label(p, up)} %</text>'
            for p in up
        ),
        *(
            f'<rect class="bar" x="{across(a) + 0.5:.2f}" y="{upwards(100 * share):.2f}" '
            f'width="{max(across(b) - across(a) - 1, 0.5):.2f}" height="{base - upwards(100 * share):.2f}">'
            f"<title>{a:.6g} to {b:.6g}: {100 * share:.2f} %</title></rect>"
            for a, b, share in zip(edges[:-1], edges[1:], shares, strict=True)
            if share > 0
        ),
        f'<line class="axis" x1="{_LEFT}" x2="{_WIDTH - _RIGHT}" y1="{base:.1f}" y2="{base:.1f}"/>',
        *(
            f'<line class="axis" x1="{across(t):.1f}" x2="{across(t):.1f}" y1="{base:.1f}" y2="{base + 4:.1f}"/>'
            f'<text class="tick" x="{across(t):.1f}" y="{base + 17:.1f}" text-anchor="middle">{_label(t, along)}</text>'
            for t in along
        ),
        *(
            f'<line class="mark" x1="{across(value):.1f}" x2="{across(value):.1f}" y1="{_TOP}" y2="{base:.1f}">'
            f"<title>{escape(name)}: {value:.6g}</title></line>"
            for name, value in marks
            if low <= value <= high
        ),
        f'<text class="tick" x="{(_LEFT + _WIDTH - _RIGHT) / 2}" y="{_HEIGHT - 8}" text-anchor="middle">'
        f"{escape(axis)}</text>",
        "</svg>",
    ]
    return "".join(parts)


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from low to high, their steps 1, 2 or 5 times a power of ten, at most so many.

    Parameters
    ----------
    low, high : float
        ``low`` below ``high``.
    most : int
        At least 2.
    """
    rough = (high - low) / max(most - 1, 1)
    if not rough > 0:
        return [low]
    power = 10.0 ** floor(log10(rough))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= rough * (1 - 1e-9))
    first, last = ceil(low / step - 1e-9), floor(high / step + 1e-9)
    return [step * k for k in range(first, last + 1)] or [low]


def _label(value: float, among: Sequence[float]) -> str:
    """As many digits as tell the ticks apart."""
    step = min((b - a for a, b in pairwise(among)), default=abs(value) or 1.0)
    decimals = max(0, -floor(log10(step) + 1e-9))
    return f"{value + 0.0:.{decimals}f}" if decimals <= 7 else f"{value:.8g}"


TITLES: Mapping[str, str] = MappingProxyType(
    {
        "parameters": "What was asked for",
        "measures": "Density, volume and area",
        "wall": "Wall thickness",
        "pores": "Pore sizes",
        "fit": "Fitted against exact",
        "quality": "Elements",
        "file": "What the file holds",
    }
)
NOTES: Mapping[str, str] = MappingProxyType(
    {
        "measures": "Face A looks into the network that the surface's normal points to, face B into the other; the "
        "rim closes the wall where the lattice ends.",
        "wall": "Measured from one fitted face to the other along the normal of the exact mid-surface; shares are of "
        "the mid-surface's area.",
        "pores": "The pore size at a place is the diameter of the largest sphere that fits between the walls and holds "
        "the place; shares are of the pores' volume. Inscribed spheres stand where the distance to the wall is largest "
        "nearby.",
        "fit": "How far the NURBS faces are from the exact minimal surface, or from the exact wall where it varies.",
        "quality": "Of structured hexahedra, one layer across the wall; measures as Verdict defines them, bounds as in "
        "CUBIT's manual.",
    }
)
# Of each value its label, and its unit. Values of one name are called alike in every section.
LABELS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "cells": ("cells", ""),
        "cell_size": ("cell size", "mm"),
        "thickness": ("thickness", "mm"),
        "scale_field": ("scale field", ""),
        "control_points": ("control points along a patch", ""),
        "density": ("density, volume fraction", ""),
        "porosity": ("porosity", ""),
        "wall_thickness": ("wall, mean", "mm"),
        "block_volume": ("volume of the block", "mm³"),
        "bounding_box_low": ("bounding box from", "mm"),
        "bounding_box_high": ("bounding box to", "mm"),
        "extent": ("extent", "mm"),
        "pieces": ("pieces that are connected", ""),
        "boundary_edges": ("edges of the mid-surface that end the lattice", ""),
        "non_manifold_edges": ("non-manifold edges", ""),
        "islands": ("islands: pieces besides the largest", ""),
        "islands_volume": ("volume of the islands", "mm³"),
        "dropped": ("small islands dropped", ""),
        "dropped_volume": ("volume dropped", "mm³"),
        "volume": ("volume", "mm³"),
        "volume_exact": ("volume, exact", "mm³"),
        "volume_error": ("volume, fitted / exact - 1", ""),
        "face_a_area": ("area of face A", "mm²"),
        "face_b_area": ("area of face B", "mm²"),
        "faces_area": ("area of both faces", "mm²"),
        "faces_area_exact": ("area of both faces, exact", "mm²"),
        "faces_area_error": ("area, fitted / exact - 1", ""),
        "rim_area": ("area of the rim", "mm²"),
        "area": ("area in all", "mm²"),
        "area_per_volume": ("area / volume of the solid", "mm²/mm³"),
        "faces_area_per_block_volume": ("area of both faces / volume of the block", "mm²/mm³"),
        "part_of_bounding_box": ("part of the bounding box", ""),
        "max_deviation": ("deviation, largest", "mm"),
        "rms_deviation": ("deviation, root mean square", "mm"),
        "max_normal_angle": ("angle between normals, largest", "degrees"),
        "max_wall_error": ("error of the wall, relative, largest", ""),
        "max_mean_curvature": ("mean curvature, largest (exact: 0)", "1/mm"),
        "edge_gap": ("gap between neighbouring patches", "mm"),
        "samples_per_patch": ("samples a patch", ""),
        "beyond": ("beyond the block", ""),
        "spacing": ("looked up every", "mm"),
        "porosity_counted": ("porosity, counted there", ""),
        "channel_a": ("network A", ""),
        "channel_b": ("network B", ""),
        "count": ("inscribed spheres", ""),
        "min_diameter": ("smallest diameter", "mm"),
        "max_diameter": ("largest diameter", "mm"),
        "open_edges": ("open edges", ""),
        "format": ("format", ""),
        "bytes": ("size", "bytes"),
        "inverted": ("elements turned inside out", ""),
        "nodes_per_element": ("nodes an element", ""),
        "subdivisions": ("subdivisions of a patch's sides", ""),
        "layers": ("layers across the wall", ""),
    }
)


def label_of(name: str) -> tuple[str, str]:
    """Label and unit of a value; of one that has none of its own, the name in words."""
    return LABELS.get(name, (name.replace("_", " "), ""))

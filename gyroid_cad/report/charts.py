"""Histograms as inline SVG: no script, no font, no colour of their own; the page's style sheet gives those."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import pairwise
from math import ceil, floor, log10

__all__ = ["histogram", "ticks"]

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

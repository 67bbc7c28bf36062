"""Figs. 2, 5, 6 and 7: the domain, the samples, the basis functions and the weights, as plots."""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
from drawing import Floats, plot
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from gyroid_cad.nurbs.basis import basis, gauss_points
from gyroid_cad.surface.fit import DEGREE, FitSettings
from gyroid_cad.surface.weierstrass import CORNER

_LINE, _SHADE, _DOT = "#2e2921", "#f0d9a8", "#a03020"
RINGS = RAYS = 10
# Half of the arc that bounds the domain, seen from the circle's centre.
_HALF_ARC = pi / 12


def arc(along: Floats) -> Floats:
    """The arc that bounds the fundamental patch's domain, from the real axis (-1) to the imaginary one (1)."""
    return np.exp(1j * pi / 4) * (sqrt(2) * np.exp(1j * _HALF_ARC * along) - 1)


def polar_grid(rings: int = RINGS, rays: int = RAYS) -> Floats:
    """Complex numbers even along the arc and in the part of the way to it; shape (rings + 1, rays + 1)."""
    return np.linspace(0, 1, rings + 1)[:, np.newaxis] * arc(np.linspace(-1, 1, rays + 1))


def fig_02() -> Path:
    """The domain of integration."""

    def fill(figure: Figure) -> None:
        whole, part = figure.subplots(1, 2)
        border = np.concatenate([[0], arc(np.linspace(-1, 1, 60)), [0]])
        turn = np.exp(1j * np.linspace(0, 2 * pi, 200))
        circle = -np.exp(1j * pi / 4) + sqrt(2) * turn
        whole.plot(circle.real, circle.imag, color=_LINE, linewidth=1)
        whole.plot(*_xy(-np.exp(1j * pi / 4)), "+", color=_LINE)
        whole.set_title("a) the circle of radius √2 about -(1 + i)/√2")
        grid = polar_grid()
        for lines in (grid, grid.T):
            for line in lines:
                part.plot(line.real, line.imag, color=_LINE, linewidth=0.6)
        part.plot([CORNER, 0], [0, CORNER], "o", color=_DOT, markersize=4)
        part.set_title("b) its part in the quadrant; corners at (√3 - 1)/√2")
        for axes in (whole, part):
            axes.fill(border.real, border.imag, color=_SHADE)
            _cross(axes)
            axes.set(aspect="equal", xlabel="u = Re ω", ylabel="v = Im ω")

    return plot("fig_02", fill, (7.2, 3.6))


def fig_05() -> Path:
    """Where the fit's samples lie in the parameters: the paper's cloud, and ours."""

    def fill(figure: Figure) -> None:
        polar, even = figure.subplots(1, 2)
        radius, along = np.linspace(0, 1, 13), np.linspace(-1, 1, 13)
        ones = np.ones_like(along)
        border = np.stack([np.concatenate([along, ones, -along, -ones]), np.concatenate([-ones, along, ones, -along])])
        polar.plot(*(np.multiply.outer(axis, radius).ravel() for axis in border), ".", color=_LINE, markersize=2)
        polar.set_title("a) the paper's: even rays and rings")
        samples = gauss_points(FitSettings().knot_vector(), 4)[0]
        u, v = np.meshgrid(samples, samples)
        even.plot(u.ravel(), v.ravel(), ".", color=_LINE, markersize=2)
        even.set_title("b) ours: Gauss points, 4 a span")
        for axes in (polar, even):
            axes.set(aspect="equal", xlabel="ξ₀", ylabel="ξ₁", xlim=(-1.05, 1.05), ylim=(-1.05, 1.05))

    return plot("fig_05", fill, (7.2, 3.6))


def fig_06() -> Path:
    """The ten cubic basis functions on the paper's knots, eq. (14), and on ours."""

    def fill(figure: Figure) -> None:
        along = np.linspace(-1, 1, 401)
        subjects = (("a) knots of eq. (14)", FitSettings.paper()), ("b) ours: evenly spaced", FitSettings()))
        for axes, (title, settings) in zip(figure.subplots(1, 2, sharey=True), subjects, strict=True):
            knots = settings.knot_vector()
            axes.plot(along, basis(knots, DEGREE, along), linewidth=1)
            axes.plot(knots, np.zeros_like(knots), "|", color=_LINE, markersize=9)
            axes.set(title=title, xlabel="ξ")
        figure.axes[0].set_ylabel("N(ξ)")

    return plot("fig_06", fill, (7.2, 2.8))


def fig_07() -> Path:
    """The paper's weights."""

    def fill(figure: Figure) -> None:
        axes = figure.subplots()
        weights = FitSettings.paper().weight_net()
        axes.imshow(weights, cmap="YlOrBr", vmin=0, vmax=3)
        names = {0.25: "1/4", 0.75: "3/4", 1.0: "1", 1.5: "3/2"}
        for (i, j), weight in np.ndenumerate(weights):
            axes.text(j, i, names[float(weight)], ha="center", va="center", color=_LINE)
        axes.set(xticks=range(10), yticks=range(10), xticklabels=range(1, 11), yticklabels=range(1, 11))

    return plot("fig_07", fill, (3.6, 3.6))


def _xy(number: complex) -> tuple[float, float]:
    return number.real, number.imag


def _cross(axes: Axes) -> None:
    for line in (axes.axhline, axes.axvline):
        line(0, color=_LINE, linewidth=0.5)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)

"""Figs. 3, 4, 8 and 19: the fundamental and semi-fundamental patch, their meshes, and the level set beside them."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
from drawing import ABOVE, GREY, SIX, Floats, Sheet, View, draw, sheet_of, surface_sheet
from level_set import level_set_sheet
from plane import RAYS, RINGS, polar_grid

from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.patch import polar
from gyroid_cad.surface.symmetry import QUARTER
from gyroid_cad.surface.weierstrass import points

# Elements along a patch's sides, as in the paper.
STEPS = 20
# Of the patch's centre in its bounding cell, eq. (6).
_CENTRE = np.array([1, 1 / 2, 1 / 4])


def fig_03() -> Path:
    """The fundamental patch, with the polar mesh of its domain."""
    patch = sheet_of(points(polar_grid()))
    return draw("fig_03", (View("a) along z", (patch,), ABOVE), View("b) aslant", (patch,))), (1000, 480))


def fig_04() -> Path:
    """Four of them are the semi-fundamental patch."""
    radius, along = np.linspace(0, 1, RINGS + 1)[:, np.newaxis], np.linspace(-1, 1, RAYS + 1)
    ones = np.ones_like(along)
    square = ((along, -ones), (ones, along), (-along, ones), (-ones, -along))
    # Of an edge of the square and the middle: one fundamental patch each.
    sheets = tuple(
        sheet_of(polar(radius * u, radius * v)[0] + _CENTRE, colour)
        for (u, v), colour in zip(square, SIX, strict=False)
    )
    return draw("fig_04", (View("a) along z", sheets, ABOVE), View("b) aslant", sheets)), (1000, 480))


def fig_08() -> Path:
    """The fitted patch on a grid of its parameters: ours, and by the paper's own settings."""
    ours, paper = (
        surface_sheet(fit_patch(settings).surface, STEPS) for settings in (FitSettings(), FitSettings.paper())
    )
    views = (
        View("a) ours, along z", (ours,), ABOVE),
        View("b) ours, aslant", (ours,)),
        View("c) the paper's settings, along z", (paper,), ABOVE),
    )
    return draw("fig_08", views, (1350, 480))


def fig_19() -> Path:
    """Patch and cell by the Weierstrass map, and pieces of the level set from -pi/2 to pi/2 and -pi to pi."""
    views = (
        View("a) SFP", (surface_sheet(fit_patch().surface, STEPS),)),
        View("b) level set, from -pi/2 to pi/2", (level_set_sheet(pi / 2),)),
        View("c) cubic cell of SFPs", cell_sheets()),
        View("d) level set, from -pi to pi", (level_set_sheet(pi),)),
    )
    return draw("fig_19", views, (1500, 460))


def cell_sheets(steps: int = STEPS, colours: Floats | None = None) -> tuple[Sheet, ...]:
    """The 24 patches of a cubic cell, as fitted."""
    surface, cell = fit_patch().surface, USUAL.cell
    placed = zip(cell.matrices, cell.translations * QUARTER, cell.bounding_cell, strict=True)
    return tuple(
        surface_sheet(surface.transformed(matrix, shift), steps, GREY if colours is None else colours[part])
        for matrix, shift, part in placed
    )

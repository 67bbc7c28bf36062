"""Figs. 9 to 13: bounding cell, cubic cell, and the lattice of 4 x 3 x 2, as surface and as volume."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from drawing import ABOVE, GREEN, RED, SIX, YELLOW, Integers, Sheet, View, draw, marked, skin, surface_sheet
from numpy.typing import NDArray
from patches import STEPS, cell_sheets

from gyroid_cad import Lattice
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh, hexahedra
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.surface.symmetry import QUARTER, bounding_cell
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import build_wall

# The paper's example, in bounding-cell lengths; it does not say how thick the wall is.
CELLS, CELL_SIZE, THICKNESS = (4, 3, 2), 2.0, 0.2


def fig_09() -> Path:
    """Six semi-fundamental patches are a bounding cell."""
    surface, placed = fit_patch().surface, bounding_cell(USUAL.patch)
    sheets = tuple(
        surface_sheet(surface.transformed(matrix, shift), STEPS // 2, colour)
        for matrix, shift, colour in zip(placed.matrices, placed.translations * QUARTER, SIX, strict=True)
    )
    return draw("fig_09", (View("a) along z", sheets, ABOVE), View("b) aslant", sheets)), (1000, 500))


def fig_10() -> Path:
    """Four bounding cells are a cubic cell."""
    sheets = cell_sheets(STEPS // 2, np.array(SIX))
    return draw("fig_10", (View("a) along z", sheets, ABOVE), View("b) aslant", sheets)), (1000, 500))


def fig_11() -> Path:
    """The whole mid-surface: 230,400 quadrilaterals."""
    mesh = Lattice(CELLS, CELL_SIZE, THICKNESS).quadrilaterals(STEPS)
    return draw("fig_11", (View(f"{len(mesh.cells):,} quadrilaterals", (skin(mesh, marked(mesh), 0.2),)),), (1200, 800))


def fig_12() -> Path:
    """A patch, a bounding cell and a cubic cell as volumes."""
    views = (
        View("a) SFP", (_volume(lambda placement, cell: placement == 0, YELLOW),)),
        View("b) BC", (_volume(lambda placement, cell: USUAL.cell.bounding_cell[placement] == 0, RED),)),
        View("c) CC", (_volume(lambda placement, cell: placement >= 0, GREEN),)),
    )
    return draw("fig_12", views, (1350, 480))


def fig_13() -> Path:
    """The whole volume: 230,400 hexahedra."""
    mesh = lattice_mesh()
    return draw("fig_13", (View(f"{len(mesh.cells):,} hexahedra", (skin(mesh, marked(mesh), 0.2),)),), (1200, 800))


def lattice_mesh() -> Mesh:
    """The paper's example as hexahedra."""
    return Lattice(CELLS, CELL_SIZE, THICKNESS).hexahedra(STEPS)


def _volume(wanted: Callable[[Integers, Integers], NDArray[np.bool_]], colour: tuple[float, float, float]) -> Sheet:
    """The wall of some of a cell's patches."""
    wall = build_wall(build_complex((1, 1, 1), wanted=wanted), fit_patch(), CELL_SIZE, THICKNESS)
    return skin(hexahedra(wall, STEPS // 2, 2), colour)

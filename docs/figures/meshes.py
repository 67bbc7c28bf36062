"""Figs. 14 to 18: the mesh for analysis and its quality, and the three specimens as meshes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from cells import CELL_SIZE, THICKNESS
from drawing import Sheet, View, draw, plot, skin
from matplotlib.figure import Figure
from patches import STEPS

from gyroid_cad import Lattice
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh
from gyroid_cad.mesh.finite_elements.quality import element_measures

_LAYERS = 3
# From a scaled Jacobian of 0.75 to 1.
_LOW, _BAD, _GOOD = 0.75, np.array([0.96, 0.82, 0.45]), np.array([0.24, 0.56, 0.56])
_SPECIMEN_STEPS = 8
# Of the cell's four bounding cells, the one in detail.
_SHOWN = 3
THICKNESS_FACTOR = "0.08 + 0.05*x + 0.02*y"


def fig_14() -> Path:
    """One cell of the mesh that goes to an analysis program."""
    mesh = _cell()
    view = View(f"{len(mesh.cells):,} hexahedra in {_LAYERS} layers", (skin(mesh, line_opacity=0.7),))
    return draw("fig_14", (view,), (900, 760))


def fig_15() -> Path:
    """Part of it, coloured by the scaled Jacobian: from yellow, 0.75, to blue, 1."""
    mesh = _cell()
    jacobian = element_measures(mesh.points, mesh.cells)["scaled_jacobian"]
    elements = np.concatenate([surface.elements for surface in mesh.surfaces().values()])
    part = np.clip((jacobian[elements] - _LOW) / (1 - _LOW), 0, 1)[:, np.newaxis]
    bounding_cell = mesh.complex.placements.bounding_cell[mesh.complex.patch_placement[mesh.element_patch[elements]]]
    near = bounding_cell == _SHOWN
    used, cells = np.unique(skin(mesh).cells[near], return_inverse=True)
    detail = Sheet(mesh.points[used], cells.reshape(-1, 4), (_BAD + part * (_GOOD - _BAD))[near], 0.8)
    text = f"scaled Jacobian from {jacobian.min():.3f} (yellow) to {jacobian.max():.3f} (blue)"
    return draw("fig_15", (View(text, (detail,)),), (900, 760))


def fig_15_histogram() -> Path:
    """The scaled Jacobians of all elements."""
    mesh = _cell()
    jacobian = element_measures(mesh.points, mesh.cells)["scaled_jacobian"]

    def fill(figure: Figure) -> None:
        axes = figure.subplots()
        axes.hist(jacobian, bins=50, color="#deae52")
        axes.set(xlabel="scaled Jacobian", ylabel="elements", xlim=(_LOW, 1))
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)

    return plot("fig_15_histogram", fill, (4.6, 2.4))


def fig_16() -> Path:
    """The wall varies."""
    return _specimen("fig_16", Lattice.paper((3, 3, 1), THICKNESS_FACTOR))


def fig_17() -> Path:
    """The bounding cells' length varies."""
    return _specimen("fig_17", Lattice.paper((3, 3, 1), 0.08, "1 + 0.3*x + 0.08*y"))


def fig_18() -> Path:
    """Both vary."""
    return _specimen("fig_18", Lattice.paper((3, 3, 2), THICKNESS_FACTOR, "1 + 0.05*x + 0.08*y"))


def _specimen(name: str, lattice: Lattice) -> Path:
    mesh = lattice.hexahedra(_SPECIMEN_STEPS)
    text = f"{len(mesh.cells):,} hexahedra; x to the right, y to the back"
    return draw(name, (View(text, (skin(mesh, line_opacity=0.5),), (0.6, -2.2, 2.6)),), (1100, 700))


def _cell() -> Mesh:
    return Lattice((1, 1, 1), CELL_SIZE, THICKNESS).hexahedra(STEPS // 2, _LAYERS)

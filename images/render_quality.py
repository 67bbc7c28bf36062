"""Render how good the meshes are: histograms of a lattice's hexahedra, and the paper's mesh of a patch beside ours.

Run from the repository's root: ``python images/render_quality.py``. It prints the tables that belong to the pictures.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sheet import FOLDER, Sheet, Vector, beside, mixed

from gyroid_cad import Lattice
from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.common.tables import text_table
from gyroid_cad.mesh.finite_elements.quality import (
    Quality,
    element_measures,
    quality_report,
    shown_name,
    shown_number,
)
from gyroid_cad.mesh.finite_elements.summaries import draw_quality
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_grids
from gyroid_cad.surface.patch import PARAMETERISATIONS

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Mesh = tuple[Floats, Integers]

# Steps along each side of a patch.
STEPS = 20
LAYERS = 3
LATTICE = Lattice(cells=(2, 2, 2), cell_size=10, thickness=1)

_SIZE, _CAPTION_HEIGHT, _BAR_ROOM, _BAR_HEIGHT = (1300, 560), 60, 200, 330
_CAMERA: Vector = (-0.1, -0.4, 1.0)
_GAP = 0.06
_BAD_TO_GOOD: tuple[Vector, ...] = ((0.76, 0.20, 0.16), (0.97, 0.84, 0.50), (0.30, 0.62, 0.62))


def main() -> list[Path]:
    """Draw both pictures and print both tables."""
    report = mesh_quality(LATTICE.hexahedra(STEPS, LAYERS))
    print(f"{report.elements:,} hexahedra, {STEPS} x {STEPS} a patch in {LAYERS} layers, thickness 0.1 L")
    print(report)
    meshes = {
        "the paper's, polar (Fig. 4)": polar_mesh(),
        "the paper's parameters on a grid": grid_mesh("polar"),
        "ours": grid_mesh("smooth"),
    }
    _print_comparison({name: quality_report(*mesh) for name, mesh in meshes.items()})
    beside = render_beside({name: meshes[name] for name in ("the paper's, polar (Fig. 4)", "ours")})
    return [draw_quality(report, FOLDER / "mesh_quality.png"), beside]


def grid_mesh(parameterisation: str) -> Mesh:
    """The patch by an even grid of parameters."""
    along = np.linspace(-1, 1, STEPS + 1)
    return _quadrilaterals(PARAMETERISATIONS[parameterisation](along[:, np.newaxis], along)[0])


def polar_mesh() -> Mesh:
    """The patch as the paper's Figs. 3 and 4 mesh it: even rays and rings round its centre, as many quadrilaterals.

    Those round the centre have an edge of no length.
    """
    along = np.linspace(-1, 1, STEPS // 2 + 1)[:-1]
    ones = np.ones_like(along)
    u, v = np.concatenate([[along, -ones], [ones, along], [-along, ones], [-ones, -along]], axis=1)
    radius = np.linspace(0, 1, STEPS**2 // len(u) + 1)
    round_and_back = np.append(np.arange(len(u)), 0)
    points = PARAMETERISATIONS["polar"](
        u[round_and_back] * radius[:, np.newaxis], v[round_and_back] * radius[:, np.newaxis]
    )[0]
    return _quadrilaterals(points)


def _quadrilaterals(points: Floats) -> Mesh:
    """Of a grid of points, shape (a, b, 3)."""
    numbers = np.arange(points[..., 0].size).reshape(points.shape[:2])
    cells = [numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]]
    return points.reshape(-1, 3), np.stack([cell.ravel() for cell in cells], axis=1)


def _print_comparison(reports: dict[str, Quality]) -> None:
    shown = ("scaled_jacobian", "edge_ratio", "skew", "min_angle", "max_angle")
    rows = []
    for name, report in reports.items():
        measures = [report.measures[measure] for measure in shown]
        numbers = (
            " / ".join(map(shown_number, (summary.smallest, summary.mean, summary.largest))) for summary in measures
        )
        rows.append((name, f"{report.elements}", *numbers))
    print("one patch: smallest / mean / largest")
    print(text_table(rows, ("mesh", "elements", *(shown_name(name) for name in shown))))


def render_beside(meshes: dict[str, Mesh]) -> Path:
    """Draw quadrilaterals of a patch side by side, coloured by their scaled Jacobian."""
    groups = beside([[_coloured(*mesh)] for mesh in meshes.values()], _CAMERA, _GAP)
    sheet, size = Sheet(_SIZE), (_SIZE[0] - _BAR_ROOM, _SIZE[1] - _CAPTION_HEIGHT)
    sheet.put(draw([one for group in groups for one in group], size, _CAMERA))
    sheet.caption(groups, list(meshes), size, _CAMERA)
    bar = (_SIZE[0] - _BAR_ROOM + 30, (_SIZE[1] - _BAR_HEIGHT) // 2, _BAR_HEIGHT)
    sheet.put_bar(mixed(_BAD_TO_GOOD, np.linspace(0, 1, 256)), 1.0, "scaled Jacobian", *bar)
    return sheet.save("polar_and_smooth_mesh", many_colours=True)


def _coloured(points: Floats, cells: Integers) -> Facets:
    """Quadrilaterals as faces with dark lines round them, in one light."""
    corners = points[cells[:, [0, 1, 3, 2]]].reshape(-1, 2, 2, 3)
    colours = mixed(_BAD_TO_GOOD, element_measures(points, cells)["scaled_jacobian"])
    everywhere = np.broadcast_to(colours[:, np.newaxis, np.newaxis], corners.shape)
    facets = facets_of_grids(corners, np.broadcast_to(_CAMERA, corners.shape), everywhere)
    return replace(facets, surfaces=facets.faces)


if __name__ == "__main__":
    print(*main(), sep="\n")

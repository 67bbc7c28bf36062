"""Render how good the meshes are: histograms of a lattice's hexahedra, and the paper's mesh of a patch beside ours.

Run from the repository's root: ``python images/render_quality.py``. It prints the tables that belong to the pictures.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import vtk
from numpy.typing import NDArray
from render import FOLDER, LINE_COLOUR, write_picture
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

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
from gyroid_cad.surface.patch import PARAMETERISATIONS

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Mesh = tuple[Floats, Integers]

# Steps along each side of a patch.
STEPS = 20
LAYERS = 3
LATTICE = Lattice(cells=(2, 2, 2), cell_size=10, thickness=1)

_SIZE = (1300, 600)
_CAMERA = (-0.1, -0.4, 1.0)
# Of the meshes' middles, in cells; and of the largest letters, in pixels.
_APART, _LETTERS = 0.51, 22
# Half the height of what is seen, in cells, and how far its middle lies right of and below the meshes', to leave room
# for the bar and the captions.
_HALF_HEIGHT, _ASIDE, _BELOW = 0.57, 0.14, 0.1
_BAD_COLOUR, _MIDDLE_COLOUR, _GOOD_COLOUR = (0.72, 0.16, 0.12), (0.96, 0.82, 0.45), (0.24, 0.56, 0.56)


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
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    towards = np.array(_CAMERA) / np.linalg.norm(_CAMERA)
    right = np.cross((0, 0, 1), towards)
    right /= np.linalg.norm(right)
    colours = _colours()
    for index, (name, (points, cells)) in enumerate(meshes.items()):
        offset = (2 * index - len(meshes) + 1) * _APART
        renderer.AddActor(_coloured(points + offset * right, cells, colours))
        across = 0.5 + (offset - _ASIDE) / (2 * _HALF_HEIGHT) * _SIZE[1] / _SIZE[0]
        renderer.AddActor(_caption(name, across))
    renderer.AddActor(_colour_bar(colours))
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.ParallelProjectionOn()
    camera.SetParallelScale(_HALF_HEIGHT)
    focus = _ASIDE * right - _BELOW * np.cross(towards, right)
    camera.SetFocalPoint(*focus.tolist())
    camera.SetPosition(*(focus + towards).tolist())
    renderer.ResetCameraClippingRange()
    target = FOLDER / "polar_and_smooth_mesh.png"
    write_picture(renderer, _SIZE, target)
    return target


def _coloured(points: Floats, cells: Integers, colours: vtk.vtkColorTransferFunction) -> vtk.vtkActor:
    held, polygons, mesh = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    held.SetData(numpy_to_vtk(points, deep=True))
    polygons.SetData(4, numpy_to_vtkIdTypeArray(cells.ravel(), deep=True))
    mesh.SetPoints(held)
    mesh.SetPolys(polygons)
    mesh.GetCellData().SetScalars(numpy_to_vtk(element_measures(points, cells)["scaled_jacobian"], deep=True))
    mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
    mapper.SetInputData(mesh)
    mapper.SetLookupTable(colours)
    actor.SetMapper(mapper)
    actor.GetProperty().EdgeVisibilityOn()
    actor.GetProperty().SetEdgeColor(*LINE_COLOUR)
    actor.GetProperty().SetLineWidth(1.2)
    actor.GetProperty().LightingOff()
    return actor


def _colours() -> vtk.vtkColorTransferFunction:
    colours = vtk.vtkColorTransferFunction()
    for value, colour in ((0, _BAD_COLOUR), (0.5, _MIDDLE_COLOUR), (1, _GOOD_COLOUR)):
        colours.AddRGBPoint(value, *colour)
    return colours


def _caption(text: str, across: float) -> vtk.vtkTextActor:
    actor = vtk.vtkTextActor()
    actor.SetInput(text)
    actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    actor.SetPosition(across, 0.03)
    letters = actor.GetTextProperty()
    letters.SetJustificationToCentered()
    _style(letters, _LETTERS)
    return actor


def _colour_bar(colours: vtk.vtkColorTransferFunction) -> vtk.vtkScalarBarActor:
    bar = vtk.vtkScalarBarActor()
    bar.SetLookupTable(colours)
    bar.SetTitle("scaled Jacobian\n")
    bar.SetNumberOfLabels(5)
    bar.SetLabelFormat("{:.2f}")
    bar.UnconstrainedFontSizeOn()
    bar.SetPosition(0.9, 0.2)
    bar.SetWidth(0.06)
    bar.SetHeight(0.6)
    _style(bar.GetTitleTextProperty(), _LETTERS - 4)
    _style(bar.GetLabelTextProperty(), _LETTERS - 4)
    return bar


def _style(letters: vtk.vtkTextProperty, size: int) -> None:
    letters.SetFontSize(size)
    letters.SetColor(*LINE_COLOUR)
    letters.BoldOff()
    letters.ItalicOff()
    letters.ShadowOff()


if __name__ == "__main__":
    print(*main(), sep="\n")

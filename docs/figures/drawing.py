"""What the figures are drawn with: views of quadrilaterals side by side, off-screen through VTK, and plots."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import vtk
from matplotlib import rc_context
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray, vtk_to_numpy

from gyroid_cad.mesh.finite_elements.hexahedra import Mesh
from gyroid_cad.nurbs.surface import NurbsSurface

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Vector = tuple[float, float, float]

FOLDER = Path(__file__).parents[1] / "images"
# The paper's colours of a semi-fundamental patch, a bounding cell and a cubic cell, and of the rest.
YELLOW, RED, GREEN, GREY = (0.98, 0.82, 0.20), (0.85, 0.25, 0.20), (0.35, 0.68, 0.38), (0.92, 0.92, 0.90)
WALL, INK = (0.87, 0.68, 0.32), (0.18, 0.16, 0.13)
SIX = (YELLOW, RED, GREEN, (0.25, 0.45, 0.70), (0.60, 0.40, 0.65), (0.90, 0.55, 0.30))
# Directions to the viewer: from above, and from before, a little to the right and above.
ABOVE, ASLANT = (0.0, 0.0, 1.0), (1.6, -3.0, 1.9)

_MARGIN, _LETTERS, _CAPTION_HEIGHT = 1.06, 17, 0.09
# A PNG with a palette of so many colours is a third as large, and looks the same.
_PALETTE = 192
# Cosine of the angle at which a patch is still seen well.
_FACING = 0.6


@dataclass(frozen=True, slots=True)
class Sheet:
    """Quadrilaterals, and how they are drawn.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
    cells : ndarray of int, shape (m, 4)
    colours : ndarray or tuple, shape (3,) or (m, 3)
        Red, green and blue, 0 to 1.
    line_opacity : float
        Of the quadrilaterals' sides, 0 to 1: less where they are many.
    """

    points: Floats
    cells: Integers
    colours: Floats | Vector = WALL
    line_opacity: float = 1.0


@dataclass(frozen=True, slots=True)
class View:
    """Sheets seen from one side, without perspective, with a line of text below."""

    caption: str
    sheets: tuple[Sheet, ...]
    towards: Vector = ASLANT


def grid_cells(rows: int, columns: int) -> Integers:
    """Quadrilaterals on a grid of points in rows; shape ((rows - 1) (columns - 1), 4)."""
    numbers = np.arange(rows * columns).reshape(rows, columns)
    corners = (numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:])
    return np.stack([corner.ravel() for corner in corners], axis=1)


def sheet_of(points: Floats, colours: Floats | Vector = WALL, line_opacity: float = 1.0) -> Sheet:
    """A sheet of a grid of points, shape (a, b, 3)."""
    return Sheet(points.reshape(-1, 3), grid_cells(*points.shape[:2]), colours, line_opacity)


def surface_sheet(surface: NurbsSurface, steps: int, colours: Floats | Vector = WALL) -> Sheet:
    """A NURBS surface on [-1, 1]^2 as steps x steps quadrilaterals, even in its parameters."""
    along = np.linspace(-1, 1, steps + 1)
    return sheet_of(surface.evaluate(along[:, np.newaxis], along), colours)


def skin(mesh: Mesh, patch_colours: Floats | Vector = WALL, line_opacity: float = 1.0) -> Sheet:
    """The outside of a mesh of linear hexahedra, or all of one of quadrilaterals; colours by patch, or one."""
    faces = list(mesh.surfaces().values())
    if faces:
        cells = np.concatenate([mesh.surface_nodes(face) for face in faces])
        elements = np.concatenate([face.elements for face in faces])
    else:
        cells, elements = mesh.cells, np.arange(len(mesh.cells))
    colours = np.asarray(patch_colours)
    return Sheet(
        mesh.points, cells, colours if colours.ndim == 1 else colours[mesh.element_patch[elements]], line_opacity
    )


def marked(mesh: Mesh) -> Floats:
    """The paper's colours: one patch yellow, its bounding cell red, its cubic cell green, the rest grey."""
    complex = mesh.complex
    part = complex.placements.bounding_cell[complex.patch_placement]
    # The cell in front, at the right and on top, where it is seen; of it the foremost patch that faces the viewer.
    front = (complex.patch_cell == [complex.cells[0] - 1, 0, complex.cells[2] - 1]).all(axis=1)
    corners = complex.corner_quarters[complex.patch_corners]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    towards = np.array(ASLANT) / np.linalg.norm(ASLANT)
    facing = np.abs(normals @ towards) / np.linalg.norm(normals, axis=1) > _FACING
    patch = int(np.argmax(np.where(front & facing, corners.mean(axis=1) @ towards, -np.inf)))
    colours = np.tile(GREY, (complex.patch_count, 1))
    colours[front] = GREEN
    colours[front & (part == part[patch])] = RED
    colours[patch] = YELLOW
    return colours


def draw(name: str, views: Iterable[View], size: tuple[int, int]) -> Path:
    """Draw views from left to right into a PNG file, each as large as its part of the picture lets it be."""
    views = list(views)
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    for index, view in enumerate(views):
        left, right = index / len(views), (index + 1) / len(views)
        below = _renderer((left, 0, right, _CAPTION_HEIGHT))
        below.AddViewProp(_caption(view.caption))
        renderer = _renderer((left, _CAPTION_HEIGHT, right, 1))
        for sheet in view.sheets:
            renderer.AddActor(_actor(sheet))
        _place_camera(renderer, view, (size[0] / len(views), size[1] * (1 - _CAPTION_HEIGHT)))
        window.AddRenderer(renderer)
        window.AddRenderer(below)
    window.Render()
    grab = vtk.vtkWindowToImageFilter()
    grab.SetInput(window)
    grab.ReadFrontBufferOff()
    grab.Update()
    image = grab.GetOutput()
    width, height, _ = image.GetDimensions()
    pixels = vtk_to_numpy(image.GetPointData().GetScalars()).reshape(height, width, 3)[::-1]
    target = FOLDER / f"{name}.png"
    Image.fromarray(np.ascontiguousarray(pixels)).quantize(_PALETTE, Image.Quantize.MAXCOVERAGE).save(
        target, optimize=True
    )
    return target


def plot(name: str, fill: Callable[[Figure], None], size: tuple[float, float]) -> Path:
    """Draw with matplotlib into an SVG file, the same each time; size in inches."""
    settings = {"svg.hashsalt": name, "svg.fonttype": "path", "font.size": 9, "axes.titlesize": 9}
    with rc_context(settings):
        figure = Figure(figsize=size, layout="constrained")
        fill(figure)
        target = FOLDER / f"{name}.svg"
        figure.savefig(target, metadata={"Date": None, "Creator": None})
    return target


def _renderer(viewport: tuple[float, float, float, float]) -> vtk.vtkRenderer:
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    renderer.SetViewport(*viewport)
    return renderer


def _caption(text: str) -> vtk.vtkTextActor:
    actor = vtk.vtkTextActor()
    actor.SetInput(text)
    actor.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
    actor.SetPosition(0.5, 0.3)
    letters = actor.GetTextProperty()
    letters.SetFontSize(_LETTERS)
    letters.SetColor(*INK)
    letters.SetJustificationToCentered()
    return actor


def _actor(sheet: Sheet) -> vtk.vtkActor:
    points, polygons, data = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(sheet.points), deep=True))
    corners = np.ascontiguousarray(sheet.cells, dtype=np.int64)
    polygons.SetData(corners.shape[1], numpy_to_vtkIdTypeArray(corners.ravel(), deep=True))
    data.SetPoints(points)
    data.SetPolys(polygons)
    colours = np.broadcast_to(np.asarray(sheet.colours), (len(corners), 3))
    data.GetCellData().SetScalars(numpy_to_vtk(np.ascontiguousarray(255 * colours).astype(np.uint8), deep=True))
    smooth = vtk.vtkPolyDataNormals()
    smooth.SetInputData(data)
    smooth.SetFeatureAngle(50)
    smooth.ConsistencyOff()
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(smooth.GetOutputPort())
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetAmbient(0.25)
    look.SetDiffuse(0.75)
    look.EdgeVisibilityOn()
    look.SetEdgeColor(*INK)
    look.SetEdgeOpacity(sheet.line_opacity)
    return actor


def _place_camera(renderer: vtk.vtkRenderer, view: View, size: tuple[float, float]) -> None:
    towards = np.array(view.towards) / np.linalg.norm(view.towards)
    up = np.array([0.0, 1.0, 0.0]) if abs(towards[2]) > 0.99 else np.array([0.0, 0.0, 1.0])
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(towards, right), towards])
    seen = np.concatenate([sheet.points for sheet in view.sheets]) @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    focus, (width, height, depth) = (low + high) / 2 @ axes, high - low
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(*focus)
    camera.SetPosition(*(focus + (depth + 1) * towards))
    camera.SetViewUp(*up)
    camera.SetParallelScale(max(height, width * size[1] / size[0]) / 2 * _MARGIN)
    renderer.ResetCameraClippingRange()

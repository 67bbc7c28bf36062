"""Render solved fields, off-screen through VTK, which CadQuery brings.

Run from the repository's root after ``examples/isogeometric_heat.py`` has left its files somewhere:
``python images/render_solutions.py FOLDER``. Fields are evaluated on the NURBS patches they were solved on.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
import vtk
from numpy.typing import NDArray
from render import FOLDER, LINE_COLOUR, write_picture
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from gyroid_cad.nurbs.volume import NurbsVolume

Floats = NDArray[np.float64]
Colours = tuple[tuple[float, float, float], ...]

SIZE = (1400, 612)
_CAMERA = (3, -4, 1.9)
# From the middle of one lattice to the other's, in cells.
_APART = 3.55
# How much of the lattices' height the picture shows, in cells.
_HEIGHT = 3.4
# Points along each side of a patch, and across the wall.
_FINENESS, _FINENESS_ACROSS = 25, 4
# The solved cell is repeated so often along each axis, as the solution is.
CELLS = 2
_COLD_TO_HOT: Colours = ((0.13, 0.29, 0.58), (0.93, 0.93, 0.88), (0.75, 0.16, 0.14))
LITTLE_TO_MUCH: Colours = ((0.20, 0.12, 0.30), (0.76, 0.29, 0.32), (0.99, 0.88, 0.60))
_ISOTHERMS, SHADES = 24, 256


@dataclass(frozen=True, slots=True)
class _Face:
    """A face on a grid: points and unit normals (a, b, 3), temperature and heat flux (a, b)."""

    points: Floats
    normals: Floats
    temperature: Floats
    flux: Floats


def main(folder: str) -> Path:
    """Draw temperature, left, and heat flux, right, of one kelvin a cell from top to bottom."""
    with np.load(Path(folder) / "isogeometric_heat.npz") as found:
        volumes = dict(found)
    temperature_at_points = np.load(Path(folder) / "temperature.npy")
    # The corners of the patches stand a cell and a half apart.
    corners = volumes["patch_points"][:, [0, 0, -1, -1], [0, -1, 0, -1]][..., [0, -1]]
    cell_size = float(np.ptp(volumes["control_points"][corners].mean(axis=-2)[..., 2])) / 1.5
    faces = _sampled(volumes, temperature_at_points, cell_size)
    right = np.cross((0, 0, 1), _CAMERA) / np.hypot(*_CAMERA[:2])
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    temperature = lookup_table(_COLD_TO_HOT, (0, CELLS), _ISOTHERMS)
    flux = lookup_table(LITTLE_TO_MUCH, (0, max(float(face.flux.max()) for face in faces)), SHADES)
    for place in product(range(CELLS), repeat=3):
        moved = cell_size * np.array(place, dtype=float)
        for values, table, side in (("temperature", temperature, -0.5), ("flux", flux, 0.5)):
            rise = place[2] if values == "temperature" else 0
            for actor in (_surface(faces, values, rise, table), _outlines(faces)):
                actor.SetPosition(*(moved + side * _APART * cell_size * right).tolist())
                renderer.AddActor(actor)
    for table, title, left in ((temperature, "K", 0.015), (flux, "K per cell", 0.945)):
        renderer.AddViewProp(legend(table, title, left))
    place_camera(renderer, cell_size)
    target = FOLDER / "isogeometric_heat.png"
    write_picture(renderer, SIZE, target)
    return target


def _sampled(volumes: dict[str, Floats], temperature: Floats, cell_size: float) -> list[_Face]:
    """All faces on the boundary of the wall; the flux in kelvins a cell, for a material of conductivity 1."""
    knots = (volumes["knots"], volumes["knots"], volumes["knots_across"])
    along, across = np.linspace(-1, 1, _FINENESS), np.linspace(0, 1, _FINENESS_ACROSS)
    faces = []
    for patch, face, _ in volumes["boundary"].tolist():
        numbers = volumes["patch_points"][patch]
        space = NurbsVolume(volumes["control_points"][numbers], volumes["weights"], *knots)
        # Three temperatures, for heat along x, y and z: a map from the same parameters.
        heat = NurbsVolume(temperature[numbers], volumes["weights"], *knots)
        axis, end = divmod(face, 2)
        parameters = [along, along, across]
        parameters[axis] = parameters[axis][[-end]]
        u, v, w = parameters
        grid = (u[:, np.newaxis, np.newaxis], v[:, np.newaxis], w)
        inverse = np.linalg.inv(space.jacobian(*grid))
        gradient = np.einsum("...j,...jk->...k", heat.jacobian(*grid)[..., 2, :], inverse)
        outward = inverse[..., axis, :] * (2 * end - 1)
        outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
        lengths = np.linalg.norm(gradient, axis=-1) * cell_size
        fields = (space.evaluate(*grid), outward, heat.evaluate(*grid)[..., 2], lengths)
        faces.append(_Face(*(np.squeeze(field, axis=axis) for field in fields)))
    return faces


def _surface(faces: list[_Face], values: str, rise: float, table: vtk.vtkLookupTable) -> vtk.vtkActor:
    squares, first = [], 0
    for face in faces:
        index = first + np.arange(face.temperature.size).reshape(face.temperature.shape)
        corners = (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
        sides = (face.points[1, 0] - face.points[0, 0], face.points[0, 1] - face.points[0, 0])
        if np.cross(*sides) @ face.normals[0, 0] < 0:
            corners = corners[::-1]
        squares.append(np.stack(corners, axis=-1).reshape(-1, 4))
        first += face.temperature.size
    mesh = _poly_data(faces)
    mesh.SetPolys(_cells(squares))
    normals = np.concatenate([face.normals.reshape(-1, 3) for face in faces])
    mesh.GetPointData().SetNormals(numpy_to_vtk(normals, deep=True))
    scalars = np.concatenate([getattr(face, values).ravel() for face in faces]) + rise
    mesh.GetPointData().SetScalars(numpy_to_vtk(scalars, deep=True))
    mapper = _mapper(mesh)
    mapper.SetLookupTable(table)
    mapper.UseLookupTableScalarRangeOn()
    mapper.InterpolateScalarsBeforeMappingOn()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    actor.GetProperty().SetAmbient(0.2)
    actor.GetProperty().SetSpecular(0.15)
    return actor


def _outlines(faces: list[_Face]) -> vtk.vtkActor:
    lines, first = vtk.vtkCellArray(), 0
    for face in faces:
        index = first + np.arange(face.temperature.size).reshape(face.temperature.shape)
        for line in (index[0], index[-1], index[:, 0], index[:, -1]):
            lines.InsertNextCell(len(line))
            for point in line.tolist():
                lines.InsertCellPoint(point)
        first += face.temperature.size
    outlines = _poly_data(faces)
    outlines.SetLines(lines)
    actor = vtk.vtkActor()
    actor.SetMapper(_mapper(outlines))
    actor.GetProperty().SetColor(*LINE_COLOUR)
    actor.GetProperty().LightingOff()
    return actor


def _poly_data(faces: list[_Face]) -> vtk.vtkPolyData:
    points = vtk.vtkPoints()
    points.SetData(numpy_to_vtk(np.concatenate([face.points.reshape(-1, 3) for face in faces]), deep=True))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    return data


def _cells(squares: list[NDArray[np.int64]]) -> vtk.vtkCellArray:
    cells = vtk.vtkCellArray()
    cells.SetData(4, numpy_to_vtkIdTypeArray(np.concatenate(squares).ravel(), deep=True))
    return cells


def _mapper(data: vtk.vtkPolyData) -> vtk.vtkPolyDataMapper:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    return mapper


def lookup_table(colours: Colours, limits: tuple[float, float], count: int) -> vtk.vtkLookupTable:
    table = vtk.vtkLookupTable()
    table.SetNumberOfTableValues(count)
    table.SetRange(*limits)
    for index, place in enumerate(np.linspace(0, len(colours) - 1, count)):
        mixed = (np.interp(place, range(len(colours)), channel) for channel in zip(*colours, strict=True))
        table.SetTableValue(index, *mixed, 1.0)
    return table


def legend(table: vtk.vtkLookupTable, title: str, left: float) -> vtk.vtkScalarBarActor:
    legend = vtk.vtkScalarBarActor()
    legend.SetLookupTable(table)
    legend.SetTitle(title)
    legend.SetNumberOfLabels(3)
    legend.SetLabelFormat("%.1f")
    legend.SetMaximumNumberOfColors(SHADES)
    legend.SetPosition(left, 0.2)
    legend.SetWidth(0.04)
    legend.SetHeight(0.6)
    legend.UnconstrainedFontSizeOn()
    for text in (legend.GetTitleTextProperty(), legend.GetLabelTextProperty()):
        text.SetColor(*LINE_COLOUR)
        text.SetFontSize(15)
        text.BoldOff()
        text.ItalicOff()
        text.ShadowOff()
    return legend


def place_camera(renderer: vtk.vtkRenderer, cell_size: float) -> None:
    middle = CELLS * cell_size / 2
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.SetFocalPoint(middle, middle, middle)
    camera.SetPosition(*(middle + 10 * cell_size * np.array(_CAMERA)).tolist())
    camera.ParallelProjectionOn()
    camera.SetParallelScale(_HEIGHT * cell_size / 2)
    renderer.ResetCameraClippingRange()


if __name__ == "__main__":
    print(main(sys.argv[1]))

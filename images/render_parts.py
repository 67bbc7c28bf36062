"""Render filled parts: whole STEP files side by side, off-screen through VTK, which CadQuery brings.

Run from the repository's root after ``examples/light_bracket.py`` has left its files somewhere:
``python images/render_parts.py FOLDER``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq
import numpy as np
import vtk
from render import FOLDER, LINE_COLOUR, WALL_COLOUR, write_picture

_SIZE = (1500, 520)
_CAMERA = (1.5, -2.2, 1.5)
_PART_COLOUR = (0.72, 0.74, 0.78)
# Of the triangles, in mm and radians.
_DEVIATION, _ANGLE = 0.02, 0.2
_GAP = 0.1


def main(folder: str) -> Path:
    """Draw the bracket, what fills it, and both with a skin, from left to right."""
    names = ("bracket.step", "bracket_light.step", "bracket_with_skin.step")
    shapes = [cq.importers.importStep(str(Path(folder) / name)).val() for name in names]
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    towards = np.array(_CAMERA) / np.linalg.norm(_CAMERA)
    right = np.cross((0, 0, 1), towards)
    right /= np.linalg.norm(right)
    width = shapes[0].BoundingBox().DiagonalLength * (1 + _GAP)
    for index, shape in enumerate(shapes):
        data = shape.toVtkPolyData(_DEVIATION, _ANGLE, normals=True)
        for actor in (_faces(data, WALL_COLOUR if index else _PART_COLOUR), _edges(shape)):
            actor.SetPosition(*(index * width * right * 0.72).tolist())
            renderer.AddActor(actor)
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.SetPosition(*_CAMERA)
    camera.SetFocalPoint(0, 0, 0)
    camera.ParallelProjectionOn()
    renderer.ResetCamera()
    camera.Zoom(2.25)
    target = FOLDER / "light_bracket.png"
    write_picture(renderer, _SIZE, target)
    return target


def _faces(data: vtk.vtkPolyData, colour: tuple[float, float, float]) -> vtk.vtkActor:
    actor = _actor(data)
    actor.GetProperty().SetColor(*colour)
    actor.GetProperty().SetSpecular(0.25)
    actor.GetProperty().SetSpecularPower(25)
    return actor


def _edges(shape: cq.Shape) -> vtk.vtkActor:
    points, lines = vtk.vtkPoints(), vtk.vtkCellArray()
    for edge in shape.Edges():
        if edge.geomType() == "OTHER" or edge.Length() < _DEVIATION:
            continue
        places = [edge.positionAt(t).toTuple() for t in np.linspace(0, 1, 2 if edge.geomType() == "LINE" else 13)]
        lines.InsertNextCell(len(places))
        for place in places:
            lines.InsertCellPoint(points.InsertNextPoint(place))
    data = vtk.vtkPolyData()
    data.SetPoints(points)
    data.SetLines(lines)
    actor = _actor(data)
    actor.GetProperty().SetColor(*LINE_COLOUR)
    actor.GetProperty().LightingOff()
    return actor


def _actor(data: vtk.vtkPolyData) -> vtk.vtkActor:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputData(data)
    mapper.ScalarVisibilityOff()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    return actor


if __name__ == "__main__":
    print(main(sys.argv[1]))

"""Render the README's picture, off-screen through VTK, which CadQuery brings.

Run from the repository's root: ``python images/render.py``. Patches are drawn with their outlines: each is
one B-spline face of the solid.
"""

from __future__ import annotations

from pathlib import Path

import cadquery as cq
import vtk

from gyroid_cad import Lattice

PICTURE = Path(__file__).with_name("gyroid_2x2x2.png")
WALL_COLOUR, LINE_COLOUR = (0.87, 0.68, 0.32), (0.18, 0.16, 0.13)


def main(target: Path = PICTURE) -> Path:
    """Render 2 x 2 x 2 cells and write the picture.

    Parameters
    ----------
    target : Path

    Returns
    -------
    Path
    """
    lattice = Lattice(cells=(2, 2, 2), cell_size=10, thickness=0.8)
    shape = cq.Shape.cast(lattice.solid())
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    for actor in (_faces(shape), _outlines(shape)):
        renderer.AddActor(actor)
    _place_camera(renderer)
    _write(renderer, target)
    return target


def _faces(shape: cq.Shape) -> vtk.vtkActor:
    vertices, triangles = shape.tessellate(0.02, 0.2)
    points = vtk.vtkPoints()
    for vertex in vertices:
        points.InsertNextPoint(*vertex.toTuple())
    cells = vtk.vtkCellArray()
    for triangle in triangles:
        cells.InsertNextCell(3, triangle)
    mesh = vtk.vtkPolyData()
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    normals = vtk.vtkPolyDataNormals()
    normals.SetInputData(mesh)
    normals.SetFeatureAngle(40)
    actor = _actor(normals)
    actor.GetProperty().SetColor(*WALL_COLOUR)
    actor.GetProperty().SetSpecular(0.25)
    actor.GetProperty().SetSpecularPower(25)
    return actor


def _outlines(shape: cq.Shape) -> vtk.vtkActor:
    lines = vtk.vtkAppendPolyData()
    for edge in shape.Edges():
        points = vtk.vtkPoints()
        for position in edge.positions([i / 12 for i in range(13)]):
            points.InsertNextPoint(*position.toTuple())
        cells = vtk.vtkCellArray()
        cells.InsertNextCell(13, range(13))
        line = vtk.vtkPolyData()
        line.SetPoints(points)
        line.SetLines(cells)
        lines.AddInputData(line)
    actor = _actor(lines)
    actor.GetProperty().SetColor(*LINE_COLOUR)
    actor.GetProperty().SetLineWidth(1.6)
    return actor


def _actor(source: vtk.vtkAlgorithm) -> vtk.vtkActor:
    mapper = vtk.vtkPolyDataMapper()
    mapper.SetInputConnection(source.GetOutputPort())
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtk.vtkActor()
    actor.SetMapper(mapper)
    return actor


def _place_camera(renderer: vtk.vtkRenderer) -> None:
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.SetPosition(3, -4, 2.4)
    camera.SetFocalPoint(0, 0, 0)
    renderer.ResetCamera()
    camera.Zoom(1.25)


def _write(renderer: vtk.vtkRenderer, target: Path) -> None:
    window = vtk.vtkRenderWindow()
    window.SetOffScreenRendering(True)
    window.SetMultiSamples(8)
    window.SetSize(1100, 900)
    window.AddRenderer(renderer)
    window.Render()
    image = vtk.vtkWindowToImageFilter()
    image.SetInput(window)
    image.ReadFrontBufferOff()
    writer = vtk.vtkPNGWriter()
    writer.SetFileName(str(target))
    writer.SetInputConnection(image.GetOutputPort())
    writer.Write()


if __name__ == "__main__":
    print(main())

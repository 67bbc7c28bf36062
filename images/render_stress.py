"""Render the stress that CalculiX finds in a stretched gyroid, off-screen through VTK, which CadQuery brings.

Run from the repository's root: ``PYTHONPATH=. python images/render_stress.py``. It solves
``examples/stiffness_in_calculix.py`` anew.
"""

from __future__ import annotations

import re
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import vtk
from numpy.typing import NDArray
from render import FOLDER, LINE_COLOUR, write_picture
from render_solutions import CELLS, LITTLE_TO_MUCH, SHADES, legend, lookup_table, place_camera
from vtk.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray

from examples.stiffness_in_calculix import CELL_SIZE, DENSITY, STRAIN, stiffness
from gyroid_cad import Lattice, Mesh

Floats = NDArray[np.float64]

SUBDIVISIONS = 4
_SIZE = (860, 720)
# A stretch of a thousandth would not be seen.
_MAGNIFIED = 100


def main() -> Path:
    """Draw the von Mises stress on the stretched lattice, and how it stood before as lines."""
    with TemporaryDirectory() as folder:
        job = Path(folder) / "cell"
        stiffness(SUBDIVISIONS, job)
        mesh = Lattice((1, 1, 1), CELL_SIZE, density=DENSITY).hexahedra(SUBDIVISIONS, order=2)
        moved, stress = (nodal(job.with_suffix(".frd"), name, len(mesh.points)) for name in ("DISP", "STRESS"))
    x, y, z, xy, yz, xz = stress.T
    mises = np.sqrt(((x - y) ** 2 + (y - z) ** 2 + (z - x) ** 2) / 2 + 3 * (xy**2 + yz**2 + xz**2))
    colours = lookup_table(LITTLE_TO_MUCH, (0.0, float(mises.max())), SHADES)
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    step = CELL_SIZE * np.array([1 + _MAGNIFIED * STRAIN, 1, 1])
    for place in product(range(CELLS), repeat=3):
        for actor in _surface(mesh, mesh.points + _MAGNIFIED * moved, mises, colours):
            actor.SetPosition(*(step * place).tolist())
            renderer.AddActor(actor)
    renderer.AddViewProp(legend(colours, "MPa", 0.9))
    place_camera(renderer, CELL_SIZE)
    target = FOLDER / "stress_in_calculix.png"
    write_picture(renderer, _SIZE, target)
    return target


def nodal(path: Path, name: str, nodes: int) -> Floats:
    """A field at the nodes from CalculiX's result file; shape (nodes, components)."""
    block = re.search(rf"^ -4  {name}.*?^ -3", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    assert block is not None
    lines = [line for line in block[0].splitlines() if line.startswith(" -1")]
    values = {int(line[3:13]): [float(line[k : k + 12]) for k in range(13, len(line), 12)] for line in lines}
    return np.array([values[number] for number in range(1, nodes + 1)])


def _surface(
    mesh: Mesh, points: Floats, values: Floats, colours: vtk.vtkLookupTable
) -> tuple[vtk.vtkActor, vtk.vtkActor]:
    faces = np.concatenate([mesh.surface_nodes(surface) for surface in mesh.surfaces().values()])
    held, cells, grid = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkUnstructuredGrid()
    held.SetData(numpy_to_vtk(points, deep=True))
    cells.SetData(faces.shape[1], numpy_to_vtkIdTypeArray(faces.ravel(), deep=True))
    grid.SetPoints(held)
    grid.SetCells(vtk.VTK_QUADRATIC_QUAD, cells)
    grid.GetPointData().SetScalars(numpy_to_vtk(values, deep=True))
    curved = vtk.vtkDataSetSurfaceFilter()
    curved.SetNonlinearSubdivisionLevel(2)
    curved.SetInputData(grid)
    smooth = vtk.vtkPolyDataNormals()
    smooth.SetInputConnection(curved.GetOutputPort())
    smooth.SetFeatureAngle(60)
    mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
    mapper.SetInputConnection(smooth.GetOutputPort())
    mapper.SetLookupTable(colours)
    mapper.UseLookupTableScalarRangeOn()
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor.SetMapper(mapper)
    actor.GetProperty().SetAmbient(0.2)
    actor.GetProperty().SetSpecular(0.15)
    return actor, _element_edges(points, faces)


def _element_edges(points: Floats, faces: NDArray[np.int64]) -> vtk.vtkActor:
    sides = np.stack([faces[:, :4], faces[:, 4:8], np.roll(faces[:, :4], -1, axis=1)], axis=-1).reshape(-1, 3)
    held, lines, data = vtk.vtkPoints(), vtk.vtkCellArray(), vtk.vtkPolyData()
    held.SetData(numpy_to_vtk(points, deep=True))
    lines.SetData(3, numpy_to_vtkIdTypeArray(sides.ravel(), deep=True))
    data.SetPoints(held)
    data.SetLines(lines)
    mapper, actor = vtk.vtkPolyDataMapper(), vtk.vtkActor()
    mapper.SetInputData(data)
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*LINE_COLOUR)
    actor.GetProperty().SetOpacity(0.5)
    actor.GetProperty().LightingOff()
    return actor


if __name__ == "__main__":
    print(main())

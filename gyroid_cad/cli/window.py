"""CadQuery's window, which is VTK's; loaded when one is opened."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

# What is made before this is there to draw it is never drawn.
import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkFiltersCore import vtkFeatureEdges, vtkStaticCleanPolyData
from vtkmodules.vtkRenderingCore import vtkActor, vtkAssembly, vtkPolyDataMapper

from gyroid_cad.errors import host_import
from gyroid_cad.render.facets import Facets

with host_import("cadquery"):
    from cadquery import vis

__all__ = ["show_window"]

# Facets at a larger angle meet in an edge that is seen, in degrees.
_SHARP = 35.0
_LINE_COLOUR = (0.2, 0.18, 0.15)

Floats = NDArray[np.float64]


def show_window(shown: Sequence[Facets], title: str, size: tuple[int, int]) -> None:
    """Show facets in a window of so many pixels; returns when it is closed.

    Parameters
    ----------
    shown : sequence of Facets
    title : str
    size : tuple of int
    """

    whole = vtkAssembly()
    for one in shown:
        data = _poly_data(one)
        for mapper, colour in ((_faces(data), None), (_lines(data), _LINE_COLOUR)):
            for place in one.places:
                whole.AddPart(_actor(mapper, colour, place))
    width, height = size
    vis.show(whole, title=title, width=width, height=height, gradient=False)


def _poly_data(facets: Facets) -> Any:

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(facets.corners.reshape(-1, 3), deep=True))  # type: ignore[no-untyped-call]
    corners = np.arange(3 * len(facets.corners), dtype=np.int64)
    cells.SetData(3, numpy_to_vtkIdTypeArray(corners, deep=True))  # type: ignore[no-untyped-call]
    data.SetPoints(points)
    data.SetPolys(cells)
    normals = numpy_to_vtk(facets.normals.reshape(-1, 3), deep=True)  # type: ignore[no-untyped-call]
    colours = np.round(255 * facets.colours).astype(np.uint8).reshape(-1, 3)
    data.GetPointData().SetNormals(normals)
    data.GetPointData().SetScalars(numpy_to_vtk(colours, deep=True))  # type: ignore[no-untyped-call]
    return data


def _faces(data: Any) -> Any:

    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    return mapper


def _lines(data: Any) -> Any:
    """Edges of the surface, and where it is sharply bent."""

    together, edges, mapper = vtkStaticCleanPolyData(), vtkFeatureEdges(), vtkPolyDataMapper()
    together.SetInputData(data)
    edges.SetInputConnection(together.GetOutputPort())
    edges.SetFeatureAngle(_SHARP)
    edges.NonManifoldEdgesOff()
    edges.ColoringOff()
    mapper.SetInputConnection(edges.GetOutputPort())
    mapper.ScalarVisibilityOff()
    return mapper


def _actor(mapper: Any, colour: tuple[float, float, float] | None, place: Floats) -> Any:

    actor, matrix = vtkActor(), vtkMatrix4x4()
    matrix.DeepCopy([*place.ravel().tolist(), 0, 0, 0, 1])
    actor.SetUserMatrix(matrix)
    actor.SetMapper(mapper)
    if colour is not None:
        actor.GetProperty().SetColor(*colour)
    return actor

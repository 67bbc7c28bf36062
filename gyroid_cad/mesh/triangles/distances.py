"""Distances of points from triangles, and nearest places on them (VTK)."""

from __future__ import annotations

from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import GyroidError
from gyroid_cad.mesh.triangles.windings import winding_numbers

__all__ = ["SignedDistances", "locator_of", "vtk_module"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class SignedDistances:
    """Distances of points from closed triangles, below zero inside.

    How far is told by ``vtkImplicitPolyDataDistance``, which alone of what the package depends on answers for many
    points in one call; on which side by how often the triangles go round a point: the normals that VTK tells it by
    mislead at acute edges, where points far outside came out inside.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Closed and counterclockwise seen from outside.

    Raises
    ------
    GyroidError
        If VTK is not installed.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> SignedDistances(corners, sides)(np.array([[0.1, 0.2, 0.3], [0.2, 0.2, -2.0]])).round(6).tolist()
    [-0.1, 2.0]
    """

    def __init__(self, vertices: Floats, triangles: Integers) -> None:
        points, facets = np.array(vertices, dtype=float, order="C"), np.array(triangles, dtype=np.int64, order="C")
        self._function = vtk_module("vtkFiltersCore").vtkImplicitPolyDataDistance()
        self._function.SetInput(_poly_data(points, facets))
        self._surface = points, facets

    def __call__(self, points: Floats) -> Floats:
        """Signed distances of points, shape (n, 3), in mm; shape (n,)."""
        support, found = vtk_module("util.numpy_support"), vtk_module("vtkCommonCore").vtkDoubleArray()
        if not len(points):
            return np.empty(0)
        self._function.FunctionValue(support.numpy_to_vtk(np.array(points, dtype=float, order="C")), found)
        away = np.abs(support.vtk_to_numpy(found))
        return np.asarray(np.where(winding_numbers(*self._surface, points) > 0, -away, away))

    def nearest(self, points: Floats) -> Floats:
        """Places on the triangles that are nearest to points, shape (n, 3), in mm; shape (n, 3).

        >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> SignedDistances(corners, sides).nearest(np.array([[0.2, 0.3, -2.0]])).round(6).tolist()
        [[0.2, 0.3, 0.0]]
        """
        core, model = vtk_module("vtkCommonCore"), vtk_module("vtkCommonDataModel")
        found, place, cell = np.empty((len(points), 3)), [0.0, 0.0, 0.0], model.vtkGenericCell()
        number, part, square = core.reference(0), core.reference(0), core.reference(0.0)
        for index, point in enumerate(points.tolist()):
            self._locator.FindClosestPoint(point, place, cell, number, part, square)
            found[index] = place
        return found

    @cached_property
    def _locator(self) -> Any:
        return locator_of(*self._surface)


def locator_of(points: Floats, triangles: NDArray[np.int64]) -> Any:
    """Locator of the triangles that a line meets."""
    locator = vtk_module("vtkCommonDataModel").vtkStaticCellLocator()
    locator.SetDataSet(_poly_data(points, triangles))
    locator.BuildLocator()
    return locator


def _poly_data(points: Floats, triangles: NDArray[np.int64]) -> Any:
    core, model, support = (
        vtk_module("vtkCommonCore"),
        vtk_module("vtkCommonDataModel"),
        vtk_module("util.numpy_support"),
    )
    data, nodes, cells = model.vtkPolyData(), core.vtkPoints(), model.vtkCellArray()
    ends = np.arange(0, triangles.size + 1, 3)
    nodes.SetData(support.numpy_to_vtk(points, deep=True))
    cells.SetData(*(support.numpy_to_vtkIdTypeArray(part, deep=True) for part in (ends, triangles.ravel())))
    data.SetPoints(nodes)
    data.SetPolys(cells)
    return data


def vtk_module(module: str) -> Any:
    """A module of VTK, which comes with the kernel's usual wheel."""
    try:
        return import_module(f"vtkmodules.{module}")
    except ModuleNotFoundError as problem:
        raise GyroidError(f"distances from triangles need VTK (pip install vtk): {problem}") from None

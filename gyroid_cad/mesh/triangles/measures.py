"""Areas, volumes, pieces and wall thickness of meshes of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import GyroidError
from gyroid_cad.wall.complex import connected

__all__ = ["TriangleMeasures", "measured_walls", "triangle_measures"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TriangleMeasures:
    """Measures of a mesh of triangles.

    Attributes
    ----------
    triangles, vertices : int
    closed : bool
        Whether every edge is used by as many triangles one way as the other: then there is an inside.
    manifold : bool
        Whether it is used exactly once each way.
    open_edges : int
        Edges used more often one way than the other.
    pieces : int
        That are connected by vertices.
    low, high : tuple of float
        Corners of the bounding box, in mm.
    volume, area : float
        In mm3 and mm2; the volume is of no meaning where the triangles are not closed.
    """

    triangles: int
    vertices: int
    closed: bool
    manifold: bool
    open_edges: int
    pieces: int
    low: tuple[float, ...]
    high: tuple[float, ...]
    volume: float
    area: float


def triangle_measures(vertices: Floats, triangles: Integers) -> TriangleMeasures:
    """Measure triangles: their size, whether they close, and what they enclose.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        In mm.
    triangles : ndarray of int, shape (m, 3)
    """
    # Near the triangles, so that volumes far from the origin lose no digits.
    middle = vertices.mean(axis=0)
    a, b, c = (vertices[triangles[:, k]] - middle for k in range(3))
    twice = np.cross(b - a, c - a)
    ends = np.concatenate([triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    forward = ends[:, 0] < ends[:, 1]
    edges, which = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    one_way = np.bincount(which.ravel()[forward], minlength=len(edges))
    other_way = np.bincount(which.ravel()[~forward], minlength=len(edges))
    used = np.unique(triangles)
    label = connected(len(vertices), edges[:, 0], edges[:, 1])[used]
    low, high = vertices[used].min(axis=0), vertices[used].max(axis=0)
    return TriangleMeasures(
        triangles=len(triangles),
        vertices=len(used),
        closed=bool(np.all(one_way == other_way)),
        manifold=bool(np.all((one_way == 1) & (other_way == 1))),
        open_edges=int(np.sum(one_way != other_way)),
        pieces=len(np.unique(label)),
        low=tuple(low.tolist()),
        high=tuple(high.tolist()),
        volume=float(np.sum(a * twice) / 6),
        area=float(np.sum(np.linalg.norm(twice, axis=1)) / 2),
    )


# A ray starts so far inside, as a part of the solid's size: beyond rounding, and far below any wall.
_STARTS_INSIDE = 1e-6
# How near a line must pass a triangle to meet it, as a part of the solid's size: with none VTK misses some.
_MEETS = 1e-9
# A wall has two sides that face away from each other, within 45 degrees; tips and edges, which run out to nothing, have
# not.
_FACING_AWAY = -np.sqrt(0.5)


def measured_walls(vertices: NDArray[np.floating], triangles: NDArray[np.integer], places: int) -> Floats:
    """Distances through the solid, along the inward normals of triangles, to where it ends again.

    Every place stands for the same area: triangles are drawn by their areas, by a generator that always starts alike,
    and places by chance in them. Rays are followed by VTK's static cell locator.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Closed and counterclockwise seen from outside.
    places : int
        How many.

    Returns
    -------
    ndarray
        In mm, sorted; one for each place whose ray meets the surface again on a side that faces away, within 45
        degrees.

    Raises
    ------
    GyroidError
        If VTK is not installed.
    """
    points, facets = np.array(vertices, dtype=float, order="C"), np.array(triangles, dtype=np.int64, order="C")
    core = _vtk("vtkCommonCore")
    locator = _locator(points, facets)
    starts, inward, normals = _places(points, facets, places)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    starts = starts + _STARTS_INSIDE * size * inward
    found = []
    for start, direction in zip(starts, inward, strict=True):
        part, place, local, sub, cell = core.mutable(0.0), [0.0] * 3, [0.0] * 3, core.mutable(0), core.mutable(-1)
        met = locator.IntersectWithLine(start, start + size * direction, _MEETS * size, part, place, local, sub, cell)
        if met and -direction @ normals[int(cell)] < _FACING_AWAY:
            found.append(float(part) * size)
    return np.sort(np.array(found)) + _STARTS_INSIDE * size


def _locator(points: Floats, triangles: NDArray[np.int64]) -> Any:
    """Locator of the triangles that a line meets."""
    core, model, support = _vtk("vtkCommonCore"), _vtk("vtkCommonDataModel"), _vtk("util.numpy_support")
    data, nodes, cells = model.vtkPolyData(), core.vtkPoints(), model.vtkCellArray()
    ends = np.arange(0, triangles.size + 1, 3)
    nodes.SetData(support.numpy_to_vtk(points, deep=True))
    cells.SetData(*(support.numpy_to_vtkIdTypeArray(part, deep=True) for part in (ends, triangles.ravel())))
    data.SetPoints(nodes)
    data.SetPolys(cells)
    locator = model.vtkStaticCellLocator()
    locator.SetDataSet(data)
    locator.BuildLocator()
    return locator


def _vtk(module: str) -> Any:
    """A module of VTK, which comes with the kernel's usual wheel."""
    try:
        return import_module(f"vtkmodules.{module}")
    except ImportError as problem:
        raise GyroidError(f"measuring the walls of triangles needs VTK (pip install vtk): {problem}") from None


def _places(points: Floats, triangles: NDArray[np.int64], count: int) -> tuple[Floats, Floats, Floats]:
    """Places spread evenly over the surface, the unit normals into the solid there, and those out of all triangles."""
    generator = np.random.default_rng(0)
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    outward = np.cross(b - a, c - a)
    areas = np.linalg.norm(outward, axis=1)
    chosen = generator.choice(len(triangles), count, p=areas / areas.sum())
    first, second = generator.random((2, count, 1))
    turned = first + second > 1
    first, second = np.where(turned, 1 - first, first), np.where(turned, 1 - second, second)
    places = a[chosen] + first * (b - a)[chosen] + second * (c - a)[chosen]
    normals = outward / np.maximum(areas, np.finfo(float).tiny)[:, np.newaxis]
    return places, -normals[chosen], normals

"""Distances of points from triangles and nearest places on them (VTK), and turns that triangles make round points."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import numbered_groups
from gyroid_cad.errors import GyroidError
from gyroid_cad.mesh.triangles.spread import spread_points
from gyroid_cad.wall.distances import tree_of

__all__ = ["SignedDistances", "Windings", "locator_of", "vtk_module"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Lines run along no direction that a part was drawn by.
_TURN = np.linalg.qr(np.array([[1.0, 0.31, 0.17], [-0.23, 1.0, 0.41], [0.37, -0.29, 1.0]]))[0]
_PAIRS_AT_ONCE = 2**19
# So many points are worth spreading others over the triangles, of which so many lie along the side of a square of the
# triangles' area.
_MANY, _SPREAD = 10_000, 150
_ROUNDING = 1e-12


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
        self._surface, self._asked = (points, facets), 0

    def __call__(self, points: Floats) -> Floats:
        """Signed distances of points, shape (n, 3), in mm; shape (n,)."""
        away = self.away(points)
        return np.asarray(np.where(self.inside(points), -away, away))

    def away(self, points: Floats) -> Floats:
        """Distances without a sign, which triangles that are not closed have too.

        >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
        >>> SignedDistances(corners, np.array([[0, 1, 2]])).away(np.array([[0.2, 0.3, -2.0]])).tolist()
        [2.0]
        """
        support, found = vtk_module("util.numpy_support"), vtk_module("vtkCommonCore").vtkDoubleArray()
        if not len(points):
            return np.empty(0)
        self._function.FunctionValue(support.numpy_to_vtk(np.array(points, dtype=float, order="C")), found)
        return np.asarray(np.abs(support.vtk_to_numpy(found)))

    def inside(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that the triangles go round; distances, which take longer, are not asked.

        >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
        >>> SignedDistances(corners, sides).inside(np.array([[0.1, 0.2, 0.3], [0.2, 0.2, -2.0]])).tolist()
        [True, False]
        """
        return np.asarray(self._turns(points) > 0)

    def near(self, points: Floats, reach: float) -> Booleans:
        """Mask of the points, shape (n, 3), that are no further from the triangles than a reach in mm.

        Once many were asked, most are told by the nearest of points spread over the triangles.

        >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
        >>> SignedDistances(corners, np.array([[0, 1, 2]])).near(np.array([[0.2, 0.3, -2.0], [0.2, 0.3, 0.5]]), 1.0)
        array([False,  True])
        """
        self._asked += len(points)
        if self._asked < _MANY:
            return np.asarray(self.away(points) <= reach)
        tree, spacing = self._spread
        apart = tree.query(points, distance_upper_bound=reach + spacing)[0]
        found: Booleans = np.asarray(apart <= reach)
        doubtful = np.flatnonzero(np.isfinite(apart) & ~found)
        found[doubtful] = self.away(points[doubtful]) <= reach
        return found

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
    def _spread(self) -> tuple[Any, float]:
        """Points spread over the triangles, and how far any place of those is from the nearest one at most, in mm."""
        vertices, triangles = self._surface
        corners = vertices[triangles]
        sides = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        spacing = float(np.sqrt(np.linalg.norm(sides, axis=1).sum() / 2)) / _SPREAD
        # No place of a triangle is further from one of its corners than the longest of its sides is long.
        wide = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) > spacing
        points = np.concatenate([vertices, spread_points(corners[wide], spacing)[0]])
        return tree_of(points), spacing * (1 + _ROUNDING)

    @cached_property
    def _turns(self) -> Windings:
        return Windings(*self._surface)

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


class Windings:
    """Turns that closed triangles make round points.

    One inside, none outside, and others where the triangles run through themselves.

    A line from a point upwards goes out of the surface once more than into it if the point is inside. On which side
    of an edge it passes is told from the same two numbered corners for both triangles there, so that it passes through
    exactly one of them: no line slips through, as it may where a side is told by the nearest triangle's normal.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> Windings(corners, sides)(np.array([[0.1, 0.2, 0.3], [0.2, 0.2, -2.0]])).tolist()
    [1, 0]
    """

    def __init__(self, vertices: Floats, triangles: Integers) -> None:
        self._corners, self._triangles = vertices @ _TURN, triangles
        # Of few points at a time, as they are mostly asked, looking for boxes anew would take the most.
        facets = self._corners[triangles]
        self._low, self._high = facets.min(axis=1), facets.max(axis=1)

    def __call__(self, points: Floats) -> Integers:
        """Turns round points, shape (n, 3); shape (n,)."""
        turns, own = np.zeros(len(points), dtype=np.int64), points @ _TURN
        for triangle, point in self._above(own):
            a, b, c = self._triangles[triangle].T
            place = own[point]
            left = [_left_of(self._corners, start, end, place) for start, end in ((a, b), (b, c), (c, a))]
            up, down = np.logical_and.reduce(left), ~np.logical_or.reduce(left)
            hit = np.flatnonzero(up | down)
            heights = _heights(self._corners[self._triangles[triangle[hit]]], place[hit])
            hit = hit[heights > place[hit, 2]]
            np.add.at(turns, point[hit], np.where(up[hit], 1, -1))
        return turns

    def _above(self, points: Floats) -> Iterator[tuple[Integers, Integers]]:
        """Triangles with the points that they may lie over: those of the same rows of the plane, and as far along."""
        if not len(points) or not len(self._triangles):
            return
        start, end = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        rows = max(1, int(np.sqrt(len(points))))
        height = (float(end[1] - start[1]) or 1.0) / rows
        # Rows are laid one after the other, so that each stretch of one is a stretch of the sorted places.
        width = 2 * float(end[0] - start[0]) + 1.0

        def row_of(y: Floats) -> Integers:
            return np.asarray(np.clip((y - start[1]) / height, 0, rows - 1).astype(np.int64))

        keys = row_of(points[:, 1]) * width + points[:, 0] - start[0]
        order = np.argsort(keys, kind="stable")
        keys = keys[order]
        met = np.all((self._low[:, :2] <= end) & (self._high[:, :2] >= start), axis=1)
        near = np.flatnonzero(met & (self._high[:, 2] >= points[:, 2].min()))
        first_row = row_of(self._low[near, 1])
        which, step = numbered_groups(row_of(self._high[near, 1]) - first_row + 1)
        number, near = first_row[which] + step, near[which]
        # Of a long triangle askew its box would hold many points that it is not over. Those beyond the ends of the
        # rows lie in the first or the last of them.
        edge = start[1] + height * np.stack([number, number + 1], axis=1)
        edge[number == 0, 0], edge[number == rows - 1, 1] = -np.inf, np.inf
        reach = _reaches(self._corners[self._triangles[near], :2], edge)
        row = number * width
        along = [np.clip(side - start[0], -0.25, width - 0.5) for side in reach]
        first = np.searchsorted(keys, row + along[0], side="left")
        count = np.maximum(np.searchsorted(keys, row + along[1], side="right") - first, 0)
        bounds = np.searchsorted(np.cumsum(count), np.arange(_PAIRS_AT_ONCE, int(count.sum()), _PAIRS_AT_ONCE))
        for some in np.split(np.arange(len(near)), bounds + 1):
            which, step = numbered_groups(count[some])
            yield near[some[which]], order[first[some[which]] + step]


def _reaches(corners: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Lowest and highest first coordinates of triangles, corners (n, 3, 2), where their second ones are in rows."""
    ends = np.roll(corners, -1, axis=1)
    along = ends - corners
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = (rows[:, :, np.newaxis] - corners[:, np.newaxis, :, 1]) / along[:, np.newaxis, :, 1]
    level = along[:, :, 1] == 0
    parts[:, 0][level], parts[:, 1][level] = 0.0, 1.0
    places = corners[:, np.newaxis, :, 0] + np.clip(parts, 0, 1) * along[:, np.newaxis, :, 0]
    low, high = np.minimum(corners[..., 1], ends[..., 1]), np.maximum(corners[..., 1], ends[..., 1])
    met = ((low <= rows[:, 1:]) & (high >= rows[:, :1]))[:, np.newaxis]
    # Rounding takes nothing away.
    slack = _ROUNDING * np.abs(corners[..., 0]).max(axis=1)
    return (
        np.where(met, places, np.inf).min(axis=(1, 2)) - slack,
        np.where(met, places, -np.inf).max(axis=(1, 2)) + slack,
    )


def _left_of(corners: Floats, start: Integers, end: Integers, place: Floats) -> NDArray[np.bool_]:
    """Mask of the places to the left of a side, told alike for both triangles that have it."""
    low, high = np.minimum(start, end), np.maximum(start, end)
    along, away = corners[high, :2] - corners[low, :2], place[:, :2] - corners[low, :2]
    found = along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0] > 0
    return np.asarray(found == (start < end))


def _heights(corners: Floats, place: Floats) -> Floats:
    """Heights of triangles' planes, corners (n, 3, 3), over places (n, 3)."""
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    away = place[:, :2] - corners[:, 0, :2]
    twice = along[:, 0] * across[:, 1] - along[:, 1] * across[:, 0]
    s = (away[:, 0] * across[:, 1] - away[:, 1] * across[:, 0]) / twice
    t = (along[:, 0] * away[:, 1] - along[:, 1] * away[:, 0]) / twice
    return np.asarray(corners[:, 0, 2] + s * along[:, 2] + t * across[:, 2])

"""Walls of whole patches as STEP bodies: vertices, edges and control points numbered by the complex's ids."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.step.bodies import LEAST_GAP, write_shells
from gyroid_cad.step.text import StepText, quoted, step_knots
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["WallBody", "wall_bodies"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

_BORDERS = 4


def wall_bodies(wall: Wall) -> list[WallBody]:
    """Return the solids that a wall of whole patches is, one a piece that is connected by edges."""
    pieces = range(wall.complex.component_count)
    return [WallBody(wall, np.flatnonzero(wall.complex.patch_component == piece)) for piece in pieces]


@dataclass(frozen=True, eq=False)
class WallBody:
    """Patches of a wall that are one solid: both faces of each, and side walls along edges that are free.

    Attributes
    ----------
    wall : Wall
    patches : ndarray of int, shape (patches,)
    """

    wall: Wall
    patches: Integers

    @property
    def solid(self) -> bool:
        return True

    @cached_property
    def gap(self) -> float:
        """Distance in mm that control points of a common border are apart in the nets: in the file they are one."""
        complex = self.wall.complex
        rows, edges = _rows(self._nets(), complex.edge_forward[self.patches]), complex.patch_edges[self.patches]
        owned = np.zeros((complex.edge_count, *rows.shape[2:]))
        owned[edges] = rows
        return max(float(np.abs(rows - owned[edges]).max()), LEAST_GAP)

    @property
    def extent(self) -> float:
        return float(np.abs(self._nets()).max())

    def _nets(self) -> Floats:
        """Control points in mm; shape (patches, 2, n, n, 3)."""
        shifts = self.wall.shifts[self.wall.patch_shift[self.patches]]
        return np.asarray(
            self.wall.nets[self.wall.patch_net[self.patches]] + shifts[:, np.newaxis, np.newaxis, np.newaxis]
        )

    def write(self, text: StepText, name: str, face_names: Iterator[str]) -> tuple[int, list[int]]:
        """Write the solid.

        Parameters
        ----------
        text : StepText
        name : str
        face_names : iterator of str
            One a face, or none: by patch side 0, side 1 and its side walls, as the kernel's solid has them.

        Returns
        -------
        body : int
            Number of its entity.
        faces : list of int
            Numbers of its faces, in that order.
        """
        written = _Writing(self.wall, self.patches, self._nets(), text)
        loops, surfaces, outward, patch = written.faces()
        order = np.argsort(patch, kind="stable")
        bounds = text.table("FACE_BOUND('',", loops[order], ",", outward[order], ")")
        names = [quoted(named) for named in islice(face_names, len(order))]
        rest = (",", bounds[:, np.newaxis], ",", surfaces[order], ",", outward[order], ")")
        faces = text.table("ADVANCED_FACE(", names or "''", *rest)
        return write_shells(text, name, [faces], 0, True), faces.tolist()


class _Writing:
    """Numbers in a file of what is written of a solid, by the complex's ids."""

    def __init__(self, wall: Wall, patches: Integers, nets: Floats, text: StepText) -> None:
        self.wall, self.text, self.nets = wall, text, nets
        complex = wall.complex
        self.edges, self.forward = complex.patch_edges[patches], complex.edge_forward[patches]
        self.fans, self.free = complex.patch_fans[patches], complex.free[complex.patch_edges[patches]]
        self.edge_fans = complex.edge_fans
        # Each edge and fan, and where among patches and their borders it is first found.
        self.edge, self.edge_place = np.unique(self.edges, return_index=True)
        self.fan, self.fan_place = np.unique(self.fans, return_index=True)
        self.edge_points, self.fan_points = self._border_points()
        self.net_points = self._net_points()
        self.vertices = np.zeros((complex.fan_count, len(SIDES)), dtype=np.int64)
        self.vertices[self.fan] = _table(text, "VERTEX_POINT('',", self.fan_points[self.fan], ")")
        self.rims = self._rims()
        self.posts = self._posts(self.fan[complex.border_fans[self.fan]])

    def _border_points(self) -> tuple[Integers, Integers]:
        """Write what borders and corners have of control points: by edge, side and place, and by fan and side."""
        rows = _rows(self.nets, self.forward)
        flat = rows.reshape(-1, *rows.shape[2:])[self.edge_place][:, :, 1:-1]
        edge_points = np.zeros((int(self.edge.max()) + 1, *flat.shape[1:-1]), dtype=np.int64)
        edge_points[self.edge] = self.text.points(flat.reshape(-1, 3)).reshape(flat.shape[:-1])
        corners = np.stack([edge_row(self.nets.transpose(2, 3, 0, 1, 4), k)[0] for k in range(_BORDERS)], axis=1)
        flat = corners.reshape(-1, *corners.shape[2:])[self.fan_place]
        fan_points = np.zeros((int(self.fan.max()) + 1, len(SIDES)), dtype=np.int64)
        fan_points[self.fan] = self.text.points(flat.reshape(-1, 3)).reshape(flat.shape[:-1])
        return edge_points, fan_points

    def _net_points(self) -> Integers:
        """Write the other control points; returns the numbers of all, by patch, side and place in the net."""
        numbers = np.zeros(self.nets.shape[:-1], dtype=np.int64)
        inner = self.nets[:, :, 1:-1, 1:-1]
        numbers[:, :, 1:-1, 1:-1] = self.text.points(inner.reshape(-1, 3)).reshape(inner.shape[:-1])
        for k in range(_BORDERS):
            # A view: the row of the net itself is set.
            row = edge_row(numbers.transpose(2, 3, 0, 1), k)
            along = self.edge_points[self.edges[:, k]]
            along[~self.forward[:, k]] = along[~self.forward[:, k]][..., ::-1]
            row[1:-1] = np.moveaxis(along, -1, 0)
            row[0] = self.fan_points[self.fans[:, k]]
        return numbers

    def _rims(self) -> Integers:
        """Write the edges along both faces; by edge and side."""
        start, end = self.edge_fans[self.edge].T
        ends = [self.fan_points[some][:, :, np.newaxis] for some in (start, end)]
        nets = np.concatenate([ends[0], self.edge_points[self.edge], ends[1]], axis=-1)
        border, forward = self.edge_place % _BORDERS, self.forward.ravel()[self.edge_place]
        curves = np.zeros(nets.shape[:2], dtype=np.int64)
        for k, along in np.ndindex(_BORDERS, 2):
            some = np.flatnonzero((border == k) & (forward == along))
            like = self.wall.face(0, 0).edge(k)
            like = like if along else like.reversed()
            curves[some] = self._splines(nets[some], like.weights, (like.knots,))
        rims = np.zeros((int(self.edge.max()) + 1, len(SIDES)), dtype=np.int64)
        first, last = self.vertices[start], self.vertices[end]
        rims[self.edge] = _table(self.text, "EDGE_CURVE('',", first, ",", last, ",", curves, ",.T.)")
        return rims

    def _posts(self, fans: Integers) -> Integers:
        """Write the straight edges through the wall at fans that do not close round their corner; by fan."""
        posts = np.zeros(len(self.vertices), dtype=np.int64)
        # Where two side walls meet, as these run across.
        curves = self._splines(self.fan_points[fans], np.ones(2), (self.wall.side_wall(0, 0).knots_v,))
        below, above = self.vertices[fans].T
        posts[fans] = _table(self.text, "EDGE_CURVE('',", below, ",", above, ",", curves, ",.T.)")
        return posts

    def faces(self) -> tuple[Integers, Integers, Booleans, Integers]:
        """Write surfaces and loops; of each face its loop, its surface, whether its normal is that one's, its patch."""
        knots, patches = self.wall.knots, np.arange(len(self.nets))
        loops, surfaces, outward, patch = [], [], [], []
        for side in SIDES:
            surfaces.append(self._splines(self.net_points[:, side], self.wall.weights, (knots, knots)))
            loops.append(self._loops(self.rims[self.edges, side], self.forward))
            outward.append(np.full(len(patches), side == SIDES[1]))
            patch.append(patches)
        for k in range(_BORDERS):
            some = np.flatnonzero(self.free[:, k])
            surfaces.append(self._side_walls(k, some))
            edge, along = self.edges[some, k], self.forward[some, k]
            start, end = self.fans[some, k], self.fans[some, (k + 1) % _BORDERS]
            border = np.stack([self.rims[edge, 0], self.posts[end], self.rims[edge, 1], self.posts[start]], axis=1)
            always = np.ones(len(some), dtype=bool)
            loops.append(self._loops(border, np.stack([along, always, ~along, ~always], axis=1)))
            outward.append(always)
            patch.append(some)
        return np.concatenate(loops), np.concatenate(surfaces), np.concatenate(outward), np.concatenate(patch)

    def _side_walls(self, k: int, patches: Integers) -> Integers:
        """Write the ruled surfaces through the wall along a border of patches."""
        # By patch, place along the border, and side.
        rows = edge_row(self.net_points[patches].transpose(2, 3, 0, 1), k).transpose(1, 0, 2)
        like = self.wall.side_wall(0, k)
        return self._splines(rows, like.weights, (like.knots_u, like.knots_v))

    def _loops(self, edges: Integers, along: Booleans) -> Integers:
        oriented = _table(self.text, "ORIENTED_EDGE('',*,*,", edges, ",", along, ")")
        return self.text.table("EDGE_LOOP('',", oriented, ")")

    def _splines(self, nets: Integers, weights: Floats, knots: tuple[Floats, ...]) -> Integers:
        """Write splines alike, by the numbers of their control points in the last axes."""
        degrees = tuple(len(some) - count - 1 for some, count in zip(knots, weights.shape, strict=True))
        flat = nets.reshape(-1, *weights.shape)
        shared = None if np.ptp(weights) == 0 else weights
        closed = (False,) * len(degrees)
        made = self.text.spline_table(degrees, flat, tuple(map(step_knots, knots)), closed, shared)
        return made.reshape(nets.shape[: nets.ndim - weights.ndim])


def _rows(nets: Floats, forward: Booleans) -> Floats:
    """Rows of control points along borders, as the edges run: by patch, border, side and place."""
    rows = np.stack([edge_row(nets.transpose(2, 3, 0, 1, 4), k) for k in range(_BORDERS)])
    rows = rows.transpose(2, 0, 3, 1, 4)
    return np.where(forward[:, :, np.newaxis, np.newaxis, np.newaxis], rows, rows[:, :, :, ::-1])


def _table(text: StepText, *columns: str | Integers | Booleans) -> Integers:
    """Write a table whose columns are arrays of one shape; returns the numbers in that shape."""
    shape = next(column.shape for column in columns if not isinstance(column, str))
    flat = [column if isinstance(column, str) else column.ravel() for column in columns]
    return text.table(*flat).reshape(shape)

"""A part's boundary as numbers: its faces, edges and vertices, and which places of a surface belong to a face."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.trim.loops import within_polygons
from gyroid_cad.trim.surfaces import PartSurface, Quadric

__all__ = ["Boundary", "BoundaryEdge", "BoundaryFace", "Coedge", "StraightLine"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]
# From parameters (n,) to points and derivatives, the first one at least, each of shape (n, 2) or (n, 3).
Curve = Callable[[Floats], tuple[Floats, ...]]

# Sags of polygons along a border, in parts of the face's own extent: rough ones, and those for places near them.
_SAGS = (1e-3, 1e-7)
# A place so many sags from a polygon is not told by it.
_DOUBTFUL = 3.0
_LEAST, _MOST = 9, 2**14
# Along an edge, to see how far its curves are apart.
_LOOKED_AT = 101


@dataclass(frozen=True, slots=True, eq=False)
class StraightLine:
    """A curve with a constant rate: from parameters (n,) to points and two derivatives, (n, 2) or (n, 3).

    Attributes
    ----------
    origin, direction : ndarray, shape (2,) or (3,)
    """

    origin: Floats
    direction: Floats

    def __call__(self, t: Floats) -> tuple[Floats, ...]:
        rates = np.zeros((2, len(t), len(self.direction)))
        # Parts have thousands of these: numpy's broadcast_to and zeros_like would take most of the time.
        rates[0] = self.direction
        return self.origin + t[:, np.newaxis] * self.direction, rates[0], rates[1]


@dataclass(frozen=True, slots=True, eq=False)
class BoundaryEdge:
    """An edge of a part.

    Attributes
    ----------
    curve : callable, optional
        None where a surface's pole or apex is no curve at all.
    first, last : float
        Its parameters at the ends.
    start, end : int
        Vertices.
    tolerance : float
        How far the curve may be from the faces, in mm.
    """

    curve: Curve | None
    first: float
    last: float
    start: int
    end: int
    tolerance: float

    @property
    def straight(self) -> bool:
        """Tell whether it is known to be a straight line."""
        return isinstance(self.curve, StraightLine)


@dataclass(frozen=True, slots=True, eq=False)
class Coedge:
    """A use of an edge by a face.

    Attributes
    ----------
    edge : int
    forward : bool
        Whether the face's border runs the way the edge does.
    curve : callable
        In the surface's parameters, by the parameter of the edge.
    first, last : float
        Parameters of the edge's ends.
    """

    edge: int
    forward: bool
    curve: Curve
    first: float
    last: float

    def looked_at(self) -> Floats:
        """A few points along it, (n, 2), its ends among them."""
        # Of many-faceted parts nearly all time would go into the places between.
        between = 0 if isinstance(self.curve, StraightLine) else _LEAST - 2
        return self.curve(np.linspace(self.first, self.last, between + 2))[0]

    def polygon(self, sag: float, scale: Floats) -> Floats:
        """Points along it, the way it runs, (n, 2): no further from the curve than a sag, in parts of a scale."""
        t = np.array([self.first, self.last])
        points = self.curve(t)[0]
        while len(t) < _MOST and not isinstance(self.curve, StraightLine):
            between = (t[1:] + t[:-1]) / 2
            found = self.curve(between)[0]
            away = np.abs((found - (points[1:] + points[:-1]) / 2) / scale).max(axis=1)
            # A curve that bends both ways may cross its chord in the middle: a few are looked at whatever that gives.
            wanted = np.flatnonzero((away > sag) | (len(t) < _LEAST))
            if not len(wanted) or (len(t) >= _LEAST and away.max() <= sag):
                break
            if len(t) < _LEAST and away.max() < sag / 100 and self._straight(scale, sag):
                break
            t, points = np.insert(t, wanted + 1, between[wanted]), np.insert(points, wanted + 1, found[wanted], axis=0)
        return points if self.forward else points[::-1]

    def _straight(self, scale: Floats, sag: float) -> bool:
        t = np.linspace(self.first, self.last, _LEAST)
        points = self.curve(t)[0] / scale
        chord = points[0] + np.linspace(0, 1, _LEAST)[:, np.newaxis] * (points[-1] - points[0])
        return bool(np.abs(points - chord).max() < sag / 100)


@dataclass(eq=False)
class BoundaryFace:
    """A face of a part.

    Attributes
    ----------
    surface : PartSurface
    sign : float
        1 where the normal of the parameters points out of the part, else -1.
    loops : list of list of Coedge
        As they run round the face, which is on their left where the normal of the parameters points towards one.
    periods : tuple of float
        Of the parameters, or the range of those of a surface that closes; 0 where they have none.
    low, high : ndarray, shape (3,)
        Of a box round it, in mm.
    """

    surface: PartSurface
    sign: float
    loops: list[list[Coedge]]
    periods: tuple[float, float]
    low: Floats
    high: Floats

    @cached_property
    def coedges(self) -> list[Coedge]:
        """All of them, loop by loop."""
        return [coedge for loop in self.loops for coedge in loop]

    @cached_property
    def range(self) -> tuple[Floats, Floats]:
        """Least and largest parameters."""
        points = np.concatenate([coedge.looked_at() for coedge in self.coedges])
        scale = np.maximum(np.ptp(points, axis=0), np.finfo(float).tiny)
        # What lies beyond is cut off where areas are measured: a polygon of a thousandth's sag lost 1e-5 of a disc.
        points = np.concatenate([coedge.polygon(_SAGS[1], scale) for coedge in self.coedges])
        return points.min(axis=0), points.max(axis=0)

    def unwound(self, places: Floats, near: Floats | None = None) -> Floats:
        """Parameters (n, 2) moved by whole periods to where the face is, or as near to others as can be."""
        if not any(self.periods):
            return places
        low, high = self.range
        period = np.array(self.periods)
        turns = np.round(
            ((low + high) / 2 - places if near is None else near - places) / np.where(period, period, np.inf)
        )
        return np.asarray(places + period * turns)

    def contains(self, places: Floats) -> Booleans:
        """Mask of the parameters (n, 2) that belong to the face, by the crossings of a ray.

        Raises
        ------
        KernelError
            If one lies all but on its border.
        """
        low, high = self.range
        scale = np.maximum(high - low, np.finfo(float).tiny)
        own = (self.unwound(places) - low) / scale
        inside, left = np.zeros(len(places), dtype=bool), np.arange(len(places))
        for sag in _SAGS:
            if not len(left):
                break
            found, nearest = within_polygons(own[left], *((end - low) / scale for end in self._sides(sag)))
            inside[left] = found
            left = left[nearest < _DOUBTFUL * sag]
        if len(left):
            raise KernelError("an edge of the lattice all but meets an edge of the part")
        return inside

    def comes_near(self, places: Floats, distance: float) -> Booleans:
        """Mask of the parameters (n, 2) that belong to the face, or are some mm beside it, a little more or less."""
        low, high = self.range
        scale = np.maximum(high - low, np.finfo(float).tiny)
        sides = ((end - low) / scale for end in self._sides(_SAGS[0]))
        inside, nearest = within_polygons((self.unwound(places) - low) / scale, *sides)
        return np.asarray(inside | (nearest * np.max(self.high - self.low) <= _DOUBTFUL * distance))

    def _sides(self, sag: float) -> tuple[Floats, Floats]:
        """Both ends of each side of the polygons along the border."""
        if sag not in self._polygons:
            low, high = self.range
            scale = np.maximum(high - low, np.finfo(float).tiny)
            starts, ends = [], []
            for loop in self.loops:
                corners = np.concatenate([coedge.polygon(sag, scale)[:-1] for coedge in loop])
                starts.append(corners)
                ends.append(np.roll(corners, -1, axis=0))
            self._polygons[sag] = np.concatenate(starts), np.concatenate(ends)
        return self._polygons[sag]

    @cached_property
    def _polygons(self) -> dict[float, tuple[Floats, Floats]]:
        return {}


@dataclass(eq=False)
class Boundary:
    """Faces, edges and vertices of a part's boundary.

    Attributes
    ----------
    faces : list of BoundaryFace
    edges : list of BoundaryEdge
    vertices : ndarray, shape (vertices, 3)
        In mm.
    """

    faces: list[BoundaryFace]
    edges: list[BoundaryEdge]
    vertices: Floats

    @cached_property
    def users(self) -> list[list[tuple[int, int]]]:
        """For each edge, faces that it bounds, and which of their coedges it is."""
        users: list[list[tuple[int, int]]] = [[] for _ in self.edges]
        for number, face in enumerate(self.faces):
            for index, coedge in enumerate(face.coedges):
                users[coedge.edge].append((number, index))
        return users

    def depths(
        self, face: Integers, points: Floats, near: Floats | None = None, tangent: bool = False
    ) -> tuple[Floats, Floats, Floats]:
        """Depths of points below faces that go on beyond their borders, how they change, and the nearest places.

        Parameters
        ----------
        face : ndarray of int, shape (m,)
        points : ndarray, shape (m, q, 3)
        near : ndarray, shape (m, q, 2), optional
            Parameters near those looked for.
        tangent : bool
            Whether to measure from the tangent planes there.

        Returns
        -------
        depths : ndarray, shape (m, q)
            In mm, positive inside.
        inwards : ndarray, shape (m, q, 3)
            Their gradients.
        places : ndarray, shape (m, q, 2)
        """
        depths, inwards, places = np.empty(points.shape[:2]), np.empty(points.shape), np.empty((*points.shape[:2], 2))
        flat, others = self._flat_and_others(face)
        own, normals = self._on_planes(face[flat], points[flat])
        depths[flat], inwards[flat], places[flat] = own[..., 2], normals[:, None], own[..., :2]
        for number, some in others:
            one, shape = self.faces[number], (len(some), points.shape[1])
            guess = None if near is None else near[some].reshape(-1, 2)
            if tangent and guess is not None:
                found = one.surface.tangent_distances(points[some].reshape(-1, 3), guess)
            else:
                found = one.surface.distances(points[some].reshape(-1, 3), guess)
            depths[some] = -one.sign * found[0].reshape(shape)
            inwards[some] = -one.sign * found[1].reshape(*shape, 3)
            places[some] = one.unwound(found[2], guess).reshape(*shape, 2)
        return depths, inwards, places

    def rough_depths(self, face: Integers, points: Floats) -> tuple[Floats, Floats]:
        """Depths of points (m, q, 3) below faces (m,), and how far off each is at most where it is near zero."""
        depths, errors = np.empty(points.shape[:2]), np.zeros(points.shape[:2])
        flat, others = self._flat_and_others(face)
        _, origins, axes, inwards = self._planes
        normals = axes[face[flat], 2] * inwards[face[flat], None]
        depths[flat] = np.einsum("mqi,mi->mq", points[flat], normals) - dot(origins[face[flat]], normals)[:, None]
        for number, some in others:
            found, error = self.faces[number].surface.roughly(points[some].reshape(-1, 3))
            depths[some] = -self.faces[number].sign * found.reshape(depths[some].shape)
            errors[some] = error.reshape(depths[some].shape)
        return depths, errors

    def points(self, face: Integers, places: Floats) -> Floats:
        """Points of faces (m,) at parameters (m, q, 2); shape (m, q, 3)."""
        points = np.empty((*places.shape[:2], 3))
        flat, others = self._flat_and_others(face)
        _, origins, axes, _ = self._planes
        points[flat] = origins[face[flat], None] + places[flat] @ axes[face[flat], :2]
        for number, some in others:
            points[some] = self.faces[number].surface.points(places[some].reshape(-1, 2)).reshape(points[some].shape)
        return points

    def along_edges(self, edge: Integers, t: Floats) -> tuple[Floats, Floats]:
        """Points of edges (m,) at parameters (m, ...), and their rates of change; each of shape (m, ..., 3)."""
        straight, origins, directions = self._lines
        shape = (-1, *(1,) * (t.ndim - 1), 3)
        rates = np.broadcast_to(directions[edge].reshape(shape), (*t.shape, 3)).copy()
        points = origins[edge].reshape(shape) + t[..., None] * rates
        others = np.flatnonzero(~straight[edge])
        for number, some in grouped(edge[others]):
            curve, rows = self.edges[number].curve, others[some]
            assert curve is not None
            point, rate, *_ = curve(t[rows].ravel())
            points[rows], rates[rows] = (values.reshape(points[rows].shape) for values in (point, rate))
        return points, rates

    @cached_property
    def _lines(self) -> tuple[Booleans, Floats, Floats]:
        """A mask of the edges that are straight lines, their origins and directions."""
        mask, both = np.zeros(len(self.edges), dtype=bool), np.zeros((2, len(self.edges), 3))
        for number, edge in enumerate(self.edges):
            if isinstance(edge.curve, StraightLine):
                mask[number], both[0, number], both[1, number] = True, edge.curve.origin, edge.curve.direction
        return mask, both[0], both[1]

    def _flat_and_others(self, face: Integers) -> tuple[Integers, list[tuple[int, Integers]]]:
        """Positions of planes, which are asked all at once; and those of the others, by number."""
        flat = self._planes[0][face]
        others = np.flatnonzero(~flat)
        return np.flatnonzero(flat), [(number, others[some]) for number, some in grouped(face[others])]

    def _on_planes(self, face: Integers, points: Floats) -> tuple[Floats, Floats]:
        """Parameters and depths of points (m, q, 3) on planes (m,), and the ways inwards (m, 3)."""
        _, origins, axes, inwards = self._planes
        own = (points - origins[face, None]) @ axes[face].transpose(0, 2, 1)
        own[..., 2] *= inwards[face, None]
        return own, axes[face, 2] * inwards[face, None]

    @cached_property
    def _planes(self) -> tuple[Booleans, Floats, Floats, Floats]:
        """A mask of the faces that are planes, their origins and axes, and 1 where the third axis points inwards."""
        mask, inwards = np.zeros(len(self.faces), dtype=bool), np.ones(len(self.faces))
        origins, axes = np.zeros((len(self.faces), 3)), np.zeros((len(self.faces), 3, 3))
        for number, face in enumerate(self.faces):
            if isinstance(face.surface, Quadric) and face.surface.kind == "plane":
                mask[number], origins[number], axes[number] = True, face.surface.origin, face.surface.axes
                inwards[number] = -face.sign * face.surface.handed
        return mask, origins, axes, inwards

    @cached_property
    def boxes(self) -> tuple[Floats, Floats]:
        """Boxes round the faces: their lowest and highest corners, (faces, 3)."""
        return np.array([face.low for face in self.faces]), np.array([face.high for face in self.faces])

    @cached_property
    def spans(self) -> Floats:
        """Ranges of the faces' parameters, (faces, 2)."""
        return np.array([face.range[1] - face.range[0] for face in self.faces])

    def deviation(self, edge: int) -> float:
        """Largest distance of an edge's curve from its curves on the faces, in mm; its stated tolerance may be less.

        The kernel looks at 23 places, where its reader of STEP made them agree.
        """
        if edge not in self._deviations:
            own, worst = self.edges[edge], 0.0
            assert own.curve is not None
            t = np.linspace(own.first, own.last, _LOOKED_AT)
            points = own.curve(t)[0]
            for number, index in self.users[edge]:
                face = self.faces[number]
                away = face.surface.points(face.coedges[index].curve(t)[0]) - points
                worst = max(worst, float(np.linalg.norm(away, axis=1).max()))
            self._deviations[edge] = worst
        return self._deviations[edge]

    @cached_property
    def _deviations(self) -> dict[int, float]:
        return {}

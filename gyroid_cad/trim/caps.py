"""Caps that close a wall cut to a box: on each side of the box, what section curves and the box's own edges bound.

Where a section curve ends at an edge of the box, the cap goes on along that edge; which way tells on which side of
that place the edge belongs to it. So the caps follow from the curves alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError
from gyroid_cad.trim.edge_crossings import PLANES
from gyroid_cad.trim.loops import linked, nested, signed_area
from gyroid_cad.trim.trimmed_faces import Arc, CutFace

__all__ = ["Cap", "CapArc", "caps_of", "plane_axes"]

Floats = NDArray[np.float64]

BoxCorner = tuple[int, int, int]
End = int | BoxCorner
Straight = Callable[[tuple[End, End]], int]


@dataclass(frozen=True, eq=False)
class CapArc:
    """A stretch of a section curve, as the cap beside it uses it.

    Attributes
    ----------
    edge : int
    forward : bool
        Whether the cap uses it the way it runs.
    start, end : int
        Vertices of the edge.
    cut : CutFace
    arc : Arc
    shift : ndarray, shape (3,)
        From the cut face's own place, in mm along the box's axes.
    """

    edge: int
    forward: bool
    start: int
    end: int
    cut: CutFace
    arc: Arc
    shift: Floats

    @property
    def first(self) -> int:
        return self.start if self.forward else self.end

    @property
    def last(self) -> int:
        return self.end if self.forward else self.start

    @cached_property
    def outline(self) -> Floats:
        """Points along it as the cap uses it, in mm; shape (k, 3)."""
        points = self.cut.outlines[self.arc] + self.shift
        return points if self.forward else points[::-1]


@dataclass(frozen=True, slots=True, eq=False)
class Cap:
    """A piece of a side of the box.

    Attributes
    ----------
    plane : int
        Of :data:`~gyroid_cad.trim.edge_crossings.PLANES`.
    loops : list of list of (int, bool)
        Edges, and whether they are used the way they run; the outer loop first, the cap on the left seen from outside.
    area : float
        In mm2.
    """

    plane: int
    loops: list[list[tuple[int, bool]]]
    area: float

    def moments(self, level: float) -> Floats:
        """Flux of x^2 / 2 along each axis out of it, where its plane is at a level, in mm4."""
        axis, sign = PLANES[self.plane]
        return np.asarray(-sign * level**2 / 2 * self.area * np.eye(3)[axis])


@dataclass(frozen=True, slots=True, eq=False)
class _Link:
    """Step of a cap's loop from one vertex, or corner, to the next."""

    edge: int
    forward: bool
    start: End
    end: End
    outline: Floats
    bulge: float


def plane_axes(plane: int) -> tuple[int, int]:
    """The two axes in a side of the box, in an order that is right-handed seen from outside."""
    axis, sign = PLANES[plane]
    following = (axis + 1) % 3, (axis + 2) % 3
    return following if sign < 0 else following[::-1]


def caps_of(
    arcs: list[list[CapArc]],
    low: Floats,
    high: Floats,
    straight: Straight,
    filled: bool,
) -> list[Cap]:
    """Close the sides of a box.

    Parameters
    ----------
    arcs : list of list of CapArc
        By plane.
    low, high : ndarray, shape (3,)
        Of the box, in mm.
    straight : callable
        The straight edge between two vertices, or corners of the box.
    filled : bool
        Whether the box's corners belong to the caps, should no curve end on any of its edges.

    Raises
    ------
    KernelError
        If the curves do not agree.
    """
    runs = _filled_runs(arcs, low, high, filled)
    caps = []
    for plane, on_plane in enumerate(arcs):
        links = [_curve_link(arc, plane) for arc in on_plane]
        links += [_straight_link(run, plane, straight) for run in runs if plane in run.planes]
        caps += _linked_caps(plane, links)
    return caps


@dataclass(frozen=True, slots=True, eq=False)
class _Run:
    """A stretch of an edge of the box that belongs to the caps on both sides, upwards along its axis."""

    planes: tuple[int, int]
    ends: tuple[End, End]
    points: Floats


def _filled_runs(arcs: list[list[CapArc]], low: Floats, high: Floats, filled: bool) -> list[_Run]:
    stops = {planes: _stops(arcs, planes) for planes in _box_edges()}
    inside: dict[BoxCorner, bool] = {}
    for planes, on_edge in stops.items():
        if on_edge:
            corners = _corners_of(planes)
            _agree(inside, corners[0], not on_edge[0][2])
            _agree(inside, corners[1], on_edge[-1][2])
    if not inside:
        inside[0, 0, 0] = filled
    # Along an edge on which no curve ends, nothing changes.
    for _ in range(len(stops)):
        for planes, on_edge in stops.items():
            one, other = _corners_of(planes)
            if not on_edge and (one in inside or other in inside):
                _agree(inside, one, inside.get(one, inside.get(other, False)))
                _agree(inside, other, inside[one])
    return [run for planes, on_edge in stops.items() for run in _runs_along(planes, on_edge, inside, (low, high))]


def _runs_along(
    planes: tuple[int, int],
    stops: list[tuple[int, Floats, bool]],
    inside: dict[BoxCorner, bool],
    box: tuple[Floats, Floats],
) -> list[_Run]:
    lowest, highest = _corners_of(planes)
    first, last = (np.array(box)[list(corner), range(3)] for corner in (lowest, highest))
    ends: list[End] = [lowest, *(vertex for vertex, _, _ in stops), highest]
    points = [first, *(point for _, point, _ in stops), last]
    belongs = [inside[lowest], *(above for _, _, above in stops)]
    return [
        _Run(planes, (ends[k], ends[k + 1]), np.array(points[k : k + 2])) for k in range(len(belongs)) if belongs[k]
    ]


def _stops(arcs: list[list[CapArc]], planes: tuple[int, int]) -> list[tuple[int, Floats, bool]]:
    """Vertices on an edge of the box, upwards: number, point, and whether the caps go on above it."""
    axis = _free_axis(planes)
    found: dict[int, tuple[Floats, bool]] = {}
    for plane, other in (planes, planes[::-1]):
        upwards = _upwards(plane, other)
        for arc in arcs[plane]:
            for vertex, point, ends_here in ((arc.first, arc.outline[0], False), (arc.last, arc.outline[-1], True)):
                node = arc.arc.end if arc.forward == ends_here else arc.arc.start
                if arc.cut.on_edge(node, other):
                    above = ends_here == upwards
                    if found.setdefault(vertex, (point, above))[1] != above:
                        raise KernelError("curves where the lattice crosses the box do not agree at one of its edges")
    stops = sorted(((v, p, a) for v, (p, a) in found.items()), key=lambda stop: float(stop[1][axis]))
    if any(one[2] == other[2] for one, other in pairwise(stops)):
        raise KernelError("curves where the lattice crosses the box do not agree along one of its edges")
    return stops


def _upwards(plane: int, other: int) -> bool:
    """True if round a side of the box, seen from outside, one runs up the edge it shares with another side."""
    x, y = plane_axes(plane)
    axis, sign = PLANES[other]
    # Anticlockwise: along x at the low y, up y at the high x, back along x at the high y, down y at the low x.
    return sign > 0 if axis == y else sign < 0 and axis == x


def _linked_caps(plane: int, links: list[_Link]) -> list[Cap]:
    loops = linked(links, "the lattice on one of its sides")
    x, y = plane_axes(plane)
    outlines = [np.concatenate([link.outline[:-1] for link in loop])[:, [x, y]] for loop in loops]
    corners = [np.array([link.outline[0] for link in loop])[:, [x, y]] for loop in loops]
    areas = [
        signed_area(polygon) + sum(link.bulge for link in loop) for polygon, loop in zip(corners, loops, strict=True)
    ]
    return [
        Cap(
            plane,
            [[(link.edge, link.forward) for link in loops[k]] for k in group],
            float(sum(areas[k] for k in group)),
        )
        for group in nested(outlines)
    ]


def _curve_link(arc: CapArc, plane: int) -> _Link:
    x, y = plane_axes(plane)
    bulge = arc.cut.bulge(arc.arc, x, y)
    return _Link(arc.edge, arc.forward, arc.first, arc.last, arc.outline, bulge if arc.forward else -bulge)


def _straight_link(run: _Run, plane: int, straight: Straight) -> _Link:
    other = run.planes[0] if run.planes[1] == plane else run.planes[1]
    edge, upwards = straight(run.ends), _upwards(plane, other)
    start, end = run.ends if upwards else run.ends[::-1]
    return _Link(edge, upwards, start, end, run.points if upwards else run.points[::-1], 0.0)


def _agree(inside: dict[BoxCorner, bool], corner: BoxCorner, value: bool) -> None:
    if inside.setdefault(corner, value) != value:
        raise KernelError("curves where the lattice crosses the box do not agree at one of its corners")


def _box_edges() -> list[tuple[int, int]]:
    count = len(PLANES)
    return [(i, j) for i in range(count) for j in range(i + 1, count) if PLANES[i][0] != PLANES[j][0]]


def _free_axis(planes: tuple[int, int]) -> int:
    return 3 - PLANES[planes[0]][0] - PLANES[planes[1]][0]


def _corners_of(planes: tuple[int, int]) -> tuple[BoxCorner, BoxCorner]:
    """The ends of an edge of the box: 0 or 1 along each axis."""
    place = [0, 0, 0]
    for plane in planes:
        axis, sign = PLANES[plane]
        place[axis] = 0 if sign > 0 else 1
    ends = []
    for value in (0, 1):
        place[_free_axis(planes)] = value
        ends.append((place[0], place[1], place[2]))
    return ends[0], ends[1]

"""A part as closed triangles: of its B-rep, or of a file of triangles."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import signed_volumes
from gyroid_cad.common.checks import finite_number
from gyroid_cad.common.choices import ROUTES, Kind, Route
from gyroid_cad.common.formats import TRIANGLE_FORMATS, format_of, require_meshing
from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.part import shapes_of, solid_names
from gyroid_cad.filling.wanted import SURFACE
from gyroid_cad.kernel.check import compound_of, volume_of
from gyroid_cad.kernel.part import face_numbers, points_within
from gyroid_cad.kernel.repair import chosen_solids, require_volume
from gyroid_cad.kernel.stl import solid_triangles
from gyroid_cad.mesh.triangles.booleans import Body, body_of, united
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.faults import Hole, holes_of, open_edges
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.spread import spread_points

__all__ = [
    "TrianglePart",
    "is_triangles",
    "mended",
    "naming_triangles",
    "require_deviation",
    "require_route",
    "sound_body",
    "triangle_part",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Corners nearer to each other are one, in parts of the part's size: above rounding in text of five digits.
_WELDED = 1e-5
# Share of a part's volume that its triangles may be off by: they are finer then, but not below a part of the usual.
_MOST_LOST, _FINEST = 3e-4, 0.02
# Of the kernel's integral that tells.
_CLOSENESS = 1e-6
# Of what several solids hold together: less in common may be rounding, where they touch.
_SHARED = 1e-6
# Of the same, and of the box round triangles, what is no solid.
_NOTHING = 1e-12
# What is expected at the route of exact solids, of what it has no use for.
_AT_BREP = {
    "deviation": "none at route brep, whose solids write(deviation=...) meshes",
    "fillet": 'none at route brep, whose solids have sharp corners there; route="triangles" rounds them',
    "repair": "none at route brep, which repairs what it can by itself",
}


# Without slots, so that what is worked out once is kept.
@dataclass(frozen=True, eq=False)
class TrianglePart:
    """A part known by its triangles.

    Attributes
    ----------
    body : Body
    remarks : tuple of str
        On what was repaired or united.
    shape : TopoDS_Shape, optional
        Of a part that has a B-rep.
    meshes : list of (vertices, triangles, faces)
        Of its solids, as :func:`solid_triangles` gives them.
    depth : callable, optional
        Depth of points below its boundary, if that is known by less than its triangles: of a core by those of its part.
    """

    body: Body
    remarks: tuple[str, ...] = ()
    shape: Any = None
    meshes: Sequence[tuple[Floats, Integers, Integers]] = ()
    depth: Callable[[Floats], Floats] | None = None

    @cached_property
    def low(self) -> Floats:
        """Lowest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[0])

    @cached_property
    def high(self) -> Floats:
        """Highest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[1])

    @cached_property
    def distances(self) -> Callable[[Floats], Floats]:
        """Distances from its boundary, below zero inside."""
        depth = self.depth
        return self.facets if depth is None else lambda points: -depth(points)

    @cached_property
    def facets(self) -> SignedDistances:
        """Its triangles, to be asked for the places on them that are nearest to points."""
        return SignedDistances(*self.body.triangles())

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        return self.facets.inside(points) if self.depth is None else np.asarray(self.distances(points) < 0)

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm."""
        return np.asarray(self.distances(points) <= reach)

    def points_inside(self, count: int) -> Floats:
        """Points spread at random over the inside, the same ones each time; shape (n, 3), as many as are wanted."""
        return points_within(self.low, self.high, self.contains, count)

    def surface_samples(self, spacing: float) -> tuple[Floats, Floats, float]:
        """Points on the boundary, their normals, and how far at most any place on it is from one, in mm."""
        vertices, triangles = self.body.triangles()
        return *spread_points(vertices[triangles], spacing), spacing

    def bodies(self) -> list[TrianglePart]:
        """Parts of it that hang together, each by itself."""
        return [TrianglePart(piece, (), self.shape, self.meshes) for piece in self.body.pieces()]

    def facets_of(self, openings: Sequence[Any]) -> tuple[Floats, Integers]:
        """Vertices and triangles of faces of the B-rep.

        Raises
        ------
        ParameterError
        """
        numbers = face_numbers(self.shape, openings)
        counts = np.cumsum([0, *(len(vertices) for vertices, _, _ in self.meshes)])
        chosen = [
            triangles[np.isin(faces, numbers)] + first
            for (_, triangles, faces), first in zip(self.meshes, counts[:-1], strict=True)
        ]
        return np.concatenate([vertices for vertices, _, _ in self.meshes]), np.concatenate(chosen)


@contextmanager
def naming_triangles(kind: Kind, body: str = "") -> Iterator[None]:
    """Context of what is asked of the kernel: where that fails, the route that needs none of it is named.

    Parameters
    ----------
    kind : str
    body : str
        The one of several that is being filled.

    Raises
    ------
    KernelError
    """
    try:
        yield
    except KernelError as failed:
        way_out = "" if kind == SURFACE else '; route="triangles" fills it for STL, 3MF, OBJ and PLY files'
        raise KernelError(f"{body and f'{body}: '}{failed}{way_out}") from failed.__cause__


def is_triangles(given: Any) -> bool:
    """Tell whether a part is given as a file of triangles."""
    return isinstance(given, str | os.PathLike) and format_of(given) in TRIANGLE_FORMATS


def triangle_part(
    given: Any, solids: Sequence[str | int], deviation: float, repair: bool = False, closely: bool = False
) -> TrianglePart:
    """The part that a user gives, by its triangles; solids that overlap or touch are united.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`gyroid_cad.fill`; or an STL, 3MF, OBJ or PLY file.
    solids : sequence of str or int
        Which of a B-rep's solids, if not all.
    deviation : float
        Of triangles from the faces of a B-rep, in mm.
    repair : bool
        Whether the triangles of a file may be mended.
    closely : bool
        Whether the triangles of a B-rep are finer where its volume would be off by more than 3e-4.

    Raises
    ------
    ParameterError, ExportError
    """
    if is_triangles(given):
        if solid_names(solids):
            raise ParameterError("solids", solids, "none of a file of triangles, whose solids have no names")
        return TrianglePart(*_body_of_file(given, repair))
    named = chosen_solids(*shapes_of(given)[:2], solid_names(solids))
    require_volume(named)
    shape = compound_of(solid for _, solid in named)
    meshes = solid_triangles(shape, deviation)
    if closely and (lost := _lost(shape, meshes)) > _MOST_LOST:
        meshes = solid_triangles(shape, deviation * max(_MOST_LOST / lost, _FINEST) / 2)
    bodies: list[Body] = []
    remarks: list[str] = []
    for vertices, triangles, _ in meshes:
        # What stays open as triangles is no fault of whoever drew the part: it is closed, and said.
        body, done = sound_body(vertices, triangles)
        body, done = (body, done) if body is not None else mended(vertices, triangles)
        if body is None:
            accepted = f"solids whose triangles close: {_said(holes_of(vertices, triangles))}"
            raise ParameterError("part", shape.ShapeType().name.removeprefix("TopAbs_").lower(), accepted)
        bodies.append(body)
        remarks += done
    whole = united(bodies)
    common = sum(body.volume for body in bodies) - whole.volume
    if common > _SHARED * whole.volume:
        remarks.append(f"{len(bodies)} solids have {common:.4g} mm3 in common: united")
    if len(bodies) > 1:
        # Where solids touch, the chords of their triangles leave films between them, some without any volume.
        whole = whole.without_films(_NOTHING * whole.volume, _SHARED * whole.volume)
    return TrianglePart(whole, tuple(remarks), shape, meshes)


def _lost(shape: Any, meshes: Sequence[tuple[Floats, Integers, Integers]]) -> float:
    """Share of a shape's volume that its triangles are off by."""
    volume = sum(float(signed_volumes(vertices, triangles).sum()) for vertices, triangles, _ in meshes)
    return abs(volume / volume_of(shape, _CLOSENESS) - 1)


def _body_of_file(path: str | os.PathLike[str], repair: bool) -> tuple[Body, tuple[str, ...]]:
    """The body that a file's triangles bound, and what was done for it."""
    try:
        vertices, triangles = read_triangles(path)
    except ParameterError as refused:
        raise ParameterError("part", str(path), refused.accepted) from None
    body, remarks = sound_body(vertices, triangles)
    if body is None and repair:
        body, remarks = mended(vertices, triangles)
    if body is None or not body.volume > _NOTHING * np.prod(np.ptp(vertices, axis=0)):
        way_out = "" if repair else "; repair closes them"
        raise ParameterError("part", str(path), f"closed triangles: {_said(holes_of(vertices, triangles))}{way_out}")
    return body, remarks


def _said(holes: Sequence[Hole]) -> str:
    if not holes:
        return "these fold over onto themselves, or bound no volume"
    return (
        "there is 1 hole, " + str(holes[0]) if len(holes) == 1 else f"there are {len(holes)} holes, one of {holes[0]}"
    )


def require_route(route: Route, **given: Any) -> None:
    """Check that there is such a route, and at that of exact solids that nothing is given which triangles alone need.

    Raises
    ------
    ParameterError
    """
    if route not in ROUTES:
        raise ParameterError("route", route, " or ".join(ROUTES))
    for name, value in given.items():
        if route == ROUTES[0] and value not in (None, False):
            raise ParameterError(name, value, _AT_BREP[name])


def require_deviation(deviation: float | None, cell_size: float) -> None:
    """Check a deviation, if one is given: with one as large as a cell, little of part and lattice would be left.

    Raises
    ------
    ParameterError
    """
    if deviation is not None:
        require_meshing(finite_number("deviation", deviation))
        if deviation >= cell_size:
            raise ParameterError("deviation", deviation, f"a length below the cell size, {cell_size:g} mm")


def sound_body(vertices: Floats, triangles: Integers) -> tuple[Body | None, tuple[str, ...]]:
    """The body that closed triangles bound, and what was done to make it one; None if they are open.

    Edges that four triangles share are taken for two that lie on one another; a body that is inside out is turned;
    shells that overlap are united.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> sound_body(corners, sides[:, ::-1])[1]
    ('its triangles are inside out: turned',)
    """
    body = body_of(vertices, triangles) or body_of(*_parted_edges(vertices, triangles))
    if body is None or body.empty:
        return None, ()
    remarks: tuple[str, ...] = ()
    if body.volume < 0:
        body, remarks = body.inside_out(), ("its triangles are inside out: turned",)
    pieces = body.pieces()
    if len(pieces) > 1 and not body.void_count:
        whole = united(pieces)
        if (common := body.volume - whole.volume) > _WELDED * whole.volume:
            return whole, (*remarks, f"{len(pieces)} shells have {common:.4g} mm3 in common: united")
    return body, remarks


def _parted_edges(vertices: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Vertices of their own for triangles that share an edge with more than one other: each is paired with one."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    count = len(vertices)
    forward = edges[:, 0] < edges[:, 1]
    keys = edges.min(axis=1) * count + edges.max(axis=1)
    # The first use of an edge one way goes with its first use the other way, the second with the second.
    ahead, behind = (np.flatnonzero(forward == way) for way in (True, False))
    ahead, behind = ahead[np.argsort(keys[ahead], kind="stable")], behind[np.argsort(keys[behind], kind="stable")]
    if not np.array_equal(keys[ahead], keys[behind]):
        return vertices, triangles
    # Corner k of a triangle begins its edge k; the edge ends at the next corner.
    start, end = np.arange(triangles.size), np.arange(triangles.size).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    joined = np.concatenate([start[ahead], end[ahead]]), np.concatenate([end[behind], start[behind]])
    label = connected(triangles.size, *joined)
    _, first = np.unique(label, return_index=True)
    return vertices[triangles.ravel()[first]], label.reshape(-1, 3)


def mended(vertices: Floats, triangles: Integers) -> tuple[Body | None, tuple[str, ...]]:
    """A body of triangles that are open, and what was done for it: corners welded, triangles turned, holes closed.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 2, 3]])
    >>> body, remarks = mended(corners, sides)
    >>> round(body.volume, 6), remarks
    (0.166667, ('1 triangle turned', '1 hole closed, 3 edges round (0.333, 0.333, 0.333)'))
    """
    size = float(np.ptp(vertices, axis=0).max())
    pairs = cKDTree(vertices).query_pairs(_WELDED * size, output_type="ndarray")
    label = connected(len(vertices), pairs[:, 0], pairs[:, 1])
    welded = len(vertices) - int(label.max(initial=-1)) - 1
    _, first = np.unique(label, return_index=True)
    vertices, triangles = vertices[first], label[triangles]
    triangles = triangles[np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    doubled = len(triangles) - len(first)
    triangles, turned = _turned_alike(triangles[np.sort(first)])
    mends = (welded, "corner", "welded"), (doubled, "triangle", "on others left out"), (turned, "triangle", "turned")
    remarks = [f"{_counted(number, what)} {done}" for number, what, done in mends if number]
    holes = holes_of(vertices, triangles)
    if holes:
        remarks.append(f"{_counted(len(holes), 'hole')} closed, {'the largest of ' * (len(holes) > 1)}{holes[0]}")
    body, more = sound_body(*_holes_closed(vertices, triangles))
    return body, (*remarks, *more)


def _counted(number: int, what: str) -> str:
    return f"1 {what}" if number == 1 else f"{number} {what}s"


def _turned_alike(triangles: Integers) -> tuple[Integers, int]:
    """Triangles turned so that neighbours agree, the fewer of each shell; and how many were.

    Every triangle is there twice, as it is and turned; what agrees is connected.
    """
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    forward, owner = edges[:, 0] < edges[:, 1], np.repeat(np.arange(len(triangles)), 3)
    keys = edges.min(axis=1) * (int(triangles.max(initial=0)) + 1) + edges.max(axis=1)
    order = np.argsort(keys, kind="stable")
    pair = np.flatnonzero(np.diff(keys[order]) == 0)
    one, other = order[pair], order[pair + 1]
    # Two that run along an edge the same way agree if one of them is turned.
    against = (forward[one] == forward[other]).astype(np.int64)
    first, second = owner[one], owner[other]
    ends = [
        np.concatenate([2 * first, 2 * first + 1]),
        np.concatenate([2 * second + against, 2 * second + 1 - against]),
    ]
    label = connected(2 * len(triangles), ends[0], ends[1])
    turned = label[1::2] < label[::2]
    shell = np.minimum(label[::2], label[1::2])
    most = np.bincount(shell, turned) > 0.5 * np.bincount(shell)
    turned ^= most[shell]
    return np.where(turned[:, np.newaxis], triangles[:, ::-1], triangles), int(turned.sum())


def _holes_closed(vertices: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Holes closed by triangles from their edges to their middles."""
    edges, label = open_edges(triangles, len(vertices))
    if not len(edges):
        return vertices, triangles
    ends = np.bincount(label).astype(float)[:, np.newaxis]
    middles = np.stack([np.bincount(label, vertices[edges[:, 0], k]) for k in range(3)], axis=1) / ends
    fans = np.column_stack([edges[:, ::-1], len(vertices) + label])
    return np.concatenate([vertices, middles]), np.concatenate([triangles, fans])

"""Areas, volumes, pieces, voids and wall thickness of meshes of triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays, numbered_groups, signed_volumes
from gyroid_cad.common.graph import connected
from gyroid_cad.mesh.triangles.distances import locator_of, vtk_module

__all__ = [
    "TriangleMeasures",
    "edge_uses",
    "measured_walls",
    "shell_labels",
    "surface_places",
    "triangle_measures",
    "unmatched_edges",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Solid angle of a whole sphere, by which winding numbers are counted.
_SPHERE = 4 * np.pi


@dataclass(frozen=True, slots=True, eq=False)
class TriangleMeasures:
    """Measures of a mesh of triangles, shell by shell.

    A shell is what is connected by edges. Oriented outwards, one that bounds solid encloses a positive volume, and one
    that bounds a void within it a negative one.

    Attributes
    ----------
    triangles, vertices : int
    open_edges : int
        Used more often one way than the other: at these the surface is not closed, or turned inside out.
    manifold : bool
        Whether every edge is used exactly once each way.
    low, high : ndarray, shape (3,)
        Corners of the bounding box, in mm.
    area : float
        In mm2.
    volumes : ndarray, shape (shells,)
        Signed, in mm3; the largest in size first. Of no meaning where a shell is not closed.
    inwards, inside : ndarray of bool, shape (shells,)
        Which shells are closed and turned inwards, and whether another goes round these.
    """

    triangles: int
    vertices: int
    open_edges: int
    manifold: bool
    low: Floats
    high: Floats
    area: float
    volumes: Floats
    inwards: Booleans
    inside: Booleans

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def closed(self) -> bool:
        """Tell whether every edge is used as often one way as the other: then there is an inside."""
        return self.open_edges == 0

    @property
    def volume(self) -> float:
        """Of all shells together, in mm3."""
        return float(self.volumes.sum())

    @property
    def pieces(self) -> int:
        """Bodies that no edge joins: all shells but those turned inwards."""
        return int(np.sum(~self.inwards))

    @property
    def trapped_voids(self) -> int:
        """Shells turned inwards, inside another."""
        return int(np.sum(self.inwards & self.inside))

    @property
    def inside_out(self) -> int:
        """Shells turned inwards that no other goes round."""
        return int(np.sum(self.inwards & ~self.inside))


def unmatched_edges(triangles: NDArray[np.integer]) -> int:
    """Count edges that are not used by two triangles, once each way; none of a closed surface that is a manifold.

    Parameters
    ----------
    triangles : ndarray of int, shape (triangles, 3)

    Examples
    --------
    >>> tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    >>> unmatched_edges(tetrahedron), unmatched_edges(tetrahedron[1:])
    (0, 3)
    """
    facets = np.asarray(triangles, dtype=np.int64)
    keys, forward = _edge_keys(facets)
    # The way an edge is run is its key's last digit: of a closed manifold all keys follow one another in pairs.
    both = np.sort(2 * keys + forward)
    back, ahead = both[::2], both[1::2]
    if len(both) % 2 == 0 and np.all(back % 2 == 0) and np.all(ahead == back + 1) and np.all(np.diff(back) > 0):
        return 0
    _, _, one_way, uses = edge_uses(facets)
    return int(np.sum((uses != 2) | (one_way != 1)))


def _edge_keys(facets: Integers) -> tuple[Integers, Booleans]:
    """Number of the edge that begins at every corner, the same both ways, and whether it runs to a higher corner."""
    start, end = facets.ravel(), facets[:, [1, 2, 0]].ravel()
    low, high = np.minimum(start, end), np.maximum(start, end)
    return low * (int(facets.max(initial=0)) + 1) + high, start < end


def edge_uses(facets: Integers) -> tuple[Integers, Integers, Integers, Integers]:
    """Edges of triangles and their uses.

    Returns
    -------
    order : ndarray of int, shape (3 triangles,)
        Corners at which edges begin, three a triangle, so that the uses of one edge follow one another.
    first : ndarray of int, shape (edges,)
        Where the uses of each edge begin there.
    one_way, uses : ndarray of int, shape (edges,)
        How often each is used from its lower to its higher corner, and in all.
    """
    keys, forward = _edge_keys(facets)
    order = np.argsort(keys, kind="stable")
    first = np.flatnonzero(np.diff(keys[order], prepend=-1))
    one_way, uses = np.add.reduceat(forward[order].astype(np.int64), first), np.diff(np.append(first, len(order)))
    return order, first, one_way, uses


def _neighbours(owner: Integers, first: Integers) -> tuple[Integers, Integers]:
    """Pairs of triangles that use one edge, where uses of one follow one another."""
    same = np.ones(max(len(owner) - 1, 0), dtype=np.bool_)
    same[first[1:] - 1] = False
    return owner[:-1][same], owner[1:][same]


def shell_labels(triangles: NDArray[np.integer]) -> Integers:
    """Label of the shell, of what is connected by edges, that each triangle is a part of.

    Parameters
    ----------
    triangles : ndarray of int, shape (triangles, 3)

    Returns
    -------
    ndarray of int, shape (triangles,)

    Examples
    --------
    >>> shell_labels(np.array([[0, 1, 2], [3, 4, 5], [2, 1, 6]]))
    array([0, 1, 0])
    """
    facets = np.asarray(triangles, dtype=np.int64)
    order, first, *_ = edge_uses(facets)
    return connected(len(facets), *_neighbours(order // 3, first))


def triangle_measures(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> TriangleMeasures:
    """Measure triangles: their size, whether they close, and what they enclose.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm; no two alike, for triangles are connected by their vertices' numbers.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.

    Returns
    -------
    TriangleMeasures
    """
    points, facets = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    order, first, one_way, uses = edge_uses(facets)
    owner = order // 3
    labels = connected(len(facets), *_neighbours(owner, first))
    opened = 2 * one_way != uses
    volumes = np.bincount(labels, signed_volumes(points, facets)).astype(np.float64)
    closed = np.bincount(labels[owner[first[opened]]], minlength=len(volumes)) == 0
    ranked = np.argsort(-np.abs(volumes), kind="stable")
    inwards = (closed & (volumes < 0))[ranked]
    # There may be thousands of loose pieces, and each question takes all triangles: only voids are asked.
    inside = np.zeros(len(ranked), dtype=np.bool_)
    for place in np.flatnonzero(inwards).tolist():
        inside[place] = _inside_another(points, facets, labels, int(ranked[place]))
    used = np.unique(facets)
    a, b, c = np.moveaxis(points[facets], 1, 0)
    return TriangleMeasures(
        triangles=len(facets),
        vertices=len(used),
        open_edges=int(np.sum(opened)),
        manifold=bool(np.all((uses == 2) & (one_way == 1))),
        low=points[used].min(axis=0),
        high=points[used].max(axis=0),
        area=float(np.sum(np.linalg.norm(np.cross(b - a, c - a), axis=1)) / 2),
        volumes=volumes[ranked],
        inwards=inwards,
        inside=inside,
    )


def _inside_another(points: Floats, triangles: Integers, labels: Integers, shell: int) -> bool:
    """Tell whether another shell goes round one: by the winding number of the others about a point of it.

    Solid angles of triangles as of van Oosterom and Strackee (IEEE Trans. Biomed. Eng. 30, 1983).
    """
    others = labels != shell
    point = points[triangles[np.flatnonzero(~others)[0], 0]]
    a, b, c = np.moveaxis(points[triangles[others]] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(corner, axis=1) for corner in (a, b, c))
    flat = la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb
    angles = 2 * np.arctan2(dot(a, np.cross(b, c)), flat)
    # Shell by shell: what one encloses another may exclude.
    winding = np.bincount(labels[others], angles, minlength=int(labels.max()) + 1) / _SPHERE
    return bool(np.any(np.rint(winding) != 0))


# A ray starts so far inside, as a part of the solid's size: beyond rounding, and far below any wall.
_STARTS_INSIDE = 1e-6
_ROUNDING = 1e-12
# How near a line must pass a triangle to meet it, as a part of the solid's size: with none VTK misses some.
_MEETS = 1e-9
# A wall has two sides that face away from each other, within 45 degrees; tips and edges, which run out to nothing, have
# not.
_FACING_AWAY = -np.sqrt(0.5)
# Sides at less than this angle run out to a sharp edge.
_SHARP = np.radians(80)
# Beside an edge the solid is as thick as the angle makes it, by the distance to the edge; where its sides are curved,
# so many times less. Further off than so many walls it is thin for its own sake, as a blade of 14 degrees is.
_BESIDE_EDGE, _WALLS_AWAY = 2.5, 4.0
# How far points of edges are apart, as a part of the solid's size, and how many of them a place looks at.
_EDGE_STEP, _EDGES_NEARBY = 0.005, 8


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
        degrees, and not where the solid runs out to a sharp edge.

    Raises
    ------
    GyroidError
        If VTK is not installed.
    """
    points, facets = np.array(vertices, dtype=float, order="C"), np.array(triangles, dtype=np.int64, order="C")
    core = vtk_module("vtkCommonCore")
    locator = locator_of(points, facets)
    starts, inward, normals = surface_places(points, facets, places)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    starts = starts + _STARTS_INSIDE * size * inward
    found, at = [], []
    for number, (start, direction) in enumerate(zip(starts, inward, strict=True)):
        part, place, local, sub, cell = core.mutable(0.0), [0.0] * 3, [0.0] * 3, core.mutable(0), core.mutable(-1)
        met = locator.IntersectWithLine(start, start + size * direction, _MEETS * size, part, place, local, sub, cell)
        if met and -direction @ normals[int(cell)] < _FACING_AWAY:
            found.append(float(part) * size)
            at.append(number)
    walls = np.array(found) + _STARTS_INSIDE * size
    return np.sort(walls[~_run_out(points, facets, normals, starts[at], walls)])


def _run_out(points: Floats, facets: Integers, normals: Floats, places: Floats, walls: Floats) -> Booleans:
    """Tell which walls were measured where the solid runs out to a sharp edge: that is as thin as one looks for.

    From a place beside an edge of angle a the other side is seen at tan(a) times the distance to the edge.
    """
    from scipy.spatial import cKDTree

    ends, slopes = _sharp_edges(points, facets, normals)
    if not len(ends) or not len(walls):
        return np.zeros(len(walls), dtype=np.bool_)
    along = ends[:, 1] - ends[:, 0]
    # Points of edges find those nearby: of long ones there must be many.
    counts = np.ceil(np.linalg.norm(along, axis=1) / (_EDGE_STEP * np.ptp(points, axis=0).max())).astype(np.int64)
    edge, step = numbered_groups(counts)
    part = (step + 0.5) / counts[edge]
    _, near = cKDTree(ends[edge, 0] + part[:, np.newaxis] * along[edge]).query(places, min(_EDGES_NEARBY, len(edge)))
    near = edge[near.reshape(len(places), -1)]
    offset = places[:, np.newaxis] - ends[near, 0]
    part = np.clip(dot(offset, along[near]) / dot(along[near], along[near]), 0, 1)
    distance = np.linalg.norm(offset - part[..., np.newaxis] * along[near], axis=-1)
    reach = np.minimum(_BESIDE_EDGE / slopes[near], _WALLS_AWAY) * walls[:, np.newaxis]
    return np.asarray(np.any(distance < reach, axis=1))


def _sharp_edges(points: Floats, facets: Integers, normals: Floats) -> tuple[Floats, Floats]:
    """Ends of the edges at which a solid's sides meet sharply, shape (n, 2, 3), and the tangents of their angles."""
    edges = np.stack([facets, np.roll(facets, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys = edges.min(axis=1) * len(points) + edges.max(axis=1)
    order = np.argsort(keys, kind="stable")
    pair = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    one, other = order[pair], order[pair + 1]
    # The corner of the one triangle that is not on the edge lies behind the other triangle where the edge is convex.
    apex = points[facets[one // 3, (one + 2) % 3]]
    cosine = -dot(normals[one // 3], normals[other // 3])
    convex = dot(apex - points[edges[one, 0]], normals[other // 3]) < 0
    sharp = convex & (cosine > np.cos(_SHARP)) & (edges[one, 0] != edges[one, 1])
    cosine = np.minimum(cosine[sharp], 1 - _ROUNDING)
    return points[edges[one[sharp]]], np.sqrt(1 - cosine**2) / cosine


def surface_places(points: Floats, triangles: Integers, count: int) -> tuple[Floats, Floats, Floats]:
    """Places spread evenly over a surface, by a generator that always starts alike.

    Parameters
    ----------
    points : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.
    count : int

    Returns
    -------
    places, inward : ndarray, shape (count, 3)
        In mm, and the unit normals into the solid there.
    normals : ndarray, shape (triangles, 3)
        Unit normals out of the solid, of all triangles.
    """
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

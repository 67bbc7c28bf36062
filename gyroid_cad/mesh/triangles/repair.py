"""Triangles of files as they come: what is wrong with them, and bodies made of them all the same."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from gyroid_cad.common.graph import connected
from gyroid_cad.mesh.triangles.booleans import Body, body_of, united

__all__ = ["Hole", "holes_of", "mended", "sound_body"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Corners nearer to each other are one, in parts of the part's size: above rounding in text of five digits.
_WELDED = 1e-5


@dataclass(frozen=True, slots=True)
class Hole:
    """Edges of triangles that no other triangle shares, connected to each other."""

    edges: int
    place: tuple[float, float, float]

    def __str__(self) -> str:
        place = ", ".join(f"{round(coordinate, 3) + 0.0:g}" for coordinate in self.place)
        return f"{self.edges} edges round ({place})"


def holes_of(vertices: Floats, triangles: Integers) -> list[Hole]:
    """Holes of triangles, the one with the most edges first.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]])
    >>> [str(hole) for hole in holes_of(corners, sides)]
    ['3 edges round (0.333, 0.333, 0.333)']
    """
    edges, label = _open_edges(triangles, len(vertices))
    found = []
    for number in range(int(label.max(initial=-1)) + 1):
        own = edges[label == number]
        x, y, z = vertices[np.unique(own)].mean(axis=0).tolist()
        found.append(Hole(len(own), (x, y, z)))
    return sorted(found, key=lambda hole: -hole.edges)


def _open_edges(triangles: Integers, count: int) -> tuple[Integers, Integers]:
    """Edges that are used more often one way than the other, as they are used, and the hole of each."""
    edges = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    keys, back = edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0]
    order = np.argsort(keys, kind="stable")
    own, first, uses = np.unique(keys[order], return_index=True, return_counts=True)
    others = back[order][first]
    where = np.searchsorted(own, others).clip(max=max(len(own) - 1, 0))
    reverse = np.where(own[where] == others, uses[where], 0)
    found = np.repeat(edges[order][first], np.maximum(uses - reverse, 0), axis=0)
    corners, numbers = np.unique(found, return_inverse=True)
    ends = numbers.reshape(-1, 2)
    return found, connected(len(corners), ends[:, 0], ends[:, 1])[ends[:, 0]] if len(found) else np.empty(0, np.int64)


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
    body = body_of(vertices, triangles) or body_of(*_parted(vertices, triangles))
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


def _parted(vertices: Floats, triangles: Integers) -> tuple[Floats, Integers]:
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
    triangles, turned = _turned_alike(triangles[np.sort(first)])
    remarks = [
        f"{_counted(number, what)} {done}"
        for number, what, done in ((welded, "corner", "welded"), (turned, "triangle", "turned"))
        if number
    ]
    holes = holes_of(vertices, triangles)
    if holes:
        remarks.append(f"{_counted(len(holes), 'hole')} closed, {'the largest of ' * (len(holes) > 1)}{holes[0]}")
    body, more = sound_body(*_closed(vertices, triangles))
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


def _closed(vertices: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Holes closed by triangles from their edges to their middles."""
    edges, label = _open_edges(triangles, len(vertices))
    if not len(edges):
        return vertices, triangles
    ends = np.bincount(label).astype(float)[:, np.newaxis]
    middles = np.stack([np.bincount(label, vertices[edges[:, 0], k]) for k in range(3)], axis=1) / ends
    fans = np.column_stack([edges[:, ::-1], len(vertices) + label])
    return np.concatenate([vertices, middles]), np.concatenate([triangles, fans])

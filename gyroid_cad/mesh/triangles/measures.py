"""What triangles amount to: their size, whether they close, and what they enclose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.wall.complex import connected

__all__ = ["TriangleMeasures", "triangle_measures"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class TriangleMeasures:
    """What triangles amount to.

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
        That hang together by vertices.
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
    """What triangles are: their size, whether they close, and what they enclose.

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

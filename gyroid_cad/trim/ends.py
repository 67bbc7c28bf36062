"""Beginnings and ends of curves: nodes on rims of the wall and on edges of the part, as each pair of faces has them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import by_number
from gyroid_cad.errors import KernelError
from gyroid_cad.trim.edge_crossings import square_points
from gyroid_cad.trim.lattice_faces import Pairs
from gyroid_cad.trim.nodes import PartNodes, RimNodes
from gyroid_cad.trim.paths import Ends, Paths
from gyroid_cad.trim.sections import level_step

__all__ = ["ends_of", "halved"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of the sides of the square.
_INWARDS = np.array([[0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [1.0, 0.0]])
# Steps of Newton's method by which an end comes to the curve.
_PULLS = 6


def ends_of(
    pairs: Pairs, rims: Integers, forward: Booleans, rim_nodes: RimNodes, part_nodes: PartNodes
) -> tuple[Ends, dict[tuple[int, int, bool], int]]:
    """The ends of all curves, and on which of a face's coedges those on edges of the part lie.

    Parameters
    ----------
    pairs : Pairs
    rims : ndarray of int, shape (faces, 4)
    forward : ndarray of bool, shape (faces, 4)
        As of :func:`~gyroid_cad.trim.nodes.rim_nodes`.
    rim_nodes : RimNodes
    part_nodes : PartNodes
        Numbered after those of the rims.

    Returns
    -------
    ends : Ends
    coedges : dict
        By node, face of the part, and whether a curve begins there.

    Raises
    ------
    KernelError
        If a node lies on a face whose partner does not come near it.
    """
    pair_of = {pair: k for k, pair in enumerate(zip(pairs.face.tolist(), pairs.part.tolist(), strict=True))}
    rows: list[tuple[float, ...]] = []
    entering: list[bool] = []
    places_of = by_number(rims)
    for node, (rim, part) in enumerate(zip(rim_nodes.rim.tolist(), rim_nodes.part.tolist(), strict=True)):
        for flat in places_of[rim]:
            face, side = divmod(flat, 4)
            along = rim_nodes.along[node] * (1 if forward[face, side] else -1)
            u, v = square_points(side, np.array(along))
            rows.append((_known(pair_of, face, part), node, side, float(u), float(v), *rim_nodes.places[node]))
            entering.append(False)
    coedges = {}
    for node, (edge, face) in enumerate(
        zip(part_nodes.edge.tolist(), part_nodes.face.tolist(), strict=True), len(rim_nodes.rim)
    ):
        index = node - len(rim_nodes.rim)
        for part, number in pairs.boundary.users[edge]:
            coedge = pairs.boundary.faces[part].coedges[number]
            near = coedge.curve(part_nodes.along[[index]])[0][0]
            # The curve runs along n x N, where the wall's normal is n and the part's N; and N x d points into the face
            # from its border d: so whether it runs into the face is told by n . d.
            rises = bool(part_nodes.upwards[index]) == coedge.forward
            into = rises != (pairs.boundary.faces[part].sign > 0)
            rows.append((_known(pair_of, face, part), node, -1, *part_nodes.places[index], *near))
            entering.append(into)
            coedges[node, part, into] = number
    table = np.array(rows).reshape(-1, 7)
    numbers = table[:, :3].astype(np.int64)
    ends = Ends(numbers[:, 0], numbers[:, 1], table[:, 3:5], table[:, 5:], np.array(entering, dtype=bool))
    return _settled(pairs, ends, numbers[:, 2]), coedges


def _known(pair_of: dict[tuple[int, int], int], face: int, part: int) -> int:
    pair = pair_of.get((face, part))
    if pair is None:
        raise KernelError("an edge crosses a face that it does not come near")
    return pair


def _settled(pairs: Pairs, ends: Ends, side: Integers) -> Ends:
    """Ends on rims told as beginnings or not; those on edges pulled to it: an edge need not quite lie on its faces."""
    places, near, entering = ends.places, ends.near, ends.entering
    on_rim = side >= 0
    for step in range(_PULLS):
        height, slopes, where, _ = pairs.heights(ends.pair, places[:, :1], places[:, 1:], near[:, None])
        near, slope = where[:, 0], slopes[:, 0]
        if step == 0:
            onward = np.stack([slope[:, 1], -slope[:, 0]], axis=-1)
            entering = np.where(on_rim, np.sum(onward * _INWARDS[side], axis=1) > 0, entering)
        places = np.where(on_rim[:, None], places, places + level_step(height[:, 0], slope))
    return Ends(ends.pair, ends.node, places, near, entering)


def halved(closed: Paths, pairs: Pairs, first: int) -> tuple[Paths, list[Floats]]:
    """Closed curves in two halves between two nodes of their own, numbered from a first one; and the nodes' points."""
    numbers: list[tuple[int, int, int]] = []
    places: list[Floats] = []
    near: list[Floats] = []
    points: list[Floats] = []
    for pair, square, part in zip(closed.pair.tolist(), closed.places, closed.near, strict=True):
        middle = len(square) // 2
        start = first + len(points)
        both = square[[0, middle]]
        points += list(pairs.heights(np.array([pair, pair]), both[:, :1], both[:, 1:])[3][:, 0])
        numbers += [(pair, start, start + 1), (pair, start + 1, start)]
        places += [square[: middle + 1], square[middle:]]
        near += [part[: middle + 1], part[middle:]]
    pairs_of, starts, ends = np.array(numbers, dtype=np.int64).reshape(-1, 3).T
    return Paths(pairs_of, starts, ends, places, near), points

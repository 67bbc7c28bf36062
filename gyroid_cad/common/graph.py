"""Connected components of graphs, and of graphs that repeat without end."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["connected", "runs_on"]

Integers = NDArray[np.int64]


def connected(count: int, first: Integers, second: Integers) -> Integers:
    """Label the connected components of a graph.

    All joined nodes take the lowest of their labels until no edge joins two, and chains of labels are followed to
    their ends in between (Shiloach and Vishkin, J. Algorithms 3, 1982). ``scipy.sparse.csgraph`` does the same up to
    twice as fast, but to import it takes 0.2 s, more than to build a lattice of some cells.

    Parameters
    ----------
    count : int
        Of nodes.
    first, second : ndarray of int, shape (edges,)
        The nodes that each edge joins.

    Returns
    -------
    ndarray of int, shape (count,)
        From 0, in the order of the components' lowest nodes.

    Examples
    --------
    >>> connected(5, np.array([4, 1]), np.array([0, 3]))
    array([0, 1, 2, 1, 0])
    """
    label = np.arange(count)
    while True:
        ends = np.stack([label[first], label[second]])
        apart = ends[0] != ends[1]
        if not np.any(apart):
            return np.unique(label, return_inverse=True)[1].ravel().astype(np.int64)
        first, second = first[apart], second[apart]
        # Every component but those lower than all their neighbours joins one of the lower ones: never in a circle.
        label[ends[:, apart].max(axis=0)] = ends[:, apart].min(axis=0)
        while np.any((further := label[label]) != label):
            label = further


def runs_on(count: int, first: Integers, second: Integers, cells: Integers) -> bool:
    """Tell whether some component of a graph that repeats in all directions leads from a node to its image elsewhere.

    Parameters
    ----------
    count : int
        Of the nodes in one cell.
    first, second : ndarray of int, shape (edges,)
        The nodes that each edge joins.
    cells : ndarray of int, shape (edges, 3)
        In which cell, counted from that of the first node, the second one lies.

    Examples
    --------
    >>> ring = np.array([[0, 0, 0], [1, 0, 0]])
    >>> runs_on(2, np.array([0, 1]), np.array([1, 0]), ring)
    True
    >>> runs_on(2, np.array([0, 1]), np.array([1, 0]), 0 * ring)
    False
    """
    crossing = cells.any(axis=1)
    label = connected(count, first[~crossing], second[~crossing])
    ways = np.column_stack([label[first], label[second], cells])[crossing]
    links: dict[int, list[tuple[int, ...]]] = {}
    for one, other, *step in np.unique(ways, axis=0).tolist():
        links.setdefault(one, []).append((other, *step))
        links.setdefault(other, []).append((one, *(-along for along in step)))
    where: dict[int, tuple[int, ...]] = {}
    for start in links:
        waiting = [] if start in where else [start]
        where.setdefault(start, (0, 0, 0))
        while waiting:
            here = waiting.pop()
            for other, *step in links[here]:
                place = tuple(a + b for a, b in zip(where[here], step, strict=True))
                if other not in where:
                    waiting.append(other)
                if where.setdefault(other, place) != place:
                    return True
    return False

"""Arrays that cannot be written to, products of many vectors at once, and what has the same number."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Point",
    "by_number",
    "cross",
    "dot",
    "freeze_arrays",
    "grouped",
    "numbered_groups",
    "signed_volumes",
    "unit",
]

# As users give it, and reports tell it.
Point = tuple[float, float, float]


def freeze_arrays(instance: Any) -> None:
    """Replace every array of a frozen dataclass by a C-ordered copy that cannot be written to.

    Parameters
    ----------
    instance : dataclass instance
        Called from its ``__post_init__``.
    """
    for field in fields(instance):
        value = getattr(instance, field.name)
        if isinstance(value, np.ndarray):
            stored = np.array(value, order="C")
            stored.setflags(write=False)
            object.__setattr__(instance, field.name, stored)


def cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vector products, components first: several times quicker than ``numpy.cross``."""
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Scalar products of vectors along the last axis (``numpy.vecdot``, which numpy 1.26 does not have)."""
    return np.asarray(np.sum(a * b, axis=-1))


def signed_volumes(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """Volumes between triangles and the middle of all vertices: of closed ones they add up to what is inside.

    From there, and not from the origin, triangles far away lose no digits.

    >>> sides = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    >>> round(float(signed_volumes(np.vstack([np.zeros(3), np.eye(3)]), sides).sum()), 9)
    0.166666667
    """
    a, b, c = np.moveaxis(vertices[triangles] - vertices.mean(axis=0), 1, 0)
    return np.asarray(dot(a, np.cross(b, c)) / 6)


def unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors along the last axis; zero where there is no length.

    >>> unit(np.array([[3.0, 4.0], [0.0, 0.0]]))
    array([[0.6, 0.8],
           [0. , 0. ]])
    """
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny))


def numbered_groups(counts: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Members of groups of so many each: the group of each member, and its number in there.

    >>> [some.tolist() for some in numbered_groups(np.array([2, 0, 3]))]
    [[0, 0, 2, 2, 2], [0, 1, 0, 1, 2]]
    """
    group = np.repeat(np.arange(len(counts)), counts)
    return group, np.arange(len(group)) - np.repeat(np.cumsum(counts) - counts, counts)


def grouped(numbers: NDArray[np.int64]) -> list[tuple[int, NDArray[np.int64]]]:
    """Distinct numbers, each with where it stands.

    >>> [(number, where.tolist()) for number, where in grouped(np.array([7, 3, 7]))]
    [(3, [1]), (7, [0, 2])]
    """
    if not len(numbers):
        return []
    order = np.argsort(numbers, kind="stable")
    distinct, first = np.unique(numbers[order], return_index=True)
    return list(zip(distinct.tolist(), np.split(order, first[1:]), strict=True))


def by_number(numbers: NDArray[np.int64]) -> dict[int, list[int]]:
    """Positions of each number, in order.

    >>> by_number(np.array([7, 3, 7]))
    {7: [0, 2], 3: [1]}
    """
    found: dict[int, list[int]] = {}
    for position, number in enumerate(numbers.ravel().tolist()):
        found.setdefault(number, []).append(position)
    return found

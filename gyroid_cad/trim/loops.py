"""Closed loops: links joined end to end, which loops are holes in which, and polygons' areas."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError

__all__ = ["contains", "decided", "linked", "nested", "signed_area", "within_polygons"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places times sides that are looked at together.
_AT_ONCE = 2**21


class _Link(Protocol):
    @property
    def start(self) -> Hashable: ...

    @property
    def end(self) -> Hashable: ...


Link = TypeVar("Link", bound=_Link)


def linked(links: Sequence[Link], of: str) -> list[list[Link]]:
    """Links, each from a start to an end, as closed loops.

    Parameters
    ----------
    links : sequence
        Each with a ``start`` and an ``end``.
    of : str
        What they bound a remainder of, for the message.

    Raises
    ------
    KernelError
        If they do not link up one for one.
    """
    onward = {link.start: link for link in links}
    if len(onward) < len(links) or onward.keys() != {link.end for link in links}:
        raise KernelError(f"what the box leaves of {of} does not close")
    loops = []
    while onward:
        loop = [onward.pop(next(iter(onward)))]
        while loop[-1].end != loop[0].start:
            loop.append(onward.pop(loop[-1].end))
        loops.append(loop)
    return loops


def nested(outlines: Sequence[Floats]) -> list[list[int]]:
    """Outlines (k, 2) that run round what they bound, each with those of its holes.

    Raises
    ------
    KernelError
        If a hole lies in nothing.
    """
    areas = np.array([signed_area(outline) for outline in outlines])
    groups = {index: [index] for index in np.flatnonzero(areas > 0).tolist()}
    for hole in np.flatnonzero(areas <= 0).tolist():
        around = [index for index in groups if contains(outlines[index], outlines[hole][0])]
        if not around:
            raise KernelError("a hole in a face that the box has cut lies in none of its pieces")
        groups[min(around, key=lambda index: float(areas[index]))].append(hole)
    return list(groups.values())


def signed_area(outline: Floats) -> float:
    """Area in a polygon, shape (k, 2), that runs anticlockwise."""
    x, y = outline.T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2)


def contains(outline: Floats, place: Floats) -> bool:
    """Tell whether a point, shape (2,), lies in a polygon, shape (k, 2): by the crossings of a ray."""
    x, y = (outline - place).T
    next_x, next_y = np.roll(x, -1), np.roll(y, -1)
    crosses = (y > 0) != (next_y > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        beyond = x - y * (next_x - x) / (next_y - y) > 0
    return bool(np.sum(crosses & beyond) % 2)


def within_polygons(places: Floats, start: Floats, end: Floats) -> tuple[Booleans, Floats]:
    """Mask of places that lie in polygons by the crossings of a ray, and how far each is from the nearest side.

    Parameters
    ----------
    places : ndarray, shape (n, 2)
    start, end : ndarray, shape (sides, 2)
        Of all polygons' sides.
    """
    inside, nearest = np.zeros(len(places), dtype=bool), np.zeros(len(places))
    (x0, y0), (x1, y1) = start.T, end.T
    squared = np.maximum((x1 - x0) ** 2 + (y1 - y0) ** 2, np.finfo(float).tiny)
    count = max(1, _AT_ONCE // len(start))
    for first in range(0, len(places), count):
        some = slice(first, first + count)
        x, y = places[some, 0, np.newaxis], places[some, 1, np.newaxis]
        with np.errstate(divide="ignore", invalid="ignore"):
            beyond = x0 + (y - y0) / (y1 - y0) * (x1 - x0) > x
        inside[some] = np.count_nonzero(((y0 > y) != (y1 > y)) & beyond, axis=1) % 2 == 1
        along = np.clip(((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / squared, 0, 1)
        nearest[some] = np.hypot(x0 + along * (x1 - x0) - x, y0 + along * (y1 - y0) - y).min(axis=1)
    return inside, nearest


def decided(
    count: int, start: Integers, end: Integers, told: Booleans, ask: Callable[[Integers], Booleans]
) -> Booleans:
    """Return which of some corners are inside: those joined by an edge that nothing crosses are alike.

    Parameters
    ----------
    count : int
    start, end : ndarray of int
        Of such edges.
    told : ndarray of bool, shape (2, count)
        Whether a crossing tells that a corner is outside, or inside.
    ask : callable
        For corners of which no crossing tells.
    """
    group = connected(count, start, end)
    groups = int(group.max(initial=-1)) + 1
    said = np.stack([np.bincount(group, told[k], groups) > 0 for k in (0, 1)])
    if np.any(said.all(axis=0)):
        raise KernelError("the crossings of lattice and part do not agree on what is inside")
    inside = said[1]
    unknown = np.flatnonzero(~said.any(axis=0))
    if len(unknown):
        first = np.full(groups, -1)
        first[group[::-1]] = np.arange(count)[::-1]
        inside[unknown] = ask(first[unknown])
    return np.asarray(inside[group])

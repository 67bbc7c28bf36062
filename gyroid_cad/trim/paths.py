"""Curves in which faces of a wall cross those of a part, followed from node to node, or round to where they began.

A curve keeps what lies in the part on its left. It is followed in the wall's parameters by a predictor of second order,
in steps that shorten where it bends, each brought back to the curve by Newton's method.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from scipy.spatial import cKDTree

from gyroid_cad.common.arrays import by_number, grouped
from gyroid_cad.errors import KernelError
from gyroid_cad.trim.lattice_faces import GRID, Pairs
from gyroid_cad.trim.sections import level_step

__all__ = ["Ends", "Paths", "closed_paths", "open_paths"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In the square, whose sides are 2 long; shorter ones where curves come too near each other.
_STEPS = (0.1, 0.02, 0.004)
_LONGEST = 12.0
_SHORTEST = 1e-5
# Between the directions at both ends of a step, in radians: a longer one is taken back, one of a third leads to longer.
_TURN = 0.35
# Of a step: so far aside of it a node may lie to end there, and so far Newton's method may move its end.
_ASIDE, _ASTRAY = 0.08, 0.25
# At most so often that end is moved: until it is on the curve; near enough in the end, in parts of a step.
_CORRECTIONS, _ON, _NEAR = 3, 1e-6, 1e-3
_OUT = 1.1
# Steps of the grid between places that are looked at first.
_COARSE = 4


@dataclass(frozen=True, slots=True, eq=False)
class Ends:
    """Nodes at which curves of pairs begin or end.

    Attributes
    ----------
    pair : ndarray of int, shape (ends,)
    node : ndarray of int, shape (ends,)
        Whatever they are known by.
    places : ndarray, shape (ends, 2)
        In the square.
    near : ndarray, shape (ends, 2)
        Parameters of the part's face.
    entering : ndarray of bool, shape (ends,)
        Whether a curve begins there.
    """

    pair: Integers
    node: Integers
    places: Floats
    near: Floats
    entering: Booleans


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Curves as they were followed.

    Attributes
    ----------
    pair : ndarray of int, shape (paths,)
    start, end : ndarray of int, shape (paths,)
        Nodes; -1 for a curve that closes.
    places : list of ndarray, shape (k, 2)
        In the square.
    near : list of ndarray, shape (k, 2)
        Parameters of the part's face.
    """

    pair: Integers
    start: Integers
    end: Integers
    places: list[Floats]
    near: list[Floats]


def open_paths(pairs: Pairs, ends: Ends) -> Paths:
    """Follow curves from the nodes where they begin to those where they end.

    Raises
    ------
    KernelError
        If the nodes of a pair are not joined one for one.
    """
    starts, stops = np.flatnonzero(ends.entering), np.flatnonzero(~ends.entering)
    balance = np.bincount(ends.pair[starts], minlength=len(pairs.face)) - np.bincount(
        ends.pair[stops], minlength=len(pairs.face)
    )
    if np.any(balance):
        raise KernelError("a curve where the lattice crosses the part begins and does not end")
    reached = np.full(len(starts), -1)
    places: list[Floats] = [np.zeros((0, 2))] * len(starts)
    near: list[Floats] = [np.zeros((0, 2))] * len(starts)
    left = np.arange(len(starts))
    for step in _STEPS:
        if not len(left):
            break
        at, found, found_near = _followed(pairs, ends, starts[left], stops, step)
        for index, path in enumerate(left.tolist()):
            reached[path], places[path], near[path] = at[index], found[index], found_near[index]
        # Of curves that came to one end all of the pair are followed again, in smaller steps.
        uses = np.bincount(reached[reached >= 0], minlength=len(ends.pair))
        doubtful = np.zeros(len(pairs.face), dtype=bool)
        doubtful[ends.pair[starts[reached < 0]]] = True
        doubtful[ends.pair[np.flatnonzero(uses > 1)]] = True
        left = np.flatnonzero(doubtful[ends.pair[starts]])
    if len(left):
        raise KernelError("a curve where the lattice crosses the part cannot be followed")
    return Paths(ends.pair[starts], ends.node[starts], ends.node[reached], places, near)


def _followed(
    pairs: Pairs, ends: Ends, starts: Integers, stops: Integers, longest: float
) -> tuple[Integers, list[Floats], list[Floats]]:
    """Ends that curves come to (-1 if to none), places along them, and those of the part's faces."""
    targets = _padded(ends, starts, stops)
    place, near = ends.places[starts].copy(), ends.near[starts].copy()
    paths, nears = [[one] for one in ends.places[starts]], [[one] for one in ends.near[starts]]
    reached = np.full(len(starts), -1)
    live, step = np.arange(len(starts)), np.full(len(starts), longest)
    travelled = np.zeros(len(starts))
    onward, _, near = _onward(pairs, ends.pair[starts], place, near)
    for _ in range(int(8 * _LONGEST / longest)):
        if not len(live):
            break
        pair = ends.pair[starts[live]]
        tried, there, tried_near, sound = _step(pairs, pair, place[live], onward[live], near[live], step[live])
        turn = np.arccos(np.clip(np.sum(onward[live] * there, axis=1), -1, 1))
        good = sound & (turn < _TURN)
        short = live[~good]
        step[short] /= 2
        go = live[good]
        # On a surface that closes on itself a curve ends where the next one begins.
        own = (travelled[go] == 0)[:, None] & (ends.node[targets[go]] == ends.node[starts[go]][:, None])
        hit = _hit(np.where(own, -1, targets[go]), place[go], tried[good], step[go], ends)
        reached[go] = hit
        done = (hit >= 0)[:, None]
        for path, square, part in zip(
            go.tolist(),
            np.where(done, ends.places[hit], tried[good]),
            np.where(done, ends.near[hit], tried_near[good]),
            strict=True,
        ):
            paths[path].append(square)
            nears[path].append(part)
        travelled[go] += step[go]
        place[go], onward[go], near[go] = tried[good], there[good], tried_near[good]
        step[go] = np.where(turn[good] < _TURN / 3, np.minimum(1.5 * step[go], longest), step[go])
        out = np.abs(place).max(axis=1) > _OUT
        lost = out | (travelled > _LONGEST) | (step < _SHORTEST)
        live = live[(reached[live] < 0) & ~lost[live]]
    return reached, [np.array(path) for path in paths], [np.array(some) for some in nears]


def _padded(ends: Ends, starts: Integers, stops: Integers) -> Integers:
    """For each start the stops of its pair, -1 where there are no more; shape (starts, most)."""
    order = stops[np.argsort(ends.pair[stops], kind="stable")]
    first = np.searchsorted(ends.pair[order], ends.pair[starts], side="left")
    count = np.searchsorted(ends.pair[order], ends.pair[starts], side="right") - first
    which = np.arange(max(1, int(count.max(initial=1))))
    index = np.minimum(first[:, None] + which, max(len(order) - 1, 0))
    return np.where(which < count[:, None], order[index], -1)


def _onward(
    pairs: Pairs, pair: Integers, place: Floats, near: Floats, tangent: bool = False
) -> tuple[Floats, Floats, Floats]:
    """The unit direction that keeps what lies deeper on its left, and the step of Newton's method to the curve."""
    height, slopes, where, _ = pairs.heights(pair, place[:, :1], place[:, 1:], near[:, None], tangent)
    slope, height = slopes[:, 0], height[:, 0]
    steepness = np.maximum(np.sum(slope * slope, axis=1), np.finfo(float).tiny)
    turned = np.stack([slope[:, 1], -slope[:, 0]], axis=-1) / np.sqrt(steepness)[:, None]
    return turned, level_step(height, slope), where[:, 0]


def _step(
    pairs: Pairs, pair: Integers, place: Floats, onward: Floats, near: Floats, length: Floats
) -> tuple[Floats, Floats, Floats, Booleans]:
    """Places a step further, directions there, places of the part's faces, and whether they are to be trusted."""
    half, _, near_half = _onward(pairs, pair, place + length[:, None] / 2 * onward, near)
    tried, there, near_there = place + length[:, None] * half, half, near_half
    moved, off, left = np.zeros(len(place)), np.zeros(len(place)), np.arange(len(place))
    for correction in range(_CORRECTIONS + 1):
        there[left], back, near_there[left] = _onward(pairs, pair[left], tried[left], near_there[left], tangent=True)
        off[left] = np.linalg.norm(back, axis=1)
        moved[left] = np.maximum(moved[left], off[left])
        far = off[left] >= _ON * length[left]
        left, back = left[far], back[far]
        if correction == _CORRECTIONS or not len(left):
            break
        tried[left] += back * np.minimum(1.0, length[left] / off[left])[:, None]
    return tried, there, near_there, (moved < _ASTRAY * length) & (off < _NEAR * length)


def _hit(targets: Integers, before: Floats, after: Floats, step: Floats, ends: Ends) -> Integers:
    """The first target that lies on each step, -1 if none does."""
    if not len(targets):
        return np.zeros(0, dtype=np.int64)
    along = after - before
    squared = np.maximum(np.sum(along * along, axis=1), np.finfo(float).tiny)[:, None]
    away = ends.places[targets] - before[:, None]
    t = np.sum(away * along[:, None], axis=-1) / squared
    aside = np.linalg.norm(away - np.clip(t, 0, 1)[..., None] * along[:, None], axis=-1)
    on = (targets >= 0) & (t > 0) & (t <= 1 + _ASIDE) & (aside < _ASIDE * step[:, None])
    t = np.where(on, t, np.inf)
    first = np.argmin(t, axis=1)
    rows = np.arange(len(targets))
    return np.where(on[rows, first], targets[rows, first], -1)


def closed_paths(pairs: Pairs, known: Paths) -> Paths:
    """Find the curves that meet no node: those that close within a face.

    Places where a height changes its sign on a grid, and that no curve known before passes, are where they are begun.

    Raises
    ------
    KernelError
        If a curve that has no node does not close.
    """
    pair, place = _unexplained(pairs, known)
    found: list[tuple[int, Floats, Floats]] = []
    done: dict[int, list[Floats]] = {}
    for number, start in zip(pair.tolist(), place, strict=True):
        if any(np.linalg.norm(path - start, axis=1).min() < 2 / (GRID - 1) for path in done.get(number, [])):
            continue
        found.append((number, *_round(pairs, number, start)))
        done.setdefault(number, []).append(_dense(found[-1][1]))
    none = np.full(len(found), -1)
    numbers = np.array([number for number, _, _ in found], dtype=np.int64)
    return Paths(numbers, none, none, [places for _, places, _ in found], [near for _, _, near in found])


def _unexplained(pairs: Pairs, known: Paths) -> tuple[Integers, Floats]:
    """Pairs and places on curves within both faces that none of the known ones passes."""
    step = 2 / (GRID - 1)
    cells: list[Integers] = []
    by_pair = by_number(known.pair)
    chunk = 128
    faces, first = np.unique(pairs.face, return_index=True)
    bounds = np.append(first, len(pairs.face))
    for begin in range(0, len(faces), chunk):
        some = faces[begin : begin + chunk]
        points = pairs.faces.on_grid(some, GRID)
        rows = np.arange(bounds[begin], bounds[min(begin + chunk, len(faces))])
        above = _above(pairs, rows, points, np.searchsorted(some, pairs.face[rows]))
        mixed = above[:, :-1, :-1]
        changes = (mixed != above[:, 1:, :-1]) | (mixed != above[:, :-1, 1:]) | (mixed != above[:, 1:, 1:])
        changes &= _in_boxes(pairs, rows, points, np.searchsorted(some, pairs.face[rows]), changes)
        changes &= ~_passed(known, rows, by_pair, np.flatnonzero(changes.any(axis=(1, 2))))
        found = np.nonzero(changes)
        cells.append(np.stack([rows[found[0]], *found[1:]], axis=1))
    flat = np.concatenate(cells) if cells else np.zeros((0, 3), dtype=np.int64)
    middles: Floats = np.asarray(-1 + step * (flat[:, 1:] + 0.5))
    return _on_curves(pairs, flat[:, 0], middles, known, by_pair, step)


def _above(pairs: Pairs, rows: Integers, points: Floats, which: Integers) -> Booleans:
    """Signs of heights on a grid: looked at closely only where those of a coarser one leave a change possible."""
    coarse = points[:, ::_COARSE, ::_COARSE]
    reach = sum(np.linalg.norm(np.diff(coarse, axis=axis), axis=-1).max(axis=(1, 2)) for axis in (1, 2))
    count = coarse.shape[1]
    heights, error = pairs.boundary.rough_depths(pairs.part[rows], coarse[which].reshape(len(rows), -1, 3))
    heights, error = heights.reshape(-1, count, count), error.reshape(-1, count, count)
    close = np.abs(heights) - error <= reach[which, None, None]
    # The cells round each such place, on the finer grid.
    cells = close[:, :-1, :-1] | close[:, 1:, :-1] | close[:, :-1, 1:] | close[:, 1:, 1:]
    above = np.kron(heights > 0, np.ones((_COARSE, _COARSE), dtype=bool))[:, :GRID, :GRID]
    row, i, j = np.nonzero(cells)
    offsets = np.arange(_COARSE + 1)
    at_i = (_COARSE * i)[:, None, None] + offsets[:, None] + 0 * offsets
    at_j = (_COARSE * j)[:, None, None] + offsets + 0 * offsets[:, None]
    at = np.broadcast_to(row[:, None, None], at_i.shape)
    fine = np.zeros((len(rows), GRID, GRID), dtype=bool)
    fine[at, at_i, at_j] = True
    at, at_i, at_j = np.nonzero(fine)
    exact, _ = pairs.boundary.rough_depths(pairs.part[rows[at]], points[which[at], at_i, at_j, None])
    above[at, at_i, at_j] = exact[:, 0] > 0
    return above


def _in_boxes(pairs: Pairs, rows: Integers, points: Floats, which: Integers, asked: Booleans) -> Booleans:
    """Mask of the cells, of those asked for, that come into the box of the part's face."""
    found = np.zeros(asked.shape, dtype=bool)
    row, i, j = np.nonzero(asked)
    low, high = pairs.boundary.boxes
    part = pairs.part[rows[row]]
    corners = np.stack([points[which[row], i + di, j + dj] for di in (0, 1) for dj in (0, 1)])
    bottom, top = corners.min(axis=0), corners.max(axis=0)
    # Between its corners a cell bulges by less than it is long.
    margin = np.linalg.norm(top - bottom, axis=1, keepdims=True)
    found[row, i, j] = np.all((bottom - margin <= high[part]) & (top + margin >= low[part]), axis=1)
    return found


def _passed(known: Paths, rows: Integers, by_pair: dict[int, list[int]], asked: Integers) -> Booleans:
    """Mask of the cells at and beside known paths, in the rows asked for."""
    passed = np.zeros((len(rows), GRID - 1, GRID - 1), dtype=bool)
    step = 2 / (GRID - 1)
    for row in asked.tolist():
        paths = by_pair.get(int(rows[row]), [])
        if paths:
            dense = np.concatenate([_dense(known.places[path], step / 2) for path in paths])
            i, j = np.clip(((dense + 1) / step).astype(int), 0, GRID - 2).T
            passed[row, i, j] = True
    return np.asarray(binary_dilation(passed, np.ones((1, 3, 3), dtype=bool)))


def _dense(places: Floats, step: float = 1 / (GRID - 1)) -> Floats:
    along = np.diff(places, axis=0)
    counts = np.maximum(1, np.ceil(np.linalg.norm(along, axis=1) / step)).astype(int)
    first = np.cumsum(counts) - counts
    chord = np.repeat(np.arange(len(counts)), counts)
    share = (np.arange(len(chord)) - first[chord]) / counts[chord]
    return np.concatenate([places[chord] + share[:, None] * along[chord], places[-1:]])


def _on_curves(
    pairs: Pairs, pair: Integers, place: Floats, known: Paths, by_pair: dict[int, list[int]], step: float
) -> tuple[Integers, Floats]:
    """Places that Newton's method takes to a curve nearby, within both faces, and not to a known one."""
    if not len(pair):
        return pair, place
    near: Floats | None = None
    at = place.copy()
    back = np.zeros_like(at)
    for _ in range(8):
        height, slopes, where, _ = pairs.heights(pair, at[:, :1], at[:, 1:], near, tangent=True)
        near, back = where, level_step(height, slopes)[:, 0]
        length = np.linalg.norm(back, axis=1)
        at = at + back * np.minimum(1, step / np.maximum(length, step))[:, None]
    assert near is not None
    good = (np.linalg.norm(back, axis=1) < 1e-8) & (np.abs(at).max(axis=1) < 1)
    good &= np.linalg.norm(at - place, axis=1) < 2 * step
    some = np.flatnonzero(good)
    for number, rows in grouped(pair[some]):
        if number in by_pair:
            dense = np.concatenate([_dense(known.places[path], step / 4) for path in by_pair[number]])
            good[some[rows]] = cKDTree(dense).query(at[some[rows]])[0] >= step / 4
    left = np.flatnonzero(good)
    for part, rows in grouped(pairs.part[pair[left]]):
        good[left[rows]] = pairs.boundary.faces[part].contains(near[left[rows], 0])
    kept = np.flatnonzero(good)
    return pair[kept], at[kept]


def _round(pairs: Pairs, pair: int, start: Floats) -> tuple[Floats, Floats]:
    """Places along a closed curve, from a place on it round to the same one."""
    number = np.array([pair])
    _, _, near = _onward(pairs, number, start[None], pairs.heights(number, start[None, :1], start[None, 1:])[2][:, 0])
    twice = Ends(
        np.array([pair, pair]),
        np.array([0, 0]),
        np.stack([start, start]),
        np.concatenate([near, near]),
        np.array([True, False]),
    )
    for step in _STEPS[1:]:
        reached, places, nears = _followed(pairs, twice, np.array([0]), np.array([1]), step)
        if reached[0] >= 0 and len(places[0]) > 3:
            return places[0], nears[0]
    raise KernelError("a curve where the lattice crosses the part does not close")

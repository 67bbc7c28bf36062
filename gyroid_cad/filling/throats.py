"""Narrowest throats of fluids: the largest spheres that pass from each opening of a fluid to every other one.

On a grid that stands in the lattice as its symmetries do, where the throats of its networks are nodes, each node has
its distance from what bounds the fluid: the wall, and the skin. Spheres grow until they hold no way between the
openings. Without openings to pass between the throat is that of the lattice itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from gyroid_cad.filling.bodies import Made, mouths_of
from gyroid_cad.filling.infill import Infill
from gyroid_cad.filling.part import FilledBy, Outcome
from gyroid_cad.filling.report import FluidReport, fluid_report
from gyroid_cad.filling.wanted import Region
from gyroid_cad.kernel.part import Part, triangles_by_face
from gyroid_cad.kernel.skin import Hollow
from gyroid_cad.mesh.triangles.spread import spread_points
from gyroid_cad.wall.distances import tree_of
from gyroid_cad.wall.pore_limits import network_throats

__all__ = ["fluid_of", "narrowest_throat"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Nodes along a cell, the most that keep their number; throats lie in eighths of the cell.
_ALONG, _MOST_NODES = (32, 16, 8), 250_000
# Of the points that stand for faces, in steps of the grid; and how near to an opening's a node lies at it.
_SPREAD, _AT_OPENING = 0.75, 1.2
# A throat that agrees so closely with the lattice's own, in cell sizes, is that: distances are known no closer.
_SAME_THROAT = 2e-3


class InCore(Protocol):
    """Part that is being filled, with the skin and core that it is parted into."""

    @property
    def hollow(self) -> Hollow | None: ...
    @property
    def core(self) -> Part: ...


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Nodes of a lattice's own space round a core, so many along a cell.

    Attributes
    ----------
    along : int
    first : ndarray of int, shape (3,)
        The lowest node, in steps.
    shape : tuple of int
    step : float
        In mm.
    """

    along: int
    first: Integers
    shape: tuple[int, ...]
    step: float

    @property
    def nodes(self) -> Floats:
        """Places of the nodes in the lattice's own space, shape (n, 3)."""
        index = np.stack(np.unravel_index(np.arange(np.prod(self.shape)), self.shape), axis=1)
        return np.asarray((index + self.first) * self.step, dtype=np.float64)


def narrowest_throat(filling: InCore, infill: Infill, region: Region) -> float:
    """Diameter of the largest sphere that passes between all openings of a fluid, in mm.

    Of a fluid with fewer than two openings in a skin that of the sphere which passes through the lattice's network.

    Parameters
    ----------
    filling : InCore
    infill : Infill
        Endless.
    region : Region
        Of the fluid.

    Returns
    -------
    float
        0 where the way between some of the openings is narrower than the grid tells.
    """
    own = _of_lattice(filling.core, infill)
    hollow = filling.hollow
    if hollow is None or sum(hollow.opened) < 2:
        return own
    grid = _grid_round(filling.core, infill)
    places = infill.frame.placed(grid.nodes)
    room = _beside_wall(infill, grid, places, region)
    within = np.flatnonzero(room > 0)
    within = within[filling.core.contains(places[within])]
    closed, openings = _surface_points(hollow, filling.core, _SPREAD * grid.step)
    free, at = np.zeros(len(room)), []
    free[within] = room[within]
    if len(closed):
        # Faces further off than any wall need not be found.
        far = tree_of(closed).query(places[within], distance_upper_bound=float(room.max()))[0]
        free[within] = np.minimum(free[within], far)
    for points in openings:
        near = tree_of(points).query(places[within], distance_upper_bound=_AT_OPENING * grid.step)[0]
        at.append(within[np.isfinite(near)])
    found = 2 * _passing(free.reshape(grid.shape), at)
    return own if abs(found - own) < _SAME_THROAT * infill.grading.cell_size else found


def _of_lattice(core: Part, infill: Infill) -> float:
    """Narrowest throat of the networks themselves, in mm; of those in a part where the wall varies."""
    grading = infill.grading
    throats, size = network_throats(grading.surface), grading.cell_size
    half = infill.max_thickness / 2
    if not grading.uniform:
        low, high = _extent(core, infill)
        cells = np.stack(np.meshgrid(*map(np.arange, np.floor(low / size), np.ceil(high / size)), indexing="ij"), -1)
        own = (cells.reshape(-1, 1, 3) + throats.centres).reshape(-1, 3) * size
        places = infill.frame.placed(own)
        half = float(infill.half_thickness(places[core.contains(places)]).max(initial=0.0)) or half
    return max(2 * (throats.radius * size - half), 0.0)


def _extent(core: Part, infill: Infill) -> tuple[Floats, Floats]:
    """Corners of a box round a core in the lattice's own space."""
    corners = np.array([[x, y, z] for x in (core.low[0], core.high[0]) for y in (0, 1) for z in (0, 1)], dtype=float)
    corners[:, 1:] = core.low[1:] + corners[:, 1:] * (core.high - core.low)[1:]
    own = infill.frame.own(corners)
    return own.min(axis=0), own.max(axis=0)


def _grid_round(core: Part, infill: Infill) -> _Grid:
    size = infill.grading.cell_size
    low, high = _extent(core, infill)
    cells = float(np.prod((high - low) / size))
    along = next((n for n in _ALONG if cells * n**3 <= _MOST_NODES), _ALONG[-1])
    first = np.floor(low / size * along).astype(np.int64)
    count = np.ceil(high / size * along).astype(np.int64) - first + 1
    return _Grid(along, first, tuple(count.tolist()), size / along)


def _beside_wall(infill: Infill, grid: _Grid, places: Floats, region: Region) -> Floats:
    """Distance of each node from the wall's face, in mm; not above 0 where it is not in the region."""
    # The lattice repeats itself: the nodes of one cell tell.
    cell = _Grid(grid.along, np.zeros(3, dtype=np.int64), 3 * (grid.along,), grid.step)
    offsets = infill.offsets(infill.frame.placed(cell.nodes))
    index = np.stack(np.unravel_index(np.arange(len(places)), grid.shape), axis=1) + grid.first
    own = np.ravel_multi_index(tuple((index % grid.along).T), cell.shape)
    above = 1.0 if region.highest is None else -1.0
    return np.asarray(above * offsets[own] - infill.half_thickness(places))


def _surface_points(hollow: Hollow, core: Part, spacing: float) -> tuple[Floats, list[Floats]]:
    """Points on the faces of a core that are closed, and on each that is open."""
    some = triangles_by_face(core.shape, spacing / 4, threads=True)
    points = [spread_points(corners, spacing, np.zeros(len(corners), dtype=np.int64))[0] for corners in some]
    closed = [own for own, is_open in zip(points, hollow.opened, strict=True) if not is_open]
    opened = [own for own, is_open in zip(points, hollow.opened, strict=True) if is_open]
    return np.concatenate([np.empty((0, 3)), *closed]), opened


def _passing(free: Floats, openings: list[Integers]) -> float:
    """Radius of the largest sphere that passes between all openings, each given by the nodes at it."""
    most = min((float(free.ravel()[nodes].max(initial=0.0)) for nodes in openings), default=0.0)
    values = np.unique(free[(free > 0) & (free <= most)])
    low, high = -1, len(values)
    while high - low > 1:
        middle = (low + high) // 2
        labels = np.asarray(label(free >= values[middle], np.ones((3, 3, 3)))[0]).ravel()
        joined = (
            set(labels.tolist()) if not openings else set.intersection(*(set(labels[n].tolist()) for n in openings))
        )
        if joined - {0}:
            low = middle
        else:
            high = middle
    return float(values[low]) if low >= 0 else 0.0


def fluid_of(name: str, made: Sequence[Made], filling: FilledBy, outcome: Outcome) -> FluidReport:
    """Report on the bodies of a fluid, by its name, once a part has been filled."""
    volume, wetted = (sum(getattr(one, of) for one in made) for of in ("volume", "wetted"))
    region = next(region for region in filling.regions if region.name == name)
    # Mouths in the bare sides of a part join over its edges: one may lead out on all of them.
    least = 1 if filling.hollow is None else 2
    dead_ends = sum(mouths_of(one) < least for one in made)
    with filling.timed("throats"):
        throat = narrowest_throat(filling.of(name), outcome.infill, region)
    return fluid_report(name, volume, wetted, len(made), dead_ends, throat)

"""Sizes of pores: spheres that fit between the walls, by place and by volume.

The distance to the nearest wall is the radius of the largest sphere round a place that fits. Where it is largest
nearby, in the middle of a network's nodes, stand the inscribed spheres. By volume, the pore size at a place is the
diameter of the largest sphere that fits and holds the place, wherever its centre may be: that is the pore-size
distribution of Gelb and Gubbins (Langmuir 15, 1999, 305-308), the one that porosimetry aims at.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field
from gyroid_cad.report.inscribed import distinct, settled
from gyroid_cad.report.wall_thickness import Distribution, distribution_of
from gyroid_cad.surface.symmetry import CELL_QUARTERS
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.distances import WallFaces, tree_of, wall_faces
from gyroid_cad.wall.fitted import FittedWall
from gyroid_cad.wall.offset import Wall
from gyroid_cad.wall.refit import graded_wall
from gyroid_cad.wall.tangency import smoothed

__all__ = ["CONTINUED", "ENDLESS", "OPEN_SIDED", "ChannelSpheres", "Pores", "inscribed_spheres", "pores_of"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Places in all and along a cell: the grid that pore sizes are looked up on.
_PLACES = 120_000
_FEWEST_ALONG, _MOST_ALONG = 11, 31
# Samples looked at round a place.
_NEIGHBOURS = 6
# In spacings: places that are next to each other, across the cube's diagonal too.
_BESIDE = 1.75
# Inscribed spheres whose centres are this near, in spacings of the grid, are one.
_SAME = 0.5
# A sphere is left out if one round a neighbouring place is larger by this part of the way: it holds it, all but a
# sliver.
_HELD = 0.85
_BALLS_AT_ONCE = 256
# How far from the wall, in spacings, spheres round places of the grid may leave a place to itself.
_LAYER = 0.5
_NEIGHBOURING = np.array([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)]) - 1
# How far beyond the block patches are fitted, in cell sizes: the largest pores reach less far.
_BEYOND = 0.75
# How far beyond the block its own patches reach.
_REACH = 0.25
# How far beyond the block the centres of spheres that reach into it are looked for, in cell sizes.
_CENTRES_BEYOND = 0.3
ENDLESS, CONTINUED, OPEN_SIDED = "endless", "continued", "open"


@dataclass(frozen=True, slots=True)
class ChannelSpheres:
    """The spheres inscribed in one network, at the places where the distance to the wall is largest nearby.

    Attributes
    ----------
    count : int
        In a cell of an endless lattice, or in the whole block of one that varies.
    smallest, largest : float
        Diameters in mm.
    """

    count: int
    smallest: float
    largest: float


@dataclass(frozen=True, slots=True)
class Pores:
    """The pores between the walls.

    Attributes
    ----------
    beyond : {"endless", "continued", "open"}
        Whether this is one cell of an endless lattice, or the block of one that varies and is taken to go on a cell
        beyond its sides, or where it cannot, because the scale field or the map ends there, the block with open sides.
    porosity : float
        Part of the block that is pore, by counting places; the exact one is 1 less the density.
    spacing : float
        Of the places looked at, in mm, at their widest.
    channel_a, channel_b : ChannelSpheres, optional
        Of the network that the common normal points to, and of the other; none where no sphere is largest inside
        the block.
    sizes : Distribution
        Diameters in mm, by the volume of the pores.
    """

    beyond: str
    porosity: float
    spacing: float
    channel_a: ChannelSpheres | None
    channel_b: ChannelSpheres | None
    sizes: Distribution


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Places in the block, or in one cell of an endless lattice.

    Attributes
    ----------
    shape : tuple of int
    places : ndarray, shape (n, 3)
        In mm, of the part.
    volumes : ndarray, shape (n,)
        That each place stands for, in mm3.
    inside : ndarray of bool, shape (n,)
        Whether the place is in the block; beyond it there may be centres of spheres that reach into it.
    period : float, optional
    spacing : float
        At its widest.
    """

    shape: tuple[int, ...]
    places: Floats
    volumes: Floats
    inside: Booleans
    period: float | None
    spacing: float


def pores_of(fitted: FittedWall) -> Pores:
    """Measure the pores of a lattice.

    Of a lattice whose cells are uniform one cell is looked at, as it is among its like. Of a graded one it is the
    block of cells, where the map carries it: spheres have their centres in the block. Those near its sides meet the
    walls that would come next, fitted for this; else every pore on the border would seem larger than it is.

    Parameters
    ----------
    fitted : FittedWall

    Returns
    -------
    Pores
    """
    grid, faces, beyond = _scene(fitted)
    radii, outside, sides = faces.feet(grid.places, _NEIGHBOURS).nearest()
    radii = np.where(outside, radii, 0.0)
    pore = outside & grid.inside
    centres, largest, channel = _inscribed(faces, grid, radii, sides)
    return Pores(
        beyond=beyond,
        porosity=float(grid.volumes[pore].sum() / grid.volumes[grid.inside].sum()),
        spacing=grid.spacing,
        channel_a=_spheres(largest[channel == 1]),
        channel_b=_spheres(largest[channel == 0]),
        sizes=distribution_of(2 * _covering_radii(grid, radii, pore, centres, largest), grid.volumes[pore]),
    )


def inscribed_spheres(fitted: FittedWall) -> tuple[Floats, Floats, Integers]:
    """The inscribed spheres themselves, as counted by :func:`pores_of`.

    Returns
    -------
    centres : ndarray, shape (n, 3)
        In mm; of an endless lattice those in one cell.
    radii : ndarray, shape (n,)
        In mm.
    channels : ndarray of int, shape (n,)
        1 for the network that the common normal points to, 0 for the other.
    """
    grid, faces, _ = _scene(fitted)
    radii, outside, sides = faces.feet(grid.places, _NEIGHBOURS).nearest()
    return _inscribed(faces, grid, np.where(outside, radii, 0.0), sides)


def _scene(fitted: FittedWall) -> tuple[_Grid, WallFaces, str]:
    """Scene of the pores: the region looked at, the walls, and what there is beyond the block's sides."""
    # Where its fields and maps are.
    fitted = fitted.at_home()
    grading, wall = fitted.spec.grading, fitted.wall
    if grading.uniform:
        return _grid(fitted, 0.0), wall_faces(wall, grading.cell_size), ENDLESS
    try:
        return _grid(fitted, _CENTRES_BEYOND), wall_faces(_continued(fitted), None), CONTINUED
    except ParameterError:
        return _grid(fitted, 0.0), wall_faces(wall, None), OPEN_SIDED


def _continued(fitted: FittedWall) -> Wall:
    """The wall of a graded lattice, with the patches that would come next beyond the block's open sides.

    Thickness and density stay there what they are where the lattice ends: a wall that thins out along it may be gone
    beyond.

    Raises
    ------
    ParameterError
        If the scale field or the map is no good there.
    """
    spec, grading = fitted.spec, fitted.spec.grading
    closed, cells, placements = np.array(grading.closed), np.array(spec.cells), grading.surface.cell
    centres = placements.translations / CELL_QUARTERS

    def near(placement: Integers, cell: Integers) -> Booleans:
        places = centres[placement] + cell
        return np.asarray(np.all(closed | ((places > -_BEYOND) & (places < cells + _BEYOND)), axis=1))

    nx, ny, nz = (cells + 2 * ~closed).tolist()
    x, y, z = (-1 * ~closed).tolist()
    complex = build_complex((nx, ny, nz), placements, grading.closed, first=(x, y, z), wanted=near)
    ends = (-_REACH * grading.cell_size, (cells + _REACH) * grading.cell_size)
    held = replace(grading, thickness=_held(grading.thickness, *ends), density=_held(grading.density, *ends))
    return smoothed(graded_wall(complex, held, len(fitted.wall.weights)))


def _held(value: float | Field | None, low: float, high: Floats) -> float | Field | None:
    """A field that beyond a box is what it is on the box."""
    if not isinstance(value, Field):
        return value
    field = value

    def held(x: Floats, y: Floats, z: Floats) -> Floats:
        return field(*(np.clip(along, low, end) for along, end in zip((x, y, z), high, strict=True)))

    return Field(held, field.text, parameter=field.parameter)


def _grid(fitted: FittedWall, margin: float) -> _Grid:
    """A grid on the block, and so many cell sizes beyond its open sides."""
    grading, cells = fitted.spec.grading, fitted.spec.cells
    endless = grading.uniform
    counted = (1, 1, 1) if endless else cells
    margins = np.where(grading.closed, 0.0, margin)
    along = int(np.clip((_PLACES / np.prod(counted + 2 * margins)) ** (1 / 3), _FEWEST_ALONG, _MOST_ALONG))
    # An odd number knows no symmetry of the lattice: else all pores that are alike would be miscounted alike.
    along -= 1 - along % 2
    extra = np.round(margins * along).astype(int).tolist()
    axes = [
        (np.arange(-more, along * count + more) + 0.5) / along * grading.cell_size
        for count, more in zip(counted, extra, strict=True)
    ]
    shape = tuple(map(len, axes))
    own = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = np.all((own > 0) & (own < np.array(counted) * grading.cell_size), axis=1)
    images, _, determinant = grading.carry(own)
    places = np.ascontiguousarray(images.T)
    size = grading.cell_size / along
    grid = places.reshape(*shape, 3)
    spacing = max(float(np.linalg.norm(np.diff(grid, axis=axis), axis=-1).max(initial=0.0)) for axis in range(3))
    volumes = np.broadcast_to(np.asarray(determinant) * size**3, len(places))
    return _Grid(shape, places, volumes, inside, grading.cell_size if endless else None, spacing)


def _neighbours(grid: _Grid) -> Iterator[tuple[Integers, Booleans]]:
    """For each of 26 directions, the place next to every place, and whether there is one."""
    index = np.stack(np.unravel_index(np.arange(len(grid.places)), grid.shape), axis=1)
    for step in _NEIGHBOURING:
        other = index + step
        within = np.all((other >= 0) & (other < grid.shape), axis=1)
        if grid.period is not None:
            within[:] = True
        other = np.mod(other, grid.shape)
        yield np.ravel_multi_index(tuple(other.T), grid.shape), within


def _inscribed(faces: WallFaces, grid: _Grid, radii: Floats, sides: Integers) -> tuple[Floats, Floats, Integers]:
    """Centres, radii and networks of the largest spheres nearby."""
    top = (radii > 0) & grid.inside
    for other, within in _neighbours(grid):
        # At the block's sides the next larger sphere may stand just outside.
        top &= within & (radii >= radii[other])
    starts = np.flatnonzero(top)
    if not len(starts):
        return np.empty((0, 3)), np.empty(0), np.empty(0, dtype=np.int64)
    # Places of a grid that lie round a centre alike are all as good: one is enough.
    starts = starts[distinct(grid.places[starts], radii[starts], _BESIDE * grid.spacing, grid.period)]
    centres, found = settled(faces, grid.places[starts], radii[starts], grid.spacing)
    if grid.period is not None:
        centres = np.mod(centres, grid.period)
    kept = distinct(centres, found, _SAME * grid.spacing, grid.period)
    return centres[kept], found[kept], sides[starts][kept]


def _covering_radii(grid: _Grid, radii: Floats, pore: Booleans, centres: Floats, largest: Floats) -> Floats:
    """At every place of the pores, the radius of the largest sphere that holds it."""
    medial = radii > 0
    for other, within in _neighbours(grid):
        apart = grid.places[other] - grid.places
        if grid.period is not None:
            apart -= grid.period * np.round(apart / grid.period)
        medial &= ~(within & (radii[other] - radii >= _HELD * np.sqrt(dot(apart, apart))))
    all_centres = np.concatenate([grid.places[medial], centres])
    all_radii = np.concatenate([radii[medial], largest])
    places, sizes = grid.places[pore], radii[pore].copy()
    tree = tree_of(places, grid.period)
    # From the largest down: what is held by a larger sphere is held already.
    order = np.argsort(-all_radii)
    for first in range(0, len(order), _BALLS_AT_ONCE):
        some = order[first : first + _BALLS_AT_ONCE]
        held = tree.query_ball_point(all_centres[some], all_radii[some])
        counts = [len(places_held) for places_held in held]
        flat = np.concatenate([np.asarray(places_held, dtype=np.int64) for places_held in held])
        np.maximum.at(sizes, flat, np.repeat(all_radii[some], counts))
    # Spheres round places of a grid leave a thin layer on the wall: what holds the next place holds it too.
    layer = (sizes <= radii[pore]) & (sizes < _LAYER * grid.spacing)
    if layer.any() and not layer.all():
        neighbour = tree_of(places[~layer], grid.period).query(places[layer])[1]
        sizes[layer] = np.maximum(sizes[layer], sizes[~layer][neighbour])
    return sizes


def _spheres(radii: Floats) -> ChannelSpheres | None:
    if not len(radii):
        return None
    return ChannelSpheres(len(radii), 2 * float(radii.min()), 2 * float(radii.max()))

"""Triangles to be drawn, with normals, colours and faces: of a lattice, of a shape of the kernel, or from anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import dot, freeze_arrays
from gyroid_cad.common.graph import connected
from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.wall.offset import SIDES, Wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["COLOURS", "Colour", "Facets", "facets_of_grids", "facets_of_shape", "facets_of_triangles", "facets_of_wall"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Colour = tuple[float, float, float]

# Of a lattice's face B, its face A, and everything else: its rims, the faces of a part.
COLOURS = ((0.93, 0.71, 0.33), (0.36, 0.58, 0.80), (0.97, 0.90, 0.75))
REST = 2
# Squares along each side of a patch: fewer where there are many.
_MOST_SQUARES, _FEWEST_SQUARES = 10, 1
_MOST_TRIANGLES = 1_200_000
# Places through the wall, on the side walls, which may be broad and twisted.
_THROUGH = np.linspace(-1.0, 1.0, 7)[np.newaxis]
# Cosine of the angle between triangles from which on their common edge is sharp.
_SHARP = 0.82


@dataclass(frozen=True, slots=True, eq=False)
class Facets:
    """Coloured triangles.

    Attributes
    ----------
    corners : ndarray, shape (n, 3, 3)
        By triangle, corner and coordinate, in mm.
    normals : ndarray, shape (n, 3, 3)
        At the corners, out of the solid; of any length but zero.
    colours : ndarray, shape (n, 3, 3)
        At the corners: red, green and blue from 0 to 1.
    faces, surfaces : ndarray of int, shape (n,)
        The face, and the smooth surface of several faces, that each is a part of: a fine line is drawn where two faces
        meet, a dark one where two surfaces do.
    closed : bool
        Whether they bound solids, counterclockwise seen from outside: then none is ever seen from behind.
    places : ndarray, shape (k, 3, 4)
        Where they are found, once or often: rotation, and translation in mm in the last column.
    """

    corners: Floats
    normals: Floats
    colours: Floats
    faces: Integers
    surfaces: Integers
    closed: bool
    places: Floats = field(default_factory=lambda: np.eye(3, 4)[np.newaxis])

    def __post_init__(self) -> None:
        freeze_arrays(self)


def facets_of_wall(wall: Wall) -> Facets:
    """Both faces of every patch, in a colour each, and the free side walls, in a third.

    Parameters
    ----------
    wall : Wall

    Returns
    -------
    Facets
        With the faces' own normals, so that facets are not seen as such.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> facets = facets_of_wall(Lattice((1, 1, 1), 10.0, 0.8).fitted().wall)
    >>> facets.closed, len(np.unique(facets.faces)) - 2 * 24
    (True, 36)
    """
    count = wall.complex.patch_count
    squares = int(np.clip(np.sqrt(_MOST_TRIANGLES / (4 * count)), _FEWEST_SQUARES, _MOST_SQUARES))
    samples = np.linspace(-1, 1, squares + 1)
    points, du, dv = grid_derivatives(wall.nets, wall.weights, (wall.knots, wall.knots), samples, samples)
    normals = np.cross(du, dv)
    shifts = wall.shifts[wall.patch_shift]
    parts = []
    for side in SIDES:
        placed = points[wall.patch_net, side] + shifts[:, np.newaxis, np.newaxis]
        # Nets' normals run from side 0 to side 1, and those of facets out of the wall.
        outward = normals[wall.patch_net, side] * (2 * side - 1)
        parts.append(facets_of_grids(placed, outward, COLOURS[side], closed=True, surface=side))
    return _joined([*parts, *_side_walls(wall, samples)])


def _side_walls(wall: Wall, samples: Floats) -> list[Facets]:
    complex = wall.complex
    free = np.flatnonzero(complex.free)
    if not len(free):
        return []
    patches = complex.edge_patches[free, 0]
    edges = np.argmax(complex.patch_edges[patches] == free[:, np.newaxis], axis=1)
    kinds, which = np.unique(np.stack([wall.patch_net[patches], edges]), axis=1, return_inverse=True)
    made = []
    for net, edge in kinds.T.tolist():
        both = wall.side_wall(net, edge).derivatives(samples[:, np.newaxis], _THROUGH)
        made.append((both[0, 0], np.cross(both[1, 0], both[0, 1])))
    points, normals = (np.stack(part)[which.ravel()] for part in zip(*made, strict=True))
    placed = points + wall.shifts[wall.patch_shift[patches]][:, np.newaxis, np.newaxis]
    return [facets_of_grids(placed, normals, COLOURS[REST], closed=True, surface=REST)]


def facets_of_grids(
    points: Floats, normals: Floats, colours: ArrayLike, closed: bool = False, surface: int = 0
) -> Facets:
    """Triangles of grids of points, each grid a face, all of them one smooth surface.

    Parameters
    ----------
    points, normals : ndarray, shape (grids, a, b, 3)
        Triangles run counterclockwise seen from where the normals point.
    colours : array-like, shape (3,) or (grids, a, b, 3)
        Of all, or at each point.
    closed : bool
        Whether they are a part of what bounds solids.
    surface : int
        The surface's number.
    """
    corners = []
    for grid in (points, normals, np.broadcast_to(np.asarray(colours, dtype=float), points.shape)):
        a, b, c, d = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
        halves = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=-3)
        corners.append(halves.reshape(-1, 3, 3))
    flat = np.cross(corners[0][:, 1] - corners[0][:, 0], corners[0][:, 2] - corners[0][:, 0])
    backwards = dot(flat, corners[1].sum(axis=1)) < 0
    for part in corners:
        part[backwards] = part[backwards, ::-1]
    faces = np.repeat(np.arange(len(points)), len(flat) // max(len(points), 1))
    where, upright, coloured = corners
    return Facets(where, upright, coloured, faces=faces, surfaces=np.full(len(flat), surface), closed=closed)


def facets_of_triangles(
    vertices: ArrayLike,
    triangles: ArrayLike,
    closed: bool,
    faces: Integers | None = None,
    colours: ArrayLike = COLOURS[0],
) -> Facets:
    """Triangles that share their corners: smooth, but for sharp edges.

    Parameters
    ----------
    vertices : array-like, shape (n, 3)
    triangles : array-like of int, shape (m, 3)
    closed : bool
        Whether they bound solids, counterclockwise seen from outside.
    faces : ndarray of int, shape (m,), optional
        The face that each is a part of; one face if left out.
    colours : array-like, shape (3,) or (m, 3)
        Of all, or of each.
    """
    numbers = np.asarray(triangles, dtype=np.int64).reshape(-1, 3)
    corners = np.asarray(vertices, dtype=float)[numbers]
    normals, surfaces = _smoothed(corners, numbers)
    each = np.broadcast_to(np.asarray(colours, dtype=float), (len(numbers), 3))
    return Facets(
        corners=corners,
        normals=normals,
        colours=np.repeat(each[:, np.newaxis], 3, axis=1),
        faces=np.zeros(len(numbers), dtype=np.int64) if faces is None else faces,
        surfaces=surfaces,
        closed=closed,
    )


def facets_of_shape(
    shape: KernelShape,
    colours: Sequence[Colour | None] | None = None,
    places: Floats | None = None,
    extent: float | None = None,
) -> Facets:
    """Triangles of a shape; faces of a lattice in the two colours of its sides.

    Parameters
    ----------
    shape : TopoDS_Shape
    colours : sequence of (float, float, float), optional
        Of each face, in place of those; none where a face has none of its own.
    places : ndarray, shape (k, 3, 4), optional
        Where it is found, if not where it is.
    extent : float, optional
        Of all that is drawn, in mm; the diagonal of the shape if left out.

    Raises
    ------
    ExportError
        If a face has no triangles.
    """
    from gyroid_cad.kernel.check import topology
    from gyroid_cad.kernel.reading import lattice_sides, shown_triangles

    usual = [COLOURS[REST if side is None else side] for side in lattice_sides(shape)]
    if not usual:
        # Of nothing there is no diagonal to measure a deviation by.
        return facets_of_triangles(np.empty((0, 3)), np.empty((0, 3)), closed=False)
    vertices, triangles, faces = shown_triangles(shape, extent)
    own = usual if colours is None else [colour or other for colour, other in zip(colours, usual, strict=True)]
    by_triangle = np.array(own).reshape(-1, 3)[faces]
    made = facets_of_triangles(vertices, triangles, topology(shape).closed, faces, by_triangle)
    return made if places is None else replace(made, places=places)


def _joined(parts: Sequence[Facets]) -> Facets:
    """Facets of a wall together; each part's faces apart from those of the others."""
    firsts = np.cumsum([0, *(int(part.faces.max(initial=-1)) + 1 for part in parts)])
    return Facets(
        corners=np.concatenate([part.corners for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        colours=np.concatenate([part.colours for part in parts]),
        faces=np.concatenate([part.faces + first for part, first in zip(parts, firsts[:-1], strict=True)]),
        surfaces=np.concatenate([part.surfaces for part in parts]),
        closed=all(part.closed for part in parts),
    )


def _smoothed(corners: Floats, triangles: Integers) -> tuple[Floats, Integers]:
    """Normals at corners, shape (m, 3, 3), and the smooth surface of each triangle: both end at sharp edges.

    The normal of a corner is the mean of the triangles round it, as far as no sharp edge parts them.
    """
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    # A side runs from each corner to the next; those of one edge follow each other once they are sorted.
    start, end = np.arange(triangles.size), np.arange(triangles.size).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    numbers = triangles.ravel()
    swapped = numbers[start] > numbers[end]
    low, high = np.where(swapped, end, start), np.where(swapped, start, end)
    order = np.lexsort((numbers[high], numbers[low]))
    one, other = order[:-1], order[1:]
    shared = (numbers[low[one]] == numbers[low[other]]) & (numbers[high[one]] == numbers[high[other]])
    smooth = shared & (dot(unit[one // 3], unit[other // 3]) > _SHARP)
    one, other = one[smooth], other[smooth]
    ends = np.concatenate([low[one], high[one]]), np.concatenate([low[other], high[other]])
    group = connected(triangles.size, *ends)
    summed = [np.bincount(group, np.repeat(flat[:, axis], 3), minlength=1)[group] for axis in range(3)]
    normals = np.stack(summed, axis=1).reshape(-1, 3, 3).astype(float)
    return normals, connected(len(triangles), one // 3, other // 3)

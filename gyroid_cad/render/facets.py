"""Triangles to be drawn, with normals, colours and faces: of a lattice, of a shape of the kernel, or from anywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.wall.offset import SIDES, Wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["COLOURS", "Colour", "Facets", "facets_of_shape", "facets_of_triangles", "facets_of_wall"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Colour = tuple[float, float, float]

# Of a lattice's face B, its face A, and everything else: its rims, the faces of a part.
COLOURS = ((0.93, 0.71, 0.33), (0.36, 0.58, 0.80), (0.97, 0.90, 0.75))
REST = 2
# Squares along each side of a patch: fewer where there are many.
_MOST_SQUARES, _FEWEST_SQUARES = 10, 1
_MOST_TRIANGLES = 1_200_000
# Places through the wall, on the side walls.
_THROUGH = np.linspace(0.0, 1.0, 3)[np.newaxis]
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
    faces : ndarray of int, shape (n,)
        Number of the face that each is a part of: a line is drawn where two faces meet.
    closed : bool
        Whether they bound solids, counterclockwise seen from outside: then none is ever seen from behind.
    places : ndarray, shape (k, 3, 4)
        Where they are found, once or often: rotation, and translation in mm in the last column.
    """

    corners: Floats
    normals: Floats
    colours: Floats
    faces: Integers
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
        parts.append(_facets_of_grids(placed, normals[wall.patch_net, side], COLOURS[side], backwards=side == 0))
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
    return [_facets_of_grids(placed, normals, COLOURS[REST])]


def _facets_of_grids(points: Floats, normals: Floats, colour: Colour, backwards: bool = False) -> Facets:
    """Triangles of grids, shape (grids, a, b, 3), each a face; turned round if they face inwards."""
    corners = []
    for grid in (points, normals):
        a, b, c, d = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
        halves = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=-3)
        corners.append(halves.reshape(-1, 3, 3))
    if backwards:
        corners = [corners[0][:, ::-1], -corners[1][:, ::-1]]
    count = len(corners[0])
    faces = np.repeat(np.arange(len(points)), count // max(len(points), 1))
    return Facets(corners[0], corners[1], np.broadcast_to(colour, (count, 3, 3)), faces, closed=True)


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
    each = np.broadcast_to(np.asarray(colours, dtype=float), (len(numbers), 3))
    return Facets(
        corners,
        _corner_normals(corners, numbers),
        np.repeat(each[:, np.newaxis], 3, axis=1),
        np.zeros(len(numbers), dtype=np.int64) if faces is None else faces,
        closed,
    )


def facets_of_shape(
    shape: KernelShape,
    colours: Sequence[Colour | None] | None = None,
    places: Floats | None = None,
    extent: float | None = None,
) -> Facets:
    """Triangles of a shape by the kernel's mesher; faces of a lattice in the two colours of its sides.

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
        If the mesher fails.
    """
    from gyroid_cad.kernel.check import topology
    from gyroid_cad.kernel.reading import lattice_sides, shown_triangles

    usual = [COLOURS[REST if side is None else side] for side in lattice_sides(shape)]
    if not usual:
        # The kernel's mesher refuses to mesh nothing.
        return facets_of_triangles(np.empty((0, 3)), np.empty((0, 3)), closed=False)
    vertices, triangles, faces = shown_triangles(shape, extent)
    own = usual if colours is None else [colour or other for colour, other in zip(colours, usual, strict=True)]
    by_triangle = np.array(own).reshape(-1, 3)[faces]
    made = facets_of_triangles(vertices, triangles, topology(shape).closed, faces, by_triangle)
    return made if places is None else replace(made, places=places)


def _joined(parts: Sequence[Facets]) -> Facets:
    """Facets that stand in the same places, together; each part's faces apart from those of the others."""
    firsts = np.cumsum([0, *(int(part.faces.max(initial=-1)) + 1 for part in parts)])
    return Facets(
        corners=np.concatenate([part.corners for part in parts]),
        normals=np.concatenate([part.normals for part in parts]),
        colours=np.concatenate([part.colours for part in parts]),
        faces=np.concatenate([part.faces + first for part, first in zip(parts, firsts[:-1], strict=True)]),
        closed=all(part.closed for part in parts),
    )


def _corner_normals(corners: Floats, triangles: Integers) -> Floats:
    """Mean normal at each corner of the triangles round it, as far as no sharp edge parts them; (m, 3, 3)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    unit = flat / np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), np.finfo(float).tiny)
    count = triangles.size
    # A side runs from each corner to the next; those of one edge follow each other once they are sorted.
    start, end = np.arange(count), np.arange(count).reshape(-1, 3)[:, [1, 2, 0]].ravel()
    numbers = triangles.ravel()
    swapped = numbers[start] > numbers[end]
    low, high = np.where(swapped, end, start), np.where(swapped, start, end)
    order = np.lexsort((numbers[high], numbers[low]))
    one, other = order[:-1], order[1:]
    shared = (numbers[low[one]] == numbers[low[other]]) & (numbers[high[one]] == numbers[high[other]])
    one, other = one[shared], other[shared]
    smooth = np.einsum("nk,nk->n", unit[one // 3], unit[other // 3]) > _SHARP
    one, other = one[smooth], other[smooth]
    links = (np.concatenate([low[one], high[one]]), np.concatenate([low[other], high[other]]))
    graph = coo_array((np.ones(len(links[0]), dtype=bool), links), shape=(count, count))
    _, group = connected_components(graph, directed=False)
    summed = [np.bincount(group, np.repeat(flat[:, axis], 3))[group] for axis in range(3)]
    return np.asarray(np.stack(summed, axis=1).reshape(-1, 3, 3), dtype=float)

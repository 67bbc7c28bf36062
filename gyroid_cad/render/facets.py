"""What is drawn: a lattice's faces and side walls from its control nets, or triangles from anywhere."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.nurbs.surface import grid_derivatives
from gyroid_cad.render.drawing import Facets
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["COLOURS", "facets_of_triangles", "facets_of_wall"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of face B, face A and the free walls of a lattice; of anything else, the first.
COLOURS = ((0.93, 0.71, 0.33), (0.36, 0.58, 0.80), (0.97, 0.90, 0.75))
# Squares along each side of a patch: fewer where there are many.
_MOST_SQUARES, _FEWEST_SQUARES = 10, 3
_MOST_TRIANGLES = 600_000
# Places through the wall, on the side walls.
_THROUGH = np.linspace(0.0, 1.0, 5)[np.newaxis]


def facets_of_wall(wall: Wall) -> Facets:
    """Both faces, in a colour each, and the free side walls, in a third.

    Parameters
    ----------
    wall : Wall

    Returns
    -------
    Facets
        With the faces' own normals, so that facets are not seen as such.
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
        parts.append(_squares(placed, normals[wall.patch_net, side], COLOURS[side], backwards=side == 0))
    parts.append(_side_walls(wall, samples))
    corners, normals, colours = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return Facets(corners, normals, colours, closed=True)


def _side_walls(wall: Wall, samples: Floats) -> tuple[Floats, Floats, Floats]:
    complex = wall.complex
    free = np.flatnonzero(complex.free)
    patches = complex.edge_patches[free, 0]
    edges = np.argmax(complex.patch_edges[patches] == free[:, np.newaxis], axis=1)
    kinds, which = np.unique(np.stack([wall.patch_net[patches], edges]), axis=1, return_inverse=True)
    made = []
    for net, edge in kinds.T.tolist():
        both = wall.side_wall(net, edge).derivatives(samples[:, np.newaxis], _THROUGH)
        made.append((both[0, 0], np.cross(both[1, 0], both[0, 1])))
    if not made:
        return np.empty((0, 3, 3)), np.empty((0, 3, 3)), np.empty((0, 3))
    points, normals = (np.stack(part)[which.ravel()] for part in zip(*made, strict=True))
    return _squares(points + wall.shifts[wall.patch_shift[patches]][:, np.newaxis, np.newaxis], normals, COLOURS[2])


def _squares(
    points: Floats, normals: Floats, colour: tuple[float, float, float], backwards: bool = False
) -> tuple[Floats, Floats, Floats]:
    """Triangles of grids, shape (grids, a, b, 3): corners, normals, colours; turned round if they face inwards."""
    corners = []
    for grid in (points, normals):
        a, b, c, d = grid[:, :-1, :-1], grid[:, 1:, :-1], grid[:, 1:, 1:], grid[:, :-1, 1:]
        halves = np.stack([np.stack([a, b, c], axis=-2), np.stack([a, c, d], axis=-2)], axis=-3)
        corners.append(halves.reshape(-1, 3, 3))
    if backwards:
        corners = [corners[0][:, ::-1], -corners[1][:, ::-1]]
    return corners[0], corners[1], np.tile(np.array(colour), (len(corners[0]), 1))


def facets_of_triangles(vertices: NDArray[Any], triangles: NDArray[Any], closed: bool) -> Facets:
    """Triangles with normals of their own.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
    triangles : ndarray of int, shape (m, 3)
    closed : bool
        Whether they bound solids, counterclockwise seen from outside.
    """
    corners = np.asarray(vertices, dtype=float)[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return Facets(corners, np.repeat(normals[:, np.newaxis], 3, axis=1), np.tile(COLOURS[0], (len(corners), 1)), closed)

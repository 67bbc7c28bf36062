"""Width of the ways out of a part's hollows, measured from its triangles: what a lattice knows from its surface."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot
from gyroid_cad.mesh.triangles.measures import surface_places

__all__ = ["way_out"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Nodes of the grid, and samples of the surface at most.
_NODES, _MOST_SAMPLES = 300_000, 1_000_000
# Distance between samples, in spacings of the grid: near enough that a sphere does not reach between them.
_SAMPLED = 0.7
# Spheres of this radius, in spacings, and larger ones cannot be on both sides of a wall at neighbouring nodes.
_LEAST_RADIUS = 3**0.5
# A larger radius is tried next by so much of a spacing, or so much of itself.
_STEP, _GROWTH = 0.25, 0.03
# Spheres of this radius, in spacings, are the largest that are tried: nobody asks whether resin passes a wider way.
_MOST_RADIUS = 11.0
# So many nodes together are a hollow; one may be due to where the nodes lie.
_HOLLOW = 2
_ROUNDING = 1e-6


def way_out(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> tuple[float | None, float]:
    """Measure the largest sphere that gets out of every hollow of a part.

    A hollow is empty space that is wider than its way out: of a lattice that is every pore, and its way out the
    throats of the network. On a grid of nodes, of which each has its distance to the surface, the spheres grow until
    those in some hollow are cut off from the outside of the part's box. A bore that is as wide all along is no hollow.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Closed and counterclockwise seen from outside.

    Returns
    -------
    diameter : float, optional
        In mm; None if there is no such hollow or its way out is a third of the part or so wide, and 0 if it is
        narrower than the grid tells.
    within : float
        How far off it may be, in mm: what a grid of some hundred thousand nodes tells.

    Examples
    --------
    A cube is nowhere hollow:

    >>> corners = np.array(list(np.ndindex(2, 2, 2)), dtype=float)
    >>> low = np.array([[0, 1, 3], [0, 3, 2], [0, 4, 5], [0, 5, 1], [0, 2, 6], [0, 6, 4]])
    >>> way_out(corners, np.concatenate([low, 7 - low[:, ::-1]]))[0] is None
    True
    """
    points, facets = np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64)
    low, high = points[facets].min(axis=(0, 1)), points[facets].max(axis=(0, 1))
    extent = np.maximum(high - low, np.finfo(float).tiny)
    spacing = float(np.prod(extent / extent.max()) / _NODES) ** (1 / 3) * float(extent.max())
    least = _LEAST_RADIUS * spacing
    if extent.min() <= 2 * least or _fills(points[facets] - low, extent):
        return None, 2 * least
    distance, outward = _distances(points, facets, low, high, spacing)
    space = _empty_space(distance, outward, least)
    before = 0.0
    for radius in _radii(least, spacing, float(distance.max())):
        if _largest_cut_off(space, radius) >= _HOLLOW:
            return (float(radius + before) if before else 0.0), 2 * (spacing if before else least)
        before = radius
    return None, 2 * least


def _fills(corners: Floats, extent: Floats) -> bool:
    """Tell whether a solid leaves nothing of its box empty, so that there is nothing to look for."""
    a, b, c = np.moveaxis(corners, 1, 0)
    return float(dot(a, np.cross(b, c)).sum()) / 6 > (1 - _ROUNDING) * float(np.prod(extent))


def _radii(least: float, spacing: float, most: float) -> Iterator[float]:
    radius = least
    while radius <= most:
        yield radius
        radius += max(_STEP * spacing, _GROWTH * radius)


def _distances(points: Floats, facets: Integers, low: Floats, high: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Distance of every node of a grid to the surface, if not too far, and how much of it is out of the solid."""
    from scipy.spatial import cKDTree

    a, b, c = np.moveaxis(points[facets], 1, 0)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    samples, inward, _ = surface_places(points, facets, int(min(area / (_SAMPLED * spacing) ** 2, _MOST_SAMPLES)) + 1)
    shape = np.ceil((high - low) / spacing).astype(np.int64) + 1
    first = (low + high - spacing * (shape - 1)) / 2
    nodes = first + spacing * np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    most = _MOST_RADIUS * spacing
    distance, number = cKDTree(samples).query(nodes, distance_upper_bound=most, workers=-1)
    nearest = np.asarray(number)
    found = nearest < len(samples)
    outward = np.zeros(len(nodes))
    outward[found] = -dot(nodes[found] - samples[nearest[found]], inward[nearest[found]])
    return np.minimum(distance, most).reshape(shape), outward.reshape(shape)


def _empty_space(distance: Floats, outward: Floats, least: float) -> Floats:
    """Distances where there is empty space, 0 elsewhere, and beyond all in a layer round the grid: there is room."""
    from scipy.ndimage import label, mean

    marked, count = label(distance >= least, np.ones((3, 3, 3)))
    labels = np.asarray(marked)
    # Nodes that are connected lie on one side of the surface. At a sharp edge a single one may seem to lie on the
    # other: all of them have a voice.
    solid = np.concatenate([[True], np.atleast_1d(mean(np.sign(outward), labels, np.arange(1, count + 1))) < 0])
    return np.pad(np.where(solid[labels], 0.0, distance), 1, constant_values=np.inf)


def _largest_cut_off(space: Floats, radius: float) -> int:
    """Count the nodes of the largest region that spheres of a radius do not leave."""
    from scipy.ndimage import label

    labels = np.asarray(label(space >= radius, np.ones((3, 3, 3)))[0])
    sizes = np.bincount(labels.ravel())
    sizes[[0, labels[0, 0, 0]]] = 0
    return int(sizes.max())

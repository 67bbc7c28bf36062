"""Shape measures of an element from its corners, as Verdict defines them: scaled Jacobian, ratios, skew, angles.

Verdict is the library behind VTK's and CUBIT's quality filters (Knupp et al., The Verdict Geometric Quality Library,
SAND2007-1751; VTK's copy in ThirdParty/verdict). It differs here in four things, each held by a test:

- An element with an edge of no length is among the worst: its scaled Jacobian is 0 (or less, if another corner says
  so) and its angles are 0 and 180. Verdict gives 1e30, 360 and 0, which would pass for good, and measures as a triangle
  the quadrilateral whose last two nodes coincide, but not that whose first two do.
- Warpage is 1 less the cube of a cosine, as the manual has it, 0 for a flat quadrilateral; the code gives the cube.
- The edge ratio is of all twelve edges; the code takes the longest of six of them.
- Angles come from sine and cosine together: the code's arc cosine loses half the digits near 180 degrees.

Elements are measured relative to their own size, so that a small one is as good as a large one of the same shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import cross

__all__ = ["HEXAHEDRON_FACES", "NO_NUMBER", "Measures", "hexahedron_corner_measures", "quadrilateral_corner_measures"]

Floats = NDArray[np.float64]
Measures = dict[str, Floats]

# The faces of a hexahedron in VTK's order of nodes, run round.
HEXAHEDRON_FACES = ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7), (3, 2, 1, 0), (4, 5, 6, 7))
_HEXAHEDRON_EDGES = np.array(
    [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
).T
# The nodes next to a corner along the three edges that leave it, in right-handed order.
_NEXT_TO_CORNER = np.array([(1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)]).T
# Signs with which corners add up to the principal axes at an element's centre.
_HEXAHEDRON_AXES = np.array([[-1, 1, 1, -1, -1, 1, 1, -1], [-1, -1, 1, 1, -1, -1, 1, 1], [-1] * 4 + [1] * 4], float)
_QUADRILATERAL_AXES = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]], float)

# Verdict's value of what has none, and its limit below which a length or an area, in parts of the element's, is none.
NO_NUMBER = 1e30
_NOTHING = 10 * np.finfo(float).eps


def quadrilateral_corner_measures(corners: Floats) -> Measures:
    """Verdict's measures of quadrilaterals in space (SAND2007-1751, quadrilateral quality metrics).

    With edges e_k from corner k to corner k + 1, corner normals N_k = e_(k-1) x e_k, principal axes
    X_1 = e_0 - e_2, X_2 = e_1 - e_3 and n their unit normal:

    - scaled_jacobian: least N_k . n / (|e_(k-1)| |e_k|)
    - aspect_ratio: longest edge times perimeter over 4 areas, the area being the sum of N_k . n over 4
    - edge_ratio: longest over shortest edge
    - skew: |cos(X_1, X_2)|
    - warpage: 1 - min(cos(N_0, N_2), cos(N_1, N_3))^3
    - min_angle, max_angle: between neighbouring edges, in degrees; the largest is taken from 360 where the
      quadrilateral is not convex

    Parameters
    ----------
    corners : ndarray, shape (3, 4, m)
        Coordinates, in any unit of length.

    Returns
    -------
    dict of str to ndarray, shape (m,)
    """
    corners = _in_parts_of_their_size(corners)
    edges = np.roll(corners, -1, axis=1) - corners
    lengths = _length(edges)
    normals = cross(np.roll(edges, 1, axis=1), edges)
    axes = np.einsum("ak,ckm->cam", _QUADRILATERAL_AXES, corners)
    signed = np.sum(normals * _unit(cross(axes[:, 0], axes[:, 1]))[:, np.newaxis], axis=0)
    products = np.roll(lengths, 1, axis=0) * lengths
    collapsed = np.any(lengths <= _NOTHING, axis=0)
    smallest, largest = _angles(edges, normals, signed, collapsed)
    return {
        "scaled_jacobian": np.where(collapsed, 0.0, _quotient(signed, products, 0.0).min(axis=0)),
        "aspect_ratio": _quotient(lengths.max(axis=0) * lengths.sum(axis=0), signed.sum(axis=0), NO_NUMBER),
        "edge_ratio": _quotient(lengths.max(axis=0), lengths.min(axis=0), NO_NUMBER),
        "skew": np.abs(np.sum(_unit(axes[:, 0]) * _unit(axes[:, 1]), axis=0)),
        "warpage": _warpage(normals),
        "min_angle": smallest,
        "max_angle": largest,
    }


def hexahedron_corner_measures(corners: Floats) -> Measures:
    """Verdict's measures of hexahedra (SAND2007-1751, hexahedral quality metrics), and the worst of their faces'.

    X_1, X_2, X_3 are the principal axes, each the sum of the four edges along it.

    - scaled_jacobian: least determinant of three unit vectors, along the edges that leave a corner, of all eight
      corners, or along the principal axes
    - aspect_ratio: largest |X_i| / |X_j|, Verdict's maximum edge ratio, which CUBIT calls the aspect ratio; of
      Verdict's quadrilateral aspect ratio there is no counterpart
    - edge_ratio: longest over shortest edge, which Abaqus/CAE calls the aspect ratio
    - skew: largest |cos(X_i, X_j)|
    - warpage, min_angle, max_angle: the worst of the faces'

    Parameters
    ----------
    corners : ndarray, shape (3, 8, m)
        Coordinates, in any unit of length, nodes in VTK's order.

    Returns
    -------
    dict of str to ndarray, shape (m,)
    """
    corners = _in_parts_of_their_size(corners)
    axes = np.einsum("ak,ckm->cam", _HEXAHEDRON_AXES, corners)
    axis_lengths = _length(axes)
    legs = [_unit(corners[:, nodes] - corners) for nodes in _NEXT_TO_CORNER]
    towards = _unit(axes)
    lengths = _length(corners[:, _HEXAHEDRON_EDGES[1]] - corners[:, _HEXAHEDRON_EDGES[0]])
    warpage, smallest, largest = zip(*(_face_measures(corners[:, face]) for face in HEXAHEDRON_FACES), strict=True)
    turned = np.max(
        [np.abs(np.sum(towards[:, i] * towards[:, j], axis=0)) for i, j in ((0, 1), (0, 2), (1, 2))], axis=0
    )
    return {
        "scaled_jacobian": np.minimum(_determinant(*legs).min(axis=0), _determinant(*np.moveaxis(towards, 1, 0))),
        "aspect_ratio": _quotient(axis_lengths.max(axis=0), axis_lengths.min(axis=0), NO_NUMBER),
        "edge_ratio": _quotient(lengths.max(axis=0), lengths.min(axis=0), NO_NUMBER),
        "skew": np.where(axis_lengths.min(axis=0) <= _NOTHING, NO_NUMBER, turned),
        "warpage": np.max(warpage, axis=0),
        "min_angle": np.min(smallest, axis=0),
        "max_angle": np.max(largest, axis=0),
    }


def _face_measures(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Warpage, smallest and largest angle of faces already in parts of their element's size."""
    edges = np.roll(corners, -1, axis=1) - corners
    normals = cross(np.roll(edges, 1, axis=1), edges)
    across = _unit(cross(edges[:, 0] - edges[:, 2], edges[:, 1] - edges[:, 3]))
    signed = np.sum(normals * across[:, np.newaxis], axis=0)
    collapsed = np.any(_length(edges) <= _NOTHING, axis=0)
    return _warpage(normals), *_angles(edges, normals, signed, collapsed)


def _angles(edges: Floats, normals: Floats, signed: Floats, collapsed: NDArray[np.bool_]) -> tuple[Floats, Floats]:
    """Smallest and largest angle, in degrees; shape (m,) each."""
    towards = -np.sum(np.roll(edges, 1, axis=1) * edges, axis=0)
    angles = np.degrees(np.arctan2(_length(normals), towards))
    largest = angles.max(axis=0)
    largest = np.where(np.any(signed < 0, axis=0), 360 - largest, largest)
    return np.where(collapsed, 0.0, angles.min(axis=0)), np.where(collapsed, 180.0, largest)


def _warpage(normals: Floats) -> Floats:
    units = _unit(normals)
    cosines = np.minimum(np.sum(units[:, 0] * units[:, 2], axis=0), np.sum(units[:, 1] * units[:, 3], axis=0))
    flat = np.any(np.sum(units * units, axis=0) == 0, axis=0)
    # A corner without a normal says nothing of planes: Verdict takes the cosine for none.
    return np.where(flat, 1.0, 1 - cosines**3)


def _in_parts_of_their_size(corners: Floats) -> Floats:
    """Corners about their mean, in parts of the diagonal of the box round them."""
    diagonals = _length(np.ptp(corners, axis=1))
    sizes = np.where(diagonals > 0, diagonals, 1.0)
    return np.asarray((corners - corners.mean(axis=1, keepdims=True)) / sizes)


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.sum(vectors * vectors, axis=0)))


def _unit(vectors: Floats) -> Floats:
    """Vectors of length 1; of what has none, none."""
    return _quotient(vectors, _length(vectors), 0.0)


def _determinant(a: Floats, b: Floats, c: Floats) -> Floats:
    return np.asarray(np.sum(a * cross(b, c), axis=0))


def _quotient(numerator: Floats, denominator: Floats, otherwise: float) -> Floats:
    """The quotient where the denominator is more than nothing."""
    something = denominator > _NOTHING
    return np.where(something, numerator / np.where(something, denominator, 1.0), otherwise)

"""Finite elements: where their nodes lie and which of them their faces have, in VTK's order.

Abaqus numbers the nodes of 8 and 20 node hexahedra, and of 4 and 10 node tetrahedra, the same way, and their faces S1
to S6, or S4, as they stand here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError

__all__ = ["BOTTOM", "EDGE_FACES", "TETRAHEDRA", "TOP", "ElementType", "element_type", "require_order"]

Integers = NDArray[np.int64]

_CORNERS = [(0, 0), (2, 0), (2, 2), (0, 2)]
_MIDDLES = [(1, 0), (2, 1), (1, 2), (0, 1)]
_HEXAHEDRON = [
    *((a, b, c) for c in (0, 2) for a, b in _CORNERS),
    *((a, b, c) for c in (0, 2) for a, b in _MIDDLES),
    *((a, b, 1) for a, b in _CORNERS),
    *((0, 1, 1), (2, 1, 1), (1, 0, 1), (1, 2, 1), (1, 1, 0), (1, 1, 2)),
    (1, 1, 1),
]
_QUADRILATERAL = [(a, b, 0) for a, b in (*_CORNERS, *_MIDDLES, (1, 1))]
# Corners, middles of the sides, middle; outwards. The bottom, the top, then the sides as a patch's edges are numbered.
_FACES = [
    [0, 3, 2, 1, 11, 10, 9, 8, 24],
    [4, 5, 6, 7, 12, 13, 14, 15, 25],
    [0, 1, 5, 4, 8, 17, 12, 16, 22],
    [1, 2, 6, 5, 9, 18, 13, 17, 21],
    [2, 3, 7, 6, 10, 19, 14, 18, 23],
    [3, 0, 4, 7, 11, 16, 15, 19, 20],
]
BOTTOM, TOP, *EDGE_FACES = range(6)


@dataclass(frozen=True, slots=True, eq=False)
class ElementType:
    """A kind of element.

    Attributes
    ----------
    name : str
        meshio's.
    order : int
        1 linear, 2 quadratic.
    nodes : ndarray of int, shape (nodes, 3)
        Place of each in the element, in halves of its sides: along u, v and across the wall.
    faces : ndarray of int, shape (6 or 4, nodes of a face)
        Nodes of each face of a hexahedron or a tetrahedron, outwards; none of a quadrilateral.
    face_name : str
        meshio's, of the faces.
    """

    name: str
    order: int
    nodes: Integers
    faces: Integers
    face_name: str

    @property
    def sparse(self) -> bool:
        """True where some places halfway along its sides have no node."""
        return len(self.nodes) in (8, 20) and self.order > 1


def _element(name: str, order: int, nodes: Sequence[tuple[int, ...]], face_nodes: int, face_name: str) -> ElementType:
    faces = np.array([face[:face_nodes] for face in _FACES]) if face_nodes else np.zeros((0, 0), dtype=np.int64)
    return ElementType(name, order, np.array(nodes), faces, face_name)


_HEXAHEDRA = [
    _element("hexahedron", 1, _HEXAHEDRON[:8], 4, "quad"),
    _element("hexahedron20", 2, _HEXAHEDRON[:20], 8, "quad8"),
    _element("hexahedron27", 2, _HEXAHEDRON, 9, "quad9"),
]
_QUADRILATERALS = [
    _element("quad", 1, _QUADRILATERAL[:4], 0, ""),
    _element("quad8", 2, _QUADRILATERAL[:8], 0, ""),
    _element("quad9", 2, _QUADRILATERAL, 0, ""),
]


_TETRAHEDRON = [
    (0, 0, 0),
    (2, 0, 0),
    (0, 2, 0),
    (0, 0, 2),
    (1, 0, 0),
    (1, 1, 0),
    (0, 1, 0),
    (0, 0, 1),
    (1, 0, 1),
    (0, 1, 1),
]
_TETRAHEDRON_FACES = np.array([[0, 2, 1, 6, 5, 4], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]])
# Of 4 nodes, and of 10.
TETRAHEDRA = (
    ElementType("tetra", 1, np.array(_TETRAHEDRON[:4]), _TETRAHEDRON_FACES[:, :3], "triangle"),
    ElementType("tetra10", 2, np.array(_TETRAHEDRON), _TETRAHEDRON_FACES, "triangle6"),
)


def require_order(order: int) -> None:
    """Check the order of elements.

    Raises
    ------
    ParameterError
    """
    if order not in (1, 2) or isinstance(order, bool):
        raise ParameterError("order", order, "1 for linear elements or 2 for quadratic ones")


def element_type(solid: bool, order: int, full: bool = False) -> ElementType:
    """The element of an order, of a solid or of a surface.

    Parameters
    ----------
    solid : bool
    order : {1, 2}
    full : bool
        With nodes in the middles of faces and of the element itself, where the order is 2.

    Raises
    ------
    ParameterError
    """
    require_order(order)
    if full and order == 1:
        raise ParameterError("full", full, "none with linear elements, which have nodes at their corners only")
    return (_HEXAHEDRA if solid else _QUADRILATERALS)[order - 1 + full]

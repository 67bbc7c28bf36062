"""All patches of a wall and how they are connected: all that a file of them holds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.tables import Rows, text_table
from gyroid_cad.mesh.nodes import FACE_A, FACE_B, FREE_WALLS
from gyroid_cad.nurbs.volume import NurbsVolume

__all__ = ["BOUNDARY_PARTS", "FACE_CORNERS", "VolumeData"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

BOUNDARY_PARTS = (FACE_B, FACE_A, FREE_WALLS)
# Of faces 0 to 5, turned so that their normals point out of the patch.
FACE_CORNERS = np.array([[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]])
FACE_CORNERS.setflags(write=False)


@dataclass(frozen=True, slots=True, eq=False)
class VolumeData:
    """All patches of a wall and how they are connected, for their writers; :class:`gyroid_cad.VolumePatches` is public.

    Attributes
    ----------
    control_points : ndarray, shape (points, 3)
        In mm. Those of side 0 come first, in the order of :func:`~gyroid_cad.mesh.nodes.patch_nodes`, those of
        side 1 last.
    patch_points : ndarray of int, shape (patches, n, n, k)
        Numbers of the control points of every patch along u, v and w.
    weights : ndarray, shape (n, n, k)
        The same for all patches; k is one more than the degree across the wall.
    knots : ndarray, shape (n + 4,)
        Along u and v, on [-1, 1], symmetric.
    knots_across : ndarray, shape (2 k,)
        Along w, on [0, 1].
    patch_group : ndarray of int, shape (patches,)
        Which bounding cell of its cubic cell a patch belongs to, 0 to 3.
    patch_vertices : ndarray of int, shape (patches, 8)
        Numbers of the patches' corners; a corner at which patches only touch has a number for each of them.
    edges : ndarray of int, shape (edges, 2)
        The vertices each edge joins. Edges opposite each other in a patch run the same way.
    edge_chain : ndarray of int, shape (edges,)
        Edges that lie opposite each other in some patch, and all those in turn, are a chain.
    interfaces : ndarray of int, shape (interfaces, 4)
        Two patches that share a side wall: first patch, its face, second patch, its face. w is the same in both.
    interface_alike : ndarray of bool, shape (interfaces,)
        Whether the parameters that run along the shared side wall rise the same way in both patches.
    boundary : ndarray of int, shape (faces, 3)
        Faces that bound the wall: patch, face, index into BOUNDARY_PARTS.
    """

    control_points: Floats
    patch_points: Integers
    weights: Floats
    knots: Floats
    knots_across: Floats
    patch_group: Integers
    patch_vertices: Integers
    edges: Integers
    edge_chain: Integers
    interfaces: Integers
    interface_alike: Booleans
    boundary: Integers

    def __post_init__(self) -> None:
        freeze_arrays(self)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.rows()[0]
        ('patches', '24 of degrees 3, 3, 1')
        """
        return [
            ("patches", f"{len(self):,} of degrees {', '.join(map(str, self.degrees))}"),
            ("control points", f"{len(self.control_points):,}"),
            ("interfaces", f"{len(self.interfaces):,}"),
        ]

    def __str__(self) -> str:
        return text_table(self.rows())

    def __len__(self) -> int:
        return len(self.patch_points)

    @property
    def degrees(self) -> tuple[int, int, int]:
        """Along u, v and w.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.degrees
        (3, 3, 1)
        """
        along = len(self.knots) - len(self.weights) - 1
        return along, along, int(self.weights.shape[2]) - 1

    @property
    def rational(self) -> bool:
        """True where the weights differ, so that the patches are not polynomial.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.rational
        False
        """
        return bool(np.ptp(self.weights) > 0)

    def patch(self, index: int) -> NurbsVolume:
        """One patch as a volume of its own.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.patch(0).evaluate(0.0, 0.0, 0.5).shape
        (3,)
        """
        points = self.control_points[self.patch_points[index]]
        return NurbsVolume(points, self.weights, self.knots, self.knots, self.knots_across)

"""Elements that share nodes by number, with their sets: all that a file of a mesh holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.common.tables import Rows, text_table
from gyroid_cad.mesh.finite_elements.elements import BOTTOM, EDGE_FACES, TOP, ElementType
from gyroid_cad.mesh.nodes import FACE_A, FACE_B, FREE_WALLS
from gyroid_cad.wall.complex import CellComplex

__all__ = ["MeshData", "Surface", "WrittenMesh", "members"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Surface:
    """Faces of elements.

    Attributes
    ----------
    elements, faces : ndarray of int, shape (faces,)
        Which element, and which of its faces, from 0.
    """

    elements: Integers
    faces: Integers

    def __post_init__(self) -> None:
        freeze_arrays(self)


class WrittenMesh(Protocol):
    """Elements and their sets, as the writers ask for them; ``parts`` are numbers of what each element is one of."""

    @property
    def element(self) -> ElementType: ...

    @property
    def points(self) -> Floats: ...

    @property
    def cells(self) -> Integers: ...

    @property
    def parts(self) -> Integers: ...

    @property
    def dimension(self) -> int: ...

    def regions(self) -> dict[str, Integers]: ...

    def numbers(self) -> dict[str, Integers]: ...

    def surfaces(self) -> dict[str, Surface]: ...

    def surface_nodes(self, surface: Surface) -> Integers: ...

    def node_sets(self) -> dict[str, Integers]: ...

    def element_sets(self) -> dict[str, Integers]: ...


@dataclass(frozen=True, slots=True, eq=False)
class MeshData:
    """Elements that share nodes by number, with their sets, for their writers; :class:`gyroid_cad.Mesh` is public.

    Elements come patch by patch, layer by layer from face B to face A, then along u and v.

    Attributes
    ----------
    complex : CellComplex
    element : ElementType
    subdivisions, layers : int
        Elements along each side of a patch, and across the wall; no layer of a mid-surface.
    points : ndarray, shape (nodes, 3)
        In mm.
    cells : ndarray of int, shape (elements, nodes of an element)
        In VTK's order.
    levels : int
        Of nodes across the wall.
    kept : ndarray of int, shape (nodes,), optional
        Which of all places and levels have a node, if not each does.
    """

    complex: CellComplex
    element: ElementType
    subdivisions: int
    layers: int
    points: Floats
    cells: Integers
    levels: int
    kept: Integers | None = None

    def __post_init__(self) -> None:
        # Made for this mesh alone and by far the largest things about: frozen where they are, not copied.
        for array in (self.points, self.cells, self.kept):
            if array is not None:
                array.setflags(write=False)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> mesh.rows()[0]
        ('elements', '288 hexahedron: 2 x 2 a patch, 3 across the wall')
        """
        n, across = self.subdivisions, f"{self.layers} across the wall" if self.layers else "of the mid-surface"
        return [
            ("elements", f"{len(self.cells):,} {self.element.name}: {n} x {n} a patch, {across}"),
            ("nodes", f"{len(self.points):,}"),
            ("patches", f"{self.complex.patch_count:,}"),
        ]

    def __str__(self) -> str:
        return text_table(self.rows())

    @property
    def element_patch(self) -> Integers:
        """Patch of each element; shape (elements,).

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> int(mesh.element_patch.max())
        23
        """
        return np.arange(len(self.cells)) // (max(self.layers, 1) * self.subdivisions**2)

    @property
    def element_layer(self) -> Integers:
        """Layer of each element, from face B on; shape (elements,).

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> mesh.element_layer[:12].tolist()
        [0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2]
        """
        return np.arange(len(self.cells)) // self.subdivisions**2 % max(self.layers, 1)

    @property
    def columns(self) -> tuple[Integers, Integers]:
        """At which place of the patches' grid, and at which level across the wall, each node stands; shape (nodes,).

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> place, level = mesh.columns
        >>> level[:5].tolist()
        [0, 1, 2, 3, 0]
        """
        numbers = np.arange(len(self.points)) if self.kept is None else self.kept
        return np.divmod(numbers, self.levels)

    @property
    def dimension(self) -> int:
        """Dimension of the elements: 3 of hexahedra, 2 of a mid-surface.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).quadrilaterals(2).dimension
        2
        """
        return 3 if self.layers else 2

    def regions(self) -> dict[str, Integers]:
        """Elements by what they fill: all of them the wall.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2)
        >>> {name: len(elements) for name, elements in mesh.regions().items()}
        {'WALL': 96}
        """
        return {"WALL": np.arange(len(self.cells))}

    @property
    def parts(self) -> Integers:
        """Bounding cell of each element, from 1; shape (elements,).

        Examples
        --------
        >>> int(Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2).parts.max())
        4
        """
        return np.asarray(self.complex.placements.bounding_cell[self.complex.patch_placement][self.element_patch] + 1)

    def numbers(self) -> dict[str, Integers]:
        """Numbers of every element's patch, bounding cell, cubic cell and layer, from 1; shape (elements,) each.

        Examples
        --------
        >>> list(Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2).numbers())
        ['patch', 'bounding_cell', 'cubic_cell', 'layer']
        """
        patch = self.element_patch
        cell_of_patch = np.unique(self.complex.patch_cell, axis=0, return_inverse=True)[1].ravel()
        return {
            "patch": patch + 1,
            "bounding_cell": self.parts,
            "cubic_cell": cell_of_patch[patch] + 1,
            "layer": self.element_layer + 1,
        }

    def surfaces(self) -> dict[str, Surface]:
        """Faces A and B of the wall and its free side walls, as faces of elements; empty of a mid-surface.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> {name: len(surface.elements) for name, surface in mesh.surfaces().items()}
        {'FACE_A': 96, 'FACE_B': 96, 'FREE_WALLS': 216}
        """
        if not self.layers:
            return {}
        n = self.subdivisions
        numbers = np.arange(len(self.cells)).reshape(-1, self.layers, n, n)
        # Edge k of a patch is the row of its elements along side k of the square.
        rows = (numbers[..., 0], numbers[:, :, -1], numbers[..., -1], numbers[:, :, 0])
        free = self.complex.free[self.complex.patch_edges]
        walls = [(row[free[:, k]].ravel(), face) for k, (row, face) in enumerate(zip(rows, EDGE_FACES, strict=True))]
        return {
            FACE_A: _surface([(numbers[:, -1].ravel(), TOP)]),
            FACE_B: _surface([(numbers[:, 0].ravel(), BOTTOM)]),
            FREE_WALLS: _surface(walls),
        }

    def surface_nodes(self, surface: Surface) -> Integers:
        """Nodes of every face of a surface, outwards; shape (faces, nodes of a face).

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> mesh.surface_nodes(mesh.surfaces()["FACE_A"]).shape
        (96, 4)
        """
        return np.asarray(self.cells[surface.elements[:, np.newaxis], self.element.faces[surface.faces]])

    def node_sets(self) -> dict[str, Integers]:
        """Nodes on the surfaces, by their names, ascending.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> list(mesh.node_sets())
        ['FACE_A', 'FACE_B', 'FREE_WALLS']
        """
        return {name: np.unique(self.surface_nodes(surface)) for name, surface in self.surfaces().items()}

    def element_sets(self) -> dict[str, Integers]:
        """Elements by bounding cell, cubic cell and layer: the colours of the paper's Fig. 11.

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2, layers=3)
        >>> list(mesh.element_sets())
        ['BC_1', 'BC_2', 'BC_3', 'BC_4', 'CC_1_1_1', 'LAYER_1', 'LAYER_2', 'LAYER_3']
        """
        patch, layer = self.element_patch, self.element_layer
        bounding_cell = self.complex.placements.bounding_cell[self.complex.patch_placement]
        cell, cell_of_patch = np.unique(self.complex.patch_cell, axis=0, return_inverse=True)
        sets = {f"BC_{k + 1}": np.flatnonzero(bounding_cell[patch] == k) for k in np.unique(bounding_cell).tolist()}
        for k, (x, y, z) in enumerate(cell.tolist()):
            sets[f"CC_{x + 1}_{y + 1}_{z + 1}"] = np.flatnonzero(cell_of_patch.ravel()[patch] == k)
        if self.layers > 1:
            sets |= {f"LAYER_{k + 1}": np.flatnonzero(layer == k) for k in range(self.layers)}
        return sets


def _surface(parts: list[tuple[Integers, int]]) -> Surface:
    elements = np.concatenate([elements for elements, _ in parts])
    return Surface(elements, np.concatenate([np.full(len(elements), face) for elements, face in parts]))


def members(numbers: Integers, count: int) -> NDArray[np.bool_]:
    members = np.zeros(count, dtype=bool)
    members[numbers] = True
    return members

"""The wall as structured hexahedra, and its mid-surface as quadrilaterals: the paper's mesh, with no meshing step.

Every patch is a grid, every wall so many layers of it. Nodes are places of that grid, shared by number through the
complex; nothing is merged by distance.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.memory import require_room
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.data import MeshData
from gyroid_cad.mesh.finite_elements.elements import ElementType, element_type
from gyroid_cad.mesh.finite_elements.files import write_mesh_files
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs
from gyroid_cad.mesh.nodes import patch_nodes, place_count
from gyroid_cad.nurbs.surface import grid_points
from gyroid_cad.wall.offset import Wall

__all__ = ["Mesh", "hexahedra", "quadrilaterals"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of the mesh and of a file that is made of it, for each node of each element; and of what imports take.
_BYTES_PER_ELEMENT_NODE, _BYTES_BEFORE = 60, 300_000_000
# So few that what is computed for them stays in the processor's cache.
_PATCHES_AT_ONCE = 64


@dataclass(frozen=True, slots=True, eq=False)
class Mesh(MeshData):
    """Elements that share nodes by number, with their sets.

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

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> mesh = Lattice(cells=(1, 1, 1), cell_size=10, thickness=0.8).hexahedra(subdivisions=2)
    >>> mesh.cells.shape
    (96, 8)
    """

    def write(
        self,
        *paths: str | os.PathLike[str],
        pairs: PeriodicPairs | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Write files; each path's ending chooses the program. A file appears whole or not at all.

        Sets are physical groups and arrays in Gmsh and VTU files, components in ANSYS files, sets and surfaces in
        Abaqus files, and property numbers (of bounding cells) in NASTRAN files, which know no more.

        Parameters
        ----------
        *paths : path-like
            Ending in .vtu, .msh, .inp, .cdb, .bdf or .nas. All are checked before any is written.
        pairs : PeriodicPairs, optional
            In VTU and Abaqus files.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError, ExportError

        Examples
        --------
        >>> mesh = Lattice((1, 1, 1), 10, thickness=0.8).hexahedra(2)
        >>> mesh.write("cell.inp", "cell.vtu")
        """
        write_mesh_files(self, paths, pairs, progress)


def hexahedra(wall: Wall, subdivisions: int, layers: int = 1, order: int = 1, full: bool = False) -> Mesh:
    """The wall as hexahedra.

    Parameters
    ----------
    wall : Wall
    subdivisions : int
        Elements along each side of a patch.
    layers : int
        Across the wall.
    order : {1, 2}
        Elements of 8 nodes, or of 20.
    full : bool
        Quadratic elements of 27 nodes.

    Returns
    -------
    Mesh

    Raises
    ------
    ParameterError
        Also if memory would not do, saying how much it would take.
    """
    element = element_type(True, order, full)
    return _meshed(wall, _count("subdivisions", subdivisions), _count("layers", layers), element)


def quadrilaterals(wall: Wall, subdivisions: int, order: int = 1, full: bool = False) -> Mesh:
    """The mid-surface as quadrilaterals.

    Parameters
    ----------
    wall : Wall
    subdivisions : int
        Elements along each side of a patch.
    order : {1, 2}
        Elements of 4 nodes, or of 8.
    full : bool
        Quadratic elements of 9 nodes.

    Returns
    -------
    Mesh

    Raises
    ------
    ParameterError
    """
    return _meshed(wall, _count("subdivisions", subdivisions), 0, element_type(False, order, full))


def _count(parameter: str, value: int) -> int:
    if not isinstance(value, Integral) or isinstance(value, bool) or value < 1:
        raise ParameterError(parameter, value, "a whole number from 1 on")
    return int(value)


def _meshed(wall: Wall, subdivisions: int, layers: int, element: ElementType) -> Mesh:
    _require_room(wall.complex.patch_count, subdivisions, layers, element)
    steps = element.order * subdivisions
    across = np.linspace(0, 1, element.order * layers + 1) if layers else np.array([0.5])
    points = _nodes(wall, steps, across)
    cells = _cells(patch_nodes(wall.complex, steps), len(across), element)
    kept = None
    if element.sparse:
        kept, numbers = np.unique(cells, return_inverse=True)
        points, cells = points[kept], numbers.reshape(cells.shape)
    return Mesh(wall.complex, element, subdivisions, layers, points, cells, len(across), kept)


def _require_room(patches: int, subdivisions: int, layers: int, element: ElementType) -> None:
    """Refuse a mesh that does not fit in memory."""
    elements = patches * subdivisions**2 * max(layers, 1)
    needed = elements * _BYTES_PER_ELEMENT_NODE * len(element.nodes)

    def accepted(left: int) -> str:
        return f"at most about {max(1, int(subdivisions * (left / needed) ** 0.5))} with {max(layers, 1)} layers"

    require_room("subdivisions", subdivisions, needed, accepted, False, _BYTES_BEFORE, f"these {elements:,} elements")


def _nodes(wall: Wall, steps: int, levels: Floats) -> Floats:
    """Points at every place of the grid and every level across the wall, level by level; shape (nodes, 3)."""
    patches = wall.complex.patch_count
    points = np.empty((place_count(wall.complex, steps), len(levels), 3))
    inside = points[len(points) - patches * (steps - 1) ** 2 :].reshape(patches, -1, len(levels), 3)
    border = _on_border(steps)
    alike = len(wall.nets) <= _PATCHES_AT_ONCE
    known = _split_grids(wall, slice(None), steps, levels) if alike else None
    for first in range(0, patches, _PATCHES_AT_ONCE):
        some = slice(first, first + _PATCHES_AT_ONCE)
        nets = wall.patch_net[some]
        within, around = _split_grids(wall, nets, steps, levels) if known is None else (part[nets] for part in known)
        shifts = wall.shifts[wall.patch_shift[some]][:, np.newaxis, np.newaxis]
        # Axis by axis: loops of three would be too short.
        for axis in range(3):
            np.add(within[..., axis], shifts[..., axis], out=inside[some][..., axis])
        points[patch_nodes(wall.complex, steps, some).reshape(len(nets), -1)[:, border]] = around + shifts
    return points.reshape(-1, 3)


def _split_grids(wall: Wall, nets: Integers | slice, steps: int, levels: Floats) -> tuple[Floats, Floats]:
    """Points inside nets and on their borders, before their translations; shapes (nets, places, levels, 3)."""
    grids = _grids(wall, nets, steps, levels)
    grids = grids.reshape(len(grids), -1, len(levels), 3)
    border = _on_border(steps)
    return grids[:, ~border], grids[:, border]


def _on_border(steps: int) -> NDArray[np.bool_]:
    """Mask of the places of a patch's grid, in one row, that lie on its border."""
    border = np.ones((steps + 1, steps + 1), dtype=bool)
    border[1:-1, 1:-1] = False
    return border.ravel()


def _grids(wall: Wall, nets: Integers | slice, steps: int, levels: Floats) -> Floats:
    along = np.linspace(-1, 1, steps + 1)
    faces = grid_points(wall.nets[nets], wall.weights, (wall.knots, wall.knots), along, along)
    below, above = faces[:, 0, :, :, np.newaxis], faces[:, 1, :, :, np.newaxis]
    return np.asarray(below + levels[:, np.newaxis] * (above - below))


def _cells(places: Integers, levels: int, element: ElementType) -> Integers:
    """Elements on grids of places (patches, steps + 1, steps + 1), each of which has a node at every level."""
    order, side = element.order, places.shape[1]
    u, v, w = (element.nodes * order // 2).T
    across, along = np.arange(0, max(levels - 1, 1), order), np.arange(0, side - 1, order)
    # Of a patch's own nodes, in rows along v, u and the layers: the same for every patch.
    of_patch = (
        ((along[:, np.newaxis, np.newaxis] + u) * side + along[:, np.newaxis] + v) * levels
        + across[:, np.newaxis, np.newaxis, np.newaxis]
        + w
    )
    nodes = (places[..., np.newaxis] * levels + np.arange(levels)).reshape(len(places), -1)
    return np.asarray(nodes.take(of_patch.ravel(), axis=1).reshape(-1, len(w)))

"""The wall as conforming trivariate NURBS patches: what isogeometric analysis needs to know of it.

Every patch of the lattice is one volume: u and v run along the wall as on its faces, w across it from side 0 to
side 1. All patches have the same knots and weights. Control points are numbered through the complex, so that patches
share those of their common side walls; nothing is merged by distance.

Faces of a patch are numbered 0 to 5: u, v and w at their start and end. Its corners stand as those of a hexahedron
in VTK and MFEM: round side 0, then round side 1.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from numbers import Integral

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.graph import connected
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.iga.data import BOUNDARY_PARTS, VolumeData
from gyroid_cad.mesh.iga.files import write_field_files, write_volume_files
from gyroid_cad.mesh.nodes import FREE_WALLS, patch_nodes, place_count
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.offset import SIDES, Wall

__all__ = ["DEGREES_ACROSS", "VolumePatches", "periodic_points", "wall_volumes"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

DEGREES_ACROSS = (1, 3)

# The face on edge k of a patch: v = -1, u = 1, v = 1, u = -1.
_FACE_OF_EDGE = np.array([2, 1, 3, 0])
_SIDE_FACES = (4, 5)
_FREE = BOUNDARY_PARTS.index(FREE_WALLS)
# So many patches' control points at a time stay in the processor's cache.
_PATCHES_AT_ONCE = 64


@dataclass(frozen=True, slots=True, eq=False)
class VolumePatches(VolumeData):
    """All patches of a wall and how they are connected.

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

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> volumes = Lattice(cells=(1, 1, 1), cell_size=10, thickness=0.8).volumes(degree=3)
    >>> len(volumes), volumes.degrees
    (24, (3, 3, 3))
    """

    def write(self, *paths: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write files; each path's ending chooses the format. A file appears whole or not at all.

        - ``.mesh``: MFEM's NURBS mesh v1.0 with its patches' control points (mfem.org/mesh-formats). Attributes of
          elements are ``patch_group`` + 1, those of the boundary the place in BOUNDARY_PARTS + 1. Knot vectors are
          numbered by the chains of edges.
        - ``.xml``: G+Smo's multipatch of TensorBSpline3, or of TensorNurbs3 if the weights differ, with its interfaces
          and boundary by name.
        - ``.json``, ``.npz``: the arrays of this class under their own names.

        Parameters
        ----------
        *paths : path-like
            All are checked before any is written.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError
            If an ending is unknown or a file cannot be put there.
        ExportError
            If writing failed.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.write("cell.xml", "cell.mesh")
        """
        write_volume_files(self, paths, progress)

    def write_field(self, values: ArrayLike, *paths: str | os.PathLike[str]) -> None:
        """Write a scalar field in the space of the patches as MFEM's GridFunction, for the mesh written with them.

        MFEM numbers control points its own way. This file holds the field patch by patch ("NURBS_patches",
        ``NURBSExtension::LoadSolution``), so that reading it puts every value where it belongs: a field to start from,
        or, if the values are the control points' numbers, a dictionary between both ways of numbering.

        Parameters
        ----------
        values : array_like, shape (points,)
            By control point: the coefficients of the field.
        *paths : path-like
            Ending in ``.gf``.

        Raises
        ------
        ParameterError
            If the values are not one for each control point, or a file cannot be put there.
        ExportError
            If writing failed.

        Examples
        --------
        >>> volumes = Lattice((1, 1, 1), 10, thickness=0.8).volumes()
        >>> volumes.write_field(volumes.control_points[:, 2], "height.gf")
        """
        write_field_files(self, values, paths)


def wall_volumes(wall: Wall, degree: int = 1) -> VolumePatches:
    """Describe a wall, uniform, graded or mapped, by its trivariate patches.

    Parameters
    ----------
    wall : Wall
    degree : {1, 3}
        Across the wall. The wall is ruled, so it has degree 1; 3 is the same wall by degree elevation of its lines
        (The NURBS Book, sec. 5.5), for finer solutions.

    Returns
    -------
    VolumePatches

    Raises
    ------
    ParameterError
        If the degree is another.
    """
    if isinstance(degree, bool) or not isinstance(degree, Integral) or degree not in DEGREES_ACROSS:
        raise ParameterError("degree", degree, f"{' or '.join(map(str, DEGREES_ACROSS))}, across the wall")
    complex, levels = wall.complex, int(degree) + 1
    points, numbers = _control_points(wall, levels)
    edges, chain = _edges(complex)
    interfaces, alike = _interfaces(complex)
    return VolumePatches(
        control_points=points,
        patch_points=numbers,
        weights=np.repeat(wall.weights[..., np.newaxis], levels, axis=2),
        knots=wall.knots,
        knots_across=np.repeat([0.0, 1.0], levels),
        patch_group=complex.placements.bounding_cell[complex.patch_placement],
        patch_vertices=np.concatenate([complex.patch_fans + side * complex.fan_count for side in SIDES], axis=1),
        edges=edges,
        edge_chain=chain,
        interfaces=interfaces,
        interface_alike=alike,
        boundary=_boundary(complex),
    )


def periodic_points(wall: Wall, volumes: VolumePatches) -> Integers:
    """Numbers of the control points where opposite ends of the block of cells are one, as in an endless lattice.

    Parameters
    ----------
    wall : Wall
        Of whole cells, all alike.
    volumes : VolumePatches
        Of that wall.

    Returns
    -------
    ndarray of int, shape (points,)
        For each control point its number in the endless lattice, from 0.

    Raises
    ------
    ParameterError
        If the wall is no block of whole cells.
    """
    complex = wall.complex
    endless = build_complex(complex.cells, complex.placements, closed=(True, True, True))
    if not np.array_equal(complex.patch_cell, endless.patch_cell):
        raise ParameterError("wall", f"{complex.patch_count} patches", "a block of whole cells")
    steps = len(wall.weights) - 1
    levels = np.arange(volumes.weights.shape[2]) * place_count(endless, steps)
    numbers = np.empty(len(volumes.control_points), dtype=np.int64)
    numbers[volumes.patch_points] = patch_nodes(endless, steps)[..., np.newaxis] + levels
    return numbers


def _control_points(wall: Wall, levels: int) -> tuple[Floats, Integers]:
    """Distinct control points and, for each patch, their numbers."""
    steps = len(wall.weights) - 1
    count = place_count(wall.complex, steps)
    places = patch_nodes(wall.complex, steps)
    points = np.empty((levels, count, 3))
    across = np.linspace(0.0, 1.0, levels).reshape(-1, 1, 1, 1, 1)
    for first in range(0, len(places), _PATCHES_AT_ONCE):
        chosen = slice(first, first + _PATCHES_AT_ONCE)
        shift = wall.shifts[wall.patch_shift[chosen], np.newaxis, np.newaxis]
        below, above = (wall.nets[wall.patch_net[chosen], side] + shift for side in SIDES)
        # Both ends exactly as the wall has them.
        points[:, places[chosen]] = np.where(across < 1, below + across * (above - below), above)
    numbers = places[..., np.newaxis] + np.arange(levels) * count
    return points.reshape(-1, 3), numbers


def _edges(complex: CellComplex) -> tuple[Integers, Integers]:
    """Edges of the volumes, opposite ones the same way round, and which chain each belongs to.

    Followed from patch to patch, opposite edges make strips of the surface. The surface has two sides, so a strip
    closes up as a ring and never as a Moebius band: no edge is opposite itself reversed.
    """
    count = complex.edge_count
    firsts, seconds = [], []
    for k in (0, 1):
        near, far = complex.patch_edges[:, k], complex.patch_edges[:, k + 2]
        # Round the patch opposite edges run against each other.
        alike = complex.edge_forward[:, k] != complex.edge_forward[:, k + 2]
        for reversed_ in (0, 1):
            firsts.append(near + count * reversed_)
            seconds.append(far + count * np.where(alike, reversed_, 1 - reversed_))
    labels = connected(2 * count, np.concatenate(firsts), np.concatenate(seconds))
    forward, backward = labels[:count], labels[count:]
    if np.any(forward == backward):
        raise ValueError("placements are no surface of two sides: a strip of patches closes up reversed")
    chain = np.unique(np.minimum(forward, backward), return_inverse=True)[1].ravel()
    ends = np.where((forward < backward)[:, np.newaxis], complex.edge_fans, complex.edge_fans[:, ::-1])
    fans = np.arange(complex.fan_count)
    across = np.stack([fans, fans + complex.fan_count], axis=1)
    edges = np.concatenate([*(ends + side * complex.fan_count for side in SIDES), across])
    # Every edge across the wall is opposite those of its patch: one chain for each piece of the lattice.
    piece = np.empty(complex.fan_count, dtype=np.int64)
    piece[complex.patch_fans] = complex.patch_component[:, np.newaxis]
    return edges, np.concatenate([chain, chain, chain.max() + 1 + piece])


def _interfaces(complex: CellComplex) -> tuple[Integers, Booleans]:
    """Pairs of faces that are one side wall, and whether the parameters along it rise the same way."""
    order = np.argsort(complex.patch_edges.ravel(), kind="stable")
    edges = complex.patch_edges.ravel()[order]
    pairs = np.flatnonzero(np.diff(edges) == 0)
    first, second = (np.divmod(order[pairs + step], 4) for step in (0, 1))
    interfaces = np.stack([first[0], _FACE_OF_EDGE[first[1]], second[0], _FACE_OF_EDGE[second[1]]], axis=1)
    # Along edges 0 and 1 a parameter rises as the patch runs, along 2 and 3 it falls.
    rises = [complex.edge_forward[patch, k] == (k < 2) for patch, k in (first, second)]
    return interfaces, np.asarray(rises[0] == rises[1])


def _boundary(complex: CellComplex) -> Integers:
    patches = np.arange(complex.patch_count)
    free, k = np.nonzero(complex.free[complex.patch_edges])
    parts = [
        *(
            (patches, np.full_like(patches, face), np.full_like(patches, side))
            for side, face in zip(SIDES, _SIDE_FACES, strict=True)
        ),
        (free, _FACE_OF_EDGE[k], np.full_like(free, _FREE)),
    ]
    return np.concatenate([np.stack(part, axis=1) for part in parts])

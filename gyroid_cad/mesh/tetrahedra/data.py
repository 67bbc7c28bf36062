"""Tetrahedra of the bodies of a part, with their regions and the named faces between and round them."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.progress import Progress
from gyroid_cad.common.tables import Rows, text_table
from gyroid_cad.mesh.finite_elements.data import Surface
from gyroid_cad.mesh.finite_elements.elements import TETRAHEDRA, ElementType
from gyroid_cad.mesh.finite_elements.files import write_mesh_files
from gyroid_cad.mesh.tetrahedra.measures import cell_volumes, mean_ratios

__all__ = ["TetrahedralMesh"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class TetrahedralMesh:
    """Tetrahedra of bodies that share nodes where they share faces; :meth:`gyroid_cad.Filled.mesh` makes them.

    Attributes
    ----------
    points : ndarray, shape (nodes, 3)
        In mm; those on the surface lie on the exact faces.
    cells : ndarray of int, shape (tetrahedra, 4 or 10)
        In VTK's order, region by region.
    names : tuple of str
        Of the regions.
    parts : ndarray of int, shape (tetrahedra,)
        Number of the region of each, from 1.
    boundaries : dict of Surface
        Faces of tetrahedra by the name of the face of the bodies that they lie on.
    exact_volumes : dict of float
        Of the bodies, by the names of the regions, in mm3.

    Examples
    --------
    >>> corners, floor = np.vstack([np.zeros(3), np.eye(3)]), Surface(np.array([0]), np.array([0]))
    >>> one = np.array([[0, 1, 2, 3]])
    >>> mesh = TetrahedralMesh(corners, one, ("rock",), np.array([1]), {"floor": floor}, {"rock": 1 / 6})
    >>> print(mesh)
    elements    1 tetra
    nodes       4
    rock        1 elements, 0.16666667 mm3, +0.0e+00 of the exact one
    mean ratio  0.840 at least, near (0.25, 0.25, 0.25); 0.840 in the mean
    >>> {name: nodes.tolist() for name, nodes in mesh.node_sets().items()}
    {'floor': [0, 1, 2]}
    """

    points: Floats
    cells: Integers
    names: tuple[str, ...]
    parts: Integers
    boundaries: dict[str, Surface]
    exact_volumes: dict[str, float]

    # Neither layers nor patches, as meshes of lattices have: all of it is solid.
    dimension = 3

    @property
    def element(self) -> ElementType:
        """Kind of the elements."""
        return TETRAHEDRA[self.cells.shape[1] > 4]

    def regions(self) -> dict[str, Integers]:
        """Tetrahedra of each region."""
        return {name: np.flatnonzero(self.parts == number) for number, name in enumerate(self.names, 1)}

    def numbers(self) -> dict[str, Integers]:
        """Numbers that files have of each element: of its region, from 1."""
        return {"region": self.parts}

    def surfaces(self) -> dict[str, Surface]:
        """Faces of tetrahedra by name; those between two regions are faces of the first one's."""
        return dict(self.boundaries)

    def surface_nodes(self, surface: Surface) -> Integers:
        """Nodes of every face of a surface, outwards; shape (faces, nodes of a face)."""
        return np.asarray(self.cells[surface.elements[:, np.newaxis], self.element.faces[surface.faces]])

    def node_sets(self) -> dict[str, Integers]:
        """Nodes on the named faces, ascending."""
        return {name: np.unique(self.surface_nodes(surface)) for name, surface in self.boundaries.items()}

    def element_sets(self) -> dict[str, Integers]:
        """Sets of elements beside the regions: none."""
        return {}

    def volumes(self) -> dict[str, float]:
        """Volumes of the regions as they are meshed, in mm3."""
        sums = np.bincount(self.parts, cell_volumes(self.points, self.cells), len(self.names) + 1)
        return dict(zip(self.names, sums[1:].tolist(), strict=True))

    def mean_ratios(self) -> Floats:
        """Mean ratio of each tetrahedron: 1 of a regular one, 0 of a flat one; shape (tetrahedra,)."""
        return mean_ratios(self.points, self.cells)

    def rows(self) -> Rows:
        """Subject and finding, line by line, as they are printed."""
        volumes, ratios = self.volumes(), self.mean_ratios()
        worst = int(ratios.argmin())
        place = ", ".join(f"{x:.4g}" for x in self.points[self.cells[worst, :4]].mean(axis=0))
        return [
            ("elements", f"{len(self.cells):,} {self.element.name}"),
            ("nodes", f"{len(self.points):,}"),
            *(
                (
                    name,
                    f"{len(own):,} elements, {volumes[name]:.8g} mm3, {self._off(name, volumes):+.1e} of the exact one",
                )
                for name, own in self.regions().items()
            ),
            ("mean ratio", f"{ratios.min():.3f} at least, near ({place}); {ratios.mean():.3f} in the mean"),
        ]

    def as_dict(self) -> dict[str, object]:
        """Counts and measures, for JSON."""
        return {
            "element": self.element.name,
            "elements": len(self.cells),
            "nodes": len(self.points),
            "regions": {name: len(own) for name, own in self.regions().items()},
            "surfaces": {name: len(surface.elements) for name, surface in self.boundaries.items()},
            "volumes": self.volumes(),
            "mean_ratio": float(self.mean_ratios().min()),
        }

    def __str__(self) -> str:
        return text_table(self.rows())

    def _off(self, name: str, volumes: dict[str, float]) -> float:
        return volumes[name] / self.exact_volumes[name] - 1

    def write(self, *paths: str | os.PathLike[str], progress: Progress | None = None) -> None:
        """Write files; each path's ending chooses the program. A file appears whole or not at all.

        Regions and named faces are physical groups in Gmsh files, sets and surfaces in Abaqus files, components in
        ANSYS files, an array "region" and arrays of nodes in VTU files, and property numbers in NASTRAN files, which
        know no more.

        Parameters
        ----------
        *paths : path-like
            Ending in .vtu, .msh, .inp, .cdb, .bdf or .nas. All are checked before any is written.
        progress : callable, optional
            Called with (stage, done, total).

        Raises
        ------
        ParameterError, ExportError
        """
        write_mesh_files(self, paths, None, progress)

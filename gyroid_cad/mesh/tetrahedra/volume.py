"""The space between triangles filled with tetrahedra by Netgen, and looked at: nothing missing, nothing twice.

Netgen (LGPL) keeps the triangles it is given and fills all regions in one go, so that tetrahedra of neighbours share
their nodes. It is asked for the volume alone: of the faces of trimmed lattices, whose borders cut off slivers, neither
it nor Gmsh meshed a ball of 185 faces.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.mesh.tetrahedra.exact import ExactPanels
from gyroid_cad.mesh.tetrahedra.measures import EDGES, FACES, cell_volumes
from gyroid_cad.mesh.tetrahedra.remesh import panels_round
from gyroid_cad.mesh.tetrahedra.surface import SurfaceMesh, sides_of

__all__ = ["Volume", "filled_volume", "require_netgen", "with_middles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """Tetrahedra, and which of their faces lie on panels.

    Attributes
    ----------
    points : ndarray, shape (nodes, 3)
        In mm, those of the surface first.
    cells : ndarray of int, shape (tetrahedra, 4 or 10)
        In VTK's order, region by region.
    regions : ndarray of int, shape (tetrahedra,)
        From 1.
    elements, faces : ndarray of int, shape (triangles, 2)
        Tetrahedra on both sides of each triangle of the surface, the region it was turned out of first, and which of
        their faces it is; -1 where there is none.
    """

    points: Floats
    cells: Integers
    regions: Integers
    elements: Integers
    faces: Integers


def require_netgen() -> None:
    """Check that the mesher is installed.

    Raises
    ------
    ParameterError
    """
    if find_spec("netgen") is None:
        raise ParameterError(
            "output", "a mesh of tetrahedra", "another ending, or Netgen installed: pip install 'gyroid_cad[mesh]'"
        )


def filled_volume(mesh: SurfaceMesh, sides: Integers, size: float) -> Volume:
    """Tetrahedra between triangles.

    Parameters
    ----------
    mesh : SurfaceMesh
    sides : ndarray of int, shape (panels, 2)
        Regions on both sides of each panel, from 1: that which its triangles are turned out of, and the other; 0 is
        outside.
    size : float
        Largest length of an edge, about, in mm.

    Raises
    ------
    KernelError
        If Netgen fails, or some of the space is left empty or filled twice.
    """
    with TemporaryDirectory() as folder:
        given, made = Path(folder) / "given.npz", Path(folder) / "made.npz"
        arrays = {"points": mesh.points, "triangles": mesh.triangles, "panels": mesh.panels}
        np.savez(given, allow_pickle=False, **arrays, sides=sides, size=size)
        command = [sys.executable, "-m", "gyroid_cad.mesh.tetrahedra.netgen_run", str(given), str(made)]
        run = subprocess.run(command, capture_output=True, check=False)
        if run.returncode or not made.exists():
            raise KernelError("Netgen filled the triangles with no tetrahedra")
        with np.load(made) as found:
            points, cells, regions = found["points"], found["cells"], found["regions"]
    if np.abs(points[: len(mesh.points)] - mesh.points).max() > 0:
        raise KernelError("Netgen moved the triangles that it was given")
    order = np.argsort(regions, kind="stable")
    cells, regions = cells[order], regions[order]
    if not len(cells) or cell_volumes(points, cells).min() <= 0:
        raise KernelError("Netgen left tetrahedra that are flat or turned inside out")
    return Volume(points, cells, regions, *_on_surface(mesh, sides, cells, regions))


def _on_surface(mesh: SurfaceMesh, sides: Integers, cells: Integers, regions: Integers) -> tuple[Integers, Integers]:
    """Tetrahedra and faces on both sides of each triangle, once all faces of tetrahedra are accounted for.

    Raises
    ------
    KernelError
    """
    faces = cells[:, FACES].reshape(-1, 3)
    owner = regions.repeat(len(FACES))
    both = np.concatenate([mesh.triangles, faces])
    _, number, uses = np.unique(np.sort(both, axis=1), axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    of_triangle, of_face = number[: len(mesh.triangles)], number[len(mesh.triangles) :]
    inner = np.bincount(of_triangle, minlength=len(uses)) == 0
    low, high = np.full(len(uses), len(uses)), np.zeros(len(uses), dtype=np.int64)
    np.minimum.at(low, of_face, owner)
    np.maximum.at(high, of_face, owner)
    if (uses[inner] != 2).any() or (low[inner] != high[inner]).any():
        raise KernelError("tetrahedra between the triangles are missing, or there twice")
    elements, which = np.full((2, len(mesh.triangles), 2), -1)
    index = np.full(len(uses), -1)
    index[of_triangle] = np.arange(len(of_triangle))
    triangle, position = index[of_face], np.arange(len(faces))
    for side in (0, 1):
        wanted = sides[mesh.panels, side]
        some = position[(triangle >= 0) & (owner == wanted[triangle])]
        elements[triangle[some], side], which[triangle[some], side] = np.divmod(some, len(FACES))
    found = (elements >= 0).sum(axis=1)
    if (found != (sides[mesh.panels] > 0).sum(axis=1)).any() or (uses[of_triangle] != found + 1).any():
        raise KernelError("tetrahedra beside the triangles are missing")
    return elements, which


def with_middles(volume: Volume, mesh: SurfaceMesh, exact: ExactPanels) -> Volume:
    """Tetrahedra of 10 nodes: those in the middles of edges on the surface lie on the exact faces.

    Parameters
    ----------
    volume : Volume
        Of tetrahedra of 4 nodes.
    mesh : SurfaceMesh
        That bounds them.
    exact : ExactPanels
    """
    ends = np.sort(volume.cells[:, EDGES].reshape(-1, 2), axis=1)
    count = len(volume.points)
    keys, of = np.unique(ends[:, 0] * count + ends[:, 1], return_inverse=True)
    middles = (volume.points[keys // count] + volume.points[keys % count]) / 2
    sides = sides_of(mesh)
    at = np.searchsorted(keys, sides.ends[:, 0] * count + sides.ends[:, 1])
    points = mesh.points[sides.ends].mean(axis=1)
    points[sides.creases] = exact.along_creases(points[sides.creases], sides.keys[sides.creases])
    # A side lies on the panels of the triangles that have it.
    by_side = SurfaceMesh(points, sides.of, mesh.panels)
    middles[at] = exact.exact(points, panels_round(by_side, np.arange(len(points))))
    cells = np.concatenate([volume.cells, count + of.reshape(-1, len(EDGES))], axis=1)
    return Volume(np.concatenate([volume.points, middles]), cells, volume.regions, volume.elements, volume.faces)

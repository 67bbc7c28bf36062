"""Meshes of a lattice's wall, checked: whole patches only, and no element turned inside out."""

from __future__ import annotations

import numpy as np

from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh, hexahedra, quadrilaterals
from gyroid_cad.mesh.finite_elements.quality import Quality, inverted, quality_report
from gyroid_cad.mesh.iga.patches import VolumePatches, wall_volumes
from gyroid_cad.wall.fitted import FittedWall

__all__ = ["hexahedral_mesh", "lattice_volumes", "mesh_quality", "quadrilateral_mesh"]

_QUADRILATERAL_CORNERS = 4


def hexahedral_mesh(fitted: FittedWall, subdivisions: int, layers: int, order: int, full: bool) -> Mesh:
    """Hexahedra of a lattice's wall; see :func:`gyroid_cad.mesh.finite_elements.hexahedra.hexahedra`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed, or an element would be turned inside out: then it says where.
    """
    _require_whole_patches(fitted)
    mesh = hexahedra(fitted.wall, subdivisions, layers, order, full)
    # Of patches that are alike one is looked at.
    patches = np.unique(fitted.wall.patch_net, return_index=True)[1]
    nodes = mesh.cells.shape[1]
    elements = mesh.cells.reshape(fitted.complex.patch_count, -1, nodes)[patches].reshape(-1, nodes)
    bad = inverted(mesh.points, elements)
    if len(bad.elements):
        worst = int(np.argmin(bad.determinants))
        where = ", ".join(f"{x:.4g}" for x in bad.places[worst])
        raise ParameterError(
            "thickness",
            fitted.max_thickness,
            f"a thinner wall, or more than {subdivisions} subdivisions: near ({where}) mm an element of the mesh is "
            f"turned inside out, and {len(bad.elements) - 1} others of {len(elements)}",
        )
    return mesh


def quadrilateral_mesh(fitted: FittedWall, subdivisions: int, order: int, full: bool) -> Mesh:
    """Quadrilaterals of a lattice's mid-surface; see :func:`gyroid_cad.mesh.finite_elements.hexahedra.quadrilaterals`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed.
    """
    _require_whole_patches(fitted)
    return quadrilaterals(fitted.wall, subdivisions, order, full)


def lattice_volumes(fitted: FittedWall, degree: int) -> VolumePatches:
    """A lattice's wall as trivariate patches; see :func:`gyroid_cad.mesh.iga.patches.wall_volumes`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed.
    """
    _require_whole_patches(fitted)
    return wall_volumes(fitted.wall, degree)


def mesh_quality(mesh: Mesh) -> Quality:
    """Measure the quality of a mesh's elements; of quadrilaterals the corners are measured.

    Parameters
    ----------
    mesh : Mesh

    Returns
    -------
    Quality
    """
    return quality_report(mesh.points, mesh.cells if mesh.layers else mesh.cells[:, :_QUADRILATERAL_CORNERS])


def _require_whole_patches(fitted: FittedWall) -> None:
    if fitted.spec.trimmed:
        raise ParameterError("trim", "box", "none with meshes and volumes, which are made of whole patches")

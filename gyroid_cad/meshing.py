"""From a lattice's wall to its meshes, checked: whole patches only, and no element turned inside out."""

from __future__ import annotations

from gyroid_cad.errors import ParameterError
from gyroid_cad.laying import LaidWall
from gyroid_cad.mesh.hexahedra import Mesh, hexahedra, quadrilaterals

__all__ = ["hexahedral_mesh", "quadrilateral_mesh"]


def hexahedral_mesh(laid: LaidWall, subdivisions: int, layers: int, order: int, full: bool) -> Mesh:
    """Hexahedra of a lattice's wall; see :func:`gyroid_cad.mesh.hexahedra.hexahedra`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed, or an element would be turned inside out: then it says where.
    """
    _require_whole_patches(laid)
    return hexahedra(laid.wall, subdivisions, layers, order, full)


def quadrilateral_mesh(laid: LaidWall, subdivisions: int, order: int, full: bool) -> Mesh:
    """Quadrilaterals of a lattice's mid-surface; see :func:`gyroid_cad.mesh.hexahedra.quadrilaterals`.

    Raises
    ------
    ParameterError
        If the lattice is trimmed.
    """
    _require_whole_patches(laid)
    return quadrilaterals(laid.wall, subdivisions, order, full)


def _require_whole_patches(laid: LaidWall) -> None:
    if laid.recipe.boxed:
        raise ParameterError("trim", "box", "none with meshes and volumes, which are made of whole patches")

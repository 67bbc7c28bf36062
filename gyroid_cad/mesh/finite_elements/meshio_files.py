"""Meshes as files through meshio: VTU, Gmsh and NASTRAN."""

from __future__ import annotations

from io import StringIO
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ExportError
from gyroid_cad.mesh.finite_elements.data import WrittenMesh, members
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs

__all__ = ["write_gmsh", "write_nastran", "write_vtu"]

Integers = NDArray[np.int64]

_NASTRAN_DIGITS = 10


def _write(mesh: Any, path: Path, file_format: str, **options: Any) -> None:

    try:
        meshio.write(path, mesh, file_format=file_format, **options)
    except meshio.WriteError as problem:
        raise ExportError(f"the mesh was not written: {problem}") from problem


def write_vtu(mesh: WrittenMesh, path: Path, pairs: PeriodicPairs | None) -> None:
    """Write VTU with node sets, periodic pairs and numbers of cells.

    Raises
    ------
    ExportError
    """

    at_nodes: dict[str, Any] = {
        name.lower(): members(nodes, len(mesh.points)).astype(np.int8) for name, nodes in mesh.node_sets().items()
    }
    if pairs is not None:
        # The node that each is a copy of, itself where it is none.
        at_nodes["periodic_first"] = np.arange(len(mesh.points))
        at_nodes["periodic_first"][pairs.second] = pairs.first
    cells = [(mesh.element.name, mesh.cells)]
    numbers = {name: [ids] for name, ids in mesh.numbers().items()}
    _write(meshio.Mesh(mesh.points, cells, at_nodes, numbers), path, "vtu")


def write_gmsh(mesh: WrittenMesh, path: Path) -> None:
    """Write Gmsh 2.2 with the regions and their surfaces as physical groups; bounding cells are entities.

    Raises
    ------
    ExportError
    """

    blocks = [(mesh.element.name, mesh.cells)]
    regions = mesh.regions()
    groups, entities = [np.zeros(len(mesh.cells), dtype=np.int64)], [mesh.parts]
    names = {}
    for group, (name, elements) in enumerate(regions.items(), 1):
        groups[0][elements] = group
        names[name] = np.array([group, mesh.dimension])
    for group, (name, surface) in enumerate(mesh.surfaces().items(), len(regions) + 1):
        blocks.append((mesh.element.face_name, mesh.surface_nodes(surface)))
        groups.append(np.full(len(surface.elements), group))
        entities.append(np.full(len(surface.elements), group))
        names[name] = np.array([group, 2])
    data = {"gmsh:physical": groups, "gmsh:geometrical": entities}
    _write(meshio.Mesh(mesh.points, blocks, cell_data=data, field_data=names), path, "gmsh22", binary=True)


def write_nastran(mesh: WrittenMesh, path: Path) -> None:
    """Write a whole NASTRAN deck, without materials and loads; bounding cells or regions are properties."""

    # meshio has 16 characters for a number, and stops at one that would take more.
    decimals = _NASTRAN_DIGITS - 1 - int(np.floor(np.log10(np.abs(mesh.points).max())))
    properties = {"nastran:ref": [mesh.parts]}
    rounded = meshio.Mesh(np.round(mesh.points, decimals), [(mesh.element.name, mesh.cells)], cell_data=properties)
    text = StringIO()
    meshio.nastran.write(text, rounded)
    # It calls quadratic hexahedra by a name of its own.
    deck = text.getvalue().replace("CHEXA_  ", "CHEXA   ")
    path.write_text("SOL 101\nCEND\n" + deck, encoding="ascii")

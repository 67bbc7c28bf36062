"""Meshes as files: VTU, Gmsh and NASTRAN through meshio, ANSYS through mapdl-archive, Abaqus by our own hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.files import replacing, require_distinct, require_writable
from gyroid_cad.common.formats import (
    ABAQUS,
    ANSYS,
    GMSH,
    MESH_FORMATS,
    NASTRAN,
    VTU,
    Format,
    listed_endings,
    require_format,
)
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.mesh.finite_elements.abaqus import abaqus_name, write_abaqus
from gyroid_cad.mesh.finite_elements.data import MeshData
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs

__all__ = ["require_mesh_format", "write_mesh_files"]

Integers = NDArray[np.int64]

# Without nodes in the middle of faces.
_NO_FULL = (ABAQUS, ANSYS, NASTRAN)
_NASTRAN_DIGITS = 10
# The whole wall's physical group in Gmsh files; surfaces follow. Bounding cells are told by the element's entity.
_WALL_GROUP = 1


def require_mesh_format(path: str | os.PathLike[str], full: bool = False) -> Path:
    """Check the ending and the folder of a file to be written, before anything is meshed.

    Raises
    ------
    ParameterError
    """
    target, form = Path(path), require_format("output", path, MESH_FORMATS)
    if full and form in _NO_FULL:
        others = listed_endings([other for other in MESH_FORMATS if other not in _NO_FULL])
        raise ParameterError(
            "full", full, f"none in {target.suffix.lower()} files; elements of 27 nodes go into {others}"
        )
    if form is ANSYS:
        _mapdl_archive(path)
    return require_writable(path)


def write_mesh_files(
    mesh: MeshData,
    paths: Sequence[str | os.PathLike[str]],
    pairs: PeriodicPairs | None = None,
    progress: Progress | None = None,
) -> None:
    """Write a mesh with its sets, as :meth:`gyroid_cad.Mesh.write` says.

    Raises
    ------
    ParameterError, ExportError
    """
    full = len(mesh.element.nodes) in (9, 27)
    for target in require_distinct(paths, lambda path: require_mesh_format(path, full)):
        with timed({}, f"write {target.name}", progress):
            _write(mesh, target, pairs, progress)


def _write(mesh: MeshData, target: Path, pairs: PeriodicPairs | None, progress: Progress | None) -> None:
    form = require_format("output", target, MESH_FORMATS)
    with replacing(target) as temporary:
        if form is ABAQUS:
            abaqus_name(mesh)
            with temporary.open("w", encoding="ascii") as file:
                write_abaqus(mesh, file, pairs, progress)
            return
        writers: dict[Format, Callable[[], None]] = {
            VTU: lambda: _write_by_meshio(_vtu(mesh, pairs), temporary, "vtu"),
            GMSH: lambda: _write_by_meshio(_gmsh(mesh), temporary, "gmsh22", binary=True),
            NASTRAN: lambda: _write_nastran(mesh, temporary),
            ANSYS: lambda: _write_ansys(mesh, temporary),
        }
        writers[form]()


def _write_by_meshio(mesh: Any, path: Path, file_format: str, **options: Any) -> None:
    import meshio

    try:
        meshio.write(path, mesh, file_format=file_format, **options)
    except meshio.WriteError as problem:
        raise ExportError(f"the mesh was not written: {problem}") from problem


def _ids(mesh: MeshData) -> dict[str, Integers]:
    """Numbers of every element's patch, bounding cell, cubic cell and layer, from 1; shape (elements,) each."""
    complex, patch = mesh.complex, mesh.element_patch
    cell_of_patch = np.unique(complex.patch_cell, axis=0, return_inverse=True)[1].ravel()
    return {
        "patch": patch + 1,
        "bounding_cell": complex.placements.bounding_cell[complex.patch_placement][patch] + 1,
        "cubic_cell": cell_of_patch[patch] + 1,
        "layer": mesh.element_layer + 1,
    }


def _vtu(mesh: MeshData, pairs: PeriodicPairs | None) -> Any:
    import meshio

    at_nodes: dict[str, Any] = {
        name.lower(): _members(nodes, len(mesh.points)).astype(np.int8) for name, nodes in mesh.node_sets().items()
    }
    if pairs is not None:
        # The node that each is a copy of, itself where it is none.
        at_nodes["periodic_first"] = np.arange(len(mesh.points))
        at_nodes["periodic_first"][pairs.second] = pairs.first
    cells = [(mesh.element.name, mesh.cells)]
    return meshio.Mesh(mesh.points, cells, at_nodes, {name: [ids] for name, ids in _ids(mesh).items()})


def _gmsh(mesh: MeshData) -> Any:
    import meshio

    ids = _ids(mesh)
    dimension = 3 if mesh.layers else 2
    blocks = [(mesh.element.name, mesh.cells)]
    groups, entities = [np.full(len(mesh.cells), _WALL_GROUP)], [ids["bounding_cell"]]
    names = {"WALL": np.array([_WALL_GROUP, dimension])}
    for group, (name, surface) in enumerate(mesh.surfaces().items(), _WALL_GROUP + 1):
        blocks.append((mesh.element.face_name, mesh.surface_nodes(surface)))
        groups.append(np.full(len(surface.elements), group))
        entities.append(np.full(len(surface.elements), group))
        names[name] = np.array([group, 2])
    data = {"gmsh:physical": groups, "gmsh:geometrical": entities}
    return meshio.Mesh(mesh.points, blocks, cell_data=data, field_data=names)


def _write_nastran(mesh: MeshData, path: Path) -> None:
    """A whole deck, without materials and loads; bounding cells are properties."""
    import meshio

    # meshio has 16 characters for a number, and stops at one that would take more.
    decimals = _NASTRAN_DIGITS - 1 - int(np.floor(np.log10(np.abs(mesh.points).max())))
    properties = {"nastran:ref": [_ids(mesh)["bounding_cell"]]}
    rounded = meshio.Mesh(np.round(mesh.points, decimals), [(mesh.element.name, mesh.cells)], cell_data=properties)
    text = StringIO()
    meshio.nastran.write(text, rounded)
    # It calls quadratic hexahedra by a name of its own.
    deck = text.getvalue().replace("CHEXA_  ", "CHEXA   ")
    path.write_text("SOL 101\nCEND\n" + deck, encoding="ascii")


def _mapdl_archive(path: str | os.PathLike[str]) -> Any:
    try:
        import mapdl_archive
        import pyvista
    except ImportError:
        raise ParameterError(
            "output", str(path), "another ending, or mapdl-archive installed: pip install 'gyroid_cad[ansys]'"
        ) from None
    return mapdl_archive, pyvista


def _write_ansys(mesh: MeshData, path: Path) -> None:
    mapdl_archive, pyvista = _mapdl_archive(path)
    vtk_type = {
        "hexahedron": pyvista.CellType.HEXAHEDRON,
        "hexahedron20": pyvista.CellType.QUADRATIC_HEXAHEDRON,
        "quad": pyvista.CellType.QUAD,
    }.get(mesh.element.name)
    if vtk_type is None:
        raise ParameterError("order", mesh.element.order, "1 for the mid-surface in .cdb files")
    grid = pyvista.UnstructuredGrid({vtk_type: mesh.cells}, mesh.points)
    for name, nodes in mesh.node_sets().items():
        grid.point_data[name] = _members(nodes, len(mesh.points))
    for name, elements in mesh.element_sets().items():
        grid.cell_data[name] = _members(elements, len(mesh.cells))
    for name in ("ansys_material_type", "ansys_real_constant"):
        grid.cell_data[name] = np.ones(len(mesh.cells), dtype=np.int32)
    mapdl_archive.save_as_archive(str(path), grid)


def _members(numbers: Integers, count: int) -> NDArray[np.bool_]:
    members = np.zeros(count, dtype=bool)
    members[numbers] = True
    return members

"""Meshes as files: VTU, Gmsh and NASTRAN through meshio, ANSYS through mapdl-archive, Abaqus by our own hand."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
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
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.abaqus import abaqus_name, set_name_of, write_abaqus
from gyroid_cad.mesh.finite_elements.data import WrittenMesh, members
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs

__all__ = ["require_mesh_format", "write_mesh_files"]

Integers = NDArray[np.int64]

# Without nodes in the middle of faces.
_NO_FULL = (ABAQUS, ANSYS, NASTRAN)


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
    mesh: WrittenMesh,
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


def _write(mesh: WrittenMesh, target: Path, pairs: PeriodicPairs | None, progress: Progress | None) -> None:
    form = require_format("output", target, MESH_FORMATS)
    with replacing(target) as temporary:
        if form is ABAQUS:
            abaqus_name(mesh)
            with temporary.open("w", encoding="ascii") as file:
                write_abaqus(mesh, file, pairs, progress)
            return
        # It takes as long to load as a small mesh to write.
        from gyroid_cad.mesh.finite_elements import meshio_files

        writers: dict[Format, Callable[[], None]] = {
            VTU: lambda: meshio_files.write_vtu(mesh, temporary, pairs),
            GMSH: lambda: meshio_files.write_gmsh(mesh, temporary),
            NASTRAN: lambda: meshio_files.write_nastran(mesh, temporary),
            ANSYS: lambda: _write_ansys(mesh, temporary),
        }
        writers[form]()


def _mapdl_archive(path: str | os.PathLike[str]) -> Any:
    try:
        import mapdl_archive
        import pyvista
    except ImportError:
        raise ParameterError(
            "output", str(path), "another ending, or mapdl-archive installed: pip install 'gyroid_cad[ansys]'"
        ) from None
    return mapdl_archive, pyvista


def _write_ansys(mesh: WrittenMesh, path: Path) -> None:
    mapdl_archive, pyvista = _mapdl_archive(path)
    vtk_type = {
        "hexahedron": pyvista.CellType.HEXAHEDRON,
        "hexahedron20": pyvista.CellType.QUADRATIC_HEXAHEDRON,
        "quad": pyvista.CellType.QUAD,
        "tetra": pyvista.CellType.TETRA,
        "tetra10": pyvista.CellType.QUADRATIC_TETRA,
    }.get(mesh.element.name)
    if vtk_type is None:
        raise ParameterError("order", mesh.element.order, "1 for the mid-surface in .cdb files")
    grid = pyvista.UnstructuredGrid({vtk_type: mesh.cells}, mesh.points)
    for name, nodes in mesh.node_sets().items():
        grid.point_data[set_name_of(name)] = members(nodes, len(mesh.points))
    for name, elements in {**mesh.regions(), **mesh.element_sets()}.items():
        grid.cell_data[set_name_of(name)] = members(elements, len(mesh.cells))
    for name in ("ansys_material_type", "ansys_real_constant"):
        grid.cell_data[name] = np.ones(len(mesh.cells), dtype=np.int32)
    mapdl_archive.save_as_archive(str(path), grid)

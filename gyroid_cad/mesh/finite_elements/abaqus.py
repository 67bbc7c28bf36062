"""Meshes as Abaqus input, which CalculiX reads too, written piece by piece.

meshio's writer is passed over: it names hexahedra C3D8RH and C3D20RH, puts 21 numbers on a line where Abaqus allows
16, knows no surfaces, and takes its time. Keywords and face numbers after the Abaqus Keywords Guide (*NODE, *ELEMENT,
*ELSET, *NSET, *SURFACE).
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.finite_elements.data import WrittenMesh
from gyroid_cad.mesh.finite_elements.periodic import PeriodicPairs

__all__ = ["abaqus_name", "set_name_of", "write_abaqus"]

Integers = NDArray[np.int64]

_TYPES = {
    "hexahedron": "C3D8",
    "hexahedron20": "C3D20R",
    "quad": "S4",
    "quad8": "S8R",
    "tetra": "C3D4",
    "tetra10": "C3D10",
}
_ROWS_AT_ONCE = 20_000
_NUMBERS_A_LINE = 16


def abaqus_name(mesh: WrittenMesh) -> str:
    """Abaqus's name of a mesh's elements.

    Raises
    ------
    ParameterError
        If it has none.
    """
    name = mesh.element.name
    if name not in _TYPES:
        raise ParameterError("full", True, f"none in Abaqus files, which know {', '.join(_TYPES.values())}")
    return _TYPES[name]


def write_abaqus(
    mesh: WrittenMesh, file: TextIO, pairs: PeriodicPairs | None = None, progress: Progress | None = None
) -> None:
    """Write nodes, elements, their sets and surfaces; materials and steps are the user's, by ``*INCLUDE``.

    Periodic pairs are node sets of equal length, PERIODIC_x_y_z_FIRST and _SECOND, one by one in the same order, for x,
    y, z blocks between them; M1 stands for -1.

    Parameters
    ----------
    mesh : WrittenMesh
    file : text file
    pairs : PeriodicPairs, optional
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        If Abaqus has no such elements.
    """
    name = abaqus_name(mesh)
    total = len(mesh.points) + len(mesh.cells)
    file.write("*HEADING\ngyroid wall, in mm\n*NODE, NSET=ALL_NODES\n")
    for first in range(0, len(mesh.points), _ROWS_AT_ONCE):
        # CalculiX reads 20 characters of a number.
        rows = mesh.points[first : first + _ROWS_AT_ONCE].tolist()
        file.writelines(f"{number},{x:.12e},{y:.12e},{z:.12e}\n" for number, (x, y, z) in enumerate(rows, first + 1))
        report_progress(progress, "mesh", first, total)
    for region, members in mesh.regions().items():
        file.write(f"*ELEMENT, TYPE={name}, ELSET={set_name_of(region)}\n")
        for first in range(0, len(members), _ROWS_AT_ONCE):
            some = members[first : first + _ROWS_AT_ONCE]
            rows = (np.column_stack([some, mesh.cells[some]]) + 1).tolist()
            file.writelines(map(_lines, rows))
            report_progress(progress, "mesh", len(mesh.points) + int(some[0]), total)
    for set_name, elements in mesh.element_sets().items():
        _write_set(file, "ELSET", set_name, elements)
    for set_name, nodes in _node_sets(mesh, pairs):
        _write_set(file, "NSET", set_name, nodes)
    for face_name, surface in mesh.surfaces().items():
        surface_name = set_name_of(face_name)
        faces = np.unique(surface.faces).tolist()
        parts = {f"{surface_name}_S{face + 1}": surface.elements[surface.faces == face] for face in faces}
        for set_name, elements in parts.items():
            _write_set(file, "ELSET", set_name, elements)
        file.write(f"*SURFACE, NAME={surface_name}, TYPE=ELEMENT\n")
        file.writelines(f"{set_name}, {set_name.rpartition('_')[2]}\n" for set_name in parts)
    report_progress(progress, "mesh", total, total)


def _node_sets(mesh: WrittenMesh, pairs: PeriodicPairs | None) -> Iterator[tuple[str, Integers]]:
    yield from ((set_name_of(name), nodes) for name, nodes in mesh.node_sets().items())
    for blocks, nodes in (pairs.by_translation() if pairs else {}).items():
        name = "_".join(f"M{-count}" if count < 0 else str(count) for count in blocks)
        for which, some in zip(("FIRST", "SECOND"), nodes, strict=True):
            yield f"PERIODIC_{name}_{which}, UNSORTED", some


def set_name_of(name: str) -> str:
    """Name of a region or a face as Abaqus and ANSYS take it: of letters, digits and underscores.

    >>> set_name_of("fluid-a/face 1"), set_name_of("a:1"), set_name_of("FACE_A")
    ('fluid_a_face_1', 'a_1', 'FACE_A')
    """
    return re.sub(r"\W", "_", name)


def _write_set(file: TextIO, keyword: str, name: str, numbers: Integers) -> None:
    file.write(f"*{keyword}, {keyword}={name}\n")
    for first in range(0, len(numbers), _ROWS_AT_ONCE):
        file.write(_lines((numbers[first : first + _ROWS_AT_ONCE] + 1).tolist()))


def _lines(numbers: Iterable[int]) -> str:
    """Numbers, at most 16 on a line; each but the last ends in a comma, for elements go on and sets do not mind."""
    words = [str(number) for number in numbers]
    lines = [",".join(words[first : first + _NUMBERS_A_LINE]) for first in range(0, len(words), _NUMBERS_A_LINE)]
    return ",\n".join(lines) + "\n"

"""Files of trivariate patches for isogeometric analysis: MFEM, G+Smo, JSON and NPZ.

All patches have the same knots and weights, and control points run with u fastest in MFEM's and G+Smo's files.
Numbers are written so that reading them gives the same doubles back.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.checks import finite_numbers
from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import (
    GISMO,
    JSON,
    MFEM,
    MFEM_FIELD,
    NPZ,
    VOLUME_FORMATS,
    Format,
    require_format,
    require_formats,
)
from gyroid_cad.common.progress import Progress, timed
from gyroid_cad.mesh.iga.data import BOUNDARY_PARTS, FACE_CORNERS, VolumeData
from gyroid_cad.version import __version__

__all__ = ["write_field_files", "write_volume_files"]

# MFEM's numbers of shapes (Geometry::Type).
_SQUARE, _CUBE = 3, 5
_ROWS_AT_ONCE = 4096
_ARRAYS = (
    "control_points",
    "patch_points",
    "weights",
    "knots",
    "knots_across",
    "patch_group",
    "patch_vertices",
    "edges",
    "edge_chain",
    "interfaces",
    "interface_alike",
    "boundary",
)


def write_volume_files(
    volumes: VolumeData, paths: Sequence[str | os.PathLike[str]], progress: Progress | None = None
) -> None:
    """Write trivariate patches, as :meth:`gyroid_cad.VolumePatches.write` says.

    Raises
    ------
    ParameterError, ExportError
    """
    for target in require_formats(paths, VOLUME_FORMATS):
        form = require_format("output", target, VOLUME_FORMATS)
        with timed({}, f"write {target.name}", progress), replacing(target) as temporary:
            _WRITERS[form](volumes, temporary)


def write_field_files(volumes: VolumeData, values: ArrayLike, paths: Sequence[str | os.PathLike[str]]) -> None:
    """Write a scalar field, as :meth:`gyroid_cad.VolumePatches.write_field` says.

    Raises
    ------
    ParameterError, ExportError
    """
    field = finite_numbers("values", values, "a finite number for each control point", (len(volumes.control_points),))
    for target in require_formats(paths, [MFEM_FIELD]):
        with replacing(target) as temporary, temporary.open("w", encoding="ascii") as file:
            file.write("FiniteElementSpace\nFiniteElementCollection: NURBS\nVDim: 1\nOrdering: 0\n\nNURBS_patches\n")
            for numbers in volumes.patch_points:
                file.write(_lines(_u_fastest(field[numbers])[:, np.newaxis]))


def _write_mfem(volumes: VolumeData, path: Path) -> None:
    """Control points are homogeneous: (weight x, weight y, weight z, weight).

    An edge's knot vector runs from its first vertex to its second. Opposite edges of a patch must name the same one,
    run the same way: MFEM before 4.10 reads nothing else (``NURBSExtension::CheckPatches``).
    """
    faces = volumes.patch_vertices[volumes.boundary[:, 0, np.newaxis], FACE_CORNERS[volumes.boundary[:, 1]]]
    shapes = [np.full(len(rows), shape) for rows, shape in ((volumes.patch_vertices, _CUBE), (faces, _SQUARE))]
    named = ", ".join(f"{number} {name}" for number, name in enumerate(BOUNDARY_PARTS, start=1))
    with path.open("w", encoding="ascii") as file:
        file.write(
            f"MFEM NURBS mesh v1.0\n\n# gyroid_cad {__version__}, lengths in mm\n# boundary attributes: {named}\n"
        )
        file.write("\ndimension\n3\n")
        _write_table(file, "elements", volumes.patch_group + 1, shapes[0], volumes.patch_vertices)
        _write_table(file, "boundary", volumes.boundary[:, 2] + 1, shapes[1], faces)
        _write_table(file, "edges", volumes.edge_chain, volumes.edges)
        file.write(f"\nvertices\n{volumes.patch_vertices.max() + 1}\n\npatches\n")
        knots = zip(volumes.degrees, volumes.weights.shape, _knots(volumes), strict=True)
        head = "".join(f"{degree} {count} {_line(along)}\n" for degree, count, along in knots)
        weights = _u_fastest(volumes.weights)[:, np.newaxis]
        for points in _patch_points(volumes):
            file.write(f"\nknotvectors\n3\n{head}\ndimension\n3\n\ncontrolpoints\n")
            file.write(_lines(np.concatenate([points * weights, weights], axis=1)))


def _write_gismo(volumes: VolumeData, path: Path) -> None:
    kind = "TensorNurbs3" if volumes.rational else "TensorBSpline3"
    with path.open("w", encoding="ascii") as file:
        file.write(f'<?xml version="1.0" encoding="UTF-8"?>\n<!-- gyroid_cad {__version__}, lengths in mm -->\n<xml>\n')
        for index, points in enumerate(_patch_points(volumes)):
            file.write(f' <Geometry type="{kind}" id="{index}">\n{_gismo_basis(volumes)}  <coefs geoDim="3">')
            file.write(f"{_lines(points)}</coefs>\n </Geometry>\n")
        file.write(
            f' <MultiPatch parDim="3" id="{len(volumes)}">\n  <patches type="id_range">0 {len(volumes) - 1}</patches>\n'
        )
        file.write(f"  <interfaces>{_lines(_gismo_interfaces(volumes))}</interfaces>\n")
        for part, name in enumerate(BOUNDARY_PARTS):
            # Sides are numbered from 1.
            rows = volumes.boundary[volumes.boundary[:, 2] == part, :2] + np.array([0, 1])
            if len(rows):
                file.write(f'  <boundary name="{name}">{_lines(rows)}</boundary>\n')
        file.write(" </MultiPatch>\n</xml>\n")


def _gismo_basis(volumes: VolumeData) -> str:
    along = "".join(
        f'   <Basis type="BSplineBasis" index="{axis}">\n'
        f'    <KnotVector degree="{degree}">{_line(knots)}</KnotVector>\n   </Basis>\n'
        for axis, (degree, knots) in enumerate(zip(volumes.degrees, _knots(volumes), strict=True))
    )
    basis = f'  <Basis type="TensorBSplineBasis3">\n{along}  </Basis>\n'
    if not volumes.rational:
        return basis
    weights = _lines(_u_fastest(volumes.weights)[:, np.newaxis])
    return f'  <Basis type="TensorNurbsBasis3">\n{basis}  <weights>{weights}</weights>\n  </Basis>\n'


def _gismo_interfaces(volumes: VolumeData) -> NDArray[np.int64]:
    """Rows of both patches and sides, the directions u, v and w have in the second patch, and whether they agree.

    Across the interface itself directions count as agreeing where both sides are at the same end of their parameter
    (G+Smo, gsBoundary.h).
    """
    rows = np.arange(len(volumes.interfaces))
    first, second = volumes.interfaces[:, 1], volumes.interfaces[:, 3]
    across_first, across_second = first // 2, second // 2
    directions = np.full((len(rows), 3), 2)
    directions[rows, across_first], directions[rows, 1 - across_first] = across_second, 1 - across_second
    agree = np.ones((len(rows), 3), dtype=np.int64)
    agree[rows, across_first] = first % 2 == second % 2
    agree[rows, 1 - across_first] = volumes.interface_alike
    return np.concatenate([volumes.interfaces + np.array([0, 1, 0, 1]), directions, agree], axis=1)


def _write_json(volumes: VolumeData, path: Path) -> None:
    head = {
        "format": "gyroid_cad volumes",
        "version": 1,
        "written_by": f"gyroid_cad {__version__}",
        "length_unit": "mm",
        "degrees": volumes.degrees,
        "boundary_parts": BOUNDARY_PARTS,
    }
    with path.open("w", encoding="ascii") as file:
        file.write("{\n" + ",\n".join(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in head.items()))
        for name in _ARRAYS:
            array = getattr(volumes, name)
            file.write(f",\n{json.dumps(name)}: [")
            # Text takes many times the room of the numbers: a few rows at a time.
            for first in range(0, len(array), _ROWS_AT_ONCE):
                rows = (json.dumps(row, separators=(",", ":")) for row in array[first : first + _ROWS_AT_ONCE].tolist())
                file.write(("," if first else "") + "\n" + ",\n".join(rows))
            file.write("\n]")
        file.write("\n}\n")


def _write_npz(volumes: VolumeData, path: Path) -> None:
    arrays = {name: getattr(volumes, name) for name in _ARRAYS}
    with path.open("wb") as file:
        np.savez_compressed(
            file,
            allow_pickle=False,
            degrees=np.array(volumes.degrees),
            boundary_parts=np.array(BOUNDARY_PARTS),
            **arrays,
        )


_WRITERS: dict[Format, Callable[[VolumeData, Path], None]] = {
    MFEM: _write_mfem,
    GISMO: _write_gismo,
    JSON: _write_json,
    NPZ: _write_npz,
}


def _knots(volumes: VolumeData) -> tuple[NDArray[np.float64], ...]:
    return volumes.knots, volumes.knots, volumes.knots_across


def _u_fastest(net: NDArray[np.float64]) -> NDArray[np.float64]:
    """A net along u, v, w as rows in the order of MFEM and G+Smo."""
    return np.swapaxes(net, 0, 2).reshape(-1, *net.shape[3:])


def _patch_points(volumes: VolumeData) -> Iterator[NDArray[np.float64]]:
    for numbers in volumes.patch_points:
        yield volumes.control_points[np.swapaxes(numbers, 0, 2).ravel()]


def _line(values: NDArray[np.generic]) -> str:
    return " ".join(map(repr, values.tolist()))


def _lines(rows: NDArray[np.generic]) -> str:
    """Rows of numbers as text, each line ended."""
    return (" ".join(["%r"] * rows.shape[1]) + "\n") * len(rows) % tuple(rows.ravel().tolist())


def _write_table(file: TextIO, name: str, *columns: NDArray[np.int64]) -> None:
    """A section of MFEM's: its name, how many rows, the rows."""
    rows = np.column_stack(columns)
    file.write(f"\n{name}\n{len(rows)}\n")
    for block in _blocks(rows):
        file.write(_lines(block))


def _blocks(rows: NDArray[np.int64]) -> Iterable[NDArray[np.int64]]:
    return (rows[first : first + _ROWS_AT_ONCE] for first in range(0, len(rows), _ROWS_AT_ONCE))

"""Triangles in named regions as one STL file of text: what OpenFOAM's meshers take for patches by their names."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import unit
from gyroid_cad.common.files import replacing
from gyroid_cad.errors import ExportError

__all__ = ["read_regions", "region_name", "write_regions"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Of coordinates: corners that differ in double precision differ in the file too.
_DIGITS = 12


def region_name(face: str) -> str:
    """Name of a face as one word of letters, digits and underscores, which every reader takes.

    >>> region_name("wall/a"), region_name("a:1"), region_name("fluid-a/face 3")
    ('wall_a', 'a_1', 'fluid_a_face_3')
    """
    return re.sub(r"\W+", "_", face, flags=re.ASCII).strip("_") or "faces"


def write_regions(vertices: Floats, triangles: Integers, names: Sequence[str], path: str | os.PathLike[str]) -> None:
    """Write triangles in millimetres as STL of text, those of each region as a solid of its own.

    The file is read back before it takes its name.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
    names : sequence of str
        Region of each triangle.
    path : path-like

    Raises
    ------
    ExportError
    """
    regions, which = np.unique(np.array(names), return_inverse=True)
    corners = np.asarray(vertices, dtype=float)[triangles]
    normals = unit(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    with replacing(path) as temporary:
        with temporary.open("w", encoding="ascii", newline="\n") as out:
            for number, name in enumerate(regions.tolist()):
                own = which == number
                out.write(f"solid {name}\n")
                out.writelines(_facets(normals[own], corners[own]))
                out.write(f"endsolid {name}\n")
        counted = {name: len(found) for name, found in read_regions(temporary).items()}
        if counted != dict(zip(regions.tolist(), np.bincount(which).tolist(), strict=True)):
            raise ExportError(f"{path} was not written: read back it has other regions than were written")


def _facets(normals: Floats, corners: Floats) -> Iterable[str]:
    for normal, places in zip(normals.tolist(), corners.tolist(), strict=True):
        lines = "".join(f"vertex {_numbers(place)}\n" for place in places)
        yield f"facet normal {_numbers(normal)}\nouter loop\n{lines}endloop\nendfacet\n"


def _numbers(values: Sequence[float]) -> str:
    return " ".join(f"{value:.{_DIGITS}g}" for value in values)


def read_regions(path: str | os.PathLike[str]) -> dict[str, Floats]:
    """Corners of the triangles of each region of an STL file of text, by its name.

    Returns
    -------
    dict of ndarray, shape (triangles, 3, 3)
        In mm.
    """
    found: dict[str, list[list[float]]] = {}
    own: list[list[float]] = []
    for line in Path(path).read_text(encoding="ascii").splitlines():
        word, _, rest = line.strip().partition(" ")
        if word == "solid":
            own = found.setdefault(rest.strip(), [])
        elif word == "vertex":
            own.append([float(number) for number in rest.split()])
    return {name: np.array(places).reshape(-1, 3, 3) for name, places in found.items()}

"""Closed triangles of a part's solids, and which of its faces each lies on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.part import Part, selected_faces
from gyroid_cad.kernel.stl import FINER, meshed_by_face
from gyroid_cad.mesh.triangles.measures import unmatched_edges

__all__ = ["face_numbers", "solid_triangles"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def solid_triangles(shape: TopoDS_Shape, deviation: float) -> list[tuple[Floats, Integers, Integers]]:
    """Triangles of each solid of a shape, meshed more finely where those of the kernel's mesher are open.

    A solid that stays open comes as it is: who takes it may repair or refuse it.

    Parameters
    ----------
    shape : TopoDS_Shape
    deviation : float
        Of the triangles from the faces, in mm.

    Returns
    -------
    list of (vertices, triangles, faces)
        In mm, shape (vertices, 3); numbers of vertices, counterclockwise seen from outside, shape (triangles, 3); and
        the face of each triangle, counted through all solids, shape (triangles,).

    Raises
    ------
    ParameterError
        If there is no solid.
    """
    found, count = [], 0
    for solid in parts_of(shape, TopAbs_SOLID):
        for finer in FINER:
            vertices, triangles, faces = meshed_by_face(solid, "part", deviation * finer)
            if not unmatched_edges(triangles):
                break
        found.append((np.asarray(vertices, dtype=float), np.asarray(triangles, dtype=np.int64), faces + count))
        count += sum(1 for _ in parts_of(solid, TopAbs_FACE))
    if not found:
        kind = shape.ShapeType().name.removeprefix("TopAbs_").lower()
        raise ParameterError("part", kind, "a closed solid: there is none in it")
    return found


def face_numbers(shape: TopoDS_Shape, openings: Sequence[Any]) -> list[int]:
    """Numbers of chosen faces, as :func:`solid_triangles` counts them.

    Parameters
    ----------
    shape : TopoDS_Shape
    openings : sequence
        As of :func:`gyroid_cad.kernel.part.selected_faces`.

    Raises
    ------
    ParameterError
    """
    low, high = bounding_box(shape)
    chosen = selected_faces(Part(shape, (), low, high, 0.0), openings)
    faces = [face for solid in parts_of(shape, TopAbs_SOLID) for face in parts_of(solid, TopAbs_FACE)]
    numbers = [number for number, face in enumerate(faces) if any(face.IsSame(other) for other in chosen)]
    if chosen and not numbers:
        raise ParameterError("openings", openings, "faces of the part that is filled")
    return numbers

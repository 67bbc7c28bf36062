"""Voids of solids: in which order the kernel is given them, and where each begins."""

from __future__ import annotations

from typing import Any

import build123d as bd
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Plane
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL

from gyroid_cad.kernel.check import is_valid, parts_of, volume_of
from gyroid_cad.kernel.compat import NumberedShapes, as_face
from gyroid_cad.kernel.shells import solids_of


def faces_of(shape: Any, inwards: bool = False) -> list[Any]:
    """Plane ones first."""
    faces = [as_face(face.Reversed() if inwards else face) for face in parts_of(shape, TopAbs_FACE)]
    return sorted(faces, key=lambda face: BRepAdaptor_Surface(face).GetType() != GeomAbs_Plane)


def edges_of_planes(shape: Any) -> NumberedShapes:
    edges = NumberedShapes()
    for face in faces_of(shape):
        if BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane:
            for edge in parts_of(face, TopAbs_EDGE):
                edges.Add(edge)
    return edges


def test_voids_come_by_number_of_faces_and_begin_off_the_planes_that_they_have_in_common() -> None:
    # Two crossed cylinders, cut flat: where they cross, two edges are of no plane.
    crossed = bd.Rot(0, 90, 0) * bd.Cylinder(1, 4) + bd.Rot(90, 0, 0) * bd.Cylinder(1, 4)
    cut = (crossed - bd.Pos(0, 0, -3) * bd.Box(6, 6, 6)).solid()
    box = bd.Box(1, 1, 1).solid()
    faces = faces_of(bd.Box(20, 20, 20).solid().wrapped)
    for void in (bd.Pos(-5, 0, 0) * cut, bd.Pos(5, 0, 0.5) * box, bd.Pos(5, 5, 0) * cut):
        faces += faces_of(void.wrapped, inwards=True)
    (solid,) = solids_of(faces, volume_of)
    assert is_valid(solid)
    outer, *voids = parts_of(solid, TopAbs_SHELL)
    assert outer.NbChildren() == 6
    assert [void.NbChildren() for void in voids] == [len(box.faces()), *2 * [len(cut.faces())]]
    for void in voids[1:]:
        assert not edges_of_planes(void).Contains(next(parts_of(void, TopAbs_EDGE)))

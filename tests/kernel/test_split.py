"""Parts and lattice faces split against each other, and the solids that their pieces bound."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape
from scipy.spatial import cKDTree

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.part import measure, require_part
from gyroid_cad.kernel.solid import build_faces, build_solid
from gyroid_cad.kernel.split import Pieces, bounded_solids, split
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.covering import CROSSING, INSIDE, SIDE_SAMPLES, Frame, covering_complex, patch_sides
from gyroid_cad.wall.exact import patch_points_and_normals
from gyroid_cad.wall.offset import build_wall

Floats = NDArray[np.float64]

L, THICKNESS = 10.0, 0.8
FRAME = Frame(np.array([1.0, 2.0, 3.0]), np.eye(3))
COARSE = FitSettings(6)


def ball(radius: float, x: float = 5.0, y: float = 5.0, z: float = 5.0) -> TopoDS_Shape:
    return BRepPrimAPI_MakeSphere(gp_Pnt(x, y, z), radius).Shape()


def never(point: Floats) -> bool:
    raise AssertionError("asked")


def filled(shape: TopoDS_Shape) -> TopoDS_Shape:
    """The part filled with the wall, by the pieces that its boundary cuts and those it leaves whole."""
    part = require_part(shape)
    complex = covering_complex(part.low, part.high, FRAME, L, THICKNESS / 2)
    cloud, _, error = part.surface_samples(L / 12)
    tree = cKDTree(cloud)
    samples = np.linspace(-1, 1, SIDE_SAMPLES)
    points = FRAME.placed(patch_points_and_normals(complex, L, samples)[0])
    sides = patch_sides(complex, points, THICKNESS / 2, lambda points: tree.query(points)[0] - error, part.contains)
    wall = build_wall(complex, fit_patch(COARSE), L, THICKNESS).moved(FRAME.rotation, FRAME.origin)
    faces = [(as_face(below.Reversed()), above) for below, above in build_faces(wall)]
    cut, whole = (
        [face for patch in np.flatnonzero(sides == side) for face in faces[patch]] for side in (CROSSING, INSIDE)
    )
    solids = bounded_solids(split(part, cut), whole, never)
    return solids[0] if len(solids) == 1 else compound_of(solids)


@lru_cache(maxsize=4)
def lattice() -> TopoDS_Shape:
    """A block that covers the parts, for the kernel's own boolean."""
    wall = build_wall(build_complex((3, 3, 3), first=(-1, -1, -1)), fit_patch(COARSE), L, THICKNESS)
    return build_solid(wall.moved(FRAME.rotation, FRAME.origin))


@pytest.mark.parametrize(
    "shape",
    [
        ball(4.0),
        BRepPrimAPI_MakeBox(gp_Pnt(2, 3, 4), gp_Pnt(8, 7, 9)).Shape(),
        compound_of([ball(2.5), ball(2.0, 11.0)]),
    ],
    ids=["ball", "box", "two balls"],
)
def test_a_filled_part_is_what_the_boolean_of_the_whole_lattice_gives(shape: TopoDS_Shape) -> None:
    ours, theirs = filled(shape), BRepAlgoAPI_Common(lattice(), shape).Shape()
    assert is_valid(ours)
    assert topology(ours).closed
    # Ours may have more faces: those of the part that close on themselves come in halves.
    assert topology(ours).solids == topology(theirs).solids
    assert measure(ours) == pytest.approx(measure(theirs), rel=1e-6)


def faces_of(shape: TopoDS_Shape) -> list[TopoDS_Face]:
    return [as_face(face) for face in parts_of(shape, TopAbs_FACE)]


def reversed_faces(shape: TopoDS_Shape) -> tuple[TopoDS_Face, ...]:
    return tuple(as_face(face.Reversed()) for face in faces_of(shape))


def test_with_no_faces_the_boundary_stays_whole() -> None:
    pieces = split(require_part(ball(3.0)), [])
    assert pieces.inside == ()
    assert sum(measure(face)[1] for face in pieces.boundary) == pytest.approx(36 * np.pi)


@pytest.mark.parametrize("wanted", [True, False])
def test_a_boundary_that_no_face_meets_is_wanted_where_its_points_are(wanted: bool) -> None:
    pieces = Pieces((), tuple(faces_of(ball(3.0))))
    solids = bounded_solids(pieces, (), lambda point: wanted)
    assert len(solids) == wanted


def test_a_closed_face_turned_inwards_is_a_void_of_the_solid_round_it() -> None:
    pieces = Pieces((), tuple(faces_of(compound_of([ball(3.0), ball(3.0, 20.0)]))))
    solids = bounded_solids(pieces, reversed_faces(ball(1.0, 19.0)), lambda point: True)
    assert sorted(len(list(parts_of(solid, TopAbs_SHELL))) for solid in solids) == [1, 2]
    assert sum(measure(solid)[0] for solid in solids) == pytest.approx(4 / 3 * np.pi * (2 * 27 - 1), rel=1e-6)


def test_a_void_in_nothing_is_an_error() -> None:
    with pytest.raises(KernelError, match="lies in none"):
        bounded_solids(Pieces((), ()), reversed_faces(ball(1.0)), never)


def test_faces_that_do_not_close_are_an_error() -> None:
    box = faces_of(BRepPrimAPI_MakeBox(1, 1, 1).Shape())
    with pytest.raises(KernelError, match="do not close"):
        bounded_solids(Pieces((), ()), box[:5], never)


def test_faces_that_disagree_on_what_is_inside_are_an_error() -> None:
    box = faces_of(BRepPrimAPI_MakeBox(1, 1, 1).Shape())
    with pytest.raises(KernelError, match="do not agree"):
        bounded_solids(Pieces((box[0], as_face(box[1].Reversed())), tuple(box[2:])), (), never)

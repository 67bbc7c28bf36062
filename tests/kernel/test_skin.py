"""Parts with a solid skin: the core it leaves, openings, lattices in it, and what is refused."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any

import build123d as bd
import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Shape, TopoDS_Solid
from scipy.spatial import cKDTree

import gyroid_cad.kernel.offset
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.depth import Depths
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.offset import CLOSED_WAYS, offsets
from gyroid_cad.kernel.offset_pieces import offset_pieces
from gyroid_cad.kernel.part import Part, measure, require_part
from gyroid_cad.kernel.skin import Hollow, hollow, hollow_round, openings_of
from gyroid_cad.kernel.solid import build_faces
from gyroid_cad.kernel.split import bounded_solids, split
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.covering import CROSSING, INSIDE, SIDE_SAMPLES, Frame, covering_complex, patch_sides
from gyroid_cad.wall.exact import patch_points_and_normals
from gyroid_cad.wall.offset import build_wall

Floats = NDArray[np.float64]

CELL, WALL, SKIN = 10.0, 0.8, 1.0
FRAME = Frame(np.array([1.0, 2.0, 3.0]), np.eye(3))
RADIUS = 4.0
SIDES = (9.0, 8.0, 7.0)


def wrapped(made: bd.Shape) -> TopoDS_Shape:
    return compound_of(solid.wrapped for solid in made.solids())


def ball(radius: float = RADIUS) -> bd.Part:
    return bd.Pos(5, 5, 5) * bd.Sphere(radius)


def box(*sides: float) -> bd.Part:
    return bd.Pos(5, 5, 5) * bd.Box(*sides or SIDES)


def plate() -> bd.Part:
    """20 by 16 by 6, its corners rounded with 3, a hole of 5 across through it."""
    return bd.fillet(bd.Box(20, 16, 6).edges().filter_by(bd.Axis.Z), 3) - bd.Cylinder(2.5, 6)


def dumb_bell() -> bd.Part:
    """Its bar is too thin to have a core."""
    return bd.Pos(-8) * bd.Box(6, 6, 6) + bd.Pos(8) * bd.Box(6, 6, 6) + bd.Box(16, 1, 1)


def flanged() -> bd.Part:
    return bd.Box(6, 6, 6) + bd.Box(9, 6, 1.9)


def sides(made: bd.Shape, *names: str) -> list[bd.Face]:
    """Faces by where they are: the one furthest along an axis, such as ">Z", or those of cylinders."""
    found: list[bd.Face] = []
    for name in names:
        if name == "mantle":
            found += made.faces().filter_by(bd.GeomType.CYLINDER)
        else:
            found.append(made.faces().sort_by(getattr(bd.Axis, name[1]))[-1 if name[0] == ">" else 0])
    return found


def parted(made: bd.Shape, skin: float = SKIN, openings: Sequence[str] = ()) -> tuple[Part, Hollow]:
    part = require_part(wrapped(made))
    return part, hollow(part, skin, [face.wrapped for face in sides(made, *openings)])


def with_nothing_in_it(made: Hollow, wanted: bool = False) -> list[TopoDS_Solid]:
    """The skin alone, or with all of the core."""
    return made.solids(split(made.core, []), (), lambda point: wanted)


def volume(solids: list[TopoDS_Solid]) -> float:
    return sum(measure(solid)[0] for solid in solids)


def areas_at(shape: TopoDS_Shape, height: float) -> list[float]:
    """Of the faces that lie in the plane z = height."""
    faces = parts_of(shape, TopAbs_FACE)
    return [measure(face)[1] for face in faces if np.abs(bounding_box(face)[:, 2] - height).max() < 1e-4]


def assert_sound(shape: TopoDS_Shape) -> None:
    assert is_valid(shape)
    assert topology(shape).closed


@lru_cache(maxsize=4)
def filled(name: str) -> tuple[Part, Hollow, TopoDS_Shape, TopoDS_Shape]:
    """A part, its core, skin with wall, and the wall in the core alone."""
    part, made = parted(*{"ball": (ball(),), "box": (box(), SKIN, [">Z"])}[name])
    core = made.core
    complex = covering_complex(core.low, core.high, FRAME, CELL, WALL / 2)
    cloud, _, error = core.surface_samples(CELL / 12)
    tree = cKDTree(cloud)
    samples = np.linspace(-1, 1, SIDE_SAMPLES)
    points = FRAME.placed(patch_points_and_normals(complex, CELL, samples)[0])
    sides = patch_sides(complex, points, WALL / 2, lambda points: tree.query(points)[0] - error, core.contains)
    wall = build_wall(complex, fit_patch(FitSettings(6)), CELL, WALL).moved(FRAME.rotation, FRAME.origin)
    faces = [(as_face(below.Reversed()), above) for below, above in build_faces(wall)]
    cut, whole = (
        [face for patch in np.flatnonzero(sides == side) for face in faces[patch]] for side in (CROSSING, INSIDE)
    )
    pieces = split(core, cut)

    def never(point: Floats) -> bool:
        raise AssertionError("asked")

    return (
        part,
        made,
        compound_of(made.solids(pieces, whole, never)),
        compound_of(bounded_solids(pieces, whole, never)),
    )


@pytest.mark.parametrize("name", ["ball", "box"])
def test_a_filled_skin_is_the_skin_and_the_lattice_in_its_core(name: str) -> None:
    part, made, ours, lattice = filled(name)
    assert_sound(ours)
    assert topology(ours).solids == 1
    assert measure(ours)[0] == pytest.approx(part.volume - made.core.volume + measure(lattice)[0], rel=1e-6)


def test_a_balls_core_is_a_ball_and_its_outer_faces_stay_whole() -> None:
    part, made, ours, _ = filled("ball")
    assert made.core.volume == pytest.approx(4 / 3 * np.pi * (RADIUS - SKIN) ** 3, rel=1e-6)
    own = list(parts_of(ours, TopAbs_FACE))
    assert all(any(face.IsSame(one) for one in own) for face in parts_of(part.shape, TopAbs_FACE))


def test_at_an_opening_the_lattice_and_what_it_leaves_come_to_the_surface() -> None:
    _, made, ours, lattice = filled("box")
    length, width, height = SIDES
    within = (length - 2 * SKIN) * (width - 2 * SKIN)
    assert made.core.volume == pytest.approx(within * (height - SKIN), rel=1e-6)
    ends = sum(areas_at(lattice, 5 + height / 2))
    assert 0.1 * within < ends < 0.5 * within
    assert sum(areas_at(ours, 5 + height / 2)) == pytest.approx(length * width - within + ends, rel=1e-6)
    assert sum(areas_at(ours, 5 - height / 2)) == pytest.approx(length * width)


def test_it_survives_a_step_file(tmp_path: Path) -> None:
    _, _, ours, _ = filled("box")
    write_step(ours, tmp_path / "box.step")
    back = read_step(tmp_path / "box.step")
    assert_sound(back)
    assert topology(back) == topology(ours)
    assert measure(back)[0] == pytest.approx(measure(ours)[0], rel=1e-6)


def rounded(length: float, width: float, radius: float) -> float:
    """Area of a rectangle with rounded corners."""
    return length * width - (4 - np.pi) * radius**2


# Of the plate's core, seen from above.
PLATE = rounded(18, 14, 2) - np.pi * 3.5**2


@pytest.mark.parametrize(
    ("made", "openings", "core", "solids"),
    [
        (plate(), [], 4 * PLATE, 1),
        (plate(), [">Z"], 5 * PLATE, 1),
        (plate(), [">Z", "<Z"], 6 * PLATE, 1),
        # Where the opening passes into round corners the skin keeps its thickness from these: a quarter of a tube.
        (plate(), [">X"], 4 * PLATE + (10 - np.pi / 2) * (6 - 2), 1),
        (box(), [">Z", ">X"], 8 * 6 * 6, 1),
        (bd.Cylinder(6, 14), ["mantle"], 36 * np.pi * 12, 1),
        (bd.Torus(10, 4), [], 2 * np.pi**2 * 10 * 9, 1),
        (box() - ball(1.5), [], 7 * 6 * 5 - 4 / 3 * np.pi * 2.5**3, 1),
        (box() - ball(1.5), [">Z"], 7 * 6 * 6 - 4 / 3 * np.pi * 2.5**3, 1),
        (ball() + bd.Pos(10) * ball(), [], 8 / 3 * np.pi * 27, 2),
        (dumb_bell(), [], None, 2),
    ],
    ids=["plate", "top", "both", "side", "corner", "mantle", "torus", "void", "open void", "two", "dumb bell"],
)
def test_skin_and_core_are_the_part(made: bd.Shape, openings: list[str], core: float | None, solids: int) -> None:
    part, found = parted(made, SKIN, openings)
    skin = with_nothing_in_it(found)
    assert_sound(compound_of(skin))
    assert_sound(found.core.shape)
    assert len(found.core.solids) == solids
    if core is not None:
        assert found.core.volume == pytest.approx(core, rel=1e-5)
    assert volume(skin) == pytest.approx(part.volume - found.core.volume, rel=1e-5)
    assert any(found.opened) == bool(openings)
    everything = with_nothing_in_it(found, True)
    assert_sound(compound_of(everything))
    assert volume(everything) == pytest.approx(part.volume, rel=1e-6)


def test_openings_are_found_where_the_part_has_other_faces_than_the_shape_it_was_made_from() -> None:
    cylinder = bd.Cylinder(6, 14)
    part = require_part(wrapped(cylinder))
    (mantle,) = sides(cylinder, "mantle")
    for given in (mantle, deepcopy(mantle)):
        found = openings_of(part, [given.wrapped, given.wrapped])
        assert len(found) == 2
        assert sum(measure(face)[1] for face in found) == pytest.approx(mantle.area)
    assert openings_of(part, []) == []


@pytest.mark.parametrize(
    ("made", "skin", "openings", "words"),
    [
        (box(), 3.6, [], "skin = 3.6: expected less than about 3.5 mm, half the part where it is thickest, round ("),
        (box(), 3.9, sides(box(), ">X", "<X"), "skin = 3.9: expected less than about 3.5 mm, as deep as"),
        (box(), 1.0, box().faces(), "some faces of each solid"),
        (box(), 1.0, ball().faces(), "openings = '1 face': expected faces of the part"),
        (box(), 1.0, sides(bd.Pos(0, 0, 0.01) * box(), ">Z"), "expected faces of the part"),
        (
            flanged(),
            1.0,
            sides(flanged(), ">X", "<Z"),
            "openings = '2 faces': expected faces wider than rims of 1 mm",
        ),
    ],
)
def test_what_leaves_no_core_no_skin_or_no_opening_is_refused(
    made: bd.Shape, skin: float, openings: list[bd.Face], words: str
) -> None:
    with pytest.raises(ParameterError) as caught:
        hollow(require_part(wrapped(made)), skin, [face.wrapped for face in openings])
    assert words in str(caught.value)


@pytest.mark.parametrize("given", [None, box(), box(7.2, 6, 5), ball(2.5)])
def test_an_offset_that_is_none_is_never_believed(monkeypatch: pytest.MonkeyPatch, given: bd.Shape | None) -> None:
    def wrong(*arguments: Any) -> Iterator[TopoDS_Shape | None]:
        yield from len(CLOSED_WAYS) * [None if given is None else wrapped(given)]

    monkeypatch.setattr(gyroid_cad.kernel.offset, "offsets", wrong)
    with pytest.raises(KernelError, match="cannot offset the part by 1 mm"):
        parted(box())


def test_a_refusal_names_the_face_that_is_bent_too_narrowly_and_what_can_be_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # At its ends an ellipse of half axes a and b has the radius b2 / a, at its sides a2 / b.
    prism = bd.extrude(bd.make_face(bd.Ellipse(6, 3).edges()), 12)
    monkeypatch.setattr(gyroid_cad.kernel.offset, "offsets", lambda *arguments: (None for _ in CLOSED_WAYS))
    with pytest.raises(KernelError, match=r"below 1\.5\d* mm no offset folds .* face \d is bent at \("):
        hollow(require_part(wrapped(prism)), 2.0)
    with pytest.raises(
        KernelError, match=r"by 1 mm; each face .* below about 2 mm, .* face \d .* at \(.*core=, --core"
    ):
        hollow(require_part(wrapped(prism)), 1.0)


def test_what_fails_is_tried_once_more_within_the_room_there_is(monkeypatch: pytest.MonkeyPatch) -> None:
    def thin_ones(solid: TopoDS_Solid, openings: Any, skin: float, *more: Any) -> Iterator[TopoDS_Shape | None]:
        yield wrapped(box(*(side - 2 * skin for side in SIDES))) if skin <= 0.5 else None

    monkeypatch.setattr(gyroid_cad.kernel.offset, "offsets", thin_ones)
    with pytest.raises(KernelError, match=r"cannot offset the part by 1 mm.*; 0\.5 mm was tried and can be made"):
        parted(box())


def crashes(*arguments: str) -> None:
    os.abort()


def does_not_end(*arguments: str) -> None:
    time.sleep(60)


def ends_too_soon(*arguments: str) -> None:
    raise SystemExit


@pytest.mark.parametrize("fault", [crashes, does_not_end, ends_too_soon])
def test_a_way_that_crashes_or_does_not_end_gives_nothing(
    monkeypatch: pytest.MonkeyPatch, fault: Callable[..., None]
) -> None:
    monkeypatch.setattr(gyroid_cad.kernel.offset, "work", fault)
    monkeypatch.setattr(gyroid_cad.kernel.offset, "_SECONDS_AT_MOST", 0.3)
    (solid,) = require_part(wrapped(box())).solids
    assert list(offsets(solid, [], SKIN, list(CLOSED_WAYS)[:2])) == [None, None]


def test_a_way_has_more_time_where_others_want_the_processors_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gyroid_cad.kernel.offset, "work", does_not_end)
    monkeypatch.setattr(gyroid_cad.kernel.offset, "_SECONDS_AT_MOST", 0.3)
    monkeypatch.setattr(gyroid_cad.kernel.offset, "slowed", lambda: 4.0)
    (solid,) = require_part(wrapped(box())).solids
    begun = time.monotonic()
    assert list(offsets(solid, [], SKIN, ["pieces"])) == [None]
    assert time.monotonic() - begun > 1.2


def test_one_way_that_fails_does_not_keep_the_next_from_being_tried() -> None:
    (solid,) = require_part(wrapped(box())).solids
    nothing, core = offsets(solid, [], SKIN, ["no such way", "sharp"])
    assert nothing is None
    assert core is not None
    assert measure(core)[0] == pytest.approx(7 * 6 * 5)


def test_a_tube_round_an_edge_that_becomes_smooth_ends_in_a_point() -> None:
    hole = bd.loft([bd.Rectangle(6, 6).face(), bd.Pos(0, 0, 8) * bd.Circle(2.5).face()])
    block = bd.Pos(0, 0, 4) * bd.Box(12, 12, 8) - hole
    pieces, _ = offset_pieces(block.solid().wrapped, 0.8, ())
    # Four edges run up the hole, corners below and smooth at the circle.
    assert len(pieces) == len(block.faces()) + 4
    assert all(map(is_valid, pieces))


def test_a_part_is_as_deep_as_the_largest_ball_in_it() -> None:
    (solid,) = require_part(wrapped(plate())).solids
    deep, place = Depths(solid, []).deepest(10.0)
    assert deep == pytest.approx(3.0, rel=0.01)
    assert Depths(solid, []).kept.distance(place) == pytest.approx(deep)


def inner(*moves: float) -> bd.Part:
    """A block for the box's inside, moved."""
    return bd.Pos(*moves) * box(7, 6, 5)


@pytest.mark.parametrize(
    ("made", "core", "opened", "thickness"),
    [
        (box(), inner(), 0, 1.0),
        (box(), inner(0.5), 0, 0.5),
        (box(), inner(0, 0, 1), 1, 1.0),
        (ball(), bd.Pos(5, 5, 5) * bd.Box(1, 1, 4), 0, RADIUS - np.sqrt(2**2 + 2 * 0.5**2)),
        (ball(), bd.Pos(5, 5, 5) * bd.Rot(0, 90, 0) * bd.Cylinder(1, 9) & ball(), 4, None),
        (box() - ball(1.0), inner() - ball(1.5), 0, 0.5),
    ],
    ids=["inside", "aside", "to the top", "in a ball", "through a ball", "round a void"],
)
def test_a_given_core_and_the_skin_round_it_are_the_part(
    made: bd.Shape, core: bd.Shape, opened: int, thickness: float | None
) -> None:
    part, given = require_part(wrapped(made)), require_part(wrapped(core))
    found = hollow_round(part, given)
    skin = with_nothing_in_it(found)
    assert_sound(compound_of(skin))
    assert sum(found.opened) == opened
    assert found.thickness == (None if thickness is None else pytest.approx(thickness, abs=1e-6))
    assert volume(skin) == pytest.approx(part.volume - given.volume, rel=1e-6)
    everything = with_nothing_in_it(found, True)
    assert_sound(compound_of(everything))
    assert volume(everything) == pytest.approx(part.volume, rel=1e-6)


@pytest.mark.parametrize(
    ("core", "words"),
    [
        (inner(2), "30 of its 210 mm3 stick out, most of it round (10, 5, 5)"),
        (inner(20), "210 of its 210 mm3 stick out, most of it round (25, 5, 5)"),
        (box(), "less than the whole part"),
        (box(12, 12, 12), "stick out"),
    ],
)
def test_a_core_that_is_not_inside_is_refused_with_what_sticks_out(core: bd.Shape, words: str) -> None:
    with pytest.raises(ParameterError) as caught:
        hollow_round(require_part(wrapped(box())), require_part(wrapped(core)))
    assert words in str(caught.value)
    assert caught.value.parameter == "core"

"""Room that faces leave for a skin: of boxes, ribs and rounded ends as geometry has it, and many faces told at once."""

from __future__ import annotations

import time
from collections.abc import Iterator

import build123d as bd
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Shape, TopoDS_Solid

import gyroid_cad.kernel.offset
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import compound_of, measure, parts_of
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.offset import OPEN_WAYS
from gyroid_cad.kernel.part import Part, require_part
from gyroid_cad.kernel.shells import solids_of
from gyroid_cad.kernel.skin import hollow, hollow_round
from gyroid_cad.kernel.skin_room import SkinRoom


def part_of(made: bd.Shape) -> Part:
    return require_part(compound_of(solid.wrapped for solid in made.solids()))


def solid_of(made: bd.Shape) -> TopoDS_Solid:
    return part_of(made).solids[0]


def waved(count: int) -> bd.Part:
    """A thread unrolled: a prism, round which splines run in and out like so many flanks."""
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    radii = np.where(np.arange(count) % 2, 8.0, 6.8)
    places = np.stack([radii * np.cos(angles), radii * np.sin(angles)], axis=1)
    edges = []
    for start, end in zip(places, np.roll(places, -1, axis=0), strict=True):
        middle = 1.01 * (start + end) / 2
        edges.append(bd.Spline(*(tuple(point) for point in (start, middle, end))))
    return bd.extrude(bd.make_face(edges), 6)


def test_faces_of_a_box_have_room_for_half_its_smallest_side() -> None:
    rooms = SkinRoom(solid_of(bd.Box(9, 8, 7)), [], 1.0).rooms(10.0)
    assert [room.number for room in rooms] == [1, 2, 3, 4, 5, 6]
    assert [room.radius for room in rooms] == pytest.approx(6 * [3.5], rel=0.1)


def test_the_tightest_face_is_on_the_rib_and_is_no_opening() -> None:
    made = bd.Box(8, 8, 8) + bd.Pos(5.5, 0, 0) * bd.Box(3, 8, 1)
    end = made.faces().sort_by(bd.Axis.X)[-1].wrapped
    tightest = SkinRoom(solid_of(made), [], 2.0).tightest()
    assert tightest.radius == pytest.approx(0.5, rel=0.1)
    assert tightest.place[0] > 3.9
    others = SkinRoom(solid_of(made), [end], 2.0).rooms(4.0)
    assert tightest.number in {room.number for room in others} or len(others) == len(made.faces()) - 1


def test_a_ball_has_room_for_itself_and_a_fillet_for_its_neighbours_too() -> None:
    rooms = SkinRoom(solid_of(bd.Sphere(4)), [], 1.0).rooms(8.0)
    assert [room.radius for room in rooms] == pytest.approx(len(rooms) * [4.0], rel=0.03)
    rounded = bd.fillet(bd.Box(8, 8, 8).edges(), 1)
    assert min(one.radius for one in SkinRoom(solid_of(rounded), [], 1.0).rooms(8.0)) == pytest.approx(1.0, rel=0.12)


@pytest.mark.parametrize(("count", "skin"), [(12, 0.1), (36, 0.5)])
def test_only_bent_faces_without_a_closed_form_that_are_near_each_other_may_cross(count: int, skin: float) -> None:
    pairs = SkinRoom(solid_of(waved(count)), [], skin).crossing_pairs()
    assert count <= pairs < count * (count - 1) / 2
    assert SkinRoom(solid_of(bd.Box(3, 4, 5) - bd.Cylinder(1, 5)), [], skin).crossing_pairs() == 0


def test_too_many_that_may_cross_are_not_cut_and_the_refusal_names_place_thickness_and_ways_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[str] = []

    def none_works(*given: object) -> Iterator[None]:
        tried.extend(given[3])  # type: ignore[arg-type]
        yield from ()

    monkeypatch.setattr(gyroid_cad.kernel.offset, "offsets", none_works)
    part, start = part_of(waved(36)), time.process_time()
    words = r"pairs of its free-form faces .* below about \d\.\d+ mm, .* face \d+ has room for at \(.*core=, --core"
    with pytest.raises(KernelError, match=words):
        hollow(part, 1.0)
    assert time.process_time() - start < 5
    assert not any("pieces" in way for way in tried)
    assert any("pieces" in way for way in OPEN_WAYS)


def test_a_core_of_the_users_own_leaves_a_skin_where_none_can_be_made() -> None:
    made = hollow_round(part_of(waved(36)), part_of(bd.Pos(0, 0, 3) * bd.Cylinder(5, 4)))
    assert made.thickness == pytest.approx(1.0)
    assert made.core.volume == pytest.approx(np.pi * 5**2 * 4)


def test_a_small_void_stays_one_though_coarse_edges_have_its_volume_measured_wrongly() -> None:
    outer, void = (solid_of(made) for made in (bd.Box(20, 20, 20), bd.Box(0.2, 0.2, 0.2)))
    turned = [as_face(face.Reversed()) for face in parts_of(void, TopAbs_FACE)]

    def measured(shell: TopoDS_Shape) -> float:
        return 0.002 if measure(shell)[0] < 0 else 8000.0

    (made,) = solids_of([*map(as_face, parts_of(outer, TopAbs_FACE)), *turned], measured)
    assert measure(made)[0] == pytest.approx(8000 - 0.008)

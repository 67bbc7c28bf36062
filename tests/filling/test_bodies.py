"""Wall, two fluids and skin of a filled part as bodies that share the faces between them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from OCP.TopAbs import TopAbs_FACE, TopAbs_SOLID

from gyroid_cad.errors import ParameterError
from gyroid_cad.filling import throats
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.kernel import apart
from gyroid_cad.kernel.assembly import read_bodies
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.step import write_step
from gyroid_cad.step.products import BodyLabels
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.covering import frame_of, periodic_offsets
from gyroid_cad.wall.pore_limits import pore_limiting_diameter

CELL, FIT = 6.0, FitSettings(5)


def ball() -> cq.Workplane:
    return cq.Workplane().sphere(4.5)


def bodies_of(part: cq.Workplane | str, **given: object) -> Filled:
    return fill(part, CELL, density=0.3, kind="bodies", fit=FIT, **given)


def open_box() -> Filled:
    return bodies_of(cq.Workplane().box(8, 7, 6.5), skin=0.7, openings=[">X", "<X"])


MADE = {"ball": lambda: bodies_of(ball()), "box with skin and openings": open_box}


@pytest.fixture(scope="module", params=MADE)
def made(request: pytest.FixtureRequest) -> Filled:
    return MADE[request.param]()


def test_bodies_fill_the_part_together(made: Filled) -> None:
    volume = sum(size.volume for sizes in made.sizes.values() for size in sizes)
    assert volume == pytest.approx(made.report.part_volume, rel=1e-9)
    assert all(is_valid(shape) and topology(shape).closed for shape in made.domains.values())
    assert made.report.volumes["fluid-a"] > 0.2 * volume
    assert [fluid.dead_ends for fluid in made.report.fluids] == [0, 0]


def test_what_is_between_two_bodies_is_one_face_that_they_use_from_either_side(made: Filled) -> None:
    uses: dict[int, list[tuple[str, str, object]]] = {}
    order: list[object] = []
    for name, shape in made.domains.items():
        faces = list(parts_of(shape, TopAbs_FACE))
        assert len(faces) == len(made.face_names[name])
        for face, called in zip(faces, made.face_names[name], strict=True):
            number = next((k for k, other in enumerate(order) if face.IsSame(other)), len(order))
            if number == len(order):
                order.append(face)
            uses.setdefault(number, []).append((name, called, face.Orientation()))
    for users in uses.values():
        names, called, orientations = zip(*users, strict=True)
        shared = called[0] in ("wall/a", "wall/b", "skin/inside")
        assert len(users) == (2 if shared else 1)
        assert len(set(called)) == 1
        assert len(set(orientations)) == len(users) == len(set(names))
        if shared:
            assert {"wall/a": {"wall", "fluid-a"}, "wall/b": {"wall", "fluid-b"}}.get(called[0], set(names)) == set(
                names
            )


def test_a_file_has_the_bodies_and_their_faces_by_name(made: Filled, tmp_path: Path) -> None:
    path = tmp_path / "bodies.step"
    made.write(path)
    shapes, _ = read_bodies(path)
    assert sum(1 for shape in shapes for _ in parts_of(shape, TopAbs_SOLID)) == made.report.solids
    text = path.read_text()
    for name, called in made.face_names.items():
        assert f"BREP('{name}'" in text.replace("WITH_VOIDS", "BREP")
        for face, count in Counter(called).items():
            assert text.count(f"ADVANCED_FACE('{face}'") >= count
    assert "DRAUGHTING_PRE_DEFINED_COLOUR('blue')" in text


def test_bodies_are_refused_what_they_cannot_be(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="bodies share exact faces"):
        fill(ball(), CELL, density=0.3, kind="bodies", route="triangles")
    with pytest.raises(ParameterError, match="fill the part together"):
        fill(ball(), CELL, density=0.3, kind="bodies", drop_islands=True)


def test_where_one_fluid_flows_in_the_channels_of_the_other_are_closed() -> None:
    part = cq.Workplane().box(9, 8, 6)
    made = bodies_of(part, skin=0.7, openings=["a:<X", "a:>X", "b:<Y", ("b", (0.0, 4.0, 0.0))])
    assert sum(made.report.volumes.values()) == pytest.approx(made.report.part_volume, rel=1e-9)
    for name, axis, size in (("fluid-a", 0, 9), ("fluid-b", 1, 8)):
        boxes = [
            cq.Face(face).BoundingBox()
            for face, called in zip(parts_of(made.domains[name], TopAbs_FACE), made.face_names[name], strict=True)
            if called.startswith(f"{name[-1]}:")
        ]
        ends = {(round((box.xmin, box.ymin)[axis], 6), round((box.xmax, box.ymax)[axis], 6)) for box in boxes}
        assert ends == {(-size / 2, -size / 2), (size / 2, size / 2)}
        # The other way it ends at the skin.
        other = part.faces(("<Y", "<X")[axis]).val()
        assert other.distance(cq.Shape.cast(made.domains[name])) == pytest.approx(0.7, abs=1e-6)
    # Chips have been joined to what is round them, and what the fluids wet is what the wall shows them.
    assert {name: topology(shape).solids for name, shape in made.domains.items()} == dict.fromkeys(made.domains, 1)
    for fluid in made.report.fluids:
        kept = [
            cq.Face(face).Area()
            for face, called in zip(
                parts_of(made.domains[fluid.name], TopAbs_FACE), made.face_names[fluid.name], strict=True
            )
            if not called.startswith(f"{fluid.name[-1]}:")
        ]
        assert fluid.wetted_area == pytest.approx(sum(kept), rel=1e-3)
        assert fluid.hydraulic_diameter == pytest.approx(4 * fluid.volume / fluid.wetted_area)
    # By the kernel's own integrals, which know nothing of ours.
    wall = cq.Shape.cast(made.domains["wall"])
    assert wall.isValid()
    assert wall.Volume() == pytest.approx(made.report.volume, rel=1e-4)


def ported(part: cq.Workplane, **given: object) -> Filled:
    return bodies_of(part, skin=0.7, openings=["a:<X", "a:>X", "b:<Y", "b:>Y"], **given)


def test_a_plug_is_as_thick_as_it_is_asked_to_be() -> None:
    part = cq.Workplane().box(9, 8, 6)
    made = ported(part, plug=1.2)
    assert sum(made.report.volumes.values()) == pytest.approx(made.report.part_volume, rel=1e-9)
    for fluid, sides in (("fluid-a", ("<Y", ">Y")), ("fluid-b", ("<X", ">X"))):
        for side in sides:
            closed = part.faces(side).val()
            assert closed.distance(cq.Shape.cast(made.domains[fluid])) == pytest.approx(1.2, abs=1e-6)
    # Above and below it is still the skin.
    assert part.faces("<Z").val().distance(cq.Shape.cast(made.domains["fluid-a"])) == pytest.approx(0.7, abs=1e-6)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"plug": 0.3}, "plug = 0.3: expected from the skin's 0.7 mm"),
        ({"plug": CELL + 0.1}, "plug = 6.1.*to the 6 mm of a cell"),
        ({"plug": 1.0, "openings": [">X"]}, "plug = 1.0.*openings for fluids"),
        # Deeper than half of the part, from both sides.
        ({"plug": 5.0}, "plug = 5.0: expected less"),
    ],
)
def test_a_plug_is_refused_where_it_cannot_be(given: dict[str, object], message: str) -> None:
    openings = {"openings": ["a:<X", "a:>X", "b:<Y", "b:>Y"], **given}
    with pytest.raises(ParameterError, match=message):
        bodies_of(cq.Workplane().box(9, 8, 6), skin=0.7, **openings)


def test_a_throat_is_narrower_behind_a_plug_and_all_but_the_same_on_another_grid(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    part, home = cq.Workplane().box(9, 8, 6), (0.0, 0.0, 0.0)
    thin, thick = (ported(part, plug=plug, origin=home).report for plug in (None, 1.0))
    limit = pore_limiting_diameter(USUAL, CELL, thin.thickness)
    for one, other in zip(thin.fluids, thick.fluids, strict=True):
        assert 0 < other.throat < one.throat + 2e-3 * CELL
        assert one.throat <= limit
    monkeypatch.setattr(throats, "_ALONG", (24,))
    again = [fluid.throat for fluid in ported(part, origin=home).report.fluids]
    assert again == pytest.approx([fluid.throat for fluid in thin.fluids], abs=CELL / 20)


def test_without_a_skin_a_throat_is_the_lattices_own() -> None:
    report = fill(cq.Workplane().box(5, 4, 4), CELL, 0.5, kind="bodies", fit=FIT).report
    limit = pore_limiting_diameter(USUAL, CELL, 0.5)
    assert [fluid.throat for fluid in report.fluids] == pytest.approx([limit, limit], rel=1e-9)


def test_a_fluid_with_one_opening_is_a_dead_end() -> None:
    made = bodies_of(cq.Workplane().box(6, 5, 5), skin=0.7, openings=["a:<X", "b:>X"])
    assert [fluid.dead_ends for fluid in made.report.fluids] == [fluid.pieces for fluid in made.report.fluids]
    assert "dead end" in str(made.report)


def test_faces_that_the_parts_file_names_keep_their_names(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(apart, "read_apart", lambda path, reader: reader(str(path)))
    part, path = cq.Workplane().box(9, 8, 6), tmp_path / "named.step"
    names = ["inlet", "outlet", "north", "", "NONE", "bottom"]
    write_step(part.val().wrapped, path, labels=BodyLabels(face_names=names))
    made = bodies_of(str(path), skin=0.7, openings=["a:<X", "a:>X", "b:<Y", "b:>Y"])
    assert {called for called in made.face_names["fluid-a"] if ":" in called} == {"a:inlet", "a:outlet"}
    assert {called for called in made.face_names["fluid-b"] if ":" in called} == {"b:north", "b:2"}
    outside = {called for called in made.face_names["wall"] if called[:5] not in ("wall/", "skin/a", "skin/b")}
    assert outside - {"skin/a", "skin/b"} == {
        *("skin/inlet", "skin/outlet", "skin/north", "skin/bottom"),
        # What has no name of its own.
        "skin/outside",
    }
    for name, shape in made.domains.items():
        for face, called in zip(parts_of(shape, TopAbs_FACE), made.face_names[name], strict=True):
            if called.endswith("inlet"):
                assert cq.Face(face).BoundingBox().xmax == pytest.approx(-4.5, abs=1e-6)
    # Mouths are counted as before.
    assert [fluid.dead_ends for fluid in made.report.fluids] == [0, 0]


@pytest.mark.parametrize(
    ("openings", "message"),
    [
        (["a:>X", ">Y"], "a fluid as well"),
        (["a:>X"], "one for fluid b too"),
        (["a:>X", "b:>X"], "each face open for one fluid"),
    ],
)
def test_openings_for_fluids_are_refused_where_they_contradict(openings: list[str], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        bodies_of(ball() if len(openings) == 1 else cq.Workplane().box(9, 8, 6), skin=0.7, openings=openings)
    with pytest.raises(ParameterError, match="unless kind is"):
        fill(ball(), CELL, density=0.3, skin=0.7, openings=["a:>X", "b:<X"])


def test_an_opening_that_no_channel_of_its_fluid_reaches_is_refused() -> None:
    # A stub that is narrower than a channel, with the middle of one of fluid b before it.
    part = cq.Workplane().box(5, 4, 4).union(cq.Workplane().box(1.6, 1.6, 1.6).translate((0, 2, 0)))
    mouth, origins = np.array([[0.0, 2.8, 0.0]]), [(x, 0.0, z) for x in range(6) for z in range(6)]
    offsets = [periodic_offsets(frame_of(origin, (0, 0, 0)), CELL, mouth, USUAL)[0] for origin in origins]
    with pytest.raises(ParameterError, match="channels reach"):
        bodies_of(part, skin=0.5, openings=["a:>Y", "b:<Y"], origin=origins[int(np.argmin(offsets))])

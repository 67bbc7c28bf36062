"""Triangles as they come: open, inside out, touching or overlapping; what is done is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cadquery as cq
import numpy as np
import pytest
import trimesh

from gyroid_cad import ParameterError
from gyroid_cad.filling.triangle_part import mended, sound_body, triangle_part
from gyroid_cad.kernel.stl import solid_triangles
from gyroid_cad.mesh.triangles.booleans import united
from gyroid_cad.mesh.triangles.faults import holes_of


def cube(low: float = 0.0, high: float = 2.0) -> tuple[Any, Any]:
    mesh = trimesh.creation.box(bounds=[[low] * 3, [high] * 3]).subdivide()
    return np.array(mesh.vertices), np.array(mesh.faces)


def together(*meshes: tuple[Any, Any]) -> tuple[Any, Any]:
    both = trimesh.util.concatenate([trimesh.Trimesh(*mesh) for mesh in meshes])
    both.merge_vertices()
    return np.array(both.vertices), np.array(both.faces)


def test_holes_are_counted_and_placed_and_closed_if_that_is_asked_for() -> None:
    vertices, triangles = cube()
    middles = vertices[triangles].mean(axis=1)
    ends = [int(np.flatnonzero(np.abs(middles[:, 2] - height) < 0.01)[0]) for height in (0.0, 2.0)]
    opened = np.delete(triangles, ends, axis=0)
    assert sound_body(vertices, opened)[0] is None
    holes = holes_of(vertices, opened)
    assert [hole.edges for hole in holes] == [3, 3]
    assert {round(hole.place[2], 6) for hole in holes} >= {0.0, 2.0}
    body, remarks = mended(vertices, opened)
    assert body is not None
    assert body.volume == pytest.approx(8.0)
    assert "2 holes closed" in remarks[0]


def test_a_face_that_is_missing_altogether_is_closed() -> None:
    vertices, triangles = cube()
    opened = triangles[vertices[triangles].mean(axis=1)[:, 2] < 1.99]
    body, _ = mended(vertices, opened)
    assert body is not None
    assert body.volume == pytest.approx(8.0)


def test_what_is_inside_out_is_turned_and_triangles_that_disagree_are_made_to_agree() -> None:
    vertices, triangles = cube()
    body, remarks = sound_body(vertices, triangles[:, ::-1])
    assert body is not None
    assert (round(body.volume, 9), remarks) == (8.0, ("its triangles are inside out: turned",))
    mixed = triangles.copy()
    mixed[::3] = mixed[::3, ::-1]
    body, remarks = mended(vertices, mixed)
    assert body is not None
    assert body.volume == pytest.approx(8.0)
    assert f"{len(mixed[::3])} triangles turned" in remarks


def test_corners_that_nearly_meet_are_welded() -> None:
    vertices, triangles = cube()
    apart = vertices[triangles].reshape(-1, 3) + np.random.default_rng(0).uniform(-1e-6, 1e-6, (triangles.size, 3))
    body, remarks = mended(apart, np.arange(triangles.size).reshape(-1, 3))
    assert body is not None
    assert body.volume == pytest.approx(8.0, rel=1e-5)
    assert "corners welded" in remarks[0]


def test_triangles_that_are_all_apart_are_no_part_once_each_is_closed_by_its_back(tmp_path: Path) -> None:
    vertices, triangles = cube()
    corners = vertices[triangles]
    apart = 0.9 * corners + 0.1 * corners.mean(axis=1, keepdims=True)
    trimesh.Trimesh(apart.reshape(-1, 3), np.arange(triangles.size).reshape(-1, 3)).export(tmp_path / "soup.stl")
    with pytest.raises(ParameterError, match=f"expected closed triangles: there are {len(triangles)} holes"):
        triangle_part(tmp_path / "soup.stl", (), 0.1, repair=True)


def test_triangles_that_lie_on_others_are_left_out_and_counted() -> None:
    vertices, triangles = cube()
    body, remarks = mended(vertices, np.concatenate([triangles, triangles[:5]]))
    assert body is not None
    assert (round(body.volume, 9), remarks) == (8.0, ("5 triangles on others left out",))


def test_cubes_that_touch_in_an_edge_are_a_body_and_those_that_overlap_are_united() -> None:
    vertices, triangles = cube()
    beside = vertices + np.array([2.0, 2.0, 0.0])
    body, remarks = sound_body(*together((vertices, triangles), (beside, triangles)))
    assert body is not None
    assert (round(body.volume, 6), remarks) == (16.0, ())
    body, remarks = sound_body(*together((vertices, triangles), (vertices + 1.0, triangles)))
    assert body is not None
    assert (round(body.volume, 6), remarks) == (15.0, ("2 shells have 1 mm3 in common: united",))


def test_an_open_file_is_refused_with_its_holes_and_taken_if_it_may_be_repaired(tmp_path: Path) -> None:
    vertices, triangles = cube()
    trimesh.Trimesh(vertices, triangles[1:]).export(tmp_path / "open.stl")
    with pytest.raises(ParameterError, match="expected closed triangles: there is 1 hole, 3 edges round"):
        triangle_part(tmp_path / "open.stl", (), 0.1)
    part = triangle_part(tmp_path / "open.stl", (), 0.1, repair=True)
    assert part.body.volume == pytest.approx(8.0)
    assert part.remarks[0].startswith("1 hole closed, 3 edges round")
    (tmp_path / "empty.stl").write_bytes(b"")
    with pytest.raises(ParameterError, match="part = "):
        triangle_part(tmp_path / "empty.stl", (), 0.1)


def test_thin_curved_parts_lose_next_to_nothing_of_their_volume_if_they_are_meshed_closely() -> None:
    tube = cq.Workplane().circle(10).circle(9.6).extrude(20)
    volume = tube.val().Volume()
    coarse, close = (triangle_part(tube, (), 0.3, closely=closely).body.volume for closely in (False, True))
    assert abs(coarse / volume - 1) > 0.01
    assert close == pytest.approx(volume, rel=3e-4)


def test_films_that_chords_leave_between_solids_that_touch_are_no_voids() -> None:
    plate = cq.Workplane().box(20, 20, 8).faces(">Z").workplane().cboreHole(6.0, 11.0, 4.0)
    bolt = cq.Workplane().circle(3.0).extrude(4.0).faces(">Z").workplane().circle(5.5).extrude(4.0)
    shape = cq.Compound.makeCompound([plate.val(), bolt.val().move(z=-4.0)])
    bare = united(sound_body(vertices, triangles)[0] for vertices, triangles, _ in solid_triangles(shape.wrapped, 0.02))
    assert len(bare.shells()[0]) + len(bare.shells()[1]) > 1
    part = triangle_part(shape.wrapped, (), 0.02)
    assert (len(part.bodies()), part.body.void_count) == (1, 0)
    assert part.body.volume == pytest.approx(20 * 20 * 8)

"""Splitting region by region, in processes, gives what splitting all at once gives."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable
from functools import lru_cache
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Standard import Standard_OutOfMemory
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape
from scipy.spatial import cKDTree

from gyroid_cad.common import processes
from gyroid_cad.errors import KernelError
from gyroid_cad.kernel import region_split, regions
from gyroid_cad.kernel.check import compound_of, is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.part import Part, measure, require_part
from gyroid_cad.kernel.regions import split_by_region
from gyroid_cad.kernel.skin import hollow
from gyroid_cad.kernel.solid import build_faces
from gyroid_cad.kernel.split import Pieces, bounded_solids, split
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.wall.covering import CROSSING, INSIDE, SIDE_SAMPLES, Frame, covering_complex, patch_sides
from gyroid_cad.wall.exact import patch_points_and_normals
from gyroid_cad.wall.offset import build_wall

Floats = NDArray[np.float64]
Faces = list[TopoDS_Face]

L, THICKNESS = 10.0, 0.8
FRAME = Frame(np.array([1.0, 2.0, 3.0]), np.eye(3))
COARSE = FitSettings(6)


def ball(radius: float, x: float = 5.0, y: float = 5.0, z: float = 5.0) -> TopoDS_Shape:
    return BRepPrimAPI_MakeSphere(gp_Pnt(x, y, z), radius).Shape()


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(gp_Pnt(*low), gp_Pnt(*high)).Shape()


def plate_with_hole() -> TopoDS_Shape:
    hole = BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(5, 6, 0), gp_Dir(0, 0, 1)), 1.5, 10).Shape()
    return BRepAlgoAPI_Cut(box((2.3, 2.2, 4.1), (9.2, 9.4, 6.3)), hole).Shape()


SHAPES: dict[str, Callable[[], TopoDS_Shape]] = {
    "ball": lambda: ball(3.5),
    "plate with hole": plate_with_hole,
    "two balls": lambda: compound_of([ball(2.5), ball(2.0, 11.0)]),
}


def edges_of(faces: Iterable[TopoDS_Shape]) -> set[int]:
    return {hash(edge) for face in faces for edge in parts_of(face, TopAbs_EDGE)}


def never(point: Floats) -> bool:
    raise AssertionError("asked")


def lattice_in(part: Part) -> tuple[Faces, Faces]:
    """The lattice's faces that the part's boundary may cross, and those wholly inside."""
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
    return cut, whole


@lru_cache(maxsize=8)
def subject(name: str) -> tuple[Part, Faces, Faces]:
    part = require_part(SHAPES[name]())
    return (part, *lattice_in(part))


@pytest.fixture(autouse=True)
def _small_regions(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(region_split, "FACES_OF_REGION", 20)
    monkeypatch.setattr(regions, "_FEW", 20)


@pytest.mark.parametrize("name", SHAPES)
def test_the_solids_are_those_of_splitting_at_once(name: str, tmp_path: Path) -> None:
    part, cut, whole = subject(name)
    assert len(region_split.Task(part, cut).regions) > 2
    ours, theirs = split_by_region(part, cut, 2), split(part, cut)
    assert len(ours.inside) == len(theirs.inside)
    assert ours.origins == theirs.origins
    assert len(ours.changed) == len(theirs.changed)
    # Edges that were not cut are the very same still.
    assert edges_of(ours.inside) & edges_of(cut) == edges_of(theirs.inside) & edges_of(cut)
    solids, others = (compound_of(bounded_solids(pieces, whole, never)) for pieces in (ours, theirs))
    assert is_valid(solids)
    assert topology(solids).closed
    assert topology(solids) == topology(others)
    assert measure(solids) == pytest.approx(measure(others), rel=1e-9)
    write_step(solids, tmp_path / "solids.step")
    back = read_step(tmp_path / "solids.step")
    assert is_valid(back)
    assert topology(back) == topology(others)
    assert measure(back) == pytest.approx(measure(others), rel=1e-6)


def test_the_result_does_not_depend_on_how_many_processes_there_are() -> None:
    part, cut, _ = subject("two balls")
    told: list[list[tuple[int, int]]] = [[], []]
    pieces = [
        split_by_region(part, cut, processes, lambda *done, run=run: run.append(done))
        for processes, run in zip((2, 3), told, strict=True)
    ]
    first, second = ([measure(face) for face in [*some.inside, *some.boundary]] for some in pieces)
    assert first == second
    for run in told:
        assert len(run) > 2
        assert run == sorted(run)
        assert run[-1] == (len(cut), len(cut))


def test_where_no_face_meets_the_boundary_it_stays_whole() -> None:
    _, cut, whole = subject("ball")
    faces = [*cut, *whole]
    part = require_part(box((-90, -90, -90), (90, 90, 90)))
    pieces = split_by_region(part, faces, 2)
    assert len(pieces.inside) == len(faces)
    assert {hash(face) for face in pieces.inside} == {hash(face) for face in faces}
    assert [hash(face) for face in pieces.boundary] == [hash(face) for face in parts_of(part.shape, TopAbs_FACE)]
    assert pieces.changed == ()


def test_a_core_split_by_region_joins_its_skin() -> None:
    part = require_part(box((2.3, 2.2, 3.1), (7.2, 7.4, 7.3)))
    skinned = hollow(part, 0.9, [next(parts_of(part.shape, TopAbs_FACE))])
    cut, whole = lattice_in(skinned.core)
    ours, theirs = (
        compound_of(skinned.solids(pieces, whole, never))
        for pieces in (split_by_region(skinned.core, cut, 2), split(skinned.core, cut))
    )
    assert is_valid(ours)
    assert topology(ours).closed
    assert topology(ours) == topology(theirs)
    assert measure(ours) == pytest.approx(measure(theirs), rel=1e-9)


def fails(*arguments: object, **named: object) -> NoReturn:
    raise RuntimeError("out of order")


def ends(*arguments: object) -> NoReturn:
    os._exit(3)


@pytest.mark.parametrize(("happens", "said"), [(fails, "out of order"), (ends, "ended too soon")])
def test_what_goes_wrong_in_a_process_is_an_error_of_the_kernel(
    happens: Callable[..., NoReturn], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, cut, _ = subject("ball")
    monkeypatch.setattr(region_split.RegionSplit, "found", happens)
    with pytest.raises(KernelError, match=said):
        split_by_region(part, cut, 2)


@pytest.mark.parametrize("why", ["few faces", "one process"])
def test_else_all_is_split_at_once(why: str, monkeypatch: pytest.MonkeyPatch) -> None:
    part, cut, _ = subject("ball")
    told: list[tuple[int, int]] = []
    made = Pieces((), ())
    monkeypatch.setattr(processes, "ProcessPoolExecutor", fails)
    monkeypatch.setattr(regions, "split", lambda part, faces: made)
    faces = cut[:10] if why == "few faces" else cut
    count = 1 if why == "one process" else None
    assert split_by_region(part, faces, count, lambda *done: told.append(done)) is made
    assert told == [(len(faces), len(faces))]


@pytest.mark.parametrize("why", ["one processor", "another system", "process of a pool"])
def test_where_no_process_can_be_started_regions_are_split_here_with_the_same_result(
    why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    part, cut, _ = subject("two balls")
    expected = split_by_region(part, cut, 2)
    monkeypatch.setattr(processes, "ProcessPoolExecutor", fails)
    if why == "one processor":
        monkeypatch.setattr(os, "sched_getaffinity", lambda _: {0}, raising=False)
    elif why == "another system":
        monkeypatch.setattr(processes.sys, "platform", "darwin")
    else:
        monkeypatch.setattr(processes.multiprocessing.current_process(), "daemon", True, raising=False)
    told: list[tuple[int, int]] = []
    pieces = split_by_region(part, cut, None, lambda *done: told.append(done))
    assert told[-1] == (len(cut), len(cut))
    assert len(told) > 2
    first, second = ([measure(face) for face in [*some.inside, *some.boundary]] for some in (pieces, expected))
    assert first == second


def test_if_no_thread_can_be_started_it_is_an_error_and_no_process_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    part, cut, _ = subject("ball")
    # As at a limit of memory: the processes are there, the thread that feeds them is not.
    monkeypatch.setattr("threading.Thread.start", fails)
    before = multiprocessing.active_children()
    with pytest.raises(KernelError, match="out of order"):
        split_by_region(part, cut, 2)
    assert multiprocessing.active_children() == before


def test_memory_that_gives_out_in_a_process_is_told_as_that(monkeypatch: pytest.MonkeyPatch) -> None:
    part, cut, _ = subject("ball")

    def gives_out(*_: object) -> NoReturn:
        raise Standard_OutOfMemory("Standard_MMgrRaw::Allocate(): malloc failed")

    monkeypatch.setattr(region_split.RegionSplit, "found", gives_out)
    with pytest.raises(MemoryError):
        split_by_region(part, cut, 2)

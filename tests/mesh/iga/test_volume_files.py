"""Files of trivariate patches, read by MFEM, G+Smo and plain numpy."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from xml.etree import ElementTree

import mfem.ser as mfem
import numpy as np
import pygismo
import pytest
from scipy.interpolate import BSpline
from volume_cases import CELL_SIZE, KINDS, volumes_named, wall_named
from volume_readers import SIDE_0, SIDE_1, Multipatch, Problem, u_fastest

from gyroid_cad import ExportError, ParameterError
from gyroid_cad.common.formats import VOLUME_FORMATS
from gyroid_cad.mesh.iga.data import BOUNDARY_PARTS

DiskFull = Callable[[int], AbstractContextManager[None]]


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_mfem_joins_the_patches_at_all_control_points_they_share(kind: str, degree: int, tmp_path: Path) -> None:
    volumes = volumes_named(kind, degree)
    problem = Problem(volumes, tmp_path)
    assert problem.space.GetNDofs() == len(volumes.control_points)
    numbers = problem.numbers()
    assert np.array_equal(np.sort(numbers), np.arange(len(numbers)))
    np.testing.assert_allclose(problem.nodes, volumes.control_points[numbers], atol=1e-13 * CELL_SIZE)


@pytest.mark.parametrize("kind", KINDS)
def test_opposite_edges_have_one_knot_vector_the_same_way_round_in_mfems_file(kind: str, tmp_path: Path) -> None:
    # MFEM 4.10 would turn them itself; older releases read no other file.
    volumes_named(kind).write(tmp_path / "wall.mesh")
    lines = (tmp_path / "wall.mesh").read_text().split("\n")

    def section(name: str) -> list[list[int]]:
        first = lines.index(name) + 2
        return [list(map(int, line.split())) for line in lines[first : first + int(lines[first - 1])]]

    knots = {(start, end): (knot, 1) for knot, start, end in section("edges")}
    knots |= {(end, start): (knot, -1) for (start, end), (knot, _) in knots.items()}
    for _, _, *corners in section("elements"):
        a, b, c, d, e, f, g, h = corners
        for along in (
            [(a, b), (d, c), (e, f), (h, g)],
            [(a, d), (b, c), (e, h), (f, g)],
            [(a, e), (b, f), (c, g), (d, h)],
        ):
            assert len({knots[ends] for ends in along}) == 1


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", ["uniform", "turned", "graded", "mapped"])
def test_mfem_integrates_the_volume_of_the_wall(kind: str, degree: int, tmp_path: Path) -> None:
    assert Problem(volumes_named(kind, degree), tmp_path).integral() == pytest.approx(
        wall_named(kind).volume(), rel=1e-13
    )


def test_mfem_integrates_rational_volumes_the_better_the_finer_its_rule(tmp_path: Path) -> None:
    problem, volume = Problem(volumes_named("rational"), tmp_path), wall_named("rational").volume()
    errors = [abs(problem.integral(degree) / volume - 1) for degree in (9, 19, 39)]
    assert errors[1] < errors[0] / 20
    assert errors[2] < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_mfem_finds_the_faces_of_each_part_of_the_boundary(kind: str, tmp_path: Path) -> None:
    volumes = volumes_named(kind)
    problem = Problem(volumes, tmp_path)
    faces = np.bincount(problem.mesh.GetBdrAttributeArray(), minlength=4)
    spans = len(np.unique(volumes.knots)) - 1
    patches = np.bincount(volumes.boundary[:, 2])
    # Across the wall there is one element.
    assert faces.tolist() == [0, *(patches * [spans**2, spans**2, spans])]
    numbers = problem.numbers()
    for side in (SIDE_0, SIDE_1):
        expected = np.unique(volumes.patch_points[..., 0 if side == SIDE_0 else -1])
        assert np.array_equal(np.sort(numbers[problem.on_boundary(side)]), expected)
    assert np.array_equal(np.unique(problem.mesh.GetAttributeArray()), np.unique(volumes.patch_group) + 1)


def topology(path: Path) -> tuple[list[tuple[int, ...]], list[tuple[int, ...]]]:
    """Interfaces and boundary of a multipatch file."""
    node = ElementTree.parse(path).getroot().find("MultiPatch")
    assert node is not None
    found = []
    for tag in ("interfaces", "boundary"):
        lines = "".join(child.text or "" for child in node.findall(tag)).split("\n")
        found.append(sorted(tuple(map(int, line.split())) for line in lines if line.strip()))
    return found[0], found[1]


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_gismo_joins_the_same_control_points(kind: str, degree: int, tmp_path: Path) -> None:
    volumes = volumes_named(kind, degree)
    read = Multipatch(volumes, tmp_path)
    assert read.patches.nPatches() == len(volumes)
    assert len(read.patches.interfaces()) == len(volumes.interfaces)
    assert len(read.patches.boundaries()) == len(volumes.boundary)
    assert read.mapper.size() == len(volumes.control_points)
    pairs = np.stack([u_fastest(volumes.patch_points).ravel(), read.numbers().ravel()], axis=1)
    # One of ours for each of theirs and the other way round.
    assert len(np.unique(pairs, axis=0)) == len(volumes.control_points)


@pytest.mark.parametrize("kind", KINDS)
def test_interfaces_are_those_gismo_finds_by_comparing_corners(kind: str, tmp_path: Path) -> None:
    read = Multipatch(volumes_named(kind), tmp_path)
    alone = pygismo.core.gsMultiPatch()
    for index in range(read.patches.nPatches()):
        alone.addPatch(read.patches.patch(index))
    assert len(alone.interfaces()) == 0
    alone.computeTopology(1e-6 * CELL_SIZE, False, False)
    found = pygismo.io.gsFileData()
    found.add(alone)
    found.save(str(tmp_path / "found.xml"))
    assert topology(tmp_path / "wall.xml") == topology(tmp_path / "found.xml")


@pytest.mark.parametrize("kind", KINDS)
def test_gismo_evaluates_the_same_points(kind: str, tmp_path: Path) -> None:
    volumes = volumes_named(kind)
    read = Multipatch(volumes, tmp_path)
    places = np.random.default_rng(0).uniform([[-1], [-1], [0]], 1, (3, 20))
    for index in range(0, len(volumes), 5):
        expected = volumes.patch(index).evaluate(*places)
        np.testing.assert_allclose(read.patches.patch(index).eval(places).T, expected, atol=1e-13 * CELL_SIZE)


def test_parts_of_the_boundary_have_names_in_gismos_file(tmp_path: Path) -> None:
    volumes = volumes_named("uniform")
    volumes.write(tmp_path / "wall.xml")
    nodes = ElementTree.parse(tmp_path / "wall.xml").getroot().findall("MultiPatch/boundary")
    counts = {node.get("name"): len((node.text or "").strip().split("\n")) for node in nodes}
    assert counts == dict(zip(BOUNDARY_PARTS, np.bincount(volumes.boundary[:, 2]).tolist(), strict=True))


def test_json_and_npz_hold_the_arrays_as_they_are(tmp_path: Path) -> None:
    volumes = volumes_named("rational")
    for ending in (".json", ".npz"):
        volumes.write(tmp_path / f"wall{ending}")
    with np.load(tmp_path / "wall.npz") as binary:
        arrays = dict(binary)
    text = json.loads((tmp_path / "wall.json").read_text())
    assert set(volumes.__slots__) < set(arrays)
    assert set(volumes.__slots__) < set(text)
    for name in volumes.__slots__:
        stored = getattr(volumes, name)
        assert np.array_equal(arrays[name], stored)
        assert arrays[name].dtype == stored.dtype
        assert np.array_equal(np.array(text[name]), stored)
    for found in (arrays, text):
        assert tuple(found["degrees"]) == (3, 3, 1)
        assert tuple(found["boundary_parts"]) == BOUNDARY_PARTS
    assert text["length_unit"] == "mm"


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", ["graded", "rational"])
@pytest.mark.parametrize("ending", [".json", ".npz"])
def test_what_json_and_npz_hold_is_the_wall_to_another_reader_of_splines(
    ending: str, kind: str, degree: int, tmp_path: Path
) -> None:
    wall = wall_named(kind)
    path = tmp_path / f"wall{ending}"
    volumes_named(kind, degree).write(path)
    found = dict(np.load(path)) if ending == ".npz" else json.loads(path.read_text())
    along, across, middle = np.linspace(-1, 1, 9), np.linspace(0, 1, 3), slice(1, 2)
    rows = BSpline.design_matrix(along, np.array(found["knots"]), found["degrees"][0]).toarray()
    columns = BSpline.design_matrix(across, np.array(found["knots_across"]), found["degrees"][2]).toarray()
    weights, points = np.array(found["weights"]), np.array(found["control_points"])
    below, above = ([wall.face(net, side) for net in range(len(wall.nets))] for side in (0, 1))
    for patch, numbers in enumerate(np.array(found["patch_points"])):
        numerator = np.einsum("ai,bj,ck,ijkd->abcd", rows, rows, columns, points[numbers] * weights[..., np.newaxis])
        values = numerator / np.einsum("ai,bj,ck,ijk->abc", rows, rows, columns, weights)[..., np.newaxis]
        net, shift = wall.patch_net[patch], wall.shifts[wall.patch_shift[patch]]
        ends = np.stack([faces[net].evaluate(along[:, np.newaxis], along) + shift for faces in (below, above)], axis=2)
        np.testing.assert_allclose(values[:, :, ::2], ends, atol=1e-12 * CELL_SIZE)
        np.testing.assert_allclose(values[:, :, middle], ends.mean(axis=2, keepdims=True), atol=1e-12 * CELL_SIZE)


def test_a_field_stands_in_mfem_where_it_stood_here(tmp_path: Path) -> None:
    volumes = volumes_named("turned", 3)
    problem = Problem(volumes, tmp_path)
    volumes.write_field(volumes.control_points @ [1.0, 2.0, 3.0], tmp_path / "field.gf")
    field = mfem.GridFunction(problem.mesh, str(tmp_path / "field.gf")).GetDataArray()
    np.testing.assert_allclose(field, problem.nodes @ [1.0, 2.0, 3.0], atol=1e-12 * CELL_SIZE)


@pytest.mark.parametrize("name", ["wall.stl", "wall", "wall.mesh.gz", "mesh"])
def test_an_unknown_ending_is_refused_with_those_that_are_known(name: str, tmp_path: Path) -> None:
    with pytest.raises(
        ParameterError, match=r"output = .*: expected a file name ending in \.mesh, \.xml, \.json or \.npz"
    ):
        volumes_named("uniform").write(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_field_of_another_length_or_ending_is_refused(tmp_path: Path) -> None:
    volumes = volumes_named("uniform")
    with pytest.raises(ParameterError, match=r"values = .*a finite number for each control point"):
        volumes.write_field(np.zeros(3), tmp_path / "field.gf")
    with pytest.raises(ParameterError, match=r"output = .*ending in \.gf"):
        volumes.write_field(np.zeros(len(volumes.control_points)), tmp_path / "field.mesh")


@pytest.mark.parametrize("ending", [form.endings[0] for form in VOLUME_FORMATS])
def test_a_full_disk_leaves_the_older_file_as_it_was(ending: str, tmp_path: Path, disk_full: DiskFull) -> None:
    path = tmp_path / f"wall{ending.upper()}"
    path.write_text("older")
    with disk_full(2000), pytest.raises(ExportError, match=r"wall.* was not written"):
        volumes_named("uniform").write(path)
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [(path.name, "older")]

"""Files of trivariate patches, read and solved on by MFEM and G+Smo, and read by plain numpy."""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

import mfem.ser as mfem
import numpy as np
import pygismo
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import spsolve
from volume_cases import CELL_SIZE, KINDS, constant_wall, wall_named

from gyroid_cad import ExportError, ParameterError
from gyroid_cad.complex import build_complex
from gyroid_cad.fit import FitSettings, fit_patch
from gyroid_cad.mesh.volume_files import VOLUME_FORMATS, write_mfem_field, write_volumes
from gyroid_cad.mesh.volumes import BOUNDARY_PARTS, VolumePatches, periodic_points, wall_volumes
from gyroid_cad.symmetry import bounding_cell
from gyroid_cad.tube import face_area
from gyroid_cad.wall import Wall, build_wall

Floats = NDArray[np.float64]
DiskFull = Callable[[int], AbstractContextManager[None]]

SIDE_0, SIDE_1, FREE = range(1, 4)


@lru_cache
def volumes_named(kind: str, degree: int = 1) -> VolumePatches:
    return wall_volumes(wall_named(kind), degree)


def bounding_cell_wall(points: int, thickness: float, cell_size: float = 2.0) -> Wall:
    """Six patches that meet in a corner."""
    return build_wall(build_complex((1, 1, 1), bounding_cell()), fit_patch(FitSettings(points)), cell_size, thickness)


class Problem:
    """A mesh file as MFEM reads it, with the space of its own patches."""

    def __init__(self, volumes: VolumePatches, folder: Path, refinements: int = 0) -> None:
        self.volumes, self.folder = volumes, folder
        write_volumes(volumes, folder / "wall.mesh")
        self.mesh = mfem.Mesh(str(folder / "wall.mesh"))
        for _ in range(refinements):
            self.mesh.UniformRefinement()
        self.space = mfem.FiniteElementSpace(self.mesh, self.mesh.GetNodes().OwnFEC())

    @property
    def nodes(self) -> Floats:
        """Control points as MFEM numbers them."""
        nodes = self.mesh.GetNodes()
        return np.stack(
            [
                nodes.GetDataArray()[[nodes.FESpace().DofToVDof(i, c) for i in range(self.space.GetNDofs())]]
                for c in range(3)
            ],
            axis=1,
        )

    def numbers(self) -> NDArray[np.int64]:
        """Our numbers of MFEM's control points."""
        write_mfem_field(self.volumes, np.arange(len(self.volumes.control_points)), self.folder / "numbers.gf")
        return mfem.GridFunction(self.mesh, str(self.folder / "numbers.gf")).GetDataArray().astype(np.int64)

    def integral(self, degree: int = 9) -> float:
        """Of 1, by a rule for polynomials of a degree along each parameter."""
        integrator = mfem.DomainLFIntegrator(mfem.ConstantCoefficient(1.0))
        integrator.SetIntRule(mfem.IntRules.Get(mfem.Geometry.CUBE, degree))
        form = mfem.LinearForm(self.space)
        form.AddDomainIntegrator(integrator)
        form.Assemble()
        return float(np.sum(form.GetDataArray()))

    def inflow(self, field: mfem.VectorCoefficient) -> Floats:
        """What flows in through the boundary, all of it, by control point."""
        form = mfem.LinearForm(self.space)
        # Rules for degree 2 * 3 + 3, for a cubic function on a normal of degree 5.
        form.AddBoundaryIntegrator(mfem.BoundaryNormalLFIntegrator(field, 2, 3))
        form.Assemble()
        return form.GetDataArray().copy()

    def matrix(self, *integrators: mfem.BilinearFormIntegrator) -> csr_array:
        form = mfem.BilinearForm(self.space)
        for integrator in integrators:
            form.AddDomainIntegrator(integrator)
        form.Assemble()
        form.Finalize()
        matrix = form.SpMat()
        arrays = (matrix.GetDataArray().copy(), matrix.GetJArray().copy(), matrix.GetIArray().copy())
        return csr_array(arrays, shape=(matrix.Height(), matrix.Width()))

    def stiffness(self) -> csr_array:
        return self.matrix(mfem.DiffusionIntegrator(mfem.ConstantCoefficient(1.0)))

    def on_boundary(self, *parts: int) -> NDArray[np.bool_]:
        """Which control points belong to parts of the boundary, by MFEM's attributes."""
        marker, found = mfem.intArray([int(part in parts) for part in (SIDE_0, SIDE_1, FREE)]), mfem.intArray()
        self.space.GetEssentialTrueDofs(marker, found)
        chosen = np.zeros(self.space.GetNDofs(), dtype=bool)
        chosen[found.ToList()] = True
        return chosen


def solved(matrix: csr_array, sources: Floats, values: Floats, known: NDArray[np.bool_]) -> Floats:
    """Values where they are known, and elsewhere such that the matrix makes the sources of them."""
    free = ~known
    result = np.where(known, values, 0.0)
    result[free] = spsolve(csc_array(matrix[free][:, free]), (sources - matrix @ result)[free])
    return result


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", KINDS)
def test_mfem_joins_the_patches_at_all_control_points_they_share(kind: str, degree: int, tmp_path: Path) -> None:
    volumes = volumes_named(kind, degree)
    problem = Problem(volumes, tmp_path)
    assert problem.space.GetNDofs() == len(volumes.control_points)
    numbers = problem.numbers()
    assert np.array_equal(np.sort(numbers), np.arange(len(numbers)))
    np.testing.assert_allclose(problem.nodes, volumes.control_points[numbers], atol=1e-13 * CELL_SIZE)


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


@pytest.mark.parametrize("degree", [1, 3])
@pytest.mark.parametrize("kind", ["uniform", "turned", "graded"])
def test_mfem_solves_for_linear_functions_exactly(kind: str, degree: int, tmp_path: Path) -> None:
    # The patch test: x, y and z are in the space, have no sources, and a gradient that flows through every face.
    problem, gradient = Problem(volumes_named(kind, degree), tmp_path), np.array([0.3, -0.5, 0.8])
    exact, stiffness = problem.nodes @ gradient, problem.stiffness()
    inflow = problem.inflow(mfem.VectorConstantCoefficient(mfem.Vector(gradient)))
    np.testing.assert_allclose(stiffness @ exact, inflow, atol=1e-12 * CELL_SIZE**2)
    assert exact @ inflow == pytest.approx(gradient @ gradient * wall_named(kind).volume(), rel=1e-12)
    np.testing.assert_allclose(
        solved(stiffness, inflow, exact, problem.on_boundary(FREE)), exact, rtol=0, atol=1e-9 * CELL_SIZE
    )


def test_solutions_on_cubic_patches_converge_at_order_four(tmp_path: Path) -> None:
    # u = exp(d . x) has lap u = |d|^2 u; MFEM knows of it only what flows in through the boundary.
    # Slow (3 s): on a coarser mesh the order is not reached yet.
    rate = np.array([2.0, 1.0, 2.0])

    class Solution(mfem.PyCoefficient):
        def EvalValue(self, x: Floats) -> float:
            return float(np.exp(rate @ x))

    class Gradient(mfem.VectorPyCoefficient):
        def EvalValue(self, x: Floats) -> Floats:
            return np.asarray(rate * np.exp(rate @ x))

    volumes = wall_volumes(bounding_cell_wall(5, 0.2), 3)
    exact, gradient = Solution(), Gradient(3)
    rule = mfem.IntRules.Get(mfem.Geometry.CUBE, 7)
    errors = []
    for refinements in (1, 2):
        problem = Problem(volumes, tmp_path, refinements)
        diffusion = mfem.DiffusionIntegrator(mfem.ConstantCoefficient(1.0))
        reaction = mfem.MassIntegrator(mfem.ConstantCoefficient(rate @ rate))
        for integrator in (diffusion, reaction):
            integrator.SetIntRule(rule)
        matrix = problem.matrix(diffusion, reaction)
        found = mfem.GridFunction(problem.space)
        found.Assign(mfem.Vector(spsolve(csc_array(matrix), problem.inflow(gradient))))
        errors.append(found.ComputeL2Error(exact))
    assert 3.8 < np.log2(errors[0] / errors[1]) < 4.5


def test_heat_through_the_wall_is_conserved_and_bounded_by_the_areas_of_its_faces(tmp_path: Path) -> None:
    relative_thickness = 0.1
    thickness = relative_thickness * CELL_SIZE
    wall = constant_wall((1, 1, 1), points=10, relative_thickness=relative_thickness)
    through = []
    for degree in (1, 3):
        problem = Problem(wall_volumes(wall, degree), tmp_path)
        hot, cold = problem.on_boundary(SIDE_1), problem.on_boundary(SIDE_0)
        stiffness = problem.stiffness()
        flow = stiffness @ solved(stiffness, np.zeros(len(hot)), hot.astype(float), hot | cold)
        assert np.sum(flow[hot]) == pytest.approx(-np.sum(flow[cold]), rel=1e-11)
        through.append(np.sum(flow[hot]))
    # Degree 1 leaves no choice: the gradient is 1 / thickness everywhere.
    assert through[0] == pytest.approx(wall.volume() / thickness**2, rel=1e-5)
    # Were temperature a function of the distance s alone, heat would have A(s) to pass there: no less than flows.
    # No more than flows would if the whole wall were as narrow as its faces.
    s, weights = np.polynomial.legendre.leggauss(12)
    areas = np.array([face_area(abs(place) * relative_thickness) for place in s]) * CELL_SIZE**2
    most, least = (
        1 / (thickness / 2 * np.sum(weights / areas)),
        face_area(relative_thickness) * CELL_SIZE**2 / thickness,
    )
    assert least < through[1] < most < through[0]
    assert through[1] == pytest.approx(most, rel=1e-4)


def conductivity(wall: Wall, degree: int, folder: Path) -> Floats:
    """Of the endless lattice over that of its material; shape (3, 3)."""
    problem = Problem(wall_volumes(wall, degree), folder)
    stiffness, nodes = problem.stiffness(), problem.nodes
    numbers = periodic_points(wall, problem.volumes)[problem.numbers()]
    joined = csr_array((np.ones(len(numbers)), (np.arange(len(numbers)), numbers)))
    periodic, drive = csc_array(joined.T @ stiffness @ joined), -joined.T @ (stiffness @ nodes)
    swing = np.zeros(drive.shape)
    # One value may be chosen: the first is 0.
    swing[1:] = spsolve(periodic[1:, 1:], drive[1:])
    temperature = nodes + joined @ swing
    return np.asarray(temperature.T @ (stiffness @ temperature)) / CELL_SIZE**3


def test_the_endless_lattice_conducts_alike_in_all_directions_and_under_the_bound_of_hashin_and_shtrikman(
    tmp_path: Path,
) -> None:
    wall = constant_wall((1, 1, 1), points=6, relative_thickness=0.3)
    density = wall.volume() / CELL_SIZE**3
    bound = 2 * density / (3 - density)
    found = [conductivity(wall, degree, tmp_path) for degree in (1, 3)]
    for tensor in found:
        np.testing.assert_allclose(tensor, tensor[0, 0] * np.eye(3), atol=1e-12)
        assert 0.9 * bound < tensor[0, 0] < bound
    # More functions, less energy.
    assert found[1][0, 0] < found[0][0, 0]


def test_thin_walls_conduct_two_thirds_of_their_density(tmp_path: Path) -> None:
    # Coordinates of a minimal surface are harmonic on it: heat needs no detour, and the error is of order 2.
    excess = []
    for relative_thickness in (0.08, 0.04):
        wall = constant_wall((1, 1, 1), points=8, relative_thickness=relative_thickness)
        tensor = conductivity(wall, 1, tmp_path)
        excess.append(tensor[0, 0] / (wall.volume() / CELL_SIZE**3) - 2 / 3)
    assert np.log2(excess[0] / excess[1]) == pytest.approx(2, abs=0.05)


class Multipatch:
    """A multipatch file as G+Smo reads it, with its own numbering of the degrees of freedom."""

    def __init__(self, volumes: VolumePatches, folder: Path) -> None:
        write_volumes(volumes, folder / "wall.xml")
        self.patches = pygismo.core.gsMultiPatch()
        pygismo.io.gsReadFile(str(folder / "wall.xml"), self.patches)
        self.bases = pygismo.core.gsMultiBasis(self.patches)
        self.mapper = pygismo.assembler.createMapper(self.bases, self.patches, 1, True, True)

    def numbers(self) -> NDArray[np.int64]:
        """G+Smo's number of every control point of every patch, u fastest."""
        return np.asarray(self.mapper.asVector(0), dtype=np.int64).reshape(self.patches.nPatches(), -1)

    def stiffness(self) -> csr_array:
        """Assembled by G+Smo patch by patch, with two points more than the degree, and joined by its own mapper."""
        options = pygismo.io.gsOptionList()
        options.addReal("quA", "points per degree", 1.0)
        options.addInt("quB", "points more", 2)
        terms = {"alpha": 0.0, "beta": 1.0, "gamma": 0.0}
        apart = pygismo.utils.gsH1Projection.matrix(self.bases, self.patches, targetDim=1, options=options, **terms)
        numbers = self.numbers().ravel()
        join = csr_array((np.ones(len(numbers)), (np.arange(len(numbers)), numbers)))
        return csr_array(join.T @ csr_array(apart) @ join)


def u_fastest(net: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.swapaxes(net, 1, 3).reshape(len(net), -1)


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
    write_volumes(volumes, tmp_path / "wall.xml")
    nodes = ElementTree.parse(tmp_path / "wall.xml").getroot().findall("MultiPatch/boundary")
    counts = {node.get("name"): len((node.text or "").strip().split("\n")) for node in nodes}
    assert counts == dict(zip(BOUNDARY_PARTS, np.bincount(volumes.boundary[:, 2]).tolist(), strict=True))


@pytest.mark.parametrize("kind", ["turned", "graded"])
def test_gismo_and_mfem_find_the_same_temperatures(kind: str, tmp_path: Path) -> None:
    volumes = volumes_named(kind, 3)
    read, problem = Multipatch(volumes, tmp_path), Problem(volumes, tmp_path)
    count = len(volumes.control_points)
    theirs = np.empty(count, dtype=np.int64)
    theirs[u_fastest(volumes.patch_points)] = read.numbers()
    across = np.arange(count) * 4 // count
    found = []
    for matrix, order in ((read.stiffness(), theirs), (problem.stiffness(), np.argsort(problem.numbers()))):
        ours = matrix[order][:, order]
        found.append(solved(ours, np.zeros(count), (across == 3).astype(float), (across == 0) | (across == 3)))
    assert np.ptp(found[0]) == pytest.approx(1)
    np.testing.assert_allclose(found[0], found[1], atol=1e-10)
    assert not np.allclose(found[0], across / 3, atol=1e-3)


def test_json_and_npz_hold_the_arrays_as_they_are(tmp_path: Path) -> None:
    volumes = volumes_named("rational")
    for ending in (".json", ".npz"):
        write_volumes(volumes, tmp_path / f"wall{ending}")
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
    write_volumes(volumes_named(kind, degree), path)
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
    write_mfem_field(volumes, volumes.control_points @ [1.0, 2.0, 3.0], tmp_path / "field.gf")
    field = mfem.GridFunction(problem.mesh, str(tmp_path / "field.gf")).GetDataArray()
    np.testing.assert_allclose(field, problem.nodes @ [1.0, 2.0, 3.0], atol=1e-12 * CELL_SIZE)


@pytest.mark.parametrize("name", ["wall.stl", "wall", "wall.mesh.gz", "mesh"])
def test_an_unknown_ending_is_refused_with_those_that_are_known(name: str, tmp_path: Path) -> None:
    with pytest.raises(
        ParameterError, match=r"output = .*: expected a file name ending in \.mesh, \.xml, \.json, \.npz"
    ):
        write_volumes(volumes_named("uniform"), tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_field_of_another_length_or_ending_is_refused(tmp_path: Path) -> None:
    volumes = volumes_named("uniform")
    with pytest.raises(ParameterError, match=r"values = .*a finite number for each control point"):
        write_mfem_field(volumes, np.zeros(3), tmp_path / "field.gf")
    with pytest.raises(ParameterError, match=r"output = .*ending in \.gf"):
        write_mfem_field(volumes, np.zeros(len(volumes.control_points)), tmp_path / "field.mesh")


@pytest.mark.parametrize("ending", VOLUME_FORMATS)
def test_a_full_disk_leaves_the_older_file_as_it_was(ending: str, tmp_path: Path, disk_full: DiskFull) -> None:
    path = tmp_path / f"wall{ending.upper()}"
    path.write_text("older")
    with disk_full(2000), pytest.raises(ExportError, match=r"wall.* was not written"):
        write_volumes(volumes_named("uniform"), path)
    assert [(found.name, found.read_text()) for found in tmp_path.iterdir()] == [(path.name, "older")]

"""Problems solved by MFEM and G+Smo on the wall's own patches."""

from __future__ import annotations

from pathlib import Path

import mfem.ser as mfem
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array
from scipy.sparse.linalg import spsolve
from volume_cases import CELL_SIZE, constant_wall, volumes_named, wall_named
from volume_readers import FREE, SIDE_0, SIDE_1, Multipatch, Problem, solved, u_fastest

from gyroid_cad.mesh.iga.patches import periodic_points, wall_volumes
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.symmetry import bounding_cell
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import Wall, build_wall

TUBE = USUAL.tube

Floats = NDArray[np.float64]


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


def bounding_cell_wall(points: int, thickness: float, cell_size: float = 2.0) -> Wall:
    """Six patches that meet in a corner."""
    return build_wall(
        build_complex((1, 1, 1), bounding_cell(USUAL.patch)), fit_patch(FitSettings(points)), cell_size, thickness
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
    areas = np.array([TUBE.face_area(abs(place) * relative_thickness) for place in s]) * CELL_SIZE**2
    most, least = (
        1 / (thickness / 2 * np.sum(weights / areas)),
        TUBE.face_area(relative_thickness) * CELL_SIZE**2 / thickness,
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

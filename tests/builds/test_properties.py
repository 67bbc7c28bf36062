"""Effective properties: bounds, symmetries, orders of convergence, and what another program finds."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad import GyroidError, Lattice, ParameterError
from gyroid_cad.builds.properties import Properties
from gyroid_cad.cli.app import main
from gyroid_cad.mesh.finite_elements.homogenised import EffectiveTensors, homogenised

pytest.importorskip("skfem", reason="no scikit-fem")

Floats = NDArray[np.float64]

L = 10.0
E, NU = 1000.0, 0.3


LATTICE = Lattice((1, 1, 1), L, density=0.3, surface="primitive")


def solved(subdivisions: int, layers: int, lattice: Lattice | None = None) -> EffectiveTensors:
    lattice = lattice or LATTICE
    mesh = lattice.hexahedra(subdivisions, layers, 2, full=True)
    return homogenised(mesh, lattice.periodic_pairs(mesh), lattice.cell_size**3, NU)


@pytest.fixture(scope="module")
def primitive() -> Properties:
    return LATTICE.properties(E, NU)


def test_energies_fall_with_the_fourth_power_of_elements_along_and_across_the_wall() -> None:
    along = [solved(n, 1).stiffness[0, 0] for n in (1, 2, 4)]
    across = [solved(1, n).stiffness[0, 0] for n in (1, 2, 4)]
    for coarse, middle, fine in (along, across):
        # An admissible displacement stores no less than the least energy.
        assert coarse > middle > fine
        assert np.log2((coarse - middle) / (middle - fine)) > 3.0


def test_a_cubic_cell_has_cubic_tensors(primitive: Properties) -> None:
    c = np.array(primitive.stiffness)
    expected = np.zeros((6, 6))
    expected[:3, :3] = c[0, 1]
    expected[range(3), range(3)] = c[0, 0]
    expected[range(3, 6), range(3, 6)] = c[3, 3]
    np.testing.assert_allclose(c, expected, atol=1e-6 * c.max())
    carried = np.array(primitive.effective_conductivity)
    np.testing.assert_allclose(carried, carried[0, 0] * np.eye(3), atol=1e-8)
    assert primitive.zener_ratio == pytest.approx(2 * c[3, 3] / (c[0, 0] - c[0, 1]))
    # Of a cubic lattice the extremes lie along the axes and the diagonals of the cell.
    assert primitive.softest[1] == (1.0, 0.0, 0.0)
    np.testing.assert_allclose(primitive.stiffest[1], np.ones(3) / np.sqrt(3))


@pytest.mark.parametrize("density", [0.1, 0.3])
def test_no_stiffness_and_no_conductivity_is_above_hashins_and_shtrikmans_bounds(density: float) -> None:
    found = solved(3, 2, Lattice((1, 1, 1), L, density=density, surface="primitive"))
    c, carried = E * found.stiffness, found.conductivity[0, 0]
    bulk, shear = E / 3 / (1 - 2 * NU), E / 2 / (1 + NU)
    pores = 1 - density
    most_bulk = bulk + pores / (-1 / bulk + 3 * density / (3 * bulk + 4 * shear))
    assert 0 < (c[0, 0] + 2 * c[0, 1]) / 3 < most_bulk
    assert carried < 2 * density / (3 - density)
    # A minimal surface's thin walls conduct two thirds of what goes straight through.
    assert carried > 0.9 * 2 * density / 3


def test_stiffness_goes_with_the_solids_modulus_and_not_with_the_cell() -> None:
    first, second = (np.array(LATTICE.properties(factor * E, NU).stiffness) for factor in (1, 2))
    np.testing.assert_allclose(second, 2 * first)
    larger = Lattice((1, 1, 1), 3 * L, density=0.3, surface="primitive")
    np.testing.assert_allclose(solved(2, 1, larger).stiffness, solved(2, 1).stiffness, atol=1e-9)


def test_what_is_told_as_the_error_is_no_less_than_it(primitive: Properties) -> None:
    finer = solved(6, 3).stiffness * E
    assert np.abs(np.array(primitive.stiffness) - finer).max() <= 2 * primitive.error * finer.max()
    assert primitive.error < 1e-3


def test_reduced_integration_in_calculix_and_full_here_hold_the_gyroids_stiffness_between_them() -> None:
    # README's and the example's, of 4 x 4 elements of 20 nodes a patch and one layer.
    assert 160.81 - 0.1 < solved(3, 2, Lattice((1, 1, 1), L, density=0.3)).stiffness[0, 0] * E < 161.22


def test_what_no_cell_problem_can_tell_is_refused() -> None:
    lattice = Lattice((1, 1, 1), L, density=0.3)
    for given, said in (
        ({"youngs_modulus": -1.0}, "youngs_modulus = -1"),
        ({"poisson_ratio": 0.5}, "poisson_ratio = 0.5: expected above -1 and below 0.5"),
        ({"conductivity": 0.0}, "conductivity = 0"),
    ):
        with pytest.raises(ParameterError, match=said):
            lattice.properties(**given)
    with pytest.raises(ParameterError, match="alike throughout"):
        Lattice((1, 1, 1), L, "0.8 + 0.01*x").properties()
    with pytest.raises(ParameterError, match="kind = 'network-a'"):
        Lattice((1, 1, 1), L, density=0.3, trim="box", kind="network-a").properties()


def test_without_the_solver_the_extra_that_brings_it_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("skfem", "gyroid_cad.mesh.finite_elements.homogenised"):
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, "skfem", None)
    with pytest.raises(GyroidError, match=r"gyroid_cad\[analysis\]"):
        Lattice((1, 1, 1), L, density=0.31).properties()


def test_the_shell_tells_the_same(capsys: pytest.CaptureFixture[str], primitive: Properties) -> None:
    line = ["properties", "--cell-size", "10", "--density", "0.3", "--surface", "primitive", "--youngs-modulus", "1000"]
    assert main([*line, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(told["stiffness"], primitive.stiffness)
    assert main(line) == 0
    assert f"{primitive.moduli[0]:.5g}" in capsys.readouterr().out
    assert main(["properties", "--density", "0.3"]) == 2
    assert "--cell-size" in capsys.readouterr().err

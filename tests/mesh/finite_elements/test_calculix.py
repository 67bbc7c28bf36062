"""CalculiX reads and solves what is written."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from examples.stiffness_in_calculix import CELL_SIZE, DENSITY, POISSON, YOUNG, stiffness, upper_bound
from gyroid_cad import Lattice
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh

pytestmark = pytest.mark.skipif(shutil.which("ccx") is None, reason="CalculiX (ccx) is not installed")

MATERIAL = f"""*MATERIAL, NAME=SOLID
*ELASTIC
{YOUNG}, {POISSON}
*SOLID SECTION, ELSET=WALL, MATERIAL=SOLID
"""


def solved(folder: Path, steps: str) -> str:
    """What CalculiX prints of a job on mesh.inp."""
    (folder / "job.inp").write_text("*INCLUDE, INPUT=mesh.inp\n" + MATERIAL + steps)
    done = subprocess.run(["ccx", "job"], cwd=folder, capture_output=True, text=True, check=False)
    assert "*ERROR" not in done.stdout, done.stdout
    return (folder / "job.dat").read_text()


def numbers_after(text: str, heading: str) -> list[float]:
    found = re.search(rf"{heading}[^\n]*\n\s*\n\s*([^\n]*)", text)
    assert found is not None
    return [float(word) for word in found[1].split()]


@pytest.fixture(scope="module")
def meshes() -> dict[str, Mesh]:
    lattice = Lattice((1, 1, 1), CELL_SIZE, density=DENSITY)
    return {"C3D8": lattice.hexahedra(4, 2), "C3D20R": lattice.hexahedra(3, 1, 2)}


@pytest.mark.parametrize("kind", ["C3D8", "C3D20R"])
def test_a_linear_displacement_of_the_border_is_a_linear_displacement_of_all(
    kind: str, meshes: dict[str, Mesh], tmp_path: Path
) -> None:
    # The patch test: uniform strain, so the energy is that of the whole volume at that strain.
    mesh = meshes[kind]
    mesh.write(tmp_path / "mesh.inp")
    strain = 1e-3
    border = np.unique(np.concatenate(list(mesh.node_sets().values())))
    held = "".join(
        f"{n + 1},1,1,{strain * x:.12e}\n{n + 1},2,3\n" for n, x in zip(border, mesh.points[border, 0], strict=True)
    )
    text = solved(
        tmp_path, f"*STEP\n*STATIC\n*BOUNDARY\n{held}*EL PRINT, ELSET=WALL, TOTALS=ONLY\nELSE,EVOL\n*END STEP\n"
    )
    (energy,), (volume,) = (numbers_after(text, f"total {what} for set WALL") for what in ("internal energy", "volume"))
    modulus = YOUNG * (1 - POISSON) / (1 + POISSON) / (1 - 2 * POISSON)
    assert energy == pytest.approx(volume * modulus * strain**2 / 2, rel=1e-5)


@pytest.mark.parametrize("kind", ["C3D8", "C3D20R"])
def test_pressure_on_all_three_surfaces_is_balanced_and_squeezes_evenly(
    kind: str, meshes: dict[str, Mesh], tmp_path: Path
) -> None:
    mesh = meshes[kind]
    mesh.write(tmp_path / "mesh.inp")
    faces = sorted({(name, face + 1) for name, some in mesh.surfaces().items() for face in set(some.faces.tolist())})
    loads = "".join(f"{name}_S{face}, P{face}, 1.0\n" for name, face in faces)
    # Three nodes that hold the body as a whole and nothing else.
    a, b, c = (int(n) + 1 for n in mesh.cells[0, [0, 1, 3]])
    held = f"*BOUNDARY\n{a},1,3\n{b},1,3\n{c},1,3\n"
    text = solved(
        tmp_path,
        f"*STEP\n*STATIC\n{held}*DLOAD\n{loads}*NODE PRINT, NSET=ALL_NODES, TOTALS=ONLY\nRF\n*END STEP\n",
    )
    # Held at a few nodes, the reactions add up to nothing: the pressures on a closed surface balance.
    assert np.abs(numbers_after(text, "total force")).max() < 1e-6 * CELL_SIZE**2


def test_a_periodic_cell_s_stiffness_converges_under_the_hashin_shtrikman_bound(tmp_path: Path) -> None:
    found = []
    for subdivisions in (1, 2, 3):
        (tmp_path / str(subdivisions)).mkdir()
        found.append(stiffness(subdivisions, tmp_path / str(subdivisions) / "cell"))
    steps = np.abs(np.diff(found))
    assert steps[1] < steps[0] / 3
    assert steps[1] < 2e-3 * found[-1]
    assert 0.5 * upper_bound() < found[-1] < upper_bound()

"""How stiff a gyroid is: one periodic cell of quadratic hexahedra, stretched in CalculiX (Debian: calculix-ccx)."""

import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from gyroid_cad import Lattice

CELL_SIZE, DENSITY = 10.0, 0.3
YOUNG, POISSON = 1000.0, 0.3  # MPa
STRAIN = 1e-3

JOB = """*INCLUDE, INPUT=mesh.inp
*NODE, NSET=STRETCH
{reference}, 0, 0, 0
*MATERIAL, NAME=SOLID
*ELASTIC
{young}, {poisson}
*SOLID SECTION, ELSET=WALL, MATERIAL=SOLID
*INCLUDE, INPUT=equations.inp
*BOUNDARY
{held}, 1, 3
*STEP
*STATIC
*BOUNDARY
{reference}, 1, 1, {stretch}
{reference}, 2, 3
*EL PRINT, ELSET=WALL, TOTALS=ONLY
ELSE
*NODE FILE
U
*EL FILE
S
*END STEP
"""


def stiffness(subdivisions: int, job: Path) -> float:
    """Stress per strain along x, in MPa, where the cell gets no wider or narrower: C11 = 2 W / (strain^2 L^3)."""
    lattice = Lattice((1, 1, 1), CELL_SIZE, density=DENSITY)
    mesh = lattice.hexahedra(subdivisions, order=2)
    pairs = lattice.periodic_pairs(mesh)
    mesh.write(job.with_name("mesh").with_suffix(".inp"), pairs=pairs)
    reference = len(mesh.points) + 1
    pairs.write(job.with_name("equations").with_suffix(".inp"), reference=reference)
    # Any node that follows no other holds the cell in its place.
    held = np.setdiff1d(np.arange(len(mesh.points)), pairs.second)[0] + 1
    values = {"young": YOUNG, "poisson": POISSON, "stretch": STRAIN * CELL_SIZE}
    job.with_suffix(".inp").write_text(JOB.format(reference=reference, held=held, **values))
    subprocess.run(["ccx", job.name], cwd=job.parent, check=True, capture_output=True)
    energy = re.search(r"internal energy for set WALL.*\s+(\S+)", job.with_suffix(".dat").read_text())
    assert energy is not None
    return 2 * float(energy[1]) / (STRAIN**2 * CELL_SIZE**3)


def upper_bound() -> float:
    """Hashin and Shtrikman's for the same density: K + 4/3 G of the stiffest isotropic arrangement."""
    bulk, shear = YOUNG / 3 / (1 - 2 * POISSON), YOUNG / 2 / (1 + POISSON)
    pores = 1 - DENSITY
    largest_bulk = bulk + pores / (-1 / bulk + 3 * DENSITY / (3 * bulk + 4 * shear))
    soft = 6 * DENSITY * (bulk + 2 * shear) / (5 * shear * (3 * bulk + 4 * shear))
    return largest_bulk + 4 / 3 * (shear + pores / (-1 / shear + soft))


if __name__ == "__main__":
    if shutil.which("ccx") is None:
        sys.exit("this example needs CalculiX: apt-get install calculix-ccx")
    for subdivisions in (2, 3, 4):
        with TemporaryDirectory() as folder:
            found = stiffness(subdivisions, Path(folder) / "cell")
        print(f"{subdivisions} x {subdivisions} elements a patch: C11 = {found:.2f} MPa")
    print(f"Hashin-Shtrikman upper bound: {upper_bound():.2f} MPa; solid: {YOUNG * 0.7 / (1.3 * 0.4):.2f} MPa")

"""Whole lattices as STEP files made from their arrays: what is in them is what the kernel's solid has."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gyroid_cad.kernel.check import is_valid, measure, topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.step.counts import topology_in_step
from gyroid_cad.step.products import StepPart, write_products
from gyroid_cad.step.walls import wall_bodies
from gyroid_cad.surface.fit import FitSettings

COARSE = FitSettings(6)
# Heavier in the middle, and symmetric as the patch is.
WEIGHTS = tuple(tuple(1.2 if 2 <= i <= 3 and 2 <= j <= 3 else 1.0 for j in range(6)) for i in range(6))
LATTICES = {
    "one cell": Lattice((1, 1, 1), 10.0, 0.8),
    "some": Lattice((2, 1, 2), 10.0, 0.8, fit=COARSE),
    "with weights": Lattice((1, 1, 1), 10.0, 0.5, fit=FitSettings(6, weights=WEIGHTS)),
    "graded": Lattice((2, 1, 1), 10.0, "0.6+0.02*x", tolerance=1e-3),
    "a closed ring": Lattice((4, 1, 1), 10.0, 0.8, map="cylinder:radius=10,angle=360", tolerance=1e-2),
    "placed": Lattice((1, 1, 1), 10.0, 0.8, origin=(5000.0, 0.0, -3.0), rotation=(10.0, 20.0, 30.0), fit=COARSE),
    "diamond": Lattice((1, 2, 1), 10.0, 0.8, surface="diamond", fit=COARSE),
    "primitive in pieces": Lattice((2, 1, 1), 10.0, 0.8, surface="primitive", fit=COARSE),
}


@pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES)
def test_the_kernel_reads_the_solid_that_it_would_have_made(lattice: Lattice, tmp_path: Path) -> None:
    path, wall = tmp_path / "a.step", lattice.wall()
    write_products(path, "a", [StepPart("a", wall_bodies(wall))])
    made, back = lattice.solid(), read_step(path)
    assert topology_in_step(path) == topology(back) == topology(made)
    assert is_valid(back)
    assert measure(back) == pytest.approx(measure(made), rel=1e-9)


def test_borders_that_are_not_the_same_are_told() -> None:
    (body,) = wall_bodies(LATTICES["one cell"].wall())
    assert body.gap == 1e-7
    nets = np.array(body.wall.nets)
    nets[3, 1, 0, 4] += 0.01
    (torn,) = wall_bodies(replace(body.wall, nets=nets))
    assert torn.gap == pytest.approx(0.01)

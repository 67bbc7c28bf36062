"""Kernels that are not OpenCascade read our STEP files: as many faces, the same volume, each valid."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder

from gyroid_cad.filling.fill import fill
from gyroid_cad.lattice import Lattice

# A fill by the divergence theorem; others integrate to five digits and better.
AGREEMENT = 1e-5


def by_kentron(path: Path) -> tuple[int, float, bool]:
    kentron = pytest.importorskip("pykentron", reason="no pykentron")
    (solid,) = kentron.importers.importStep(str(path)).solids().vals()
    return len(solid.Faces()), solid.Volume(), solid.isValid()


def by_smlib(path: Path) -> tuple[int, float, bool]:
    smlib = pytest.importorskip("smlibpy", reason="no smlibpy")
    part = smlib.import_step(str(path))
    return len(part.faces()), part.volume, part.is_valid()


@pytest.fixture(scope="module", params=["whole", "cut", "filled"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Any]:
    path = tmp_path_factory.mktemp("others") / "part.step"
    made: Any
    if request.param == "filled":
        made = fill(BRepPrimAPI_MakeCylinder(2.0, 3.0).Shape(), 5.0, density=0.3)
        made.write(path)
        return path, made.report
    made = Lattice((1, 1, 1), 10.0, 0.8, trim="box" if request.param == "cut" else None)
    made.write(path)
    return path, made.report()


@pytest.mark.parametrize("read", [by_kentron, by_smlib])
def test_another_kernel_finds_as_many_faces_and_the_same_volume(read: Any, written: tuple[Path, Any]) -> None:
    path, report = written
    faces, volume, valid = read(path)
    assert (faces, valid) == (report.faces, True)
    assert volume == pytest.approx(report.volume, rel=AGREEMENT)

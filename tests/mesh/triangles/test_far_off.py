"""Triangles far from the origin: single precision would round their corners until they cross."""

from __future__ import annotations

import re
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.kernel.stl import meshed
from gyroid_cad.kernel.surfaces import translation
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.printing.print_check import print_check
from gyroid_cad.surface.fit import FitSettings

FAR = (1e7, 0.0, 0.0)
GIVEN = {"cells": (1, 1, 1), "cell_size": 8.0, "thickness": 0.8, "fit": FitSettings(5)}


def unit_normals(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    a, b, c = np.moveaxis(vertices[triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1)[:, np.newaxis]


@pytest.mark.parametrize("trim", [None, "box"])
@pytest.mark.parametrize("ending", ["stl", "3mf"])
def test_a_lattice_too_far_off_for_single_precision_is_refused_before_anything_is_written(
    tmp_path: Path, trim: str | None, ending: str
) -> None:
    lattice = Lattice(**GIVEN, trim=trim, origin=FAR, keep_islands=trim is not None)  # type: ignore[arg-type]
    with pytest.raises(ParameterError, match=r"expected STEP or BREP, or a part within about 1.7e\+04 mm"):
        lattice.write(tmp_path / "a.step", tmp_path / f"a.{ending}")
    assert not list(tmp_path.iterdir())
    lattice.write(tmp_path / "a.step")


@pytest.mark.parametrize("ending", ["stl", "3mf"])
def test_as_far_off_as_is_accepted_no_triangle_turns_over(tmp_path: Path, ending: str) -> None:
    path = tmp_path / f"a.{ending}"
    with pytest.raises(ParameterError) as refused:
        Lattice(**GIVEN, origin=FAR).write(path)  # type: ignore[arg-type]
    accepted = re.search(r"within about (\S+) mm", str(refused.value))
    assert accepted
    normals = []
    for away in (0.0, 0.95 * float(accepted[1])):
        Lattice(**GIVEN, origin=(away, 0.0, 0.0)).write(path)  # type: ignore[arg-type]
        vertices, triangles = read_triangles(path)
        normals.append(unit_normals(vertices, triangles))
    # Triangles are in one order, wherever they stand.
    assert np.einsum("ij,ij->i", *normals).min() > 0.9


@pytest.mark.parametrize("trim", [None, "box"])
def test_a_lattice_is_checked_for_a_printer_wherever_it_stands(trim: str | None) -> None:
    near, far = (
        print_check(Lattice(**GIVEN, trim=trim, origin=origin), deviation=0.05)  # type: ignore[arg-type]
        for origin in ((0.0, 0.0, 0.0), FAR)
    )
    assert far.size == pytest.approx(near.size, abs=1e-3)
    assert (far.pieces, far.trapped_voids, far.passed) == (near.pieces, near.trapped_voids, near.passed)


def test_a_part_too_far_off_is_written_as_step_alone(tmp_path: Path) -> None:
    filled = fill(cq.Workplane().box(4, 4, 4).translate(FAR), 8, density=0.5, fit=FitSettings(5))
    with pytest.raises(ParameterError, match="expected STEP or BREP"):
        filled.write(tmp_path / "a.step", tmp_path / "a.stl")
    assert not list(tmp_path.iterdir())
    far, near = filled.solid(), filled.solid().Moved(translation([-FAR[0], 0.0, 0.0]))
    # What is only looked at, drawn or checked is meshed near the origin, and put back.
    (far_vertices, far_triangles), (near_vertices, near_triangles) = (meshed(s, "a", 0.05) for s in (far, near))
    assert len(far_triangles) == len(near_triangles)
    assert np.abs(np.sort(far_vertices - FAR, axis=0) - np.sort(near_vertices, axis=0)).max() < 1e-6
    assert print_check(filled).pieces == 1

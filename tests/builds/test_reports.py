"""Reports on what a lattice was built as: short tables when printed, with the area of all that bounds it."""

from __future__ import annotations

import pytest

from gyroid_cad.kernel.part import measure
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.fit_report import fit_report

COARSE = FitSettings(5)


def test_a_printed_report_is_a_short_table(cell: Lattice) -> None:
    report = cell.report()
    lines = [" ".join(line.split()) for line in str(report).splitlines()]
    assert lines == [
        "cells 1 x 1 x 1, 10 mm each",
        "wall 0.8 mm, density 0.24517",
        f"solids, faces 1, {report.faces} (valid and closed)",
        f"boundary edges, non-manifold edges {report.boundary_edges}, {report.non_manifold_edges}",
        f"volume {report.volume:.8g} mm3, {report.volume / report.volume_exact - 1:+.1e} of the exact one",
        f"area {report.area:.8g} mm2",
        f"deviation {report.max_deviation:.1e} mm, {report.max_normal_angle:.3f} degrees; 5 x 5 control points a patch",
    ]


def test_the_area_is_that_of_the_solid_triangles_and_cells_of_an_assembly_alike(cell: Lattice) -> None:
    area = cell.report().area
    assert area == pytest.approx(measure(cell.solid())[1], rel=1e-4)
    assert cell.triangle_report(0.1).area == pytest.approx(area, rel=1e-13)
    row = Lattice((3, 1, 1), cell.cell_size, cell.thickness, fit=cell.fit)
    # Cells of an assembly are closed, each by itself; merged they have no side walls between them.
    assert row.assembly_report().area == pytest.approx(3 * area, rel=1e-12)
    assert 2 * area < row.report().area < 3 * area


def test_the_area_of_a_cut_lattice_is_that_of_its_solid() -> None:
    cut = Lattice((1, 1, 1), 10.0, 0.8, fit=COARSE, trim="box")
    assert cut.report().area == pytest.approx(measure(cut.solid())[1], rel=1e-4)


def test_cells_that_grow_are_not_said_to_be_of_one_size() -> None:
    settings = {"cells": (1, 1, 1), "cell_size": 10.0, "fit": COARSE, "tolerance": 0.01}
    growing = Lattice(**settings, thickness=0.8, scale_field="1 + 0.01*x").triangle_report(0.2)
    assert "1 x 1 x 1, 10 mm before scaling or mapping" in str(growing)
    assert "10 mm each" in str(Lattice(**settings, thickness="0.8 + 0.01*x").triangle_report(0.2))


def test_meshes_volumes_and_fits_are_printed_as_tables_too(cell: Lattice) -> None:
    first = [" ".join(str(made).splitlines()[0].split()) for made in (cell.hexahedra(2), cell.volumes())]
    assert first == ["elements 96 hexahedron: 2 x 2 a patch, 1 across the wall", "patches 24 of degrees 3, 3, 1"]
    assert str(fit_report(fit_patch(cell.fit))).startswith("largest distance along the normal / L ")

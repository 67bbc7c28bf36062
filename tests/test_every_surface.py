"""Diamond and primitive lattices through everything that exists for the gyroid."""

from __future__ import annotations

import json
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
import trimesh
from build123d import BuildPart

import gyroid_cad.cq_plugin  # noqa: F401 (adds Workplane.gyroid)
from gyroid_cad import FitSettings, Lattice, fill
from gyroid_cad.bd_objects import Gyroid
from gyroid_cad.builds.meshes import mesh_quality
from gyroid_cad.cli.app import main
from gyroid_cad.errors import ParameterError
from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.step import read_step
from gyroid_cad.maps import Cylinder
from gyroid_cad.mesh.nodes import FREE_WALLS
from gyroid_cad.surface.families import SURFACES

SIZE = 10.0
NAMES = pytest.mark.parametrize("name", SURFACES)


@NAMES
@pytest.mark.parametrize("cells", [(1, 1, 1), (2, 1, 1), (2, 2, 1), (2, 2, 2), (3, 2, 1)])
def test_a_block_is_one_valid_closed_solid_of_the_tube_formula_s_volume(name: str, cells: tuple[int, int, int]) -> None:
    report = Lattice(cells, SIZE, density=0.3, surface=name).report()
    assert report.valid
    assert report.closed
    assert report.solids == 1
    assert report.patches == np.prod(cells) * len(SURFACES[name].cell)
    assert report.volume == pytest.approx(0.3 * np.prod(cells) * SIZE**3, rel=1e-6)


@NAMES
@pytest.mark.parametrize("part", [0.02, 0.5, 0.95])
def test_volume_follows_the_tube_formula_from_thin_to_thick(name: str, part: float) -> None:
    thickness = part * SURFACES[name].tube.thickness_limit * SIZE
    lattice = Lattice((1, 1, 1), SIZE, thickness, surface=name)
    assert lattice.wall().volume() == pytest.approx(lattice.exact_volume, rel=1e-5)


@NAMES
def test_a_wall_past_the_surface_s_own_limit_is_refused_with_it(name: str) -> None:
    limit = SURFACES[name].tube.max_thickness * SIZE
    Lattice((1, 1, 1), SIZE, 0.9999 * limit, surface=name)
    with pytest.raises(ParameterError, match=f"below {limit:.5g} mm"):
        Lattice((1, 1, 1), SIZE, 1.0001 * limit, surface=name)
    largest = SURFACES[name].tube.max_density
    with pytest.raises(ParameterError, match=f"below {largest:.5f}"):
        Lattice((1, 1, 1), SIZE, density=largest + 1e-4, surface=name)


@NAMES
def test_from_the_shell_a_surface_becomes_a_step_file_that_reads_back_valid_and_a_closed_stl(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    step, stl = tmp_path / "a.step", tmp_path / "a.stl"
    options = ["--cells", "1", "1", "1", "--cell-size", "10", "--density", "0.3", "--surface", name]
    assert main(["build", "-o", str(step), "-o", str(stl), *options, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["valid"]
    shape = read_step(step)
    assert is_valid(shape)
    assert topology(shape).closed
    assert enclosed_volume(shape) == pytest.approx(300, rel=1e-6)
    mesh = trimesh.load_mesh(stl)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(300, rel=4e-3)


@NAMES
def test_walls_that_vary_and_mapped_space_are_as_near_as_asked(name: str) -> None:
    lattice = Lattice((2, 1, 1), SIZE, "0.6 + 0.03*x", surface=name, map="twist:angle=20")
    report = lattice.report()
    assert report.valid
    assert report.max_deviation <= 1e-4 * SIZE
    assert report.volume == pytest.approx(report.volume_exact, rel=1e-4)


@NAMES
def test_a_ring_closes_on_itself(name: str) -> None:
    lattice = Lattice((6, 1, 1), SIZE, density=0.2, surface=name, map=Cylinder(12, angle=360), tolerance=1e-3)
    opened = Lattice((6, 1, 1), SIZE, density=0.2, surface=name, fit=FitSettings(6))
    complex, open_complex = lattice.fitted().complex, opened.fitted().complex
    assert complex.free.sum() < open_complex.free.sum()
    assert lattice.report().valid


@NAMES
def test_a_lattice_cut_to_its_block_has_the_block_s_share(name: str) -> None:
    report = Lattice((1, 1, 1), SIZE, density=0.3, surface=name, trim="box", keep_islands=True).report()
    assert report.valid
    assert report.volume == pytest.approx(300, rel=1e-5)


@pytest.mark.parametrize("name", ["diamond", "primitive"])
def test_a_part_is_filled(name: str) -> None:
    filled = fill(cq.Workplane().circle(3).extrude(4), SIZE, density=0.3, surface=name, fit=FitSettings(5))
    assert filled.report.valid
    assert filled.report.closed
    networks = [
        fill(cq.Workplane().box(10, 10, 10), SIZE, density=0.4, surface=name, kind=kind, keep_islands=True)
        for kind in ("network-a", "network-b")
    ]
    for made in networks:
        assert made.report.density == pytest.approx(0.4, abs=1e-4)


@NAMES
def test_hexahedra_are_upright_and_their_free_walls_pair_up(name: str) -> None:
    lattice = Lattice((1, 1, 1), SIZE, 0.1 * SIZE * SURFACES[name].tube.thickness_limit / 0.376, surface=name)
    mesh = lattice.hexahedra(6, 2)
    quality = mesh_quality(mesh)
    assert quality.inverted == 0
    assert quality.measures["scaled_jacobian"].smallest > 0.5
    pairs = lattice.periodic_pairs(mesh)
    assert np.array_equal(np.union1d(pairs.first, pairs.second), mesh.node_sets()[FREE_WALLS])


@NAMES
def test_trivariate_patches_are_read_by_mfem_with_the_wall_s_volume(name: str, tmp_path: Path) -> None:
    mfem = pytest.importorskip("mfem.ser")
    lattice = Lattice((1, 1, 1), SIZE, density=0.3, surface=name, fit=FitSettings(6))
    lattice.volumes().write(tmp_path / "a.mesh")
    mesh = mfem.Mesh(str(tmp_path / "a.mesh"))
    space = mfem.FiniteElementSpace(mesh, mesh.GetNodes().OwnFEC())
    assert space.GetNDofs() == len(lattice.volumes().control_points)
    form = mfem.LinearForm(space)
    form.AddDomainIntegrator(mfem.DomainLFIntegrator(mfem.ConstantCoefficient(1.0), 6, 6))
    form.Assemble()
    assert form.Sum() == pytest.approx(lattice.wall().volume(), rel=1e-9)


@NAMES
def test_hosts_take_a_surface(name: str) -> None:
    given = {"cells": (1, 1, 1), "cell_size": SIZE, "density": 0.3, "surface": name, "fit": FitSettings(6)}
    in_cadquery = cq.Workplane().gyroid(**given).val()
    with BuildPart() as part:
        Gyroid(**given)
    for shape in (in_cadquery.wrapped, part.part.wrapped):
        assert enclosed_volume(shape) == pytest.approx(300, rel=1e-3)


@pytest.mark.parametrize(
    "build",
    [
        lambda: Lattice((1, 1, 1), SIZE, 0.8, surface="iwp"),
        lambda: fill(cq.Workplane().box(5, 5, 5), SIZE, 0.8, surface="iwp"),
    ],
)
def test_a_surface_that_is_none_of_the_three_is_refused(build: object) -> None:
    with pytest.raises(ParameterError, match="surface = 'iwp': expected gyroid or diamond or primitive"):
        build()  # type: ignore[operator]

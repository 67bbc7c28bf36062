"""Tetrahedra of bodies: on the exact faces, conforming, sound, named in every file, and fit to solve on."""

from __future__ import annotations

import importlib
import importlib.util
import re
from pathlib import Path

import cadquery as cq
import meshio
import numpy as np
import pytest
from numpy.typing import NDArray

pytest.importorskip("netgen", reason="no netgen-mesher")

from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.filled import Filled
from gyroid_cad.filling.tetrahedra import Meshed, tetrahedra_of
from gyroid_cad.kernel.check import faces_of
from gyroid_cad.mesh.tetrahedra.data import TetrahedralMesh
from gyroid_cad.mesh.tetrahedra.measures import EDGES, mean_ratios, smallest_determinants
from gyroid_cad.mesh.tetrahedra.surface import SurfaceMesh
from gyroid_cad.mesh.tetrahedra.volume import filled_volume
from gyroid_cad.surface.fit import FitSettings

SIDE, SIZE = 4.0, 0.8


@pytest.fixture(scope="module")
def bodies() -> Filled:
    return fill(cq.Workplane().box(SIDE, SIDE, SIDE, centered=False), 8, density=0.3, kind="bodies", fit=FitSettings(5))


@pytest.fixture(scope="module")
def linear(bodies: Filled) -> TetrahedralMesh:
    return bodies.mesh(element_size=SIZE)


@pytest.fixture(scope="module")
def quadratic(bodies: Filled) -> TetrahedralMesh:
    return bodies.mesh(element_size=SIZE, order=2)


def plain(**shapes: cq.Workplane) -> Meshed:
    """Shapes without a lattice."""
    return Meshed(
        {name: shape.val().wrapped for name, shape in shapes.items()},
        {},
        {name: shape.val().Volume() for name, shape in shapes.items()},
    )


def test_wall_and_fluids_share_their_nodes_where_they_share_faces(linear: TetrahedralMesh) -> None:
    nodes = {name: set(linear.cells[own].ravel().tolist()) for name, own in linear.regions().items()}
    on = {name: set(some.tolist()) for name, some in linear.node_sets().items()}
    assert nodes["wall"] & nodes["fluid-a"] == on["wall/a"]
    assert nodes["wall"] & nodes["fluid-b"] == on["wall/b"]
    assert not nodes["fluid-a"] & nodes["fluid-b"]
    assert set.union(*nodes.values()) == set(range(len(linear.points)))
    # Flat faces are met exactly, so that nothing is missing of the box whatever becomes of the wall.
    assert sum(linear.volumes().values()) == pytest.approx(SIDE**3, rel=1e-12)


def test_faces_between_bodies_are_named_and_turned_out_of_the_first_one(linear: TetrahedralMesh) -> None:
    for name, surface in linear.surfaces().items():
        regions = {linear.names[part - 1] for part in linear.parts[surface.elements].tolist()}
        assert regions == {"wall" if name.startswith("wall") else name.split("/")[0]}
        corners = linear.points[linear.surface_nodes(surface)]
        outwards = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        middles = linear.points[linear.cells[surface.elements]].mean(axis=1)
        assert np.all(np.sum(outwards * (corners.mean(axis=1) - middles), axis=1) > 0)
    areas = sum(
        np.linalg.norm(np.cross(c[:, 1] - c[:, 0], c[:, 2] - c[:, 0]), axis=1).sum() / 2
        for name, surface in linear.surfaces().items()
        if "/face" in name
        for c in (linear.points[linear.surface_nodes(surface)],)
    )
    assert areas == pytest.approx(6 * SIDE**2, rel=1e-12)


def test_nodes_of_corners_and_middles_lie_on_the_exact_faces(bodies: Filled, quadratic: TetrahedralMesh) -> None:
    called = bodies.face_names["fluid-a"]
    faces = [face for face, name in zip(faces_of(bodies.domains["fluid-a"]), called, strict=True) if name == "wall/a"]
    shape = cq.Compound.makeCompound([cq.Face(face) for face in faces])
    nodes = quadratic.node_sets()["wall/a"]
    middles = nodes[nodes > quadratic.cells[:, :4].max()]
    assert len(middles) > len(nodes) / 2
    for node in (*middles[::9], *np.setdiff1d(nodes, middles)[::5]):
        assert cq.Vertex.makeVertex(*quadratic.points[node].tolist()).distance(shape) < 2e-6


def test_volumes_come_near_the_exact_ones_at_the_order_of_the_elements(
    bodies: Filled, linear: TetrahedralMesh, quadratic: TetrahedralMesh
) -> None:
    def off(mesh: TetrahedralMesh) -> float:
        return max(abs(volume / mesh.exact_volumes[name] - 1) for name, volume in mesh.volumes().items())

    finer = bodies.mesh(element_size=SIZE / 2)
    assert np.log2(off(linear) / off(finer)) > 1.6
    assert off(quadratic) < 1e-3
    assert off(quadratic) < off(linear) / 20


def test_elements_are_sound(linear: TetrahedralMesh, quadratic: TetrahedralMesh) -> None:
    assert linear.mean_ratios().min() >= 0.15
    assert smallest_determinants(quadratic.points, quadratic.cells).min() > 0
    edges = quadratic.points[quadratic.cells[:, :4]][:, EDGES].mean(axis=2)
    inside = ~np.isin(quadratic.cells[:, 4:], np.concatenate(list(quadratic.node_sets().values())))
    assert quadratic.points[quadratic.cells[:, 4:]][inside] == pytest.approx(edges[inside], abs=1e-12)


def test_more_elements_through_the_wall_are_smaller(bodies: Filled, linear: TetrahedralMesh) -> None:
    wall = bodies.report.thickness
    assert wall is not None
    coarse = bodies.mesh(elements_through=0.75)
    edges = coarse.points[coarse.surface_nodes(coarse.surfaces()["wall/a"])]
    assert np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1).mean() == pytest.approx(wall / 0.75, rel=0.3)
    assert len(coarse.cells) < len(linear.cells)


def test_gmsh_files_have_regions_and_faces_as_physical_groups(linear: TetrahedralMesh, tmp_path: Path) -> None:
    gmsh = pytest.importorskip("gmsh", reason="no gmsh")
    linear.write(tmp_path / "bodies.msh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.open(str(tmp_path / "bodies.msh"))
        found = {
            (dimension, gmsh.model.getPhysicalName(dimension, group)): sum(
                len(gmsh.model.mesh.getElements(dimension, entity)[1][0])
                for entity in gmsh.model.getEntitiesForPhysicalGroup(dimension, group)
            )
            for dimension, group in gmsh.model.getPhysicalGroups()
        }
        tetrahedra = np.concatenate(
            [np.concatenate(gmsh.model.mesh.getElements(*entity)[1]) for entity in gmsh.model.getEntities(3)]
        )
        volume = gmsh.model.mesh.getElementQualities(tetrahedra, "volume").sum()
    finally:
        gmsh.finalize()
    assert found == {
        **{(3, name): len(own) for name, own in linear.regions().items()},
        **{(2, name): len(surface.elements) for name, surface in linear.surfaces().items()},
    }
    assert volume == pytest.approx(SIDE**3, rel=1e-9)


def test_abaqus_files_have_regions_as_sets_and_faces_as_surfaces(quadratic: TetrahedralMesh, tmp_path: Path) -> None:
    path = tmp_path / "bodies.inp"
    quadratic.write(path)
    text = path.read_text()
    assert re.findall(r"TYPE=C3D10, ELSET=(\w+)", text) == ["wall", "fluid_a", "fluid_b"]
    assert "*SURFACE, NAME=wall_a, TYPE=ELEMENT\nwall_a_S1, S1\n" in text
    read = meshio.read(path)
    assert np.concatenate([block.data for block in read.cells]).tolist() == quadratic.cells.tolist()
    assert sorted(read.point_sets["fluid_a_face_1"]) == quadratic.node_sets()["fluid-a/face 1"].tolist()


def test_other_files_have_the_regions_as_numbers(linear: TetrahedralMesh, tmp_path: Path) -> None:
    linear.write(tmp_path / "bodies.vtu", tmp_path / "bodies.bdf")
    read = meshio.read(tmp_path / "bodies.vtu")
    assert read.cell_data["region"][0].tolist() == linear.parts.tolist()
    assert np.flatnonzero(read.point_data["wall/b"]).tolist() == linear.node_sets()["wall/b"].tolist()
    assert meshio.read(tmp_path / "bodies.bdf").cell_data["nastran:ref"][0].tolist() == linear.parts.tolist()


def test_ansys_files_have_regions_and_faces_as_components(linear: TetrahedralMesh, tmp_path: Path) -> None:
    reader = pytest.importorskip("ansys.mapdl.reader", reason="no ansys-mapdl-reader")
    pytest.importorskip("mapdl_archive", reason="no mapdl-archive")
    linear.write(tmp_path / "bodies.cdb")
    archive = reader.Archive(str(tmp_path / "bodies.cdb"))
    assert sorted(archive.element_components) == ["FLUID_A", "FLUID_B", "WALL"]
    assert len(archive.element_components["WALL"]) == len(linear.regions()["wall"])
    assert len(archive.node_components["WALL_A"]) == len(linear.node_sets()["wall/a"])


def test_heat_that_enters_one_fluid_leaves_the_other_through_the_wall(quadratic: TetrahedralMesh) -> None:
    fem = pytest.importorskip("skfem", reason="no scikit-fem")
    mesh, corners = quadratic, int(quadratic.cells[:, :4].max()) + 1
    grid = fem.MeshTet(mesh.points[:corners].T.copy(), mesh.cells[:, :4].T.copy())
    basis, gradients = fem.Basis(grid, fem.ElementTetP2()), importlib.import_module("skfem.helpers")
    conducts = fem.BilinearForm(lambda u, v, w: gradients.dot(gradients.grad(u), gradients.grad(v)))
    parts = {
        name: conducts.assemble(fem.Basis(grid, fem.ElementTetP2(), elements=own))
        for name, own in mesh.regions().items()
    }
    on = {name: np.isin(np.arange(corners), nodes) for name, nodes in mesh.node_sets().items()}

    def unknowns(name: str) -> NDArray[np.int64]:
        return np.asarray(basis.get_dofs(np.flatnonzero(on[name][grid.facets].all(axis=0))).all())

    # Of one material the temperature is linear, whatever the bodies: that takes nodes that are shared.
    expected = basis.doflocs.T @ np.array([1.0, -2.0, 0.5])
    outside = np.any((basis.doflocs < 1e-9) | (basis.doflocs > SIDE - 1e-9), axis=0)
    alike = fem.condense(sum(parts.values()), D=np.flatnonzero(outside), x=np.where(outside, expected, 0.0))
    assert fem.solve(*alike) == pytest.approx(expected, abs=1e-9)
    # Of three, what goes in passes either side of the wall, and comes out.
    conductivity = {"wall": 16.0, "fluid-a": 0.6, "fluid-b": 0.6}
    terms = {name: conductivity[name] * part for name, part in parts.items()}
    hot, cold = unknowns("fluid-a/face 1"), unknowns("fluid-b/face 2")
    given = np.zeros(len(expected))
    given[hot] = 1.0
    found = fem.solve(*fem.condense(sum(terms.values()), D=np.concatenate([hot, cold]), x=given))
    flow = (sum(terms.values()) @ found)[hot].sum()
    assert flow > 0
    past_a = ((terms["wall"] + terms["fluid-b"]) @ found)[unknowns("wall/a")].sum()
    past_b = ((terms["wall"] + terms["fluid-a"]) @ found)[unknowns("wall/b")].sum()
    out = (sum(terms.values()) @ found)[cold].sum()
    assert [past_a, -past_b, -out] == pytest.approx([flow] * 3, rel=1e-6)


@pytest.mark.filterwarnings("ignore::gyroid_cad.IslandsWarning")
def test_a_body_of_any_kind_is_meshed(tmp_path: Path) -> None:
    sheet = fill(cq.Workplane().box(SIDE, SIDE, SIDE, centered=False), 8, density=0.3, fit=FitSettings(5))
    sheet.write(tmp_path / "sheet.inp", tmp_path / "sheet.brep", element_size=SIZE)
    assert "*SURFACE, NAME=boundary, TYPE=ELEMENT" in (tmp_path / "sheet.inp").read_text()
    cylinder = tetrahedra_of(plain(pin=cq.Workplane().cylinder(4, 1.5)), 0.7, 2)
    assert cylinder.volumes()["pin"] == pytest.approx(9 * np.pi, rel=1e-3)


def test_triangles_that_bound_nothing_are_refused() -> None:
    corners = np.array([(1.0, 1, 1), (1, -1, -1), (-1, 1, -1), (-1, -1, 1)])
    sides = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    assert mean_ratios(corners, np.array([[1, 0, 2, 3]])) == pytest.approx(1)
    made = filled_volume(SurfaceMesh(corners, sides, np.arange(4)), np.tile([1, 0], (4, 1)), 5.0)
    assert made.cells.shape[0] >= 1
    with pytest.raises(KernelError, match=r"Netgen|tetrahedra"):
        filled_volume(SurfaceMesh(corners, sides[:3], np.arange(3)), np.tile([1, 0], (3, 1)), 5.0)


def test_volumes_that_do_not_agree_are_refused() -> None:
    wrong = plain(block=cq.Workplane().box(2, 2, 2))
    wrong.volumes["block"] *= 1.002
    with pytest.raises(KernelError, match=r"volume is off by 2\.0e-03"):
        tetrahedra_of(wrong, 1.0, 1)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"element_size": -1.0}, "element_size = -1.0: expected a length above 0 mm"),
        ({"element_size": 9.0}, "element_size = 9.0: expected at most the cell size, 8 mm"),
        ({"elements_through": 100}, "elements_through = 100: expected a number from 0.5 to 20"),
        ({"elements_through": 2, "element_size": 1.0}, "elements_through = 2: expected none beside element_size"),
        ({"order": 3}, "order = 3: expected 1"),
    ],
)
def test_elements_that_cannot_be_are_refused(bodies: Filled, given: dict[str, float], message: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(message)):
        bodies.mesh(**given)


def test_without_the_mesher_its_extra_is_named(bodies: Filled, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    find = importlib.util.find_spec
    monkeypatch.setattr(
        "gyroid_cad.mesh.tetrahedra.volume.find_spec", lambda name: None if name == "netgen" else find(name)
    )
    with pytest.raises(ParameterError, match=re.escape("pip install 'gyroid_cad[mesh]'")):
        bodies.write(tmp_path / "bodies.msh")

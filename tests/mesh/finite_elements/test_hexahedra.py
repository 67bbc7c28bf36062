"""Structured hexahedra and quadrilaterals of walls."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyroid_cad import Lattice
from gyroid_cad.errors import ParameterError
from gyroid_cad.maps import Cylinder
from gyroid_cad.mesh.finite_elements.hexahedra import Mesh, hexahedra, quadrilaterals
from gyroid_cad.mesh.nodes import FACE_A, FACE_B, FREE_WALLS
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings

TUBE = USUAL.tube

SIZE, THICKNESS = 10.0, 1.0
COARSE = FitSettings(6)


def lattice(cells: tuple[int, int, int] = (1, 1, 1), **given: object) -> Lattice:
    return Lattice(cells, SIZE, **{"thickness": THICKNESS, "fit": COARSE, **given})  # type: ignore[arg-type]


GRADED = lattice((2, 1, 1), thickness="0.8 + 0.03*x", tolerance=1e-2)
RING = lattice((6, 1, 1), map=Cylinder(radius=12, angle=360), tolerance=1e-2)


def volume(mesh: Mesh) -> float:
    """Of linear or of the corners of quadratic hexahedra, by Gauss quadrature of the trilinear determinant."""
    node = np.array([-1, 1]) / np.sqrt(3)
    corners = mesh.element.nodes[:8] - 1.0
    total = 0.0
    for place in np.stack(np.meshgrid(node, node, node), axis=-1).reshape(-1, 3):
        factors = (1 + corners * place) / 2
        slopes = np.stack([corners[:, k] / 2 * np.delete(factors, k, axis=1).prod(axis=1) for k in range(3)], axis=-1)
        jacobian = np.einsum("ka,ekc->eac", slopes, mesh.points[mesh.cells[:, :8]])
        determinants = np.linalg.det(jacobian)
        assert determinants.min() > 0
        total += float(determinants.sum())
    return total


def test_the_paper_s_example_has_230400_quadrilaterals_and_as_many_hexahedra() -> None:
    wall = lattice((4, 3, 2)).wall()
    assert len(quadrilaterals(wall, 20).cells) == 230_400
    assert len(hexahedra(wall, 20).cells) == 230_400


@pytest.mark.parametrize("made", [lattice((2, 1, 1)), GRADED, RING], ids=["alike", "graded", "ring"])
def test_volume_converges_to_the_wall_s_own_at_second_order(made: Lattice) -> None:
    wall = made.wall()
    errors = [abs(volume(hexahedra(wall, n)) / wall.volume() - 1) for n in (4, 8, 16)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(np.abs(orders - 2) < 0.15)


def test_layers_do_not_change_the_volume_of_a_ruled_wall_much_and_never_the_faces() -> None:
    wall = lattice().wall()
    one, three = hexahedra(wall, 4, 1), hexahedra(wall, 4, 3)
    assert volume(one) == pytest.approx(volume(three), rel=1e-3)
    for name in (FACE_A, FACE_B):
        ends = [np.unique(mesh.points[mesh.node_sets()[name]], axis=0) for mesh in (one, three)]
        np.testing.assert_allclose(*ends, atol=1e-12)


def area_and_outflow(mesh: Mesh, name: str) -> tuple[float, float]:
    corners = mesh.points[mesh.surface_nodes(mesh.surfaces()[name])[:, :4]]
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    outflow = np.einsum("ec,ec->", corners.mean(axis=1), across) / 3
    return float(np.linalg.norm(across, axis=1).sum()), float(outflow)


def test_the_area_of_each_face_follows_the_tube_formula() -> None:
    mesh = hexahedra(lattice(fit=FitSettings()).wall(), 24)
    exact = TUBE.face_area(THICKNESS / SIZE) * SIZE**2
    for name in (FACE_A, FACE_B):
        assert area_and_outflow(mesh, name)[0] == pytest.approx(exact, rel=1e-3)


@pytest.mark.parametrize("made", [lattice((2, 2, 1)), GRADED, RING], ids=["alike", "graded", "ring"])
def test_the_three_surfaces_close_and_enclose_the_volume(made: Lattice) -> None:
    mesh = hexahedra(made.wall(), 6, 2)
    enclosed = sum(area_and_outflow(mesh, name)[1] for name in (FACE_A, FACE_B, FREE_WALLS))
    assert enclosed == pytest.approx(volume(mesh), rel=2e-3)
    sides = np.concatenate([mesh.surface_nodes(surface)[:, :4] for surface in mesh.surfaces().values()])
    edges = np.sort(np.stack([sides, np.roll(sides, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    assert np.all(np.unique(edges, axis=0, return_counts=True)[1] == 2)


def test_every_face_of_every_element_is_shared_by_two_or_lies_on_one_surface() -> None:
    mesh = hexahedra(lattice((2, 1, 1)).wall(), 3, 2)
    faces = mesh.cells[:, mesh.element.faces].reshape(-1, 4)
    _, uses = np.unique(np.sort(faces, axis=1), axis=0, return_counts=True)
    assert uses.max() == 2
    assert np.sum(uses == 1) == sum(len(surface.elements) for surface in mesh.surfaces().values())


@settings(max_examples=12)
@given(
    cells=st.tuples(*3 * [st.integers(1, 2)]),
    subdivisions=st.integers(1, 3),
    layers=st.integers(1, 3),
    order=st.sampled_from([(1, False), (2, False), (2, True)]),
)
def test_every_node_is_used_and_none_twice_in_an_element(
    cells: tuple[int, int, int], subdivisions: int, layers: int, order: tuple[int, bool]
) -> None:
    mesh = hexahedra(lattice(cells).wall(), subdivisions, layers, *order)
    assert np.array_equal(np.unique(mesh.cells), np.arange(len(mesh.points)))
    assert np.all(np.diff(np.sort(mesh.cells, axis=1), axis=1) > 0)
    assert len(mesh.cells) == 24 * np.prod(cells) * subdivisions**2 * layers


@pytest.mark.parametrize("full", [False, True])
def test_quadratic_elements_are_linear_ones_of_half_the_size_but_for_left_out_nodes(full: bool) -> None:
    wall = lattice().wall()
    quadratic, linear = hexahedra(wall, 3, 2, 2, full), hexahedra(wall, 6, 4)
    known = {point.tobytes() for point in linear.points}
    assert {point.tobytes() for point in quadratic.points} <= known
    assert (len(quadratic.points) == len(known)) is full


def test_the_mid_surface_lies_halfway_between_the_faces() -> None:
    wall = lattice((2, 1, 1)).wall()
    surface, solid = quadrilaterals(wall, 4), hexahedra(wall, 4)
    faces = solid.points[solid.cells].reshape(-1, 2, 4, 3)
    np.testing.assert_allclose(surface.points[surface.cells], faces.mean(axis=1), atol=1e-12)


def test_element_sets_of_a_kind_part_the_elements() -> None:
    mesh = hexahedra(lattice((2, 1, 1)).wall(), 2, 3)
    sets = mesh.element_sets()
    for kind, count in (("BC_", 4), ("CC_", 2), ("LAYER_", 3)):
        some = [numbers for name, numbers in sets.items() if name.startswith(kind)]
        assert len(some) == count
        assert np.array_equal(np.sort(np.concatenate(some)), np.arange(len(mesh.cells)))


def test_an_element_s_cell_is_where_its_patch_is() -> None:
    mesh = hexahedra(lattice((2, 1, 1)).wall(), 2)
    middle = mesh.points[mesh.cells].mean(axis=1)[:, 0]
    sets = mesh.element_sets()
    assert middle[sets["CC_2_1_1"]].mean() - middle[sets["CC_1_1_1"]].mean() == pytest.approx(SIZE)


def test_face_a_is_the_one_the_common_normal_points_to() -> None:
    made = lattice()
    mesh, wall = hexahedra(made.wall(), 2), made.wall()
    on_a = mesh.points[mesh.node_sets()[FACE_A]]
    above = wall.face(0, 1).evaluate(0.0, 0.0) + wall.shifts[wall.patch_shift[0]]
    assert np.linalg.norm(on_a - above, axis=1).min() < 1e-9


def test_a_ring_has_free_walls_at_its_sides_only() -> None:
    mesh = hexahedra(RING.wall(), 2)
    cells_round = 6
    open_block = hexahedra(lattice((cells_round, 1, 1)).wall(), 2)
    assert len(mesh.surfaces()[FREE_WALLS].elements) < len(open_block.surfaces()[FREE_WALLS].elements)


@pytest.mark.parametrize("name", ["subdivisions", "layers"])
@pytest.mark.parametrize("value", [0, -1, 1.5, "2", True, None])
def test_counts_are_whole_numbers_from_1(name: str, value: object) -> None:
    with pytest.raises(ParameterError, match=f"{name} = .*: expected a whole number from 1 on"):
        hexahedra(lattice().wall(), **{"subdivisions": 2, name: value})  # type: ignore[arg-type]


def test_absurd_subdivisions_are_refused_with_what_they_would_take(monkeypatch: pytest.MonkeyPatch) -> None:
    wall = lattice().wall()
    with pytest.raises(ParameterError, match=r"subdivisions = 100000: .*240,000,000,000 elements.*GB .* are free"):
        hexahedra(wall, 100_000)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=310_000_000))
    with pytest.raises(ParameterError, match="at most about 29 with 1 layers"):
        hexahedra(wall, 40)
    hexahedra(wall, 29)


def test_a_trimmed_lattice_has_no_hexahedra() -> None:
    for made in (lattice(trim="box").hexahedra, lattice(trim="box").quadrilaterals):
        with pytest.raises(ParameterError, match="trim = 'box': expected none with meshes"):
            made(2)


def test_what_a_mesh_holds_cannot_be_written_to() -> None:
    mesh = lattice().hexahedra(2, order=2)
    for array in (mesh.points, mesh.cells, mesh.kept):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0

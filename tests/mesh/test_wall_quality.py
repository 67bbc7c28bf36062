"""How good the elements of a wall are, laid straight between the control nets of its two faces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.determinants import hexahedron_nodes
from gyroid_cad.mesh.quality import Quality, inverted, quality_report
from gyroid_cad.nurbs import grid_derivatives
from gyroid_cad.patch import PARAMETERISATIONS
from gyroid_cad.wall import Wall

CELL_SIZE = 10.0
STEPS, LAYERS = 20, 3
THICKNESS = 0.1 * CELL_SIZE


def hexahedra(wall: Wall, steps: int, layers: int, order: int = 1) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Of every patch, each with nodes of its own; 8 nodes, or 27 if the order is 2."""
    along = np.linspace(-1, 1, steps * order + 1)
    across = np.linspace(0, 1, layers * order + 1)[:, np.newaxis]
    sides = grid_derivatives(wall.nets, wall.weights, (wall.knots, wall.knots), along, along)[0]
    below, above = sides[:, 0, ..., np.newaxis, :], sides[:, 1, ..., np.newaxis, :]
    nodes = ((1 - across) * below + across * above)[wall.patch_net]
    nodes += wall.shifts[wall.patch_shift][:, np.newaxis, np.newaxis, np.newaxis]
    numbers = np.arange(nodes[..., 0].size).reshape(nodes.shape[:-1])
    offsets = ((hexahedron_nodes(27 if order == 2 else 8) + 1) / 2 * order).astype(int).tolist()
    cells = [numbers[:, i::order, j::order, k::order][:, :steps, :steps, :layers].ravel() for i, j, k in offsets]
    return nodes.reshape(-1, 3), np.stack(cells, axis=1)


def report_on(lattice: Lattice, order: int = 1) -> Quality:
    return quality_report(*hexahedra(lattice.wall(), STEPS, LAYERS, order))


LATTICES = {
    "uniform": Lattice((1, 1, 1), CELL_SIZE, THICKNESS),
    "graded": Lattice((2, 1, 1), CELL_SIZE, "0.6 + 0.04*x"),
    "mapped": Lattice((6, 1, 1), CELL_SIZE, THICKNESS, map="cylinder:radius=20"),
}


@pytest.mark.parametrize("lattice", LATTICES.values(), ids=LATTICES)
def test_scaled_jacobians_of_a_wall_of_a_tenth_of_the_cell_are_above_half_and_on_average_above_nine_tenths(
    lattice: Lattice,
) -> None:
    report = report_on(lattice)
    scaled = report.measures["scaled_jacobian"]
    assert report.inverted == 0
    assert scaled.smallest >= 0.5
    assert scaled.mean >= 0.9


def test_quadratic_elements_of_a_wall_are_as_good_inside_as_at_their_corners() -> None:
    report = report_on(LATTICES["uniform"], order=2)
    inside, corners = (report.measures[name].smallest for name in ("sampled_scaled_jacobian", "scaled_jacobian"))
    assert report.inverted == 0
    assert inside == pytest.approx(corners, abs=0.02)


def test_no_grid_makes_the_corner_of_a_patch_better_than_its_sixty_degrees() -> None:
    # Six patches meet at a flat point of the surface, whose walls are parallel there.
    thin = Lattice((1, 1, 1), CELL_SIZE, 1e-3 * CELL_SIZE)
    smallest = quality_report(*hexahedra(thin.wall(), 40, 1)).measures["scaled_jacobian"].smallest
    assert smallest == pytest.approx(np.sin(np.pi / 3), abs=2e-3)


def test_a_wall_past_its_curvature_limit_is_inverted_at_the_middle_of_every_patch_where_it_is_curved_most() -> None:
    wall = LATTICES["uniform"].wall()
    below, above = np.moveaxis(wall.nets, 1, 0)
    # Its faces pushed apart from 0.1 L to 0.4 L, past the 0.37647 L at which the faces' curvature breaks.
    middle, half = (below + above) / 2, (above - below) / 2
    thick = Wall(
        wall.complex,
        np.stack([middle - 4 * half, middle + 4 * half], axis=1),
        wall.patch_net,
        wall.shifts,
        wall.patch_shift,
        wall.weights,
        wall.knots,
    )
    points, cells = hexahedra(thick, STEPS, LAYERS)
    found = inverted(points, cells)
    per_patch = STEPS**2 * LAYERS
    assert np.array_equal(np.unique(found.elements // per_patch), np.arange(wall.complex.patch_count))
    u, v, _ = np.unravel_index(found.elements % per_patch, (STEPS, STEPS, LAYERS))
    assert np.abs(np.stack([u, v]) - (STEPS - 1) / 2).max() < STEPS / 4
    assert np.all(found.determinants <= 0)


def test_the_papers_polar_mesh_collapses_at_its_centre_and_is_bad_at_its_corners_where_ours_is_good() -> None:
    along = np.linspace(-1, 1, STEPS + 1)
    half = along[: STEPS // 2 + 1] * 2 + 1
    rays = np.concatenate([half[:-1] + 1j * 0 - 1j, 1 + 1j * half[:-1], 1j - half[:-1], -1 - 1j * half])
    polar = np.linspace(0, 1, STEPS // 2 + 1)[:, np.newaxis] * rays
    meshes = {"polar": polar, "smooth": along[:, np.newaxis] + 1j * along}
    smallest = {}
    for name, parameters in meshes.items():
        points = PARAMETERISATIONS[name](parameters.real, parameters.imag)[0]
        numbers = np.arange(parameters.size).reshape(parameters.shape)
        cells = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], axis=-1).reshape(
            -1, 4
        )
        report = quality_report(points.reshape(-1, 3), cells)
        assert report.elements == STEPS**2
        smallest[name] = report.measures["scaled_jacobian"].smallest
        collapsed = report.measures["edge_ratio"].undefined
        assert collapsed == (len(rays) - 1 if name == "polar" else 0)
    assert smallest["polar"] == 0
    assert smallest["smooth"] > 0.86

"""How good the elements of a wall are, laid straight between the control nets of its two faces."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from gyroid_cad.builds.meshes import hexahedral_mesh, mesh_quality
from gyroid_cad.errors import ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.finite_elements.hexahedra import hexahedra
from gyroid_cad.mesh.finite_elements.quality import Quality, inverted, quality_report
from gyroid_cad.surface.patch import PARAMETERISATIONS
from gyroid_cad.wall.fitted import FittedWall

CELL_SIZE = 10.0
STEPS, LAYERS = 20, 3
THICKNESS = 0.1 * CELL_SIZE


def report_on(lattice: Lattice, order: int = 1) -> Quality:
    return mesh_quality(lattice.hexahedra(STEPS, LAYERS, order, full=order > 1))


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
    smallest = mesh_quality(thin.hexahedra(40)).measures["scaled_jacobian"].smallest
    assert smallest == pytest.approx(np.sin(np.pi / 3), abs=2e-3)


@pytest.fixture(scope="module")
def thick() -> FittedWall:
    """Its faces pushed apart from 0.1 L to 0.4 L, past the 0.37647 L at which their curvature breaks."""
    fitted = LATTICES["uniform"].fitted()
    below, above = np.moveaxis(fitted.wall.nets, 1, 0)
    middle, half = (below + above) / 2, (above - below) / 2
    return replace(fitted, wall=replace(fitted.wall, nets=np.stack([middle - 4 * half, middle + 4 * half], axis=1)))


def test_a_wall_past_its_curvature_limit_is_inverted_at_the_middle_of_every_patch_where_it_is_curved_most(
    thick: FittedWall,
) -> None:
    mesh = hexahedra(thick.wall, STEPS, LAYERS)
    found = inverted(mesh.points, mesh.cells)
    assert np.array_equal(np.unique(mesh.element_patch[found.elements]), np.arange(mesh.complex.patch_count))
    u, v = np.divmod(found.elements % STEPS**2, STEPS)
    assert np.abs(np.stack([u, v]) - (STEPS - 1) / 2).max() < STEPS / 4
    assert np.all(found.determinants <= 0)


def test_elements_turned_inside_out_are_refused_with_one_of_their_places(thick: FittedWall) -> None:
    with pytest.raises(ParameterError, match=r"thickness = 1.0: expected a thinner wall, .* near \(.*\) mm") as caught:
        hexahedral_mesh(thick, STEPS, LAYERS, 1, False)
    place = [float(number) for number in re.findall(r"\((.*?)\)", str(caught.value))[0].split(",")]
    below, above = (thick.wall.nets[:, side].reshape(-1, 3) for side in (0, 1))
    assert np.linalg.norm((below + above) / 2 - place, axis=1).min() < CELL_SIZE / 4


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

"""What follows from any two quantities of a lattice, against what is measured on the lattice itself."""

from __future__ import annotations

import re
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gyroid_cad import Design, Lattice, ParameterError, design
from gyroid_cad.cli.app import main
from gyroid_cad.common.choices import SURFACE_NAMES, Kind, SurfaceName
from gyroid_cad.nurbs.basis import gauss_points
from gyroid_cad.report.pores import inscribed_spheres
from gyroid_cad.surface.families import SURFACES
from gyroid_cad.wall.distances import tree_of
from gyroid_cad.wall.laws import QUANTITIES
from gyroid_cad.wall.pore_limits import pore_limiting_diameter

L, T = 10.0, 0.8


def whole(surface: SurfaceName) -> tuple[Design, Lattice]:
    return design(surface=surface, cell_size=L, thickness=T), Lattice((1, 1, 1), L, T, surface=surface)


@pytest.mark.parametrize("surface", SURFACE_NAMES)
def test_density_area_and_hydraulic_diameter_are_those_of_the_wall_s_faces(surface: SurfaceName) -> None:
    made, lattice = whole(surface)
    wall = lattice.wall()
    patches = range(wall.complex.patch_count)
    nodes, weights = gauss_points(wall.knots, 8)
    areas = []
    for side in (0, 1):
        d = wall.face(0, side).derivatives(nodes[:, np.newaxis], nodes)
        areas.append(weights @ np.linalg.norm(np.cross(d[1, 0], d[0, 1]), axis=-1) @ weights * len(patches))
    volume = wall.volume()
    assert made.density == pytest.approx(volume / L**3, rel=1e-6)
    assert made.area_per_volume == pytest.approx(sum(areas) / L**3, rel=1e-5)
    # Half of the empty space lies on either side, and one face bounds it.
    assert made.hydraulic_diameter == pytest.approx(4 * (L**3 - volume) / 2 / areas[0], rel=1e-5)


@pytest.mark.parametrize("surface", SURFACE_NAMES)
def test_the_largest_sphere_is_the_one_that_measuring_the_pores_finds(surface: SurfaceName) -> None:
    made, lattice = whole(surface)
    _, radii, _ = inscribed_spheres(lattice.fitted())
    assert made.pore_size == pytest.approx(2 * radii.max(), rel=1e-4)
    assert made.throat == pytest.approx(pore_limiting_diameter(SURFACES[surface], L, T), rel=1e-9)


@pytest.mark.parametrize("surface", SURFACE_NAMES)
def test_no_place_of_space_is_further_from_the_wall_than_half_the_pore_size(surface: SurfaceName) -> None:
    made, lattice = whole(surface)
    samples = np.linspace(-1, 1, 31)
    wall = lattice.wall()
    faces = [
        wall.face(patch, side).evaluate(samples[:, np.newaxis], samples).reshape(-1, 3)
        for patch in range(wall.complex.patch_count)
        for side in (0, 1)
    ]
    tree = tree_of(np.mod(np.concatenate(faces), L), L)
    places = np.random.default_rng(1).uniform(0, L, (20000, 3))
    middle = tree_of(np.mod(np.concatenate([(a + b) / 2 for a, b in zip(faces[::2], faces[1::2], strict=True)]), L), L)
    outside = middle.query(places)[0] > T / 2
    reached = 2 * tree.query(places[outside])[0].max()
    assert 0.9 * made.pore_size < reached < 1.005 * made.pore_size


@pytest.mark.parametrize("surface", SURFACE_NAMES)
def test_the_smallest_radius_of_curvature_is_that_of_the_faces(surface: SurfaceName) -> None:
    made, lattice = whole(surface)
    face = lattice.wall().face(0, 1)
    samples = np.linspace(-1, 1, 61)
    d = face.derivatives(samples[:, np.newaxis], samples, 2)
    normal = np.cross(d[1, 0], d[0, 1])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    first = np.stack([np.sum(d[a] * d[b], -1) for a, b in (((1, 0), (1, 0)), ((1, 0), (0, 1)), ((0, 1), (0, 1)))])
    second = np.stack([np.sum(d[k] * normal, -1) for k in ((2, 0), (1, 1), (0, 2))])
    determinant = first[0] * first[2] - first[1] ** 2
    gauss = (second[0] * second[2] - second[1] ** 2) / determinant
    mean = (second[0] * first[2] - 2 * second[1] * first[1] + second[2] * first[0]) / (2 * determinant)
    largest = np.abs(mean) + np.sqrt(np.maximum(mean**2 - gauss, 0))
    assert made.curvature_radius == pytest.approx(1 / largest.max(), rel=1e-2)


def found_by(surface: SurfaceName, kind: Kind, pair: dict[str, float], density: float) -> dict[str, Any] | None:
    """A lattice of two quantities; None where one is 1 less the other, or two have both, of which this one is told."""
    try:
        return design(surface=surface, kind=kind, **pair).as_dict()  # type: ignore[arg-type]
    except ParameterError as problem:
        said = str(problem)
    told = re.findall(r"[\d.]+(?= and|e? have)", said)
    assert "none beside" in said or any(abs(float(one) - density) < 1e-2 for one in told), said
    return None


@given(
    st.sampled_from(SURFACE_NAMES), st.sampled_from(["sheet", "network-b"]), st.floats(0.05, 0.6), st.floats(0.5, 50)
)
@settings(max_examples=20, deadline=None)
def test_any_two_independent_quantities_give_the_lattice_back(
    surface: SurfaceName, kind: Kind, density: float, size: float
) -> None:
    try:
        made = design(surface=surface, kind=kind, cell_size=size, density=density).as_dict()
    except ParameterError:
        assume(False)
    known = [name for name in QUANTITIES if made[name] is not None]
    found = 0
    for pair in combinations(known, 2):
        again = found_by(surface, kind, {name: made[name] for name in pair}, density)
        if again is None:
            continue
        found += 1
        for name in known:
            assert again[name] == pytest.approx(made[name], rel=1e-6)
    assert found > len(known)


@given(st.sampled_from(SURFACE_NAMES), st.floats(0.2, 0.45))
@settings(max_examples=10, deadline=None)
def test_both_networks_and_the_wall_between_them_fill_space(surface: SurfaceName, density: float) -> None:
    network = design(surface=surface, kind="network-a", cell_size=1.0, density=density)
    wall = design(surface=surface, cell_size=1.0, density=1 - 2 * density)
    # The network's face is one of the wall's; a sphere in the other network gains what the wall loses on this side.
    assert 2 * network.area_per_volume == pytest.approx(wall.area_per_volume, rel=1e-9)
    assert network.pore_size == pytest.approx(wall.pore_size + 2 * wall.thickness, rel=1e-9)  # type: ignore[operator]
    assert network.curvature_radius == pytest.approx(wall.curvature_radius, rel=1e-9)


@pytest.mark.parametrize("size", [0.5, 3.0])
def test_lengths_go_with_the_cell_and_area_against_it(size: float) -> None:
    one, other = (design(cell_size=factor, density=0.3).as_dict() for factor in (1.0, size))
    for name in QUANTITIES:
        power = 0 if name in ("density", "porosity") else -1 if name == "area_per_volume" else 1
        assert other[name] == pytest.approx(one[name] * size**power, rel=1e-9)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"pore_size": 5, "cell_size": 3}, r"pore_size = 5\.0: expected above 0\.\d+ and below 1\.37\d* mm beside"),
        ({"pore_size": 0.6}, r"pore_size = 0\.6: expected two quantities of these: cell size, thickness"),
        ({}, "design = None: expected two quantities of these"),
        ({"pore_size": 1, "throat": 1, "density": 0.3}, "expected two quantities"),
        ({"density": 0.3, "porosity": 0.7}, "porosity = 0.7: expected none beside density"),
        ({"porosity": 75, "pore_size": 1}, "75 % is 0.75"),
        ({"porosity": 0.01, "pore_size": 1}, "porosity = 0.01: expected above 0.059"),
        ({"throat": -1, "density": 0.3}, "throat = -1.0: expected a length in mm, above 0"),
        ({"throat": "x", "density": 0.3}, "throat = 'x': expected a length in mm, one number"),
        ({"kind": "channels", "throat": 1, "density": 0.3}, "kind = 'channels'"),
        ({"kind": "network-a", "throat": 1, "thickness": 0.3}, "thickness = 0.3: expected none of a network"),
    ],
)
def test_what_fixes_no_lattice_is_refused_with_what_would(asked: dict[str, Any], said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        design(**asked)


def test_a_lattice_keeps_the_cell_and_the_wall_that_follow() -> None:
    found = design(pore_size=0.6, porosity=0.75)
    lattice = Lattice((2, 2, 2), pore_size=0.6, porosity=0.75)
    assert lattice == Lattice((2, 2, 2), found.cell_size, density=0.25)
    assert (lattice.density, lattice.pore_size) == (0.25, None)
    by_wall = Lattice((1, 1, 1), thickness=0.2, throat=1.0)
    assert (by_wall.thickness, by_wall.density) == (0.2, None)
    network = Lattice((1, 1, 1), trim="box", kind="network-a", pore_size=2.0, porosity=0.6)
    assert network.cell_size == design(kind="network-a", pore_size=2.0, porosity=0.6).cell_size
    graded = Lattice((1, 1, 1), 10.0, porosity="0.7 + 0.001*x")
    assert graded.volume_fraction == pytest.approx(Lattice((1, 1, 1), 10.0, density="0.3 - 0.001*x").volume_fraction)


def test_pores_that_would_vary_with_the_cells_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"pore_size = 3.*: expected none where a scale field or a map"):
        Lattice((1, 1, 1), pore_size=3.0, porosity=0.75, scale_field="1 + 0.01*x")
    assert Lattice((1, 1, 1), 10.0, porosity=0.75, scale_field="1 + 0.01*x").density == 0.25


def test_where_no_lattice_has_both_each_says_what_it_would_take(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["design", "--area-per-volume", "0.9", "--cell-size", "10"]) == 2
    said = capsys.readouterr().err
    for name in ("gyroid sheet: above", "diamond sheet: above", "primitive network-a: above"):
        assert name in said
    assert main(["design", "--area-per-volume", "-1", "--cell-size", "10"]) == 2
    assert capsys.readouterr().err.count("above 0") == 1


def test_a_cell_that_follows_and_is_too_small_is_told_by_what_was_given(capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--cells", "1", "1", "1", "--pore-size", "1e-4", "--porosity", "0.7"]
    assert main(["build", "-o", "a.step", *asked]) == 2
    assert "--porosity, --pore-size: cell_size = 0.0002" in capsys.readouterr().err


@pytest.mark.parametrize("beside", [{"thickness": 0.8}, {"density": 0.3}])
def test_a_porosity_stands_alone(beside: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=r"porosity = 0\.7: expected none beside"):
        Lattice((1, 1, 1), 10.0, porosity=0.7, **beside)  # type: ignore[arg-type]

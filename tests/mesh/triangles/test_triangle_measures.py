"""What triangles amount to."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures

CUBE = np.array([[x, y, z] for x in (0.0, 2.0) for y in (0.0, 2.0) for z in (0.0, 2.0)])
SIDES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
FACETS = np.array([t for a, b, c, d in SIDES for t in ((a, b, c), (a, c, d))])


@pytest.fixture(scope="module")
def folder(
    tmp_path_factory: pytest.TempPathFactory,
) -> Path:
    made = tmp_path_factory.mktemp("triangles")
    Lattice((1, 1, 1), 10.0, 0.8).write(made / "a.stl", made / "a.3mf", deviation=0.05)
    return made


@pytest.mark.parametrize("name", ["a.stl", "a.3mf"])
def test_a_lattice_is_read_back_with_its_triangles_volume_and_no_open_edge(folder: Path, name: str) -> None:
    report = Lattice((1, 1, 1), 10.0, 0.8).triangle_report(0.05)
    found = triangle_measures(*read_triangles(folder / name))
    assert found.triangles == report.triangles
    assert found.volume == pytest.approx(report.volume, rel=1e-6)
    assert (found.closed, found.manifold, found.open_edges, found.pieces) == (True, True, 0, 1)


def test_a_cube_without_a_triangle_has_three_open_edges_and_no_inside() -> None:
    whole = triangle_measures(CUBE, FACETS)
    opened = triangle_measures(CUBE, FACETS[1:])
    assert (whole.volume, whole.area, whole.closed) == (pytest.approx(8), pytest.approx(24), True)
    assert (opened.open_edges, opened.closed, opened.manifold) == (3, False, False)


def test_cubes_that_share_an_edge_close_but_are_no_manifold() -> None:
    other = CUBE + np.array([2.0, 2.0, 0.0])
    vertices, numbers = np.unique(np.concatenate([CUBE, other]), axis=0, return_inverse=True)
    found = triangle_measures(vertices, numbers.ravel()[np.concatenate([FACETS, FACETS + 8])])
    assert (found.closed, found.manifold, found.open_edges, found.pieces) == (True, False, 0, 1)

"""CAD files as they are: what the kernel finds them to be, sound or not."""

from __future__ import annotations

from pathlib import Path

import build123d as bd
import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.apart import read_shape
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.reading import described, lattice_sides, shown_triangles
from gyroid_cad.lattice import Lattice
from gyroid_cad.surface.fit import FitSettings


@pytest.mark.parametrize("ending", [".step", ".stp", ".brep"])
def test_a_box_is_read_back_with_its_faces_and_size(tmp_path: Path, ending: str) -> None:
    box, path = bd.Box(1, 2, 3), tmp_path / f"box{ending}"
    if ending == ".brep":
        write_brep(box.wrapped, path)
    else:
        bd.export_step(box, path)
    found = described(read_shape(path))
    assert (found.topology.solids, found.topology.faces, found.topology.closed, found.valid) == (1, 6, True, True)
    assert (found.volume, found.area) == (pytest.approx(6), pytest.approx(22))
    assert found.low == pytest.approx((-0.5, -1, -1.5))
    assert found.high == pytest.approx((0.5, 1, 1.5))


def test_a_box_without_its_lid_is_described_as_open() -> None:
    faces = bd.Box(1, 2, 3).faces().sort_by(bd.Axis.Z)[:-1]
    found = described(bd.Shell(faces).wrapped)
    assert (found.topology.solids, found.topology.faces, found.topology.open_edges) == (0, 5, 4)
    assert not found.topology.closed


def test_triangles_to_look_at_are_as_large_as_the_shape() -> None:
    vertices, triangles, faces = shown_triangles(bd.Sphere(5).wrapped)
    assert areas(vertices, triangles).sum() == pytest.approx(4 * np.pi * 25, rel=0.01)
    assert not faces.any()


def areas(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    corners = vertices[triangles].astype(float)
    return np.asarray(
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    )


def test_triangles_are_told_by_the_faces_they_lie_on() -> None:
    box = bd.fillet(bd.Box(1, 2, 3).edges().filter_by(bd.Axis.Z), 0.2)
    vertices, triangles, faces = shown_triangles(box.wrapped)
    by_face = np.bincount(faces, areas(vertices, triangles))
    assert by_face == pytest.approx([face.area for face in box.faces()], rel=5e-3)


def test_faces_of_a_lattice_are_told_by_their_sides_also_in_a_file_and_those_of_other_things_by_none(
    tmp_path: Path,
) -> None:
    lattice = Lattice((1, 1, 1), 10, 0.8, fit=FitSettings(5), trim="box")
    lattice.write(tmp_path / "cell.step")
    for shape in (lattice.solid(), read_shape(tmp_path / "cell.step")):
        sides = lattice_sides(shape)
        vertices, triangles, faces = shown_triangles(shape)
        by_face = np.bincount(faces, areas(vertices, triangles))
        of_sides = [sum(area for area, side in zip(by_face, sides, strict=True) if side == k) for k in (0, 1, None)]
        # Both faces of a thin wall are about as large; where it is cut there is its thickness.
        assert of_sides[0] == pytest.approx(of_sides[1], rel=0.1)
        assert 0.1 < of_sides[2] / of_sides[0] < 0.5
    spline = bd.Spline((0, 0), (1, 1), (2, 0))
    extruded = bd.extrude(bd.make_face(bd.Curve([spline, bd.Line((2, 0), (0, 0))])), 1)
    assert set(lattice_sides(extruded.wrapped)) == {None}


@pytest.mark.parametrize("name", ["a.step", "a.brep"])
def test_text_that_is_no_shape_says_so(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("nothing of the kind\n")
    with pytest.raises(ExportError, match="could not be read as"):
        read_shape(tmp_path / name)

"""CAD files as they are: what the kernel finds them to be, sound or not."""

from __future__ import annotations

from pathlib import Path

import build123d as bd
import numpy as np
import pytest

from gyroid_cad.errors import ExportError
from gyroid_cad.kernel.brep import write_brep
from gyroid_cad.kernel.reading import described, read_shape, shown_triangles


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
    vertices, triangles = shown_triangles(bd.Sphere(5).wrapped, 10.0)
    corners = vertices[triangles].astype(float)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(4 * np.pi * 25, rel=0.01)


@pytest.mark.parametrize("name", ["a.step", "a.brep"])
def test_text_that_is_no_shape_says_so(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("nothing of the kind\n")
    with pytest.raises(ExportError, match="could not be read as"):
        read_shape(tmp_path / name)

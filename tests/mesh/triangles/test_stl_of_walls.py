"""Binary STL written from the wall: read back from the file itself."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from gyroid_cad.errors import ExportError, ParameterError
from gyroid_cad.fields.makers import linear
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles import stl
from gyroid_cad.mesh.triangles.stl import MOST_TRIANGLES, write_stl
from gyroid_cad.mesh.triangles.triangulation import Triangulation, triangulated
from gyroid_cad.surface.fit import FitSettings

L = 10.0
COARSE = FitSettings(5)
RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])


def alike() -> Triangulation:
    return triangulated(Lattice((2, 2, 1), L, 0.8, fit=COARSE).wall(), 0.05)


def graded() -> Triangulation:
    return triangulated(Lattice((2, 1, 1), L, linear(0.5, x=0.12), fit=COARSE, tolerance=1e-2).wall(), 0.05)


def ring() -> Triangulation:
    lattice = Lattice((8, 1, 1), L, 0.8, map="cylinder:radius=16,angle=360", fit=COARSE, tolerance=1e-2)
    return triangulated(lattice.wall(), 0.1)


def records(path: Path) -> NDArray[np.void]:
    return np.fromfile(path, RECORD, offset=84)


SUBJECTS = pytest.mark.parametrize("made", [alike, graded, ring])


@SUBJECTS
def test_every_edge_in_the_file_bounds_two_triangles_that_agree_to_the_last_bit(
    made: Callable[[], Triangulation], tmp_path: Path
) -> None:
    write_stl(made(), tmp_path / "part.stl")
    corners = records(tmp_path / "part.stl")["corners"].reshape(-1, 3)
    numbers = np.unique(corners.view(np.uint32), axis=0, return_inverse=True)[1].reshape(-1, 3)
    there = np.stack([numbers, np.roll(numbers, -1, axis=1)], axis=-1).reshape(-1, 2)
    edges, uses = np.unique(there, axis=0, return_counts=True)
    assert np.all(uses == 1)
    assert np.array_equal(edges, np.unique(there[:, ::-1], axis=0))


@SUBJECTS
def test_trimesh_finds_the_file_closed_and_of_the_walls_volume(
    made: Callable[[], Triangulation], tmp_path: Path
) -> None:
    triangulation = made()
    complex = triangulation.wall.complex
    write_stl(triangulation, tmp_path / "part.stl")
    mesh = trimesh.load_mesh(tmp_path / "part.stl")
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(triangulation.volume, rel=1e-5)
    assert mesh.euler_number == 2 * (complex.fan_count - complex.edge_count + complex.patch_count)


@SUBJECTS
def test_the_file_has_fifty_bytes_a_triangle_and_normals_by_the_right_hand_rule(
    made: Callable[[], Triangulation], tmp_path: Path
) -> None:
    triangulation = made()
    write_stl(triangulation, tmp_path / "part.stl")
    content = (tmp_path / "part.stl").read_bytes()
    assert len(content) == 84 + 50 * triangulation.triangle_count
    assert int.from_bytes(content[80:84], "little") == triangulation.triangle_count
    # A file that starts with this word is taken for text.
    assert not content.startswith(b"solid")
    facets = records(tmp_path / "part.stl")
    corners = facets["corners"].astype(float)
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    cosine = np.sum(cross * facets["normal"], axis=1) / np.linalg.norm(cross, axis=1)
    np.testing.assert_allclose(cosine, 1, atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(facets["normal"], axis=1), 1, atol=1e-5)
    assert not np.any(facets["attributes"])


def test_the_portions_in_which_it_is_written_do_not_show(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for made in (alike, graded):
        triangulation = made()
        contents = []
        for portion in (1, 3000, 10**9):
            monkeypatch.setattr(stl, "_TRIANGLES_AT_ONCE", portion)
            write_stl(triangulation, tmp_path / "part.stl")
            contents.append(np.sort(records(tmp_path / "part.stl")["corners"].reshape(-1, 9).view("V36").ravel()))
        assert all(np.array_equal(content, contents[0]) for content in contents[1:])


def test_progress_counts_triangles_up_to_all_of_them(tmp_path: Path) -> None:
    told: list[tuple[str, int, int]] = []
    triangulation = alike()
    write_stl(triangulation, tmp_path / "part.stl", lambda *step: told.append(step), "write part.stl")
    total = triangulation.triangle_count
    assert told[0] == ("write part.stl", 0, total)
    assert told[-1] == ("write part.stl", total, total)
    assert [done for _, done, _ in told] == sorted(done for _, done, _ in told)
    assert len(told) > 3


def test_more_triangles_than_the_format_counts_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Triangulation, "triangle_count", MOST_TRIANGLES + 1)
    with pytest.raises(ParameterError, match=r"at most 4,294,967,295 triangles in STL; these are 4,294,967,296"):
        write_stl(alike(), tmp_path / "part.stl")
    assert not list(tmp_path.iterdir())


def test_a_disk_that_fills_up_leaves_the_older_file_and_nothing_else(
    tmp_path: Path, disk_full: Callable[[int], AbstractContextManager[None]]
) -> None:
    path = tmp_path / "part.stl"
    path.write_text("older")
    with disk_full(100_000), pytest.raises(ExportError, match=r"part\.stl was not written"):
        write_stl(alike(), path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


MEMORY = """
import sys
from pathlib import Path
from gyroid_cad import Lattice
from gyroid_cad.mesh.triangles.stl import write_stl
from gyroid_cad.mesh.triangles.triangulation import triangulated
write_stl(triangulated(Lattice((3, 3, 3), 10, 0.8).wall(), float(sys.argv[1])), sys.argv[2])
lines = (line.split() for line in Path("/proc/self/status").read_text().splitlines())
print(next(int(words[1]) * 1024 for words in lines if words[0] == "VmHWM:"), Path(sys.argv[2]).stat().st_size)
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="peak memory of a process is read from /proc")
def test_memory_does_not_grow_with_the_file(tmp_path: Path) -> None:
    def peak_and_size(deviation: float) -> tuple[int, int]:
        command = [sys.executable, "-c", MEMORY, str(deviation), str(tmp_path / "part.stl")]
        peak, size = subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()
        return int(peak), int(size)

    (small_peak, small), (large_peak, large) = peak_and_size(0.02), peak_and_size(0.0015)
    assert large > 1e8 > 7 * small
    assert large_peak - small_peak < 0.3 * (large - small)


def test_writing_triangles_loads_no_kernel(tmp_path: Path) -> None:
    program = (
        "import sys; from gyroid_cad import Lattice\n"
        f"Lattice((1, 1, 1), 10, 0.8).write({str(tmp_path / 'a.stl')!r}, {str(tmp_path / 'a.3mf')!r}, deviation=0.1)\n"
        "print({'OCP', 'cadquery', 'build123d'} & {name.split('.')[0] for name in sys.modules})"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout == "set()\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.3mf", "a.stl"]

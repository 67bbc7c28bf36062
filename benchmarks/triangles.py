"""Triangles straight from the wall beside the kernel's mesher: time, closedness, volume, writing, memory.

Both start from what they are made of and are asked for the same deviation, 0.005 of the cell size: the wall's nets on
one side, the closed solid, each time a copy without triangles, on the other. The kernel is let off its limit on angles,
so that the deviation alone decides. Whether the triangles are closed is asked of manifold3d and of trimesh. Writing STL
is compared, by the clock, with writing the same bytes in one piece, both synchronised with the disk before they appear.
Memory is that of a fresh process that goes from the description of 10 x 10 x 10 cells to the file.

Run: ``python -m benchmarks.triangles [--cells N] [--repeats N] [--small]``; ``--small`` is one cell, once, with files
of a few cells.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np

from benchmarks.timing import Row, arguments_for, best_in_turn, best_of, fresh_python, plain_table, print_verdicts
from gyroid_cad.common.files import replacing
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.mesh.triangles.corners import indexed_triangles
from gyroid_cad.mesh.triangles.measuring import triangulated_volume
from gyroid_cad.mesh.triangles.stl import write_stl
from gyroid_cad.mesh.triangles.triangulation import triangulated
from gyroid_cad.wall.offset import Wall

__all__ = ["main"]

# In mm, of 10 mm cells: what the ratio is asked at, what the order is measured at, and the usual one of a lattice.
_DEVIATION, _DEVIATIONS, _USUAL_DEVIATION = 0.05, (0.2, 0.1, 0.05, 0.025, 0.0125), 0.01
# In degrees: the least strict that means anything, and the usual one.
_LOOSE_ANGLE, _USUAL_ANGLE = 80.0, 15.0
_COUNTS = (8, 16, 32, 64)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    parser = arguments_for("Measure triangles against the kernel's mesher.")
    parser.add_argument("--cells", type=int, default=3, help="along a side, for time and closedness (default 3)")
    parser.add_argument("--repeats", type=int, default=5, help="the best counts (default 5)")
    given = parser.parse_args(arguments)
    from benchmarks.subject import block

    cells, repeats, written, large = (1, 1, 2, 2) if given.small else (given.cells, given.repeats, 6, 10)
    wall = block(cells)
    rows = [*_against_mesher(wall, repeats), *_soundness(wall), *_volume(wall)]
    _print_deviations(wall)
    with TemporaryDirectory() as folder:
        rows += _writing(block(written), Path(folder), repeats)
        rows += _memory(Path(folder) / "large.stl", large)
    return print_verdicts(f"Triangles, {cells} x {cells} x {cells} cells of 10 mm, wall 0.8 mm", rows)


def _against_mesher(wall: Wall, repeats: int) -> list[Row]:
    """Processor time of both, all threads together, and how many triangles each makes of the deviation."""
    from gyroid_cad.kernel.solid import build_solid

    solid = build_solid(wall)

    def ours() -> int:
        return len(indexed_triangles(triangulated(wall, _DEVIATION))[1])

    # Each round of the kernel takes long; ours is repeated more often beside it.
    kernel, mesh = best_of(lambda: _kernel_mesh(solid, _LOOSE_ANGLE), max(1, repeats // 2))
    usual, usual_mesh = best_of(lambda: _kernel_mesh(solid, _USUAL_ANGLE), 1)
    seconds, made = best_of(ours, repeats)
    (count, off), (usual_count, _) = _counted(mesh), _counted(usual_mesh)
    bounds = f"{made:,} triangles, {seconds:.3g} s"
    exact = wall.volume()
    return [
        Row("kernel's mesher / triangles from the nets", kernel / seconds, 20, None, "x", True, bounds),
        Row(
            "the same, the kernel's angle at most 15 degrees",
            usual / seconds,
            unit="x",
            remark=f"{usual_count:,} triangles",
        ),
        Row("kernel's mesher", kernel, unit=" s", remark=f"{count:,} triangles, volume {off / exact - 1:+.1e}"),
    ]


def _kernel_mesh(solid: Any, angle: float) -> Any:
    """A copy of a solid, meshed."""
    from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
    from OCP.BRepMesh import BRepMesh_IncrementalMesh

    copy = BRepBuilderAPI_Copy(solid, False, False).Shape()
    BRepMesh_IncrementalMesh(copy, _DEVIATION, False, float(np.radians(angle)), True)
    return copy


def _counted(meshed: Any) -> tuple[int, float]:
    """How many triangles there are, and what they enclose in mm3."""
    from OCP.BRep import BRep_Tool
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location

    count, explorer = 0, TopExp_Explorer(meshed, TopAbs_FACE)
    while explorer.More():
        count += BRep_Tool.Triangulation_s(as_face(explorer.Current()), TopLoc_Location()).NbTriangles()
        explorer.Next()
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(meshed, properties, False, False, True)
    return count, float(properties.Mass())


def _soundness(wall: Wall) -> list[Row]:
    """What manifold3d says of the triangles, and trimesh of their coordinates alone."""
    import manifold3d
    import trimesh

    complex = wall.complex
    vertices, triangles = indexed_triangles(triangulated(wall, _DEVIATION))
    judged = manifold3d.Manifold(manifold3d.Mesh(vertices, triangles.astype(np.uint32)))
    euler = 2 * (complex.fan_count - complex.edge_count + complex.patch_count)
    merged = trimesh.Trimesh(vertices, triangles)
    closed = judged.status() == manifold3d.Error.NoError and 2 - 2 * judged.genus() == euler
    sound = merged.is_watertight and merged.is_winding_consistent and merged.euler_number == euler
    return [
        Row("closed, by manifold3d", float(closed), 1, at_least=True, remark=f"genus {judged.genus()}"),
        Row("closed and oriented, by trimesh from coordinates", float(sound), 1, at_least=True),
        Row("volume by manifold3d, off by", abs(judged.volume() / wall.volume() - 1), 1e-3),
    ]


def _volume(wall: Wall) -> list[Row]:
    """How fast the volume nears the wall's, before corners are offset to make up for it."""
    missing = []
    for count in _COUNTS:
        patches, edges = np.full(wall.complex.patch_count, count), np.full(wall.complex.edge_count, count)
        missing.append(1 - triangulated_volume(wall, patches, edges, count) / wall.volume())
    order = -float(np.polyfit(np.log(_COUNTS), np.log(missing), 1)[0])
    remark = f"corners on the faces, {_COUNTS[0]} to {_COUNTS[-1]} squares: {missing[0]:.1e} to {missing[-1]:.1e}"
    return [Row("order at which the volume nears the wall's", order, 1.9, at_least=True, remark=remark)]


def _print_deviations(wall: Wall) -> None:
    lines = []
    for deviation in _DEVIATIONS:
        made = triangulated(wall, deviation)
        lines.append(
            (
                f"{deviation:g}",
                f"{made.deviation:.2e}",
                f"{made.volume_offset:.1e}",
                f"{made.patch_steps.max()}",
                f"{made.triangle_count:,}",
                f"{made.volume / wall.volume() - 1:+.1e}",
            )
        )
    plain_table(
        "What a deviation takes",
        ("asked for, mm", "measured", "offset", "squares along a patch", "triangles", "volume off by"),
        lines,
    )


def _writing(wall: Wall, folder: Path, repeats: int) -> list[Row]:
    """Writing triangles as they are made, and the bytes of the same file."""
    triangulation = triangulated(wall, _USUAL_DEVIATION)
    streamed, plain = folder / "streamed.stl", folder / "plain.stl"
    write_stl(triangulation, streamed)
    content = streamed.read_bytes()

    def at_once() -> None:
        with replacing(plain) as temporary:
            temporary.write_bytes(content)

    def stream() -> None:
        write_stl(triangulation, streamed)

    rounds = [(_seconds(at_once), _seconds(stream)) for _ in range(repeats)]
    clock = [min(column) for column in zip(*rounds, strict=True)]
    (plain_processor, _), (processor, _) = best_in_turn(repeats, at_once, stream)
    size = len(content) / 1e6
    remark = f"{size:.0f} MB: {size / clock[1]:.0f} MB/s beside {size / clock[0]:.0f} MB/s"
    return [
        Row("writing the bytes plainly / making and writing them", clock[0] / clock[1], 0.5, 1, "x", True, remark),
        Row("processor time of making and writing", processor, unit=" s", remark=f"plainly {plain_processor:.3g} s"),
    ]


def _seconds(task: Callable[[], None]) -> float:
    start = perf_counter()
    task()
    return perf_counter() - start


def _memory(path: Path, cells: int) -> list[Row]:
    """Peak of a fresh process that writes a block of so many cells a side."""
    peak, size, seconds = fresh_python("-m", "benchmarks.triangles", "--alone", str(path), str(cells)).split()
    remark = f"{int(size) / 1e6:.0f} MB of STL at {_USUAL_DEVIATION:g} mm, {float(seconds):.3g} s"
    what = f"peak memory, {cells} x {cells} x {cells} cells to STL"
    return [Row(what, int(peak) / 1e9, 1, None, " GB", remark=remark)]


def _alone(path: str, cells: int) -> None:
    """From the description to the file; print this process's peak, the file's size and the seconds it took."""
    from benchmarks.memory import peak
    from gyroid_cad import Lattice

    start = perf_counter()
    Lattice((cells,) * 3, 10.0, 0.8).write(path, deviation=_USUAL_DEVIATION)
    print(peak(), Path(path).stat().st_size, perf_counter() - start)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        _alone(sys.argv[2], int(sys.argv[3]))
    else:
        sys.exit(not main(sys.argv[1:]))

"""Every part of a folder of STEP files, filled in all ways by whole commands, and what came out.

Cells are a third of a part's smallest dimension, the density 0.3, skins 3 % of that dimension. What a command wrote is
read back: by the kernel from STEP, by trimesh from STL. Its volume, and that of dropped islands, is compared with an
estimate that knows nothing of how it was made: columns of points, inside the part by the windings of a mesh of it that
CadQuery's tessellation gives, in the wall by their distance from dense samples of the exact surface.

Run: ``python -m benchmarks.real_parts DIR [--ways plain-step ...] [--only NAME ...] [--timeout S]``; ``--small`` fills
a cylinder that is drawn for it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.TopoDS import TopoDS_Shape
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from benchmarks.timing import ROOT, arguments_for, fresh_python, plain_table
from gyroid_cad.kernel.check import is_valid, measure, topology
from gyroid_cad.kernel.extent import bounding_box
from gyroid_cad.kernel.step import read_step, write_step
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.step.counts import topology_in_step
from gyroid_cad.surface.families import USUAL
from gyroid_cad.wall.covering import AT_HOME, periodic_offsets

__all__ = ["WAYS", "main"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DENSITY, CELLS, SKIN = 0.3, 3.0, 0.03
_BY_TRIANGLES, _BY_BREP = ("--route", "triangles"), ("--route", "brep")
# Ending of the file, and options besides those that all have; "{skin}" is its thickness.
WAYS: dict[str, tuple[str, tuple[str, ...]]] = {
    "plain-step": ("step", ()),
    "plain-stl": ("stl", _BY_BREP),
    "skin-step": ("step", ("--skin", "{skin}")),
    "skin-stl": ("stl", ("--skin", "{skin}", *_BY_TRIANGLES)),
    "triangles-stl": ("stl", _BY_TRIANGLES),
    "network-stl": ("stl", ("--kind", "network-a", *_BY_TRIANGLES)),
    "network-step": ("step", ("--kind", "network-a")),
    "channels-step": ("step", ("--kind", "channels")),
}
_USUAL_WAYS = ("plain-step", "plain-stl", "triangles-stl", "skin-step", "skin-stl")
# Of the estimate: points in the part, few ones, and the mesh of it in parts of its longest side and in radians:
# twice as coarse, it held 0.4 % less than a swept part.
_POINTS, _FEW_POINTS, _DEVIATION, _ANGLE = 1_500_000, 50_000, 1e-4, 0.04
_CHECK_SECONDS = 300


@dataclass(frozen=True, slots=True)
class Outcome:
    """Result of filling one part in one way.

    Attributes
    ----------
    part, way : str
    seconds : float
    state : str
        "ok", "refused", "timed out", or what is wrong with the file.
    solids : int
        Of the file; pieces of triangles.
    volume : float
        Of the file and of what was dropped, in mm3.
    off : float
        Of that from the estimate, in %.
    remark : str
        The line that refused it.
    """

    part: str
    way: str
    seconds: float
    state: str
    solids: int = 0
    volume: float = 0.0
    off: float = np.nan
    remark: str = ""


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table and its summary; returns whether every part was filled or refused, and no file was faulty."""
    parser = arguments_for("Fill every part of a folder.")
    parser.add_argument("folder", type=Path, nargs="?", help="of STEP files")
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=_USUAL_WAYS)
    parser.add_argument("--only", nargs="+", default=[""], help="parts whose names have one of these in them")
    parser.add_argument("--cells", type=float, default=CELLS, help="in the smallest dimension of a part")
    parser.add_argument("--timeout", type=float, default=120, help="in seconds, of one command")
    given = parser.parse_args(arguments)
    with TemporaryDirectory() as name:
        scratch = Path(name)
        if given.small:
            given.folder, given.ways, given.cells = scratch / "parts", ("plain-step",), 1.0
            given.folder.mkdir()
            write_step(BRepPrimAPI_MakeCylinder(3.0, 5.0).Shape(), given.folder / "peg.step")
        if given.folder is None:
            parser.error("a folder of STEP files is needed")
        files = sorted(path for path in given.folder.iterdir() if path.suffix.lower() in (".step", ".stp"))
        parts = [path for path in files if any(word in path.stem for word in given.only)]
        points = _FEW_POINTS if given.small else _POINTS
        outcomes = [
            _filled(part, way, scratch, given.timeout, given.cells, points) for part in parts for way in given.ways
        ]
    return _print(outcomes)


def _filled(part: Path, way: str, scratch: Path, timeout: float, cells: float, points: int) -> Outcome:
    """Fill a part by one command, and look at what it wrote."""
    ending, options = WAYS[way]
    size = float(np.ptp(bounding_box(read_step(part)), axis=0).min())
    cell, file = size / cells, scratch / f"{part.stem}-{way}.{ending}"
    more = [option.format(skin=f"{SKIN * size:.6g}") for option in options]
    command = ["fill", str(part.resolve()), "-o", str(file), "--cell-size", f"{cell:.6g}", "--density", str(DENSITY)]
    start = perf_counter()
    try:
        run = subprocess.run(
            [sys.executable, "-m", "gyroid_cad", *command, *more, "--json"],
            cwd=ROOT, capture_output=True, text=True, check=False, timeout=timeout,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        made = Outcome(part.stem, way, perf_counter() - start, "timed out")
    else:
        made = Outcome(part.stem, way, perf_counter() - start, "refused")
        if run.returncode:
            made = replace(made, remark=(run.stderr.strip().splitlines() or [f"status {run.returncode}"])[-1])
        else:
            made = _checked(made, part, file, float(f"{cell:.6g}"), SKIN * size, points, json.loads(run.stdout))
    file.unlink(missing_ok=True)
    print(*asdict(made).values(), sep=" | ", file=sys.stderr, flush=True)
    return made


def _checked(
    made: Outcome, part: Path, file: Path, cell: float, skin: float, points: int, report: dict[str, float]
) -> Outcome:
    """Read a file back and estimate what it should hold, in processes of their own: the kernel may not come back."""
    try:
        told = _alone("look", str(file))
        asked = (str(part), cell, skin if report["skin"] else 0.0, report["kind"], points)
        expected = _alone("expected", *asked)["volume"]
    except RuntimeError as problem:
        return replace(made, state="cannot be read back", remark=str(problem).strip().splitlines()[-1])
    volume = told["volume"] + report["dropped_volume"]
    faults = [fault for fault in (told["fault"], "" if told["solids"] == report["solids"] else "solids lost") if fault]
    return replace(
        made,
        state=", ".join(faults) or "ok",
        solids=told["solids"],
        volume=volume,
        off=100 * (volume / expected - 1),
        remark=f"{report['islands']} islands" if report["islands"] else "",
    )


@cache
def _alone(what: str, *about: str | float) -> dict[str, Any]:
    """The answer of a process of its own; an estimate is asked once for all ways that share it."""
    asked = json.dumps([what, *about])
    told: dict[str, Any] = json.loads(fresh_python("-m", "benchmarks.real_parts", "--alone", asked))
    return told


def _look(file: str) -> dict[str, float | str]:
    """Solids and volume of a file, and what is wrong with it."""
    if file.endswith(".stl"):
        import trimesh

        mesh = trimesh.load(file)
        return {
            "solids": _solids_of_triangles(mesh),
            "volume": float(mesh.volume),
            "fault": "" if mesh.is_watertight and mesh.is_winding_consistent else "not watertight",
        }
    shape, written = read_step(file), topology_in_step(file)
    read = topology(shape)
    faults = {
        "invalid": is_valid(shape),
        "open": read.closed and written.closed,
        "faces lost": (read.solids, read.faces) == (written.solids, written.faces),
    }
    return {
        "solids": read.solids,
        "volume": measure(shape)[0],
        "fault": ", ".join(fault for fault, passed in faults.items() if not passed),
    }


def _solids_of_triangles(mesh: Any) -> int:
    """Connected pieces that hold something: voids are pieces turned inside out."""
    adjacency, count = mesh.face_adjacency, len(mesh.triangles)
    graph = coo_array((np.ones(len(adjacency)), adjacency.T), shape=(count, count))
    pieces, piece = connected_components(graph, directed=False)
    return int(np.sum(np.bincount(piece, _volumes(mesh.triangles), pieces) > 0))


def _expected(part: str, cell: float, skin: float, kind: str, count: int) -> dict[str, float]:
    """Volume of what fills a part, in mm3, by columns of points that lie askew to most faces."""
    corners = _tessellated(read_step(part))
    step = float((_volumes(corners).sum() / count) ** (1 / 3))
    askew = Rotation.random(rng=0)
    turned = askew.apply(corners.reshape(-1, 3)).reshape(corners.shape)
    points = askew.inv().apply(_points_inside(turned, turned.min(axis=(0, 1)), turned.max(axis=(0, 1)), step))
    offsets = np.concatenate([periodic_offsets(AT_HOME, cell, some) for some in np.array_split(points, 32)])
    tube = USUAL.tube
    half = float(tube.thickness(DENSITY)) * cell / 2
    if kind == "network-a":
        held = offsets > float(tube.network_offset(DENSITY)) * cell
    else:
        held = (np.abs(offsets) < half) != (kind == "channels")
    if skin:
        in_skin = SignedDistances(corners.reshape(-1, 3), np.arange(corners.size // 3).reshape(-1, 3))
        near = in_skin.near(points, skin)
        held = held & ~near if kind == "channels" else held | near
    return {"volume": float(held.sum()) * step**3}


def _tessellated(shape: TopoDS_Shape) -> Floats:
    """Triangles of what is in any of a shape's solids, shape (n, 3, 3)."""
    import cadquery as cq
    import trimesh

    longest = float(np.ptp(bounding_box(shape), axis=0).max())
    meshes = []
    for solid in cq.Shape.cast(shape).Solids():
        vertices, triangles = solid.tessellate(_DEVIATION * longest, _ANGLE)
        meshes.append(trimesh.Trimesh([vertex.toTuple() for vertex in vertices], triangles))
    return np.array((meshes[0] if len(meshes) == 1 else trimesh.boolean.union(meshes)).triangles)


def _volumes(corners: Floats) -> Floats:
    """Of the tetrahedra between triangles and the origin."""
    return np.asarray(np.sum(corners[:, 0] * np.cross(corners[:, 1], corners[:, 2]), axis=1) / 6)


def _points_inside(corners: Floats, low: Floats, high: Floats, step: float) -> Floats:
    """Points of a grid, each at a random height of its cell, that triangles, shape (n, 3, 3), wind round; (m, 3)."""
    origin = low + step * np.array([0.4931, 0.5077, 0.0])
    counts = np.ceil((high - low) / step).astype(int)
    column, z, sign = _crossings(corners, origin[:2], counts[:2], step)
    order = np.lexsort((z, column))
    column, z, sign = column[order], z[order], sign[order]
    # From a column's lowest crossing upwards, the windings so far; they come to nothing at the end of it.
    within = np.flatnonzero(np.cumsum(sign)[:-1] > 0)
    first, last = z[within], z[within + 1]
    random = np.random.default_rng(0)
    cells = np.arange(counts[2])
    heights = low[2] + step * (cells + random.random((len(within), len(cells))))
    row, _ = np.nonzero((heights > first[:, np.newaxis]) & (heights < last[:, np.newaxis]))
    kept = heights[(heights > first[:, np.newaxis]) & (heights < last[:, np.newaxis])]
    place = column[within][row]
    x, y = origin[0] + step * (place // counts[1]), origin[1] + step * (place % counts[1])
    return np.stack([x, y, kept], axis=1)


def _crossings(corners: Floats, origin: Floats, counts: Integers, step: float) -> tuple[Integers, Floats, Integers]:
    """Where upright lines on a grid go through triangles: line, height, and 1 where they enter, -1 where they leave."""
    flat = (corners[..., :2] - origin) / step
    first = np.ceil(flat.min(axis=1)).astype(int).clip(0)
    last = np.floor(flat.max(axis=1)).astype(int).clip(max=counts - 1)
    spans = (last - first + 1).clip(0)
    number = spans.prod(axis=1)
    triangle = np.repeat(np.arange(len(corners)), number)
    index = np.arange(len(triangle)) - np.repeat(np.cumsum(number) - number, number)
    at = first[triangle] + np.stack([index // spans[triangle, 1], index % spans[triangle, 1]], axis=1)
    around = flat[triangle] - at[:, np.newaxis]
    following = np.roll(around, -1, axis=1)
    # Of the triangle of each side and the line; the corner opposite to it has that share.
    areas = around[..., 0] * following[..., 1] - around[..., 1] * following[..., 0]
    through = np.all(areas > 0, axis=1) | np.all(areas < 0, axis=1)
    shares, triangle = areas[through], triangle[through]
    z = np.sum(shares * np.roll(corners[triangle, :, 2], -2, axis=1), axis=1) / shares.sum(axis=1)
    return at[through] @ np.array([counts[1], 1]), z, np.where(shares[:, 0] > 0, -1, 1)


def _print(outcomes: Sequence[Outcome]) -> bool:
    lines = [
        (one.part, one.way, f"{one.seconds:.1f}", one.state, str(one.solids or ""), *(
            (f"{one.volume:.6g}", f"{one.off:+.2f}") if one.volume else ("", "")), one.remark[:100])
        for one in outcomes
    ]  # fmt: skip
    headings = ("part", "way", "seconds", "result", "solids", "mm3", "off, %", "remark")
    plain_table("Real parts", headings, lines)
    ways = list(dict.fromkeys(one.way for one in outcomes))
    states = {way: Counter(one.state for one in outcomes if one.way == way) for way in ways}
    off = {way: [abs(one.off) for one in outcomes if one.way == way and one.state == "ok"] for way in ways}
    summary = [
        (
            way,
            ", ".join(f"{count} {state}" for state, count in states[way].most_common()),
            f"{max(off[way], default=np.nan):.2f}",
        )
        for way in ways
    ]
    plain_table("Summary", ("way", "results", "largest volume off, %"), summary)
    return all(one.state in ("ok", "refused") for one in outcomes)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--alone"]:
        asked, *about = json.loads(sys.argv[2])
        print(json.dumps({"look": _look, "expected": _expected}[asked](*about)))
    else:
        sys.exit(not main(sys.argv[1:]))

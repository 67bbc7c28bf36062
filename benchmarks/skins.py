"""Skins of parts: what each part of a folder leaves inside a skin, and why where there is none.

Solids of a part that do not overlap are parts by themselves. The skin is three hundredths of the smallest side of the
box round the part. Of each core: its volume, whether it is valid and closed and comes back whole from a STEP file, how
far points of its faces are from being as deep as the skin is thick, and the seconds it took, the reading of the part
not counted.

Run: ``python -m benchmarks.skins [--small] [DIR]``; ``--small``, or no folder, takes two parts made here.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder, BRepPrimAPI_MakeSphere
from OCP.TopAbs import TopAbs_FACE
from OCP.TopoDS import TopoDS_Shape

from benchmarks.timing import Row, arguments_for, print_verdicts
from gyroid_cad.errors import GyroidError
from gyroid_cad.filling.part import bodies_of
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_face
from gyroid_cad.kernel.depth import FaceDistances, points_on
from gyroid_cad.kernel.part import Part, require_part
from gyroid_cad.kernel.skin import hollow
from gyroid_cad.kernel.step import read_step, write_step

__all__ = ["main"]

# Of the smallest side of the box round a part.
_SKIN = 0.03
_POINTS_ON_FACE = 10
# The share of parts that have a skin, and how far its inner side may be off, in parts of its thickness.
_WITH_SKIN, _OFF = 0.9, 1e-2


@dataclass(frozen=True, slots=True)
class _Found:
    name: str
    seconds: float
    good: bool = False
    remark: str = ""


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the table; returns whether as many parts have a skin as are required."""
    parser = arguments_for("Take skins off parts.")
    parser.add_argument("folder", nargs="?", type=Path, help="of STEP files")
    given = parser.parse_args(arguments)
    made = [_found(name, part) for name, part in _parts(None if given.small else given.folder)]
    rows = [Row(one.name, one.seconds, unit=" s", remark=one.remark) for one in made]
    share = sum(one.good for one in made) / max(len(made), 1)
    return print_verdicts("Skins", [*rows, Row("parts with a skin", share, _WITH_SKIN, 1.0, at_least=True)])


def _parts(folder: Path | None) -> Iterator[tuple[str, Part | str]]:
    if folder is None:
        block = BRepPrimAPI_MakeBox(20.0, 16.0, 8.0).Shape()
        yield "ball", require_part(BRepPrimAPI_MakeSphere(10.0).Shape())
        yield "pierced", require_part(BRepAlgoAPI_Cut(block, BRepPrimAPI_MakeCylinder(5.0, 8.0).Shape()).Shape())
        return
    for path in sorted(folder.glob("*.st*p")):
        try:
            bodies, _ = bodies_of(path)
        except GyroidError as refused:
            yield path.stem, str(refused)
            continue
        for number, (_, part) in enumerate(bodies, 1):
            yield path.stem if len(bodies) == 1 else f"{path.stem}, {number} of {len(bodies)}", part


def _found(name: str, part: Part | str) -> _Found:
    if isinstance(part, str):
        return _Found(name, 0.0, remark=f"no part: {part}")
    skin = _SKIN * float(np.min(part.high - part.low))
    start = perf_counter()
    try:
        core = hollow(part, skin).core
    except GyroidError as refused:
        return _Found(name, perf_counter() - start, remark=str(refused))
    seconds = perf_counter() - start
    off = _distance_error(part.shape, core.shape, skin)
    valid, closed, whole = is_valid(core.shape), topology(core.shape).closed, _comes_back(core.shape)
    faults = [word for word, fine in (("valid", valid), ("closed", closed), ("whole in STEP", whole)) if not fine]
    state = "".join(f", not {word}" for word in faults)
    remark = f"{len(core.solids)} of {core.volume:.6g} mm3 in {part.volume:.6g}, off by {off:.1e} of {skin:.3g}{state}"
    return _Found(name, seconds, not faults and off < _OFF, remark)


def _distance_error(part: TopoDS_Shape, core: TopoDS_Shape, skin: float) -> float:
    """Largest difference from the skin of the distance of a core's faces from the part's, in skins."""
    distances = FaceDistances(parts_of(part, TopAbs_FACE))
    points = [points_on(as_face(face), _POINTS_ON_FACE) for face in parts_of(core, TopAbs_FACE)]
    return float(np.abs(distances.distances(np.concatenate(points)) / skin - 1).max())


def _comes_back(core: TopoDS_Shape) -> bool:
    with TemporaryDirectory() as folder:
        path = Path(folder, "core.step")
        try:
            write_step(core, path)
        except GyroidError:
            return False
        return topology(read_step(path)) == topology(core)


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

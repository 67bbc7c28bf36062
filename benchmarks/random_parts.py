"""Random parts filled: how many come out whole, by which road, and why the others do not.

Simple solids, lofts, turned splines and fillets, somewhere and turned somehow, up to three of them united or cut out of
each other. Each is filled with wall and with channels, of a surface drawn by lot; the two together are the part, whose
volume the kernel's quadrature tells. A part runs in a process of its own, so that none holds up the rest.

Run: ``python -m benchmarks.random_parts [--small] [--parts N] [--first SEED] [--timeout S]``.
"""

from __future__ import annotations

import sys
import warnings
from collections import Counter
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import pi
from multiprocessing import get_context
from multiprocessing.connection import Connection
from time import perf_counter

import numpy as np
from OCP.BOPAlgo import BOPAlgo_ArgumentAnalyzer
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import (
    BRepBuilderAPI_MakeEdge,
    BRepBuilderAPI_MakeFace,
    BRepBuilderAPI_MakeWire,
    BRepBuilderAPI_Transform,
)
from OCP.BRepFilletAPI import BRepFilletAPI_MakeFillet
from OCP.BRepGProp import BRepGProp
from OCP.BRepOffsetAPI import BRepOffsetAPI_ThruSections
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakeRevol,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.Geom import Geom_BSplineCurve
from OCP.GeomAPI import GeomAPI_PointsToBSpline
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Elips, gp_Pnt, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TColgp import TColgp_Array1OfPnt
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Shape, TopoDS_Wire

from benchmarks.timing import Row, arguments_for, plain_table, print_verdicts
from gyroid_cad.common.choices import Kind, SurfaceName
from gyroid_cad.errors import GyroidError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.report import FillReport
from gyroid_cad.kernel.check import is_valid, parts_of, topology
from gyroid_cad.kernel.compat import as_edge
from gyroid_cad.surface.fit import FitSettings

__all__ = ["is_part", "main", "random_part"]

_SURFACES: tuple[SurfaceName, ...] = ("gyroid", "diamond", "primitive")
_KINDS: tuple[Kind, ...] = ("sheet", "channels")
# How far wall and channels together may be from the part, also where only one of them was shifted, and the share of
# parts that may fail.
_OFF, _OFF_SHIFTED, _FAILED = 1e-5, 1e-3, 0.02
_COARSE = FitSettings(5)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether as many parts come out whole as are required."""
    parser = arguments_for("Fill random parts.")
    parser.add_argument("--parts", type=int, default=200)
    parser.add_argument("--first", type=int, default=0, help="seed of the first part")
    parser.add_argument("--timeout", type=float, default=120, help="seconds for each part")
    given = parser.parse_args(arguments)
    seeds = range(given.first, given.first + (2 if given.small else given.parts))
    found: dict[int, str] = {}
    for seed in seeds:
        outcome, seconds = _in_process(seed, given.timeout)
        found[seed] = outcome
        if outcome != "whole":
            print(f"seed {seed}, {seconds:.1f} s: {outcome}", flush=True)
    kinds = Counter(outcome.split(":")[0] for outcome in found.values())
    plain_table("Random parts", ("outcome", "parts"), [(kind, str(count)) for kind, count in kinds.most_common()])
    good = sum(count for kind, count in kinds.items() if kind in ("whole", "shifted", "by booleans", "no part"))
    return print_verdicts("Failed", [Row("share of parts", 1 - good / len(found), _FAILED, 0.0)])


def _in_process(seed: int, timeout: float) -> tuple[str, float]:
    start = perf_counter()
    ours, theirs = get_context("spawn").Pipe(duplex=False)
    process = get_context("spawn").Process(target=_told, args=(seed, theirs))
    process.start()
    theirs.close()
    outcome = "timed out"
    if ours.poll(timeout):
        try:
            outcome = ours.recv()
        except EOFError:
            outcome = "crashed"
    process.kill()
    process.join()
    return outcome, perf_counter() - start


def _told(seed: int, told: Connection) -> None:
    warnings.simplefilter("ignore")
    told.send(_outcome(seed))


def _outcome(seed: int) -> str:
    """Fill one part, and say how it went."""
    random = np.random.default_rng(seed)
    part = random_part(random)
    whole = _volume(part)
    if whole < 1 or not is_part(part):
        return "no part"
    cell, surface = random.uniform(4, 9), _SURFACES[random.integers(3)]

    def failed(stage: str, _: int, __: int) -> None:
        if "failed" in stage:
            failures.add(stage.rsplit("follows: ", maxsplit=1)[-1])

    reports: list[FillReport] = []
    failures: set[str] = set()
    for kind in _KINDS:
        try:
            made = fill(
                part, cell, density=0.3, kind=kind, surface=surface, fit=_COARSE, keep_islands=True, progress=failed
            )
        except GyroidError as refused:
            return f"refused: {kind}, {refused}"
        reports.append(made.report)
    off = sum(report.volume for report in reports) / whole - 1
    if not all(report.valid and report.closed for report in reports):
        return "invalid"
    # A lattice that was shifted for one of them leaves a little between wall and channels.
    alike = len({report.shift for report in reports}) == 1
    if abs(off) > (_OFF if alike else _OFF_SHIFTED):
        return f"volume off: by {off:.1e}"
    if not all(report.by_sections for report in reports):
        return f"by booleans: {surface}, cells of {cell:.3g}, {failures}"
    return "whole" if all(not any(report.shift) for report in reports) else f"shifted: {failures}"


def is_part(shape: TopoDS_Shape) -> bool:
    """Tell whether there is a solid, valid, and no faces that cross each other, which the kernel's check passes.

    Between such faces, as its fuse may leave them, is space that they wind round backwards: it is neither in nor out.
    """
    looked = BOPAlgo_ArgumentAnalyzer()
    looked.SetShape1(shape)
    looked.SelfInterMode = True
    looked.Perform()
    return is_valid(shape) and topology(shape).solids > 0 and not looked.HasFaulty()


def _volume(shape: TopoDS_Shape) -> float:
    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, found, 1e-10)
    return float(found.Mass())


def random_part(random: np.random.Generator) -> TopoDS_Shape:
    """Up to three random solids, united or cut out of the first."""
    part = _solid(random)
    for _ in range(random.integers(0, 3)):
        other = _solid(random)
        part = (BRepAlgoAPI_Fuse if random.random() < 0.5 else BRepAlgoAPI_Cut)(part, other).Shape()
    return part


def _solid(random: np.random.Generator) -> TopoDS_Shape:
    a, b, c = random.uniform(2, 7, 3).tolist()
    made: tuple[Callable[[], TopoDS_Shape], ...] = (
        lambda: BRepPrimAPI_MakeBox(a, b, c).Shape(),
        lambda: BRepPrimAPI_MakeCylinder(a / 2, b).Shape(),
        lambda: BRepPrimAPI_MakeCone(a / 2, random.choice([0.0, a / 5]), b).Shape(),
        lambda: BRepPrimAPI_MakeSphere(a / 2).Shape(),
        lambda: BRepPrimAPI_MakeTorus(a, a / 3).Shape(),
        lambda: _filleted(BRepPrimAPI_MakeBox(a, b, c).Shape(), min(a, b, c) / random.uniform(3, 12)),
        lambda: _loft(random, a, b, c),
        lambda: _turned_spline(random, a, b),
    )
    shape = made[random.integers(len(made))]()
    if random.random() < 0.25:
        return shape
    move = gp_Trsf()
    move.SetRotation(gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(*random.normal(size=3).tolist())), float(random.uniform(0, pi)))
    move.SetTranslationPart(gp_Vec(*random.uniform(-2.5, 2.5, 3).tolist()))
    return BRepBuilderAPI_Transform(shape, move, True).Shape()


def _filleted(shape: TopoDS_Shape, radius: float) -> TopoDS_Shape:
    fillet = BRepFilletAPI_MakeFillet(shape)
    for edge in parts_of(shape, TopAbs_EDGE):
        fillet.Add(radius, as_edge(edge))
    return fillet.Shape()


def _loft(random: np.random.Generator, a: float, b: float, c: float) -> TopoDS_Shape:
    through = BRepOffsetAPI_ThruSections(True, False)
    for z in np.linspace(0, c, 3).tolist():
        major, minor = sorted(random.uniform(1, max(a, b) / 2 + 1, 2).tolist(), reverse=True)
        through.AddWire(_wire(gp_Elips(gp_Ax2(gp_Pnt(0, 0, z), gp_Dir(0, 0, 1)), major, minor)))
    through.Build()
    return through.Shape()


def _turned_spline(random: np.random.Generator, a: float, b: float) -> TopoDS_Shape:
    """A solid of revolution round z, hollow, whose outer profile is a spline."""
    heights = np.linspace(0, b, 4)
    radii = a / 2 + 1 + random.uniform(0, 2, 4)
    points = TColgp_Array1OfPnt(1, 4)
    for index, (x, z) in enumerate(zip(radii.tolist(), heights.tolist(), strict=True), 1):
        points.SetValue(index, gp_Pnt(x, 0, z))
    spline: Geom_BSplineCurve = GeomAPI_PointsToBSpline(points).Curve()
    wire = BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(spline).Edge())
    inner = a / 4
    corners = [(radii[-1], b), (inner, b), (inner, 0.0), (radii[0], 0.0)]
    for (x0, z0), (x1, z1) in pairwise(corners):
        wire.Add(BRepBuilderAPI_MakeEdge(gp_Pnt(float(x0), 0, z0), gp_Pnt(float(x1), 0, z1)).Edge())
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    return BRepPrimAPI_MakeRevol(face, gp_Ax1(gp_Pnt(0, 0, 0), gp_Dir(0, 0, 1))).Shape()


def _wire(conic: gp_Elips) -> TopoDS_Wire:
    return BRepBuilderAPI_MakeWire(BRepBuilderAPI_MakeEdge(conic).Edge()).Wire()


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

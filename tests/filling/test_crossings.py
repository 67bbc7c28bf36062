"""Any part is cut without the kernel's booleans: what is left of wall and channels is the part, and kernels agree."""

from __future__ import annotations

import warnings
from itertools import pairwise
from math import pi
from typing import Any

import cadquery as cq
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_BSplineCurve
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TColgp import TColgp_Array1OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal

import gyroid_cad.filling.part
import gyroid_cad.filling.roads
from gyroid_cad.errors import KernelError
from gyroid_cad.filling.fill import fill
from gyroid_cad.filling.report import FillReport
from gyroid_cad.kernel.check import is_valid, measure, topology
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.pieces import Crossing
from gyroid_cad.trim.section_splines import on_section

COARSE = FitSettings(5)


def plate() -> cq.Workplane:
    return cq.Workplane().box(14, 9, 4).faces(">Z").workplane().pushPoints([(-4, 0), (4, 1)]).hole(2.4)


def cone() -> cq.Workplane:
    return cq.Workplane(cq.Solid.makeCone(4, 1.5, 6)).translate((0.3, 0.2, 0.1))


def loft() -> cq.Workplane:
    return cq.Workplane().ellipse(5, 3).workplane(offset=4).ellipse(3, 4).workplane(offset=4).ellipse(4, 2.5).loft()


def vase() -> cq.Workplane:
    return (
        cq.Workplane("XZ")
        .moveTo(2, 0)
        .spline([(4, 2), (3, 4), (3.5, 5)], includeCurrent=True)
        .lineTo(2, 5)
        .close()
        .revolve()
    )


def filleted() -> cq.Workplane:
    return cq.Workplane().box(8, 7, 6).edges("|Z").fillet(1.5).edges(">Z").fillet(0.8)


def leaping() -> cq.Workplane:
    """A profile of three cubics whose curvature leaps where they meet, extruded."""
    poles = [(0, 0), (0.7, 1.2), (1.5, 1.8), (2.1, 2.25), (3.2, 1), (3.9, 1.6), (4.3, 1.95), (5, 0.2)]
    knots, multiplicities = [0.0, 0.45, 0.55, 1.0], [4, 2, 2, 4]
    points, values, times = TColgp_Array1OfPnt(1, 8), TColStd_Array1OfReal(1, 4), TColStd_Array1OfInteger(1, 4)
    for number, (x, y) in enumerate(poles, 1):
        points.SetValue(number, gp_Pnt(x, y, 0))
    for number, (knot, multiplicity) in enumerate(zip(knots, multiplicities, strict=True), 1):
        values.SetValue(number, knot)
        times.SetValue(number, multiplicity)
    top = cq.Edge(BRepBuilderAPI_MakeEdge(Geom_BSplineCurve(points, values, times, 3)).Edge())
    corners = [cq.Vector(*corner) for corner in ((5, 0.2), (5, -2), (0, -2), (0, 0))]
    border = cq.Wire.assembleEdges([top, *(cq.Edge.makeLine(a, b) for a, b in pairwise(corners))])
    return cq.Workplane(cq.Solid.extrudeLinear(border, [], cq.Vector(0, 0, 1)))


# Of each kind of surface one.
DRAWN = {
    "plate": plate,
    "ball": lambda: cq.Workplane().sphere(4).translate((0.2, 0.1, 0.3)),
    "ring": lambda: cq.Workplane(cq.Solid.makeTorus(5, 1.8)).translate((0.1, 0.2, 0.3)),
    "cone": cone,
    "loft": loft,
    "vase": vase,
    "filleted": filleted,
}


def crossed(part: Any, **given: Any) -> FillReport:
    """Fill a part; the kernel's booleans are not at hand."""
    every = gyroid_cad.filling.roads.taken

    def taken(road: str, *arguments: Any) -> Any:
        if road == "booleans":
            raise KernelError("no booleans here")
        return every(road, *arguments)  # type: ignore[arg-type]

    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        patch.setattr(gyroid_cad.filling.part, "taken", taken)
        return fill(part, fit=COARSE, keep_islands=True, **{"cell_size": 8, "density": 0.3, **given}).report


@pytest.mark.parametrize("name", ["plate", "cone", "loft", "vase", "filleted"])
def test_wall_and_channels_are_the_whole_part(name: str) -> None:
    part = DRAWN[name]()
    wall, channels = (crossed(part, kind=kind, surface="primitive") for kind in ("sheet", "channels"))
    assert wall.valid
    assert wall.closed
    # The kernel's own measure of a spline turned about an axis is off by 1e-3, unless it is asked for more.
    assert wall.volume + channels.volume == pytest.approx(volume(part), rel=1e-7)


def volume(part: cq.Workplane) -> float:
    found = GProp_GProps()
    BRepGProp.VolumeProperties_s(part.val().wrapped, found, 1e-10)
    return float(found.Mass())


def test_of_a_ball_and_a_ring_that_holds_to_nine_digits() -> None:
    for name, whole in (("ball", 4 / 3 * pi * 4**3), ("ring", 2 * pi**2 * 5 * 1.8**2)):
        reports = [crossed(DRAWN[name](), kind=kind) for kind in ("sheet", "channels")]
        assert sum(report.volume for report in reports) == pytest.approx(whole, rel=1e-9)


@pytest.mark.parametrize("kind", ["sheet", "network-a", "surface"])
def test_the_kernels_fuse_comes_to_the_same(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    sizes: dict[str, Any] = {"density": None if kind == "surface" else 0.3, "origin": (0.3, 0.2, 0.1)}
    ours = crossed(plate(), kind=kind, **sizes)
    every = gyroid_cad.filling.roads.taken

    def taken(road: str, *arguments: Any) -> Any:
        if road != "booleans":
            raise KernelError("by the kernel alone")
        return every(road, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(gyroid_cad.filling.part, "taken", taken)
    theirs = fill(plate(), 8, fit=COARSE, kind=kind, keep_islands=True, **sizes).report
    assert ours.by_sections
    assert not theirs.by_sections
    assert ours.volume == pytest.approx(theirs.volume, rel=1e-5)
    assert ours.area == pytest.approx(theirs.area, rel=1e-5)
    assert (ours.solids, ours.faces) == (theirs.solids, theirs.faces)


def test_a_wall_graded_through_a_part_is_cut_too() -> None:
    reports = [crossed(plate(), kind=kind, density="0.25 + 0.01*x", tolerance=1e-2) for kind in ("sheet", "channels")]
    assert sum(report.volume for report in reports) == pytest.approx(volume(plate()), rel=1e-6)


sizes = st.floats(2.0, 6.0)
places = st.tuples(*[st.floats(-2.5, 2.5)] * 3)


@st.composite
def solids(draw: st.DrawFn) -> cq.Workplane:
    """One of the simple solids, somewhere and turned somehow."""
    a, b, c = draw(st.tuples(sizes, sizes, sizes))
    kind = draw(st.sampled_from(["box", "cylinder", "cone", "sphere", "torus", "filleted"]))
    made = {
        "box": lambda: cq.Workplane().box(a, b, c),
        "cylinder": lambda: cq.Workplane().circle(a / 2).extrude(b),
        "cone": lambda: cq.Workplane(cq.Solid.makeCone(a / 2, a / 5, b)),
        "sphere": lambda: cq.Workplane().sphere(a / 2),
        "torus": lambda: cq.Workplane(cq.Solid.makeTorus(a, a / 3)),
        "filleted": lambda: cq.Workplane().box(a, b, c).edges().fillet(min(a, b, c) / 5),
    }[kind]()
    turned = made.rotate((0, 0, 0), (1, 2, 3), draw(st.floats(0, 90)))
    return turned.translate(draw(places))


@st.composite
def combined(draw: st.DrawFn) -> cq.Workplane:
    """Up to three of them, united or cut out of the first."""
    part = draw(solids())
    for _ in range(draw(st.integers(0, 2))):
        other = draw(solids())
        part = part.union(other) if draw(st.booleans()) else part.cut(other)
    return part


# Each takes about a second: many are tried by the benchmark of random parts.
@settings(max_examples=4, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(part=combined())
def test_random_parts_are_filled_wholly_or_refused_for_a_reason(part: cq.Workplane) -> None:
    shape = part.val().wrapped if part.vals() else None
    if shape is None or not is_valid(shape) or not topology(shape).solids or measure(shape)[0] < 1:
        return
    try:
        wall, channels = (crossed(part, kind=kind, surface="primitive") for kind in ("sheet", "channels"))
    except KernelError as refused:
        assert "no booleans here" in str(refused)  # noqa: PT017
        return
    assert wall.volume + channels.volume == pytest.approx(volume(part), rel=1e-5)


def test_numbers_of_nodes_do_not_depend_on_where_the_part_stands() -> None:
    near, far = (crossed(plate().translate((x, 0, 0))) for x in (0, 8 * 1000))
    assert (near.faces, near.solids) == (far.faces, far.solids)
    assert near.volume == pytest.approx(far.volume, rel=1e-8)
    assert np.isfinite(far.area)


def test_sections_are_as_near_to_both_faces_as_is_said_where_a_faces_curvature_leaps(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cuts: list[Crossing] = []
    cross_part = gyroid_cad.filling.roads.cross_part

    def kept(*arguments: Any, **options: Any) -> Crossing:
        cuts.append(cross_part(*arguments, **options))
        return cuts[-1]

    monkeypatch.setattr(gyroid_cad.filling.roads, "cross_part", kept)
    fill(leaping(), 2.9, density=0.3, fit=COARSE)
    (cut,) = cuts
    t = np.linspace(0, 1, 501)
    for section in cut.sections:
        face, part = cut.pairs.face[[section.pair]], cut.pairs.part[[section.pair]]
        points, (u, v) = on_section(section.in_space, t), section.square(t).T[:, np.newaxis]
        on_faces = cut.faces.derivatives(face, u, v, 0)[0][0], cut.boundary.points(part, section.part(t)[None])[0]
        for exact in on_faces:
            assert np.linalg.norm(exact - points, axis=1).max() <= 1.25 * section.deviation + 1e-12

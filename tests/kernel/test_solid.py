"""The closed solid: its topology, its pieces, its thickness, and sewing as an independent opinion."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import lru_cache
from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakeSolid, BRepBuilderAPI_Sewing
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Trsf, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.TopAbs import (
    TopAbs_COMPOUND,
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_VERTEX,
)
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Shape

from gyroid_cad.kernel.check import enclosed_volume, topology
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_shell, as_vertex
from gyroid_cad.kernel.solid import TOLERANCE, another_handle, build_solid
from gyroid_cad.kernel.surfaces import kernel_surface
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import FitSettings, fit_patch
from gyroid_cad.surface.patch import smooth
from gyroid_cad.surface.symmetry import CELL_QUARTERS, QUARTER, Placements, bounding_cell
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import SIDES, Wall, build_wall

TUBE = USUAL.tube

Floats = NDArray[np.float64]
Cells = tuple[int, int, int]

CELL_SIZE, THICKNESS = 10.0, 0.8
ONE_CELL = (1, 1, 1)
BLOCKS = [ONE_CELL, (2, 1, 1), (2, 2, 1), (2, 2, 2), (3, 2, 2)]
COARSE = FitSettings(5)
PAPER_WEIGHTS = replace(FitSettings.paper(), parameterisation="smooth")


@lru_cache(maxsize=32)
def wall_of(cells: Cells, fit: FitSettings = COARSE, placements: Placements | None = None) -> Wall:
    return build_wall(build_complex(cells, placements), fit_patch(fit), CELL_SIZE, THICKNESS)


@lru_cache(maxsize=32)
def solid_of(cells: Cells, fit: FitSettings = COARSE, placements: Placements | None = None) -> TopoDS_Shape:
    return build_solid(wall_of(cells, fit, placements))


@lru_cache(maxsize=1)
def sorted_into_the_cell() -> Placements:
    """The same lattice, each patch moved by whole cells until its centre is in the cell: some then hang by a line."""
    placements = USUAL.cell
    return replace(placements, translations=placements.translations % CELL_QUARTERS)


def distinct(shape: TopoDS_Shape, kind: object) -> int:
    found = NumberedShapes()
    TopExp.MapShapes_s(shape, kind, found)
    return int(found.Extent())


def parts(shape: TopoDS_Shape, kind: object) -> list[TopoDS_Shape]:
    found, explorer = [], TopExp_Explorer(shape, kind)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def surfaces_of(shape: TopoDS_Shape) -> list[Geom_BSplineSurface]:
    """The surface of each face, before the face's own translation."""
    return [BRep_Tool.Surface_s(as_face(face), TopLoc_Location()) for face in parts(shape, TopAbs_FACE)]


def euler_characteristic(shape: TopoDS_Shape) -> int:
    return distinct(shape, TopAbs_VERTEX) - distinct(shape, TopAbs_EDGE) + distinct(shape, TopAbs_FACE)


def mid_surface_euler_characteristic(wall: Wall) -> int:
    return wall.complex.fan_count - wall.complex.edge_count + wall.complex.patch_count


def valid(shape: TopoDS_Shape) -> bool:
    return bool(BRepCheck_Analyzer(shape, True, True).IsValid())


@pytest.mark.parametrize("cells", BLOCKS)
def test_the_lattice_is_one_valid_solid_with_one_closed_shell(cells: Cells) -> None:
    solid = solid_of(cells)
    assert solid.ShapeType() == TopAbs_SOLID
    assert len(parts(solid, TopAbs_SHELL)) == 1
    assert parts(solid, TopAbs_SHELL)[0].Closed()
    assert valid(solid)
    assert enclosed_volume(solid) > 0


@pytest.mark.parametrize("cells", BLOCKS)
def test_every_edge_bounds_two_faces_and_is_run_once_in_each_direction(cells: Cells) -> None:
    uses = Counter((edge.__hash__(), edge.Orientation()) for edge in parts(solid_of(cells), TopAbs_EDGE))
    edges = {edge for edge, _ in uses}
    assert len(edges) == distinct(solid_of(cells), TopAbs_EDGE)
    assert uses == Counter((edge, way) for edge in edges for way in (TopAbs_FORWARD, TopAbs_REVERSED))


@pytest.mark.parametrize("cells", BLOCKS)
def test_a_patch_has_two_faces_and_a_free_edge_has_one(cells: Cells) -> None:
    complex = wall_of(cells).complex
    free = int(complex.free.sum())
    assert distinct(solid_of(cells), TopAbs_FACE) == 2 * complex.patch_count + free
    assert distinct(solid_of(cells), TopAbs_EDGE) == 2 * complex.edge_count + int(complex.border_fans.sum())
    assert distinct(solid_of(cells), TopAbs_VERTEX) == 2 * complex.fan_count


@pytest.mark.parametrize("cells", BLOCKS)
def test_the_shell_is_the_double_of_the_mid_surface(cells: Cells) -> None:
    """Two copies of the mid-surface, joined along its border by annuli, whose Euler characteristic is zero."""
    complex = wall_of(cells).complex
    assert complex.border_fans.sum() == complex.free.sum()  # the border is made of closed curves
    assert euler_characteristic(solid_of(cells)) == 2 * mid_surface_euler_characteristic(wall_of(cells))


def test_a_cell_among_others_adds_twice_minus_eight_to_the_euler_characteristic() -> None:
    """Inclusion and exclusion over the blocks of 1 or 2 cells a side leaves what one cell adds: Gauss-Bonnet's 2 chi.

    Sides, edges and corners of a block cancel out.
    """
    blocks = list(product((1, 2), repeat=3))
    total = sum((-1) ** (6 - sum(cells)) * euler_characteristic(solid_of(cells)) for cells in blocks)
    assert total == 2 * TUBE.euler_characteristic


@pytest.mark.parametrize("cells", [ONE_CELL, (2, 1, 1)])
def test_no_vertex_is_further_from_its_edges_than_the_kernels_smallest_distance(cells: Cells) -> None:
    solid = solid_of(cells)
    for shape, of in ((TopAbs_VERTEX, as_vertex), (TopAbs_EDGE, as_edge), (TopAbs_FACE, as_face)):
        assert max(BRep_Tool.Tolerance_s(of(part)) for part in parts(solid, shape)) == TOLERANCE
    assert valid(solid)


def faces_of(wall: Wall) -> list[TopoDS_Shape]:
    """Every face on its own, as a tool that knows nothing of the complex would be given it."""
    complex, faces = wall.complex, []
    for patch, net in enumerate(wall.patch_net.tolist()):
        shift = gp_Trsf()
        shift.SetTranslation(gp_Vec(*wall.shifts[wall.patch_shift[patch]].tolist()))
        free = np.flatnonzero(complex.free[complex.patch_edges[patch]]).tolist()
        nets = [wall.face(net, side) for side in SIDES] + [wall.side_wall(net, k) for k in free]
        for surface in nets:
            moved = kernel_surface(surface)
            moved.Transform(shift)
            faces.append(BRepBuilderAPI_MakeFace(moved, TOLERANCE).Face())
        faces[-len(nets)] = faces[-len(nets)].Reversed()
    return faces


def sewn(wall: Wall) -> BRepBuilderAPI_Sewing:
    sewing = BRepBuilderAPI_Sewing(1e-6)
    for face in faces_of(wall):
        sewing.Add(face)
    sewing.Perform()
    return sewing


def test_sewing_the_faces_of_a_bounding_cell_gives_the_same_solid() -> None:
    placements = bounding_cell(USUAL.patch)
    wall, built = wall_of(ONE_CELL, COARSE, placements), solid_of(ONE_CELL, COARSE, placements)
    assert wall.complex.non_manifold_edges == 0
    sewing = sewn(wall)
    assert sewing.NbFreeEdges() == 0
    solid = BRepBuilderAPI_MakeSolid(as_shell(sewing.SewedShape())).Solid()
    assert valid(solid)
    for kind in (TopAbs_FACE, TopAbs_EDGE, TopAbs_VERTEX):
        assert distinct(solid, kind) == distinct(built, kind)
    assert enclosed_volume(solid) == pytest.approx(enclosed_volume(built), rel=1e-12)


@pytest.mark.parametrize("cells", BLOCKS[:3])
def test_a_sewing_tool_finds_no_edge_without_a_partner(cells: Cells) -> None:
    assert sewn(wall_of(cells)).NbFreeEdges() == 0


def test_the_papers_weights_and_knots_make_a_valid_solid_of_rational_faces() -> None:
    """Of a bounding cell, for the kernel takes long to check rational faces."""
    placements = bounding_cell(USUAL.patch)
    wall, solid = (made(ONE_CELL, PAPER_WEIGHTS, placements) for made in (wall_of, solid_of))
    surfaces = surfaces_of(solid)
    faces = [surface for surface in surfaces if surface.VDegree() == 3]
    assert len(faces) == 2 * len(placements)
    assert len(surfaces) - len(faces) == wall.complex.free.sum()
    assert all(isinstance(surface, Geom_BSplineSurface) for surface in surfaces)
    assert all(surface.IsURational() or surface.IsVRational() for surface in surfaces)
    assert topology(solid).closed
    assert valid(solid)
    assert enclosed_volume(solid) == pytest.approx(wall.volume(), rel=1e-9)


@pytest.mark.parametrize("cells", [ONE_CELL, (2, 1, 1)])
def test_pieces_that_touch_in_lines_only_are_solids_of_their_own(cells: Cells) -> None:
    placements = sorted_into_the_cell()
    wall, compound = wall_of(cells, COARSE, placements), solid_of(cells, COARSE, placements)
    solids = parts(compound, TopAbs_SOLID)
    assert wall.complex.component_count > 1
    assert compound.ShapeType() == TopAbs_COMPOUND
    assert len(solids) == wall.complex.component_count
    assert all(valid(solid) and enclosed_volume(solid) > 0 for solid in solids)
    assert sum(map(enclosed_volume, solids)) == pytest.approx(wall.volume(), rel=1e-12)
    vertices = NumberedShapes()
    for solid in solids:
        TopExp.MapShapes_s(solid, TopAbs_VERTEX, vertices)
    assert vertices.Extent() == sum(distinct(solid, TopAbs_VERTEX) for solid in solids)


def test_a_patch_that_hangs_by_a_line_becomes_a_plate_with_the_topology_of_a_box() -> None:
    solids = parts(solid_of(ONE_CELL, COARSE, sorted_into_the_cell()), TopAbs_SOLID)
    plate = min(solids, key=enclosed_volume)
    assert [distinct(plate, kind) for kind in (TopAbs_VERTEX, TopAbs_EDGE, TopAbs_FACE)] == [8, 12, 6]
    assert sum(map(enclosed_volume, solids)) == pytest.approx(len(USUAL.cell) * enclosed_volume(plate), rel=1e-12)


@pytest.mark.parametrize("placements", [None, sorted_into_the_cell()], ids=["a solid", "a compound"])
def test_moving_one_handle_leaves_the_others_where_they_are(placements: Placements | None) -> None:
    original = solid_of(ONE_CELL, COARSE, placements)
    moved = another_handle(original)
    assert moved.IsEqual(original)
    shift = gp_Trsf()
    shift.SetTranslation(gp_Vec(100, 0, 0))
    moved.Move(TopLoc_Location(shift))
    assert moved.IsPartner(original)
    assert not moved.IsSame(original)
    assert original.Location().IsIdentity()
    assert another_handle(original).IsEqual(original)
    assert type(moved).__name__ == ("TopoDS_Solid" if placements is None else "TopoDS_Compound")


def test_translated_copies_of_a_patch_share_their_geometry_in_the_kernel() -> None:
    surfaces = [BRep_Tool.Surface_s(as_face(f), TopLoc_Location()) for f in parts(solid_of((3, 2, 2)), TopAbs_FACE)]
    faces = {id(surface) for surface in surfaces if surface.VDegree() == 3}
    assert len(faces) == len(SIDES) * len(USUAL.cell)


@pytest.mark.parametrize(("control_points", "relative_error"), [(5, 3e-2), (10, 5e-4), (16, 5e-5)])
def test_a_line_along_the_exact_normal_passes_through_one_thickness_of_wall(
    control_points: int, relative_error: float
) -> None:
    """Shot from the exact surface into the kernel's solid: half the wall lies on each side."""
    solid = another_handle(solid_of(ONE_CELL, FitSettings(control_points)))
    shooter = IntCurvesFace_ShapeIntersector()
    shooter.Load(solid, TOLERANCE)
    placements, random = USUAL.cell, np.random.default_rng(control_points)
    for matrix, translation in zip(placements.matrices, placements.translations, strict=True):
        points, normals = smooth(*random.uniform(-0.99, 0.99, (2, 4)))
        placed = (points @ matrix.T + translation * QUARTER) * CELL_SIZE / 2
        for point, normal in zip(placed.tolist(), (normals @ matrix.T).tolist(), strict=True):
            shooter.Perform(gp_Lin(gp_Pnt(*point), gp_Dir(*normal)), -THICKNESS, THICKNESS)
            hits = sorted(shooter.WParameter(i) for i in range(1, shooter.NbPnt() + 1))
            assert hits == pytest.approx([-THICKNESS / 2, THICKNESS / 2], rel=relative_error)


def test_progress_rises_to_the_number_of_patches() -> None:
    told: list[tuple[int, int]] = []
    build_solid(wall_of((2, 2, 1)), lambda done, total: told.append((done, total)))
    assert told == sorted(told)
    assert {total for _, total in told} == {wall_of((2, 2, 1)).complex.patch_count}
    assert told[-1][0] == told[-1][1]


def test_the_solid_carries_no_triangles() -> None:
    assert not BRepTools.Triangulation_s(solid_of(ONE_CELL), 1e9)

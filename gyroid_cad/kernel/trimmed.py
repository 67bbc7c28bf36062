"""A wall cut to a box as closed solids: every vertex and edge made once, nothing sewn and no boolean asked."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_BSplineCurve, Geom_Plane
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_REVERSED, TopAbs_SHELL
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid, TopoDS_Vertex, TopoDS_Wire

from gyroid_cad.errors import KernelError
from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.surfaces import TOLERANCE, WallGeometry, kernel_curve, plane_curve
from gyroid_cad.nurbs.surface import NurbsCurve
from gyroid_cad.trim.box import BoxEdge, BoxFace, TrimmedWall
from gyroid_cad.trim.caps import Cap, plane_axes
from gyroid_cad.trim.edge_crossings import PLANES
from gyroid_cad.trim.section_splines import section_knots
from gyroid_cad.trim.sections import Sections

__all__ = ["build_trimmed", "hollowed_by"]

# Between what was measured between stations of a section curve and what the kernel finds elsewhere along it.
_MARGIN = 2.0


def build_trimmed(cut: TrimmedWall) -> list[TopoDS_Shape]:
    """Build the solids of a wall cut to a box, one for each of its components; or shells, if it has no caps.

    Parameters
    ----------
    cut : TrimmedWall

    Raises
    ------
    KernelError
        If a piece of the boundary runs round nothing but a void.
    """
    shells = _Realisation(cut).shells()
    if not cut.capped:
        return shells
    if any(volume <= 0 for volume in cut.volumes):
        raise KernelError("the box leaves a void of the lattice with nothing round it")
    return [_solid(shell) for shell in shells]


def hollowed_by(solid: TopoDS_Shape, voids: Iterable[TopoDS_Shape]) -> TopoDS_Solid:
    """A solid with others, which lie within it and touch neither it nor each other, as its voids."""
    builder, made = BRep_Builder(), TopoDS_Solid()
    builder.MakeSolid(made)
    for shell in parts_of(solid, TopAbs_SHELL):
        builder.Add(made, shell)
    for shell in (shell for void in voids for shell in parts_of(void, TopAbs_SHELL)):
        builder.Add(made, shell.Reversed())
    return made


class _Realisation:
    def __init__(self, cut: TrimmedWall) -> None:
        self.cut = cut
        self.builder = BRep_Builder()
        self.geometry = WallGeometry(cut.wall)
        self.identity = TopLoc_Location()
        self.curves: dict[tuple[int, int], tuple[Geom_BSplineCurve, Geom2d_BSplineCurve, float]] = {}
        self.planes = [self._plane(plane) for plane in range(len(PLANES))]
        self.vertices = [self._vertex(point.tolist()) for point in cut.points]
        self.edges = [self._edge(edge) for edge in cut.edges]

    def shells(self) -> list[TopoDS_Shell]:
        shells = [TopoDS_Shell() for _ in self.cut.volumes]
        for shell in shells:
            self.builder.MakeShell(shell)
        faces = [self._face(face) for face in self.cut.faces] + [self._cap(cap) for cap in self.cut.caps]
        for face, component in zip(faces, self.cut.component.tolist(), strict=True):
            self.builder.Add(shells[component], face)
        for shell in shells:
            shell.Closed(self.cut.capped)
        return shells

    def _plane(self, plane: int) -> Geom_Plane:
        box, (axis, sign) = self.cut.box, PLANES[plane]
        origin = box.axes @ box.low if sign > 0 else box.axes @ box.high
        outwards, along = -sign * box.axes[:, axis], box.axes[:, plane_axes(plane)[0]]
        return Geom_Plane(gp_Ax3(gp_Pnt(*origin.tolist()), gp_Dir(*outwards.tolist()), gp_Dir(*along.tolist())))

    def _vertex(self, point: list[float]) -> TopoDS_Vertex:
        vertex = TopoDS_Vertex()
        self.builder.MakeVertex(vertex, gp_Pnt(*point), TOLERANCE)
        return vertex

    def _edge(self, edge: BoxEdge) -> TopoDS_Edge:
        made = TopoDS_Edge()
        start, end = self.vertices[edge.start], self.vertices[edge.end]
        first, last = edge.first, edge.last
        if edge.patch < 0:
            curve, location, tolerance = self._straight(edge), self.identity, TOLERANCE
        elif edge.sections is None:
            curve, location = (
                self.geometry.face_edge(edge.patch, edge.patch_edge, edge.side),
                self.geometry.location(edge.patch),
            )
            tolerance = TOLERANCE
        else:
            curve, _, tolerance = self._section(edge.sections, edge.curve)
            location = self.geometry.location(edge.patch)
        self.builder.MakeEdge(made, curve, location, tolerance)
        for vertex, parameter in ((start, first), (end, last)):
            place = curve.Value(parameter).Transformed(location.Transformation())
            # Two curves that meet at a small angle are further apart there than each is from its face.
            gap = _MARGIN * place.Distance(BRep_Tool.Pnt_s(vertex))
            self.builder.UpdateVertex(vertex, max(tolerance, gap))
        self.builder.Add(made, start)
        self.builder.Add(made, end.Oriented(TopAbs_REVERSED))
        self.builder.Range(made, first, last)
        return made

    def _straight(self, edge: BoxEdge) -> Geom_BSplineCurve:
        ends = np.array([self.cut.points[edge.start], self.cut.points[edge.end]])
        return kernel_curve(NurbsCurve(ends, np.ones(2), np.array([0.0, 0.0, 1.0, 1.0])))

    def _section(self, sections: Sections, curve: int) -> tuple[Geom_BSplineCurve, Geom2d_BSplineCurve, float]:
        """The curve in space and in the parameter plane, and how far the two are from each other."""
        key = (id(sections), curve)
        if key not in self.curves:
            parameters = sections.parameters[curve]
            points = sections.points[curve] @ self.cut.box.axes.T
            knots = section_knots(len(points))
            self.curves[key] = (
                kernel_curve(NurbsCurve(points, np.ones(len(points)), knots)),
                plane_curve(parameters, knots),
                max(TOLERANCE, _MARGIN * float(sections.deviation[curve])),
            )
        return self.curves[key]

    def _face(self, face: BoxFace) -> TopoDS_Face:
        surface, location = self.geometry.face(face.patch, face.side), self.geometry.location(face.patch)
        made = TopoDS_Face()
        self.builder.MakeFace(made, surface, location, TOLERANCE)
        for loop, patch_edges in zip(face.loops, face.patch_edges, strict=True):
            for (number, _), patch_edge in zip(loop, patch_edges, strict=True):
                sections, curve = self.cut.edges[number].sections, self.cut.edges[number].curve
                if sections is None:
                    line, tolerance = self.geometry.border(face.patch, patch_edge), TOLERANCE
                else:
                    _, line, tolerance = self._section(sections, curve)
                self.builder.UpdateEdge(self.edges[number], line, surface, location, tolerance)
            self.builder.Add(made, self._wire(loop))
        self.builder.NaturalRestriction(
            made, all(patch_edge >= 0 for patch_edges in face.patch_edges for patch_edge in patch_edges)
        )
        return made.Oriented(TopAbs_REVERSED) if face.backwards else made

    def _cap(self, cap: Cap) -> TopoDS_Face:
        made = TopoDS_Face()
        self.builder.MakeFace(made, self.planes[cap.plane], TOLERANCE)
        for loop in cap.loops:
            self.builder.Add(made, self._wire(loop))
        return made

    def _wire(self, loop: list[tuple[int, bool]]) -> TopoDS_Wire:
        wire = TopoDS_Wire()
        self.builder.MakeWire(wire)
        for number, forward in loop:
            self.builder.Add(wire, self.edges[number] if forward else self.edges[number].Reversed())
        wire.Closed(True)
        return wire


def _solid(shell: TopoDS_Shell) -> TopoDS_Solid:
    builder, solid = BRep_Builder(), TopoDS_Solid()
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid

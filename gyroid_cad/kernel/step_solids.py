"""Solids and shells of the kernel, read into what STEP has for them: the topology is walked once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepClass3d import BRepClass3d
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.Geom import Geom_SphericalSurface
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_ShapeEnum,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_WIRE,
)
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Iterator, TopoDS_Shape, TopoDS_Vertex

from gyroid_cad.kernel.check import parts_of
from gyroid_cad.kernel.compat import NumberedShapes, as_edge, as_face, as_solid, as_wire
from gyroid_cad.kernel.step_geometry import Geometries, UnknownGeometryError, axis_placement, parameter_curve
from gyroid_cad.step.bodies import LEAST_GAP, EdgeUse, StepBody, StepFace, StepLoop
from gyroid_cad.step.geometry import ParameterCurve
from gyroid_cad.step.products import UNLABELLED, BodyLabels, Occurrence, StepPart, parts_apart
from gyroid_cad.wall.areas import ShapeSize

__all__ = ["products_of", "read_step_bodies", "require_bodies"]

# Along an edge, from 0 to 1: by the golden ratio, so that they are not where a curve was fitted through points.
_SAMPLES = np.arange(1, 18) * (np.sqrt(5) - 1) / 2 % 1


def read_step_bodies(shape: TopoDS_Shape, pcurves: bool = False) -> list[StepBody]:
    """Read the solids of a shape, or its shells if it has none, each with edges and vertices of its own.

    Parameters
    ----------
    shape : TopoDS_Shape
    pcurves : bool
        Whether to read the curves of edges in the parameters of their faces as well.

    Raises
    ------
    UnknownGeometryError
        If it holds anything that is not known here.
    """
    return [_Reading(body, pcurves).read for body in parts_of(shape, require_bodies(shape))]


def products_of(
    shape: TopoDS_Shape,
    name: str,
    labels: BodyLabels = UNLABELLED,
    sizes: Sequence[ShapeSize] = (),
    pcurves: bool = False,
    products: bool = False,
) -> tuple[list[StepPart], list[Occurrence]]:
    """Return the parts that a shape is written as, and their places if it has a solid in several.

    Parameters
    ----------
    shape : TopoDS_Shape
    name : str
        Of the product.
    labels : BodyLabels
        Of the bodies as the kernel counts them; of those in several places they are left out.
    sizes : sequence of ShapeSize
        One a body, or none; of bodies in several places, or of others than there are, they are left out.
    pcurves : bool
        As of :func:`read_step_bodies`.
    products : bool
        Whether bodies of each name, or each that has none, are a part of their own.

    Raises
    ------
    UnknownGeometryError
    """
    kinds, bodies = NumberedShapes(), list(parts_of(shape, require_bodies(shape)))
    which = [kinds.Add(body.Located(TopLoc_Location()).Oriented(TopAbs_FORWARD)) - 1 for body in bodies]
    if len(bodies) == kinds.Extent():
        own = sizes if len(sizes) == len(bodies) else ()
        read = read_step_bodies(shape, pcurves)
        part = StepPart(
            name,
            read,
            body_names=labels.names,
            body_colours=labels.colours,
            face_names=labels.face_names,
            body_sizes=own,
        )
        if not products or len(bodies) == 1:
            return [part], []
        return parts_apart(part, [body.face_count for body in read])
    parts = [
        StepPart(f"{name} {kind}", read_step_bodies(kinds.FindKey(kind), pcurves))
        for kind in range(1, kinds.Extent() + 1)
    ]
    places = [axis_placement(body.Location()) for body in bodies]
    return parts, [Occurrence(kind, f"{name} {kind + 1}", place) for kind, place in zip(which, places, strict=True)]


def require_bodies(shape: TopoDS_Shape) -> TopAbs_ShapeEnum:
    """Check that a shape is solids and nothing else, or open shells and nothing else; returns which.

    Raises
    ------
    UnknownGeometryError
    """
    kind = TopAbs_SOLID if TopExp_Explorer(shape, TopAbs_SOLID).More() else TopAbs_SHELL
    strays = (TopExp_Explorer(shape, TopAbs_FACE, kind), TopExp_Explorer(shape, TopAbs_EDGE, TopAbs_FACE))
    if not TopExp_Explorer(shape, kind).More() or any(explorer.More() for explorer in strays):
        raise UnknownGeometryError("faces or edges of no body")
    if kind == TopAbs_SHELL and any(BRep_Tool.IsClosed_s(shell) for shell in parts_of(shape, TopAbs_SHELL)):
        raise UnknownGeometryError("a closed shell of no solid")
    return kind


class _Reading:
    """The walk through a body."""

    def __init__(self, body: TopoDS_Shape, pcurves: bool) -> None:
        self.read = StepBody(solid=body.ShapeType() == TopAbs_SOLID)
        self._surfaces, self._curves, self._pcurves = Geometries(), Geometries(), pcurves
        self._edges, self._vertices = NumberedShapes(), NumberedShapes()
        self._meetings: list[tuple[float, TopoDS_Edge, TopoDS_Face | TopoDS_Vertex]] = []
        # A solid is what its outer shell holds; that the kernel has it inside out is not for STEP to say.
        whole = body.Oriented(TopAbs_FORWARD)
        shells = _children(whole) if self.read.solid else [whole]
        if any(shell.ShapeType() != TopAbs_SHELL for shell in shells):
            raise UnknownGeometryError("a solid with more than shells")
        if len(shells) > 1:
            outer = BRepClass3d.OuterShell_s(as_solid(whole))
            self.read.outer = next(number for number, shell in enumerate(shells) if shell.IsSame(outer))
        for number, shell in enumerate(shells):
            # The shell of a void is written as seen from the void.
            turned = number != self.read.outer
            self.read.shells.append([self._face(as_face(face), turned) for face in _children(shell)])
        self.read.surfaces, self.read.curves = self._surfaces.found, self._curves.found
        self.read.gap = _largest_gap(self._meetings)

    def _face(self, face: TopoDS_Face, turned: bool) -> StepFace:
        location = TopLoc_Location()
        geometry = BRep_Tool.Surface_s(face, location)
        surface = self._surfaces.number(geometry, location)
        wires = _children(face.Oriented(TopAbs_FORWARD))
        on_ball = isinstance(geometry, Geom_SphericalSurface)
        if not wires:
            raise UnknownGeometryError("a face without a border")
        loops = [loop for wire in wires for loop in self._loops(wire, face, on_ball)]
        if self._pcurves:
            self._read_pcurves(face, surface, {edge for loop in loops for edge, _ in loop.uses})
        return StepFace(surface, (_along(face) != turned), loops)

    def _read_pcurves(self, face: TopoDS_Face, surface: int, written: set[int]) -> None:
        seen: set[tuple[int, bool]] = set()
        for edge in map(as_edge, parts_of(face.Oriented(TopAbs_FORWARD), TopAbs_EDGE)):
            use = int(self._edges.FindIndex(edge)) - 1, _along(edge)
            if use[0] not in written or use in seen:
                continue
            seen.add(use)
            curve = self._curves.found[self.read.edges[use[0]][2]]
            found = parameter_curve(edge, face, self._surfaces.found[surface], curve)
            if found is not None:
                self.read.pcurves.append(ParameterCurve(use[0], surface, found))

    def _loops(self, wire: TopoDS_Shape, face: TopoDS_Face, on_ball: bool) -> list[StepLoop]:
        if wire.ShapeType() != TopAbs_WIRE:
            raise UnknownGeometryError("a face with more than wires")
        edges = [as_edge(edge) for edge in _children(wire)]
        uses = [self._use(edge, face) for edge in edges if not BRep_Tool.Degenerated_s(edge)]
        if on_ball and sum(map(BRep_Tool.Degenerated_s, edges)) == 2:
            # The seam of a ball and its poles are the kernel's own affair. Readers, the kernel's among them, lose their
            # way along a border that runs to both poles and back.
            times = Counter(edge for edge, _ in uses)
            return self._closed_loops([use for use in uses if times[use[0]] == 1]) or [self._pole(edges)]
        if not uses:
            return [self._pole(edges)]
        for some in (uses, uses[::-1]):
            if self._joined(some):
                return [StepLoop(some)]
        explorer, ordered = BRepTools_WireExplorer(as_wire(wire), as_face(face.Oriented(TopAbs_FORWARD))), []
        while explorer.More():
            if not BRep_Tool.Degenerated_s(explorer.Current()):
                ordered.append(self._use(explorer.Current(), face))
            explorer.Next()
        if sorted(ordered) != sorted(uses) or not self._joined(ordered):
            raise UnknownGeometryError("a wire that does not close")
        return [StepLoop(ordered)]

    def _pole(self, edges: list[TopoDS_Edge]) -> StepLoop:
        pole = next(edge for edge in edges if BRep_Tool.Degenerated_s(edge))
        return StepLoop([], self._vertex(TopExp.FirstVertex_s(pole)))

    def _closed_loops(self, uses: list[EdgeUse]) -> list[StepLoop]:
        """Join uses end to end."""
        left, loops = list(uses), []
        while left:
            loop = [left.pop(0)]
            while self._ends(loop[-1])[1] != self._ends(loop[0])[0]:
                following = next((use for use in left if self._ends(use)[0] == self._ends(loop[-1])[1]), None)
                if following is None:
                    raise UnknownGeometryError("a wire that does not close")
                left.remove(following)
                loop.append(following)
            loops.append(StepLoop(loop))
        return loops

    def _ends(self, use: EdgeUse) -> tuple[int, int]:
        """Vertices where a use of an edge begins and ends."""
        first, last, _ = self.read.edges[use[0]]
        return (first, last) if use[1] else (last, first)

    def _joined(self, uses: list[EdgeUse]) -> bool:
        """Tell whether every edge ends where the next begins."""
        ends = [self._ends(use) for use in uses]
        return all(end == start for (_, end), (start, _) in zip(ends, [*ends[1:], ends[0]], strict=True))

    def _use(self, edge: TopoDS_Edge, face: TopoDS_Face) -> EdgeUse:
        along, known = _along(edge), self._edges.Extent()
        number = int(self._edges.Add(edge))
        self._meet(BRep_Tool.Tolerance_s(edge), edge, face)
        if number > known:
            forward = as_edge(edge.Oriented(TopAbs_FORWARD))
            location = TopLoc_Location()
            curve = self._curves.number(BRep_Tool.Curve_s(forward, location, 0.0, 0.0), location)
            ends = TopExp.FirstVertex_s(forward), TopExp.LastVertex_s(forward)
            self.read.edges.append((self._vertex(ends[0]), self._vertex(ends[1]), curve))
            for end in ends:
                self._meet(BRep_Tool.Tolerance_s(end), edge, end)
        return number - 1, along

    def _meet(self, tolerance: float, edge: TopoDS_Edge, other: TopoDS_Face | TopoDS_Vertex) -> None:
        if tolerance > LEAST_GAP:
            self._meetings.append((tolerance, edge, other))

    def _vertex(self, vertex: TopoDS_Vertex) -> int:
        if vertex.IsNull():
            raise UnknownGeometryError("an edge without an end")
        known = self._vertices.Extent()
        number = int(self._vertices.Add(vertex))
        if number > known:
            place = BRep_Tool.Pnt_s(vertex)
            self.read.vertices.append((place.X(), place.Y(), place.Z()))
        return number - 1


def _largest_gap(meetings: list[tuple[float, TopoDS_Edge, TopoDS_Face | TopoDS_Vertex]]) -> float:
    """Largest distance in mm of edges from the faces that they bound and the vertices where they end.

    Parameters
    ----------
    meetings : list of (tolerance, edge, face or vertex)
        No distance is above its tolerance, so that those with the largest tolerances are measured, and few others.
    """
    largest = 0.0
    for tolerance, edge, other in sorted(meetings, key=lambda meeting: -meeting[0]):
        if tolerance <= largest:
            break
        curve = BRepAdaptor_Curve(edge)
        first, last = curve.FirstParameter(), curve.LastParameter()
        if isinstance(other, TopoDS_Face):
            on_face = BRepAdaptor_Curve(edge, other)
            places = (first + (last - first) * _SAMPLES).tolist()
            largest = max(largest, *(curve.Value(at).Distance(on_face.Value(at)) for at in places))
        else:
            # Of a closed edge both ends are there.
            largest = max(largest, min(curve.Value(at).Distance(BRep_Tool.Pnt_s(other)) for at in (first, last)))
    return largest


def _children(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    iterator, found = TopoDS_Iterator(shape), []
    while iterator.More():
        found.append(iterator.Value())
        iterator.Next()
    return found


def _along(shape: TopoDS_Shape) -> bool:
    if shape.Orientation() not in (TopAbs_FORWARD, TopAbs_REVERSED):
        raise UnknownGeometryError("an edge or face inside another")
    return bool(shape.Orientation() == TopAbs_FORWARD)

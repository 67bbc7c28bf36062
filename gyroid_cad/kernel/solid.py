"""The wall as a closed solid, every vertex and edge made once and shared by the complex's ids.

Nothing is sewn: ``BRep_Builder`` puts together what the complex already knows to be together. Geometry is
shared as well, between patches that differ by a translation; the translation is the location of the
curve or surface inside the edge or face.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from OCP.BRep import BRep_Builder
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_COMPOUND, TopAbs_FACE, TopAbs_REVERSED, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import (
    TopoDS_Compound,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from gyroid_cad.kernel.compat import as_compound, as_face, as_shell, as_solid
from gyroid_cad.kernel.surfaces import TOLERANCE, WallGeometry, parameter_line, straight_curve
from gyroid_cad.wall.offset import SIDES, Wall, side_along

__all__ = [
    "TOLERANCE",
    "KernelFace",
    "KernelShape",
    "another_handle",
    "build_faces",
    "build_patches",
    "build_solid",
    "faces_by_patch",
]

KernelShape: TypeAlias = TopoDS_Shape
KernelFace: TypeAlias = TopoDS_Face

# Where the patch's corners are in its control net.
_CORNER_INDEX = ((0, 0), (-1, 0), (-1, -1), (0, -1))


def build_solid(wall: Wall, progress: Callable[[int, int], None] | None = None) -> TopoDS_Shape:
    """Build the closed solid round a wall.

    Parameters
    ----------
    wall : Wall
    progress : callable, optional
        Called now and then with (patches done, patches in all).

    Returns
    -------
    TopoDS_Solid
        Or a TopoDS_Compound of solids where the lattice falls into pieces that share no edge.
    """
    return _Realisation(wall).build(progress or (lambda done, total: None))


def build_faces(wall: Wall) -> list[tuple[TopoDS_Face, TopoDS_Face]]:
    """The two faces of every patch, without side walls, neighbours sharing their edges.

    Parameters
    ----------
    wall : Wall

    Returns
    -------
    list of (TopoDS_Face, TopoDS_Face)
        By patch: on side 0 and on side 1, both oriented along the common normal.
    """
    return _Realisation(wall).faces()


def build_patches(wall: Wall) -> list[list[TopoDS_Face]]:
    """All faces of every patch of a closed wall, its free side walls too, oriented outwards and sharing their edges."""
    return _Realisation(wall).patches()


def faces_by_patch(solid: TopoDS_Shape, wall: Wall) -> list[list[TopoDS_Face]]:
    """The faces of a solid made by :func:`build_solid`, by patch: side 0, side 1, then its free side walls.

    Parameters
    ----------
    solid : TopoDS_Solid
    wall : Wall
        That it was made of; of one piece.
    """
    # A shell keeps the order in which it was given its faces.
    explorer = TopExp_Explorer(solid, TopAbs_FACE)
    faces: list[TopoDS_Face] = []
    while explorer.More():
        faces.append(as_face(explorer.Current()))
        explorer.Next()
    counts = len(SIDES) + wall.complex.free[wall.complex.patch_edges].sum(axis=1)
    ends = np.cumsum(counts).tolist()
    return [faces[start:end] for start, end in zip([0, *ends[:-1]], ends, strict=True)]


def another_handle(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Another handle on a shape's topology and geometry: moving one does not move the other."""
    casts = {TopAbs_SOLID: as_solid, TopAbs_SHELL: as_shell, TopAbs_COMPOUND: as_compound}
    return casts[shape.ShapeType()](shape.Located(TopLoc_Location()))


class _Realisation:
    """The shapes made so far, by the complex's ids."""

    def __init__(self, wall: Wall) -> None:
        self.wall = wall
        self.complex = wall.complex
        self.builder = BRep_Builder()
        self.identity = TopLoc_Location()
        self.geometry = WallGeometry(wall)
        self.free = self.complex.free.tolist()
        self.patch_edges = self.complex.patch_edges.tolist()
        self.patch_fans = self.complex.patch_fans.tolist()
        self.edge_forward = self.complex.edge_forward.tolist()
        self.rim_lines = [(parameter_line(0, v, -1, 0), parameter_line(0, v, 1, 0)) for v in (-1, 1)]
        self.post_lines = [parameter_line(u, 0, 0, 1) for u in (-1, 1)]

    def build(self, progress: Callable[[int, int], None]) -> TopoDS_Shape:
        self.vertices = self._make_vertices()
        self.edges = self._make_edges()
        self.posts = self._make_posts()
        shells = [self._new_shell() for _ in range(self.complex.component_count)]
        component = self.complex.patch_component.tolist()
        for patch in range(self.complex.patch_count):
            shell = shells[component[patch]]
            for face in self._patch_faces(patch):
                self.builder.Add(shell, face)
            if patch % 240 == 0:
                progress(patch, self.complex.patch_count)
        progress(self.complex.patch_count, self.complex.patch_count)
        return self._solids(shells)

    def patches(self) -> list[list[TopoDS_Face]]:
        self.vertices = self._make_vertices()
        self.edges = self._make_edges()
        self.posts = self._make_posts()
        return [self._patch_faces(patch) for patch in range(self.complex.patch_count)]

    def _patch_faces(self, patch: int) -> list[TopoDS_Face]:
        sides = [k for k in range(4) if self.free[self.patch_edges[patch][k]]]
        return [
            as_face(self._make_face(patch, 0).Oriented(TopAbs_REVERSED)),
            self._make_face(patch, 1),
            *(self._make_side_wall(patch, k) for k in sides),
        ]

    def faces(self) -> list[tuple[TopoDS_Face, TopoDS_Face]]:
        self.vertices = self._make_vertices()
        self.edges = self._make_edges()
        return [(self._make_face(patch, 0), self._make_face(patch, 1)) for patch in range(self.complex.patch_count)]

    def _new_shell(self) -> TopoDS_Shell:
        shell = TopoDS_Shell()
        self.builder.MakeShell(shell)
        return shell

    def _solids(self, shells: list[TopoDS_Shell]) -> TopoDS_Shape:
        solids = []
        for shell in shells:
            shell.Closed(True)
            solid = TopoDS_Solid()
            self.builder.MakeSolid(solid)
            self.builder.Add(solid, shell)
            solids.append(solid)
        if len(solids) == 1:
            return solids[0]
        compound = TopoDS_Compound()
        self.builder.MakeCompound(compound)
        for solid in solids:
            self.builder.Add(compound, solid)
        return compound

    def _make_vertices(self) -> list[list[TopoDS_Vertex]]:
        """Two vertices a fan, one on each side of the wall; [side][fan]."""
        patches, corners = self.complex.patch_fans.shape
        first = np.zeros(self.complex.fan_count, dtype=np.int64)
        first[self.complex.patch_fans.ravel()] = np.arange(patches * corners)
        patch, corner = np.divmod(first, corners)
        net, shift = self.wall.patch_net[patch], self.wall.shifts[self.wall.patch_shift[patch]]
        vertices: list[list[TopoDS_Vertex]] = []
        for side in SIDES:
            corner_points = np.stack(
                [self.wall.nets[:, side][(slice(None), *_CORNER_INDEX[k])] for k in range(corners)], axis=1
            )
            made = []
            for point in (corner_points[net, corner] + shift).tolist():
                vertex = TopoDS_Vertex()
                self.builder.MakeVertex(vertex, gp_Pnt(*point), TOLERANCE)
                made.append(vertex)
            vertices.append(made)
        return vertices

    def _make_edges(self) -> list[list[TopoDS_Edge]]:
        """Two rims an edge of the complex, one on each side of the wall; [side][edge]."""
        owner = self.complex.edge_patches[:, 0].tolist()
        fans = self.complex.edge_fans.tolist()
        edges: list[list[TopoDS_Edge]] = []
        for side in SIDES:
            made = []
            for index, patch in enumerate(owner):
                k = self.patch_edges[patch].index(index)
                edge = TopoDS_Edge()
                self.builder.MakeEdge(
                    edge, self.geometry.face_edge(patch, k, side), self.geometry.location(patch), TOLERANCE
                )
                start, end = fans[index]
                self._bound(edge, self.vertices[side][start], self.vertices[side][end], -1.0, 1.0)
                made.append(edge)
            edges.append(made)
        return edges

    def _make_posts(self) -> dict[int, TopoDS_Edge]:
        """A straight edge through the wall for each fan that does not close round its corner."""
        posts = {}
        for fan in np.flatnonzero(self.complex.border_fans).tolist():
            below, above = (self.vertices[side][fan] for side in SIDES)
            edge = TopoDS_Edge()
            self.builder.MakeEdge(edge, straight_curve(below, above), self.identity, TOLERANCE)
            self._bound(edge, below, above, -1.0, 1.0)
            posts[fan] = edge
        return posts

    def _bound(self, edge: TopoDS_Edge, start: TopoDS_Vertex, end: TopoDS_Vertex, first: float, last: float) -> None:
        self.builder.Add(edge, start)
        self.builder.Add(edge, end.Oriented(TopAbs_REVERSED))
        self.builder.Range(edge, first, last)

    def _make_face(self, patch: int, side: int) -> TopoDS_Face:
        surface, location = self.geometry.face(patch, side), self.geometry.location(patch)
        face, wire = TopoDS_Face(), TopoDS_Wire()
        self.builder.MakeFace(face, surface, location, TOLERANCE)
        self.builder.MakeWire(wire)
        for k, index in enumerate(self.patch_edges[patch]):
            edge = self.edges[side][index]
            self.builder.UpdateEdge(edge, self.geometry.border(patch, k), surface, location, TOLERANCE)
            self.builder.Add(wire, edge if self.edge_forward[patch][k] else edge.Reversed())
        return self._closed(face, wire)

    def _make_side_wall(self, patch: int, k: int) -> TopoDS_Face:
        surface, location = self.geometry.face(patch, side_along(k)), self.geometry.location(patch)
        face, wire = TopoDS_Face(), TopoDS_Wire()
        self.builder.MakeFace(face, surface, location, TOLERANCE)
        self.builder.MakeWire(wire)
        index, forward = self.patch_edges[patch][k], self.edge_forward[patch][k]
        start, end = self.patch_fans[patch][k], self.patch_fans[patch][(k + 1) % 4]
        bottom, top = self.edges[0][index], self.edges[1][index]
        left, right = self.posts[start], self.posts[end]
        for rim, height in ((bottom, 0), (top, 1)):
            self.builder.UpdateEdge(rim, self.rim_lines[height][forward], surface, location, TOLERANCE)
        for post, line in ((left, self.post_lines[0]), (right, self.post_lines[1])):
            self.builder.UpdateEdge(post, line, surface, location, TOLERANCE)
        self.builder.Add(wire, bottom if forward else bottom.Reversed())
        self.builder.Add(wire, right)
        self.builder.Add(wire, top.Reversed() if forward else top)
        self.builder.Add(wire, left.Reversed())
        return self._closed(face, wire)

    def _closed(self, face: TopoDS_Face, wire: TopoDS_Wire) -> TopoDS_Face:
        wire.Closed(True)
        self.builder.Add(face, wire)
        self.builder.NaturalRestriction(face, True)
        return face

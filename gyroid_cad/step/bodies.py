"""Solids and shells as STEP has them: faces, their borders, edges and vertices by number, written in tables."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.step.geometry import Geometry, ParameterCurve, ParameterLine, Placed, Spline, Triple
from gyroid_cad.step.text import StepText, quoted, real, refs

__all__ = ["LEAST_GAP", "EdgeUse", "StepBody", "StepFace", "StepLoop", "WritableBody", "write_shells"]

Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# In mm: the kernel's smallest distance, which no tolerance is below.
LEAST_GAP = 1e-7
_PLANE_OF_PARAMETERS = (
    "(GEOMETRIC_REPRESENTATION_CONTEXT(2)PARAMETRIC_REPRESENTATION_CONTEXT()REPRESENTATION_CONTEXT('2D SPACE',''))"
)
# Of an edge: its number, and whether it is run from its first vertex to its last.
EdgeUse = tuple[int, bool]


class WritableBody(Protocol):
    """Solid that a STEP file can hold, or shell that bounds none."""

    @property
    def gap(self) -> float:
        """The largest in mm, of edges from their surfaces and from their ends."""

    @property
    def solid(self) -> bool: ...

    @property
    def extent(self) -> float:
        """The largest coordinate in mm."""

    def write(self, text: StepText, name: str, face_names: Iterator[str]) -> tuple[int, list[int]]:
        """Write the body; returns the number of its entity, and those of its faces."""


@dataclass(frozen=True, slots=True)
class StepLoop:
    """A border of a face.

    Attributes
    ----------
    uses : list of (edge, along)
        One after the other.
    vertex : int, optional
        Instead of them, where the border is a point.
    """

    uses: list[EdgeUse]
    vertex: int | None = None


@dataclass(frozen=True, slots=True)
class StepFace:
    """A face: the number of its surface, whether its normal is the surface's, and its borders."""

    surface: int
    forward: bool
    loops: list[StepLoop]


@dataclass(slots=True)
class StepBody:
    """A solid, or a shell that bounds none, whatever its geometry.

    Attributes
    ----------
    gap : float
        The largest in mm, of edges from their surfaces and from their ends.
    surfaces, curves : list of Spline, Placed, Line or SweptSurface
    vertices : list of tuple of float
    edges : list of (first vertex, last vertex, curve)
    pcurves : list of ParameterCurve
        Of edges, in the parameters of the faces that they bound, where they are wanted.
    shells : list of list of StepFace
    outer : int
        Which of them is not round a void.
    solid : bool
    """

    gap: float = 0.0
    surfaces: list[Geometry] = field(default_factory=list)
    curves: list[Geometry] = field(default_factory=list)
    vertices: list[Triple] = field(default_factory=list)
    edges: list[tuple[int, int, int]] = field(default_factory=list)
    pcurves: list[ParameterCurve] = field(default_factory=list)
    shells: list[list[StepFace]] = field(default_factory=list)
    outer: int = 0
    solid: bool = True

    @property
    def face_count(self) -> int:
        """Number of its faces."""
        return sum(map(len, self.shells))

    @property
    def extent(self) -> float:
        """The largest coordinate of its vertices and splines, in mm."""
        splines = [one for one in (*self.surfaces, *self.curves) if isinstance(one, Spline)]
        places = [np.array(self.vertices), *(one.poles for one in splines)]
        return max(float(np.abs(some).max()) for some in places)

    def write(self, text: StepText, name: str, face_names: Iterator[str]) -> tuple[int, list[int]]:
        """Write the body.

        Parameters
        ----------
        text : StepText
        name : str
        face_names : iterator of str
            One a face, shell by shell, or none.

        Returns
        -------
        body : int
            Number of its entity.
        faces : list of int
            Numbers of its faces, shell by shell.
        """
        geometries = text.geometries([*self.surfaces, *self.curves])
        points = text.points(np.array(self.vertices).reshape(-1, 3))
        vertices = text.table("VERTEX_POINT('',", points, ")")
        edges = np.zeros(0, dtype=np.int64)
        if self.edges:
            first, last, curve = np.array(self.edges).T
            curves = _edge_curves(text, geometries[len(self.surfaces) :][curve], geometries, self.pcurves)
            edges = text.table("EDGE_CURVE('',", vertices[first], ",", vertices[last], ",", curves, ",.T.)")
        all_faces = [face for shell in self.shells for face in shell]
        forward = np.array([face.forward for face in all_faces])
        bounds = self._bounds(text, all_faces, vertices, edges, forward)
        # The entity's normal is the opposite of the kernel's where its frame is left-handed.
        turned = np.array([isinstance(one, Placed) and one.left_handed for one in self.surfaces])
        surface = np.array([face.surface for face in all_faces])
        names = [quoted(next(face_names, "")) for _ in all_faces]
        counts = np.array([len(some) for some in bounds])
        faces = np.zeros(len(all_faces), dtype=np.int64)
        for count in np.unique(counts).tolist():
            which = np.flatnonzero(counts == count)
            table = np.array([bounds[face] for face in which.tolist()])
            some, sense = [names[face] for face in which.tolist()], forward[which] != turned[surface[which]]
            faces[which] = text.table(
                "ADVANCED_FACE(", some, ",", table, ",", geometries[surface[which]], ",", sense, ")"
            )
        shells = np.split(faces, np.cumsum([len(shell) for shell in self.shells])[:-1])
        return write_shells(text, name, shells, self.outer, self.solid), faces.tolist()

    def _bounds(
        self, text: StepText, faces: Sequence[StepFace], vertices: Integers, edges: Integers, forward: Booleans
    ) -> list[list[int]]:
        """Write the borders of faces; returns their numbers, face by face."""
        loops = [loop for face in faces for loop in face.loops]
        face_of = np.repeat(np.arange(len(faces)), [len(face.loops) for face in faces])
        numbers = np.zeros(len(loops), dtype=np.int64)
        uses = np.array([use for loop in loops for use in loop.uses], dtype=np.int64).reshape(-1, 2)
        oriented = np.zeros(0, dtype=np.int64)
        if len(uses):
            oriented = text.table("ORIENTED_EDGE('',*,*,", edges[uses[:, 0]], ",", uses[:, 1] > 0, ")")
        lengths = np.array([len(loop.uses) for loop in loops])
        starts = np.cumsum(lengths) - lengths
        for length in np.unique(lengths).tolist():
            which = np.flatnonzero(lengths == length)
            if length:
                table = oriented[starts[which, np.newaxis] + np.arange(length)]
                numbers[which] = text.table("EDGE_LOOP('',", table, ")")
            else:
                ends = vertices[np.array([loops[loop].vertex for loop in which.tolist()])]
                numbers[which] = text.table("VERTEX_LOOP('',", ends, ")")
        bounds = text.table("FACE_BOUND('',", numbers, ",", forward[face_of], ")")
        found: list[list[int]] = [[] for _ in faces]
        for face, bound in zip(face_of.tolist(), bounds.tolist(), strict=True):
            found[face].append(bound)
        return found


def write_shells(text: StepText, name: str, shells: Sequence[Integers], outer: int, solid: bool) -> int:
    """Write shells and the body that they bound; returns its number.

    Parameters
    ----------
    text : StepText
    name : str
    shells : sequence of ndarray of int
        Numbers of the faces of each.
    outer : int
        Which of them is not round a void.
    solid : bool
        Whether they bound anything.
    """
    kind = "CLOSED" if solid else "OPEN"
    numbers = [int(text.table(f"{kind}_SHELL('',", shell[np.newaxis], ")")[0]) for shell in shells]
    if not solid:
        return text.add(f"SHELL_BASED_SURFACE_MODEL({quoted(name)},{refs(numbers)})")
    outside = numbers.pop(outer)
    if not numbers:
        return text.add(f"MANIFOLD_SOLID_BREP({quoted(name)},#{outside})")
    voids = text.table("ORIENTED_CLOSED_SHELL('',*,", np.array(numbers), ",.F.)")
    return text.add(f"BREP_WITH_VOIDS({quoted(name)},#{outside},{refs(voids.tolist())})")


def _edge_curves(text: StepText, curves: Integers, surfaces: Integers, pcurves: Sequence[ParameterCurve]) -> Integers:
    """Write what edges lie on: their curves in space, with those in the parameters of surfaces that are known.

    The curve in space stays the one that counts: of the two it is the closer to both faces.

    Parameters
    ----------
    text : StepText
    curves : ndarray of int, shape (edges,)
        Numbers of their curves in space.
    surfaces : ndarray of int
        Numbers of surfaces.
    pcurves : sequence of ParameterCurve

    Returns
    -------
    ndarray of int, shape (edges,)
        Number of a SURFACE_CURVE or SEAM_CURVE, or of the curve in space alone.
    """
    if not pcurves:
        return curves
    context = text.once(_PLANE_OF_PARAMETERS)
    lines = _parameter_curves(text, [one.curve for one in pcurves])
    held = text.table("DEFINITIONAL_REPRESENTATION('',", lines[:, np.newaxis], f",#{context})")
    edge, on = np.array([one.edge for one in pcurves]), surfaces[[one.surface for one in pcurves]]
    numbers = text.table("PCURVE('',", on, ",", held, ")")
    # The second of an edge stands beside its first.
    order = np.argsort(edge, kind="stable")
    edges, first, count = np.unique(edge[order], return_index=True, return_counts=True)
    made = curves.copy()
    seams = np.zeros(len(edges), dtype=bool)
    twice = count == 2
    seams[twice] = on[order[first[twice]]] == on[order[first[twice] + 1]]
    for kind, some in (("SURFACE", ~seams), ("SEAM", seams)):
        for size in (1, 2):
            which = np.flatnonzero(some & (count == size))
            own = numbers[order[first[which, np.newaxis] + np.arange(size)]]
            if len(which):
                made[edges[which]] = text.table(f"{kind}_CURVE('',", curves[edges[which]], ",", own, ",.CURVE_3D.)")
    return made


def _parameter_curves(text: StepText, found: Sequence[Spline | ParameterLine]) -> Integers:
    made = np.zeros(len(found), dtype=np.int64)
    alike: dict[tuple[Any, ...], list[int]] = {}
    for index, one in enumerate(found):
        if isinstance(one, ParameterLine):
            made[index] = _line(text, one)
        else:
            weights = None if one.weights is None else one.weights.tobytes()
            alike.setdefault((one.degrees, one.poles.shape, one.knots, weights), []).append(index)
    for indices in alike.values():
        splines = [found[index] for index in indices]
        one = splines[0]
        assert isinstance(one, Spline)
        poles = np.stack([spline.poles for spline in splines if isinstance(spline, Spline)])
        u, v = poles.reshape(-1, 2).T
        nets = text.table("CARTESIAN_POINT('',(", u, ",", v, "))").reshape(poles.shape[:2])
        made[indices] = text.spline_table(one.degrees, nets, one.knots, one.closed, one.weights, counted=False)
    return made


def _line(text: StepText, line: ParameterLine) -> int:
    start = text.once(f"CARTESIAN_POINT('',{_pair(line.origin)})")
    way = text.once(f"DIRECTION('',{_pair(line.direction)})")
    vector = text.once(f"VECTOR('',#{way},{real(line.rate)})")
    return text.once(f"LINE('',#{start},#{vector})")


def _pair(parts: tuple[float, float]) -> str:
    return f"({','.join(real(float(part) + 0.0) for part in parts)})"

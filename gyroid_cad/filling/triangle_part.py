"""A part as closed triangles: of its B-rep, or of a file of triangles."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.choices import Kind
from gyroid_cad.common.formats import TRIANGLE_FORMATS, format_of
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.part import shapes_of, solid_names
from gyroid_cad.filling.wanted import SURFACE
from gyroid_cad.kernel.check import compound_of
from gyroid_cad.kernel.part import face_numbers, points_within, spread_points
from gyroid_cad.kernel.repair import chosen_solids
from gyroid_cad.kernel.stl import solid_triangles
from gyroid_cad.mesh.triangles.booleans import Body, united
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.repair import Hole, holes_of, mended, sound_body

__all__ = ["TrianglePart", "is_triangles", "naming_triangles", "require_brep", "triangle_part"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of what several solids hold together: less in common may be rounding, where they touch.
_SHARED = 1e-6
# What is expected at the route of exact solids, of what it has no use for.
_AT_BREP = {
    "deviation": "none at route brep, whose solids write(deviation=...) meshes",
    "repair": "none at route brep, which repairs what it can by itself",
}


# Without slots, so that what is worked out once is kept.
@dataclass(frozen=True, eq=False)
class TrianglePart:
    """A part known by its triangles.

    Attributes
    ----------
    body : Body
    remarks : tuple of str
        On what was repaired or united.
    shape : TopoDS_Shape, optional
        Of a part that has a B-rep.
    meshes : list of (vertices, triangles, faces)
        Of its solids, as :func:`solid_triangles` gives them.
    depth : callable, optional
        Depth of points below its boundary, if that is known by less than its triangles: of a core by those of its part.
    """

    body: Body
    remarks: tuple[str, ...] = ()
    shape: Any = None
    meshes: Sequence[tuple[Floats, Integers, Integers]] = ()
    depth: Callable[[Floats], Floats] | None = None

    @cached_property
    def low(self) -> Floats:
        """Lowest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[0])

    @cached_property
    def high(self) -> Floats:
        """Highest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[1])

    @cached_property
    def distances(self) -> Callable[[Floats], Floats]:
        """Distances from its boundary, below zero inside."""
        depth = self.depth
        return self.facets if depth is None else lambda points: -depth(points)

    @cached_property
    def facets(self) -> SignedDistances:
        """Its triangles, to be asked for the places on them that are nearest to points."""
        return SignedDistances(*self.body.triangles())

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        return np.asarray(self.distances(points) < 0)

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm."""
        return np.asarray(self.distances(points) <= reach)

    def points_inside(self, count: int) -> Floats:
        """Points spread at random over the inside, the same ones each time; shape (n, 3), as many as are wanted."""
        return points_within(self.low, self.high, self.contains, count)

    def surface_samples(self, spacing: float) -> tuple[Floats, Floats, float]:
        """Points on the boundary, their normals, and how far at most any place on it is from one, in mm."""
        vertices, triangles = self.body.triangles()
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        return *spread_points(a, b, c, spacing), spacing

    def bodies(self) -> list[TrianglePart]:
        """Parts of it that hang together, each by itself."""
        return [TrianglePart(piece, (), self.shape, self.meshes) for piece in self.body.pieces()]

    def facets_of(self, openings: Sequence[Any]) -> tuple[Floats, Integers]:
        """Vertices and triangles of faces of the B-rep.

        Raises
        ------
        ParameterError
        """
        numbers = face_numbers(self.shape, openings)
        counts = np.cumsum([0, *(len(vertices) for vertices, _, _ in self.meshes)])
        chosen = [
            triangles[np.isin(faces, numbers)] + first
            for (_, triangles, faces), first in zip(self.meshes, counts[:-1], strict=True)
        ]
        return np.concatenate([vertices for vertices, _, _ in self.meshes]), np.concatenate(chosen)


@contextmanager
def naming_triangles(kind: Kind, body: str = "") -> Iterator[None]:
    """Context of what is asked of the kernel: where that fails, the route that needs none of it is named.

    Parameters
    ----------
    kind : str
    body : str
        The one of several that is being filled.

    Raises
    ------
    KernelError
    """
    try:
        yield
    except KernelError as failed:
        way_out = "" if kind == SURFACE else '; route="triangles" fills it for STL, 3MF, OBJ and PLY files'
        raise KernelError(f"{body and f'{body}: '}{failed}{way_out}") from failed.__cause__


def is_triangles(given: Any) -> bool:
    """Tell whether a part is given as a file of triangles."""
    return isinstance(given, str | os.PathLike) and format_of(given) in TRIANGLE_FORMATS


def triangle_part(given: Any, solids: Sequence[str | int], deviation: float, repair: bool = False) -> TrianglePart:
    """The part that a user gives, by its triangles; solids that overlap or touch are united.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`gyroid_cad.fill`; or an STL, 3MF, OBJ or PLY file.
    solids : sequence of str or int
        Which of a B-rep's solids, if not all.
    deviation : float
        Of triangles from the faces of a B-rep, in mm.
    repair : bool
        Whether the triangles of a file may be mended.

    Raises
    ------
    ParameterError, ExportError
    """
    if is_triangles(given):
        if solid_names(solids):
            raise ParameterError("solids", solids, "none of a file of triangles, whose solids have no names")
        return TrianglePart(*_body_of_file(given, repair))
    shape = compound_of(solid for _, solid in chosen_solids(*shapes_of(given), solid_names(solids)))
    meshes = solid_triangles(shape, deviation)
    bodies: list[Body] = []
    remarks: list[str] = []
    for vertices, triangles, _ in meshes:
        # What the kernel's mesher leaves open is no fault of whoever drew the part: it is closed, and said.
        body, done = sound_body(vertices, triangles)
        body, done = (body, done) if body is not None else mended(vertices, triangles)
        if body is None:
            accepted = f"solids whose triangles close: {_said(holes_of(vertices, triangles))}"
            raise ParameterError("part", shape.ShapeType().name.removeprefix("TopAbs_").lower(), accepted)
        bodies.append(body)
        remarks += done
    whole = united(bodies)
    common = sum(body.volume for body in bodies) - whole.volume
    if common > _SHARED * whole.volume:
        remarks.append(f"{len(bodies)} solids have {common:.4g} mm3 in common: united")
    return TrianglePart(whole, tuple(remarks), shape, meshes)


def _body_of_file(path: str | os.PathLike[str], repair: bool) -> tuple[Body, tuple[str, ...]]:
    """The body that a file's triangles bound, and what was done for it."""
    try:
        vertices, triangles = read_triangles(path)
    except ParameterError as refused:
        raise ParameterError("part", str(path), refused.accepted) from None
    body, remarks = sound_body(vertices, triangles)
    if body is None and repair:
        body, remarks = mended(vertices, triangles)
    if body is None or not body.volume > 0:
        way_out = "" if repair else "; repair closes them"
        raise ParameterError("part", str(path), f"closed triangles: {_said(holes_of(vertices, triangles))}{way_out}")
    return body, remarks


def _said(holes: Sequence[Hole]) -> str:
    if not holes:
        return "these fold over onto themselves, or bound no volume"
    return (
        "there is 1 hole, " + str(holes[0]) if len(holes) == 1 else f"there are {len(holes)} holes, one of {holes[0]}"
    )


def require_brep(**given: Any) -> None:
    """Refuse what is for the route of triangles alone, if it is given.

    Raises
    ------
    ParameterError
    """
    for name, value in given.items():
        if value not in (None, False):
            raise ParameterError(name, value, _AT_BREP[name])

"""A part as closed triangles: of its B-rep, or of a file of triangles."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
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
from gyroid_cad.mesh.triangles.booleans import Body, body_of, united
from gyroid_cad.mesh.triangles.distances import SignedDistances
from gyroid_cad.mesh.triangles.files import read_triangles

__all__ = ["TrianglePart", "is_triangles", "naming_triangles", "triangle_part"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

# Of what several solids hold together: less in common may be rounding, where they touch.
_SHARED = 1e-6


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
    """

    body: Body
    remarks: tuple[str, ...] = ()
    shape: Any = None
    meshes: Sequence[tuple[Floats, Integers, Integers]] = ()

    @cached_property
    def low(self) -> Floats:
        """Lowest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[0])

    @cached_property
    def high(self) -> Floats:
        """Highest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[1])

    @cached_property
    def distances(self) -> SignedDistances:
        """Distances from its boundary, below zero inside."""
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


def triangle_part(given: Any, solids: Sequence[str | int], deviation: float) -> TrianglePart:
    """The part that a user gives, by its triangles; solids that overlap or touch are united.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`gyroid_cad.fill`; or an STL, 3MF, OBJ or PLY file.
    solids : sequence of str or int
        Which of a B-rep's solids, if not all.
    deviation : float
        Of triangles from the faces of a B-rep, in mm.

    Raises
    ------
    ParameterError, ExportError
    """
    if is_triangles(given):
        if solid_names(solids):
            raise ParameterError("solids", solids, "none of a file of triangles, whose solids have no names")
        body = body_of(*read_triangles(given))
        if body is None:
            raise ParameterError("part", str(given), "triangles that are closed")
        return TrianglePart(body)
    shape = compound_of(solid for _, solid in chosen_solids(*shapes_of(given), solid_names(solids)))
    meshes = solid_triangles(shape, deviation)
    bodies = []
    for vertices, triangles, _ in meshes:
        body = body_of(vertices, triangles)
        if body is None:
            raise ParameterError("part", given, "solids whose triangles close")
        bodies.append(body)
    whole = united(bodies)
    common = sum(body.volume for body in bodies) - whole.volume
    overlap = f"{len(bodies)} solids have {common:.4g} mm3 in common: united"
    return TrianglePart(whole, (overlap,) if common > _SHARED * whole.volume else (), shape, meshes)

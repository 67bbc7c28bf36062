"""A part as closed triangles: of its B-rep, or of a file of triangles."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.choices import Kind
from gyroid_cad.common.formats import TRIANGLE_FORMATS, format_of
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.part import shape_of
from gyroid_cad.filling.wanted import SURFACE
from gyroid_cad.kernel.part_triangles import solid_triangles
from gyroid_cad.mesh.triangles.booleans import Body, body_of, united
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import SignedDistances

__all__ = ["TrianglePart", "is_triangles", "naming_triangles", "triangle_part"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]


# Without slots, so that what is worked out once is kept.
@dataclass(frozen=True, eq=False)
class TrianglePart:
    """A part known by its triangles.

    Attributes
    ----------
    body : Body
    repairs : tuple of str
        That its triangles needed.
    """

    body: Body
    repairs: tuple[str, ...] = ()

    @property
    def low(self) -> Floats:
        """Lowest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[0])

    @property
    def high(self) -> Floats:
        """Highest corner of the box round it, in mm; shape (3,)."""
        return np.asarray(self.body.bounds[1])

    @property
    def volume(self) -> float:
        """In mm3."""
        return self.body.volume

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""
        return np.asarray(self._distances(points) < 0)

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm."""
        return np.asarray(self._distances(points) <= reach)

    @cached_property
    def _distances(self) -> SignedDistances:
        return SignedDistances(*self.body.triangles())


@contextmanager
def naming_triangles(kind: Kind) -> Iterator[None]:
    """Context of what is asked of the kernel: where that fails, the route that needs none of it is named.

    Raises
    ------
    KernelError
    """
    try:
        yield
    except KernelError as failed:
        if kind == SURFACE:
            raise
        raise KernelError(f'{failed}; route="triangles" fills it for STL, 3MF, OBJ and PLY files') from failed


def is_triangles(given: Any) -> bool:
    """Tell whether a part is given as a file of triangles."""
    return isinstance(given, str | os.PathLike) and format_of(given) in TRIANGLE_FORMATS


def triangle_part(given: Any, deviation: float) -> TrianglePart:
    """The part that a user gives, by its triangles.

    Parameters
    ----------
    given : shape, Workplane or path-like
        As of :func:`fill`; or an STL or 3MF file.
    deviation : float
        Of triangles from the faces of a B-rep, in mm.

    Raises
    ------
    ParameterError, ExportError
    """
    if is_triangles(given):
        body = body_of(*read_triangles(given))
        if body is None:
            raise ParameterError("part", str(given), "triangles that are closed")
        return TrianglePart(body)
    bodies = []
    for vertices, triangles, _ in solid_triangles(shape_of(given), deviation):
        body = body_of(vertices, triangles)
        if body is None:
            raise ParameterError("part", given, "solids whose triangles close")
        bodies.append(body)
    return TrianglePart(united(bodies))

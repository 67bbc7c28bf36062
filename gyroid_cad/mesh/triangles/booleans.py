"""Bodies bounded by triangles, united, intersected and subtracted (manifold3d).

The library's booleans give a closed, oriented manifold whatever they are given that is one, and compare coordinates
symbolically, without a tolerance: E. Lalish, Manifold, https://github.com/elalish/manifold, after J. M. Smith and
N. A. Dodgson, A topologically robust algorithm for Boolean operations on polyhedral shapes, CAD 39 (2007).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from manifold3d import Error, Manifold, Mesh64, OpType
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot

__all__ = ["Body", "body_of", "united"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_ASKEW = np.array([0.5257, 0.3161, 0.7898])


# Without slots, so that what is measured once is kept.
@dataclass(frozen=True, eq=False)
class Body:
    """Space inside closed triangles, in one piece or several.

    Attributes
    ----------
    manifold : Manifold
        The library's own.

    Examples
    --------
    >>> cube = Body(Manifold.cube((2, 2, 2)))
    >>> corner = cube.moved(np.ones(3))
    >>> (cube & corner).volume, (cube - corner).volume, (cube | corner).volume
    (1.0, 7.0, 15.0)
    """

    manifold: Manifold

    def __and__(self, other: Body) -> Body:
        return Body(self.manifold ^ other.manifold)

    def __or__(self, other: Body) -> Body:
        return Body(self.manifold + other.manifold)

    def __sub__(self, other: Body) -> Body:
        return Body(self.manifold - other.manifold)

    @cached_property
    def volume(self) -> float:
        """In mm3."""
        return float(self.manifold.volume())

    @cached_property
    def area(self) -> float:
        """In mm2."""
        return float(self.manifold.surface_area())

    @property
    def triangle_count(self) -> int:
        return int(self.manifold.num_tri())

    @property
    def empty(self) -> bool:
        return bool(self.manifold.is_empty())

    @property
    def bounds(self) -> Floats:
        """Lowest and highest corner of the box round it, in mm; shape (2, 3)."""
        return np.array(self.manifold.bounding_box()).reshape(2, 3)

    @property
    def centre(self) -> Floats:
        """Centre of mass, in mm, by the tetrahedra from the origin to the triangles; shape (3,)."""
        vertices, triangles = self.triangles()
        a, b, c = np.moveaxis(vertices[triangles], 1, 0)
        weights = dot(a, np.cross(b, c))
        return np.asarray(((a + b + c) * weights[:, np.newaxis]).sum(axis=0) / (4 * weights.sum()))

    def pieces(self) -> list[Body]:
        """Bodies that no edge joins, each with the voids in it, the largest first.

        >>> cube = Body(Manifold.cube((2, 2, 2)))
        >>> hollow = cube - Body(Manifold.cube((1, 1, 1))).moved(np.full(3, 0.5))
        >>> [(round(piece.volume, 9), piece.void_count) for piece in (hollow | cube.moved(np.full(3, 5.0))).pieces()]
        [(8.0, 0), (7.0, 1)]
        """
        return [self] if len(self._shells[0]) == 1 else self._pieces(0.0, 0.0)

    def without_films(self, least_solid: float, least_void: float) -> Body:
        """The body without pieces below a volume in mm3, and with voids below another filled in which nothing lies.

        >>> cube = Body(Manifold.cube((2, 2, 2)))
        >>> hollow = cube - Body(Manifold.cube((1, 1, 1))).moved(np.full(3, 0.5))
        >>> [round(hollow.without_films(0.1, least).volume, 9) for least in (0.5, 2.0)]
        [7.0, 8.0]
        """
        solid, voids = self._shells
        small = any(shell.volume() < least_solid for shell in solid) or any(
            -void.volume() < least_void for void in voids
        )
        return united(self._pieces(least_solid, least_void)) if small else self

    def _pieces(self, least_solid: float, least_void: float) -> list[Body]:
        """Pieces and voids in them of some volume, the largest piece first."""
        solid, voids = self._shells
        solid = [shell for shell in solid if shell.volume() >= least_solid]
        # What the library decomposes are shells. The whole within one would have what lies in its voids as well.
        holes: list[list[Body]] = [[] for _ in solid]
        for void in voids:
            if -void.volume() >= least_void or any(_lies_in(shell, void) for shell in solid):
                holes[_smallest_round(void, solid)].append(Body(void).inside_out())
        found = [Body(shell) - united(some) if some else Body(shell) for shell, some in zip(solid, holes, strict=True)]
        return sorted(found, key=lambda piece: -piece.volume)

    @property
    def void_count(self) -> int:
        """Count of the voids that no way leads out of."""
        return len(self._shells[1])

    def shells(self) -> tuple[list[Body], list[Body]]:
        """Boundaries from outside, and those of voids that no way leads out of, whose volumes are below zero."""
        solid, voids = ([Body(shell) for shell in some] for some in self._shells)
        return solid, voids

    def inside_out(self) -> Body:
        """The body that the same triangles bound, seen from the other side."""
        vertices, triangles = self.triangles()
        turned = body_of(vertices, triangles[:, ::-1])
        assert turned is not None
        return turned

    @cached_property
    def _shells(self) -> tuple[list[Manifold], list[Manifold]]:
        """Shells that bound solid from outside, and those that bound voids in it."""
        shells = self.manifold.decompose()
        outward = [shell.volume() > 0 for shell in shells]
        solid, voids = (
            [shell for shell, out in zip(shells, outward, strict=True) if out == side] for side in (True, False)
        )
        return solid, voids

    def triangles(self) -> tuple[Floats, Integers]:
        """Vertices in mm, shape (vertices, 3), and triangles as their numbers, shape (triangles, 3), outwards."""
        mesh = self.manifold.to_mesh64()
        vertices = np.array(mesh.vert_properties[:, :3])
        return vertices, np.asarray(mesh.tri_verts, dtype=np.int64)

    def origins(self) -> Integers:
        """Number of the body that each triangle was part of before bodies were combined; shape (triangles,).

        >>> cube, other = (body_of(*Body(Manifold.cube((2, 2, 2))).triangles()) for _ in range(2))
        >>> corner = cube - other.moved(np.ones(3))
        >>> int(np.isin(corner.origins(), cube.origins()).sum()), int(np.isin(corner.origins(), other.origins()).sum())
        (18, 6)
        """
        mesh = self.manifold.to_mesh64()
        return np.repeat(np.asarray(mesh.run_original_id, dtype=np.int64), np.diff(mesh.run_index) // 3)

    def tolerant(self, tolerance: float) -> Body:
        """The body, whose cuts are simplified as they are made: vertices may go that no more than a tolerance tells.

        That takes no time, where simplifying what came out does.

        Parameters
        ----------
        tolerance : float
            In mm.

        Examples
        --------
        >>> cube = Body(Manifold.cube((2, 2, 2)))
        >>> dent = cube.moved(np.array([1.0, 1.0, 1.99]))
        >>> (cube - dent).triangle_count > (cube.tolerant(0.1) - dent).triangle_count
        True
        """
        return Body(self.manifold.set_tolerance(tolerance))

    def moved(self, shift: Floats) -> Body:
        """The body, translated by a vector in mm."""
        return Body(self.manifold.translate(np.asarray(shift, dtype=float).tolist()))


def body_of(vertices: NDArray[np.floating], triangles: NDArray[np.integer]) -> Body | None:
    """The body that triangles bound; None if they are not closed, not oriented, or no manifold.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.

    Examples
    --------
    >>> vertices, triangles = Body(Manifold.cube((1, 1, 1))).triangles()
    >>> body_of(vertices, triangles).volume, body_of(vertices, triangles[1:])
    (1.0, None)
    """
    points = np.array(vertices, dtype=np.float64, order="C")
    manifold = Manifold(Mesh64(points, np.array(triangles, dtype=np.uint64, order="C")))
    return Body(manifold) if manifold.status() == Error.NoError else None


def united(bodies: Iterable[Body]) -> Body:
    """All bodies together.

    Examples
    --------
    >>> cube = Body(Manifold.cube((2, 2, 2)))
    >>> united([cube, cube.moved(np.ones(3)), cube.moved(np.full(3, 5.0))]).volume
    23.0
    """
    return Body(Manifold.batch_boolean([body.manifold for body in bodies], OpType.Add))


def _lies_in(inner: Manifold, outer: Manifold) -> bool:
    """Tell whether one's box lies in the other's."""
    (low, high), (least, most) = (np.array(one.bounding_box()).reshape(2, 3) for one in (inner, outer))
    return bool(np.all(low >= least) and np.all(high <= most))


def _smallest_round(void: Manifold, shells: Sequence[Manifold]) -> int:
    """Number of the smallest shell that goes round a void, by how often a ray from it crosses each."""
    start = np.array(void.to_mesh64().vert_properties[0, :3])
    found, least = 0, np.inf
    for index, shell in enumerate(shells):
        if not _lies_in(void, shell) or shell.volume() >= least:
            continue
        box = np.array(shell.bounding_box()).reshape(2, 3)
        # A direction that no flat face of a part is likely to lie along.
        beyond = start + np.linalg.norm(box[1] - box[0]) * 1.5 * _ASKEW
        if len(shell.ray_cast(start.tolist(), beyond.tolist())) % 2:
            found, least = index, shell.volume()
    return found

"""Corners of triangles: where they are, in single precision, and how they are numbered.

STL knows nothing but single-precision coordinates, so places that patches share must come out of one computation: fans
and edges are evaluated on the first patch they belong to, and moved where that patch stands. Places are evaluated in
double precision; only the translation is added in single, for speed: it costs a last digit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.mesh.triangles.measuring import canonical_edges
from gyroid_cad.mesh.triangles.templates import Template, face_template, wall_template
from gyroid_cad.mesh.triangles.triangulation import Triangulation
from gyroid_cad.nurbs.basis import images, rational_basis
from gyroid_cad.nurbs.surface import edge_row

__all__ = ["Corners", "FaceGroup", "face_groups", "indexed_triangles", "side_groups"]

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class FaceGroup:
    """Patches cut alike.

    Attributes
    ----------
    template : Template
    steps : int
    edge_steps : tuple of int
    alike : bool
        Whether the patches differ by translations only.
    patches : ndarray of int
    """

    template: Template
    steps: int
    edge_steps: tuple[int, int, int, int]
    alike: bool
    patches: Integers

    @property
    def triangles(self) -> Integers:
        """Triangles of both faces, oriented outwards, in the corners of face 0, then 1; shape (triangles, 3)."""
        below, above = self.template.triangles[:, ::-1], self.template.triangles + len(self.template.places)
        return np.concatenate([below, above])


def face_groups(triangulation: Triangulation) -> Iterator[FaceGroup]:
    """All patches, by their templates, and by their nets where several patches share one."""
    wall = triangulation.wall
    alike = len(wall.nets) < wall.complex.patch_count
    nets = wall.patch_net if alike else np.zeros_like(wall.patch_net)
    keys = np.column_stack(
        [triangulation.patch_steps, triangulation.edge_steps[wall.complex.patch_edges], nets],
    )
    distinct, which = np.unique(keys, axis=0, return_inverse=True)
    order = np.argsort(which.ravel(), kind="stable")
    ends = np.cumsum(np.bincount(which.ravel()))
    for (steps, a, b, c, d, _), patches in zip(distinct.tolist(), np.split(order, ends[:-1]), strict=True):
        yield FaceGroup(face_template(steps, (a, b, c, d)), steps, (a, b, c, d), alike, patches)


def side_groups(triangulation: Triangulation) -> Iterator[tuple[Template, Integers]]:
    """All boundary edges by their steps, with the template of their side walls."""
    free = np.flatnonzero(triangulation.wall.complex.free)
    steps = triangulation.edge_steps[free]
    for along in np.unique(steps).tolist():
        yield wall_template(along, triangulation.across), free[steps == along]


class Corners:
    """Coordinates of a triangulation's corners, in mm, in single precision: x, y, z and a zero.

    For what is gathered of them: sixteen bytes at a time go four times as quick as twelve.

    Parameters
    ----------
    triangulation : Triangulation
    """

    def __init__(self, triangulation: Triangulation) -> None:
        self._triangulation = triangulation
        self._wall = triangulation.wall
        patches, self._edge_rows = canonical_edges(self._wall, np.arange(self._wall.complex.edge_count))
        self._edge_shift = self._wall.patch_shift[patches]
        self._edge_forward = self._wall.complex.edge_forward[patches, self._edge_rows % 4]
        self._shifts = _four_wide(self._wall.shifts)
        self._fans = _four_wide(self._placed_fans())
        # By steps: places along edges, and what gives those inside patches.
        self._tables: dict[int, tuple[Integers, Singles]] = {}
        self._matrices: dict[int, Floats] = {}

    def of_faces(self, group: FaceGroup) -> Callable[[Integers], Singles]:
        """Function from some patches of a group to the corners of both their faces, shape (patches, 2, places, 4)."""
        wall, complex = self._wall, self._wall.complex
        first = sum(group.edge_steps)
        if group.steps not in self._matrices:
            self._matrices[group.steps] = rational_basis(
                wall.weights, (wall.knots, wall.knots), group.template.places[first:]
            )[0]
        matrix = self._matrices[group.steps]

        def inside(patches: Integers) -> Singles:
            controls = wall.nets[wall.patch_net[patches]].reshape(len(patches), 2, -1, 3)
            # Both faces in one product.
            places = images(matrix, np.moveaxis(controls, 1, 2).reshape(len(patches), -1, 6))
            places = np.moveaxis(places.reshape(len(patches), -1, 2, 3), 2, 1)
            return _four_wide(places).reshape(len(patches), 2, -1)

        # Of patches that differ by translations one is evaluated.
        once = inside(group.patches[:1]) if group.alike else None

        def placed(patches: Integers) -> Singles:
            corners = np.empty((len(patches), 2, len(group.template.places), 4), dtype=np.float32)
            corners[:, :, :4] = self._fans[complex.patch_fans[patches]].transpose(0, 2, 1, 3)
            start = 4
            for k, steps in enumerate(group.edge_steps):
                edges, forward = complex.patch_edges[patches, k], complex.edge_forward[patches, k]
                corners[:, :, start : start + steps - 1] = self._between(edges, steps, forward)
                start += steps - 1
            # Coordinates in one row, for short rows are slow to add to.
            shifts = np.tile(self._shifts[wall.patch_shift[patches], np.newaxis], len(matrix))
            rows = corners.reshape(len(patches), 2, -1)[:, :, 4 * first :]
            np.add(inside(patches) if once is None else once, shifts, out=rows)
            return corners

        return placed

    def of_side_walls(self, edges: Integers, steps: int) -> Singles:
        """Corners of side walls, along the edge as its patch runs and then across; shape (edges, places, 4)."""
        complex, across = self._wall.complex, self._triangulation.across
        patches, rows = complex.edge_patches[edges, 0], self._edge_rows[edges]
        forward = complex.edge_forward[patches, rows % 4]
        rails = np.empty((len(edges), 2, steps + 1, 4), dtype=np.float32)
        for end, k in ((0, rows % 4), (-1, (rows + 1) % 4)):
            rails[:, :, end] = self._fans[complex.patch_fans[patches, k]]
        rails[:, :, 1:-1] = self._between(edges, steps, forward)
        v = np.linspace(0, 1, across + 1)[:, np.newaxis]
        corners = np.empty((len(edges), steps + 1, across + 1, 4), dtype=np.float32)
        # Two fans' ends of one line through the wall are worked out from the same two places: to the last digit alike.
        below, above = rails[:, 0, :, np.newaxis].astype(float), rails[:, 1, :, np.newaxis].astype(float)
        corners[:] = (1 - v) * below + v * above
        return corners.reshape(len(edges), -1, 4)

    def _between(self, edges: Integers, steps: int, forward: NDArray[np.bool_]) -> Singles:
        """Corners along edges between their ends, on both faces, as the edge runs or against it."""
        if steps not in self._tables:
            self._tables[steps] = self._evaluated_edges(steps)
        rows, table = self._tables[steps]
        where = np.searchsorted(rows, self._edge_rows[edges])
        backward = (forward != self._edge_forward[edges]).astype(np.int64)
        placed: Singles = table[backward, where]
        placed += self._shifts[self._edge_shift[edges]][:, np.newaxis, np.newaxis]
        return placed

    def _evaluated_edges(self, steps: int) -> tuple[Integers, Singles]:
        """Distinct edges with so many steps, sorted, and the places between their ends.

        Shape of these (2, edges, 2, places, 4): as the first patch of the edge runs and backwards; both faces.
        """
        rows = np.unique(self._edge_rows[self._triangulation.edge_steps == steps])
        table = np.empty((len(rows), 2, steps - 1, 3))
        places = np.linspace(-1, 1, steps + 1)[1:-1, np.newaxis]
        for k in range(4):
            some = np.flatnonzero(rows % 4 == k)
            nets = self._wall.nets[rows[some] // 4].transpose(2, 3, 0, 1, 4)
            # Knots are symmetric: an edge run backwards has the same functions.
            functions = rational_basis(edge_row(self._wall.weights, k), (self._wall.knots,), places)[0]
            table[some] = np.einsum("pn,ngsc->gspc", functions, edge_row(nets, k))
        return rows, _four_wide(np.stack([table, table[:, :, ::-1]]))

    def _placed_fans(self) -> Floats:
        """Corners at fans on both faces, moved into their own patches where fans coincide; shape (fans, 2, 3)."""
        wall, complex = self._wall, self._wall.complex
        where = np.empty(complex.fan_count, dtype=np.int64)
        where[complex.patch_fans.ravel()] = np.arange(complex.patch_fans.size)
        patches, corners = np.divmod(where, 4)
        ends = wall.nets[:, :, [0, -1, -1, 0], [0, 0, -1, -1]]
        shifts = wall.shifts[wall.patch_shift]
        fans = ends[wall.patch_net[patches], :, corners] + shifts[patches][:, np.newaxis]
        alone = np.bincount(complex.fan_corner)[complex.fan_corner] == 1
        if not np.all(alone):
            centres = ends.mean(axis=(1, 2))[wall.patch_net] + shifts
            inward = np.zeros((complex.fan_count, 3))
            for k in range(4):
                np.add.at(inward, complex.patch_fans[:, k], centres)
            count = np.bincount(complex.patch_fans.ravel())[:, np.newaxis]
            inward = (inward / count - fans.mean(axis=1))[~alone]
            inward *= self._triangulation.parting / np.linalg.norm(inward, axis=1, keepdims=True)
            fans[~alone] += inward[:, np.newaxis]
        return fans


def indexed_triangles(triangulation: Triangulation) -> tuple[Singles, NDArray[np.int32]]:
    """All corners once, in mm, and the triangles as their numbers, oriented outwards.

    The numbers come from the complex; nothing is merged by distance.

    Returns
    -------
    vertices : ndarray of float32, shape (vertices, 3)
    triangles : ndarray of int32, shape (triangles, 3)
    """
    corners, numbers = Corners(triangulation), _Numbers(triangulation)
    vertices = np.empty((numbers.count, 3), dtype=np.float32)
    triangles = np.empty((triangulation.triangle_count, 3), dtype=np.int32)
    written = 0
    for group in face_groups(triangulation):
        places = numbers.of_faces(group)
        vertices[places] = corners.of_faces(group)(group.patches)[..., :3].reshape(*places.shape, 3)
        some = places[:, group.triangles].reshape(-1, 3)
        triangles[written : written + len(some)] = some
        written += len(some)
    for template, edges in side_groups(triangulation):
        steps = len(template.places) // (triangulation.across + 1) - 1
        places = numbers.of_side_walls(edges, steps)
        vertices[places] = corners.of_side_walls(edges, steps)[..., :3]
        some = places[:, template.triangles].reshape(-1, 3)
        triangles[written : written + len(some)] = some
        written += len(some)
    return vertices, triangles


class _Numbers:
    """Numbers of the corners: fans, edges and insides of face 0, the same of face 1, then those through the wall."""

    def __init__(self, triangulation: Triangulation) -> None:
        self._complex = complex = triangulation.wall.complex
        self._across = triangulation.across
        between, inside = triangulation.edge_steps - 1, (triangulation.patch_steps - 1) ** 2
        self._on_edges = complex.fan_count + _starts(between)
        self._inside = complex.fan_count + int(between.sum()) + _starts(inside)
        self._face = complex.fan_count + int(between.sum() + inside.sum())
        # Through the wall: at every fan on the border, then along every boundary edge.
        within = self._across - 1
        border = complex.border_fans
        self._at_fans = 2 * self._face + _starts(border * within)
        through = complex.free * between * within
        self._along = 2 * self._face + int(border.sum()) * within + _starts(through)
        self.count = 2 * self._face + int(border.sum()) * within + int(through.sum())

    def of_faces(self, group: FaceGroup) -> Integers:
        """Shape (patches, 2 places): of face 0, then of face 1."""
        complex, patches = self._complex, group.patches
        parts = [complex.patch_fans[patches]]
        for k, steps in enumerate(group.edge_steps):
            parts.append(self._between(complex.patch_edges[patches, k], steps, complex.edge_forward[patches, k]))
        parts.append(self._inside[patches, np.newaxis] + np.arange((group.steps - 1) ** 2))
        numbers = np.concatenate(parts, axis=1)
        return np.concatenate([numbers, numbers + self._face], axis=1)

    def of_side_walls(self, edges: Integers, steps: int) -> Integers:
        """Shape (edges, places)."""
        complex, within = self._complex, self._across - 1
        patches = complex.edge_patches[edges, 0]
        k = np.argmax(complex.patch_edges[patches] == edges[:, np.newaxis], axis=1)
        numbers = np.empty((len(edges), steps + 1, self._across + 1), dtype=np.int64)
        ends = [complex.patch_fans[patches, k], complex.patch_fans[patches, (k + 1) % 4]]
        numbers[:, [0, -1], 0] = np.stack(ends, axis=1)
        numbers[:, 1:-1, 0] = self._between(edges, steps, complex.edge_forward[patches, k])
        numbers[:, :, -1] = numbers[:, :, 0] + self._face
        for end, fans in zip((0, -1), ends, strict=True):
            numbers[:, end, 1:-1] = self._at_fans[fans, np.newaxis] + np.arange(within)
        own = np.arange((steps - 1) * within).reshape(steps - 1, within)
        numbers[:, 1:-1, 1:-1] = self._along[edges, np.newaxis, np.newaxis] + own
        return numbers.reshape(len(edges), -1)

    def _between(self, edges: Integers, steps: int, forward: NDArray[np.bool_]) -> Integers:
        along = np.arange(steps - 1)
        run = np.where(forward[:, np.newaxis], along, steps - 2 - along)
        return np.asarray(self._on_edges[edges, np.newaxis] + run)


def _four_wide(places: Floats) -> Singles:
    """Coordinates in single precision, with a zero behind."""
    wide = np.zeros((*places.shape[:-1], 4), dtype=np.float32)
    wide[..., :3] = places
    return wide


def _starts(counts: Integers) -> Integers:
    return np.concatenate([[0], np.cumsum(counts)[:-1]])

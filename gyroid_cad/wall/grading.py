"""Grading of a lattice: its wall, cell size, and the space it is carried to.

All fields are functions of the place in the lattice's own flat space, in mm, before any map. First the scale field
s carries a point p to s(p) p, the paper's variable bounding-cell length; then the map of space carries on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import cross
from gyroid_cad.errors import SelfIntersectionError
from gyroid_cad.fields.field import Field, evaluated, given_as
from gyroid_cad.maps.space import OPEN, SpaceMap, carried, differences
from gyroid_cad.surface.families import USUAL, MinimalSurface

__all__ = ["LARGEST_CELL", "SMALLEST_CELL", "THINNEST_WALL", "Extent", "Grading", "WallPoints"]

Floats = NDArray[np.float64]
Booleans = NDArray[np.bool_]
Integers = NDArray[np.int64]

# Of differences, in cell sizes: their error, about its square, is far below any fit's; the rounding they amplify, which
# neighbouring patches do not share, stays near 1e-12.
_STEP = 2e-4
# In mm. The kernel takes lengths under 1e-7 mm for nothing; this keeps every wall well above.
THINNEST_WALL = 1e-4
# In mm, before and after a scale. The kernel takes lengths under 1e-7 mm for nothing; these keep every edge well above.
SMALLEST_CELL, LARGEST_CELL = 1e-2, 1e5
# How far below zero a wall goes on beyond the part as it comes, and how far then at most, in parts of the thickest, or
# densest, there may be.
_AS_IT_COMES, _AT_MOST = 0.1, 0.4


class Extent(Protocol):
    """Space that is to be filled."""

    def contains(self, points: Floats) -> Booleans:
        """Mask of the points, shape (n, 3), that lie inside; shape (n,)."""

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        """Mask of the points that lie inside or within a reach of it, in mm; it may hold some a little further off."""


# Of places that may or may not be wanted, so many are asked for at first.
_ASKED_FIRST = 256


@dataclass(frozen=True, slots=True)
class WallPoints:
    """The mid-surface where it is wanted.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        In mm.
    normals : ndarray, shape (n, 3)
        Unit normals of the mapped surface.
    thickness : ndarray, shape (n,)
        Whole wall in mm.
    """

    points: Floats
    normals: Floats
    thickness: Floats


@dataclass(frozen=True, slots=True)
class Grading:
    """Grading of the wall and the space.

    Attributes
    ----------
    cell_size : float
        Period of the lattice before any map, in mm.
    thickness : float or Field, optional
        Whole wall in mm.
    density : float or Field, optional
        Volume fraction instead of thickness.
    scale_field : float or Field, optional
        Factor on the position, without unit.
    map : SpaceMap, optional
    surface : MinimalSurface
        Whose tube formula it goes by.
    extent : Extent, optional
        Where the wall is wanted, in the lattice's own flat space; everywhere if left out. Beyond, what is asked for
        goes on as it comes, be it below zero, so that patches which reach out of the extent are smooth all over.
    """

    cell_size: float
    thickness: float | Field | None = None
    density: float | Field | None = None
    scale_field: float | Field | None = None
    map: SpaceMap | None = None
    surface: MinimalSurface = USUAL
    extent: Extent | None = None

    @property
    def uniform(self) -> bool:
        """True where every cell is like every other: a constant wall in flat space."""
        return not isinstance(self.thickness, Field | None) and self.scale_field is None and self.map is None

    @property
    def cells_alike(self) -> bool:
        """True where every cell has the size and shape of every other, whatever its wall."""
        return self.scale_field is None and self.map is None

    @property
    def map_closes(self) -> tuple[bool, bool, bool]:
        """Along which axes the map would join the ends of a block."""
        return OPEN if self.map is None else self.map.closed

    @property
    def closed(self) -> tuple[bool, bool, bool]:
        """Along which axes the block's ends are joined; a scale would part them again."""
        return OPEN if self.scale_field is not None else self.map_closes

    def lay(self, points: Floats, normals: Floats) -> WallPoints:
        """Carry points of the mid-surface and their normals to where they are wanted.

        Parameters
        ----------
        points, normals : ndarray, shape (n, 3)
            In the lattice's own space; points in mm, unit normals.

        Returns
        -------
        WallPoints

        Raises
        ------
        ParameterError
            If a field or the map gives something else than finite real numbers.
        SelfIntersectionError
            If the map turns space inside out, or a thickness or density is outside its range.
        """
        images, jacobian, determinant = self.carry(points)
        if jacobian is None:
            return WallPoints(points, normals, self._thickness(points, 1.0))
        turned = _turned(jacobian, np.ascontiguousarray(normals.T))
        growth = np.sqrt(np.sum(turned * turned, axis=0))
        return WallPoints(images.T, (turned / growth).T, self._thickness(points, determinant / growth))

    def carry(self, points: Floats) -> tuple[Floats, Floats | None, Floats | float]:
        """Images of points, and the Jacobian and its determinant there, component first.

        Parameters
        ----------
        points : ndarray, shape (n, 3)

        Returns
        -------
        images : ndarray, shape (3, n)
        jacobian : ndarray, shape (3, 3, n)
            None in flat space.
        determinant : ndarray, shape (n,)
            1 in flat space.

        Raises
        ------
        ParameterError
        SelfIntersectionError
            If the determinant is not positive everywhere.
        """
        images = np.ascontiguousarray(points.T)
        jacobian: Floats | None = None
        determinant: Floats | float = 1.0
        if self.scale_field is not None:
            name = given_as("scale_field", self.scale_field)
            images, jacobian = self._scaled(images, checked=True)
            determinant = _positive_determinant(name, jacobian, points)
        if self.map is not None:
            images, onward = carried("map", self.map, images, _STEP * self.cell_size)
            determinant = determinant * _positive_determinant("map", onward, points)
            jacobian = onward if jacobian is None else np.einsum("ijn,jkn->ikn", onward, jacobian)
        return images, jacobian, determinant

    def image(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Carry points as :meth:`carry` does, wherever they are and whatever becomes of space there.

        Parameters
        ----------
        points : ndarray, shape (n, 3)

        Returns
        -------
        scaled : ndarray, shape (n, 3)
            Before the map.
        images : ndarray, shape (n, 3)
        jacobian : ndarray, shape (n, 3, 3)

        Raises
        ------
        ParameterError
            If a field or the map gives no finite numbers.
        """
        scaled = np.ascontiguousarray(points.T)
        jacobian = np.tile(np.eye(3)[..., np.newaxis], (1, 1, len(points)))
        if self.scale_field is not None:
            scaled, jacobian = self._scaled(scaled)
        images = scaled
        if self.map is not None:
            images, onward = carried("map", self.map, scaled, _STEP * self.cell_size)
            jacobian = np.einsum("ijn,jkn->ikn", onward, jacobian)
        return scaled.T, images.T, np.moveaxis(jacobian, -1, 0)

    def _scaled(self, places: Floats, checked: bool = False) -> tuple[Floats, Floats]:
        """p -> s(p) p, whose Jacobian is s I + p (grad s)^T."""

        name = given_as("scale_field", self.scale_field)

        def scale(points: Floats) -> Floats:
            return _values(name, self.scale_field, points.T)

        factor = scale(places)
        if checked:
            _require(name, factor, places.T, 0.0, "above", "everywhere in the lattice")
            self._require_scaled_cells(name, factor, places.T)
        slope = differences(scale, places, _STEP * self.cell_size)
        jacobian = places[:, np.newaxis] * slope
        for axis in range(3):
            jacobian[axis, axis] += factor
        return factor * places, jacobian

    def _require_scaled_cells(self, name: str, factor: Floats, points: Floats) -> None:
        least, most = SMALLEST_CELL / self.cell_size, LARGEST_CELL / self.cell_size
        worst = int(np.argmax(factor))
        if factor[worst] > most:
            reason = f"where cells are {LARGEST_CELL:g} mm large"
            raise SelfIntersectionError(name, float(factor[worst]), _place(points, worst), most, reason, "at most")
        _require(name, factor, points, least, "at least", f"where cells are {SMALLEST_CELL:g} mm small")

    def requested(self, points: Floats) -> Floats:
        """The thickness in mm, or the density, asked for at points of the lattice's own space; shape (n,).

        Raises
        ------
        ParameterError
        SelfIntersectionError
            If it is not positive wherever the wall is wanted, or a density past the largest.
        """
        value = self.thickness if self.density is None else self.density
        parameter = given_as("thickness" if self.density is None else "density", value)
        values = _values(parameter, value, points)
        tube = self.surface.tube
        if self.density is None:
            low = self._wanted(values < THINNEST_WALL, points)
            _require(parameter, values[low], points[low], THINNEST_WALL, "at least", "the thinnest wall", unit=" mm")
            return self._going_on(values, tube.max_thickness * self.cell_size)
        low = self._wanted(values <= 0, points)
        _require(parameter, values[low], points[low], 0.0, "above", "everywhere in the lattice")
        # A wall beyond the extent may still come into it.
        high = self._wanted(values >= tube.max_density, points, tube.max_thickness / 2 * self.cell_size)
        if len(high):
            worst = int(high[np.argmax(values[high])])
            reason = "the density at which the wall meets itself"
            raise SelfIntersectionError(
                parameter, float(values[worst]), _place(points, worst), tube.max_density, reason
            )
        return self._going_on(values, tube.max_density)

    def wanted(self, bad: Booleans, points: Floats, reach: Floats | float = 0.0) -> Booleans:
        """Mask of those bad places at which a wall that reaches so far, in mm, is wanted; shape (n,).

        Parameters
        ----------
        bad : ndarray of bool, shape (n,)
        points : ndarray, shape (n, 3)
            In the lattice's own flat space.
        reach : float or ndarray, shape (n,)
            Nothing by itself: then places are told closely, else the extent may seem a little larger.
        """
        found = bad.copy()
        if self.extent is not None and bad.any():
            if np.ndim(reach):
                found[bad] = self.extent.near(points[bad], np.asarray(reach)[bad])
            else:
                found[bad] = self.extent.near(points[bad], reach) if reach else self.extent.contains(points[bad])
        return found

    def extremes(self, fitted: WallPoints, thinnest: float, thickest: float) -> tuple[float, float]:
        """The thinnest and the thickest wall so far, in mm, and at more points where it is wanted."""
        points, thickness = fitted.points, fitted.thickness
        return -self.largest(-thickness, -thinnest, points), self.largest(thickness, thickest, points, thickness / 2)

    def largest(self, values: Floats, so_far: float, points: Floats, reach: Floats | float = 0.0) -> float:
        """The largest of some values, and of those so far, where a wall that reaches so far is wanted.

        Parameters
        ----------
        values : ndarray, shape (n,)
        so_far : float
        points, reach
            As of :meth:`wanted`.
        """
        larger = np.flatnonzero(~(values <= so_far))
        if not len(larger):
            return so_far
        # From the largest down, for one place where it is wanted is enough.
        larger = larger[np.argsort(-values[larger], kind="stable")]
        asked, many = 0, _ASKED_FIRST
        while asked < len(larger):
            some = larger[asked : asked + many]
            reaches = np.asarray(reach)[some] if np.ndim(reach) else reach
            found = self._wanted(np.ones(len(some), dtype=bool), points[some], reaches)
            if len(found):
                return float(values[some[found[0]]])
            asked, many = asked + many, 4 * many
        return so_far

    def _wanted(self, bad: Booleans, points: Floats, reach: Floats | float = 0.0) -> Integers:
        return np.flatnonzero(self.wanted(bad, points, reach))

    def _going_on(self, values: Floats, largest: float) -> Floats:
        """The values, and beyond the extent such as are no worse than a wall that is turned inside out a little."""
        if self.extent is None:
            return values
        least, more = -_AS_IT_COMES * largest, _AT_MOST * largest
        below = least - more * np.tanh((least - np.minimum(values, least)) / more)
        return np.asarray(np.where(values < least, below, np.minimum(values, largest)))

    def _thickness(self, points: Floats, spacing: Floats | float) -> Floats:
        requested = self.requested(points)
        if self.density is None:
            return requested
        # The wall is stretched with the space across it, as if it had been mapped itself: so the volume
        # fraction is kept, to first order in the thickness, however the map stretches.
        thickness = np.asarray(self.surface.tube.thickness(requested) * self.cell_size * spacing)
        low = self._wanted(~(thickness >= THINNEST_WALL), points)
        name = given_as("density", self.density)
        _require(name, thickness[low], points[low], THINNEST_WALL, "at least", "the thinnest wall", "thickness", " mm")
        return thickness


def _values(parameter: str, value: float | Field | None, points: Floats) -> Floats:
    if isinstance(value, Field):
        return evaluated(parameter, value, points)
    assert value is not None
    return np.full(len(points), value)


def _turned(jacobian: Floats, normals: Floats) -> Floats:
    """Cofactors of the Jacobian times the normals, det(J) J^-T n: the area vector of the mapped surface."""
    x, y, z = jacobian[:, 0], jacobian[:, 1], jacobian[:, 2]
    return np.asarray(normals[0] * cross(y, z) + normals[1] * cross(z, x) + normals[2] * cross(x, y))


def _positive_determinant(parameter: str, jacobian: Floats, points: Floats) -> Floats:
    determinant = np.sum(jacobian[:, 0] * cross(jacobian[:, 1], jacobian[:, 2]), axis=0)
    reason, quantity = "where space is turned inside out", "Jacobian determinant"
    _require(parameter, determinant, points, 0.0, "above", reason, quantity)
    return np.asarray(determinant)


def _require(
    parameter: str,
    values: Floats,
    points: Floats,
    limit: float,
    accepted: str,
    reason: str,
    quantity: str = "",
    unit: str = "",
) -> None:
    """Refuse values that are not "above", or not "at least", a limit everywhere."""
    if not len(values):
        return
    worst = int(np.argmin(values))
    if not (values[worst] > limit or (accepted == "at least" and values[worst] == limit)):
        place = _place(points, worst)
        raise SelfIntersectionError(parameter, float(values[worst]), place, limit, reason, accepted, quantity, unit)


def _place(points: Floats, index: int) -> tuple[float, float, float]:
    x, y, z = points[index].tolist()
    return x, y, z

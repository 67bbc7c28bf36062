"""The patches of an endless lattice that a part needs: where they are, and which the part's boundary crosses.

Patches wholly inside or outside the part need no cutting. Those that the boundary stays clear of are connected by
their edges, and each such group is all inside or all outside: one point tells.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import three_numbers
from gyroid_cad.common.graph import connected
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.surface.families import USUAL, MinimalSurface
from gyroid_cad.surface.symmetry import CELL_QUARTERS, Placements
from gyroid_cad.wall.complex import CellComplex, build_complex
from gyroid_cad.wall.distances import nearest_offsets
from gyroid_cad.wall.exact import offset_patches, patch_points_and_normals
from gyroid_cad.wall.grading import Extent, Grading

__all__ = [
    "AT_HOME",
    "CROSSING",
    "INSIDE",
    "OUTSIDE",
    "PERTURBATIONS",
    "SIDE_SAMPLES",
    "BoxExtent",
    "Frame",
    "PlacedExtent",
    "block_extent",
    "covering_complex",
    "first_success",
    "frame_of",
    "patch_sides",
    "periodic_offsets",
    "periodic_patches",
    "placement",
    "wall_extremes",
]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Booleans = NDArray[np.bool_]

T = TypeVar("T")

OUTSIDE, CROSSING, INSIDE = -1, 0, 1
# Along each side of a patch, whose middle is among them.
SIDE_SAMPLES = 7
# Of the lattice, in cell sizes: tangent or nearly coincident faces cannot be cut; a shift that no symmetry knows parts
# them.
PERTURBATIONS = ((0.0, 0.0, 0.0), (0.0031, 0.0047, 0.0023), (-0.0053, 0.0029, 0.0071))
_OFFSET_SAMPLES = 17
# In mm: there a double's last digit is 2e-9 mm, a fiftieth of what the kernel tells apart.
FURTHEST_ORIGIN = 1e7
FULL_TURN = 360.0


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """Frame of a lattice: p -> rotation p + origin, from its own space to that of the part, or of the file.

    Attributes
    ----------
    origin : ndarray, shape (3,)
        In mm.
    rotation : ndarray, shape (3, 3)
    """

    origin: Floats
    rotation: Floats

    def own(self, points: Floats) -> Floats:
        """Points of the part's space in the lattice's own; shape (..., 3)."""
        return (points - self.origin) @ self.rotation

    def placed(self, points: Floats) -> Floats:
        """Points of the lattice's own space in the part's; shape (..., 3)."""
        return points @ self.rotation.T + self.origin

    def nearest_to(self, point: Floats, cell_size: float) -> Frame:
        """Return the frame moved by whole cells, which an endless lattice does not know, to be nearest to a point."""
        cells = np.round(self.own(point) / cell_size)
        return Frame(self.placed(cells * cell_size), self.rotation)

    def within(self, outer: Frame) -> Frame:
        """Return the frame that this one is, placed by another."""
        return Frame(outer.placed(self.origin), outer.rotation @ self.rotation)


@dataclass(frozen=True, slots=True)
class BoxExtent:
    """A box in space, along the axes.

    Attributes
    ----------
    low, high : tuple of float
        Of its corners, in mm.

    Examples
    --------
    >>> box = BoxExtent((0.0, 0.0, 0.0), (10.0, 10.0, 10.0))
    >>> box.contains(np.array([[5.0, 5.0, 5.0], [5.0, 5.0, 10.5]])).tolist()
    [True, False]
    >>> box.near(np.array([[5.0, 5.0, 10.5]]), 1.0).tolist()
    [True]
    """

    low: Point
    high: Point

    def contains(self, points: Floats) -> Booleans:
        return np.asarray(self._outside(points) < 0)

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        return np.asarray(self._outside(points) <= reach)

    def _outside(self, points: Floats) -> Floats:
        """Distance of the points beyond the side that they are furthest beyond, in mm; below 0 inside."""
        return np.asarray(np.maximum(np.array(self.low) - points, points - np.array(self.high)).max(axis=-1))


@dataclass(frozen=True, slots=True, eq=False)
class PlacedExtent:
    """An extent as it is seen from a frame of its space: asked of points of the frame's own."""

    extent: Extent
    frame: Frame

    def contains(self, points: Floats) -> Booleans:
        return self.extent.contains(self.frame.placed(points))

    def near(self, points: Floats, reach: Floats | float) -> Booleans:
        return self.extent.near(self.frame.placed(points), reach)


AT_HOME = Frame(np.zeros(3), np.eye(3))


def block_extent(cells: tuple[int, int, int], cell_size: float) -> BoxExtent:
    """A block of cells, with as much round it as :data:`PERTURBATIONS` may shift the lattice by."""
    margin = max(max(map(abs, shift)) for shift in PERTURBATIONS) * cell_size
    x, y, z = (count * cell_size + margin for count in cells)
    return BoxExtent((-margin, -margin, -margin), (x, y, z))


def placement(origin: object, rotation: object) -> tuple[Point, Point]:
    """Check where a user places a lattice: its origin in mm, and its angles about the axes in degrees.

    Raises
    ------
    ParameterError
    """
    checked = []
    for parameter, value, most, unit in (
        ("origin", origin, FURTHEST_ORIGIN, "mm"),
        ("rotation", rotation, FULL_TURN, "degrees"),
    ):
        numbers = three_numbers(parameter, value)
        if np.abs(numbers).max() > most:
            raise ParameterError(parameter, value, f"three numbers from -{most:,.0f} to {most:,.0f} {unit}")
        x, y, z = numbers.tolist()
        checked.append((x, y, z))
    return checked[0], checked[1]


def frame_of(origin: Point | Floats, rotation: Point | Floats) -> Frame:
    """Return the frame of a lattice that is turned and then moved.

    Parameters
    ----------
    origin : tuple of float
        Of the lattice, in mm.
    rotation : tuple of float
        Angles in degrees about the fixed axes x, y and z, one turn after the other.

    Examples
    --------
    >>> frame_of((1.0, 0.0, 0.0), (0.0, 0.0, 90.0)).placed(np.array([5.0, 0.0, 0.0])).round(12).tolist()
    [1.0, 5.0, 0.0]
    """
    turn = np.eye(3)
    for axis, angle in enumerate(np.radians(rotation).tolist()):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        about = np.eye(3)
        about[[i, j], [i, j]] = np.cos(angle)
        about[j, i], about[i, j] = np.sin(angle), -np.sin(angle)
        turn = about @ turn
    return Frame(np.array(origin, dtype=np.float64), turn)


def first_success(attempts: Iterable[Callable[[], T]]) -> T:
    """Return the result of the first attempt at a cut in which the kernel does not fail.

    Parameters
    ----------
    attempts : iterable of callable
        Without arguments: a cut with the lattice as it stands, and with it shifted by :data:`PERTURBATIONS`.

    Raises
    ------
    KernelError
        That of the first attempt, if all fail.
    """
    problem: KernelError | None = None
    for attempt in attempts:
        try:
            return attempt()
        except KernelError as failed:
            problem = problem or failed
    raise KernelError(f"{problem}; nor with the lattice shifted a little, twice")


def covering_complex(
    low: Floats,
    high: Floats,
    frame: Frame,
    cell_size: float,
    reach: float,
    surface: MinimalSurface = USUAL,
    extent: Extent | None = None,
) -> CellComplex:
    """All patches that come within reach of a box in the part's space, and of what is in it.

    Parameters
    ----------
    low, high : ndarray, shape (3,)
        Corners of the box, in mm.
    frame : Frame
    cell_size : float
        In mm.
    reach : float
        Half the wall or whatever else stands off the mid-surface, in mm.
    surface : MinimalSurface
    extent : Extent, optional
        Of the part, in the lattice's own space, if patches near its box alone are not wanted.
    """
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    own = frame.own(corners)
    placements = surface.cell
    margin = reach + _patch_radius(placements) * cell_size
    first = np.floor((own.min(axis=0) - margin) / cell_size).astype(np.int64) - 1
    last = np.ceil((own.max(axis=0) + margin) / cell_size).astype(np.int64) + 1
    centres = placements.translations / CELL_QUARTERS * cell_size

    def near(placement: Integers, cell: Integers) -> Booleans:
        own = centres[placement] + cell * cell_size
        places = frame.placed(own)
        in_box = np.asarray(np.all((places > low - margin) & (places < high + margin), axis=1))
        if extent is not None:
            in_box[in_box] = extent.near(own[in_box], margin)
        return in_box

    nx, ny, nz = (last - first).tolist()
    x, y, z = first.tolist()
    return build_complex((nx, ny, nz), placements, first=(x, y, z), wanted=near)


def _patch_radius(placements: Placements) -> float:
    """Radius of a patch, from its middle to its corners, which are furthest from it, in cell sizes."""
    return float(np.linalg.norm(placements.patch.corner_array, axis=1).max()) / CELL_QUARTERS


def wall_extremes(low: Floats, high: Floats, frame: Frame, grading: Grading) -> tuple[float, float]:
    """The thinnest and the thickest wall, in mm, of patches that may come near a box in the part's space.

    Where the grading has an extent, only of the places where the wall may be in it.
    """
    if grading.uniform:
        return float(grading.thickness), float(grading.thickness)  # type: ignore[arg-type]
    reach = grading.surface.tube.max_thickness / 2 * grading.cell_size
    complex = covering_complex(low, high, frame, grading.cell_size, reach, grading.surface, grading.extent)
    thinnest, thickest = np.inf, 0.0
    for _, fitted in offset_patches(complex, grading, np.linspace(-1, 1, SIDE_SAMPLES)):
        thinnest, thickest = grading.extremes(fitted, thinnest, thickest)
    return thinnest, thickest


def patch_sides(
    complex: CellComplex,
    points: Floats,
    reach: float,
    distance: Callable[[Floats], Floats],
    contains: Callable[[Floats], Booleans],
) -> Integers:
    """Sort patches by whether they lie inside a part, outside it, or may be crossed by its boundary; shape (patches,).

    Parameters
    ----------
    complex : CellComplex
    points : ndarray, shape (patches, :data:`SIDE_SAMPLES` squared, 3)
        Of the mid-surface, on a grid, in mm, in the part's space.
    reach : float
        In mm.
    distance : callable
        Of points (n, 3) in the part's space: no more than their distance from its boundary, in mm.
    contains : callable
        Which of some points lie inside the part.
    """
    # Every place of a patch is within half a step between samples, along both sides, of one of them.
    grid = points.reshape(-1, SIDE_SAMPLES, SIDE_SAMPLES, 3)
    steps = [np.linalg.norm(np.diff(grid, axis=axis), axis=-1).max() for axis in (1, 2)]
    gap = sum(steps) / 2
    middle = points[:, SIDE_SAMPLES**2 // 2]
    radius = np.linalg.norm(points - middle[:, np.newaxis], axis=-1).max(axis=1) + gap
    clear = distance(middle) > radius + reach
    near = np.flatnonzero(~clear)
    clear[near] = distance(points[near].reshape(-1, 3)).reshape(len(near), SIDE_SAMPLES**2).min(axis=1) > gap + reach
    sides = np.full(complex.patch_count, CROSSING)
    both = complex.edge_patches[~complex.free]
    both = both[clear[both].all(axis=1)]
    group = connected(complex.patch_count, both[:, 0], both[:, 1])
    groups, first = np.unique(group[clear], return_index=True)
    inside = np.zeros(complex.patch_count, dtype=bool)
    inside[groups] = contains(middle[np.flatnonzero(clear)[first]])
    sides[clear] = np.where(inside[group[clear]], INSIDE, OUTSIDE)
    return sides


def periodic_offsets(frame: Frame, cell_size: float, points: Floats, surface: MinimalSurface = USUAL) -> Floats:
    """Distance of the part's points from the endless mid-surface, along its normal, to about 1e-3 cell sizes.

    Parameters
    ----------
    frame : Frame
    cell_size : float
        In mm.
    points : ndarray, shape (n, 3)
    surface : MinimalSurface

    Returns
    -------
    ndarray, shape (n,)
        In mm; positive on the side that the common normal points to.
    """
    return _nearest_in_cell(cell_size, frame.own(points), surface)[0]


def periodic_patches(cell_size: float, points: Floats, surface: MinimalSurface = USUAL) -> tuple[Integers, Integers]:
    """Patches of the endless lattice that points of its own space are nearest to.

    Parameters
    ----------
    cell_size : float
        In mm.
    points : ndarray, shape (n, 3)
    surface : MinimalSurface

    Returns
    -------
    placements : ndarray of int, shape (n,)
    cells : ndarray of int, shape (n, 3)
    """
    _, patch, cell = _nearest_in_cell(cell_size, points, surface)
    return cell.patch_placement[patch], cell.patch_cell[patch] + np.floor(points / cell_size).astype(np.int64)


def _nearest_in_cell(cell_size: float, own: Floats, surface: MinimalSurface) -> tuple[Floats, Integers, CellComplex]:
    """Offsets of points, brought into one cell, from the patches that come near it, the nearest of these, and all."""
    cell = covering_complex(np.zeros(3), np.full(3, cell_size), AT_HOME, cell_size, 0.0, surface)
    places, normals = patch_points_and_normals(cell, cell_size, np.linspace(-1, 1, _OFFSET_SAMPLES))
    offsets, nearest = nearest_offsets(places, normals, np.mod(own, cell_size))
    return offsets, nearest // _OFFSET_SAMPLES**2, cell

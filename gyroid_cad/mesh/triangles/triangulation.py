"""The wall's surface as triangles: closed, oriented outwards, within a deviation of the wall's NURBS faces.

The lattice knows its own topology: patches share the places along their common edges and at their fans by number,
side walls share theirs with the faces. Nothing is merged by distance, and no kernel is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.triangles.measuring import face_cases, face_deviations, side_deviations, triangulated_volume
from gyroid_cad.mesh.triangles.templates import FEWEST_STEPS, Template, few_counts, wall_template
from gyroid_cad.wall.offset import Wall

__all__ = ["Subdivision", "Triangulation", "parting", "subdivided", "triangulated"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# Between the places measured a triangle may be further off: of a quadratic surface by at most 3 %.
_MARGIN = 1.05
_FIRST_STEPS = 8
# There triangles are nearer to the faces, about 1e-5 of the cell size, than the usual fit is to the exact gyroid.
MOST_STEPS = 128
# Between the deviation that would just do and the one named as possible: corners are offset, counts rounded up.
_SLACK = 1.5
# Of a side wall's deviation, what its curved edges may take; its twist takes the rest.
_SHARE_OF_EDGES = 0.5
# Counts come from floating-point roots: a whole number that came out a hair above itself is still that number.
_HAIR = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Subdivision:
    """Steps of every patch and edge, and how near their triangles come.

    Attributes
    ----------
    patch_steps : ndarray of int, shape (patches,)
        Along each side of a patch, inside it.
    edge_steps : ndarray of int, shape (edges,)
    across : int
        Of the free side walls, through the wall.
    deviation : float
        Largest measured, in mm.
    """

    patch_steps: Integers
    edge_steps: Integers
    across: int
    deviation: float

    def __post_init__(self) -> None:
        freeze_arrays(self)


def subdivided(wall: Wall, deviation: float, reserved: float = 0.0) -> Subdivision:
    """The fewest steps with which triangles that have their corners on the wall keep within a deviation.

    Parameters
    ----------
    wall : Wall
    deviation : float
        Largest distance of a triangle from the wall's faces and side walls, in mm.
    reserved : float
        What of it is not to be used, in mm.

    Raises
    ------
    ParameterError
        If a patch would take too many steps, saying which deviation would do.
    """
    limit = (deviation - reserved) / _MARGIN
    distinct = np.arange(len(wall.nets))
    first = np.column_stack([np.full((len(distinct), 5), _FIRST_STEPS), distinct])
    patch_steps = few_counts(_enough(first[:, 0], face_deviations(wall, first), limit))[wall.patch_net]
    free = np.flatnonzero(wall.complex.free)
    while True:
        _require_few(patch_steps, deviation)
        edge_steps = _steps_of_edges(wall, patch_steps)
        edge_steps[free] = few_counts(_steps_of_side_walls(wall, free, edge_steps[free], limit))
        _require_few(edge_steps, deviation)
        cases, which = face_cases(wall, patch_steps, edge_steps)
        faces = face_deviations(wall, cases)
        if faces.max() <= limit:
            break
        patch_steps = few_counts(np.maximum(patch_steps, _enough(cases[:, 0], faces, limit)[which]))
    across, sides = _through(wall, free, edge_steps[free], limit)
    return Subdivision(patch_steps, edge_steps, across, max(float(faces.max()), sides))


def _enough(steps: Integers, deviation: Floats, limit: float) -> Integers:
    """Steps that would do, from what some steps gave: the deviation goes with 1 / n^2."""
    more = np.ceil(steps * np.sqrt(deviation / limit) * (1 - _HAIR)).astype(np.int64)
    # Where they do not do yet, one more at least.
    return np.asarray(np.maximum(np.where(deviation > limit, np.maximum(more, steps + 1), more), FEWEST_STEPS))


def _require_few(steps: Integers, deviation: float) -> None:
    most = int(steps.max())
    if most > MOST_STEPS:
        possible = deviation * (most / MOST_STEPS) ** 2 * _SLACK
        raise ParameterError(
            "deviation",
            deviation,
            f"about {possible:.1e} mm or more: it takes {most} x {most} squares a patch, {MOST_STEPS} x {MOST_STEPS} "
            "are the most",
        )


def _steps_of_edges(wall: Wall, patch_steps: Integers) -> Integers:
    """Steps of every edge, the more of its two patches'."""
    steps = np.zeros(wall.complex.edge_count, dtype=np.int64)
    np.maximum.at(steps, wall.complex.patch_edges.ravel(), np.repeat(patch_steps, 4))
    return steps


def _steps_of_side_walls(wall: Wall, free: Integers, steps: Integers, limit: float) -> Integers:
    """Steps along boundary edges, raised where the lines along the side walls would take too much of the deviation."""
    while np.all(steps <= MOST_STEPS):
        deviations, which = side_deviations(wall, free, steps, _lines_along)
        enough = np.maximum(steps, _enough(steps, deviations[which], _SHARE_OF_EDGES * limit))
        if np.array_equal(enough, steps):
            break
        steps = enough
    return steps


def _through(wall: Wall, free: Integers, steps: Integers, limit: float) -> tuple[int, float]:
    """Steps through the wall with which all side walls keep within the deviation, and what it is with them."""
    across = 1
    while True:
        deviations, _ = side_deviations(wall, free, steps, lambda along: wall_template(along, across))  # noqa: B023
        worst = float(deviations.max(initial=0.0))
        if worst <= limit:
            return across, worst
        # What the twist takes falls with 1 / n; the curved edges take at most their share.
        across = max(across + 1, int(np.ceil(across * worst / limit * (1 - _HAIR))))


def _lines_along(along: int) -> Template:
    """The lines along a side wall at both its edges and half way between, without triangles."""
    full = wall_template(along, 2)
    same = full.places[full.sides[:, 0], 1] == full.places[full.sides[:, 1], 1]
    return Template(full.places, np.empty((0, 3), dtype=np.int64), full.sides[same])


# Triangles that touch in a line without belonging together are parted by so much of the deviation, but by enough
# steps of the single-precision numbers of STL and 3MF for these to tell them apart.
_PARTING, _SINGLE_PRECISION_STEPS = 1e-3, 8
# Of the secant method for the volume: each step squares what is left, and the first leaves 1e-5.
_SECANT_STEPS = 2
# A part of the thickness that changes no volume but by rounding.
_NOTHING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Triangulation:
    """Triangulation of a wall.

    Attributes
    ----------
    wall : Wall
        On whose faces the corners of all triangles lie: the wall, a little thicker, as :func:`triangulated` says.
    patch_steps : ndarray of int, shape (patches,)
        Along each side of a patch, inside it.
    edge_steps : ndarray of int, shape (edges,)
    across : int
        Steps of the free side walls, through the wall.
    deviation : float
        Largest distance of a triangle from the wall's faces, in mm, as measured.
    volume_offset : float
        In mm, how far from the wall's faces the corners lie at most.
    parting : float
        In mm, how far corners are moved where patches touch in a line without joining.
    volume : float
        That the triangles enclose, in mm3, before they are parted.
    """

    wall: Wall
    patch_steps: Integers
    edge_steps: Integers
    across: int
    deviation: float
    volume_offset: float
    parting: float
    volume: float

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def triangle_count(self) -> int:
        """Count of the triangles of both faces and the side walls."""
        edges = self.edge_steps[self.wall.complex.patch_edges].sum()
        faces = np.sum(2 * (self.patch_steps - 2) ** 2 + 4 * (self.patch_steps - 2)) + edges
        return int(2 * faces + 2 * self.across * self.edge_steps[self.wall.complex.free].sum())


def triangulated(wall: Wall, deviation: float) -> Triangulation:
    """Find the steps with which triangles keep within a deviation of a wall.

    Triangles with their corners on the faces of a gyroid wall enclose too little, about as much as they deviate. So
    the corners are offset along the lines through the wall, all by the same small part of its thickness, until
    the triangles enclose the wall's own volume. Faces, edges and side walls stay those of one wall, a little thicker,
    and the deviation counts what was added.

    Parameters
    ----------
    wall : Wall
    deviation : float
        Largest distance of a triangle from the wall's faces and side walls, in mm.

    Raises
    ------
    ParameterError
        If a patch would take too many steps, saying which deviation would do.
    """
    volume, max_thickness = wall.volume(), float(np.linalg.norm(wall.nets[:, 1] - wall.nets[:, 0], axis=-1).max())
    reserved = 0.0
    while True:
        steps = subdivided(wall, deviation, reserved)
        thicker, enclosed, part = _of_volume(wall, steps, volume)
        volume_offset = abs(part) * max_thickness
        if steps.deviation + volume_offset <= deviation:
            break
        # What is offset falls with the rest: never all is reserved for it.
        reserved = min(volume_offset, (deviation + reserved) / 2)
    furthest = float(np.abs(thicker.nets).max() + np.abs(wall.shifts).max())
    return Triangulation(
        wall=thicker,
        patch_steps=steps.patch_steps,
        edge_steps=steps.edge_steps,
        across=steps.across,
        deviation=steps.deviation + volume_offset,
        volume_offset=volume_offset,
        parting=parting(deviation, furthest),
        volume=enclosed,
    )


def parting(deviation: float, furthest: float) -> float:
    """Distance in mm by which triangles that touch in a line, and do not belong together, are parted.

    Parameters
    ----------
    deviation : float
        Of the triangles, in mm.
    furthest : float
        The largest of their coordinates, in mm.

    Examples
    --------
    >>> parting(0.01, 20.0)
    1.9073486328125e-05
    """
    return max(_PARTING * deviation, _SINGLE_PRECISION_STEPS * float(np.finfo(np.float32).eps) * furthest)


def _of_volume(wall: Wall, steps: Subdivision, volume: float) -> tuple[Wall, float, float]:
    """The wall offset so that its triangles enclose a volume, what they enclose, and by which part of itself."""
    part, thicker = 0.0, wall
    enclosed = triangulated_volume(wall, steps.patch_steps, steps.edge_steps, steps.across)
    # Of a thin wall the volume goes with the thickness, which grows on both sides.
    following = (volume / enclosed - 1) / 2
    for _ in range(_SECANT_STEPS):
        if abs(following - part) < _NOTHING:
            break
        thicker = _offset(wall, following)
        found = triangulated_volume(thicker, steps.patch_steps, steps.edge_steps, steps.across)
        slope = (found - enclosed) / (following - part)
        part, enclosed = following, found
        following = part + (volume - enclosed) / slope
    return thicker, enclosed, part


def _offset(wall: Wall, part: float) -> Wall:
    """The wall with both faces moved outwards by a part of its thickness."""
    through = part * (wall.nets[:, 1] - wall.nets[:, 0])
    return replace(wall, nets=wall.nets + np.stack([-through, through], axis=1))

"""The wall's surface as triangles: closed, oriented outwards, within a deviation of the wall's NURBS faces.

The lattice knows its own topology: patches share the places along their common edges and at their fans by number,
side walls share theirs with the faces. Nothing is merged by distance, and no kernel is asked.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import freeze_arrays
from gyroid_cad.mesh.triangles.measuring import enclosed_volume
from gyroid_cad.mesh.triangles.subdivision import Subdivision, subdivided
from gyroid_cad.wall.offset import Wall

__all__ = ["Triangulation", "triangulated"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# How far triangles that touch in a line without belonging together are parted: a thousandth of the deviation, but
# enough for the single-precision numbers of STL and 3MF to tell them apart. The kernel's writer does the same.
_PARTING = 1e-3
_SINGLE_PRECISION_STEPS = 8
# Of the secant method for the volume: each step squares what is left, and the first leaves 1e-5.
_SECANT_STEPS = 2
# A part of the thickness that changes no volume but by rounding.
_NOTHING = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Triangulation:
    """How a wall is cut into triangles.

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
    laid_off : float
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
    laid_off: float
    parting: float
    volume: float

    def __post_init__(self) -> None:
        freeze_arrays(self)

    @property
    def triangle_count(self) -> int:
        """Of both faces and the free side walls."""
        edges = self.edge_steps[self.wall.complex.patch_edges].sum()
        faces = np.sum(2 * (self.patch_steps - 2) ** 2 + 4 * (self.patch_steps - 2)) + edges
        return int(2 * faces + 2 * self.across * self.edge_steps[self.wall.complex.free].sum())


def triangulated(wall: Wall, deviation: float) -> Triangulation:
    """Find the steps with which triangles keep within a deviation of a wall.

    Triangles with their corners on the faces of a gyroid wall enclose too little, about as much as they deviate. So
    the corners are laid off along the lines through the wall, all by the same small part of its thickness, until
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
    volume, thickest = wall.volume(), float(np.linalg.norm(wall.nets[:, 1] - wall.nets[:, 0], axis=-1).max())
    reserved = 0.0
    while True:
        steps = subdivided(wall, deviation, reserved)
        thicker, enclosed, part = _of_volume(wall, steps, volume)
        laid_off = abs(part) * thickest
        if steps.deviation + laid_off <= deviation:
            break
        # What is laid off falls with the rest: never all is reserved for it.
        reserved = min(laid_off, (deviation + reserved) / 2)
    furthest = float(np.abs(thicker.nets).max() + np.abs(wall.shifts).max())
    parting = max(_PARTING * deviation, _SINGLE_PRECISION_STEPS * float(np.finfo(np.float32).eps) * furthest)
    return Triangulation(
        wall=thicker,
        patch_steps=steps.patch_steps,
        edge_steps=steps.edge_steps,
        across=steps.across,
        deviation=steps.deviation + laid_off,
        laid_off=laid_off,
        parting=parting,
        volume=enclosed,
    )


def _of_volume(wall: Wall, steps: Subdivision, volume: float) -> tuple[Wall, float, float]:
    """The wall laid off so that its triangles enclose a volume, what they enclose, and by which part of itself."""
    part, thicker = 0.0, wall
    enclosed = enclosed_volume(wall, steps.patch_steps, steps.edge_steps, steps.across)
    # Of a thin wall the volume goes with the thickness, which grows on both sides.
    following = (volume / enclosed - 1) / 2
    for _ in range(_SECANT_STEPS):
        if abs(following - part) < _NOTHING:
            break
        thicker = _laid_off(wall, following)
        found = enclosed_volume(thicker, steps.patch_steps, steps.edge_steps, steps.across)
        slope = (found - enclosed) / (following - part)
        part, enclosed = following, found
        following = part + (volume - enclosed) / slope
    return thicker, enclosed, part


def _laid_off(wall: Wall, part: float) -> Wall:
    """The wall with both faces moved outwards by a part of its thickness."""
    through = part * (wall.nets[:, 1] - wall.nets[:, 0])
    return replace(wall, nets=wall.nets + np.stack([-through, through], axis=1))

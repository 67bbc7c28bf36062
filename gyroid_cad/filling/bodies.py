"""Bodies that share their faces: what they are called, and chips that are joined to what is round them."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.errors import KernelError
from gyroid_cad.filling.wanted import SKIN, WALL
from gyroid_cad.kernel.check import faces_of
from gyroid_cad.kernel.compat import NumberedShapes
from gyroid_cad.kernel.crossed import FaceSizes
from gyroid_cad.kernel.depth import NamedFaces
from gyroid_cad.kernel.shells import connected_shells, fused_solids
from gyroid_cad.kernel.skin import Hollow
from gyroid_cad.kernel.solid import KernelFace, KernelShape
from gyroid_cad.kernel.split import Pieces
from gyroid_cad.trim.islands import SMALL_ISLAND
from gyroid_cad.trim.measures import PieceMeasures
from gyroid_cad.wall.areas import ShapeSize

__all__ = ["Crossed", "FaceNames", "Made", "made_of", "merged_chips", "mouths_of", "with_own_names"]

Floats = NDArray[np.float64]
# End of the name of a face that lies on the part's boundary.
_PART_OWN = re.compile(r"(/|:)(face \d+|opening \d+|\d+|outside)$")
# Solids by the name of what they are.
Bodies = dict[str, list[KernelShape]]


@dataclass(frozen=True, slots=True, eq=False)
class Made:
    """A solid, or a shell of the bare surface, with its volume in mm3, its area in mm2, and its centroid in mm.

    There is no centroid where the kernel measured some of it, which is not as exact. Names of its faces, if it has any,
    are in the order in which the kernel counts them; wetted is what of its area is no mouth, in mm2.
    """

    shape: KernelShape
    volume: float
    area: float
    centroid: Point | None = None
    face_names: tuple[str, ...] = ()
    wetted: float = 0.0

    @property
    def size(self) -> ShapeSize:
        return ShapeSize(self.volume, self.area, self.centroid)


@dataclass(frozen=True, slots=True, eq=False)
class Crossed:
    """Pieces of the core's boundary and of the lattice's faces, faces that nothing cut, and how large they are.

    Attributes
    ----------
    pieces : Pieces
    faces : list of TopoDS_Face
        Uncut.
    measures : PieceMeasures
        Of the pieces of the lattice's faces, of those of the boundary, and of the uncut faces.
    middle : ndarray, shape (3,)
        That they are taken about.
    sides : list of int
        Of the wall, 0 or 1: on which the pieces of the lattice's faces are, and then the uncut faces.
    """

    pieces: Pieces
    faces: list[KernelFace]
    measures: PieceMeasures
    middle: Floats
    sides: list[int]

    @property
    def measured(self) -> list[KernelFace]:
        """Faces in the order of their measures."""
        return [*self.pieces.inside, *self.pieces.boundary, *self.faces]

    @property
    def sizes(self) -> FaceSizes:
        """Sizes of what the faces bound."""
        return FaceSizes(self.measured, self.measures, self.middle)


class FaceNames:
    """Names of the faces of bodies, by what is on their other side: a face that two of them share has one.

    Parameters
    ----------
    crossed : Crossed
    hollow : Hollow, optional
    fluids : dict
        Names of the fluids by the side of the wall that they are on.
    """

    def __init__(self, crossed: Crossed, hollow: Hollow | None, fluids: dict[int, str]) -> None:
        self._numbers, self._hollow, self._fluids = NumberedShapes(), hollow, fluids
        self._sides, self._origins = crossed.sides, crossed.pieces.origins
        for face in [*crossed.pieces.inside, *crossed.faces, *crossed.pieces.boundary]:
            self._numbers.Add(face)

    def fluid_of(self, solid: KernelShape) -> str:
        """Name of the fluid that a solid beside the wall is.

        Raises
        ------
        KernelError
            If it meets no wall.
        """
        numbers = (self._numbers.FindIndex(face) for face in faces_of(solid))
        side = next((self._sides[number - 1] for number in numbers if 0 < number <= len(self._sides)), None)
        if side is None:
            raise KernelError("a piece of the part meets no wall, so that it belongs to neither fluid")
        return self._fluids[side]

    def of(self, solid: KernelShape, body: str) -> tuple[str, ...]:
        """Names of the faces of a body, in the order in which the kernel counts them."""
        return tuple(self._name(int(self._numbers.FindIndex(face)) - 1, body) for face in faces_of(solid))

    def made(self, solid: KernelShape, body: str, sizes: FaceSizes) -> Made:
        """A body with its size and the names of its faces."""
        return made_of(solid, self.of(solid, body), sizes)

    def _name(self, number: int, body: str) -> str:
        if number < 0:
            return f"{SKIN}/outside"
        if number < len(self._sides):
            return f"{WALL}/{self._fluids[self._sides[number]][-1]}"
        origin = self._origins[number - len(self._sides)]
        if self._hollow is None:
            return f"{body}/face {origin + 1}"
        if not self._hollow.opened[origin]:
            return f"{SKIN}/inside"
        return f"{body}/opening {sum(self._hollow.opened[: origin + 1])}"


def made_of(solid: KernelShape, names: tuple[str, ...], sizes: FaceSizes) -> Made:
    """A body whose faces have names, with its size.

    Parameters
    ----------
    solid : TopoDS_Shape
    names : tuple of str
        Those of faces between bodies begin with the wall's name or the skin's.
    sizes : FaceSizes
    """
    size, areas = sizes.of(solid), sizes.areas(solid)
    wetted = [name.split("/")[0] in (WALL, SKIN) for name in names]
    return Made(solid, size.volume, size.area, size.centroid, names, float(areas[wetted].sum()))


def mouths_of(made: Made) -> int:
    """Count the mouths of a fluid's body: the openings of a skin that it comes to, or else faces that are connected.

    Parameters
    ----------
    made : Made
        With the names of its faces.
    """
    ends = [name.split("/")[0] not in (WALL, SKIN) for name in made.face_names]
    named = {name for name, is_end in zip(made.face_names, ends, strict=True) if is_end}
    if not all("/face " in name for name in named):
        return len(named)
    return len(connected_shells([face for face, is_end in zip(faces_of(made.shape), ends, strict=True) if is_end]))


def with_own_names(made: Made, own: NamedFaces) -> tuple[str, ...]:
    """Names of a body's faces, where they lie on the part's own by the names that those have in its file.

    What is told before them, the body or the fluid of a mouth, stays.
    """
    if not own or not made.face_names:
        return made.face_names
    return tuple(
        _renamed(called, own.name_of(face) if _PART_OWN.search(called) else None)
        for face, called in zip(faces_of(made.shape), made.face_names, strict=True)
    )


def _renamed(called: str, own: str | None) -> str:
    return called if own is None else _PART_OWN.sub(lambda found: found.group(1) + own, called)


def merged_chips(bodies: Bodies, volume_of: Callable[[KernelShape], float], one_cell: float) -> Bodies:
    """Return bodies of which small pieces that are unconnected have been joined to what is round them.

    A chip of the wall becomes fluid, a pocket of fluid wall: no mesher is given pieces that hold nothing, and together
    they still fill the part. Small is a piece as of :data:`~gyroid_cad.trim.islands.SMALL_ISLAND`.

    Parameters
    ----------
    bodies : dict
        Solids by name, that share faces.
    volume_of : callable
        Of a shell or solid, in mm3.
    one_cell : float
        Volume of a cell, in mm3.

    Raises
    ------
    KernelError
        If what is joined does not close.
    """
    pieces = [(name, solid, volume_of(solid)) for name, some in bodies.items() for solid in some]
    largest = {name: max((volume for other, _, volume in pieces if other == name), default=0.0) for name in bodies}
    chip = [volume < SMALL_ISLAND * min(largest[name], one_cell) for name, _, volume in pieces]
    if not any(chip):
        return bodies
    target = _targets([solid for _, solid, _ in pieces], chip)
    joined: Bodies = {name: [] for name in bodies}
    for number, (name, solid, _) in enumerate(pieces):
        if target[number] != number:
            continue
        added = [pieces[other][1] for other, to in enumerate(target) if to == number != other]
        joined[name] += fused_solids([solid, *added], volume_of) if added else [solid]
    return joined


def _targets(solids: Sequence[KernelShape], chip: Sequence[bool]) -> list[int]:
    """Number of the solid that each becomes part of: of a chip one beside it that is none, else its own."""
    faces = NumberedShapes()
    users: list[list[int]] = []
    for number, solid in enumerate(solids):
        for face in faces_of(solid):
            index = int(faces.Add(face)) - 1
            if index == len(users):
                users.append([])
            users[index].append(number)
    target = list(range(len(solids)))
    for some in users:
        for number in some:
            beside = next((other for other in some if other != number and not chip[other]), None)
            if chip[number] and target[number] == number and beside is not None:
                target[number] = beside
    return target

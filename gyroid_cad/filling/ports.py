"""Bodies of a part whose openings are for one fluid each: where one flows in, the other's channels are closed.

Either fluid has a core of its own, the part less its skin but for the openings of that fluid. What is left of the part
is the wall, with the skin and the plugs: it shares its faces with both.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import positive_number
from gyroid_cad.common.choices import ROUTES, Kind, Route
from gyroid_cad.errors import KernelError, ParameterError
from gyroid_cad.filling.bodies import Crossed, Made, made_of, merged_chips
from gyroid_cad.filling.infill import Infill
from gyroid_cad.filling.part import Filling, Outcome
from gyroid_cad.filling.roads import crossed_by, patches_of
from gyroid_cad.filling.wanted import BODIES, FLUID_A, FLUID_B, SKIN, WALL, Region
from gyroid_cad.kernel.check import faces_of, is_valid, topology
from gyroid_cad.kernel.compat import NumberedShapes, as_face
from gyroid_cad.kernel.crossed import FaceSizes
from gyroid_cad.kernel.extent import box_round, corners_of
from gyroid_cad.kernel.part import Part
from gyroid_cad.kernel.shells import solids_of
from gyroid_cad.kernel.skin import Hollow, opened_faces
from gyroid_cad.kernel.skin_room import shown_place
from gyroid_cad.kernel.solid import KernelFace, KernelShape
from gyroid_cad.kernel.split import inner_sides
from gyroid_cad.trim.clearance import NearMisses
from gyroid_cad.trim.measures import joined
from gyroid_cad.wall.covering import PERTURBATIONS, Frame, first_success

__all__ = ["ANY", "OpenFaces", "PortedFilling", "checked_plug", "open_faces", "ports_of", "require_of_bodies"]

Floats = NDArray[np.float64]

FLUIDS = (FLUID_A, FLUID_B)
# By fluid; of openings that name none, all of them.
OpenFaces = dict[str, list[KernelFace]]
ANY = ""
# What is before the colon of an opening that names its fluid.
_LETTERS = {"a": FLUID_A, "b": FLUID_B}
# Of the kernel's measure of the wall against what the fluids leave of the part: its integrals are no closer.
_AGREEMENT = 1e-4


def ports_of(openings: Sequence[Any]) -> dict[str, list[Any]] | None:
    """Openings by the fluid that they name, as in "a:>X" or ("a", face); None where none names one.

    Raises
    ------
    ParameterError
        If some name a fluid and others none.

    Examples
    --------
    >>> ports_of(["a:>X", "b:<X", ("b", (1.0, 2.0, 3.0))])
    {'fluid-a': ['>X'], 'fluid-b': ['<X', (1.0, 2.0, 3.0)]}
    >>> ports_of([">Z"]) is None
    True
    """
    named = [_named(opening) for opening in openings]
    if not any(named):
        return None
    ports: dict[str, list[Any]] = {fluid: [] for fluid in FLUIDS}
    for opening, found in zip(openings, named, strict=True):
        if found is None:
            raise ParameterError("openings", opening, 'a fluid as well, as in "a:>X": others name theirs')
        ports[found[0]].append(found[1])
    return ports


def _named(opening: Any) -> tuple[str, Any] | None:
    if isinstance(opening, str) and opening[:2] in ("a:", "b:"):
        return _LETTERS[opening[0]], opening[2:]
    if isinstance(opening, tuple | list) and len(opening) == 2 and opening[0] in _LETTERS:
        return _LETTERS[opening[0]], opening[1]
    return None


def require_of_bodies(kind: Kind, openings: Sequence[Any], drop_islands: bool, route: Route) -> None:
    """Check what is asked of bodies that share their faces, or of other kinds what only those can be.

    Raises
    ------
    ParameterError
    """
    if kind != BODIES:
        if ports_of(openings):
            raise ParameterError("openings", list(openings), 'none that names a fluid, unless kind is "bodies"')
        return
    if drop_islands:
        raise ParameterError("drop_islands", drop_islands, "none of bodies, which fill the part together")
    if route != ROUTES[0]:
        raise ParameterError("kind", kind, "another at the route of triangles: bodies share exact faces")


def checked_plug(plug: float | None, skin: float | None, openings: Sequence[Any], cell_size: float) -> float | None:
    """Thickness in mm of what closes one fluid's channels where the other flows in; None for the skin's.

    Raises
    ------
    ParameterError
    """
    if plug is None:
        return None
    if ports_of(openings) is None or skin is None:
        raise ParameterError("plug", plug, 'none without openings for fluids, as in "a:>X": they are what it stands at')
    thickness = positive_number("plug", plug, "a length in mm, a finite number above 0")
    if not skin <= thickness <= cell_size:
        raise ParameterError("plug", plug, f"from the skin's {skin:g} mm to the {cell_size:g} mm of a cell")
    return thickness


def open_faces(parts: Sequence[tuple[str, Part]], openings: Sequence[Any]) -> list[OpenFaces]:
    """Faces of each part that are open, by the fluid that they are open for.

    Raises
    ------
    ParameterError
        If a face is open for both, or a fluid has no port.
    """
    ports = ports_of(openings)
    if ports is None:
        return [{ANY: faces} for faces in opened_faces(parts, openings)]
    for fluid, given in ports.items():
        if not given:
            letter = fluid[-1]
            raise ParameterError("openings", list(openings), f'one for fluid {letter} too, as in "{letter}:>X"')
    found = [opened_faces(parts, given) for given in ports.values()]
    for first, second in zip(*found, strict=True):
        if any(one.IsSame(other) for one in first for other in second):
            raise ParameterError("openings", list(openings), "each face open for one fluid")
    return [dict(zip(ports, faces, strict=True)) for faces in zip(*found, strict=True)]


@dataclass(frozen=True, eq=False)
class PortedFilling:
    """A part to be filled with a wall and two fluids, each with openings of its own.

    Attributes
    ----------
    fillings : dict of Filling
        By the name of the fluid, that which gives it: of the core that its openings leave.
    """

    fillings: dict[str, Filling]

    @property
    def _first(self) -> Filling:
        return self.fillings[FLUID_A]

    @property
    def part(self) -> Part:
        """The part that is filled."""
        return self._first.part

    @property
    def hollow(self) -> Hollow | None:
        """Skin and core of the part, as the first fluid sees them."""
        return self._first.hollow

    @property
    def regions(self) -> tuple[Region, ...]:
        """Regions of the fluids, and of the wall between them."""
        return (Region(WALL, -1.0, 1.0), *(region for one in self.fillings.values() for region in one.regions))

    @property
    def cell_size(self) -> float:
        """Size of a cell, in mm."""
        return self._first.cell_size

    @property
    def cells(self) -> float:
        """Number of cells that have the volume of what is filled."""
        return self._first.cells

    @property
    def seconds(self) -> dict[str, float]:
        """Seconds by stage."""
        return self._first.seconds

    def timed(self, stage: str) -> AbstractContextManager[None]:
        """Context that adds the seconds of a stage."""
        return self._first.timed(stage)

    def of(self, fluid: str) -> Filling:
        """The filling that gives a fluid."""
        return self.fillings[fluid]

    def near_misses(self, frame: Frame, within: float) -> NearMisses:
        """As of :meth:`Filling.near_misses`, of both cores."""
        return NearMisses.joined([one.near_misses(frame, within) for one in self.fillings.values()])

    def run(self, frame: Frame) -> Outcome:
        """Fill, with the lattice a little shifted where it touches the part.

        Raises
        ------
        KernelError
        """
        return first_success(partial(self._filled, frame, phase) for phase in PERTURBATIONS)

    def _filled(self, frame: Frame, phase: Point) -> Outcome:
        shift = np.array(phase) * self.cell_size
        placed = replace(frame, origin=frame.origin + shift)
        made: dict[str, _Fluid] = {}
        cut = whole = 0
        for name, filling in self.fillings.items():
            infill = filling.infill_at(placed)
            crossing, inside = patches_of(filling, infill)
            crossed = crossed_by(filling, infill, filling.regions[0], crossing, inside, outer=True)
            made[name] = _Fluid(name, filling, infill, crossed)
            made[name].require_mouths()
            cut, whole = max(cut, len(crossing)), max(whole, len(inside))
        domains = self._bodies(made)
        with self._first.timed("check"):
            for name, some in domains.items():
                for body in some:
                    counted = topology(body.shape)
                    if not (counted.closed and is_valid(body.shape)):
                        raise KernelError(f"the {name} is no valid solid, with {counted.open_edges} open edges")
        return Outcome(domains, made[FLUID_A].infill, shift, cut, whole, True)

    def _bodies(self, made: dict[str, _Fluid]) -> dict[str, list[Made]]:
        some = [fluid.crossed for fluid in made.values()]
        sizes = FaceSizes(
            [face for one in some for face in one.measured], joined(*(one.measures for one in some)), some[0].middle
        )

        def volume_of(shell: KernelShape) -> float:
            return sizes.of(shell).volume

        with self._first.timed("join"):
            found: dict[str, list[KernelShape]] = {WALL: list(solids_of(self._wall_faces(made), volume_of))}
            for name, fluid in made.items():
                found[name] = list(solids_of(fluid.own_faces(), volume_of))
            found = merged_chips(found, volume_of, self.cell_size**3)
            if not all(found.values()):
                raise KernelError("nothing of a fluid lies in the part")
        domains = {name: [self._made(solid, sizes, made, name) for solid in some] for name, some in found.items()}
        self._require_sum(domains)
        return domains

    def _require_sum(self, domains: dict[str, list[Made]]) -> None:
        """Take the volume of a single wall for what the fluids leave of the part, once the kernel all but agrees."""
        fluids = sum(made.volume for name in FLUIDS for made in domains[name])
        walls = domains[WALL]
        left = self.part.volume - fluids
        if abs(sum(wall.volume for wall in walls) - left) > _AGREEMENT * self.part.volume:
            raise KernelError("the wall and the fluids do not add up to the part")
        if len(walls) == 1:
            domains[WALL] = [replace(walls[0], volume=left)]

    def _made(self, solid: KernelShape, sizes: FaceSizes, made: dict[str, _Fluid], body: str) -> Made:
        return made_of(solid, tuple(_name_of(face, made, body) for face in faces_of(solid)), sizes)

    def _wall_faces(self, made: dict[str, _Fluid]) -> list[KernelFace]:
        """Faces of the wall with the skin: the part's own, what is left of openings, and those of both fluids."""
        faces: list[KernelFace] = []
        for name, fluid in made.items():
            own, rims = fluid.outer_faces()
            faces += rims
            if name == FLUID_A:
                others = made[FLUID_B].filling.opened
                faces += [face for original, face in own if not any(original.IsSame(other) for other in others)]
            faces += fluid.turned_faces()
        return faces


class _Fluid:
    """Pieces that were crossed for one fluid, and those of its core's boundary that are its own."""

    def __init__(self, name: str, filling: Filling, infill: Infill, crossed: Crossed) -> None:
        assert filling.hollow is not None
        self.name, self.filling, self.infill, self.crossed = name, filling, infill, crossed
        self.hollow = filling.hollow
        self.inner = inner_sides(crossed.pieces, self.wanted_at)
        self._lattice, self._boundary = NumberedShapes(), NumberedShapes()
        for face in [*crossed.pieces.inside, *crossed.faces]:
            self._lattice.Add(face)
        for face in crossed.pieces.boundary:
            self._boundary.Add(face)

    def wanted_at(self, point: Floats) -> bool:
        return bool(self.infill.contains(self.filling.regions[0], point[np.newaxis])[0])

    def require_mouths(self) -> None:
        """Check that channels of the fluid come to all faces that are open for it.

        Raises
        ------
        ParameterError
        """
        pieces = self.crossed.pieces
        reached = {origin for origin, inner in zip(pieces.origins, self.inner, strict=True) if inner}
        for origin, is_open in enumerate(self.hollow.opened):
            if is_open and origin not in reached:
                face = next(face for face, own in zip(pieces.boundary, pieces.origins, strict=True) if own == origin)
                place = shown_place(corners_of(box_round([face])).mean(axis=0))
                accepted = f"faces that the fluid's channels reach, not the one round {place}"
                raise ParameterError("openings", f"{self.name[-1]}:", accepted)

    def own_faces(self) -> list[KernelFace]:
        """Faces that bound this fluid."""
        pieces = self.crossed.pieces
        ends = (piece for piece, inner in zip(pieces.boundary, self.inner, strict=True) if inner)
        return [*pieces.inside, *self.crossed.faces, *ends]

    def outer_faces(self) -> tuple[list[tuple[KernelFace, KernelFace]], list[KernelFace]]:
        """The part's faces that are not open for this fluid, each with what has become of it, and rims of others."""
        originals = faces_of(self.filling.part.shape)
        kept = [face for face in originals if not any(face.IsSame(other) for other in self.filling.opened)]
        skin = list(self.hollow.skin_faces(self.crossed.pieces))
        return list(zip(kept, skin[: len(kept)], strict=True)), skin[len(kept) :]

    def turned_faces(self) -> list[KernelFace]:
        """Faces between the wall and this fluid as the wall has them, and what the wall has of its mouths."""
        pieces = self.crossed.pieces
        ends = [
            piece if is_open else as_face(piece.Reversed())
            for piece, origin, inner in zip(pieces.boundary, pieces.origins, self.inner, strict=True)
            for is_open in (self.hollow.opened[origin],)
            if inner != is_open
        ]
        return [*(as_face(face.Reversed()) for face in (*pieces.inside, *self.crossed.faces)), *ends]

    def name_of(self, face: KernelShape, body: str) -> str | None:
        """Name that a face which was made for this fluid has on a body: chips have gone from one to another."""
        if self._lattice.Contains(face):
            return f"{WALL}/{self.name[-1]}"
        number = int(self._boundary.FindIndex(face)) - 1
        if number < 0:
            return None
        origin = self.crossed.pieces.origins[number]
        if not self.hollow.opened[origin]:
            return f"{SKIN}/{self.name[-1]}"
        return f"{SKIN}/outside" if body == WALL else f"{self.name[-1]}:{sum(self.hollow.opened[: origin + 1])}"


def _name_of(face: KernelShape, made: dict[str, _Fluid], body: str) -> str:
    for fluid in made.values():
        name = fluid.name_of(face, body)
        if name is not None:
            return name
    return f"{SKIN}/outside"

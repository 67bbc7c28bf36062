"""Render lattices with the package's own rasteriser.

Run from the repository's root: ``python images/render.py [name ...]``, all of them if no name is given. Fine lines are
the outlines of patches: each is one B-spline face of the solid. Where two lattices are shown they have one scale.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sheet import Sheet, Vector, beside

from gyroid_cad import Lattice
from gyroid_cad.fields import distance_from_axis
from gyroid_cad.maps import Cylinder
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_shape, facets_of_wall
from gyroid_cad.render.picture import CAMERA


@dataclass(frozen=True, slots=True)
class Picture:
    """Lattices from left to right, and from where they are seen.

    Attributes
    ----------
    lattices : tuple of Lattice
    size : tuple of int
        In pixels.
    camera : tuple of float
        Direction from the lattices to the viewer.
    """

    lattices: tuple[Lattice, ...]
    size: tuple[int, int]
    camera: Vector


def gyroid_2x2x2() -> Picture:
    """Eight cells, all alike, cut to a cube: one solid."""
    return Picture((Lattice(cells=(2, 2, 2), cell_size=10, thickness=0.8, trim="box"),), (900, 900), (2.2, -4.5, 2.1))


def specimen_variable_thickness() -> Picture:
    """The paper's Fig. 16."""
    return _specimen((3, 3, 1), "0.08 + 0.05*x + 0.02*y", 1.0, (1380, 530))


def specimen_variable_cell_length() -> Picture:
    """The paper's Fig. 17."""
    return _specimen((3, 3, 1), 0.08, "1 + 0.3*x + 0.08*y", (1400, 600))


def specimen_variable_both() -> Picture:
    """The paper's Fig. 18."""
    return _specimen((3, 3, 2), "0.08 + 0.05*x + 0.02*y", "1 + 0.05*x + 0.08*y", (1260, 600))


def bone_gradient() -> Picture:
    """As ``examples/bone_gradient.py`` builds it."""
    density = 0.12 + 0.68 / (1 + 2 ** (12 - distance_from_axis((15, 15, 0), (0, 0, 1))))
    return Picture((Lattice(cells=(3, 3, 2), cell_size=10, density=density),), (850, 820), (0.5, -1.5, 3.6))


def closed_cylinder() -> Picture:
    """As ``examples/closed_cylinder.py`` builds it."""
    lattice = Lattice(cells=(12, 2, 1), cell_size=10, thickness=0.8, map=Cylinder(radius=20, angle=360))
    return Picture((lattice,), (1000, 760), (0, -3, 2.7))


def three_surfaces() -> Picture:
    """Gyroid, diamond and primitive surface: as many cells, of one size and density, cut to cubes."""
    lattices = [
        Lattice((2, 2, 2), 10, density=0.25, surface=name, trim="box") for name in ("gyroid", "diamond", "primitive")
    ]
    return Picture(tuple(lattices), (1500, 520), CAMERA)


def _specimen(
    cells: tuple[int, int, int], thickness_factor: float | str, bc_length: float | str, size: tuple[int, int]
) -> Picture:
    """A specimen of the paper to the right of the lattice whose wall and cells do not vary."""
    plain = Lattice.paper(cells, 0.08, scale=5.0)
    return Picture((plain, Lattice.paper(cells, thickness_factor, bc_length, scale=5.0)), size, (1.2, -3, 2.6))


PICTURES: tuple[Callable[[], Picture], ...] = (
    gyroid_2x2x2,
    specimen_variable_thickness,
    specimen_variable_cell_length,
    specimen_variable_both,
    bone_gradient,
    closed_cylinder,
    three_surfaces,
)


def main(names: Sequence[str] = ()) -> list[Path]:
    """Render pictures, and write each under its name.

    Parameters
    ----------
    names : sequence of str
        All if left out.
    """
    by_name = {make.__name__: make for make in PICTURES}
    return [render(by_name[name](), name) for name in names or by_name]


def render(picture: Picture, name: str) -> Path:
    """Draw a picture and save it under a name."""
    groups = beside([_facets(lattice) for lattice in picture.lattices], picture.camera)
    sheet = Sheet(picture.size)
    sheet.put(draw([one for group in groups for one in group], picture.size, picture.camera))
    return sheet.save(name)


def _facets(lattice: Lattice) -> list[Facets]:
    return [facets_of_shape(lattice.solid()) if lattice.trim else facets_of_wall(lattice.fitted().wall)]


if __name__ == "__main__":
    print(*main(sys.argv[1:]), sep="\n")

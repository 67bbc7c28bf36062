"""Walls whose volumes several tests look at."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from gyroid_cad import FitSettings, Lattice
from gyroid_cad.fields import linear
from gyroid_cad.maps import Cylinder
from gyroid_cad.mesh.iga.patches import VolumePatches, wall_volumes
from gyroid_cad.surface.families import USUAL
from gyroid_cad.surface.fit import fit_patch
from gyroid_cad.surface.symmetry import Placements, bounding_cell
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.offset import Wall, build_wall

CELL_SIZE = 10.0
KINDS = ("uniform", "turned", "rational", "graded", "mapped", "ring")
# The fourfold rotoinversion about the patch's centre, (x, y, z) -> (y, -x, -z), which carries the patch onto itself.
TURN = np.array([[0, 1, 0], [-1, 0, 0], [0, 0, -1]])


def turned_placements() -> Placements:
    """The patches of a cell where they are, each third one with its parameters turned by a right angle."""
    cell = USUAL.cell
    matrices = np.array([matrix @ TURN if k % 3 == 0 else matrix for k, matrix in enumerate(cell.matrices)])
    return Placements(cell.patch, matrices, cell.translations, cell.bounding_cell)


def constant_wall(
    cells: tuple[int, int, int],
    placements: Placements | None = None,
    points: int = 5,
    relative_thickness: float = 0.08,
) -> Wall:
    patch = fit_patch(FitSettings(points))
    return build_wall(build_complex(cells, placements), patch, CELL_SIZE, relative_thickness * CELL_SIZE)


def rational_wall() -> Wall:
    paper = FitSettings.paper()
    patch = fit_patch(FitSettings(10, paper.knots, paper.weights, "smooth"))
    return build_wall(build_complex((1, 1, 1), bounding_cell(USUAL.patch)), patch, CELL_SIZE, 0.08 * CELL_SIZE)


def coarse(cells: tuple[int, int, int], **given: Any) -> Wall:
    return Lattice(cells, CELL_SIZE, fit=FitSettings(5), tolerance=2e-2, **given).wall()


@lru_cache
def wall_named(name: str) -> Wall:
    """A wall of each kind: "uniform", "turned", "rational", "graded", "mapped", "ring"."""
    makers = {
        "uniform": lambda: constant_wall((2, 1, 1)),
        "turned": lambda: constant_wall((2, 1, 1), turned_placements()),
        "rational": rational_wall,
        "graded": lambda: coarse((1, 1, 1), thickness=linear(0.8, x=0.03)),
        "mapped": lambda: coarse((2, 1, 1), thickness=0.8, map=Cylinder(radius=30, angle=60)),
        "ring": lambda: coarse((6, 1, 1), thickness=0.8, map=Cylinder(radius=15, angle=360)),
    }
    return makers[name]()


@lru_cache
def volumes_named(kind: str, degree: int = 1) -> VolumePatches:
    return wall_volumes(wall_named(kind), degree)

"""Render solved fields with the package's own rasteriser.

Run from the repository's root after ``examples/isogeometric_heat.py`` has left its files somewhere:
``python images/render_solutions.py FOLDER``. Fields are evaluated on the NURBS patches they were solved on.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from itertools import groupby, product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sheet import Sheet, Vector, mixed

from gyroid_cad.nurbs.volume import NurbsVolume
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_grids
from gyroid_cad.render.picture import CAMERA

Floats = NDArray[np.float64]

_SIZE, _BAR_ROOM, _BAR_HEIGHT = (1440, 600), 120, 350
# Steps along each side of a patch, and across the wall.
_FINENESS, _FINENESS_ACROSS = 40, 6
# The solved cell is repeated so often along each axis, as the solution is.
CELLS = 2
_COLD_TO_HOT: tuple[Vector, ...] = ((0.20, 0.38, 0.72), (0.95, 0.95, 0.90), (0.82, 0.22, 0.18))
LITTLE_TO_MUCH: tuple[Vector, ...] = ((0.33, 0.22, 0.48), (0.85, 0.38, 0.40), (1.0, 0.90, 0.62))
# Temperatures have a line every so many kelvins.
_ISOTHERMS = 1 / 12
SHADES = np.linspace(0, 1, 256)


@dataclass(frozen=True, slots=True)
class _Face:
    """A face on a grid: points and unit normals (a, b, 3), temperature and heat flux (a, b)."""

    points: Floats
    normals: Floats
    temperature: Floats
    flux: Floats


def main(folder: str) -> Path:
    """Draw temperature, left, and heat flux, right, of one kelvin a cell from top to bottom."""
    with np.load(Path(folder) / "isogeometric_heat.npz") as found:
        volumes = dict(found)
    temperature_at_points = np.load(Path(folder) / "temperature.npy")
    # The corners of the patches stand a cell and a half apart.
    corners = volumes["patch_points"][:, [0, 0, -1, -1], [0, -1, 0, -1]][..., [0, -1]]
    cell_size = float(np.ptp(volumes["control_points"][corners].mean(axis=-2)[..., 2])) / 1.5
    faces = _sampled(volumes, temperature_at_points, cell_size)
    most = max(float(face.flux.max()) for face in faces)
    temperature, flux = [], []
    for layer in range(CELLS):
        places = [(x, y, layer) for x, y in product(range(CELLS), repeat=2)]
        for facets in _facets(faces, "temperature"):
            kelvins = facets.colours[..., 0] + layer
            lines = np.floor(kelvins.mean(axis=1) / _ISOTHERMS).astype(int)
            # Fine lines stand where faces meet: those of one patch are its stretches between isotherms.
            several = facets.faces * (lines.max() + 1) + lines
            shown = replace(facets, colours=mixed(_COLD_TO_HOT, kelvins / CELLS), faces=several)
            temperature.append(repeated(shown, np.array(places) * cell_size))
        for facets in _facets(faces, "flux"):
            shown = replace(facets, colours=mixed(LITTLE_TO_MUCH, facets.colours[..., 0] / most))
            flux.append(repeated(shown, np.array(places) * cell_size))
    sheet, size = Sheet(_SIZE), (_SIZE[0] // 2 - _BAR_ROOM, _SIZE[1])
    sheet.put(draw(temperature, size, CAMERA), _BAR_ROOM)
    sheet.put(draw(flux, size, CAMERA), _SIZE[0] // 2)
    top = (_SIZE[1] - _BAR_HEIGHT) // 2
    sheet.put_bar(mixed(_COLD_TO_HOT, SHADES), CELLS, "K", 20, top, _BAR_HEIGHT)
    sheet.put_bar(mixed(LITTLE_TO_MUCH, SHADES), most, "K per cell", _SIZE[0] - _BAR_ROOM, top, _BAR_HEIGHT)
    return sheet.save("isogeometric_heat", many_colours=True)


def repeated(facets: Facets, shifts: Floats) -> Facets:
    """Facets in several places, by their shifts, shape (k, 3)."""
    places = np.tile(np.eye(3, 4), (len(shifts), 1, 1))
    places[..., 3] = shifts
    return replace(facets, places=places)


def _facets(faces: list[_Face], values: str) -> list[Facets]:
    """Facets of all faces, those with as many points together; values stand in place of colours."""
    by_shape = [list(some) for _, some in groupby(sorted(faces, key=_shape), _shape)]
    return [
        facets_of_grids(
            np.array([face.points for face in some]),
            np.array([face.normals for face in some]),
            np.repeat(np.array([getattr(face, values) for face in some])[..., np.newaxis], 3, axis=-1),
            closed=True,
            surface=number,
        )
        for number, some in enumerate(by_shape)
    ]


def _shape(face: _Face) -> tuple[int, ...]:
    return face.temperature.shape


def _sampled(volumes: dict[str, Floats], temperature: Floats, cell_size: float) -> list[_Face]:
    """All faces on the boundary of the wall; the flux in kelvins a cell, for a material of conductivity 1."""
    knots = (volumes["knots"], volumes["knots"], volumes["knots_across"])
    along, across = np.linspace(-1, 1, _FINENESS + 1), np.linspace(0, 1, _FINENESS_ACROSS + 1)
    faces = []
    for patch, face, _ in volumes["boundary"].tolist():
        numbers = volumes["patch_points"][patch]
        space = NurbsVolume(volumes["control_points"][numbers], volumes["weights"], *knots)
        # Three temperatures, for heat along x, y and z: a map from the same parameters.
        heat = NurbsVolume(temperature[numbers], volumes["weights"], *knots)
        axis, end = divmod(face, 2)
        parameters = [along, along, across]
        parameters[axis] = parameters[axis][[-end]]
        u, v, w = parameters
        grid = (u[:, np.newaxis, np.newaxis], v[:, np.newaxis], w)
        inverse = np.linalg.inv(space.jacobian(*grid))
        gradient = np.einsum("...j,...jk->...k", heat.jacobian(*grid)[..., 2, :], inverse)
        outward = inverse[..., axis, :] * (2 * end - 1)
        outward /= np.linalg.norm(outward, axis=-1, keepdims=True)
        lengths = np.linalg.norm(gradient, axis=-1) * cell_size
        fields = (space.evaluate(*grid), outward, heat.evaluate(*grid)[..., 2], lengths)
        faces.append(_Face(*(np.squeeze(field, axis=axis) for field in fields)))
    return faces


if __name__ == "__main__":
    print(main(sys.argv[1]))

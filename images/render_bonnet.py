"""Render one patch of the Bonnet family as it bends from the diamond surface to the primitive one.

Run from the repository's root: ``python images/render_bonnet.py``. Lines are those of one grid of parameters of the
Gauss map: every stretch of them keeps its length and its normal.
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from sheet import Sheet, Vector, beside

from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import COLOURS, Facets, facets_of_grids
from gyroid_cad.surface.weierstrass import GYROID, Family, normals, points

Floats = NDArray[np.float64]

ANGLES = (0.0, 20.0, float(np.degrees(GYROID.bonnet_angle)), 65.0, 90.0)
_SIZE, _CAPTION_HEIGHT = (1500, 330), 50
_CAMERA: Vector = (0.55, -1.0, 0.75)
_GAP = 0.4
# Squares along each side of the patch, and steps along each side of a square.
_SQUARES, _FINENESS = 8, 8


def main() -> Path:
    """Draw the patch at several angles, side by side, the gyroid in the middle."""
    patches = []
    for angle in ANGLES:
        family = Family("associate", np.radians(angle), GYROID.scale)
        # The view along the axis turns with the angle: turned back, the corners stay where they are.
        patches.append([_patch(family, np.exp(1j * np.radians(angle)))])
    patches = beside(patches, _CAMERA, _GAP)
    sheet, size = Sheet(_SIZE), (_SIZE[0], _SIZE[1] - _CAPTION_HEIGHT)
    sheet.put(draw([one for patch in patches for one in patch], size, _CAMERA))
    texts = [f"{round(angle, 2):g} degrees" for angle in ANGLES]
    sheet.caption(patches, texts, size, _CAMERA)
    return sheet.save("bonnet_family")


def _patch(family: Family, turn: complex) -> Facets:
    """Squares of the patch, even in the parameters of the polar grid of the Gauss map."""
    along = np.linspace(-1, 1, _SQUARES * _FINENESS + 1)
    u, v = np.meshgrid(along, along, indexing="ij")
    radius = np.maximum(np.abs(u), np.abs(v))
    edge = np.select([-v >= radius, u >= radius, v >= radius], [0, 1, 2], 3)
    on_edge = np.choose(edge, [u, v, -u, -v]) / np.where(radius == 0, 1, radius)
    omega = (
        radius * (sqrt(2) * np.exp(1j * pi / 12 * on_edge) - 1) * np.exp(1j * pi / 4) * np.array([1j, -1, -1j, 1])[edge]
    )
    back = np.array([[turn.real, -turn.imag, 0], [turn.imag, turn.real, 0], [0, 0, 1]])
    above = _squares(points(omega, family) @ back.T), _squares(normals(omega) @ back.T)
    return facets_of_grids(*above, COLOURS[0])


def _squares(field: Floats) -> Floats:
    starts = range(0, _SQUARES * _FINENESS, _FINENESS)
    return np.array([field[i : i + _FINENESS + 1, j : j + _FINENESS + 1] for i in starts for j in starts])


if __name__ == "__main__":
    print(main())

"""Render one patch of the Bonnet family as it bends from the diamond surface to the primitive one.

Run from the repository's root: ``python images/render_bonnet.py``. Lines are those of one grid of parameters of the
Gauss map: every stretch of them keeps its length and its normal.
"""

from __future__ import annotations

from math import pi, sqrt
from pathlib import Path

import numpy as np
import vtk
from numpy.typing import NDArray
from render import FOLDER, WALL_COLOUR, Grids, outline_actor, surface_actor, write_picture

from gyroid_cad.surface.weierstrass import GYROID, Family, normals, points

Floats = NDArray[np.float64]

ANGLES = (0.0, 20.0, float(np.degrees(GYROID.bonnet_angle)), 65.0, 90.0)
_SIZE, _CAMERA = (1500, 340), np.array([0.55, -1.0, 0.75])
_APART, _HEIGHT = 1.36, 1.58
# Squares along each side of the patch, and points along each side of a square.
_SQUARES, _FINENESS = 8, 9


def main() -> Path:
    """Draw the patch at several angles, side by side, the gyroid in the middle."""
    renderer = vtk.vtkRenderer()
    renderer.SetBackground(1, 1, 1)
    towards = _CAMERA / np.linalg.norm(_CAMERA)
    right = np.cross((0, 0, 1), towards)
    right /= np.linalg.norm(right)
    for index, angle in enumerate(ANGLES):
        family = Family("associate", np.radians(angle), GYROID.scale)
        # The view along the axis turns with the angle: turned back, the corners stay where they are.
        turn = np.exp(1j * np.radians(angle))
        grids = _patch(family, turn)
        for actor in (surface_actor(grids, WALL_COLOUR), outline_actor(grids, 1.0)):
            actor.SetPosition(*((index - (len(ANGLES) - 1) / 2) * _APART * right).tolist())
            renderer.AddActor(actor)
        caption = vtk.vtkTextActor()
        caption.SetInput(f"{angle:.2f} degrees" if index == 2 else f"{angle:.0f} degrees")
        caption.GetPositionCoordinate().SetCoordinateSystemToNormalizedViewport()
        caption.SetPosition(0.5 + (index - 2) * _APART / (_HEIGHT * _SIZE[0] / _SIZE[1]), 0.02)
        caption.GetTextProperty().SetJustificationToCentered()
        caption.GetTextProperty().SetColor(0.2, 0.2, 0.2)
        caption.GetTextProperty().SetFontSize(20)
        renderer.AddActor(caption)
    camera = renderer.GetActiveCamera()
    camera.SetViewUp(0, 0, 1)
    camera.SetFocalPoint(0, 0, -0.06)
    camera.SetPosition(*(10 * towards).tolist())
    camera.ParallelProjectionOn()
    camera.SetParallelScale(_HEIGHT / 2)
    renderer.ResetCameraClippingRange()
    target = FOLDER / "bonnet_family.png"
    write_picture(renderer, _SIZE, target)
    return target


def _patch(family: Family, turn: complex) -> Grids:
    """Squares of the patch, even in the parameters of the polar grid of the Gauss map."""
    along = np.linspace(-1, 1, _SQUARES * (_FINENESS - 1) + 1)
    u, v = np.meshgrid(along, along, indexing="ij")
    radius = np.maximum(np.abs(u), np.abs(v))
    edge = np.select([-v >= radius, u >= radius, v >= radius], [0, 1, 2], 3)
    on_edge = np.choose(edge, [u, v, -u, -v]) / np.where(radius == 0, 1, radius)
    omega = (
        radius * (sqrt(2) * np.exp(1j * pi / 12 * on_edge) - 1) * np.exp(1j * pi / 4) * np.array([1j, -1, -1j, 1])[edge]
    )
    places, upright = points(omega, family), normals(omega)
    back = np.array([[turn.real, -turn.imag, 0], [turn.imag, turn.real, 0], [0, 0, 1]])
    return Grids(*(_squares(field @ back.T) for field in (places, upright)))


def _squares(field: Floats) -> Floats:
    step = _FINENESS - 1
    starts = range(0, _SQUARES * step, step)
    return np.array([field[i : i + _FINENESS, j : j + _FINENESS] for i in starts for j in starts])


if __name__ == "__main__":
    print(main())

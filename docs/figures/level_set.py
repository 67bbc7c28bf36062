"""The level set sin x cos y + sin y cos z + sin z cos x = 0 that is commonly called a gyroid, to compare with."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
import vtk
from drawing import GREY, Floats, Sheet
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

from gyroid_cad.surface.patch import smooth

# What brings the exact patch, centred at the origin, onto the level set: a half-turn about x, after a translation in
# bounding-cell lengths, which are pi.
_TURN, _SHIFT = np.diag([1.0, -1.0, -1.0]), np.array([1, 1 / 2, 1 / 4])
_PATCH_SAMPLES = 41
# Samples along each axis, for a whole period.
_SAMPLES = 64
_PROJECTIONS = 6


def level_set_sheet(reach: float) -> Sheet:
    """Its triangles by contouring samples on a grid, from -reach to reach along each axis, as the paper does."""
    triangles = level_set_triangles(reach)
    return Sheet(*triangles, GREY, 0.4)


def level_set_triangles(reach: float) -> tuple[Floats, Floats]:
    """Points (n, 3), in radians, and triangles (m, 3)."""
    along = np.linspace(-reach, reach, round(_SAMPLES * reach / pi))
    x, y, z = np.meshgrid(along, along, along, indexing="ij")
    image = vtk.vtkImageData()
    image.SetDimensions(*(len(along),) * 3)
    image.SetOrigin(-reach, -reach, -reach)
    image.SetSpacing(*(along[1] - along[0],) * 3)
    image.GetPointData().SetScalars(numpy_to_vtk(value(np.stack([x, y, z])).ravel(order="F"), deep=True))
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, 0.0)
    contour.Update()
    data = contour.GetOutput()
    cells = vtk_to_numpy(data.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    return vtk_to_numpy(data.GetPoints().GetData()).astype(float), cells


@dataclass(frozen=True, slots=True)
class Measures:
    """How far the level set is from the gyroid; lengths in cell sizes L, angles in degrees, curvature in 1/L."""

    max_distance: float
    max_normal_angle: float
    max_mean_curvature: float
    rms_mean_curvature: float


def measures() -> Measures:
    """Of the place on the level set next to each place of an exact patch."""
    along = np.linspace(-1, 1, _PATCH_SAMPLES)
    points, normals = (array.reshape(-1, 3) for array in smooth(along[:, np.newaxis], along))
    exact, exact_normals = pi * _TURN @ (points + _SHIFT).T, _TURN @ normals.T
    near = on_level_set(exact)
    unit = gradient(near) / np.linalg.norm(gradient(near), axis=0)
    curvature = 2 * pi * mean_curvature(near)
    return Measures(
        max_distance=float(np.linalg.norm(near - exact, axis=0).max()) / (2 * pi),
        max_normal_angle=float(np.degrees(np.arccos(np.abs(np.sum(unit * exact_normals, axis=0)).min()))),
        max_mean_curvature=float(np.abs(curvature).max()),
        rms_mean_curvature=float(np.sqrt(np.mean(curvature**2))),
    )


def value(places: Floats) -> Floats:
    """The level set's function of x, y, z in radians; places of shape (3, ...)."""
    x, y, z = places
    return np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)


def gradient(places: Floats) -> Floats:
    """Its gradient; shape (3, ...)."""
    x, y, z = places
    return np.stack(
        [
            np.cos(x) * np.cos(y) - np.sin(z) * np.sin(x),
            np.cos(y) * np.cos(z) - np.sin(x) * np.sin(y),
            np.cos(z) * np.cos(x) - np.sin(y) * np.sin(z),
        ]
    )


def mean_curvature(places: Floats) -> Floats:
    """H of the level surfaces, half the divergence of the unit gradient, per radian.

    For an implicit surface H = (|g|^2 tr(G) - g . G g) / (2 |g|^3), with the gradient g and the Hessian G
    (R. Goldman, Curvature formulas for implicit curves and surfaces, 2005).
    """
    x, y, z = places
    g = gradient(places)
    xy, yz, zx = -np.cos(x) * np.sin(y), -np.cos(y) * np.sin(z), -np.cos(z) * np.sin(x)
    xx = -np.sin(x) * np.cos(y) - np.sin(z) * np.cos(x)
    yy = -np.sin(y) * np.cos(z) - np.sin(x) * np.cos(y)
    zz = -np.sin(z) * np.cos(x) - np.sin(y) * np.cos(z)
    product = np.stack(
        [xx * g[0] + xy * g[1] + zx * g[2], xy * g[0] + yy * g[1] + yz * g[2], zx * g[0] + yz * g[1] + zz * g[2]]
    )
    square = np.sum(g * g, axis=0)
    return (square * (xx + yy + zz) - np.sum(g * product, axis=0)) / (2 * square**1.5)


def on_level_set(places: Floats) -> Floats:
    """Nearby places carried onto the level set by Newton's method along its gradient; shape (3, ...)."""
    for _ in range(_PROJECTIONS):
        g = gradient(places)
        places = places - value(places) / np.sum(g * g, axis=0) * g
    return places

"""The wall of a graded lattice: every patch fitted anew, all at once, by one linear operator.

On a grid of samples with the square's border in it, the staged fit of :mod:`gyroid_cad.surface.fit` (corners, then
edges from their own samples, then the interior) is one small matrix applied along u and then along v. So all
patches take two matrix products, and an edge's control points still depend on nothing but the edge.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.arrays import dot, unit
from gyroid_cad.errors import FitError, ParameterError
from gyroid_cad.nurbs.basis import basis, uniform_knots
from gyroid_cad.nurbs.surface import edge_row
from gyroid_cad.surface.fit import DEGREE, MOST_CONTROL_POINTS
from gyroid_cad.surface.fit_report import more_control_points
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.distances import met_along_normals
from gyroid_cad.wall.exact import offset_patches
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.offset import Wall

__all__ = ["Refit", "fitted_nets", "graded_wall", "likely_control_points", "measured"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# The wall may be off by so many times the tolerance, relative to itself.
WALL_PER_TOLERANCE = 5.0
# In mm. Of thinner walls the error counts as if they were this thick: a hundred thousandth of a mm is no error.
_LEAST_WALL_TOLD = 0.02
_CHECKS_PER_SPAN = 2
_TRIED_PATCHES = 32
_LARGEST_EXCESS_TRUSTED = 16.0
# How far control points of one edge may differ between its two patches, in cell sizes: rounding, amplified by
# differences where a map has no Jacobian, leaves 1e-12.
_EDGE_GAP_LIMIT = 1e-9


@dataclass(frozen=True, slots=True)
class Refit:
    """Errors of the fit of a graded wall.

    Attributes
    ----------
    control_points : int
        Along each side of every patch.
    max_deviation : float
        In mm, of both faces from the exact ones, along their normals.
    max_wall_error : float
        Relative, of the distance between the faces along the exact normal; to 0.02 mm of thinner walls.
    max_normal_angle : float
        In degrees, between the normals of the fitted and of the exact mid-surface.
    min_thickness, max_thickness : float
        Wall asked for, in mm.
    samples : int
        Along each side of a patch, at which all this was measured.
    """

    control_points: int
    max_deviation: float
    max_wall_error: float
    max_normal_angle: float
    min_thickness: float
    max_thickness: float
    samples: int

    def excess(self, tolerance: float, cell_size: float) -> float:
        """Error of the fit in units of what it may be."""
        return max(self.max_deviation / (tolerance * cell_size), self.max_wall_error / (WALL_PER_TOLERANCE * tolerance))

    def control_points_for(self, tolerance: float, cell_size: float) -> int:
        """Number of control points to fit with next; as many as now if the fit is close enough.

        Parameters
        ----------
        tolerance : float
            Largest deviation of either face, in cell sizes.
        cell_size : float
            In mm.

        Raises
        ------
        ParameterError
            If the tolerance is out of reach.
        """
        reached = self.max_deviation / cell_size
        excess = self.excess(tolerance, cell_size)
        if excess <= 1:
            return self.control_points
        if self.control_points == MOST_CONTROL_POINTS:
            raise ParameterError(
                "tolerance",
                tolerance,
                f"at least {tolerance * excess:.2g}: {MOST_CONTROL_POINTS} control points a side are {reached:.2g} of "
                f"the cell size off, and the wall {self.max_wall_error:.2g} of itself, which counts as a "
                f"{WALL_PER_TOLERANCE:g}th; is a field or the map not smooth?",
            )
        return more_control_points(self.control_points, excess)


def likely_control_points(complex: CellComplex, grading: Grading, least: int, tolerance: float) -> int:
    """Number of control points that the tolerance is likely to take, from a fit of a few patches.

    Parameters
    ----------
    complex : CellComplex
    grading : Grading
    least : int
        Control points to fit those with, and the least to answer.
    tolerance : float
        In cell sizes.

    Raises
    ------
    ParameterError
        If even the finest fit of those few misses the tolerance.
    FitError
        If that is because a field or the map is not continuous.
    """
    few = np.unique(np.linspace(0, complex.patch_count - 1, _TRIED_PATCHES).astype(np.int64))
    made = measured(fitted_nets(complex, grading, least, few), complex, grading, few)
    excess = made.excess(tolerance, grading.cell_size)
    if excess <= 1:
        return least
    if more_control_points(least, excess) == MOST_CONTROL_POINTS:
        finest = measured(fitted_nets(complex, grading, MOST_CONTROL_POINTS, few), complex, grading, few)
        if finest.excess(tolerance, grading.cell_size) > 1:
            # All patches take the finest fit many seconds. A jump, which a coarse fit shows as well, is told as one.
            graded_wall(complex, grading, least)
            finest.control_points_for(tolerance, grading.cell_size)
    # A wall that folds is off by any amount; whether it does is not for this to say.
    return more_control_points(least, min(excess, _LARGEST_EXCESS_TRUSTED))


def graded_wall(complex: CellComplex, grading: Grading, control_points: int) -> Wall:
    """Fit every patch's two faces with so many control points a side, each by itself.

    Raises
    ------
    ParameterError
        If a field or the map is no good somewhere.
    FitError
        If neighbouring patches do not meet, because a field or the map is not continuous.
    """
    patches = np.arange(complex.patch_count)
    wall = Wall(
        complex=complex,
        nets=fitted_nets(complex, grading, control_points, patches),
        patch_net=patches,
        shifts=np.zeros((1, 3)),
        patch_shift=np.zeros_like(patches),
        weights=np.ones((control_points, control_points)),
        knots=uniform_knots(control_points),
    )
    _require_shared_edges(wall, grading.cell_size)
    return wall


def fitted_nets(complex: CellComplex, grading: Grading, control_points: int, patches: Integers) -> Floats:
    """Control points of the two faces of some patches; shape (patches, 2, n, n, 3)."""
    samples, operator = _fit_operator(control_points)
    nets = np.empty((len(patches), 2, control_points, control_points, 3))
    for some, fitted in offset_patches(complex, grading, samples, patches):
        offset = fitted.normals * (fitted.thickness / 2)[:, np.newaxis]
        faces = np.concatenate([fitted.points - offset, fitted.points + offset], axis=1)
        along_u = operator @ faces.reshape(-1, len(samples), len(samples) * 6)
        net = operator @ along_u.reshape(-1, control_points, len(samples), 6)
        nets[some] = np.moveaxis(net.reshape(*net.shape[:-1], 2, 3), -2, 1)
    return nets


def measured(nets: Floats, complex: CellComplex, grading: Grading, patches: Integers | None = None) -> Refit:
    """Measure fitted patches against the exact wall, twice a span and at the ends.

    Parameters
    ----------
    nets : ndarray, shape (patches, 2, n, n, 3)
    complex : CellComplex
    grading : Grading
    patches : ndarray of int, optional
        Which patches the nets are of; all if left out.

    Returns
    -------
    Refit
    """
    n = nets.shape[2]
    knots, weights = uniform_knots(n), np.ones((n, n))
    samples = np.linspace(-1, 1, _CHECKS_PER_SPAN * (n - DEGREE) + 1)
    worst = np.zeros(3)
    thinnest, thickest = np.inf, 0.0
    for some, fitted in offset_patches(complex, grading, samples, patches):
        met, du, dv, across = met_along_normals(nets[some], weights, knots, samples, fitted)
        shape = (len(met), len(samples), len(samples))
        thickness, normal = fitted.thickness.reshape(shape), fitted.normals.reshape(*shape, 3)
        # From the exact faces, along the fitted faces' own normals.
        off = met - np.stack([-thickness / 2, thickness / 2], axis=1)
        distance = np.abs(off * dot(unit(across), normal[:, np.newaxis])).max(axis=1)
        middle = unit(np.cross(du.sum(axis=1), dv.sum(axis=1)))
        sine = np.linalg.norm(np.cross(middle, normal), axis=-1)
        wall_error = np.abs(off[:, 1] - off[:, 0]) / np.maximum(np.abs(thickness), _LEAST_WALL_TOLD)
        for index, values in enumerate((distance, wall_error, sine)):
            worst[index] = grading.largest(values.ravel(), worst[index], fitted.points, np.abs(fitted.thickness) / 2)
        thinnest, thickest = grading.extremes(fitted, thinnest, thickest)
    angle = float(np.degrees(np.arcsin(min(worst[2], 1.0))))
    return Refit(n, float(worst[0]), float(worst[1]), angle, thinnest, thickest, len(samples))


@lru_cache(maxsize=16)
def _fit_operator(control_points: int) -> tuple[Floats, Floats]:
    """Samples on [-1, 1], ends included, and the matrix from values there to the control points of a curve.

    The ends are interpolated, the rest are least squares (eqs. (12), (13)) over evenly spaced samples, two more than
    there are control points between the ends: as close as over twice as many Gauss points.
    """
    knots = uniform_knots(control_points)
    inner = (np.arange(control_points) + 0.5) / control_points * 2 - 1
    functions = basis(knots, DEGREE, inner)
    solve = np.linalg.pinv(functions[:, 1:-1])
    ends = -solve @ functions[:, [0, -1]]
    operator = np.zeros((control_points, control_points + 2))
    operator[0, 0] = operator[-1, -1] = 1.0
    operator[1:-1] = np.column_stack([ends[:, 0], solve, ends[:, 1]])
    return np.concatenate([[-1.0], inner, [1.0]]), operator


def _require_shared_edges(wall: Wall, cell_size: float) -> None:
    """Compare the control points that two patches have for their common edge."""
    complex = wall.complex
    rows = np.stack([edge_row(np.moveaxis(wall.nets, (2, 3), (0, 1)), k) for k in range(4)])
    rows = np.where(complex.edge_forward.T[:, np.newaxis, :, np.newaxis, np.newaxis], rows, rows[:, ::-1])
    patch, k = np.divmod(np.argsort(complex.patch_edges.ravel(), kind="stable"), 4)
    order = complex.patch_edges[patch, k]
    pair = np.flatnonzero(order[1:] == order[:-1])
    gaps = np.abs(rows[k[pair], :, patch[pair]] - rows[k[pair + 1], :, patch[pair + 1]]).max(axis=(1, 2, 3))
    worst = int(np.argmax(gaps)) if len(gaps) else 0
    if len(gaps) and gaps[worst] > _EDGE_GAP_LIMIT * cell_size:
        middle = wall.nets[patch[pair[worst]]].mean(axis=(0, 1, 2))
        place = ", ".join(f"{p:.6g}" for p in middle)
        raise FitError(
            f"the edges of neighbouring patches are {gaps[worst]:.2g} mm apart near ({place}) mm of the part: "
            "thickness, density, scale_field and map must be continuous, and the same at both ends that a map joins"
        )

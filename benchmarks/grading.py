"""Lattices that vary: what fitting every patch anew costs, and how true the wall and the volume come out.

The subjects are the paper's three specimens (sec. 3.2, a unit is 5 mm) and a closed cylinder. What they should be is
worked out beside the package's fields, maps and quadrature: from plain formulas of the wall and of where places are
carried, with differences along the exact patch for normals and derivatives. The wall is measured by rays from the
exact mid-surface along its normal, both ways, at random places of all patches; Newton's method finds where they
meet the fitted faces. The exact volume is by Gauss quadrature of the volume element.

Run: ``python -m benchmarks.grading [--rays N] [--repeats N] [--small]``; ``--small`` is one cell of each, half the
cylinder's, few rays.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from benchmarks.timing import Row, arguments_for, best_in_turn, plain_table, print_verdicts
from gyroid_cad import Lattice
from gyroid_cad.builds.solid import Build
from gyroid_cad.kernel.solid import build_solid
from gyroid_cad.kernel.step import write_step
from gyroid_cad.maps import Cylinder
from gyroid_cad.nurbs.basis import basis
from gyroid_cad.surface.patch import PARAMETERISATIONS
from gyroid_cad.surface.symmetry import QUARTER
from gyroid_cad.wall.complex import CellComplex
from gyroid_cad.wall.fitted import USUAL_TOLERANCE, LatticeSpec, fit_spec
from gyroid_cad.wall.offset import SIDES, Wall
from gyroid_cad.wall.refit import graded_wall

__all__ = ["main"]

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

# In mm: the paper's unit, and the cubic cell before it is carried anywhere.
_UNIT, _CELL = 5.0, 10.0
_RADIUS, _CELLS_ROUND = 20.0, 12
_SEED = 16
# Of differences along the patch, which is two wide: what they leave out and what they round off stays below 1e-8.
_STEP = 1e-4
_DEGREE = 3
_NEWTON_STEPS = 8
_GAUSS_POINTS = 16
# Two points across the wall, where the volume element is quadratic, are exact.
_ACROSS = (-(3**-0.5), 3**-0.5)
_HEADINGS = ("", "cells", "faces", "wall, mm", "control points", "deviation, mm", "/ cell size", "normal off by")


@dataclass(frozen=True, slots=True)
class _Subject:
    """A lattice and what it should be.

    Attributes
    ----------
    name : str
    lattice : Lattice
    wall : tuple of float
        In units: thickness at the origin and its slopes along x and y.
    image : callable
        Where places, shape (..., 3), are carried to, in mm.
    """

    name: str
    lattice: Lattice
    wall: tuple[float, float, float]
    image: Callable[[Floats], Floats]

    def thickness(self, places: Floats) -> Floats:
        """Whole wall in mm."""
        return _UNIT * _linear(places, *self.wall)


def main(arguments: Sequence[str] = ()) -> bool:
    """Print the tables; returns whether every requirement is met."""
    parser = arguments_for("Measure lattices that vary.")
    parser.add_argument("--rays", type=int, default=10_000, help="through the wall of each subject (default 10000)")
    parser.add_argument("--repeats", type=int, default=3, help="the best counts (default 3)")
    options = parser.parse_args(arguments)
    if options.small:
        options.rays, options.repeats = 100, 1
    subjects = [subject(options.small) for subject in (_case_3, _case_1, _case_2, _cylinder)]
    builds = [(subject, _built(subject.lattice)) for subject in subjects]
    plain_table("What a tolerance of 1e-4 cell sizes takes", _HEADINGS, [_figures(*pair) for pair in builds])
    rows = _time_rows(*builds[0], options.repeats)
    for pair in builds:
        rows += [_wall_row(*pair, options.rays), _volume_row(*pair)]
    return print_verdicts("Lattices that vary", rows)


def _case_1(small: bool) -> _Subject:
    lattice = Lattice.paper((1, 1, 1) if small else (3, 3, 1), "0.08 + 0.05*x + 0.02*y", scale=_UNIT)
    return _Subject("case 1", lattice, (0.08, 0.05, 0.02), lambda places: places)


def _case_2(small: bool) -> _Subject:
    lattice = Lattice.paper((1, 1, 1) if small else (3, 3, 1), 0.08, "1 + 0.3*x + 0.08*y", scale=_UNIT)
    return _Subject("case 2", lattice, (0.08, 0, 0), lambda p: _linear(p, 1, 0.3, 0.08)[..., np.newaxis] * p)


def _case_3(small: bool) -> _Subject:
    cells = (1, 1, 1) if small else (3, 3, 2)
    lattice = Lattice.paper(cells, "0.08 + 0.05*x + 0.02*y", "1 + 0.05*x + 0.08*y", scale=_UNIT)
    return _Subject("case 3", lattice, (0.08, 0.05, 0.02), lambda p: _linear(p, 1, 0.05, 0.08)[..., np.newaxis] * p)


def _cylinder(small: bool) -> _Subject:
    lattice = Lattice((_CELLS_ROUND, 1 if small else 2, 1), _CELL, 0.16 * _UNIT, map=Cylinder(_RADIUS, angle=360))
    return _Subject("closed cylinder", lattice, (0.16, 0, 0), _wrapped)


def _linear(places: Floats, at_origin: float, along_x: float, along_y: float) -> Floats:
    return np.asarray(at_origin + (along_x * places[..., 0] + along_y * places[..., 1]) / _UNIT)


def _wrapped(places: Floats) -> Floats:
    angle, out = places[..., 0] * (2 * np.pi / (_CELLS_ROUND * _CELL)), _RADIUS + places[..., 2]
    return np.stack([out * np.cos(angle), out * np.sin(angle), places[..., 1]], axis=-1)


def _built(lattice: Lattice) -> Build:
    """Anew, whatever was built before."""
    return Build(fit_spec(LatticeSpec(lattice.cells, lattice.grading(), lattice.fit, USUAL_TOLERANCE)), None)


def _figures(subject: _Subject, built: Build) -> tuple[str, ...]:
    refit = built.fitted.refit
    assert refit is not None
    return (
        subject.name,
        " x ".join(map(str, built.cells)),
        f"{built.topology.faces}",
        f"{refit.min_thickness:.3f} to {refit.max_thickness:.3f}",
        f"{refit.control_points}",
        f"{refit.max_deviation:.1e}",
        f"{refit.max_deviation / _CELL:.1e}",
        f"{refit.max_normal_angle:.4f}°",
    )


def _time_rows(subject: _Subject, built: Build, repeats: int) -> list[Row]:
    """Of case 3, against the kernel's part of it and against the same cells, all alike."""
    points = len(built.fitted.wall.weights)
    along = np.linspace(-1, 1, points + 2)
    (fitting, _), (making, _), (sampling, _) = best_in_turn(
        repeats,
        lambda: graded_wall(built.fitted.complex, built.fitted.spec.grading, points),
        lambda: build_solid(built.fitted.wall),
        lambda: PARAMETERISATIONS["smooth"](along[:, np.newaxis], along),
    )
    lattices = subject.lattice, Lattice.paper(built.cells, 0.08, scale=_UNIT)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "lattice.step"
        (varying, size), (alike, alike_size) = best_in_turn(
            repeats, *(lambda lattice=lattice: _step_bytes(lattice, path) for lattice in lattices)
        )
    return [
        Row(
            "case 3: fitting all patches / solid",
            fitting / making,
            0.1,
            unit="x",
            remark=f"{fitting:.3f} s, {making:.3f} s",
        ),
        Row(
            "the same and sampling the exact patch",
            (fitting + sampling) / making,
            unit="x",
            remark=f"{sampling:.3f} s: once a process and number of points",
        ),
        Row(
            "case 3 to STEP / the same, all alike",
            varying / alike,
            3,
            unit="x",
            remark=f"{varying:.1f} s, {size / 1e6:.1f} MB; {alike:.1f} s, {alike_size / 1e6:.1f} MB",
        ),
    ]


def _step_bytes(lattice: Lattice, path: Path) -> int:
    write_step(_built(lattice).solid(), path)
    return path.stat().st_size


def _wall_row(subject: _Subject, built: Build, rays: int) -> Row:
    random = np.random.default_rng(_SEED)
    patches = random.integers(built.fitted.complex.patch_count, size=rays)
    u, v = random.uniform(_STEP - 1, 1 - _STEP, (2, rays))
    ahead = _STEP * np.array([(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)])[..., np.newaxis]
    points, _ = PARAMETERISATIONS["smooth"](u + ahead[:, 0], v + ahead[:, 1])
    places = _places(built.fitted.complex, patches, points)
    middle, along_u, back_u, along_v, back_v = subject.image(places)
    normals = _unit(np.cross(along_u - back_u, along_v - back_v))
    half = subject.thickness(places[0]) / 2
    distances = (_met(built.fitted.wall, patches, side, (u, v), middle, normals, half) for side in SIDES)
    errors = np.abs(np.stack(list(distances)) - half)
    return Row(
        f"{subject.name}: half the wall, relative error",
        float(np.max(errors / half)),
        1e-3,
        remark=f"{rays} rays; {errors.max():.1e} mm",
    )


def _volume_row(subject: _Subject, built: Build) -> Row:
    exact = _exact_volume(subject, built.fitted.complex)
    return Row(
        f"{subject.name}: volume, relative error",
        abs(built.volume / exact - 1),
        1e-4,
        remark=f"{exact:.4f} mm³; the package's own: {subject.lattice.exact_volume / exact - 1:+.0e}",
    )


def _places(complex: CellComplex, patches: Integers, points: Floats) -> Floats:
    """Where points of the exact patch, shape (..., 3), are in some patches, in mm, before they are carried anywhere."""
    placement = complex.patch_placement[patches]
    turned = np.einsum("...ij,...j->...i", complex.placements.matrices[placement], points)
    in_units = turned + QUARTER * complex.placements.translations[placement]
    return np.asarray(in_units * (_CELL / 2) + complex.patch_cell[patches] * _CELL)


def _met(
    wall: Wall,
    patches: Integers,
    side: int,
    parameters: tuple[Floats, Floats],
    middle: Floats,
    normals: Floats,
    half: Floats,
) -> Floats:
    """How far from the mid-surface rays meet one face, in mm: Newton's method for u, v and the distance at once."""
    nets = wall.nets[wall.patch_net[patches], side]
    start, direction = middle - wall.shifts[wall.patch_shift[patches]], (2 * side - 1) * normals
    u, v, distance = *parameters, half
    for _ in range(_NEWTON_STEPS):
        (at_u, rate_u), (at_v, rate_v) = (
            [basis(wall.knots, _DEGREE, along, order) for order in (0, 1)] for along in (u, v)
        )
        point, along_u, along_v = (
            np.einsum("rn,rnmc,rm->rc", a, nets, b, optimize=True)
            for a, b in ((at_u, at_v), (rate_u, at_v), (at_u, rate_v))
        )
        off = start + distance[:, np.newaxis] * direction - point
        columns = np.stack([along_u, along_v, -direction], axis=-1)
        step_u, step_v, step = np.linalg.solve(columns, off[..., np.newaxis])[..., 0].T
        u, v, distance = u + step_u, v + step_v, distance + step
    if not np.abs(step).max() < 1e-9:
        raise ArithmeticError("a ray meets no face: Newton's method does not settle")
    return distance


def _exact_volume(subject: _Subject, complex: CellComplex) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    # Two steps to each side of a node: one for the normal, one for the derivative of a face that takes the normal.
    stencil = (nodes[:, np.newaxis] + _STEP * np.arange(-2, 3)).ravel()
    points, _ = PARAMETERISATIONS["smooth"](stencil[:, np.newaxis], stencil)
    points = points.reshape(_GAUSS_POINTS, 5, _GAUSS_POINTS, 5, 3)
    elements = (
        _volume_element(subject, _places(complex, np.asarray(patch), points)) for patch in range(complex.patch_count)
    )
    return float(weights @ sum(elements) @ weights)


def _volume_element(subject: _Subject, places: Floats) -> Floats:
    """Summed across the wall, at every node; places have two axes of nodes, each followed by that of its stencil."""
    middle = subject.image(places)
    normals = _unit(np.cross(_rate(middle, 1)[:, :, :, 1:-1], _rate(middle, 3)[:, 1:-1]))
    middle, places = middle[:, 1:-1, :, 1:-1], places[:, 1:-1, :, 1:-1]
    half = normals * (subject.thickness(places) / 2)[..., np.newaxis]
    element = 0.0
    for across in _ACROSS:
        layer = middle + across * half
        area = np.cross(_rate(layer, 1)[:, 0, :, 1], _rate(layer, 3)[:, 1, :, 0])
        element += np.sum(area * half[:, 1, :, 1], axis=-1)
    return np.asarray(element)


def _rate(values: Floats, axis: int) -> Floats:
    """Central differences along a stencil, which gets two shorter."""
    along = np.moveaxis(values, axis, 0)
    return np.moveaxis((along[2:] - along[:-2]) / (2 * _STEP), 0, axis)


def _unit(vectors: Floats) -> Floats:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


if __name__ == "__main__":
    sys.exit(not main(sys.argv[1:]))

"""Effective properties of a lattice: what a part of many cells does, by one periodic cell, and how closely it is known.

Meshes of few elements are solved, and what finer ones would give is extrapolated (Richardson): along the patches from
three to seven elements a side (of the diamond's smaller ones from two to five), and across the wall from two to three
layers. The two corrections are small and independent; both together are told as the error.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.builds.meshes import hexahedral_mesh
from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import finite_number, positive_number
from gyroid_cad.common.choices import Kind
from gyroid_cad.common.progress import Progress, report_progress
from gyroid_cad.common.verdicts import as_point
from gyroid_cad.errors import GyroidError, ParameterError
from gyroid_cad.mesh.finite_elements.periodic import periodic_pairs
from gyroid_cad.wall.fitted import LatticeSpec, fitted_wall
from gyroid_cad.wall.limits import require_sheet

if TYPE_CHECKING:
    from gyroid_cad.mesh.finite_elements.homogenised import EffectiveTensors

__all__ = ["LatticeProperties", "Properties"]

Floats = NDArray[np.float64]

# Elements a side of a patch, few and more: of cells of so many patches, and of those of more and smaller ones.
_PATCHES, _SIDES, _SIDES_OF_SMALL_ONES = 24, (3, 7), (2, 5)
# Layers across the wall; with what power of either number the error falls.
_FEW_LAYERS, _MORE_LAYERS = 2, 3
_ORDER = 4
# Directions at which the stiffness is looked at, for where it is largest and smallest: of a hemisphere.
_DIRECTIONS = 20_000


@dataclass(frozen=True, slots=True)
class Properties:
    """Effective properties of an endless lattice; stresses in the unit of the solid's modulus.

    Attributes
    ----------
    density : float
    youngs_modulus, poisson_ratio, conductivity : float
        Of the solid, as they were given.
    stiffness : tuple of tuple of float
        6 x 6, in Voigt's order xx, yy, zz, yz, xz, xy with engineering shear strains.
    moduli, shear_moduli : tuple of float
        Young's modulus along x, y and z; shear moduli yz, xz, xy.
    relative_modulus : float
        Young's modulus along x, of the solid's.
    lateral_ratio : float
        Poisson's ratio between x and y.
    zener_ratio : float
        2 C44 / (C11 - C12): 1 where all directions are alike.
    stiffest, softest : (modulus, direction)
        Largest and smallest Young's modulus, and a direction that has it.
    effective_conductivity : tuple of tuple of float
        3 x 3, in the unit of the solid's.
    error : float
        Of stiffness and conductivity, in parts of the largest entry: what was extrapolated.

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> found = Lattice((1, 1, 1), 10, density=0.3, surface="primitive").properties(youngs_modulus=1000)
    >>> f"{found.moduli[0]:.1f} {found.zener_ratio:.3f} {found.error < 1e-3}"
    '87.5 1.909 True'
    """

    density: float
    youngs_modulus: float
    poisson_ratio: float
    conductivity: float
    stiffness: tuple[tuple[float, ...], ...]
    moduli: Point
    shear_moduli: Point
    relative_modulus: float
    lateral_ratio: float
    zener_ratio: float
    stiffest: tuple[float, Point]
    softest: tuple[float, Point]
    effective_conductivity: tuple[tuple[float, ...], ...]
    error: float

    def as_dict(self) -> dict[str, Any]:
        """All of it, by name."""
        return asdict(self)

    def rows(self) -> list[tuple[str, str]]:
        """Rows of the table that the command line prints."""
        c = self.stiffness
        return [
            ("density", f"{self.density:.5g}"),
            ("Young's modulus along x, y, z", ", ".join(f"{value:.5g}" for value in self.moduli)),
            ("of the solid's", f"{self.relative_modulus:.5g}"),
            ("shear modulus yz, xz, xy", ", ".join(f"{value:.5g}" for value in self.shear_moduli)),
            ("Poisson's ratio", f"{self.lateral_ratio:.5g}"),
            ("C11, C12, C44", ", ".join(f"{value:.5g}" for value in (c[0][0], c[0][1], c[3][3]))),
            ("Zener ratio", f"{self.zener_ratio:.5g}"),
            ("stiffest", _directed(*self.stiffest)),
            ("softest", _directed(*self.softest)),
            ("conductivity along x, y, z", ", ".join(f"{self.effective_conductivity[k][k]:.5g}" for k in range(3))),
            ("error", f"{self.error:.1e}"),
        ]


def _directed(modulus: float, way: Point) -> str:
    return f"{modulus:.5g} along ({', '.join(f'{part:.2f}' for part in way)})"


def _effective_properties(
    spec: LatticeSpec,
    density: float,
    youngs_modulus: float,
    poisson_ratio: float,
    conductivity: float,
    progress: Progress | None = None,
) -> Properties:
    if not spec.grading.uniform:
        raise ParameterError("cells", spec.cells, "a lattice whose wall and cells are alike throughout: one is solved")
    modulus = positive_number("youngs_modulus", youngs_modulus)
    carried = positive_number("conductivity", conductivity)
    lateral = finite_number("poisson_ratio", poisson_ratio, "a number above -1 and below 0.5")
    if not -1 < lateral < 0.5:
        raise ParameterError("poisson_ratio", poisson_ratio, "above -1 and below 0.5")
    relative, carries, error = _extrapolated(_one_cell(spec), lateral, progress)
    stiffness = modulus * relative
    compliance: Floats = np.asarray(np.linalg.inv(stiffness), dtype=np.float64)
    moduli, shears = (1 / np.diag(compliance)[part] for part in (slice(3), slice(3, 6)))
    extremes = _extremes(compliance)
    return Properties(
        density,
        modulus,
        lateral,
        carried,
        _rows(stiffness),
        as_point(moduli),
        as_point(shears),
        float(moduli[0] / modulus),
        float(-compliance[0, 1] / compliance[0, 0]),
        float(2 * stiffness[3, 3] / (stiffness[0, 0] - stiffness[0, 1])),
        *extremes,
        _rows(carried * carries),
        error,
    )


class Described(Protocol):
    """Stands for :class:`gyroid_cad.Lattice`."""

    @property
    def kind(self) -> Kind: ...

    @property
    def volume_fraction(self) -> float: ...

    def spec(self) -> LatticeSpec: ...


class LatticeProperties:
    """Mixin of :class:`gyroid_cad.Lattice`: what a part of many of its cells does."""

    __slots__ = ()

    def properties(
        self: Described,
        youngs_modulus: float = 1.0,
        poisson_ratio: float = 0.3,
        conductivity: float = 1.0,
        progress: Progress | None = None,
    ) -> Properties:
        """Effective elasticity and conductivity of an endless lattice, along its own axes.

        One periodic cell of quadratic hexahedra is solved, by scikit-fem and SciPy: ``pip install
        'gyroid_cad[analysis]'``.

        Parameters
        ----------
        youngs_modulus, poisson_ratio : float
            Of the solid, which is isotropic; the modulus in any unit, which is that of all stiffnesses.
        conductivity : float
            Of the solid, for heat or electricity, in any unit.
        progress : callable, optional
            Called with (stage, done, total).

        Returns
        -------
        Properties

        Raises
        ------
        ParameterError
            If the lattice varies or is no sheet, or the solid is none.
        GyroidError
            If scikit-fem is not installed.

        Examples
        --------
        >>> lattice = Lattice((1, 1, 1), 10, density=0.3, surface="primitive")
        >>> f"{lattice.properties(youngs_modulus=110_000, poisson_ratio=0.34).relative_modulus:.3f}"
        '0.088'
        """
        require_sheet(self.kind)
        return _effective_properties(
            self.spec(), self.volume_fraction, youngs_modulus, poisson_ratio, conductivity, progress
        )


def _one_cell(spec: LatticeSpec) -> LatticeSpec:
    """One cell alone, where it is at home: what is effective knows of no place."""
    return LatticeSpec((1, 1, 1), spec.grading, spec.settings, spec.tolerance)


def _extrapolated(cell: LatticeSpec, poisson_ratio: float, progress: Progress | None) -> tuple[Floats, Floats, float]:
    """Extrapolate to meshes without end; the last number is by how much that differs from what was solved."""
    few, many = _SIDES if len(cell.grading.surface.cell) <= _PATCHES else _SIDES_OF_SMALL_ONES
    meshes = ((many, 1), (few, 1), (few, _FEW_LAYERS), (few, _MORE_LAYERS))
    solved = []
    for number, (subdivisions, layers) in enumerate(meshes):
        report_progress(progress, "solve", number, len(meshes))
        solved.append(_solved(cell, subdivisions, layers, poisson_ratio))
    report_progress(progress, "solve", len(meshes), len(meshes))
    along = (many / few) ** _ORDER - 1
    across = (_MORE_LAYERS / _FEW_LAYERS) ** _ORDER - 1
    results, errors = [], []
    for fine, coarse, thick, thin in zip(*((one.stiffness, one.conductivity) for one in solved), strict=True):
        further, thinner = (fine - coarse) / along, (thin - thick) / across
        results.append(fine + further + (thin - coarse) + thinner)
        errors.append(float((np.abs(further) + np.abs(thinner)).max() / np.abs(results[-1]).max()))
    return results[0], results[1], max(errors)


@lru_cache(maxsize=16)
def _solved(cell: LatticeSpec, subdivisions: int, layers: int, poisson_ratio: float) -> EffectiveTensors:
    try:
        from gyroid_cad.mesh.finite_elements.homogenised import homogenised
    except ModuleNotFoundError as missing:
        raise GyroidError(f"effective properties need {missing.name}: pip install 'gyroid_cad[analysis]'") from None
    mesh = hexahedral_mesh(fitted_wall(cell), subdivisions, layers, order=2, full=True)
    size = cell.grading.cell_size
    return homogenised(mesh, periodic_pairs(mesh, size), size**3, poisson_ratio)


def _extremes(compliance: Floats) -> tuple[tuple[float, Point], tuple[float, Point]]:
    """Largest and smallest Young's modulus, and directions that have them; by a spiral over half the sphere."""
    z = 1 - (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    turn = np.pi * (1 + np.sqrt(5)) * np.arange(_DIRECTIONS)
    across = np.sqrt(1 - z**2)
    # The axes first, so that of directions that are alike the simplest is told.
    simple = [way for way in np.ndindex(2, 2, 2) if any(way)]
    named = np.array(sorted(simple, key=lambda way: (sum(way), [-part for part in way])), dtype=float)
    named /= np.linalg.norm(named, axis=1)[:, np.newaxis]
    ways = np.concatenate([named, np.column_stack([across * np.cos(turn), across * np.sin(turn), z])])
    x, y, z = ways.T
    stress = np.stack([x * x, y * y, z * z, y * z, x * z, x * y])
    moduli = 1 / np.einsum("im,ij,jm->m", stress, compliance, stress)
    first, last = (int(np.argmax(np.round(sign * moduli / moduli.max(), 6))) for sign in (1, -1))
    return (float(moduli[first]), as_point(ways[first])), (float(moduli[last]), as_point(ways[last]))


def _rows(matrix: Floats) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, matrix.tolist()))

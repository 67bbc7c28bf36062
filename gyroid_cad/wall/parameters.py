"""Parameters of a lattice: checked when they are given, and turned into what is to be built."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import prod
from typing import Self

from numpy.typing import ArrayLike

from gyroid_cad.common.arrays import Point
from gyroid_cad.common.checks import finite_number, positive_number
from gyroid_cad.common.choices import BLOCK_KINDS, TARGETS, TRIMS, Kind, SurfaceName, Trim
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field, FieldLike, as_field
from gyroid_cad.fields.makers import paper_units
from gyroid_cad.maps.block import as_map, space_over
from gyroid_cad.maps.space import BlockMap
from gyroid_cad.surface.families import MinimalSurface, surface_named
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.wall.complex import build_complex
from gyroid_cad.wall.covering import block_extent, placement
from gyroid_cad.wall.exact import ExactMeasures, block_volume, exact_measures
from gyroid_cad.wall.fitted import HOME, Closeness, FittedWall, LatticeSpec, fitted_wall, valid_tolerance
from gyroid_cad.wall.grading import Grading
from gyroid_cad.wall.limits import (
    NETWORK_KINDS,
    SHEET_KIND,
    network_density,
    require_cell_size,
    require_density,
    require_one,
    require_sheet,
    require_thickness,
    wall_beside_network,
    whole_cells,
)
from gyroid_cad.wall.offset import Wall

__all__ = ["LatticeParameters", "MapLike"]

MapLike = BlockMap | str | Callable[..., Sequence[ArrayLike]]

_FIELDS = {
    "thickness": "a length in mm",
    "density": "a volume fraction",
    "scale_field": "a factor without unit",
}


@dataclass(frozen=True, slots=True)
class LatticeParameters:
    """The parameters of :class:`gyroid_cad.Lattice`, which tells of each, and what follows from them alone."""

    cells: tuple[int, int, int]
    # A number once its description is complete: it may follow from others.
    cell_size: float = None  # type: ignore[assignment]
    thickness: FieldLike | None = None
    density: FieldLike | None = None
    fit: FitSettings = field(default_factory=FitSettings)
    scale_field: FieldLike | None = None
    map: MapLike | None = None
    tolerance: float | None = None
    trim: Trim | None = None
    surface: SurfaceName = "gyroid"
    keep_islands: bool = False
    origin: Point = HOME
    rotation: Point = HOME
    compact: float | None = None
    kind: Kind = SHEET_KIND
    porosity: FieldLike | None = None
    pore_size: float | None = None
    throat: float | None = None
    hydraulic_diameter: float | None = None
    area_per_volume: float | None = None
    curvature_radius: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", whole_cells(self.cells))
        self._take_targets()
        object.__setattr__(
            self, "cell_size", finite_number("cell_size", self.cell_size, "a length in mm, a finite number")
        )
        require_cell_size(self.cell_size)
        require_one(self.thickness, self.density)
        self._require_kind()
        for name, meaning in _FIELDS.items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, as_field(name, getattr(self, name), meaning))
        if self.map is not None:
            object.__setattr__(self, "map", as_map(self.map))
        surface_named(self.surface)
        for name, placed in zip(("origin", "rotation"), placement(self.origin, self.rotation), strict=True):
            object.__setattr__(self, name, placed)
        self._require_fit()
        self._require_trim()
        if not self.uniform:
            self._require_variable()
        elif self.density is None:
            require_thickness(self.wall_thickness, self.cell_size, self.minimal_surface.tube)
        elif not self.network:
            require_density(self.volume_fraction, self.cell_size, self.minimal_surface.tube)

    @classmethod
    def paper(
        cls,
        cells: tuple[int, int, int],
        thickness_factor: FieldLike,
        bc_length: FieldLike = 1.0,
        scale: float = 1.0,
        fit: FitSettings | None = None,
        tolerance: float | None = None,
        surface: SurfaceName = "gyroid",
        origin: Point = HOME,
        rotation: Point = HOME,
        compact: float | None = None,
    ) -> Self:
        """A lattice in the paper's own units (sec. 3.2): lengths in BC units, with one scale to millimetres.

        Parameters
        ----------
        cells : tuple of int
            Number of cubic cells along x, y, z; each is two bounding cells long.
        thickness_factor : number or field
            Whole wall in BC units, of places in BC units before they are moved.
        bc_length : number or field
            In BC units: a place p is moved to bc_length(p) p.
        scale : float
            Millimetres per unit of BC length.
        fit, tolerance, surface, origin, rotation, compact
            As of :class:`Lattice`.

        Raises
        ------
        ParameterError

        Examples
        --------
        >>> lattice = Lattice.paper((1, 1, 1), thickness_factor=0.16, scale=5)
        >>> lattice.cell_size, lattice.thickness
        (10.0, 0.8)
        """
        given = paper_units(thickness_factor, bc_length, scale)
        return cls(
            cells,
            given.cell_size,
            given.thickness,
            fit=fit or FitSettings(),
            scale_field=given.scale_field,
            tolerance=tolerance,
            surface=surface,
            origin=origin,
            rotation=rotation,
            compact=compact,
        )

    @property
    def minimal_surface(self) -> MinimalSurface:
        """The surface of that name, from the table of families.

        Examples
        --------
        >>> len(Lattice((1, 1, 1), 10, thickness=0.8, surface="diamond").minimal_surface.cell)
        48
        """
        return surface_named(self.surface)

    @property
    def uniform(self) -> bool:
        """True where every cell is like every other.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness="0.8 + 0.01*x").uniform
        False
        """
        varying = isinstance(self.thickness, Field) or isinstance(self.density, Field)
        return not varying and self.scale_field is None and self.map is None

    @property
    def network(self) -> bool:
        """True of one of the two networks that the surface parts.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, density=0.3, trim="box", kind="network-a").network
        True
        """
        return self.kind in NETWORK_KINDS

    @property
    def wall_thickness(self) -> float:
        """The whole wall in mm, whichever of thickness and density was given; its mean where the lattice is graded.

        Of a network that which both of the surface's networks of its density, or of the rest, would leave between them.

        Examples
        --------
        >>> round(Lattice((1, 1, 1), 10, density=0.3).wall_thickness, 3)
        0.983
        """
        if not self.uniform:
            return self._measures().mean_thickness
        if self.network:
            return 2 * abs(self.minimal_surface.tube.network_offset(self.density)) * self.cell_size  # type: ignore[arg-type]
        if self.density is None:
            return float(self.thickness)  # type: ignore[arg-type]
        return self.minimal_surface.tube.thickness(self.density) * self.cell_size  # type: ignore[arg-type]

    @property
    def volume_fraction(self) -> float:
        """The density, whichever of thickness and density was given; the whole block's where the lattice is graded.

        Examples
        --------
        >>> round(Lattice((1, 1, 1), 10, thickness=0.8).volume_fraction, 4)
        0.2452
        """
        if not self.uniform:
            return self.exact_volume / block_volume(self.cells, self.grading())
        if self.density is None:
            return self.minimal_surface.tube.density(self.wall_thickness / self.cell_size)
        return float(self.density)  # type: ignore[arg-type]

    @property
    def exact_volume(self) -> float:
        """Volume in mm3 of the exact lattice, by the tube formula, or by quadrature where it varies.

        Examples
        --------
        >>> round(Lattice((2, 1, 1), 10, density=0.3).exact_volume, 6)
        600.0
        """
        if not self.uniform:
            wall = self._measures().volume
            # Of what the wall leaves either network has half, to second order in the gradient.
            return (block_volume(self.cells, self.grading()) - wall) / 2 if self.network else wall
        return prod(self.cells) * self.volume_fraction * self.cell_size**3

    def spec(self) -> LatticeSpec:
        """Return what is to be built.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8, tolerance=1e-6).spec().settings.control_points
        14
        """
        family = self.minimal_surface.family if self.uniform else None
        settings, tolerance = Closeness(self.fit, self.tolerance, self.compact).chosen(self.cell_size, family)
        trimmed = self.trim is not None
        return LatticeSpec(
            self.cells, self.grading(), settings, tolerance, trimmed, self.keep_islands, self.origin, self.rotation
        )

    def grading(self) -> Grading:
        """Return how wall and space vary, or that they do not.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).grading().uniform
        True
        """
        if self.uniform:
            return Grading(self.cell_size, self.wall_thickness, surface=self.minimal_surface)
        space = None if self.map is None else space_over(self.map, self.cells, self.cell_size)  # type: ignore[arg-type]
        return Grading(
            self.cell_size,
            self.thickness,  # type: ignore[arg-type]
            wall_beside_network(self.density) if self.network else self.density,  # type: ignore[arg-type]
            self.scale_field,  # type: ignore[arg-type]
            space,
            self.minimal_surface,
            # Patches reach out of a block that is cut from them: there nothing is asked of the wall.
            None if self.trim is None else block_extent(self.cells, self.cell_size),
        )

    def fitted(self, progress: Progress | None = None) -> FittedWall:
        """The wall behind everything else, with its complex and what the fit is worth; no kernel is asked.

        Examples
        --------
        >>> Lattice((1, 1, 1), 10, thickness=0.8).fitted().min_thickness
        0.8
        """
        require_sheet(self.kind)
        return fitted_wall(self.spec(), progress)

    def wall(self) -> Wall:
        """Control nets of the wall's faces, in mm, and the cell complex they belong to.

        Raises
        ------
        FitError
            If the fit's edges do not meet those of its neighbours.

        Examples
        --------
        >>> wall = Lattice((1, 1, 1), 10, thickness=0.8).wall()
        >>> wall.complex.patch_count, wall.face(0, side=1).evaluate(0.0, 0.0).shape
        (24, (3,))
        """
        return self.fitted().wall

    def bounding_box(self) -> tuple[Point, Point]:
        """Lowest and highest corner of the box round the wall, or round the block it is cut to, in mm.

        Examples
        --------
        >>> low, high = Lattice((1, 1, 1), 10, thickness=0.8).bounding_box()
        >>> [round(x, 2) for x in low], [round(x, 2) for x in high]
        ([-2.73, -2.73, -2.73], [12.73, 12.73, 12.73])
        """
        # Of a block that is cut nothing needs to be fitted.
        box = self.spec().block_box() if self.trim else self.fitted().bounding_box()
        low, high = (corner.tolist() for corner in box)
        return (low[0], low[1], low[2]), (high[0], high[1], high[2])

    def deviation(self, given: float | None = None) -> float:
        """Return the largest distance of triangles from the faces, in mm: the usual one if none is given.

        Examples
        --------
        >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8)
        >>> lattice.deviation(), lattice.deviation(0.2)
        (0.01, 0.2)
        """
        return min(self.cell_size / 1000, self.fitted().min_thickness / 10) if given is None else given

    def _measures(self) -> ExactMeasures:
        return _measures(self.cells, self.grading())

    def _take_targets(self) -> None:
        """Put cell size and wall in the place of what describes them otherwise."""
        targets = {name: getattr(self, name) for name in TARGETS}
        named = [name for name, value in targets.items() if value is not None]
        if (self.scale_field is not None or self.map is not None) and named not in ([], ["porosity"]):
            name = next(name for name in named if name != "porosity")
            raise ParameterError(name, targets[name], "none where a scale field or a map lets cells vary")
        if named:
            # What is needed to solve for them takes longer to load than a cell to build.
            from gyroid_cad.wall.laws import wall_from

            own = wall_from(self.surface, self.kind, self.cell_size, self.thickness, self.density, targets)
            found = dict(zip(("cell_size", "thickness", "density"), own, strict=True)) | dict.fromkeys(TARGETS)
            for name, value in found.items():
                object.__setattr__(self, name, value)

    def _require_variable(self) -> None:
        """Check a graded lattice as far as can be before it is built."""
        for name in ("thickness", "scale_field"):
            if isinstance(value := getattr(self, name), float):
                positive_number(name, value)
        if isinstance(self.density, float):
            require_density(self.density, self.cell_size, self.minimal_surface.tube)
        if self.scale_field is not None and any(self.grading().map_closes):
            raise ParameterError("scale_field", self.scale_field, f"none where {self.map} joins the block's ends")

    def _require_kind(self) -> None:
        if self.kind not in BLOCK_KINDS:
            raise ParameterError("kind", self.kind, " or ".join(BLOCK_KINDS))
        if self.kind != SHEET_KIND and self.trim is None:
            accepted = f"{SHEET_KIND}, unless trim is box: whole patches end in walls that close the {SHEET_KIND} alone"
            raise ParameterError("kind", self.kind, accepted)
        if self.network:
            network_density(self.density, self.thickness, self.minimal_surface.tube)

    def _require_trim(self) -> None:
        if self.trim is not None and self.trim not in TRIMS:
            raise ParameterError("trim", self.trim, f"{' or '.join(TRIMS)}, or none for whole patches")
        if self.keep_islands and not self.trim:
            raise ParameterError("keep_islands", True, "a lattice that is trimmed: whole patches leave no islands")
        if self.trim and (self.scale_field is not None or self.map is not None):
            raise ParameterError("trim", self.trim, "none where a map or a scale field carries the block elsewhere")

    def _require_fit(self) -> None:
        if not isinstance(self.fit, FitSettings):
            raise ParameterError("fit", self.fit, "a FitSettings")
        if not self.uniform and not self.fit.plain:
            raise ParameterError(
                "fit",
                self.fit,
                "evenly spaced knots, equal weights and the smooth parameterisation where the lattice is graded: "
                "there the number of control points rises with the tolerance",
            )
        if self.tolerance is not None:
            object.__setattr__(self, "tolerance", valid_tolerance(self.tolerance))
        Closeness(self.fit, self.tolerance, self.compact).require(self.cell_size)


@lru_cache(maxsize=16)
def _measures(cells: tuple[int, int, int], grading: Grading) -> ExactMeasures:
    return exact_measures(build_complex(cells, grading.surface.cell, grading.closed), grading)

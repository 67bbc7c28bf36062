"""Laws of a lattice: what follows from any two of its cell size, wall, density, pores, area and curvature.

All lengths go with the cell size L. What is left depends on one number alone: a wall's thickness t / L, or the distance
s / L from the mid-surface at which a network begins. The tube formula (:class:`~gyroid_cad.surface.families.TubeLaw`)
gives volumes and areas of parallel surfaces exactly, for the mean curvature is zero; distances to a wall's face are
those to the mid-surface less half the wall, so that spheres are known from the exact surface once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import lru_cache
from math import copysign
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from gyroid_cad.common.choices import TARGETS, Kind, SurfaceName
from gyroid_cad.errors import ParameterError
from gyroid_cad.fields.field import Field, FieldLike, as_field
from gyroid_cad.surface.families import MinimalSurface, surface_named
from gyroid_cad.wall.limits import NETWORK_KINDS, SHEET_KIND, percent_hint
from gyroid_cad.wall.pore_limits import network_throats

__all__ = ["QUANTITIES", "Design", "design", "wall_from"]

Floats = NDArray[np.float64]
# With what power of the cell size a quantity goes, and what it is at a cell size of 1.
Law = tuple[int, Callable[[Any], Any]]

QUANTITIES = ("cell_size", "thickness", "density", *TARGETS)
_FRACTIONS = ("density", "porosity")
# At how many walls a law is looked at, for where it takes a value.
_LOOKED_AT = 2001
# Of the thickest wall, where the thinnest is looked at.
_THINNEST = 1e-6
# Digits of what is worked out: rounding is in those beyond.
_DIGITS = 12
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class Design:
    """A lattice in the terms of who uses it; lengths in mm.

    Attributes
    ----------
    surface, kind : str
    cell_size : float
    thickness : float or None
        Of the wall; a network has none.
    density, porosity : float
        Parts of the volume that are solid and empty.
    pore_size : float
        Diameter of the largest sphere that fits into the pores.
    throat : float
        Diameter of the largest sphere that can travel through them without end.
    hydraulic_diameter : float
        Four times the volume of the pores by their area: of each of a wall's two fluids.
    area_per_volume : float
        Of all faces, in mm2 per mm3 of the lattice.
    curvature_radius : float
        The smallest of the faces.

    Examples
    --------
    >>> from gyroid_cad import design
    >>> made = design(pore_size=0.6, porosity=0.75)
    >>> f"{made.cell_size:.4f} {made.thickness:.4f} {made.throat:.4f}"
    '1.5913 0.1299 0.5592'
    """

    surface: SurfaceName
    kind: Kind
    cell_size: float
    thickness: float | None
    density: float
    porosity: float
    pore_size: float
    throat: float
    hydraulic_diameter: float
    area_per_volume: float
    curvature_radius: float

    def as_dict(self) -> dict[str, Any]:
        """All of it, by name."""
        return asdict(self)


def design(
    *,
    surface: SurfaceName = "gyroid",
    kind: Kind = SHEET_KIND,
    cell_size: float | None = None,
    thickness: float | None = None,
    density: float | None = None,
    porosity: float | None = None,
    pore_size: float | None = None,
    throat: float | None = None,
    hydraulic_diameter: float | None = None,
    area_per_volume: float | None = None,
    curvature_radius: float | None = None,
) -> Design:
    """Work out a lattice from any two independent quantities of it.

    Parameters
    ----------
    surface : {"gyroid", "diamond", "primitive"}
    kind : {"sheet", "network-a", "network-b"}
    cell_size, thickness, density, porosity, pore_size, throat, hydraulic_diameter, area_per_volume, curvature_radius \
    : float
        Two of them, as :class:`Design` has them.

    Returns
    -------
    Design

    Raises
    ------
    ParameterError
        If they are not two, or no lattice has both: then it says what the second may be beside the first.

    Examples
    --------
    >>> from gyroid_cad import Lattice, design
    >>> found = design(throat=0.5, density=0.2, surface="diamond")
    >>> lattice = Lattice((2, 2, 2), found.cell_size, density=0.2, surface="diamond")
    >>> round(lattice.wall_thickness, 6) == round(found.thickness, 6)
    True
    """
    if kind not in (SHEET_KIND, *NETWORK_KINDS):
        raise ParameterError("kind", kind, " or ".join((SHEET_KIND, *NETWORK_KINDS)))
    values = (cell_size, thickness, density, porosity, pore_size, throat, hydraulic_diameter, area_per_volume)
    given = dict(zip(QUANTITIES, (*values, curvature_radius), strict=True))
    return _solved(surface, kind, {name: value for name, value in given.items() if value is not None})


def wall_from(
    surface: SurfaceName,
    kind: Kind,
    cell_size: float | None,
    thickness: FieldLike | None,
    density: FieldLike | None,
    targets: Mapping[str, Any],
) -> tuple[float | None, FieldLike | None, FieldLike | None]:
    """Cell size, thickness and density of a lattice that may be described otherwise.

    Parameters
    ----------
    surface, kind, cell_size, thickness, density
        As of :class:`gyroid_cad.Lattice`; of channels and bodies the wall's.
    targets : mapping
        By name of :data:`TARGETS`; None is not given. A porosity beside a cell size may vary, as a density may.

    Raises
    ------
    ParameterError
    """
    wanted = {name: targets[name] for name in TARGETS if targets.get(name) is not None}
    if not wanted:
        return cell_size, thickness, density
    if list(wanted) == ["porosity"]:
        for name, value in (("thickness", thickness), ("density", density)):
            if value is not None:
                raise ParameterError("porosity", wanted["porosity"], f"none beside {name} = {value}")
        return cell_size, None, _density_of(wanted["porosity"])
    given = {"cell_size": cell_size, "thickness": thickness, "density": density}
    given = {name: value for name, value in given.items() if value is not None} | wanted
    found = _solved(surface, kind if kind in NETWORK_KINDS else SHEET_KIND, given)
    if found.thickness is None or any(name in given for name in _FRACTIONS):
        return found.cell_size, None, found.density
    return found.cell_size, found.thickness, None


def _density_of(porosity: FieldLike) -> FieldLike:
    empty = as_field("porosity", porosity, "a volume fraction")
    if isinstance(empty, Field):
        return 1 - empty
    if not 0 < empty < 1:
        raise ParameterError("porosity", empty, "above 0 and below 1" + percent_hint(empty))
    # So that 0.7 is the density 0.3, to the last bit.
    return round(1 - empty, 15)


def _solved(surface: SurfaceName, kind: Kind, given: Mapping[str, Any]) -> Design:
    """The lattice of two quantities, in the order of :data:`QUANTITIES`."""
    chosen = surface_named(surface)
    laws, low, high = _laws(chosen, kind in NETWORK_KINDS)
    if "thickness" in given and kind in NETWORK_KINDS:
        raise ParameterError("thickness", given["thickness"], "none of a network, which is told by its density")
    values = {name: _number(name, given[name]) for name in QUANTITIES if name in given}
    if len(values) != 2:
        known = ", ".join(name.replace("_", " ") for name in QUANTITIES if name in laws)
        shown = tuple(values.values()) if len(values) > 1 else next(iter(values.values()), None)
        raise ParameterError(", ".join(values) or "design", shown, f"two quantities of these: {known}")
    (first, a), (second, b) = values.items()
    if first in _FRACTIONS and second in _FRACTIONS:
        raise ParameterError(second, b, f"none beside {first}: one of them is 1 less the other")
    # Fractions fix the wall, whatever the cell.
    if second in _FRACTIONS:
        (first, a), (second, b) = (second, b), (first, a)
    x = _wall(laws, (first, a), (second, b), low, high)
    name, value = (second, b) if laws[first][0] == 0 else (first, a)
    power, law = laws[name]
    size = float((value / law(x)) ** (1 / power))
    found: dict[str, Any] = {key: float(size**power * law(x)) for key, (power, law) in laws.items()}
    # What was given stays as it is, to the last bit.
    return Design(surface, kind, **{"thickness": None, **found, **_rounded(found, values)})


def _rounded(found: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
    rounded = {key: float(f"{value:.{_DIGITS}g}") for key, value in found.items()} | dict(values)
    if "porosity" in values:
        rounded["density"] = round(1 - values["porosity"], 15)
    if "density" in values:
        rounded["porosity"] = round(1 - values["density"], 15)
    return rounded


def _number(name: str, value: Any) -> float:
    unit = "a volume fraction" if name in _FRACTIONS else "1/mm" if name == "area_per_volume" else "a length in mm"
    number = as_field(name, value, unit)
    if isinstance(number, Field):
        raise ParameterError(name, value, f"{unit}, one number")
    if not 0 < number < (1 if name in _FRACTIONS else np.inf):
        below = f" and below 1{percent_hint(number)}" if name in _FRACTIONS else ""
        raise ParameterError(name, number, f"{unit}, above 0{below}")
    return number


def _wall(
    laws: Mapping[str, Law], first: tuple[str, float], second: tuple[str, float], low: float, high: float
) -> float:
    """Find where the one quantity, at the cell size that the other asks for, has its own value."""
    (name, a), (other, b) = first, second
    (p, law), (q, beside) = laws[name], laws[other]

    def off(x: Any) -> Any:
        return law(x) - a if p == 0 else beside(x) * (a / law(x)) ** (q / p) - b

    # Closely where walls are thin.
    x = low + (high - low) * np.linspace(0, 1, _LOOKED_AT) ** 2 if low >= 0 else np.linspace(low, high, _LOOKED_AT)
    values = np.array([off(place) for place in x.tolist()])
    crossing = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0)
    if not len(crossing):
        near = int(np.argmin(np.abs(values)))
        if abs(values[near]) <= _ROUNDING * abs(a if p == 0 else b):
            return float(x[near])
        told, base = (name, a) if p == 0 else (other, b)
        lowest, highest = values.min() + base, values.max() + base
        unit = "" if p == 0 else " /mm" if q < 0 else " mm"
        hint = f" beside {name} = {a:g}" if p else ""
        raise ParameterError(told, base, f"above {lowest:.5g} and below {highest:.5g}{unit}{hint}")
    found = [float(brentq(off, float(x[k]), float(x[k + 1]), xtol=1e-15, rtol=1e-15)) for k in crossing.tolist()]
    if len(found) > 1:
        densities = " and ".join(f"{laws['density'][1](place):.5g}" for place in found)
        raise ParameterError(
            other, b, f"a density instead of it or of {name}: lattices of densities {densities} have both"
        )
    return found[0]


@lru_cache(maxsize=8)
def _laws(surface: MinimalSurface, network: bool) -> tuple[dict[str, Law], float, float]:
    """Quantities of cells of size 1, by t of a wall or s of a network's beginning, and between which these may be."""
    tube, spheres = surface.tube, network_throats(surface)
    widest = tube.max_thickness / 2

    if network:
        # Of the network that begins at s along the normal: the pores reach from the other network up to there.
        def filled(s: float) -> float:
            return (1 - copysign(tube.density(2 * abs(s)), s)) / 2

        laws: dict[str, Law] = {
            "density": (0, filled),
            "porosity": (0, lambda s: 1 - filled(s)),
            "pore_size": (1, lambda s: 2 * (spheres.inscribed + s)),
            "throat": (1, lambda s: 2 * (spheres.radius + s)),
            "hydraulic_diameter": (1, lambda s: 4 * (1 - filled(s)) / tube.face_area(2 * s)),
            "area_per_volume": (-1, lambda s: tube.face_area(2 * s)),
            "curvature_radius": (1, lambda s: tube.thickness_limit / 2 - abs(s)),
        }
        return {"cell_size": (1, lambda s: 1.0), **laws}, -widest, widest
    laws = {
        "cell_size": (1, lambda t: 1.0),
        "thickness": (1, lambda t: t),
        "density": (0, tube.density),
        "porosity": (0, lambda t: 1 - tube.density(t)),
        "pore_size": (1, lambda t: 2 * spheres.inscribed - t),
        "throat": (1, lambda t: 2 * spheres.radius - t),
        "hydraulic_diameter": (1, lambda t: 2 * (1 - tube.density(t)) / tube.face_area(t)),
        "area_per_volume": (-1, lambda t: 2 * tube.face_area(t)),
        "curvature_radius": (1, lambda t: (tube.thickness_limit - t) / 2),
    }
    return laws, _THINNEST * tube.max_thickness, min(tube.max_thickness, 2 * spheres.radius)

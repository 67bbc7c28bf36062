"""``gyroid-cad design``: lattices of every surface that have two quantities, side by side."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import click

from gyroid_cad.cli.console import print_table
from gyroid_cad.cli.lattice_options import quantity_options
from gyroid_cad.cli.options import json_option, printer_option
from gyroid_cad.common.choices import SURFACE_NAMES, Kind, SurfaceName
from gyroid_cad.errors import ParameterError
from gyroid_cad.printing.printers import Printer, printer_named
from gyroid_cad.wall.laws import Design, design

__all__ = ["design_command"]

# The two networks of a surface are alike.
_KINDS: tuple[Kind, ...] = ("sheet", "network-a")
_ROWS = (
    ("cell size", "cell_size", "mm"),
    ("thickness", "thickness", "mm"),
    ("density", "density", ""),
    ("porosity", "porosity", ""),
    ("pore size", "pore_size", "mm"),
    ("throat", "throat", "mm"),
    ("hydraulic diameter", "hydraulic_diameter", "mm"),
    ("area per volume", "area_per_volume", "/mm"),
    ("curvature radius", "curvature_radius", "mm"),
)


@click.command("design")
@quantity_options
@printer_option("By whose limits walls and throats are looked at: one that is known, or a TOML file.", "form2")
@json_option
def design_command(printer: str, as_json: bool, **given: Any) -> None:
    """Work out the lattices that have two quantities, of all surfaces, as walls and as networks.

    Any two that are independent: cell size, thickness, density or porosity, pore size, throat, hydraulic diameter, area
    per volume, smallest radius of curvature. Where a surface has none with both, it is said why. The status is 2 if
    none has.

    \b
    gyroid-cad design --pore-size 0.6 --porosity 0.75
    gyroid-cad design --cell-size 8 --throat 2.5 --json
    """
    limits = printer_named(printer)
    asked = {name: value for name, value in given.items() if value is not None}
    found: dict[tuple[SurfaceName, Kind], Design | ParameterError] = {}
    for kind in _KINDS:
        for surface in SURFACE_NAMES:
            try:
                found[surface, kind] = design(surface=surface, kind=kind, **asked)
            except ParameterError as refused:
                found[surface, kind] = refused
    made = [one for one in found.values() if isinstance(one, Design)]
    if not made:
        raise _joint([(key, one) for key, one in found.items() if isinstance(one, ParameterError)])
    if as_json:
        click.echo(json.dumps([_as_dict(key, one, limits) for key, one in found.items()]))
        return
    header = ("", *(f"{one.surface} {one.kind}" for one in made))
    rows = [(name, *(_shown(getattr(one, key), unit) for one in made)) for name, key, unit in _ROWS]
    rows += [(limits.name, *(", ".join(_verdict(one, limits)) or "ok" for one in made))]
    print_table(header, rows)
    for (surface, kind), one in found.items():
        if isinstance(one, ParameterError):
            click.echo(f"{surface} {kind}: none: {one}")


def _joint(refused: Sequence[tuple[tuple[SurfaceName, Kind], ParameterError]]) -> ParameterError:
    """One error of all lattices: what each accepts, unless all say the same."""
    first = refused[0][1]
    said = [(f"{surface} {kind}", one) for (surface, kind), one in refused if one.parameter == first.parameter]
    if len({one.accepted for _, one in said}) == 1:
        return first
    accepted = "; ".join(f"{name}: {one.accepted}" for name, one in said)
    return ParameterError(first.parameter, first.value, accepted)


def _shown(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.4g} {unit}".strip()


def _verdict(made: Design, printer: Printer) -> list[str]:
    """Walls that the printer cannot make, and throats that do not drain."""
    said = []
    if made.thickness is not None and made.thickness < printer.min_supported_wall:
        said.append(f"wall under {printer.min_supported_wall:g} mm")
    if made.throat < printer.min_drain_hole:
        said.append(f"throat under {printer.min_drain_hole:g} mm")
    return said


def _as_dict(key: tuple[SurfaceName, Kind], made: Design | ParameterError, printer: Printer) -> dict[str, Any]:
    if isinstance(made, ParameterError):
        return {"surface": key[0], "kind": key[1], "refused": str(made)}
    return {**made.as_dict(), "printer": printer.key, "refused_by_printer": _verdict(made, printer)}

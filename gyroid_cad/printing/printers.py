"""Printers: what their build volume, walls and drain holes must be, from a TOML file that anyone can add to."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from importlib.resources import files
from typing import Any

from gyroid_cad.common.checks import finite_numbers, positive_number
from gyroid_cad.common.formats import TOML, format_of
from gyroid_cad.common.inputs import read_toml
from gyroid_cad.errors import ParameterError

__all__ = ["Printer", "printer_named", "printers"]

_LENGTH = "a length in mm, a finite number above 0"


@dataclass(frozen=True, slots=True)
class Printer:
    """A printer's demands on a part; lengths in mm.

    Attributes
    ----------
    key : str
        How it is asked for.
    name, process : str
    build_volume : tuple of float
        Along its own three axes.
    min_supported_wall : float
        Of walls that are joined to others on two sides or more.
    min_unsupported_wall : float
        Of walls that stand free at an edge.
    min_drain_hole : float
        Diameter.

    Examples
    --------
    >>> from gyroid_cad import Lattice, Printer, print_check
    >>> mine = Printer("mine", "Mine", "resin", (80, 80, 80), 0.4, 0.6, 3.5)
    >>> print_check(Lattice((1, 1, 1), 10, thickness=0.8), mine).fits
    True
    """

    key: str
    name: str
    process: str
    build_volume: tuple[float, float, float]
    min_supported_wall: float
    min_unsupported_wall: float
    min_drain_hole: float


_KEYS = tuple(field.name for field in fields(Printer) if field.name != "key")


def printers() -> dict[str, Printer]:
    """The printers that come with the package, by their keys."""
    text = files("gyroid_cad.printing").joinpath("printers.toml").read_text(encoding="utf-8")
    return _described(tomllib.loads(text), "printers.toml")


def printer_named(given: str) -> Printer:
    """A printer by its key, or the only one of a TOML file.

    Parameters
    ----------
    given : str
        A key of :func:`printers`; or the path of a file of one's own that ends in .toml and describes one printer as
        a table, with the keys of the package's own ``printers.toml``.

    Raises
    ------
    ParameterError
        If there is none, with those there are; or if the file says something that no printer is.
    """
    known = printers()
    if str(given) in known:
        return known[str(given)]
    if format_of(given) is not TOML:
        raise ParameterError("printer", str(given), f"{', '.join(known)}, or the path of a .toml file of your own")
    own = _described(read_toml("printer", given)[0], str(given))
    if len(own) != 1:
        raise ParameterError("printer", str(given), f"a file with one table, of one printer; it has {len(own)}")
    return next(iter(own.values()))


def _described(tables: Mapping[str, Any], path: str) -> dict[str, Printer]:
    return {key: _printer(key, table, path) for key, table in tables.items()}


def _printer(key: str, table: Any, path: str) -> Printer:
    if not isinstance(table, dict):
        raise ParameterError(f"{path}: {key}", table, "a table that describes a printer")
    for name in table:
        if name not in _KEYS:
            raise ParameterError(f"{path}: {key}.{name}", table[name], f"a known key: {', '.join(_KEYS)}")
    for name in _KEYS:
        if name not in table:
            raise ParameterError(f"{path}: {key}", sorted(table), f"the key {name} as well")
    for name in ("name", "process"):
        if not isinstance(table[name], str):
            raise ParameterError(f"{path}: {key}.{name}", table[name], "text")
    volume = finite_numbers(
        f"{path}: {key}.build_volume", table["build_volume"], f"three lengths, each {_LENGTH}", (3,)
    )
    if not (volume > 0).all():
        raise ParameterError(f"{path}: {key}.build_volume", table["build_volume"], f"three lengths, each {_LENGTH}")
    x, y, z = volume.tolist()
    lengths = {name: positive_number(f"{path}: {key}.{name}", table[name], _LENGTH) for name in _KEYS[3:]}
    return Printer(key, table["name"], table["process"], (x, y, z), **lengths)

"""Verdict on a part for a printer, subject by subject."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from gyroid_cad.common.tables import text_table
from gyroid_cad.printing.printers import Printer

__all__ = ["ROUNDING", "PrintCheck"]

_UNITS = "STL in mm (STL has no unit: PreForm takes mm), 3MF says mm itself"
# A part as long as the build volume, but for rounding, fits.
ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class PrintCheck:
    """Verdict on a part for a printer; lengths in mm.

    Attributes
    ----------
    printer : Printer
    size : tuple of float
        Of the part's box, along its own x, y, z.
    orientation : tuple of int, optional
        Which of the part's axes lie along the printer's: (0, 1, 2) as it is, (2, 1, 0) with x and z exchanged. None
        if it fits in no way along the axes.
    scale_to_fit : float
        The largest scale at which it fits: below 1 it must be made smaller.
    min_wall : float, optional
        None where none was found.
    walls_measured : int
        At how many places; 0 if it is known from the lattice's description.
    scale_for_supported_wall, scale_for_wall : float, optional
        The scales from which on the smallest wall would pass as one that others support, and as one that stands free.
    opening : float, optional
        Diameter of the largest sphere that passes through a lattice's channels, or of triangles, that gets out of every
        hollow; None where there is none, or triangles do not close.
    opening_within : float, optional
        How closely that was measured in triangles; 0 if it was worked out, None if it was not looked for.
    trapped_voids : int
        Regions of empty space that do not reach outside.
    pieces : int
        That are connected by no edge.
    open_edges, inside_out : int
        Of triangles: edges not closed, and pieces turned inside out.
    triangles : int
    units : str

    Examples
    --------
    >>> from gyroid_cad import Lattice, print_check
    >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
    >>> check.passed, round(check.scale_to_fit, 2)
    (True, 9.38)
    """

    printer: Printer
    size: tuple[float, float, float]
    orientation: tuple[int, int, int] | None
    scale_to_fit: float
    min_wall: float | None
    walls_measured: int
    scale_for_supported_wall: float | None
    scale_for_wall: float | None
    opening: float | None
    opening_within: float | None
    trapped_voids: int
    pieces: int
    open_edges: int
    inside_out: int
    triangles: int
    units: str = _UNITS

    @property
    def fits(self) -> bool:
        """True if it fits the build volume, its axes along the printer's in one order or another.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.fits
        True
        """
        return self.orientation is not None

    @property
    def wall(self) -> str:
        """ "good", "supported only" where it passes joined to others but not free, "too thin", or "unknown".

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.wall
        'good'
        """
        if self.min_wall is None:
            return "unknown"
        if self.min_wall >= self.printer.min_unsupported_wall:
            return "good"
        return "supported only" if self.min_wall >= self.printer.min_supported_wall else "too thin"

    @property
    def drains(self) -> bool | None:
        """True if channels are as wide as a drain hole is to be; None if that is not known.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.drains
        True
        """
        return None if self.opening is None else self.opening >= self.printer.min_drain_hole

    @property
    def suggested_scale(self) -> float | None:
        """1 if it can be made as it is, else the scale next to it at which it fits and no wall is too thin, or None.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.suggested_scale
        1.0
        """
        least = self.scale_for_supported_wall or 0.0
        return None if least > self.scale_to_fit else float(np.clip(1.0, least, self.scale_to_fit))

    @property
    def passed(self) -> bool:
        """Absence of anything that stands in the way; narrow channels and boundary edges are the user's to judge.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.passed
        True
        """
        sound = self.trapped_voids == 0 and self.open_edges == 0 and self.inside_out == 0
        return self.fits and self.wall != "too thin" and sound and self.pieces == 1

    def as_dict(self) -> dict[str, Any]:
        """The check as plain values, ready for JSON.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.as_dict()["pieces"]
        1
        """
        judged = {name: getattr(self, name) for name in ("passed", "fits", "wall", "drains", "suggested_scale")}
        return {**asdict(self), **judged}

    def header(self) -> tuple[str, str, str]:
        """Headings of the rows: the printer over the first of them.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.header()[0]
        'Formlabs Form 2, resin (SLA)'
        """
        return f"{self.printer.name}, {self.printer.process}", "", ""

    def rows(self) -> list[tuple[str, str, str]]:
        """Subject, finding and verdict, line by line.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.rows()[0][0]
        'build volume'
        """
        return [self._fit_row(), self._wall_row(), *self._drain_rows(), *self._whole_rows()]

    def __str__(self) -> str:
        return text_table([*self.rows(), self.verdict_row()], self.header())

    def verdict_row(self) -> tuple[str, str, str]:
        """Conclusion from all the rows, as one more of them.

        Examples
        --------
        >>> check = print_check(Lattice((1, 1, 1), 10, thickness=0.8), "form2")
        >>> check.verdict_row()
        ('verdict', 'can be printed', 'passed')
        """
        scale = self.suggested_scale
        if self.passed:
            return "verdict", "can be printed", "passed"
        if scale is not None and scale != 1:
            return "verdict", f"cannot be printed as it is; suggested scale {scale:.4g}", "failed"
        at_none = "" if scale else ", at no scale: what fits has too thin a wall"
        return "verdict", f"cannot be printed as it is{at_none}", "failed"

    def _fit_row(self) -> tuple[str, str, str]:
        volume = " x ".join(f"{length:g}" for length in self.printer.build_volume)
        finding = f"{' x '.join(f'{length:.4g}' for length in self.size)} mm in {volume} mm"
        if self.orientation is None:
            return "build volume", finding, f"too large: scale by {_rounded_down(self.scale_to_fit)}"
        if self.orientation == (0, 1, 2):
            return "build volume", finding, f"fits, up to a scale of {_rounded_down(self.scale_to_fit)}"
        order = ", ".join("xyz"[axis] for axis in self.orientation)
        return "build volume", finding, f"fits with its {order} along the printer's x, y, z"

    def _wall_row(self) -> tuple[str, str, str]:
        limits = self.printer.min_supported_wall, self.printer.min_unsupported_wall
        requested = f"asked {limits[0]:g} mm supported, {limits[1]:g} mm free"
        if self.min_wall is None:
            return "smallest wall", f"none found; {requested}", "unknown"
        how = f" at {self.walls_measured:,} places" if self.walls_measured else ""
        verdict = {
            "good": "good",
            "supported only": f"good but at boundary edges; there from a scale of {_rounded_up(self.scale_for_wall)}",
            "too thin": f"too thin: passes from a scale of {_rounded_up(self.scale_for_supported_wall)}, "
            f"boundary edges from {_rounded_up(self.scale_for_wall)}",
        }[self.wall]
        return "smallest wall", f"{self.min_wall:.4g} mm{how}; {requested}", verdict

    def _drain_rows(self) -> list[tuple[str, str, str]]:
        voids = "none" if self.trapped_voids == 0 else f"{self.trapped_voids}: resin cannot leave"
        rows = [("trapped voids", f"{self.trapped_voids} regions that do not reach outside", voids)]
        within = f" (to {self.opening_within:.2g} mm)" if self.opening_within else ""
        if self.opening is not None:
            verdict = "drain" if self.drains else "narrow: rinse long, or larger cells"
            finding = f"spheres up to {max(self.opening, 0.0):.4g} mm pass{within}"
        elif self.opening_within is not None:
            verdict, finding = "none", f"no hollow with a narrower way out{within}"
        else:
            verdict, finding = "unknown", "not measured: what is not closed has no inside"
        return [*rows, ("channels", f"{finding}; drain holes {self._hole:g} mm", verdict)]

    @property
    def _hole(self) -> float:
        return self.printer.min_drain_hole

    def _whole_rows(self) -> list[tuple[str, str, str]]:
        closed = "closed" if not self.open_edges else f"{self.open_edges:,} open edges"
        turned = f", {self.inside_out} inside out" if self.inside_out else ""
        pieces = "one piece" if self.pieces == 1 else "falls apart"
        return [
            ("pieces", f"{self.pieces}", pieces),
            ("triangles", f"{self.triangles:,}, {closed}{turned}", "not closed" if self.open_edges else "good"),
            ("units", self.units, "mm"),
        ]


def _rounded_down(scale: float) -> str:
    """Three digits, none of them too large."""
    unit = 10.0 ** (np.floor(np.log10(scale)) - 2)
    return f"{np.floor(scale / unit * (1 + ROUNDING)) * unit:.3g}"


def _rounded_up(scale: float | None) -> str:
    assert scale is not None
    unit = 10.0 ** (np.floor(np.log10(scale)) - 2)
    return f"{np.ceil(scale / unit * (1 - ROUNDING)) * unit:.3g}"

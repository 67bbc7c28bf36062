"""How close a fit is to be, as it may be stated: control points, a part of the cell size, or millimetres."""

from __future__ import annotations

from dataclasses import dataclass

from gyroid_cad.common.checks import finite_number
from gyroid_cad.errors import ParameterError
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.surface.fit_report import fewest_within, fit_within
from gyroid_cad.surface.weierstrass import Family

__all__ = ["USUAL_TOLERANCE", "Closeness", "valid_tolerance"]

# Of a graded lattice, in cell sizes.
USUAL_TOLERANCE = 1e-4
# Control points a side, from which a compact fit goes up: with 4 each edge is a single span.
_FEWEST_COMPACT = 5


def valid_tolerance(tolerance: float) -> float:
    """The largest deviation of a fit, in cell sizes.

    Raises
    ------
    ParameterError
        If it is not above 0 and below 1.
    """
    accepted = "a part of the cell size, a finite number above 0 and below 1"
    number = finite_number("tolerance", tolerance, accepted)
    if not 0 < number < 1:
        raise ParameterError("tolerance", tolerance, accepted)
    return number


@dataclass(frozen=True, slots=True)
class Closeness:
    """A fit, or the deviation that chooses its control points.

    Attributes
    ----------
    fit : FitSettings
        To begin with.
    tolerance : float, optional
        Largest deviation in cell sizes, to which control points rise.
    compact : float, optional
        Largest deviation in mm instead, which the fewest control points are to meet.

    Examples
    --------
    >>> from gyroid_cad.surface.weierstrass import GYROID
    >>> settings, tolerance = Closeness(FitSettings(), compact=0.01).chosen(10.0, GYROID)
    >>> settings.control_points, tolerance
    (5, 0.001)
    """

    fit: FitSettings
    tolerance: float | None = None
    compact: float | None = None

    def require(self, cell_size: float) -> None:
        """Refuse what is no deviation, or is said twice.

        Raises
        ------
        ParameterError
        """
        if self.tolerance is not None:
            valid_tolerance(self.tolerance)
        if self.compact is None:
            return
        accepted = f"a length in mm, a finite number above 0 and below the cell size, {cell_size:g}"
        if not 0 < finite_number("compact", self.compact, accepted) < cell_size:
            raise ParameterError("compact", self.compact, accepted)
        if self.tolerance is not None or self.fit != FitSettings():
            accepted = "none beside a tolerance, control points or a fit: it chooses the control points itself"
            raise ParameterError("compact", self.compact, accepted)

    def chosen(self, cell_size: float, family: Family | None) -> tuple[FitSettings, float]:
        """The fit to begin with, and the deviation in cell sizes to which a graded wall is brought from there.

        Parameters
        ----------
        cell_size : float
            In mm.
        family : Family, optional
            Of a uniform wall, whose fit is settled here; none of a graded one.

        Raises
        ------
        ParameterError
            If the deviation is out of reach.
        """
        if self.compact is None:
            settled = self.tolerance is None or family is None
            fit = self.fit if settled else fit_within(self.fit, self.tolerance, family)  # type: ignore[arg-type]
            return fit, self.tolerance or USUAL_TOLERANCE
        least, part = FitSettings(_FEWEST_COMPACT), self.compact / cell_size
        if family is None:
            return least, part
        try:
            return fewest_within(least, part, family), part
        except ParameterError as refused:
            accepted = f"a larger one: it is {part:.2g} of the cell size, which has to be {refused.accepted}"
            raise ParameterError("compact", self.compact, accepted) from None

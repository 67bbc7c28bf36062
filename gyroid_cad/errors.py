"""Errors, in words a user can act on: the parameter, its value, what is accepted."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from gyroid_cad.former import Moved, former_name

__all__ = [
    "ExportError",
    "FitError",
    "GyroidError",
    "IslandsWarning",
    "KernelError",
    "MissingHostError",
    "ParameterError",
    "PartWarning",
    "SealedVoidsWarning",
    "SelfIntersectionError",
    "host_import",
]

_MOVED = {"SoundnessError": Moved(f"{__name__}.SelfIntersectionError")}


def __getattr__(name: str) -> Any:
    return former_name(__name__, name, _MOVED.get(name))


class GyroidError(Exception):
    """Base of every error this package raises on purpose.

    Examples
    --------
    >>> from gyroid_cad import GyroidError, Lattice
    >>> try:
    ...     Lattice((1, 1, 1), 10, thickness=-1)
    ... except GyroidError as problem:
    ...     print(problem)
    thickness = -1.0: expected 0.0001 mm or more and below 3.7647 mm, the curvature limit 0.37647 x cell_size
    """


class ParameterError(GyroidError, ValueError):
    """A value that cannot be used.

    Parameters
    ----------
    parameter : str
        Name of the parameter, as the caller wrote it.
    value : object
        What was given.
    accepted : str
        What would have been accepted.

    Examples
    --------
    >>> from gyroid_cad import Lattice, ParameterError
    >>> try:
    ...     Lattice((1, 1, 1), 10, density=30)
    ... except ParameterError as problem:
    ...     print(problem.parameter, problem.value)
    density 30.0
    """

    def __init__(self, parameter: str, value: object, accepted: str) -> None:
        shown = " ".join(_shown(value).split())
        if len(shown) > 120:
            shown = shown[:117] + "..."
        super().__init__(f"{parameter} = {shown}: expected {accepted}")
        self.parameter = parameter
        self.value = value
        self.accepted = accepted

    def __reduce__(self) -> tuple[type[ParameterError], tuple[str, object, str]]:
        return type(self), (self.parameter, self.value, self.accepted)


class SelfIntersectionError(ParameterError):
    """A field or a map that cannot be built somewhere in the lattice.

    Parameters
    ----------
    parameter : str
        Name of the parameter, as the caller wrote it.
    value : float
        At the worst place.
    place : tuple of float
        The worst place x, y, z in mm, in the lattice before any map.
    limit : float
        The largest value that would pass there; the least for other values of ``accepted``.
    reason : str
        What the limit is.
    accepted : {"below", "above", "at least", "at most"}
    quantity : str
        What the value is of, if it is not the parameter itself.
    unit : str
        Of value and limit.

    Examples
    --------
    >>> from gyroid_cad import Lattice, SelfIntersectionError
    >>> try:
    ...     Lattice((1, 1, 1), 10, thickness="3 + 0.1*x").fitted()
    ... except SelfIntersectionError as problem:
    ...     print(problem.reason)
    where the wall folds over its own curvature
    """

    def __init__(
        self,
        parameter: str,
        value: float,
        place: tuple[float, float, float],
        limit: float,
        reason: str,
        accepted: str = "below",
        quantity: str = "",
        unit: str = "",
    ) -> None:
        subject = f"{parameter}: {quantity}" if quantity else parameter
        where = ", ".join(f"{round(coordinate, 9) + 0.0:.6g}" for coordinate in place)
        Exception.__init__(
            self,
            f"{subject} = {value:.6g}{unit} at (x, y, z) = ({where}) mm: "
            f"expected {accepted} {limit:.6g}{unit}, {reason}",
        )
        self.parameter, self.value, self.accepted, self.quantity = parameter, value, accepted, quantity
        self.place, self.limit, self.reason, self.unit = place, limit, reason, unit

    def __reduce__(self) -> tuple[type[SelfIntersectionError], tuple[object, ...]]:  # type: ignore[override]
        given = (
            self.parameter,
            self.value,
            self.place,
            self.limit,
            self.reason,
            self.accepted,
            self.quantity,
            self.unit,
        )
        return type(self), given


class FitError(GyroidError):
    """A fit that cannot serve the purpose it was asked for.

    Examples
    --------
    >>> from gyroid_cad import FitError, FitSettings, Lattice
    >>> try:
    ...     Lattice((1, 1, 1), 10, thickness=0.8, fit=FitSettings.paper()).wall()
    ... except FitError as problem:
    ...     print(str(problem)[:40])
    the edges of neighbouring patches are 4.
    """


class KernelError(GyroidError, RuntimeError):
    """The CAD kernel returned something that is not the closed, valid solid that was asked for.

    Examples
    --------
    >>> issubclass(KernelError, GyroidError), issubclass(KernelError, RuntimeError)
    (True, True)
    """


class ExportError(GyroidError, OSError):
    """A file that could not be written; nothing was left behind and nothing older was touched.

    Examples
    --------
    >>> from gyroid_cad import ExportError, fill
    >>> try:
    ...     fill("nothere.step", cell_size=8, density=0.3)
    ... except ExportError as problem:
    ...     print(problem)
    nothere.step could not be read: No such file or directory
    """


class MissingHostError(GyroidError, ModuleNotFoundError):
    """A CAD host, CadQuery or build123d, that is asked for and not installed.

    Parameters
    ----------
    name : {"cadquery", "build123d"}
        Of the package, and of our extra that brings it.

    Attributes
    ----------
    remedy : str
        The command that installs it, alone or beside the other.
    """

    def __init__(self, name: str) -> None:
        # The extra of one host may replace the kernel under the other; that of both finds versions that share one.
        self.remedy = f'pip install "gyroid_cad[{name}]", or "gyroid_cad[hosts]" for both hosts in one environment'
        super().__init__(f"{name} is not installed: {self.remedy}")
        self.name = name

    def __reduce__(self) -> tuple[type[MissingHostError], tuple[str | None]]:
        return type(self), (self.name,)


@contextmanager
def host_import(name: str) -> Iterator[None]:
    """Context of an import from a host: where the host is not installed, the extra that brings it is named.

    Parameters
    ----------
    name : {"cadquery", "build123d"}

    Raises
    ------
    MissingHostError

    Examples
    --------
    >>> with host_import("cadquery"):
    ...     from cadquery import Shape
    """
    try:
        yield
    except ModuleNotFoundError as problem:
        # Another package that the host lacks, or a module that it no longer has, is for the host to explain.
        if problem.name != name:
            raise
        raise MissingHostError(name) from None


class IslandsWarning(UserWarning):
    """A lattice that was cut falls into pieces: some were dropped, or are left beside the largest one.

    Examples
    --------
    >>> import warnings
    >>> from gyroid_cad import IslandsWarning, Lattice
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", IslandsWarning)
    ...     solid = Lattice((1, 1, 1), 10, density=0.2, trim="box").solid()
    """


class PartWarning(UserWarning):
    """A part is not filled as it was given: its solids were repaired or united, or some of it is out of reach.

    Examples
    --------
    >>> import warnings
    >>> import cadquery as cq
    >>> from gyroid_cad import FitSettings, PartWarning, fill
    >>> pair = cq.Workplane().box(4, 4, 4).add(cq.Workplane().box(2, 2, 6))
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", PartWarning)
    ...     filled = fill(pair, cell_size=8, density=0.3, fit=FitSettings(5))
    >>> filled.report.remarks
    ('solid 1 of 2 and solid 2 of 2 have 16 mm3 in common: united',)
    """


class SealedVoidsWarning(UserWarning):
    """A filled part encloses space that nothing, no resin and no powder, can leave.

    Examples
    --------
    >>> import warnings
    >>> import cadquery as cq
    >>> from gyroid_cad import FitSettings, fill
    >>> from gyroid_cad.errors import SealedVoidsWarning
    >>> with warnings.catch_warnings():
    ...     warnings.simplefilter("ignore", SealedVoidsWarning)
    ...     filled = fill(cq.Workplane().box(4, 4, 4), 8, density=0.2, skin=0.5, fit=FitSettings(5))
    """


def _shown(value: object) -> str:
    try:
        return repr(value)
    # A whole number of more digits than Python prints, or lists within lists within lists.
    except (ValueError, RecursionError):
        return f"a {type(value).__name__} too long to print"

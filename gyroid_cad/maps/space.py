"""Maps of space: a lattice is laid out in its own flat space, in mm, and then carried to where it is wanted.

A map is a function of (x, y, z) with its Jacobian. Normals turn with the Jacobian's cofactors, so the wall can
be offset along the normal of the surface as mapped. Arrays here are component first, (3, n): every
component is then contiguous.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gyroid_cad.common.checks import hashable
from gyroid_cad.errors import ParameterError

__all__ = [
    "EVERYWHERE",
    "OPEN",
    "BlockMap",
    "JacobianFunction",
    "MapFunction",
    "Size",
    "SpaceMap",
    "carried",
    "differences",
]

Floats = NDArray[np.float64]
Size = tuple[float, float, float]
MapFunction = Callable[[Floats, Floats, Floats], Sequence[ArrayLike]]
JacobianFunction = Callable[[Floats, Floats, Floats], Sequence[Sequence[ArrayLike]]]

# At how many points a Jacobian is compared with differences, and how closely: a wrong one is wrong by far more.
_COMPARED_POINTS = 8
_JACOBIAN_AGREEMENT = 1e-3
OPEN = (False, False, False)
EVERYWHERE = (3 * (-inf,), 3 * (inf,))


@runtime_checkable
class BlockMap(Protocol):
    """A map that may depend on the size of the block it is laid over."""

    def over(self, size: Size) -> SpaceMap:
        """The map for a block [0, size x] x [0, size y] x [0, size z], in mm."""


@dataclass(frozen=True, slots=True)
class SpaceMap:
    """Any map of space, from a function and, if it is known, its Jacobian.

    Parameters
    ----------
    function : callable
        ``function(x, y, z)``, arrays of shape (n,) in mm, returns three arrays (or numbers): the place each
        point is carried to, in mm.
    jacobian : callable, optional
        ``jacobian(x, y, z)`` returns three rows of three arrays (or numbers), row i the derivatives of
        component i; if left out, central differences of ``function`` take its place.
    closed : tuple of bool
        Along which axes the block's far end is carried exactly onto its near end, so that they are joined.
    text : str
        How it prints; the function's name if left out.
    domain : tuple of tuple of float
        Lowest and highest x, y and z, in mm, between which it carries no two places to one: so far it may go on beyond
        the block, where a part asks for more.

    Raises
    ------
    ParameterError

    Examples
    --------
    >>> from gyroid_cad import Lattice
    >>> from gyroid_cad.maps import SpaceMap
    >>> sheared = SpaceMap(lambda x, y, z: (x + 0.2 * z, y, z), text="sheared")
    >>> lattice = Lattice((1, 1, 1), 10, thickness=0.8, map=sheared)
    >>> print(lattice.map)
    sheared
    """

    function: MapFunction
    jacobian: JacobianFunction | None = None
    closed: tuple[bool, bool, bool] = OPEN
    text: str = ""
    domain: tuple[tuple[float, ...], tuple[float, ...]] = EVERYWHERE

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ParameterError("function", self.function, "a function of x, y, z that returns three arrays")
        if self.jacobian is not None and not callable(self.jacobian):
            raise ParameterError("jacobian", self.jacobian, "a function of x, y, z that returns 3 x 3 arrays, or None")
        if not isinstance(self.closed, tuple | list) or [type(end) for end in self.closed] != [bool] * 3:
            raise ParameterError("closed", self.closed, "three of True and False")
        object.__setattr__(self, "function", hashable(self.function))
        object.__setattr__(self, "jacobian", hashable(self.jacobian))
        object.__setattr__(self, "closed", tuple(self.closed))

    def over(self, size: Size) -> SpaceMap:
        """Return the map itself, whatever the block."""
        return self

    def __str__(self) -> str:
        return self.text or str(getattr(self.function, "__name__", type(self.function).__name__))


def carried(parameter: str, space: SpaceMap, points: Floats, step: float) -> tuple[Floats, Floats]:
    """Carry points by a map, and give its Jacobian there.

    Parameters
    ----------
    parameter : str
        Named in errors.
    space : SpaceMap
    points : ndarray, shape (3, n)
        In mm.
    step : float
        In mm, of differences where the map has no Jacobian of its own.

    Returns
    -------
    images : ndarray, shape (3, n)
        In mm.
    jacobian : ndarray, shape (3, 3, n)

    Raises
    ------
    ParameterError
        If the map gives anything but finite real numbers, three (and 3 x 3) for each point.
    """

    def images(places: Floats) -> Floats:
        return _components(parameter, space, _requested(parameter, space, space.function, places), places, (3,))

    moved = images(points)
    if space.jacobian is None:
        return moved, differences(images, points, step)
    jacobian = _components(parameter, space, _requested(parameter, space, space.jacobian, points), points, (3, 3))
    few = slice(None, None, max(1, points.shape[1] // _COMPARED_POINTS))
    measured = differences(images, points[:, few], step)
    if not np.abs(jacobian[..., few] - measured).max() <= _JACOBIAN_AGREEMENT * np.abs(measured).max():
        raise ParameterError(parameter, str(space), "a Jacobian that agrees with differences of the map itself")
    return moved, jacobian


def differences(function: Callable[[Floats], Floats], points: Floats, step: float) -> Floats:
    """Derivatives of a function of points by x, y, z, by central differences.

    Taken in space, not along a patch, so that two patches have the same on their common edge.

    Parameters
    ----------
    function : callable
        From (3, n) to (..., n).
    points : ndarray, shape (3, n)
    step : float
        In mm.

    Returns
    -------
    ndarray, shape (..., 3, n)
    """

    def along(axis: int) -> Floats:
        ahead, behind = points.copy(), points.copy()
        ahead[axis] += step
        behind[axis] -= step
        return np.asarray((function(ahead) - function(behind)) / (2 * step))

    return np.stack([along(axis) for axis in range(3)], axis=-2)


def _requested(parameter: str, space: SpaceMap, function: Callable[..., Any], points: Floats) -> Any:
    try:
        return function(*points.copy())
    except Exception as problem:
        reason = " ".join(f"{type(problem).__name__}: {problem}"[:200].split())
        raise ParameterError(parameter, str(space), f"a map that can be evaluated; it raised {reason}") from problem


def _components(parameter: str, space: SpaceMap, given: Any, points: Floats, shape: tuple[int, ...]) -> Floats:
    """Values of a map as one array (*shape, n), if they are what a map should give."""
    wanted = f"{' x '.join(map(str, shape))} real arrays of shape {points[0].shape} or numbers"
    result = np.empty((*shape, points.shape[1]))
    try:
        rows = list(given) if len(shape) == 1 else [entry for row in given for entry in _three(row)]
        if len(rows) != np.prod(shape):
            raise ValueError(f"it gave {len(rows)}")
        for entry, row in zip(result.reshape(-1, points.shape[1]), rows, strict=True):
            values = np.asarray(row)
            if values.dtype.kind not in "iuf" or values.shape not in ((), entry.shape):
                raise ValueError(f"it gave {values.dtype} of shape {values.shape}")
            entry[:] = values
    except (TypeError, ValueError) as problem:
        raise ParameterError(parameter, str(space), f"a map that gives {wanted}; {problem}") from None
    bad = ~np.isfinite(result.reshape(-1, points.shape[1])).all(axis=0)
    if bad.any():
        place = ", ".join(f"{p:.6g}" for p in points[:, np.argmax(bad)])
        raise ParameterError(parameter, str(space), f"finite values; at (x, y, z) = ({place}) mm it gave none")
    return result


def _three(row: Any) -> list[Any]:
    entries = list(row)
    if len(entries) != 3:
        raise ValueError(f"it gave a row of {len(entries)}")
    return entries

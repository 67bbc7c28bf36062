"""Checks of a user's values: numbers that are real, finite and no boolean, functions that can be cached."""

from __future__ import annotations

from math import inf, isfinite, nan
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import ParameterError

__all__ = ["finite_number", "finite_numbers", "hashable", "positive_number", "three_numbers"]


def finite_number(parameter: str, value: object, accepted: str = "a finite number") -> float:
    """A real, finite number as a float.

    Parameters
    ----------
    parameter : str
        Its name, for errors.
    value : object
    accepted : str
        What would be accepted, for errors.

    Raises
    ------
    ParameterError
    """
    try:
        number = float(value) if isinstance(value, Real) and not isinstance(value, bool) else nan
    except OverflowError:
        number = inf
    if not isfinite(number):
        raise ParameterError(parameter, value, accepted)
    return number


def positive_number(parameter: str, value: object, accepted: str = "a finite number above 0") -> float:
    """A real, finite number above 0 as a float.

    Parameters
    ----------
    parameter : str
        Its name, for errors.
    value : object
    accepted : str
        What would be accepted, for errors.

    Raises
    ------
    ParameterError
    """
    number = finite_number(parameter, value, accepted)
    if number <= 0:
        raise ParameterError(parameter, value, accepted)
    return number


def finite_numbers(
    parameter: str, value: object, accepted: str, shape: tuple[int, ...] | None = None
) -> NDArray[np.float64]:
    """Real, finite numbers as an array, of a given shape if there is one.

    Raises
    ------
    ParameterError
    """
    try:
        array = np.array(value)
    except (TypeError, ValueError):
        raise ParameterError(parameter, value, accepted) from None
    fits = array.dtype.kind in "iuf" and (shape is None or array.shape == shape)
    if not fits or not np.isfinite(array).all():
        raise ParameterError(parameter, value, accepted)
    return array.astype(np.float64)


def three_numbers(parameter: str, value: object) -> NDArray[np.float64]:
    """Coordinates of a point, or angles about the axes; shape (3,).

    Raises
    ------
    ParameterError
    """
    return finite_numbers(parameter, value, "three finite numbers", (3,))


def hashable(function: Any) -> Any:
    """The function, or its bound call if it cannot be hashed: builds are remembered by what they are made of."""
    try:
        hash(function)
    except TypeError:
        return function.__call__
    return function

"""Numbers as text, many at once: rows of bytes, padded with zero bytes that are left out when they are written."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["decimal_text", "integer_text", "joined_rows", "text_rows"]

Bytes = NDArray[np.uint8]
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

_ZERO, _POINT, _MINUS = b"0.-"
# Digits that are looked up at once.
_DIGITS = 5
_CHUNK = 10**_DIGITS


def integer_text(values: Integers) -> Bytes:
    """Text of integers that are not negative.

    Returns
    -------
    ndarray of uint8, shape (..., width)

    Examples
    --------
    >>> joined_rows(integer_text(np.array([7, 1234567])))
    b'71234567'
    """
    full, without_leading, _ = _tables()
    chunks = [values % _CHUNK]
    rest = values // _CHUNK
    while rest.any():
        chunks.append(rest % _CHUNK)
        rest = rest // _CHUNK
    shown, begun = [], np.zeros(values.shape, dtype=bool)
    for place, chunk in reversed(list(enumerate(chunks))):
        text = np.where(begun[..., np.newaxis], full[chunk], without_leading[chunk])
        begun |= chunk > 0
        shown.append(text if place == 0 else np.where(begun[..., np.newaxis], text, 0))
    return np.concatenate(shown, axis=-1)


def decimal_text(values: Floats, decimals: int) -> Bytes:
    """Text of numbers, rounded, with a point and without zeros at the end, as ISO 10303-21 wants reals.

    Parameters
    ----------
    values : ndarray, shape (...)
    decimals : int
        At most 15.

    Returns
    -------
    ndarray of uint8, shape (..., width)

    Examples
    --------
    >>> joined_rows(decimal_text(np.array([-0.25, 3.0, -1e-12]), 10))
    b'-0.253.0.'
    """
    full, _, without_trailing = _tables()
    count = -(-decimals // _DIGITS)
    # What comes after the point is multiplied alone, so that nothing is lost by it.
    part, before = np.modf(np.abs(values))
    rest = np.rint(part * 10.0**decimals).astype(np.int64)
    whole, rest = before.astype(np.int64) + rest // 10**decimals, rest % 10**decimals
    negative = (values < 0) & ((whole > 0) | (rest > 0))
    rest *= 10 ** (count * _DIGITS - decimals)
    chunks = []
    for _ in range(count):
        rest, chunk = np.divmod(rest, _CHUNK)
        chunks.append(chunk)
    shown, ended = [], np.zeros(values.shape, dtype=bool)
    for chunk in chunks:
        shown.append(np.where(ended[..., np.newaxis], full[chunk], without_trailing[chunk]))
        ended |= chunk > 0
    sign = np.where(negative, _MINUS, 0).astype(np.uint8)[..., np.newaxis]
    point = np.full((*values.shape, 1), _POINT, dtype=np.uint8)
    return np.concatenate([sign, integer_text(whole), point, *reversed(shown)], axis=-1)


def text_rows(texts: list[str]) -> Bytes:
    """Rows of ASCII texts.

    Examples
    --------
    >>> text_rows(["a", "bcd"]).shape
    (2, 3)
    """
    packed = np.array([text.encode("ascii") for text in texts])
    return packed.view(np.uint8).reshape(len(texts), -1) if packed.itemsize else np.zeros((len(texts), 0), np.uint8)


def joined_rows(*columns: Bytes) -> bytes:
    """Rows of bytes side by side, one after the other, without what they are padded with."""
    rows = np.concatenate(columns, axis=-1).ravel()
    return bytes(rows[rows != 0].tobytes())


@cache
def _tables() -> tuple[Bytes, Bytes, Bytes]:
    """Digits of the numbers of one chunk: all of them, without leading zeros, and without zeros at the end."""
    full = (np.arange(_CHUNK)[:, np.newaxis] // 10 ** np.arange(_DIGITS)[::-1] % 10 + _ZERO).astype(np.uint8)
    some = full != _ZERO
    begun, ended = np.logical_or.accumulate(some, axis=1), np.logical_or.accumulate(some[:, ::-1], axis=1)[:, ::-1]
    begun[0, -1] = True
    return full, np.where(begun, full, 0), np.where(ended, full, 0)

"""Check of the memory that cells take against the memory that there is."""

from __future__ import annotations

from math import prod

from gyroid_cad.errors import ParameterError

__all__ = ["require_memory"]

# What imports and one cell take.
_BASE_BYTES = 400_000_000


def require_memory(cells: tuple[int, int, int], bytes_per_cell: int, control_points: int = 10) -> None:
    """Refuse cells that would take more memory than is free.

    Parameters
    ----------
    cells : tuple of int
    bytes_per_cell : int
        At the peak, as ``benchmarks/memory.py`` measures it, with 10 control points along each side of a patch.
    control_points : int

    Raises
    ------
    ParameterError
    """
    import psutil

    bytes_per_cell = int(bytes_per_cell * max(1.0, (control_points / 10) ** 2))

    needed = _BASE_BYTES + prod(cells) * bytes_per_cell
    available = psutil.virtual_memory().available
    if needed > available:
        most = max(0, (available - _BASE_BYTES) // bytes_per_cell)
        raise ParameterError(
            "cells",
            cells,
            f"at most about {most} cells in all: these take about {needed / 1e9:.3g} GB of memory "
            f"and {available / 1e9:.3g} GB are free",
        )

"""Formats of files and their settings, checked before anything is built, without the kernel."""

from __future__ import annotations

import os
from collections.abc import Sequence
from math import isfinite
from numbers import Real
from pathlib import Path
from types import MappingProxyType

from gyroid_cad.common.files import require_distinct, require_writable
from gyroid_cad.errors import ParameterError

__all__ = [
    "DEFAULT_ANGLE",
    "FORMATS",
    "SCHEMAS",
    "TRIANGLE_FORMATS",
    "require_formats",
    "require_meshing",
    "require_schema",
]

FORMATS = {".step": "step", ".stp": "step", ".brep": "brep", ".stl": "stl", ".3mf": "3mf"}
TRIANGLE_FORMATS = ("stl", "3mf")
# By the names of the kernel's STEP writer.
SCHEMAS = MappingProxyType({"ap214": "AP214IS", "ap242": "AP242DIS"})
# Degrees between neighbouring facets.
DEFAULT_ANGLE = 15.0


def require_formats(paths: Sequence[str | os.PathLike[str]]) -> list[Path]:
    """Check the endings and folders of files to be written, before anything is built.

    Raises
    ------
    ParameterError
    """
    return require_distinct(paths, _require_format)


def _require_format(path: str | os.PathLike[str]) -> Path:
    if Path(path).suffix.lower() not in FORMATS:
        raise ParameterError("output", str(path), f"a file name ending in {', '.join(FORMATS)}")
    return require_writable(path)


def require_schema(schema: str) -> str:
    """The kernel's name of a schema.

    Raises
    ------
    ParameterError
    """
    if schema not in tuple(SCHEMAS):
        raise ParameterError("schema", schema, " or ".join(SCHEMAS))
    return SCHEMAS[schema]


def require_meshing(deviation: float, angle: float = DEFAULT_ANGLE) -> None:
    """Check the two limits of triangles.

    Raises
    ------
    ParameterError
    """
    if not (isinstance(deviation, Real) and isfinite(deviation) and deviation > 0):
        raise ParameterError("deviation", deviation, "a length above 0 mm")
    if not (isinstance(angle, Real) and isfinite(angle) and 0 < angle < 90):
        raise ParameterError("angle", angle, "above 0 and below 90 degrees")

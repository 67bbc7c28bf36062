"""STEP text made smaller: equal points are written once, with no more digits than a CAD kernel can tell apart.

The kernel's writer gives every pole of every curve and surface a CARTESIAN_POINT of its own, in 13 digits. Two
faces and the edge between them have the same poles there, and ISO 10303-21 lets them share the entity.
Points of anything but splines stay their own, so that vertices that coincide stay two.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

__all__ = ["compact_step"]

# 5e-11 of a coordinate, under 1e-8 mm for parts below 200 mm: a tenth of the kernel's tolerance.
_SIGNIFICANT_DIGITS = 10
# Coordinates are rounding noise about 0 below this, in mm.
_NOISE_DECIMALS = 12

_POINT = re.compile(r"#(\d+) = CARTESIAN_POINT\('',\(([^()]*)\)\s*\);")
_REFERENCE = re.compile(r"#(\d+)")
_SPLINE = "B_SPLINE_"


def compact_step(source: Path, target: Path) -> None:
    """Rewrite a STEP file of the kernel's writer.

    Parameters
    ----------
    source : Path
        As ``STEPControl_Writer`` left it.
    target : Path
        Another file.
    """
    shared = _shared_points(source)
    with source.open(encoding="utf-8") as lines, target.open("w", encoding="utf-8", newline="\n") as out:
        out.writelines(_rewritten(entity, shared) for entity in _entities(lines))


def _entities(lines: TextIO) -> Iterator[str]:
    """Whole entities, each with its folded lines."""
    pending = ""
    for line in lines:
        pending += line
        if line.endswith(";\n"):
            yield pending
            pending = ""
    yield pending


def _shared_points(source: Path) -> dict[str, str]:
    """For each pole that repeats an earlier point, the earlier one's id."""
    first: dict[str, str] = {}
    shared: dict[str, str] = {}
    used_elsewhere: set[str] = set()
    with source.open(encoding="utf-8") as lines:
        for entity in _entities(lines):
            if point := _POINT.match(entity):
                original = first.setdefault(_rounded(point[2]), point[1])
                if original != point[1]:
                    shared[point[1]] = original
            elif _SPLINE not in entity:
                used_elsewhere.update(_REFERENCE.findall(entity))
    return {number: original for number, original in shared.items() if number not in used_elsewhere}


def _rewritten(entity: str, shared: dict[str, str]) -> str:
    if point := _POINT.match(entity):
        return "" if point[1] in shared else f"#{point[1]}=CARTESIAN_POINT('',({_rounded(point[2])}));\n"
    if entity.startswith("#") and _SPLINE in entity:
        unfolded = "".join(part.strip() for part in entity.splitlines()).replace(" = ", "=", 1)
        return _REFERENCE.sub(lambda match: "#" + shared.get(match[1], match[1]), unfolded) + "\n"
    return entity


def _rounded(coordinates: str) -> str:
    return ",".join(map(_real, coordinates.split(",")))


def _real(text: str) -> str:
    """A number as ISO 10303-21 wants it: always with a point, an exponent in capitals."""
    mantissa, mark, exponent = f"{round(float(text), _NOISE_DECIMALS) + 0.0:.{_SIGNIFICANT_DIGITS}g}".partition("e")
    return (mantissa if "." in mantissa else mantissa + ".") + mark.upper() + exponent

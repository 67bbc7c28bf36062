"""Sections of the report on a file: its solids as the kernel finds them, or its triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gyroid_cad.common.formats import PART_FORMATS, TRIANGLE_FORMATS, Format, require_format
from gyroid_cad.common.inputs import unreadable
from gyroid_cad.errors import ParameterError
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures
from gyroid_cad.render.facets import Facets, facets_of_shape, facets_of_triangles

__all__ = ["FileContents", "file_section", "read_contents"]


@dataclass(frozen=True, slots=True)
class FileContents:
    """A file that was read.

    Attributes
    ----------
    path : Path
    form : Format
    measures : dict
        Plain values.
    facets : Facets, optional
        None if there is nothing to be seen.
    shape : TopoDS_Shape, optional
        Of STEP and BREP files.
    triangles : tuple of ndarray, optional
        Vertices in mm and triangles of STL and 3MF files.
    """

    path: Path
    form: Format
    measures: dict[str, Any]
    facets: Facets | None
    shape: Any = None
    triangles: Any = None


def read_contents(path: str) -> FileContents:
    """Read a file and measure what it holds.

    Raises
    ------
    ParameterError
        If the ending is not known, or there is no such file.
    ExportError
        If it cannot be read.
    """
    target, form = Path(path), require_format("input file", path, PART_FORMATS)
    if reason := unreadable(path):
        raise ParameterError("input file", path, f"a file that exists and can be read: {reason}")
    return _triangles_of(target, form) if form in TRIANGLE_FORMATS else _shape_of(target, form)


def file_section(contents: FileContents) -> dict[str, Any]:
    """Section on the contents of a file."""
    return {
        "format": contents.form.name,
        "bytes": contents.path.stat().st_size,
        **contents.measures,
    }


def _shape_of(path: Path, form: Format) -> FileContents:
    from gyroid_cad.kernel.apart import read_shape
    from gyroid_cad.kernel.reading import described

    shape = read_shape(path)
    found = described(shape)
    extent = np.array(found.high) - np.array(found.low)
    measures = {
        "solids": found.topology.solids,
        "faces": found.topology.faces,
        "open_edges": found.topology.open_edges,
        "closed": found.topology.closed,
        "valid": found.valid,
        **_sizes(found.low, found.high, found.volume if found.topology.closed else None, found.area),
    }
    facets = facets_of_shape(shape) if found.topology.faces and extent.max() > 0 else None
    return FileContents(path, form, measures, facets, shape=shape)


def _triangles_of(path: Path, form: Format) -> FileContents:

    vertices, triangles = read_triangles(path)
    found = triangle_measures(vertices, triangles)
    measures = {
        "triangles": found.triangles,
        "vertices": found.vertices,
        "pieces": found.pieces,
        "open_edges": found.open_edges,
        "closed": found.closed,
        "manifold": found.manifold,
        **_sizes(found.low.tolist(), found.high.tolist(), found.volume if found.closed else None, found.area),
    }
    flat = found.area == 0
    facets = None if flat else facets_of_triangles(vertices, triangles, found.closed and found.volume > 0)
    return FileContents(path, form, measures, facets, triangles=(vertices, triangles))


def _sizes(low: Sequence[float], high: Sequence[float], volume: float | None, area: float) -> dict[str, Any]:
    extent = [b - a for a, b in zip(low, high, strict=True)]
    box = extent[0] * extent[1] * extent[2]
    sizes: dict[str, Any] = {"bounding_box_low": list(low), "bounding_box_high": list(high), "extent": extent}
    if volume is not None:
        sizes["volume"] = volume
        if box > 0:
            sizes["part_of_bounding_box"] = volume / box
    sizes["area"] = area
    if volume:
        sizes["area_per_volume"] = area / abs(volume)
    return sizes

"""Notebook view of a lattice or a filled part: a picture and a small table, which open offline.

IPython asks objects for ``_repr_mimebundle_`` (its documentation, *Integrating your objects with IPython*). The picture
stands in the HTML itself, for notebooks, and once more by itself, for what knows no HTML.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.errors import GyroidError
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import facets_of_shape, facets_of_triangles, facets_of_wall
from gyroid_cad.render.picture import Vector, data_uri, png
from gyroid_cad.wall.offset import Wall

if TYPE_CHECKING:
    from gyroid_cad.kernel.solid import KernelShape

__all__ = ["MimeBundle", "mime_bundle", "shape_picture", "triangles_picture", "wall_picture"]

# What IPython takes: the data by media type, and what is to be known of them.
MimeBundle = tuple[dict[str, Any], dict[str, Any]]

_CELL = 'style="text-align: left; padding: 0.1em 1.2em 0.1em 0"'


def wall_picture(wall: Wall, size: tuple[int, int], camera: Vector) -> bytes:
    """A wall of whole patches as a PNG file; no kernel is asked.

    Parameters
    ----------
    wall : Wall
    size : tuple of int
        Width and height in pixels.
    camera : tuple of float
        Direction to the viewer.
    """
    return png(draw([facets_of_wall(wall)], size, camera))


def shape_picture(shape: KernelShape, size: tuple[int, int], camera: Vector) -> bytes:
    """A shape of the kernel as a PNG file, by the triangles of its faces.

    Raises
    ------
    ExportError
        If a face has no triangles.
    """
    return png(draw([facets_of_shape(shape)], size, camera))


def triangles_picture(
    vertices: NDArray[np.floating], triangles: NDArray[np.integer], size: tuple[int, int], camera: Vector
) -> bytes:
    """Closed triangles as a PNG file; no kernel is asked.

    Parameters
    ----------
    vertices : ndarray, shape (vertices, 3)
        In mm.
    triangles : ndarray of int, shape (triangles, 3)
        Counterclockwise seen from outside.
    size : tuple of int
        Width and height in pixels.
    camera : tuple of float
        Direction to the viewer.
    """
    return png(draw([facets_of_triangles(vertices, triangles, closed=True)], size, camera))


def mime_bundle(title: str, rows: Callable[[], Sequence[tuple[str, str]]], picture: Callable[[], bytes]) -> MimeBundle:
    """A table and a picture, or why there is none.

    Parameters
    ----------
    title : str
    rows : callable
        Gives what is to be read, line by line.
    picture : callable
        Gives a PNG file.

    Returns
    -------
    tuple of (dict, dict)
        With "text/html" and, if there is a picture, "image/png".
    """
    data: dict[str, Any] = {}
    shown, lines = "", [("", title)]
    try:
        lines += rows()
        address = data_uri(picture())
        data["image/png"] = address.partition(",")[2]
        shown = f'<img alt="{escape(title)}" src="{address}">'
    except GyroidError as problem:
        # An object that cannot be shown is no reason for a traceback in place of it.
        lines.append(("not shown", str(problem)))
    table = "".join(f"<tr><th {_CELL}>{escape(a)}</th><td {_CELL}>{escape(b)}</td></tr>" for a, b in lines)
    data["text/html"] = f"<div>{shown}<table>{table}</table></div>"
    return data, {}

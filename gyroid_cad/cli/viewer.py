"""Lattices and files to look at: in a window, CadQuery's own, which is VTK's, or drawn into a PNG file without one."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.files import replacing
from gyroid_cad.common.formats import (
    BREP,
    PART_FORMATS,
    PNG,
    TRIANGLE_FORMATS,
    format_of,
    require_format,
    require_output,
)
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import GyroidError, ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_shape, facets_of_triangles, facets_of_wall
from gyroid_cad.render.picture import png

__all__ = ["has_display", "view"]

# Of pictures and windows, in pixels.
_SIZE = (1000, 800)
# Facets at a larger angle meet in an edge that is seen, in degrees.
_SHARP = 35.0
_LINE_COLOUR = (0.2, 0.18, 0.15)

Floats = NDArray[np.float64]


def view(
    what: Lattice | str | os.PathLike[str],
    picture: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> None:
    """Show a lattice, or what is in a file; returns when the window is closed, or the picture written.

    A lattice of whole patches is shown straight from the NURBS faces; no solid is built. Parts of a STEP file are
    meshed once, however often they occur.

    Parameters
    ----------
    what : Lattice or path-like
        A file's ending says what it is: .step, .stp, .brep, .stl or .3mf.
    picture : path-like, optional
        A .png file to draw into; no display is needed, and no window opened.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        Of names that will not do, and of triangles that cannot be read.
    GyroidError
        If there is no display for a window.
    ExportError
        If a file cannot be read, or the picture not be written.
    """
    if picture is not None:
        require_output(picture, (PNG,))
    if not isinstance(what, Lattice):
        _require_viewed(what)
    if picture is None:
        _require_display()
    shown = _of_lattice(what, progress) if isinstance(what, Lattice) else _of_file(Path(what))
    if not any(len(facets.corners) for facets in shown):
        raise GyroidError(f"{what} holds no face to be seen")
    if picture is None:
        _show(shown, f"{what.surface} lattice" if isinstance(what, Lattice) else Path(what).name)
        return
    image = png(draw(shown, _SIZE))
    with replacing(picture) as temporary:
        temporary.write_bytes(image)


def has_display() -> bool:
    """Tell whether a window could be opened: elsewhere than on Linux there always is a desktop."""
    if not sys.platform.startswith("linux"):
        return True
    try:
        x11 = ctypes.CDLL("libX11.so.6")
    except OSError:
        return False
    x11.XOpenDisplay.restype = ctypes.c_void_p
    display = x11.XOpenDisplay(None)
    if not display:
        return False
    x11.XCloseDisplay(ctypes.c_void_p(display))
    return True


def _require_viewed(path: str | os.PathLike[str]) -> None:
    require_format("file", path, PART_FORMATS, "a file ending in ")
    if not Path(path).is_file():
        raise ParameterError("file", str(path), "a file that exists")


def _require_display() -> None:
    if not has_display():
        shown = os.environ.get("DISPLAY")
        state = f"DISPLAY={shown} does not answer" if shown else "DISPLAY is not set"
        raise GyroidError(f"no display to open a window on: {state}; -o FILE.png draws without one")


def _of_lattice(lattice: Lattice, progress: Progress | None) -> list[Facets]:
    if lattice.trim:
        return [facets_of_shape(lattice.solid(progress))]
    return [facets_of_wall(lattice.fitted(progress).wall)]


def _of_file(path: Path) -> list[Facets]:
    if format_of(path) in TRIANGLE_FORMATS:
        # Nobody knows of strange triangles that they are closed and the right way round.
        return [facets_of_triangles(*read_triangles(path), closed=False)]
    if format_of(path) == BREP:
        from gyroid_cad.kernel.reading import read_shape

        return [facets_of_shape(read_shape(path))]
    from gyroid_cad.kernel.coloured import coloured_parts, extent_of

    parts = coloured_parts(path)
    extent = extent_of(parts)
    return [facets_of_shape(part.shape, part.colours, part.places, extent) for part in parts]


def _show(shown: Sequence[Facets], title: str) -> None:
    # What is made before this is there to draw it is never drawn.
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from cadquery.vis import show
    from vtkmodules.vtkRenderingCore import vtkAssembly

    whole = vtkAssembly()
    for one in shown:
        data = _poly_data(one)
        for mapper, colour in ((_faces(data), None), (_lines(data), _LINE_COLOUR)):
            for place in one.places:
                whole.AddPart(_actor(mapper, colour, place))
    width, height = _SIZE
    show(whole, title=title, width=width, height=height, gradient=False)


def _poly_data(facets: Facets) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(facets.corners.reshape(-1, 3), deep=True))  # type: ignore[no-untyped-call]
    corners = np.arange(3 * len(facets.corners), dtype=np.int64)
    cells.SetData(3, numpy_to_vtkIdTypeArray(corners, deep=True))  # type: ignore[no-untyped-call]
    data.SetPoints(points)
    data.SetPolys(cells)
    normals = numpy_to_vtk(facets.normals.reshape(-1, 3), deep=True)  # type: ignore[no-untyped-call]
    colours = np.round(255 * facets.colours).astype(np.uint8).reshape(-1, 3)
    data.GetPointData().SetNormals(normals)
    data.GetPointData().SetScalars(numpy_to_vtk(colours, deep=True))  # type: ignore[no-untyped-call]
    return data


def _faces(data: Any) -> Any:
    from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    return mapper


def _lines(data: Any) -> Any:
    """Edges of the surface, and where it is sharply bent."""
    from vtkmodules.vtkFiltersCore import vtkFeatureEdges, vtkStaticCleanPolyData
    from vtkmodules.vtkRenderingCore import vtkPolyDataMapper

    together, edges, mapper = vtkStaticCleanPolyData(), vtkFeatureEdges(), vtkPolyDataMapper()
    together.SetInputData(data)
    edges.SetInputConnection(together.GetOutputPort())
    edges.SetFeatureAngle(_SHARP)
    edges.NonManifoldEdgesOff()
    edges.ColoringOff()
    mapper.SetInputConnection(edges.GetOutputPort())
    mapper.ScalarVisibilityOff()
    return mapper


def _actor(mapper: Any, colour: tuple[float, float, float] | None, place: Floats) -> Any:
    from vtkmodules.vtkCommonMath import vtkMatrix4x4
    from vtkmodules.vtkRenderingCore import vtkActor

    actor, matrix = vtkActor(), vtkMatrix4x4()
    matrix.DeepCopy([*place.ravel().tolist(), 0, 0, 0, 1])
    actor.SetUserMatrix(matrix)
    actor.SetMapper(mapper)
    if colour is not None:
        actor.GetProperty().SetColor(*colour)
    return actor

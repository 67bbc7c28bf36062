"""Lattices and files in CadQuery's own viewer, which is VTK's: in a window, or off screen into a PNG file."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.files import replacing, require_writable
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import ExportError, GyroidError, ParameterError
from gyroid_cad.lattice import Lattice

__all__ = ["VIEWED_FORMATS", "can_draw_off_screen", "has_display", "view"]

VIEWED_FORMATS = (".step", ".stp", ".brep", ".stl")
SCREENSHOT_ENDING = ".png"
# In pixels.
_WINDOW = (1000, 800)
# Of triangles from what is shown, in parts of the diagonal of the box round it: a third of a pixel.
_FINENESS = 1 / 4000
_COLOUR = (0.87, 0.68, 0.32)
# Facets at a larger angle meet in an edge that is seen, in degrees.
_CREASE = 30.0
# The end of every PNG file.
_PNG_END = b"IEND\xaeB`\x82"
_TRIAL = """
import vtkmodules.vtkRenderingOpenGL2
from vtkmodules.vtkRenderingCore import vtkRenderer, vtkRenderWindow
window = vtkRenderWindow()
window.SetOffScreenRendering(1)
window.SetSize(8, 8)
window.AddRenderer(vtkRenderer())
window.Render()
"""


def view(
    what: Lattice | str | os.PathLike[str],
    screenshot: str | os.PathLike[str] | None = None,
    progress: Progress | None = None,
) -> None:
    """Show a lattice, or what is in a file, with ``cadquery.vis.show``; returns when the window is closed.

    A lattice of whole patches is shown by its triangles, straight from the NURBS faces; no solid is built.

    Parameters
    ----------
    what : Lattice or path-like
        A file's ending says what it is: .step, .stp, .brep or .stl.
    screenshot : path-like, optional
        A .png file to draw into, without a window.
    progress : callable, optional
        Called with (stage, done, total).

    Raises
    ------
    ParameterError
        Of names that will not do.
    GyroidError
        If there is no display for a window, or nothing to draw off screen with.
    ExportError
        If a file cannot be read, or the picture not be written.
    """
    if screenshot is not None:
        if Path(screenshot).suffix.lower() != SCREENSHOT_ENDING:
            raise ParameterError("screenshot", str(screenshot), f"a file name ending in {SCREENSHOT_ENDING}")
        require_writable(screenshot)
    showables: Callable[[], tuple[Sequence[Any], float]]
    if isinstance(what, Lattice):
        title, showables = f"{what.surface} lattice", lambda: _of_lattice(what, progress)
    else:
        path = require_viewed(what)
        title, showables = path.name, lambda: _of_file(path)
    _require_means(screenshot is not None)
    _show(*showables(), title, screenshot)


def require_viewed(path: str | os.PathLike[str]) -> Path:
    """Check that there is a file of a kind that can be shown.

    Raises
    ------
    ParameterError
    """
    given = Path(path)
    if given.suffix.lower() not in VIEWED_FORMATS:
        raise ParameterError("file", str(path), f"a file ending in {', '.join(VIEWED_FORMATS)}")
    if not given.is_file():
        raise ParameterError("file", str(path), "a file that exists")
    return given


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


def can_draw_off_screen() -> bool:
    """Tell whether VTK finds what it draws with, in a process of its own: where it finds nothing it ends it."""
    return has_display() or _succeeds(_TRIAL)


@lru_cache(maxsize=4)
def _succeeds(program: str) -> bool:
    """Tell whether a program runs to its end in a process of its own; it is tried once."""
    return subprocess.run([sys.executable, "-c", program], capture_output=True, check=False).returncode == 0


def _require_means(off_screen: bool) -> None:
    if off_screen and not can_draw_off_screen():
        raise GyroidError(
            "nothing to draw with: there is no display, and neither EGL nor OSMesa; "
            "on Debian or Ubuntu: apt-get install libegl1 libegl-mesa0"
        )
    if not off_screen and not has_display():
        shown = os.environ.get("DISPLAY")
        state = f"DISPLAY={shown} does not answer" if shown else "DISPLAY is not set"
        raise GyroidError(f"no display to open a window on: {state}; --screenshot FILE.png draws without one")


def _of_lattice(lattice: Lattice, progress: Progress | None) -> tuple[Sequence[Any], float]:
    low, high = lattice.bounding_box()
    tolerance = _FINENESS * float(np.linalg.norm(np.subtract(high, low)))
    if lattice.trim:
        import cadquery as cq

        return [cq.Assembly(cq.Shape.cast(lattice.solid(progress)), color=cq.Color(*_COLOUR))], tolerance
    from gyroid_cad.mesh.triangles.corners import indexed_triangles

    made = lattice.triangles(tolerance, progress)
    return [_actor(_poly_data(*indexed_triangles(made.triangulation)))], tolerance


def _of_file(path: Path) -> tuple[Sequence[Any], float]:
    if path.suffix.lower() == ".stl":
        return [_actor(_read_stl(path))], 1.0
    import cadquery as cq

    from gyroid_cad.kernel.brep import read_brep
    from gyroid_cad.kernel.coloured import coloured_shapes
    from gyroid_cad.kernel.split import compound_of
    from gyroid_cad.kernel.stl import diagonal

    shapes = [(read_brep(path), None)] if path.suffix.lower() == ".brep" else coloured_shapes(path)
    assembly = cq.Assembly()
    for shape, colour in shapes:
        assembly.add(cq.Shape.cast(shape), color=cq.Color(*(colour or _COLOUR)))
    return [assembly], _FINENESS * diagonal(compound_of(shape for shape, _ in shapes))


def _read_stl(path: Path) -> Any:
    from vtkmodules.vtkIOGeometry import vtkSTLReader

    reader = vtkSTLReader()
    reader.SetFileName(str(path))
    with _silent_vtk():
        reader.Update()
    data = reader.GetOutput()
    if not data.GetNumberOfCells():
        raise ExportError(f"{path} could not be read as STL")
    return data


def _poly_data(vertices: NDArray[np.float32], triangles: NDArray[np.int32]) -> Any:
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData

    points, cells, data = vtkPoints(), vtkCellArray(), vtkPolyData()
    points.SetData(numpy_to_vtk(np.ascontiguousarray(vertices), deep=True))  # type: ignore[no-untyped-call]
    offsets = np.arange(0, 3 * len(triangles) + 1, 3, dtype=np.int64)
    connectivity = np.ascontiguousarray(triangles.ravel(), dtype=np.int64)
    arrays = [numpy_to_vtkIdTypeArray(array, deep=True) for array in (offsets, connectivity)]  # type: ignore[no-untyped-call]
    cells.SetData(*arrays)
    data.SetPoints(points)
    data.SetPolys(cells)
    return data


def _actor(data: Any) -> Any:
    """Triangles in the lattice's colour, smooth but for creases."""
    # What is made before this is there to draw it is never drawn.
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401
    from vtkmodules.vtkFiltersCore import vtkPolyDataNormals
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    normals, mapper, actor = vtkPolyDataNormals(), vtkPolyDataMapper(), vtkActor()
    normals.SetInputData(data)
    normals.SetFeatureAngle(_CREASE)
    mapper.SetInputConnection(normals.GetOutputPort())
    actor.SetMapper(mapper)
    actor.GetProperty().SetColor(*_COLOUR)
    return actor


def _show(showables: Sequence[Any], tolerance: float, title: str, screenshot: str | os.PathLike[str] | None) -> None:
    from cadquery.vis import show

    width, height = _WINDOW
    look = {"tolerance": tolerance, "title": title, "width": width, "height": height, "gradient": False}
    if screenshot is None:
        show(*showables, **look)
        return
    with replacing(screenshot) as temporary, _silent_vtk():
        show(*showables, **look, screenshot=str(temporary), interact=False)
        if temporary.exists() and not temporary.read_bytes().endswith(_PNG_END):
            raise ExportError(f"{screenshot} was not written: the picture is cut short")


@contextmanager
def _silent_vtk() -> Iterator[None]:
    """Keep what VTK says of files and displays off the terminal: what is wrong is ours to tell, in one line."""
    from vtkmodules.vtkCommonCore import vtkLogger

    cutoff = vtkLogger.GetCurrentVerbosityCutoff()
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        yield
    finally:
        vtkLogger.SetStderrVerbosity(cutoff)

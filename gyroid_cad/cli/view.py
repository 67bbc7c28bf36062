"""``gyroid-cad view``: lattices and files in a window, CadQuery's own, or drawn into a PNG file without one."""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from gyroid_cad.cli.console import shown_progress
from gyroid_cad.cli.lattice_options import lattice_of, lattice_options_beside
from gyroid_cad.cli.options import file_paths
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
from gyroid_cad.common.inputs import unreadable
from gyroid_cad.common.memory import require_libraries
from gyroid_cad.common.progress import Progress
from gyroid_cad.errors import GyroidError, ParameterError
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.render.drawing import draw
from gyroid_cad.render.facets import Facets, facets_of_shape, facets_of_triangles, facets_of_wall
from gyroid_cad.render.picture import png

__all__ = ["has_display", "view", "view_command"]

# Of pictures and windows, in pixels.
_SIZE = (1000, 800)

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
        A file's ending says what it is: .step, .stp, .stpz, .step.gz, .stp.gz, .brep, .stl, .3mf, .obj or .ply.
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
    MissingHostError
        If there is no CadQuery for a window.
    ExportError
        If a file cannot be read, or the picture not be written.
    """
    if picture is not None:
        require_output(picture, (PNG,))
    if not isinstance(what, Lattice):
        _require_viewed(what)
    if picture is None:
        _require_display()
        # It loads CadQuery, and is refused before any work where that is missing.
        from gyroid_cad.cli.window import show_window
    shown = _of_lattice(what, progress) if isinstance(what, Lattice) else _of_file(Path(what))
    if not any(len(facets.corners) for facets in shown):
        raise GyroidError(f"{what} holds no face to be seen")
    if picture is None:
        show_window(shown, f"{what.surface} lattice" if isinstance(what, Lattice) else Path(what).name, _SIZE)
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
    if reason := unreadable(path):
        raise ParameterError("file", str(path), f"a file that exists and can be read: {reason}")


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
    from gyroid_cad.kernel.coloured import coloured_parts, diagonal_of

    parts = coloured_parts(path)
    extent = diagonal_of(parts)
    return [facets_of_shape(part.shape, part.colours, part.places, extent) for part in parts]


_TOML_ENDING = ".toml"


@click.command("view")
@lattice_options_beside("LATTICE.toml|FILE")
@click.option(
    "-o",
    "--output",
    "--screenshot",
    "screenshot",
    metavar="FILE.png",
    shell_complete=file_paths,
    help="Draw into a file instead of opening a window; no display is needed.",
)
@click.option("--quiet", is_flag=True, help="Show no progress.")
def view_command(screenshot: str | None, quiet: bool, **given: Any) -> None:
    """Show a lattice, or a file of a shape or of triangles, in CadQuery's viewer.

    The lattice is described as for "build", by options or in a TOML file; no solid is built unless it is trimmed.
    Files end in .step, .stp, .stpz, .step.gz, .stp.gz, .brep, .stl, .3mf, .obj or .ply.
    STEP files are shown in their own colours. In the window: drag to turn, wheel to zoom, q to leave.

    \b
    gyroid-cad view --cells 2 2 2 --cell-size 10 --thickness 0.8
    gyroid-cad view part.step
    gyroid-cad view lattice.toml -o lattice.png
    """

    require_libraries()
    file = given["config"]
    named = file is not None and not file.lower().endswith(_TOML_ENDING)
    what = file if named else lattice_of(given)
    with shown_progress(sys.stderr.isatty() and not quiet) as progress:
        view(what, screenshot, progress)

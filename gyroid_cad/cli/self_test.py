"""Self-test of an installation: one cell, built; written as STEP and STL and read; taken by the hosts."""

from __future__ import annotations

from pathlib import Path

from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
from gyroid_cad.kernel.compat import kernel_origin
from gyroid_cad.kernel.step import read_step
from gyroid_cad.lattice import Lattice
from gyroid_cad.mesh.triangles.files import read_triangles
from gyroid_cad.mesh.triangles.measures import triangle_measures

__all__ = ["TESTS"]

_CELL_SIZE, _THICKNESS = 10.0, 0.8
# The lattice's volume against the exact one's: what the fit of 10 x 10 control points is worth, and more than enough.
_VOLUME_AGREEMENT = 1e-5
# Of triangles, whose coordinates in STL are in single precision.
_TRIANGLES_AGREEMENT = 1e-3


def _lattice() -> Lattice:
    return Lattice((1, 1, 1), _CELL_SIZE, _THICKNESS)


def _kernel_loads(folder: Path) -> str:
    return kernel_origin()


def _cell_is_built(folder: Path) -> str:
    report = _lattice().report()
    error = report.volume / _lattice().exact_volume - 1
    _require(report.valid, "the kernel finds it invalid")
    _require(report.closed, "it is not closed")
    _require(abs(error) < _VOLUME_AGREEMENT, f"its volume is off by {error:.1e}")
    return f"{report.faces} faces, valid, closed, volume off by {error:+.1e}"


def _step_returns(folder: Path) -> str:

    lattice, path = _lattice(), folder / "cell.step"
    lattice.write(path)
    written, read = topology(lattice.solid()), read_step(path)
    found = topology(read)
    _require(found == written, f"it comes back as {found}, not {written}")
    _require(is_valid(read), "the kernel finds what comes back invalid")
    error = enclosed_volume(read) / lattice.exact_volume - 1
    _require(abs(error) < _VOLUME_AGREEMENT, f"its volume comes back off by {error:.1e}")
    return f"{path.stat().st_size:,} bytes; {found.faces} faces come back, valid, closed"


def _stl_is_closed(folder: Path) -> str:

    lattice, path = _lattice(), folder / "cell.stl"
    lattice.write(path, deviation=_CELL_SIZE / 200)
    found = triangle_measures(*read_triangles(path))
    error = found.volume / lattice.exact_volume - 1
    _require(found.closed, f"{found.open_edges} edges are open")
    _require(abs(error) < _TRIANGLES_AGREEMENT, f"its volume is off by {error:.1e}")
    return f"{found.triangles:,} triangles, closed, volume off by {error:+.1e}"


def _cadquery_takes_it(folder: Path) -> str:
    shape = _lattice().to_cadquery()
    return f"{shape.ShapeType()} of {len(shape.Faces())} faces"


def _build123d_takes_it(folder: Path) -> str:
    part = _lattice().to_build123d()
    return f"{type(part).__name__} of {len(part.faces())} faces"


def _require(contains: bool, problem: str) -> None:
    if not contains:
        raise RuntimeError(problem)


# By what is tested, in order; each gives what it found, or raises.
TESTS = {
    "kernel loads": _kernel_loads,
    "one cell is built": _cell_is_built,
    "STEP is written and read": _step_returns,
    "STL is written and closed": _stl_is_closed,
    "CadQuery takes the cell": _cadquery_takes_it,
    "build123d takes the cell": _build123d_takes_it,
}

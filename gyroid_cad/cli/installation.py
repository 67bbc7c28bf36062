"""Diagnosis of an installation: packages and their versions, kernel, programs, one cell built and read."""

from __future__ import annotations

import platform
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gyroid_cad.version import __version__

__all__ = ["OPTIONAL", "PROGRAMS", "REQUIRED", "Diagnosis", "Finding", "diagnose", "kernel_version"]

# Distributions that pyproject.toml asks for, and what those it does not ask for are good for.
REQUIRED = (
    "numpy",
    "scipy",
    "mpmath",
    "cadquery",
    "build123d",
    "click",
    "rich",
    "psutil",
    "tomli-w",
    "meshio",
    "lib3mf",
)
OPTIONAL = {
    "vtk": "measures the walls of STL and 3MF files in print-check",
    "matplotlib": "draws histograms: mesh --histogram",
    "mapdl-archive": "writes ANSYS .cdb files",
}
PROGRAMS = {"ccx": "CalculiX: solves the .inp files that mesh writes"}
# The kernel's Python wheels: with and without VTK.
_KERNELS = ("cadquery-ocp", "cadquery-ocp-novtk")
_CELL_SIZE, _THICKNESS = 10.0, 0.8
# The lattice's volume against the exact one's: what the fit of 10 x 10 control points is worth, and more than enough.
_VOLUME_AGREEMENT = 1e-5
# Of triangles, whose coordinates in STL are in single precision.
_TRIANGLES_AGREEMENT = 1e-3
GOOD, MISSING, FAILED = "good", "missing", "failed"


@dataclass(frozen=True, slots=True)
class Finding:
    """Finding about one package or program.

    Attributes
    ----------
    subject : str
    state : {"good", "missing", "failed"}
    detail : str
        Its version, what it is for, or what is wrong.
    required : bool
    seconds : float, optional
        That a test took.
    """

    subject: str
    state: str
    detail: str
    required: bool
    seconds: float | None = None


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """All that was found.

    Attributes
    ----------
    findings : tuple of Finding
    """

    findings: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Absence of anything required that is missing or fails."""
        return all(finding.state == GOOD for finding in self.findings if finding.required)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {"ok": self.ok, "findings": [asdict(finding) for finding in self.findings]}


def kernel_version() -> str:
    """The kernel's wheel and its version, without loading it; its first three numbers are OCCT's own."""
    for name in _KERNELS:
        if (found := _version(name)) is not None:
            return f"{name} {found} (OCCT {'.'.join(found.split('.')[:3])})"
    return "no kernel: cadquery-ocp is not installed"


def diagnose() -> Diagnosis:
    """Look for all that is required or of use, and build, write and read one cell.

    Returns
    -------
    Diagnosis
    """
    system = f"{platform.system()} {platform.machine()}"
    findings = [
        Finding("gyroid_cad", GOOD, __version__, True),
        Finding("Python", GOOD, f"{platform.python_version()}, {system}, {sys.executable}", True),
        Finding("kernel", GOOD if any(map(_version, _KERNELS)) else MISSING, kernel_version(), True),
    ]
    findings += [_package(name, True, "required: pip install gyroid_cad again") for name in REQUIRED]
    findings += [_package(name, False, purpose) for name, purpose in OPTIONAL.items()]
    findings += [_program(name, purpose) for name, purpose in PROGRAMS.items()]
    return Diagnosis((*findings, *_self_test()))


def _version(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _package(name: str, required: bool, purpose: str) -> Finding:
    found = _version(name)
    detail = purpose if found is None else found if required else f"{found}: {purpose}"
    return Finding(name, MISSING if found is None else GOOD, detail, required)


def _program(name: str, purpose: str) -> Finding:
    found = shutil.which(name)
    return Finding(name, MISSING if found is None else GOOD, f"{purpose}{'' if found is None else f', {found}'}", False)


def _self_test() -> Iterator[Finding]:
    """One cell: built; written as STEP and read; written as STL and read. What fails takes the rest with it."""
    tests: tuple[tuple[str, Callable[[Path], str]], ...] = (
        ("kernel loads", _kernel_loads),
        ("one cell is built", _cell_is_built),
        ("STEP is written and read", _step_returns),
        ("STL is written and closed", _stl_is_closed),
    )
    with TemporaryDirectory() as folder:
        for subject, test in tests:
            start = time.perf_counter()
            try:
                state, detail = GOOD, test(Path(folder))
            except Exception as problem:  # whatever it is, it is what is to be told
                state, detail = FAILED, " ".join(f"{type(problem).__name__}: {problem}".split())
            yield Finding(subject, state, detail, True, time.perf_counter() - start)


def _kernel_loads(folder: Path) -> str:
    from gyroid_cad.kernel.origin import kernel_origin

    return kernel_origin()


def _lattice() -> Any:
    from gyroid_cad.lattice import Lattice

    return Lattice((1, 1, 1), _CELL_SIZE, _THICKNESS)


def _cell_is_built(folder: Path) -> str:
    report = _lattice().report()
    error = report.volume / report.volume_exact - 1
    _require(report.valid, "the kernel finds it invalid")
    _require(report.closed, "it is not closed")
    _require(abs(error) < _VOLUME_AGREEMENT, f"its volume is off by {error:.1e}")
    return f"{report.faces} faces, valid, closed, volume off by {error:+.1e}"


def _step_returns(folder: Path) -> str:
    from gyroid_cad.kernel.check import enclosed_volume, is_valid, topology
    from gyroid_cad.kernel.step import read_step

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
    from gyroid_cad.mesh.triangles.files import read_triangles
    from gyroid_cad.mesh.triangles.measures import triangle_measures

    lattice, path = _lattice(), folder / "cell.stl"
    lattice.write(path, deviation=_CELL_SIZE / 200)
    found = triangle_measures(*read_triangles(path))
    error = found.volume / lattice.exact_volume - 1
    _require(found.closed, f"{found.open_edges} edges are open")
    _require(abs(error) < _TRIANGLES_AGREEMENT, f"its volume is off by {error:.1e}")
    return f"{found.triangles:,} triangles, closed, volume off by {error:+.1e}"


def _require(contains: bool, problem: str) -> None:
    if not contains:
        raise RuntimeError(problem)

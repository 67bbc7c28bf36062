"""Diagnosis of an installation: packages and their versions, kernel, programs, one cell built and read."""

from __future__ import annotations

import platform
import shutil
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from gyroid_cad.errors import MissingHostError
from gyroid_cad.version import __version__

__all__ = ["OPTIONAL", "PROGRAMS", "REQUIRED", "Diagnosis", "Finding", "diagnose", "kernel_version"]

# Distributions that pyproject.toml asks for, and what those it does not ask for are good for.
REQUIRED = (
    "numpy",
    "scipy",
    "mpmath",
    "click",
    "rich",
    "psutil",
    "tomli-w",
    "meshio",
    "lib3mf",
    "manifold3d",
)
OPTIONAL = {
    "cadquery": "adds Workplane.gyroid, and the window of view; needs OCP 7.9",
    "build123d": "has Gyroid and GyroidFill; 0.12 needs OCP 7.9, 0.13 OCP 8",
    "vtk": "tells inside from outside of parts, and measures walls in print-check",
    "matplotlib": "draws histograms: mesh --histogram",
    "mapdl-archive": "writes ANSYS .cdb files",
    "scikit-fem": "finds effective properties",
}
# How those are installed that are an extra of ours.
_REMEDIES = {
    "cadquery": MissingHostError("cadquery").remedy,
    "build123d": MissingHostError("build123d").remedy,
    "mapdl-archive": 'pip install "gyroid_cad[ansys]"',
    "scikit-fem": 'pip install "gyroid_cad[analysis]"',
}
PROGRAMS = {"ccx": "CalculiX: solves the .inp files that mesh writes"}
# The kernel's Python wheels: with and without VTK.
_KERNELS = ("cadquery-ocp", "cadquery-ocp-novtk")
# What is tested, and the package that it is about where that is one of those that need not be there.
_SUBJECTS = {
    "kernel loads": None,
    "one cell is built": None,
    "STEP is written and read": None,
    "STL is written and closed": None,
    "CadQuery takes the cell": "cadquery",
    "build123d takes the cell": "build123d",
}
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
        _kernel(),
    ]
    findings += [_package(name, True, "required", "pip install gyroid_cad again") for name in REQUIRED]
    findings += [
        _package(name, False, purpose, _REMEDIES.get(name, f"pip install {name}")) for name, purpose in OPTIONAL.items()
    ]
    findings += [_program(name, purpose) for name, purpose in PROGRAMS.items()]
    return Diagnosis((*findings, *_self_test()))


def _version(distribution: str) -> str | None:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None


def _kernel() -> Finding:
    """The kernel's wheels, which share one folder: of two versions, one lies over the other and neither works."""
    found = {name: told for name in _KERNELS if (told := _version(name)) is not None}
    if len(set(found.values())) > 1:
        both = " and ".join(f"{name} {told}" for name, told in found.items())
        remedy = "install into a new environment, with the host's extra: gyroid_cad[cadquery], [build123d] or [hosts]"
        return Finding("kernel", FAILED, f"{both}, one laid over the other: {remedy}", True)
    return Finding("kernel", GOOD if found else MISSING, kernel_version(), True)


def _package(name: str, required: bool, purpose: str, remedy: str) -> Finding:
    found = _version(name)
    if found is None:
        return Finding(name, MISSING, f"{purpose}: {remedy}", required)
    return Finding(name, GOOD, found if required else f"{found}: {purpose}", required)


def _program(name: str, purpose: str) -> Finding:
    found = shutil.which(name)
    return Finding(name, MISSING if found is None else GOOD, f"{purpose}{'' if found is None else f', {found}'}", False)


def _self_test() -> Iterator[Finding]:
    """One cell: built, written as STEP and STL and read, taken by the hosts that are installed."""
    with TemporaryDirectory() as folder:
        for subject, package in _SUBJECTS.items():
            if package is not None and _version(package) is None:
                continue
            start = time.perf_counter()
            try:
                # Whatever is not installed fails here as well.
                from gyroid_cad.cli.self_test import TESTS

                state, detail = GOOD, TESTS[subject](Path(folder))
            except Exception as problem:
                state, detail = FAILED, " ".join(f"{type(problem).__name__}: {problem}".split())
            yield Finding(subject, state, detail, True, time.perf_counter() - start)

"""Lattices and measurements that several files use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

import hypothesis
import pytest

from gyroid_cad.fit import FitSettings
from gyroid_cad.lattice import Lattice

CELL_SIZE = 10.0
THICKNESS = 0.8

# A slow machine is no reason to fail.
hypothesis.settings.register_profile("patient", deadline=None)
hypothesis.settings.load_profile("patient")

DiskFull = Callable[[int], AbstractContextManager[None]]


@pytest.fixture(scope="session")
def block() -> Lattice:
    """2 x 2 x 2 cells as a user would order them."""
    return Lattice((2, 2, 2), CELL_SIZE, THICKNESS)


@pytest.fixture(scope="session")
def cell() -> Lattice:
    """One cell of a coarse fit: quick, and as closed as a fine one."""
    return Lattice((1, 1, 1), CELL_SIZE, THICKNESS, fit=FitSettings(5))


@pytest.fixture(scope="session")
def kernel_volume() -> Callable[[Any], float]:
    """The volume of a shape as the kernel itself integrates it."""
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    def measure(shape: Any) -> float:
        properties = GProp_GProps()
        BRepGProp.VolumeProperties_s(shape, properties)
        return float(properties.Mass())

    return measure


@pytest.fixture
def disk_full() -> DiskFull:
    """A context in which no file of this process can grow past so many bytes, as on a full disk."""
    resource = pytest.importorskip("resource")

    @contextmanager
    def limited(size: int) -> Iterator[None]:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limited

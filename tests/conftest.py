"""Lattices and measurements that several files use."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any, Protocol

import hypothesis
import numpy as np
import pytest
from numpy.typing import NDArray

from gyroid_cad.lattice import Lattice
from gyroid_cad.nurbs.basis import basis, uniform_knots
from gyroid_cad.surface.fit import FitSettings
from gyroid_cad.trim.edge_crossings import PLANES, FacesToCut

CELL_SIZE = 10.0
THICKNESS = 0.8

# Tests start dozens of Pythons: where this is set, each would compile the project anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# A slow machine is no reason to fail.
hypothesis.settings.register_profile("patient", deadline=None)
hypothesis.settings.load_profile("patient")

Floats = NDArray[np.float64]
Height = Callable[[Floats, Floats], Floats]


class Graph(Protocol):
    """The face z = f(x, y) over [-1, 1]^2, exact for cubics, with levels of some planes by index.

    A weight 1 + lean (u + v / 2) makes it a quotient; then it is exact for quadratics.
    """

    def __call__(self, height: Height, levels: dict[int, float], lean: float = 0.0) -> FacesToCut: ...


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


@pytest.fixture(scope="session")
def graph() -> Graph:
    def face(height: Height, levels: dict[int, float], lean: float = 0.0) -> FacesToCut:
        knots = uniform_knots(7)
        at = np.array([knots[k + 1 : k + 4].mean() for k in range(7)])
        u, v = np.meshgrid(at, at, indexing="ij")
        weight = 1 + lean * (u + v / 2)
        values = np.stack([u * weight, v * weight, height(u, v) * weight, weight], axis=-1)
        inverse = np.linalg.inv(basis(knots, 3, at))
        control = np.einsum("ia,jb,abk->ijk", inverse, inverse, values)
        near = np.array([[levels.get(plane, np.nan) for plane in range(len(PLANES))]])
        return FacesToCut((control[..., :3] / control[..., 3:])[np.newaxis], control[..., 3], knots, near)

    return face


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

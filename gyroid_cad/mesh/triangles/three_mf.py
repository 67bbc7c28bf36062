"""Triangles as 3MF, by the 3MF Consortium's own library, lib3mf."""

from __future__ import annotations

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from io import BytesIO
from typing import Any
from uuid import NAMESPACE_OID, uuid5

import numpy as np
from numpy.typing import NDArray

from gyroid_cad.common.files import replacing
from gyroid_cad.errors import ExportError

__all__ = ["write_3mf"]

# Of coordinates, so that single precision survives being written in decimals.
_DECIMALS = 9


def write_3mf(vertices: NDArray[np.float32], triangles: NDArray[np.int32], path: str | os.PathLike[str]) -> None:
    """Write one mesh as 3MF (core specification 1.3), in millimetres.

    The whole mesh, the library's copy of it and its text are in memory at once, about 350 bytes a triangle: for
    lattices of many millions of triangles STL, which is streamed, is the better file.

    Parameters
    ----------
    vertices : ndarray of float32, shape (vertices, 3)
        In mm.
    triangles : ndarray of int32, shape (triangles, 3)
        Numbers of vertices, counterclockwise seen from outside.
    path : path-like

    Raises
    ------
    ExportError
        If the library finds the mesh not closed or not oriented, or the file could not be written.
    """
    import lib3mf

    wrapper = lib3mf.get_wrapper()
    model = wrapper.CreateModel()
    model.SetUnit(lib3mf.ModelUnit.MilliMeter)
    mesh = model.AddMeshObject()
    mesh.SetName("gyroid_cad")
    places = np.array(vertices, dtype="<f4", order="C")
    numbers = np.array(triangles, dtype="<u4", order="C")
    corners = (lib3mf.Position * len(vertices)).from_buffer(places)
    facets = (lib3mf.Triangle * len(triangles)).from_buffer(numbers)
    try:
        mesh.SetGeometry(corners, facets)
        if not mesh.IsManifoldAndOriented():
            raise ExportError(f"{path} was not written: its triangles are not closed and oriented")
        item = model.AddBuildItem(mesh, wrapper.GetIdentityTransform())
        # The library draws lots for them; so the same mesh makes the same file.
        content = sha256(places.tobytes())
        content.update(numbers.tobytes())
        for name, set_identity in (("object", mesh.SetUUID), ("item", item.SetUUID), ("build", model.SetBuildUUID)):
            set_identity(str(uuid5(NAMESPACE_OID, f"{name} {content.hexdigest()}")))
        writer = model.QueryWriter("3mf")
        writer.SetDecimalPrecision(_DECIMALS)
        package = _written(writer)
    except lib3mf.ELib3MFException as problem:
        raise ExportError(f"{path} was not written: lib3mf says {problem}") from problem
    with replacing(path) as temporary:
        temporary.write_bytes(package)


def _written(writer: Any) -> memoryview:
    """Bytes that a writer of lib3mf writes: into memory, for to a file on a full disk it ends the whole process."""
    import lib3mf

    package = BytesIO()
    problems: list[BaseException] = []

    @contextmanager
    def told_later() -> Iterator[None]:
        # Nothing passes through the library: an interrupt, or memory that gives out, would be lost in it.
        try:
            yield
        except BaseException as problem:
            problems.append(problem)

    def write(address: int, count: int, _: object) -> None:
        with told_later():
            package.write(ctypes.string_at(address, count))

    def seek(position: int, _: object) -> None:
        with told_later():
            package.seek(position)

    writer.WriteToCallback(lib3mf.WriteCallback(write), lib3mf.SeekCallback(seek), None)
    if problems:
        raise problems[0]
    return package.getbuffer()

"""Names and modules of before: in this version they go on working, with a warning that says where they are now."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from importlib import import_module
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, NamedTuple, TextIO

__all__ = ["FORMER_MODULES", "METHODS", "FormerModules", "Moved", "former_name", "place_in"]


class Moved(NamedTuple):
    """Place where a name is now.

    Attributes
    ----------
    home : str
        Module and name.
    instead : str
        What to write instead, if that is not the home.
    """

    home: str
    instead: str = ""


# Functions of before, below, and the methods that take their place.
METHODS: Mapping[str, str] = {
    "write_mesh": "the method write of gyroid_cad.Mesh",
    "write_mfem_field": "the method write_field of gyroid_cad.VolumePatches",
    "write_periodic_equations": "the method write of what Lattice.periodic_pairs gives",
    "write_volumes": "the method write of gyroid_cad.VolumePatches",
}
# Modules of before and those that have their names now; only such as the documentation has shown.
FORMER_MODULES: Mapping[str, tuple[str, ...]] = {
    f"gyroid_cad.{former}": tuple(f"gyroid_cad.{module}" for module in modules.split())
    for former, modules in {
        "block_maps": "maps",
        "bounding_cells": "surface.symmetry",
        "complex": "wall.complex",
        "exact_wall": "wall.exact",
        "families": "surface.families",
        "field_makers": "fields",
        "fit": "surface.fit surface.fit_report",
        "fit_settings": "surface.fit",
        "mesh.abaqus": "mesh.finite_elements.abaqus former",
        "mesh.hexahedra": "mesh.finite_elements.hexahedra",
        "mesh.mesh_files": "mesh.finite_elements.files former",
        "mesh.periodic": "mesh.finite_elements.periodic",
        "mesh.quality": "mesh.finite_elements.quality",
        "mesh.summaries": "mesh.finite_elements.summaries",
        "mesh.volume_files": "mesh.iga.files former",
        "mesh.volumes": "mesh.iga.patches",
        "meshing": "builds.meshes",
        "patch": "surface.patch",
        "printers": "printing.printers",
        "symmetry": "surface.symmetry",
        "triangles": "builds.triangles",
        "tube": "surface.families",
        "weierstrass": "surface.weierstrass",
    }.items()
}


def write_mesh(mesh: Any, path: object, pairs: object = None, progress: object = None) -> None:
    """Write one file of a mesh, as was done before a mesh wrote itself."""
    mesh.write(path, pairs=pairs, progress=progress)


def write_volumes(volumes: Any, path: object) -> None:
    """Write one file of trivariate patches, as was done before they wrote themselves."""
    volumes.write(path)


def write_mfem_field(volumes: Any, values: object, path: object) -> None:
    """Write one file of a field on trivariate patches, as was done before they wrote it."""
    volumes.write_field(values, path)


def write_periodic_equations(pairs: Any, file: TextIO, reference: int) -> None:
    """Write equations to a file that is open, as was done before periodic pairs wrote themselves."""
    file.writelines(pairs.equations(reference))


def former_name(module: str, name: str, place: Moved | None) -> Any:
    """Return what a module had under a name, and warn the one who asked its ``__getattr__`` for it.

    Parameters
    ----------
    module, name : str
    place : Moved or None
        Where it is now; None if the module never had it.

    Raises
    ------
    AttributeError
    """
    if place is None:
        raise AttributeError(f"module {module!r} has no attribute {name!r}")
    warnings.warn(
        f"{module}.{name} is now {place.instead or place.home}; the old name goes with this version",
        DeprecationWarning,
        stacklevel=3,
    )
    where, _, what = place.home.rpartition(".")
    return getattr(import_module(where), what)


def place_in(homes: Iterable[str], name: str) -> Moved | None:
    """Return the place of a name that one of some modules has now."""
    if name.startswith("_"):
        return None
    having = (home for home in homes if hasattr(import_module(home), name))
    return next((Moved(f"{home}.{name}", METHODS.get(name, "")) for home in having), None)


class FormerModules:
    """Finds modules of before, when nobody else does: each hands out the names of the new ones."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """Answer the import system."""
        return ModuleSpec(name, self) if name in FORMER_MODULES else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave it to the import system to make a module."""

    def exec_module(self, module: ModuleType) -> None:
        """Give a module the names of those that took its place."""
        own, homes = module.__name__, FORMER_MODULES[module.__name__]
        module.__getattr__ = lambda name: former_name(own, name, place_in(homes, name))  # type: ignore[method-assign]

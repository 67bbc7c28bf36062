"""The gyroid as exact-grade B-rep solids.

Names are loaded when first used, so that ``import gyroid_cad`` costs next to nothing and loads neither
the CAD kernel nor CadQuery nor build123d. Maps of space are in :mod:`gyroid_cad.maps`, the makers of fields in
:mod:`gyroid_cad.fields`: none of the names here is one of the hosts' too.

>>> from gyroid_cad import Lattice
>>> round(Lattice(cells=(2, 2, 2), cell_size=10, thickness=0.8).volume_fraction, 5)
0.24517
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

from gyroid_cad.former import METHODS, FormerModules, Moved, former_name
from gyroid_cad.version import __version__

if TYPE_CHECKING:
    from gyroid_cad.builds.file_check import FileCheck, check_file
    from gyroid_cad.builds.meshes import mesh_quality
    from gyroid_cad.errors import (
        ExportError,
        FitError,
        GyroidError,
        IslandsWarning,
        KernelError,
        ParameterError,
        PartWarning,
        SelfIntersectionError,
    )
    from gyroid_cad.fields.field import Field
    from gyroid_cad.filling.fill import fill
    from gyroid_cad.filling.filled import Filled
    from gyroid_cad.filling.report import FillReport
    from gyroid_cad.filling.triangles import FilledTriangles
    from gyroid_cad.lattice import Lattice, LatticeReport
    from gyroid_cad.mesh.finite_elements.hexahedra import Mesh
    from gyroid_cad.mesh.iga.patches import VolumePatches
    from gyroid_cad.printing.print_check import print_check
    from gyroid_cad.printing.printers import Printer
    from gyroid_cad.printing.verdict import PrintCheck
    from gyroid_cad.surface.fit import FitSettings
    from gyroid_cad.wall.laws import Design, design

__all__ = [
    "Design",
    "ExportError",
    "Field",
    "FileCheck",
    "FillReport",
    "Filled",
    "FilledTriangles",
    "FitError",
    "FitSettings",
    "GyroidError",
    "IslandsWarning",
    "KernelError",
    "Lattice",
    "LatticeReport",
    "Mesh",
    "ParameterError",
    "PartWarning",
    "PrintCheck",
    "Printer",
    "SelfIntersectionError",
    "VolumePatches",
    "__version__",
    "check_file",
    "design",
    "fill",
    "mesh_quality",
    "print_check",
]

_HOMES = {
    "builds.file_check": ("FileCheck", "check_file"),
    "builds.meshes": ("mesh_quality",),
    "errors": (
        "ExportError",
        "FitError",
        "GyroidError",
        "IslandsWarning",
        "KernelError",
        "ParameterError",
        "PartWarning",
        "SelfIntersectionError",
    ),
    "fields.field": ("Field",),
    "filling.fill": ("fill",),
    "filling.filled": ("Filled",),
    "filling.report": ("FillReport",),
    "filling.triangles": ("FilledTriangles",),
    "lattice": ("Lattice", "LatticeReport"),
    "mesh.finite_elements.hexahedra": ("Mesh",),
    "mesh.iga.patches": ("VolumePatches",),
    "printing.print_check": ("print_check",),
    "printing.printers": ("Printer",),
    "printing.verdict": ("PrintCheck",),
    "surface.fit": ("FitSettings",),
    "wall.laws": ("Design", "design"),
}
_MOVED = {
    "builds.assembly": ("Assembly", "AssemblyReport"),
    "builds.triangles": ("TriangleReport",),
    "fields": (
        "between_planes",
        "constant",
        "distance_from_axis",
        "distance_from_point",
        "expression",
        "linear",
        "radial",
        "sampled",
        "smooth_maximum",
        "smooth_minimum",
    ),
    "maps": ("Bend", "Cylinder", "SpaceMap", "Sphere", "Twist"),
    "nurbs.surface": ("NurbsSurface",),
    "surface.fit": ("fit_patch",),
    "surface.fit_report": ("FitReport", "fit_report"),
}
_PLACES = {
    **{name: Moved(f"gyroid_cad.{module}.{name}") for module, names in _MOVED.items() for name in names},
    **{name: Moved(f"gyroid_cad.former.{name}", method) for name, method in METHODS.items()},
    "SoundnessError": Moved("gyroid_cad.errors.SelfIntersectionError", "gyroid_cad.SelfIntersectionError"),
}
if not any(isinstance(finder, FormerModules) for finder in sys.meta_path):
    sys.meta_path.append(FormerModules())


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"gyroid_cad.{module}"), name)
    return former_name(__name__, name, _PLACES.get(name))


def __dir__() -> list[str]:
    return sorted(__all__)

"""The gyroid as exact-grade B-rep solids.

Names are loaded when first used, so that ``import gyroid_cad`` costs next to nothing and loads neither
the CAD kernel nor CadQuery nor build123d.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gyroid_cad.version import __version__

if TYPE_CHECKING:
    from gyroid_cad.builds.assembly import Assembly, AssemblyReport
    from gyroid_cad.builds.meshes import mesh_quality
    from gyroid_cad.builds.triangles import TriangleReport
    from gyroid_cad.errors import ExportError, FitError, GyroidError, KernelError, ParameterError, SelfIntersectionError
    from gyroid_cad.fields.field import Field
    from gyroid_cad.fields.makers import (
        between_planes,
        constant,
        distance_from_axis,
        distance_from_point,
        expression,
        linear,
        radial,
        sampled,
        smooth_maximum,
        smooth_minimum,
    )
    from gyroid_cad.filling.fill import Filled, FillReport, fill
    from gyroid_cad.lattice import Lattice, LatticeReport
    from gyroid_cad.maps.block import Bend, Cylinder, Sphere, Twist
    from gyroid_cad.maps.space import SpaceMap
    from gyroid_cad.mesh.finite_elements.abaqus import write_periodic_equations
    from gyroid_cad.mesh.finite_elements.files import write_mesh
    from gyroid_cad.mesh.finite_elements.hexahedra import Mesh
    from gyroid_cad.mesh.iga.files import write_volumes
    from gyroid_cad.mesh.iga.patches import VolumePatches
    from gyroid_cad.nurbs.surface import NurbsSurface
    from gyroid_cad.printing.print_check import PrintCheck, print_check
    from gyroid_cad.printing.printers import Printer
    from gyroid_cad.surface.fit import FitSettings, fit_patch
    from gyroid_cad.surface.fit_report import FitReport, fit_report

__all__ = [
    "Assembly",
    "AssemblyReport",
    "Bend",
    "Cylinder",
    "ExportError",
    "Field",
    "FillReport",
    "Filled",
    "FitError",
    "FitReport",
    "FitSettings",
    "GyroidError",
    "KernelError",
    "Lattice",
    "LatticeReport",
    "Mesh",
    "NurbsSurface",
    "ParameterError",
    "PrintCheck",
    "Printer",
    "SelfIntersectionError",
    "SpaceMap",
    "Sphere",
    "TriangleReport",
    "Twist",
    "VolumePatches",
    "__version__",
    "between_planes",
    "constant",
    "distance_from_axis",
    "distance_from_point",
    "expression",
    "fill",
    "fit_patch",
    "fit_report",
    "linear",
    "mesh_quality",
    "print_check",
    "radial",
    "sampled",
    "smooth_maximum",
    "smooth_minimum",
    "write_mesh",
    "write_periodic_equations",
    "write_volumes",
]

_HOMES = {
    "builds.assembly": ("Assembly", "AssemblyReport"),
    "maps.block": ("Bend", "Cylinder", "Sphere", "Twist"),
    "errors": ("ExportError", "FitError", "GyroidError", "KernelError", "ParameterError", "SelfIntersectionError"),
    "fields.field": ("Field",),
    "fields.makers": (
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
    "filling.fill": ("FillReport", "Filled", "fill"),
    "surface.fit": ("FitSettings", "fit_patch"),
    "surface.fit_report": ("FitReport", "fit_report"),
    "lattice": ("Lattice", "LatticeReport"),
    "maps.space": ("SpaceMap",),
    "mesh.finite_elements.abaqus": ("write_periodic_equations",),
    "mesh.finite_elements.hexahedra": ("Mesh",),
    "mesh.finite_elements.files": ("write_mesh",),
    "mesh.iga.files": ("write_volumes",),
    "mesh.iga.patches": ("VolumePatches",),
    "builds.meshes": ("mesh_quality",),
    "nurbs.surface": ("NurbsSurface",),
    "printing.print_check": ("PrintCheck", "print_check"),
    "printing.printers": ("Printer",),
    "builds.triangles": ("TriangleReport",),
}


def __getattr__(name: str) -> object:
    from importlib import import_module

    for module, names in _HOMES.items():
        if name in names:
            return getattr(import_module(f"gyroid_cad.{module}"), name)
    raise AttributeError(f"module 'gyroid_cad' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
